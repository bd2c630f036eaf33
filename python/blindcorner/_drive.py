# SPDX-License-Identifier: Apache-2.0
"""Simulated drives around corners, and paths on maps."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._core import Error
from ._result import frame
from ._scene import PathLike


def _save(directory: PathLike, files: dict[str, str]) -> None:
    folder = Path(directory)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(f"{folder}: cannot be made a directory: {error.strerror}") from None
    for name, text in files.items():
        _core.write_atomically(os.fspath(folder / name), text)
    _core.write_index(os.fspath(folder))


class Drive:
    """A drive file: scene, vehicle, route, sensor mount, map (docs/drive.md)."""

    def __init__(self, core: _core.Drive, light: float = 0.0) -> None:
        self._core = core
        self.light = light  #: factor on the laser's light; 0: the drive file's

    @classmethod
    def load(cls, path: PathLike, *, light: float = 0.0) -> Drive:
        """Reads a drive file and the scene that it names. ``light``: factor on the laser's light in
        place of the file's; 0: the file's. Raises Error."""
        return cls(_core.Drive.load(os.fspath(path), light), light)

    @property
    def name(self) -> str:
        """Name of the drive."""
        return self._core.name

    @property
    def path(self) -> str:
        """File that it was read from."""
        return self._core.path

    @property
    def perception(self) -> str:
        """The perception that the file names: los, solver, cnn, cnn_wide or oracle."""
        return self._core.perception

    @property
    def route(self) -> NDArray[np.float64]:
        """[points, 2] points on the way, m; the last one is the goal."""
        return np.array(self._core.route)

    def __repr__(self) -> str:
        return (
            f"Drive {self.name}: {self._core.vehicle}, {self._core.rate:g} frames/s, perception "
            f"{self.perception}, at most {self._core.time_limit:g} s"
        )


class DriveRun:
    """One simulated drive. In a notebook it shows the map, which moves."""

    def __init__(self, core: _core.DriveRun, drive: Drive) -> None:
        self._core = core
        self.drive = drive

    @property
    def outcome(self) -> str:
        """reached, collision, stopped or timeout."""
        return self._core.outcome

    @property
    def clearance_m(self) -> float:
        """Least distance between vehicle and anything, m; 0: collision."""
        return self._core.clearance

    @property
    def length_m(self) -> float:
        """Length of the way that was driven, m."""
        return self._core.length

    @property
    def time_s(self) -> float:
        """Time that the drive took, s."""
        return self._core.time

    @property
    def mean_speed_m_per_s(self) -> float:
        """Mean speed, m/s."""
        return self._core.mean_speed

    @property
    def trace(self) -> NDArray[np.float64]:
        """[steps, 3] x, y (m) and yaw (rad) of the vehicle, ``trace_step_s`` apart."""
        return self._core.trace

    @property
    def trace_step_s(self) -> float:
        """Time between rows of ``trace``, s."""
        return self._core.trace_step

    @property
    def frames(self) -> list[dict[str, Any]]:
        """What the vehicle knew and did at each sensor frame (docs/drive.md)."""
        return self.to_dict()["frames"]

    def to_dict(self) -> dict[str, Any]:
        """What ``drive.json`` holds (docs/drive.md)."""
        return json.loads(self._core.text)

    def page(self) -> str:
        """A page that plays the drive, HTML. Raises Error for a drive without pictures."""
        return self._core.page()

    def save(self, directory: PathLike) -> None:
        """Writes ``drive.json`` and ``drive.html``; the directory is made. Raises Error."""
        _save(directory, {"drive.html": self.page(), "drive.json": self._core.text})

    def __repr__(self) -> str:
        return (
            f"{self.drive.name}: {self.outcome} after {self.time_s:.1f} s and {self.length_m:.1f} m "
            f"(mean {self.mean_speed_m_per_s:.2f} m/s), clearance {self.clearance_m:.2f} m"
        )

    def _repr_html_(self) -> str:
        return frame(self.page())


def drive(
    drive: Drive | PathLike,
    *,
    perception: str = "",
    seed: int = 1,
    speed_m_per_s: float | None = None,
    injected_error_m: float = 0.0,
    weights: Sequence[PathLike] = (),
    pictures: bool = True,
    progress: Callable[[float], None] | None = None,
) -> DriveRun:
    """Drives around a corner in simulation, as ``blindcorner drive``; the same seed gives the same
    drive.

    perception: los, solver, cnn, cnn_wide or oracle; by default the drive file's.
    speed_m_per_s: wanted speed. injected_error_m: distance by which misled oracles miss the
    truth.
    weights: of networks. pictures: keep what the page needs.
    progress: called before each sensor frame with the time of the drive, s. Raises Error.
    """
    data = drive if isinstance(drive, Drive) else Drive.load(drive)
    core = _core.drive(data._core, perception, seed, speed_m_per_s, injected_error_m,
                       [os.fspath(w) for w in weights], pictures, progress)
    return DriveRun(core, data)


class Plan:
    """A planned path. In a notebook it shows the map with the path."""

    def __init__(self, core: _core.PlanRun) -> None:
        self._core = core
        self._document: dict[str, Any] = json.loads(core.text)

    @property
    def status(self) -> str:
        """found, no_path, start_blocked, goal_blocked, start_outside or goal_outside."""
        return self._document["status"]

    @property
    def found(self) -> bool:
        """Whether there is a path."""
        return self.status == "found"

    @property
    def length_m(self) -> float | None:
        """Length, m."""
        return self._document["length_m"]

    @property
    def points(self) -> NDArray[np.float64]:
        """[points, 5] x, y (m), heading (rad), curvature (1/m, left is positive), arc length (m)."""
        return np.array(self._document["points"], dtype=float).reshape(-1, 5)

    def to_dict(self) -> dict[str, Any]:
        """What ``path.json`` holds (docs/plan.md)."""
        return self._document

    def save(self, directory: PathLike) -> None:
        """Writes ``path.json`` and ``path.html``; the directory is made. Raises Error."""
        _save(directory, {"path.json": self._core.text, "path.html": self._core.page()})

    def __repr__(self) -> str:
        length = "" if self.length_m is None else f", {self.length_m:.2f} m"
        return f"Plan: {self.status}{length}, {len(self.points)} points"

    def _repr_html_(self) -> str:
        return frame(self._core.page())


def load_map(path: PathLike) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
    """Reads a ROS map (.yaml) or a MovingAI map (.map): occupancy [rows, columns] (probability, NaN:
    unknown; row 0 has the lowest y), size of a cell (m), lower left corner [2] (m). Raises Error."""
    return _core.load_map(os.fspath(path))


def plan(
    map: PathLike | ArrayLike,
    start: Sequence[float],
    goal: Sequence[float],
    *,
    cell_size_m: float = 1.0,
    origin_m: Sequence[float] = (0.0, 0.0),
    start_heading_rad: float | None = None,
    goal_heading_rad: float | None = None,
    vehicle_length_m: float | None = None,
    vehicle_width_m: float | None = None,
    radius_m: float = 0.0,
    min_turning_radius_m: float = 0.0,
    unknown: float = 0.5,
    risk_weight: float = 0.0,
    risk_radius_m: float = 0.0,
    heuristic_weight: float = 1.0,
) -> Plan:
    """A path on a map, as ``blindcorner plan`` (docs/plan.md).

    map: a file, or an array [rows, columns] of probabilities (NaN: unknown; row 0 has the lowest y)
        whose cells are ``cell_size_m`` wide and whose lower left corner is ``origin_m`` [2].
    start, goal: x, y in m. The vehicle is a rectangle, a disc (``radius_m``) or a point; it turns
    no tighter than ``min_turning_radius_m``. unknown: probability of unknown cells. risk_weight,
    risk_radius_m: how strongly, and within which distance, the path keeps away from obstacles.
    Raises Error for wrong maps and numbers; if there is no path, ``status`` says so.
    """
    name = "array"
    if isinstance(map, (str, os.PathLike)):
        name = os.fspath(map)
        occupancy, cell_size_m, origin = load_map(map)
    else:
        occupancy, origin = np.ascontiguousarray(map, dtype=float), np.asarray(origin_m, dtype=float)
    core = _core.plan(name, occupancy, cell_size_m, np.asarray(origin, dtype=float),
                      np.asarray(start, dtype=float), np.asarray(goal, dtype=float),
                      start_heading_rad, goal_heading_rad, vehicle_length_m, vehicle_width_m, radius_m,
                      min_turning_radius_m, unknown, risk_weight, risk_radius_m, heuristic_weight)
    return Plan(core)
