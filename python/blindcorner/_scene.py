# SPDX-License-Identifier: Apache-2.0
"""Scenes: what is known before a capture is looked at."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Union

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._core import Error

PathLike = Union[str, "os.PathLike[str]"]
#: A pose by names (x_m, y_m, z_m, yaw_deg or yaw_rad, size; with several objects NAME.x_m), or a
#: vector in the order of the scene's unknowns, m, rad or 1.
PoseLike = Union[Mapping[str, float], Sequence[float], NDArray[np.floating[Any]]]
#: A pose of the sensor by names (x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg, or _rad), or a matrix
#: [4, 4] that takes sensor coordinates to the world, m.
SensorPoseLike = Union[Mapping[str, float], NDArray[np.floating[Any]]]


def bundled(name: str = "") -> str:
    """Path of a scene, drive or capture that comes with the package, such as "tmf8828_wall.json" or
    "captures/tmf8828_wall.exr". Without a name: path of their folder. Raises Error for other
    names."""
    folder = Path(__file__).parent / "scenes"
    path = folder / name
    if not path.exists():
        known = ", ".join(sorted(p.name for p in folder.glob("*.json")))
        raise Error(f'bundled: found "{name}", accepted: {known}')
    return str(path)


def presets() -> list[str]:
    """Names of the sensors that a scene may use: ``{"sensor": {"preset": NAME}}``."""
    return _core.preset_names()


def preset(name: str) -> dict[str, Any]:
    """The fields of a scene's ``sensor`` that a preset stands for. Raises Error for an unknown
    name."""
    return json.loads(_core.preset_text(name))


class Scene:
    """Sensor, known surfaces, the kind of object and which components of its pose are unknown, as a
    scene file says (docs/scene.md). A scene cannot be changed; :meth:`with_fields` makes
    another one."""

    def __init__(self, core: _core.Scene) -> None:
        self._core = core

    @classmethod
    def load(cls, path: PathLike, instrument: PathLike | None = None) -> Scene:
        """Reads a scene file; ``instrument`` is a file of :meth:`Calibration.save` or of
        ``blindcorner calibrate``, whose fields replace those of the scene. Raises Error with a line
        for each problem."""
        return cls(_core.Scene.load(os.fspath(path), os.fspath(instrument or "")))

    @classmethod
    def from_dict(cls, fields: Mapping[str, Any], path: PathLike = "") -> Scene:
        """A scene from the fields of a scene file. ``path`` stands for the file in messages, and
        files that the fields name are relative to its folder. Raises Error."""
        return cls(_core.Scene.from_text(json.dumps(fields), os.fspath(path)))

    def to_dict(self) -> dict[str, Any]:
        """The fields of the scene file, as they were read. The keys state the units (degrees,
        picoseconds)."""
        return json.loads(self._core.text)

    def with_fields(self, **fields: Any) -> Scene:
        """The same scene with top-level fields of its file put in place of its own, such as
        ``unknowns={"x_m": [0, 1]}``. Raises Error."""
        return Scene.from_dict({**self.to_dict(), **fields}, self.path)

    @property
    def name(self) -> str:
        """Name of the scene."""
        return self._core.name

    @property
    def path(self) -> str:
        """File that the scene was read from; may be empty."""
        return self._core.path

    @property
    def unknowns(self) -> list[str]:
        """Names with units: x_m, y_m, z_m, yaw_rad, size; with several objects NAME.x_m."""
        return self._core.unknowns

    @property
    def bounds(self) -> NDArray[np.float64]:
        """[unknowns, 2] ends of the search region, m, rad or 1."""
        return np.ascontiguousarray(self._core.bounds)

    @property
    def periods(self) -> NDArray[np.float64]:
        """[unknowns] period after which each repeats, rad (the symmetry of the shape); 0: it does
        not."""
        return np.array(self._core.periods)

    @property
    def objects(self) -> list[str]:
        """Names of the hidden objects."""
        return self._core.objects

    @property
    def sensor(self) -> str:
        """Name of the sensor."""
        return self._core.sensor

    @property
    def rows(self) -> int:
        """Rows of zones."""
        return self._core.rows

    @property
    def columns(self) -> int:
        """Columns of zones."""
        return self._core.columns

    @property
    def zones(self) -> int:
        """Number of zones, rows times columns."""
        return self.rows * self.columns

    @property
    def bins(self) -> int:
        """Bins of a histogram."""
        return self._core.bins

    @property
    def bin_width_s(self) -> float:
        """Width of a bin, s."""
        return self._core.bin_width_s

    @property
    def sensor_pose(self) -> NDArray[np.float64]:
        """[4, 4] takes sensor coordinates (x ahead, y left, z up) to the world, m."""
        return np.ascontiguousarray(self._core.sensor_pose)

    def pose(self, pose: PoseLike | None = None, **components: float) -> NDArray[np.float64]:
        """A pose as a vector [unknowns], m, rad or 1: that of the scene, except for the named
        components, as in ``scene.pose(x_m=0.3, yaw_deg=20)``. Raises Error for other names."""
        if pose is None or isinstance(pose, Mapping):
            return self._core.pose(named({**(pose or {}), **components}))
        vector = np.ascontiguousarray(pose, dtype=float)
        if vector.shape != (len(self.unknowns),):
            raise Error(
                f"pose: found shape {vector.shape}, accepted: ({len(self.unknowns)},), one number "
                f"for each of {', '.join(self.unknowns)}"
            )
        return vector

    def hints(self) -> list[str]:
        """Sentences on what is odd about the scene: parts of the search region in which nothing can
        be found, and why. Empty: nothing."""
        return _core.scene_hints(self._core)

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (self._core.text, self.path, self._core.nominal_bin_width_s)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Scene)
            and (self._core.text, self.path) == (other._core.text, other.path)
        )

    def __hash__(self) -> int:
        return hash((self._core.text, self.path))

    def __repr__(self) -> str:
        lines = [
            f"Scene {self.name}: {self.sensor}, {self.rows} x {self.columns} zones, "
            f"{self.bins} bins of {self.bin_width_s * 1e12:.4g} ps"
        ]
        for name, (lower, upper) in zip(self.unknowns, self.bounds):
            lines.append(f"  {name:<10} {lower:8.3f} to {upper:8.3f}")
        return "\n".join(lines)


def _restore(text: str, path: str, nominal: float) -> Scene:
    return Scene(_core.Scene.from_text(text, path, nominal))


def named(values: Mapping[str, float]) -> list[tuple[str, float]]:
    """(name, value) pairs as the library takes them."""
    return [(str(name), float(value)) for name, value in values.items()]


def sensor_matrix(scene: Scene, pose: SensorPoseLike) -> NDArray[np.float64]:
    """[4, 4] pose of a sensor, m; names that are left out keep the scene's values."""
    if isinstance(pose, Mapping):
        return scene._core.sensor_pose_with(named(pose))
    matrix = np.ascontiguousarray(pose, dtype=float)
    rotation = matrix[:3, :3] if matrix.shape == (4, 4) else np.zeros((3, 3))
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6) or np.linalg.det(rotation) < 0:
        raise Error("sensor_pose: accepted: names with numbers, or a matrix [4, 4] of a rotation and "
                    "a position in m")
    return matrix
