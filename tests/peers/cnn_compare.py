# SPDX-License-Identifier: Apache-2.0
"""The learned baselines of the program beside the same networks in PyTorch, on the same weights.

Compared are a network's outputs, normalised as it puts them out: the program's estimates (of the
ensemble with their standard deviations) are encoded again by what the file's metadata say. Weights
go from the program to PyTorch and back.
"""
import argparse
import csv
import json
import math
import os
import subprocess
import sys
import tempfile

import numpy as np
import torch

EQUAL = 1e-5  # of outputs that span -1 to 1
SCENE = "scenes/tmf8828_wall.json"


class Published(torch.nn.Module):
    """The published network of docs/cnn.md."""

    def __init__(self, zones, bins, outputs):
        super().__init__()
        self.conv1 = torch.nn.Conv1d(zones, 4, 3)
        self.norm1 = torch.nn.BatchNorm1d(4)
        self.conv2 = torch.nn.Conv1d(4, 8, 3)
        self.norm2 = torch.nn.BatchNorm1d(8)
        self.dropout = torch.nn.Dropout(0.5)
        self.hidden = torch.nn.Linear(8 * (bins - 4) + 3, 16)
        self.output = torch.nn.Linear(16, outputs)

    def forward(self, histograms, sensors):
        x = torch.relu(self.norm1(self.conv1(histograms)))
        x = torch.relu(self.dropout(self.norm2(self.conv2(x))))
        x = torch.cat([x.flatten(1), sensors], 1)
        return self.output(torch.relu(self.hidden(x)))


