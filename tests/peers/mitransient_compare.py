# SPDX-License-Identifier: Apache-2.0
"""The forward models beside mitransient on the same scenes and cores.

Errors are relative L2 over the bins where the object's light stands above 2 % of its peak, against
blindcorner's reference renderer at a dense sampling. Times are processor seconds, all threads added
up, so other programs on the machine do not count; compilation of mitransient's kernels is left out.
"""
import argparse
import csv
import json
import math
import os
import subprocess
import tempfile
import time

import mitsuba as mi

mi.set_variant("llvm_ad_mono")

import mitransient as mitr  # noqa: E402  (needs the variant)
import numpy as np  # noqa: E402

SPEED_OF_LIGHT = 299792458.0
SUB_PIXELS = 8  # along each side of a zone
FINE = 4  # path bins per histogram bin, before the pulse
FWHM = 2.354820045030949
OBJECT_LIGHT = 0.02  # share of the peak above which bins are compared


def rectangle(center, normal, width, height, albedo):
    """Mitsuba's rectangle spans -1..1 with normal +z; its y goes up."""
    normal = np.asarray(normal, float)
    to_world = mi.ScalarTransform4f().look_at(
        origin=list(center), target=list(np.asarray(center) + normal), up=[0, 0, 1]
    ) @ mi.ScalarTransform4f().scale([width / 2, height / 2, 1])
    return {"type": "rectangle", "to_world": to_world, "bsdf": diffuse(albedo)}


def diffuse(albedo):
    return {"type": "diffuse", "reflectance": {"type": "uniform", "value": albedo}}


class Bins:
    """Time axis of a scene as optical path."""

    def __init__(self, scene):
        sensor = scene["sensor"]
        self.count = sensor["bins"]
        self.width = sensor["bin_width_ps"] * 1e-12 * SPEED_OF_LIGHT
        self.sigma = sensor["impulse_response"]["fwhm_ps"] * 1e-12 * SPEED_OF_LIGHT / FWHM

    def film(self, width, height):
        return {
            "type": "transient_hdr_film", "width": width, "height": height,
            "temporal_bins": self.count * FINE, "bin_width_opl": self.width / FINE, "start_opl": 0.0,
            "rfilter": {"type": "box"},
        }

    def with_pulse(self, fine):
        """Convolves [..., fine bins] with the pulse and adds up to histogram bins."""
        step = self.width / FINE
        reach = int(math.ceil(6 * self.sigma / step))
        edges = (np.arange(-reach, reach + 2) - 0.5) * step
        erf = np.vectorize(math.erf)
        pulse = np.diff(0.5 * (1 + erf(edges / (math.sqrt(2) * self.sigma))))
        flat = fine.reshape(-1, fine.shape[-1])
        blurred = np.stack([np.convolve(row, pulse, mode="same") for row in flat])
        return blurred.reshape(*fine.shape[:-1], self.count, FINE).sum(-1)


def hidden_object(scene):
    hidden = scene["hidden"]
    yaw = math.radians(hidden["yaw_deg"])
    return rectangle(hidden["position_m"], [math.cos(yaw), math.sin(yaw), 0], hidden["width_m"],
                     hidden["height_m"], hidden["albedo"])


def flash_scene(scene, with_object):
    """One cone of light from the sensor; every zone as SUB_PIXELS^2 pixels."""
    sensor = scene["sensor"]
    position = scene["sensor_pose"]["position_m"]
    view = mi.ScalarTransform4f().look_at(
        origin=position, target=list(np.add(position, scene["sensor_pose"]["look"])), up=[0, 0, 1])
    half = sensor["illumination"]["field"]["cone_half_angle_deg"]
    wall = scene["surfaces"][0]
    world = {
        "type": "scene",
        "integrator": {"type": "transient_path", "max_depth": 4, "temporal_filter": "box"},
        # Camera rays start at the near plane, and so do path lengths.
        "sensor": {
            "type": "perspective", "fov": sensor["fov_deg"][0], "fov_axis": "x", "near_clip": 1e-4,
            "far_clip": 100.0, "to_world": view,
            "film": Bins(scene).film(sensor["columns"] * SUB_PIXELS, sensor["rows"] * SUB_PIXELS),
            "sampler": {"type": "independent"},
        },
        "light": {"type": "spot", "to_world": view, "cutoff_angle": half, "beam_width": half * 0.9999,
                  "intensity": {"type": "uniform", "value": 1.0}},
        "wall": rectangle(wall["center_m"], wall["normal"], wall["width_m"], wall["height_m"],
                          wall["albedo"]),
    }
    if with_object:
        world["object"] = hidden_object(scene)
    return mi.load_dict(world)


