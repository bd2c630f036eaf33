# SPDX-License-Identifier: Apache-2.0
"""The learned baseline of the program beside the same network in PyTorch, on the same weights.

Compared are the network's outputs, normalised as it puts them out: the program's estimates are
encoded again by what the file's metadata say. Weights go from the program to PyTorch and back.
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
    """The network of docs/cnn.md."""

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


def load(path):
    """Metadata and state of a file of weights."""
    # libtorch tags the dict with its type, which the default (weights only) of torch 2.6 and later refuses.
    state = dict(torch.load(path, weights_only=False))
    return json.loads(state.pop("metadata")), state


def outputs_of(meta):
    return sum(2 if "period" in unknown else 1 for unknown in meta["unknowns"])


def network_of(meta, state):
    network = Published(meta["zones"], meta["bins"], outputs_of(meta))
    network.load_state_dict(state)
    return network.eval()


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


def encoded(meta, row):
    """Outputs that stand for an estimate; of a whole turn the angle of cosine and sine."""
    values = []
    for unknown in meta["unknowns"]:
        value = float(row[unknown["name"] + "_estimate"])
        if "period" in unknown:
            values.append(2 * math.pi * value / unknown["period"])
        else:
            values.append(2 * (value - unknown["lower"]) / (unknown["upper"] - unknown["lower"]) - 1)
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


def largest_difference(program, folder, data, weights):
    meta, state = load(weights)
    subprocess.run([program, "cnn", "evaluate", SCENE, weights, data, "-o", folder + "/evaluation"],
                   check=True, stdout=subprocess.DEVNULL)
    with open(folder + "/evaluation/estimates.csv", newline="") as file:
        own = np.array([encoded(meta, row) for row in csv.DictReader(file)])
    with torch.no_grad():
        peer = network_of(meta, state)(*inputs_of(meta, folder + "/data.npz")).numpy()
    apart = own - comparable(meta, peer)
    for column, unknown in enumerate(meta["unknowns"]):
        if "period" in unknown:
            apart[:, column] = np.remainder(apart[:, column] + math.pi, 2 * math.pi) - math.pi
    return np.abs(apart).max(), len(own)


def compare(program, folder):
    data = folder + "/data"
    run = lambda *arguments: subprocess.run([program, *arguments], check=True, stdout=subprocess.DEVNULL)
    run("cnn", "dataset", SCENE, "--objects", "100", "-o", data)
    run("cnn", "train", SCENE, data, "--epochs", "30", "-o", folder + "/net")
    run("export", data + "/captures.exr", "-o", folder + "/data.npz")
    weights = folder + "/net/weights.pt"
    trained, count = largest_difference(program, folder, data, weights)
    # Other weights under the same metadata, written by PyTorch.
    meta, _ = load(weights)
    torch.manual_seed(1)
    other = Published(meta["zones"], meta["bins"], outputs_of(meta))
    back = folder + "/torch.pt"
    torch.save({"metadata": json.dumps(meta), **dict(other.state_dict())}, back)
    written, _ = largest_difference(program, folder, data, back)
    print(f"torch {torch.__version__}, {count} captures, largest difference of an output:")
    print(f"  weights of the program, read by PyTorch: {trained:.2e}")
    print(f"  weights of PyTorch, read by the program: {written:.2e}")
    return not max(trained, written) <= EQUAL  # not a number is a failure


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", required=True)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        failed = compare(os.path.abspath(arguments.program), folder)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