class Member(torch.nn.Module):
    """One network of the ensemble: means, and logarithms of variances."""

    def __init__(self, zones, bins, outputs):
        super().__init__()
        self.outputs = outputs
        self.conv1 = torch.nn.Conv1d(zones, 32, 5, stride=2)
        self.norm1 = torch.nn.BatchNorm1d(32)
        self.conv2 = torch.nn.Conv1d(32, 48, 5, stride=2)
        self.norm2 = torch.nn.BatchNorm1d(48)
        steps = ((bins - 5) // 2 + 1 - 5) // 2 + 1
        self.hidden = torch.nn.Linear(48 * steps + 3, 64)
        self.output = torch.nn.Linear(64, 2 * outputs)

    def forward(self, histograms, sensors):
        x = torch.relu(self.norm1(self.conv1(histograms)))
        x = torch.relu(self.norm2(self.conv2(x)))
        x = torch.cat([x.flatten(1), sensors], 1)
        x = self.output(torch.relu(self.hidden(x)))
        return x[:, : self.outputs], x[:, self.outputs :].clamp(-14, 4)


class Wide(torch.nn.Module):
    """The ensemble: mean and covariance of the members' mixture."""

    def __init__(self, zones, bins, outputs):
        super().__init__()
        for number in range(5):
            self.add_module(f"member{number}", Member(zones, bins, outputs))

    def forward(self, histograms, sensors):
        said = [member(histograms, sensors) for member in self.children()]
        means = torch.stack([mean for mean, _ in said]).double()
        variances = torch.stack([log_variance.double().exp() for _, log_variance in said])
        mean = means.mean(0)
        covariance = torch.einsum("mci,mcj->cij", means, means) / len(said)
        covariance += torch.diag_embed(variances.mean(0)) - torch.einsum("ci,cj->cij", mean, mean)
        return mean, covariance


NETWORKS = {"published": Published, "wide": Wide}


def load(path):
    """Metadata and state of a file of weights, by torch.load's own default: no code is run."""
    state = dict(torch.load(path))
    return json.loads(state.pop("metadata")), state


def outputs_of(meta):
    return sum(2 if "period" in unknown else 1 for unknown in meta["unknowns"])


def new_network(meta):
    return NETWORKS[meta["network"]](meta["zones"], meta["bins"], outputs_of(meta))


def yaw_of(pose):
    w, x, y, z = pose["quaternion_wxyz"]
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def bounded(meta, values):
    """Standardised values, clipped as the file says; 0: they are not."""
    bound = meta["input_bound"]
    return np.clip(values, -bound, bound) if bound > 0 else values


def inputs_of(meta, archive):
    """Histograms [captures, zones, bins] and sensor poses [captures, 3] of an exported data set."""
    data = np.load(archive)
    counts = data["counts"].astype(np.float64)
    captures = json.loads(str(data["metadata_json"]))["captures"]
    histograms = counts / counts.sum(axis=(1, 2), keepdims=True) * meta["input_scale"]
    if "input_mean" in meta:
        mean, deviation = np.array(meta["input_mean"]), np.array(meta["input_deviation"])
        histograms = bounded(
            meta, (histograms - mean.reshape(counts.shape[1:])) / deviation.reshape(counts.shape[1:]))
    poses = np.array([[*c["sensor_pose"]["position_m"][:2], yaw_of(c["sensor_pose"])] for c in captures])
    sensors = bounded(meta, (poses - meta["sensor_pose"]["center"]) / meta["sensor_pose"]["scale"])
    return torch.tensor(histograms, dtype=torch.float32), torch.tensor(sensors, dtype=torch.float32)


def scale_of(unknown):
    """Of an unknown in one of its output: half its range; of a whole turn, of the angle."""
    if "period" in unknown:
        return unknown["period"] / (2 * math.pi)
    return (unknown["upper"] - unknown["lower"]) / 2


def encoded(meta, row):
    """Outputs that stand for an estimate; of a whole turn the angle of cosine and sine."""
    values = []
    for unknown in meta["unknowns"]:
        value = float(row[unknown["name"] + "_estimate"]) / scale_of(unknown)
        values.append(value if "period" in unknown else value - unknown["lower"] / scale_of(unknown) - 1)
    return values


def comparable(meta, outputs):
    """The same of the network's outputs; the program's answers stay within the ranges."""
    columns, at = [], 0
    for unknown in meta["unknowns"]:
        if "period" in unknown:
            columns.append(np.arctan2(outputs[:, at + 1], outputs[:, at]))
            at += 2
        else:
            columns.append(np.clip(outputs[:, at], -1, 1))
            at += 1
    return np.stack(columns, axis=1)


def comparable_deviations(meta, mean, covariance):
    """Standard deviations of the same, of an angle to first order, at most those of the range."""
    columns, at = [], 0
    for unknown in meta["unknowns"]:
        if "period" in unknown:
            slope = np.stack([-mean[:, at + 1], mean[:, at]], axis=1)
            slope /= np.maximum((mean[:, at : at + 2] ** 2).sum(1, keepdims=True), 1e-6)
            variance = np.einsum("ci,cij,cj->c", slope, covariance[:, at : at + 2, at : at + 2], slope)
            at += 2
        else:
            variance = covariance[:, at, at]
            at += 1
        most = (unknown["upper"] - unknown["lower"]) / math.sqrt(12) / scale_of(unknown)
        columns.append(np.minimum(np.sqrt(variance), most))
    return np.stack(columns, axis=1)


def largest_difference(program, folder, data, weights):
    meta, state = load(weights)
    network = new_network(meta)
    network.load_state_dict(state)
    network.eval()
    subprocess.run([program, "cnn", "evaluate", SCENE, weights, data, "-o", folder + "/evaluation"],
                   check=True, stdout=subprocess.DEVNULL)
    with open(folder + "/evaluation/estimates.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    with torch.no_grad():
        said = network(*inputs_of(meta, folder + "/data.npz"))
    mean = (said[0] if meta["network"] == "wide" else said).numpy()
    apart = np.array([encoded(meta, row) for row in rows]) - comparable(meta, mean)
    for column, unknown in enumerate(meta["unknowns"]):
        if "period" in unknown:
            apart[:, column] = np.remainder(apart[:, column] + math.pi, 2 * math.pi) - math.pi
    largest = np.abs(apart).max()
    if meta["network"] == "wide":
        own = np.array([[float(row[u["name"] + "_sigma"]) / scale_of(u) for u in meta["unknowns"]]
                        for row in rows])
        deviations = comparable_deviations(meta, mean, said[1].numpy())
        largest = max(largest, np.abs(own - deviations).max())
    return largest, len(rows)


def compare(program, folder, name, epochs):
    """Trains a network of that name; the largest difference in either direction."""
    data = folder + "/data"
    run = lambda *arguments: subprocess.run([program, *arguments], check=True, stdout=subprocess.DEVNULL)
    if not os.path.exists(data):
        run("cnn", "dataset", SCENE, "--objects", "100", "-o", data)
        run("export", data + "/captures.exr", "-o", folder + "/data.npz")
    run("cnn", "train", SCENE, data, "--network", name, "--epochs", str(epochs), "-o", folder + "/" + name)
    weights = f"{folder}/{name}/weights.pt"
    trained, count = largest_difference(program, folder, data, weights)
    # Other weights under the same metadata, written by PyTorch.
    meta, _ = load(weights)
    torch.manual_seed(1)
    back = folder + "/torch.pt"
    torch.save({"metadata": json.dumps(meta), **dict(new_network(meta).state_dict())}, back)
    written, _ = largest_difference(program, folder, data, back)
    print(f"{name} network, format {meta['format']}, torch {torch.__version__}, {count} captures, "
          "largest difference of an output:")
    print(f"  weights of the program, read by PyTorch: {trained:.2e}")
    print(f"  weights of PyTorch, read by the program: {written:.2e}")
    return max(trained, written)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", required=True)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        program = os.path.abspath(arguments.program)
        largest = [compare(program, folder, "published", 30), compare(program, folder, "wide", 5)]
    sys.exit(0 if all(value <= EQUAL for value in largest) else 1)  # not a number is a failure


if __name__ == "__main__":
    main()
