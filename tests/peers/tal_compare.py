# SPDX-License-Identifier: Apache-2.0
"""Captures to tal's HDF5 and back, with tal on the other side."""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import tal
from tal.enums import GridFormat, HFormat
from tal.io.capture_data import NLOSCaptureData

SPEED_OF_LIGHT = 299_792_458.0  # m/s


def captures(folder: Path, program: str) -> tuple[Path, np.ndarray, np.ndarray]:
    """A capture file of 4 x 3 zones with points on the wall y = 0, its counts and points."""
    random = np.random.default_rng(1)
    counts = random.poisson(20, (1, 12, 32)).astype(float)
    points = [[0.3 * (z % 3), 0.0, 1 + 0.2 * (z // 3)] for z in range(12)]
    metadata = {
        "format": "blindcorner.capture/1", "bin_width_ps": 100, "rows": 4, "columns": 3, "bins": 32,
        "captures": [{"relay_points_m": points,
                      "sensor_pose": {"position_m": [0.3, -1.5, 1.2], "quaternion_wxyz": [1, 0, 0, 0]}}],
    }
    np.savez(folder / "a.npz", counts=counts, metadata_json=json.dumps(metadata))
    subprocess.run([program, "import", folder / "a.npz", "-o", folder / "a.exr"], check=True,
                   stdout=subprocess.DEVNULL)
    return folder / "a.exr", counts[0], np.array(points)


def read_by_tal(folder: Path, program: str) -> None:
    file, counts, points = captures(folder, program)
    subprocess.run([program, "export", file, "-o", folder / "a.hdf5", "--confocal"], check=True,
                   stdout=subprocess.DEVNULL)
    data = tal.io.read_capture(str(folder / "a.hdf5"))
    assert data.H_format == HFormat.T_Sx_Sy and data.sensor_grid_format == GridFormat.X_Y_3
    assert data.is_confocal() and bool(data.t_accounts_first_and_last_bounces)
    np.testing.assert_array_equal(np.moveaxis(data.H, 0, -1).reshape(12, 32), counts)
    turned = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)
    np.testing.assert_allclose(data.sensor_grid_xyz.reshape(12, 3), turned, atol=1e-6)
    np.testing.assert_allclose(data.sensor_xyz, [0.3, 1.2, 1.5], atol=1e-6)
    np.testing.assert_allclose(data.delta_t, 100e-12 * SPEED_OF_LIGHT, rtol=1e-6)
    print("tal reads what export writes: counts equal, points within 1 um")


def written_by_tal(folder: Path, program: str) -> None:
    data = NLOSCaptureData()
    data.H = np.random.default_rng(2).random((16, 2, 5)).astype(np.float32)
    data.H_format = HFormat.T_Sx_Sy
    data.sensor_grid_xyz = np.random.default_rng(3).random((2, 5, 3)).astype(np.float32)
    data.sensor_grid_format = GridFormat.X_Y_3
    data.laser_grid_xyz = np.array([[[0.1, 0.2, 0]]], dtype=np.float32)
    data.laser_grid_format = GridFormat.X_Y_3
    data.sensor_xyz = np.array([0.5, 0.5, 1], dtype=np.float32)
    data.delta_t = 0.01
    data.t_start = 0.5
    data.t_accounts_first_and_last_bounces = True
    data.scene_info = {}
    tal.io.write_capture(str(folder / "b.hdf5"), data)
    told = subprocess.run([program, "import", folder / "b.hdf5", "-o", folder / "b.exr"], check=True,
                          stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True).stderr
    assert "time_zero_ps is -1667.82" in told, told
    subprocess.run([program, "export", folder / "b.exr", "-o", folder / "b.npz"], check=True,
                   stdout=subprocess.DEVNULL)
    with np.load(folder / "b.npz") as back:
        np.testing.assert_array_equal(back["counts"][0],
                                      np.moveaxis(data.H, 0, -1).reshape(10, 16))
        entry = json.loads(back["metadata_json"].item())["captures"][0]
    grid = data.sensor_grid_xyz.reshape(10, 3)
    np.testing.assert_allclose(entry["relay_points_m"],
                               np.stack([grid[:, 0], -grid[:, 2], grid[:, 1]], axis=1), atol=1e-6)
    print("import reads what tal writes: counts equal, points within 1 um")


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--program", required=True)
    program = arguments.parse_args().program
    with tempfile.TemporaryDirectory() as folder:
        read_by_tal(Path(folder), program)
        written_by_tal(Path(folder), program)


if __name__ == "__main__":
    main()