def flash_zones(scene, transient):
    """Radiance of the pixels to W/m^2 of the zones."""
    sensor = scene["sensor"]
    rows, columns = sensor["rows"], sensor["columns"]
    radiance = np.asarray(transient)[..., 0]
    tangent = math.tan(math.radians(sensor["fov_deg"][0] / 2))
    pixels = columns * SUB_PIXELS
    u = (np.arange(pixels) + 0.5) / pixels * 2 * tangent - tangent
    uu, vv = np.meshgrid(u, u)
    solid = (2 * tangent / pixels) ** 2 * (1 + uu**2 + vv**2) ** -1.5
    light = radiance * solid[:, :, None]
    shape = (rows, SUB_PIXELS, columns, SUB_PIXELS, -1)
    return Bins(scene).with_pulse(light.reshape(shape).sum(axis=(1, 3)))


def point_scene(scene):
    """One lit point, hidden-geometry and laser sampling: what the integrator is made for."""
    sensor = scene["sensor"]
    position = scene["sensor_pose"]["position_m"]
    wall = scene["surfaces"][0]
    relay = rectangle(wall["center_m"], wall["normal"], 1.0, 1.0, wall["albedo"])
    relay["sensor"] = {
        "type": "nlos_capture_meter", "sensor_origin": position,
        "film": Bins(scene).film(sensor["columns"], sensor["rows"]),
        "sampler": {"type": "independent"},
    }
    loaded = mi.load_dict({
        "type": "scene",
        "integrator": {
            "type": "transient_nlos_path", "max_depth": 4, "discard_direct_paths": True,
            "nlos_laser_sampling": True, "nlos_hidden_geometry_sampling": True,
            "nlos_hidden_geometry_sampling_includes_relay_wall": False,
            "account_first_and_last_bounces": True, "temporal_filter": "box",
        },
        "relay": relay,
        "light": {"type": "projector", "irradiance": {"type": "uniform", "value": 1.0}, "fov": 0.2,
                  "to_world": mi.ScalarTransform4f().look_at(
                      origin=position, target=wall["center_m"], up=[0, 0, 1])},
        "object": hidden_object(scene),
    })
    relay_shape = next(s for s in loaded.shapes() if s.is_sensor())
    mitr.nlos.focus_emitter_at_relay_wall_3dpoint(
        mi.Point3f(wall["center_m"]), relay_shape, loaded.emitters()[0])
    return loaded


def point_zones(scene, transient):
    light = np.asarray(transient)[::-1, :, :, 0]  # the film's rows go up the wall
    return Bins(scene).with_pulse(np.array(light))


def render(scene, samples, seed):
    """Transient and processor seconds."""
    start = time.process_time()
    _, transient = mi.render(scene, spp=samples, seed=seed)
    data = np.array(transient)
    return data, time.process_time() - start


def small_zones(scene):
    """The capture meter looks at the middles of its pixels: zones of 0.02 degrees there."""
    sensor = scene["sensor"]
    distance = scene["surfaces"][0]["center_m"][0]
    zones = []
    for row in range(sensor["rows"]):
        for column in range(sensor["columns"]):
            right = math.degrees(math.atan(((column + 0.5) / sensor["columns"] - 0.5) / distance))
            down = math.degrees(math.atan(((row + 0.5) / sensor["rows"] - 0.5) / distance))
            zones.append({"angles_deg": {"left": right - 0.01, "right": right + 0.01,
                                         "top": down - 0.01, "bottom": down + 0.01}})
    sensor = {key: value for key, value in sensor.items() if key != "fov_deg"}
    return {**scene, "sensor": {**sensor, "zones": zones}}


