# SPDX-License-Identifier: Apache-2.0
"""What a robot's tools are told: where things stand for good, and what changes from moment to moment."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .._core import Error
from .._drive import Drive, DriveRun
from .._result import numbers
from .._scene import PathLike, Scene, bundled

Floats = NDArray[np.float64]

#: A grid whose cell size is not stated has at most about this many cells along its longer side.
GRID_CELLS = 100
#: Time between captures that state no times, s.
CAPTURE_INTERVAL_S = 1.0


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One explanation, a mode of the answer. Vectors follow the scene's unknowns, m, rad or 1."""

    weight: float  #: share of the posterior, given that there is an object
    pose: Floats  #: [unknowns]; NaN: the mode leaves that object out
    covariance: Floats  #: [unknowns, unknowns]


@dataclass(frozen=True, eq=False)
class Vehicle:
    """Where the vehicle is: its reference point on the floor, in the map frame."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_m_per_s: float = 0.0
    steering_rad: float = 0.0

    @property
    def matrix(self) -> Floats:
        """[4, 4] takes the vehicle's coordinates to the map, m."""
        return planar_matrix(self.x_m, self.y_m, self.yaw_rad)


@dataclass(frozen=True, eq=False)
class Moment:
    """What is known at one time."""

    time_s: float  #: s since the start
    presence: float | None = None  #: probability that there is an object; None: no answer yet
    modes: list[Hypothesis] = field(default_factory=list)  #: heaviest first
    vehicle: Vehicle | None = None
    sensor: Floats | None = None  #: [4, 4] takes sensor coordinates to the map; None: the setting's
    path: Floats | None = None  #: [points, 2] the plan, m
    truth: Floats | None = None  #: [unknowns] in simulation
    occupancy: Floats | None = None  #: [rows, columns] the vehicle's own map; NaN: nothing is known
    counts: Floats | None = None  #: [zones, bins]
    flags: list[str] = field(default_factory=list)
    error: str = ""
    notes: dict[str, Any] = field(default_factory=dict)  #: words and numbers beside the answer


def planar_matrix(x: float, y: float, yaw: float) -> Floats:
    """[4, 4] a turn about z and a shift in the plane, m and rad."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
    matrix[:2, 3] = x, y
    return matrix


@dataclass(frozen=True)
class Grid:
    """How an occupancy grid lies in the map frame. Row 0 has the lowest y, column 0 the lowest x."""

    rows: int
    columns: int
    cell_m: float
    x_m: float  #: lower left corner
    y_m: float

    @classmethod
    def around(cls, scene: Scene, cell_m: float | None = None) -> Grid:
        """A grid that holds the search region of a scene, its objects' bodies, and the sensor."""
        corners = [scene.sensor_pose[:2, 3]]
        for end in (0, 1):
            for _, x, y, _, _, _, footprint, _ in _core.objects_at(
                    scene._core, np.ascontiguousarray(scene.bounds[:, end])):
                # The body's reach, however the object is turned.
                reach = np.linalg.norm(footprint - [x, y], axis=1).max()
                corners += [np.array([x, y]) - reach, np.array([x, y]) + reach]
        lower, upper = np.min(corners, axis=0), np.max(corners, axis=0)
        extent = float(max(upper - lower))
        cell = cell_m or _round_up(extent / GRID_CELLS)
        lower = np.floor(lower / cell) * cell
        columns, rows = (int(n) for n in np.maximum(1, np.ceil((upper - lower) / cell)))
        return cls(rows, columns, cell, float(lower[0]), float(lower[1]))


def _round_up(value: float) -> float:
    """The value rounded up to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(max(value, 1e-3)))
    return next(step * power for step in (1, 2, 5, 10) if step * power >= value * (1 - 1e-9))


class Setting:
    """What stays the same: scene, grid, and on a drive the vehicle's body and the sensor's mount."""

    def __init__(self, scene: Scene, drive: Drive | None = None, cell_m: float | None = None) -> None:
        """``cell_m``: edge of a grid's cell, m; by default the drive's, or one that gives up
        to some hundred cells along the longer side. Raises Error."""
        self.scene = scene
        self.drive = drive
        if drive is not None and cell_m is None:
            rows, columns, cell, origin = drive._core.map
            self.grid = Grid(rows, columns, cell, float(origin[0]), float(origin[1]))
        else:
            self.grid = Grid.around(scene, cell_m)
        #: [3] length, width, height of the vehicle, m; None: there is no vehicle
        self.body: Floats | None = None if drive is None else drive._core.body
        #: [4, 4] takes sensor coordinates to the vehicle, m
        self.mount: Floats | None = None if drive is None else drive._core.mount
        self._hidden = _core.HiddenGrid.make(
            scene._core, self.grid.rows, self.grid.columns, self.grid.cell_m,
            np.array([self.grid.x_m, self.grid.y_m]))

    @classmethod
    def of_drive(cls, drive: Drive) -> Setting:
        """The setting of a drive file."""
        return cls(Scene.load(drive._core.scene_path), drive)

    def sensor(self, moment: Moment) -> Floats:
        """[4, 4] takes sensor coordinates to the map, m."""
        if moment.sensor is not None:
            return moment.sensor
        if moment.vehicle is not None and self.mount is not None:
            return moment.vehicle.matrix @ self.mount
        return self.scene.sensor_pose

    def occupancy(self, moment: Moment) -> Floats | None:
        """[rows, columns] probability that a cell is occupied, NaN where nothing is known. This is
        the vehicle's own map if the moment has it, else what the answer says of hidden objects;
        None without an answer. Raises Error for an invalid answer."""
        if moment.occupancy is not None:
            return moment.occupancy
        if moment.presence is None:
            return None
        n = len(self.scene.unknowns)
        weights = np.array([m.weight for m in moment.modes], dtype=float)
        poses = np.array([m.pose for m in moment.modes], dtype=float).reshape(-1, n)
        covariances = np.array([m.covariance for m in moment.modes], dtype=float).reshape(-1, n, n)
        cells: Floats = self._hidden.occupied(float(moment.presence), weights, poses, covariances)
        return cells


def checked(moment: Moment, unknowns: int) -> Moment:
    """Returns the moment. Raises ValueError if its answer does not suit a scene with this number of
    unknowns."""
    if moment.presence is not None and not 0 <= moment.presence <= 1:
        raise ValueError(f"presence_probability: found {moment.presence}, accepted: 0 to 1")
    vectors = [mode.pose for mode in moment.modes] + ([] if moment.truth is None else [moment.truth])
    matrices = [mode.covariance for mode in moment.modes]
    for found, accepted in [*((v.shape, (unknowns,)) for v in vectors),
                            *((m.shape, (unknowns, unknowns)) for m in matrices)]:
        if found != accepted:
            raise ValueError(f"modes: found numbers of shape {found}, accepted: {accepted}")
    return moment


def hypotheses(modes: Iterable[Mapping[str, Any]]) -> list[Hypothesis]:
    """Modes as ``result.json`` and ``drive.json`` hold them."""
    return [Hypothesis(float(m["weight"]), numbers(m["pose"]), numbers(m["covariance"])) for m in modes]


# --- Drives -----------------------------------------------------------------------------------------


def _of_frame(frame: Mapping[str, Any], **more: Any) -> Moment:
    """A frame of ``drive.json`` (docs/drive.md)."""
    path = (frame.get("plan") or {}).get("path_m")
    truth = frame.get("truth")
    return Moment(
        time_s=float(frame["time_s"]),
        presence=frame["presence_probability"],
        modes=hypotheses(frame["modes"]),
        vehicle=Vehicle(frame["x_m"], frame["y_m"], frame["yaw_rad"], frame["speed_m_per_s"],
                        frame["steering_rad"]),
        path=None if not path else numbers(path),
        truth=None if truth is None else numbers(truth),
        flags=list(frame["flags"]),
        error=frame["error"] or "",
        notes={"frame": frame["frame"], "clearance_m": frame["clearance_m"],
               "target_speed_m_per_s": frame["target_speed_m_per_s"],
               "speed_m_per_s": frame["speed_m_per_s"],
               "decision": (frame.get("plan") or {}).get("decision", "")},
        **more,
    )


def of_run(run: DriveRun) -> tuple[Setting, list[Moment]]:
    """Setting and moments of a drive that was simulated in this process, with the vehicle's own map
    and the histograms."""
    moments = []
    for i, frame in enumerate(run.frames):
        occupancy, counts = run._core.occupancy(i), run._core.counts(i)
        moments.append(_of_frame(frame, occupancy=occupancy if occupancy.size else None,
                                 counts=counts if counts.size else None))
    return Setting.of_drive(run.drive), moments


def of_drive_document(document: Mapping[str, Any], place: str,
                      drive: Drive | None = None) -> tuple[Setting, list[Moment]]:
    """Setting and moments of a ``drive.json``. It does not hold the scene, which is that of the
    drive file, by default of the bundled one of that name. Raises Error."""
    name = document.get("drive", "")
    if drive is None:
        try:
            drive = Drive.load(bundled(f"{name}.json"))
        except Error:
            raise Error(f'{place}: drive: found "{name}", accepted: a bundled drive, or another whose '
                        "file --drive names") from None
    setting = Setting.of_drive(drive)
    _same_unknowns(place, document, setting.scene)
    try:
        n = len(setting.scene.unknowns)
        return setting, [checked(_of_frame(frame), n) for frame in document["frames"]]
    except (KeyError, TypeError, ValueError) as error:
        raise Error(f"{place}: frames: {_what(error)}, accepted: as docs/drive.md says") from None


# --- Answers ----------------------------------------------------------------------------------------


def _same_unknowns(place: str, document: Mapping[str, Any], scene: Scene) -> None:
    if list(document.get("unknowns", [])) != scene.unknowns:
        raise Error(f"{place}: unknowns: found {', '.join(document.get('unknowns', [])) or 'none'}, "
                    f"accepted: those of {scene.path or scene.name}: {', '.join(scene.unknowns)}")


def _what(error: Exception) -> str:
    return f"found no {error}" if isinstance(error, KeyError) else str(error)


def of_answer(entry: Mapping[str, Any], time_s: float, **more: Any) -> Moment:
    """The moment of an element of ``captures`` of ``result.json`` (docs/result.md); ``more``:
    further fields of the moment. Raises KeyError, TypeError or ValueError if the entry is no such
    element."""
    notes = {name: entry[name] for name in ("frame", "skipped", "latency_ms", "source", "index")
             if entry.get(name) is not None}
    return Moment(time_s=time_s, presence=entry["presence_probability"],
                  modes=hypotheses(entry.get("modes") or []), flags=list(entry.get("flags") or []),
                  error=entry.get("error") or "", notes=notes, **more)


def of_results(document: Mapping[str, Any], place: str, scene: Scene | None = None,
               cell_m: float | None = None) -> tuple[Setting, list[Moment]]:
    """Setting and moments of a ``result.json``. Those of ``fit --track`` have their times, others
    are a second apart. ``scene``: by default the file that it names. Raises Error."""
    scene = scene or Scene.load(document.get("scene", ""))
    _same_unknowns(place, document, scene)
    moments = []
    for i, entry in enumerate(document.get("captures", [])):
        try:
            time_s = (entry.get("track") or {}).get("time_s")
            moment = of_answer(entry, CAPTURE_INTERVAL_S * i if time_s is None else time_s)
            moments.append(checked(moment, len(scene.unknowns)))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise Error(f"{place}: captures[{i}]: {_what(error)}, accepted: as docs/result.md says"
                        ) from None
    return Setting(scene, cell_m=cell_m), moments


class LiveAnswers:
    """Answers of ``blindcorner live`` from lines of JSON, as they arrive. A line that holds no
    answer is counted in ``bad_lines``; ``first_bad`` says what was wrong with the first one."""

    def __init__(self, lines: Iterable[str], place: str = "standard input",
                 scene: Scene | None = None, cell_m: float | None = None) -> None:
        """Reads the first line. ``scene``: by default the file that it names. Raises Error."""
        self._lines = iter(lines)
        self._place = place
        self.bad_lines = 0
        self.first_bad = ""
        head = self._head()
        scene = scene or Scene.load(head.get("scene", ""))
        _same_unknowns(place, head, scene)
        self.setting = Setting(scene, cell_m=cell_m)

    def _head(self) -> dict[str, Any]:
        line = next(self._lines, "")
        try:
            head = json.loads(line)
        except ValueError:
            head = None
        if not isinstance(head, dict) or head.get("format") != "blindcorner.live/1":
            raise Error(f"{self._place}: line 1: format: found {line.strip()[:60] or 'nothing'}, "
                        'accepted: "blindcorner.live/1"')
        return head

    def __iter__(self) -> Iterator[Moment]:
        n = len(self.setting.scene.unknowns)
        for number, line in enumerate(self._lines, 2):
            if not line.strip():
                continue
            try:
                entry = json.loads(line)
                moment = checked(of_answer(entry, float(entry["time_s"])), n)
            except (ValueError, KeyError, TypeError, AttributeError) as error:
                self.bad_lines += 1
                self.first_bad = self.first_bad or f"{self._place}: line {number}: {_what(error)}"
                continue
            yield moment


def read_document(path: PathLike) -> dict[str, Any]:
    """A JSON object of a file. Raises Error."""
    file = Path(path)
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise Error(f"{file}: {error.strerror}") from None
    except ValueError as error:
        raise Error(f"{file}: {error}, accepted: JSON") from None
    if not isinstance(document, dict):
        raise Error(f"{file}: accepted: a JSON object")
    return document