def blindcorner_truth(program, path, folder, flash):
    """Tiny zones and a tiny field need next to no sampling."""
    capture = os.path.join(folder, "truth.exr")
    zone, field = ("10", "32") if flash else ("2", "3")
    subprocess.run([program, "render", path, "-o", capture, "--noiseless", "--zone-divisions", zone,
                    "--field-divisions", field], check=True)
    subprocess.run([program, "export", capture, "-o", os.path.join(folder, "truth.npz")], check=True)
    return np.load(os.path.join(folder, "truth.npz"))["counts"][0]


def blindcorner_times(program, path, folder, flash):
    """Cheapest microseconds with at most 1 % error: fast model, reference renderer."""
    subprocess.run([program, "benchmark", "forward", path, "-o", folder, "--poses", "1", "--truth",
                    "1.2" if flash else "0.5", "--slowest-ms", "20"], check=True)
    best = {"fast": math.inf, "reference": math.inf}
    with open(os.path.join(folder, "forward.csv"), newline="") as file:
        for row in csv.DictReader(file):
            kind = "reference" if row["model"] == "reference" else "fast"
            if float(row["relative_l2"]) <= 0.01:
                best[kind] = min(best[kind], float(row["microseconds"]))
    return best


def compare(name, load, zones, program, here, most_seconds):
    path = os.path.join(here, name + ".json")
    with open(path) as file:
        scene = json.load(file)
    flash = name.startswith("flash")
    with tempfile.TemporaryDirectory() as folder:
        if not flash:
            path = os.path.join(folder, name + ".json")
            with open(path, "w") as file:
                json.dump(small_zones(scene), file)
        truth = blindcorner_truth(program, path, folder, flash)
        own = blindcorner_times(program, path, folder, flash)
    truth = truth.reshape((scene["sensor"]["rows"], scene["sensor"]["columns"], -1))
    if not flash:  # the meter's pixels are radiances, not integrals over solid angles
        truth = truth / truth.sum(axis=-1, keepdims=True)
    world = load(scene)
    # The first bounce comes before the object's light; what is compared starts after it.
    late = np.arange(truth.shape[-1]) >= (first_object_bin(scene) if flash else 0)
    mask = (truth > OBJECT_LIGHT * truth[..., late].max()) & late
    render(world, 16, 0)  # compiles
    seconds, samples, passes = 0.0, 16, 0
    print(f"\n{name}: mitransient")
    print(f"{'samples':>10} {'seconds':>9} {'rel. L2':>9} {'scale':>8}")
    while True:
        data, spent = render(world, samples, 1 + passes)
        light = zones(scene, data)
        if not flash:
            light = light / light.sum(axis=-1, keepdims=True)
        seconds, passes = spent, passes + 1
        scale = (light[mask] * truth[mask]).sum() / (light[mask] ** 2).sum()
        error = np.linalg.norm((light - truth)[mask]) / np.linalg.norm(truth[mask])
        print(f"{samples:>10} {seconds:>9.2f} {100 * error:>8.2f}% {scale:>8.4f}", flush=True)
        if error < 0.01 or 4 * seconds > most_seconds:
            break
        samples *= 4
    # Monte Carlo: the error falls with the root of the time.
    at_percent = seconds * (error / 0.01) ** 2
    print(f"{name}: 1 % takes mitransient {at_percent:.3g} s"
          f"{'' if error < 0.012 else ' (from the error of its last rendering)'}, "
          f"the fast model {own['fast']:.4g} us ({1e6 * at_percent / own['fast']:.3g} times faster), "
          f"the reference renderer {own['reference']:.4g} us "
          f"({1e6 * at_percent / own['reference']:.3g} times faster)")


def first_object_bin(scene):
    """One bin after the direct return's pulse has passed."""
    bins = Bins(scene)
    wall = scene["surfaces"][0]["center_m"][0] - scene["sensor_pose"]["position_m"][0]
    corner = 2 * wall * math.sqrt(
        1 + 2 * math.tan(math.radians(scene["sensor"]["fov_deg"][0] / 2)) ** 2)
    return int((corner + 6 * bins.sigma) / bins.width) + 1


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", required=True)
    parser.add_argument("--seconds", type=float, default=60)
    arguments = parser.parse_args()
    here = os.path.dirname(os.path.abspath(__file__))
    compare("flash_wall", lambda s: flash_scene(s, True), flash_zones, arguments.program, here,
            arguments.seconds)
    compare("lit_point", point_scene, point_zones, arguments.program, here, arguments.seconds)


if __name__ == "__main__":
    main()
