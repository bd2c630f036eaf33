# SPDX-License-Identifier: Apache-2.0
"""Captures: histograms as numpy arrays, with what is known of how they were taken."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Union, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._core import Error
from ._scene import PathLike

CoreArrays = tuple[NDArray[np.float64], str, list[str], list[int]]


class Captures:
    """Histograms [captures, zones, bins] with their metadata.

    ``counts`` is a numpy array of doubles (averaged captures are not whole numbers); zones count
    row by row. Slices (``captures[3]``, ``captures[10:20]``) are views of the same memory.
    """

    counts: NDArray[np.float64]
    metadata: dict[str, Any]
    sources: list[str]
    indices: list[int]

    def __init__(
        self,
        counts: ArrayLike,
        *,
        rows: int | None = None,
        columns: int | None = None,
        bin_width_ps: float = 0.0,
        exposures: float = 1.0,
        dispersion: float | None = None,
        truth: Sequence[Mapping[str, float]] | None = None,
        sensor_poses: ArrayLike | None = None,
        sensor: str = "",
        description: str = "",
        source: str = "memory",
    ) -> None:
        """
        counts: [zones, bins] of one capture, [captures, zones, bins], or
            [captures, rows, columns, bins]. C-contiguous doubles are not copied.
        rows, columns: layout of the zones; a square unless stated.
        bin_width_ps: nominal width of a bin, ps; 0: not known, a fit assumes the scene's.
        exposures: exposures that were averaged in each capture, > 0.
        dispersion: variance / mean of one exposure's counts; None: the sensor's.
        truth: for each capture what is known of the object: x_m, y_m, z_m, yaw_rad, size.
        sensor_poses: [captures, 4, 4] take sensor coordinates to the world, m; None: the scene's.
        Raises Error if these do not suit each other.
        """
        array = np.ascontiguousarray(counts, dtype=np.float64)
        if array.ndim == 4:
            rows, columns = array.shape[1], array.shape[2]
            array = array.reshape(array.shape[0], -1, array.shape[3])
        elif array.ndim == 2:
            array = array[np.newaxis]
        if array.ndim != 3:
            raise Error(
                f"counts: found {array.ndim} axes, accepted: [zones, bins], "
                "[captures, zones, bins] or [captures, rows, columns, bins]"
            )
        number, zones, bins = array.shape
        if rows is None and columns is None:
            side = round(zones**0.5)
            rows = columns = side
        elif columns is None:
            columns = zones // int(rows or 1)
        elif rows is None:
            rows = zones // columns
        if int(rows or 0) * int(columns or 0) != zones:
            raise Error(f"rows and columns: found {zones} zones, accepted: {rows} x {columns}")
        entries: list[dict[str, Any]] = [{"exposures": float(exposures)} for _ in range(number)]
        for i, entry in enumerate(entries):
            if dispersion is not None:
                entry["dispersion"] = float(dispersion)
            if truth is not None:
                entry["truth"] = {k: float(v) for k, v in _one_each(truth, number, "truth")[i].items()}
            if sensor_poses is not None:
                entry["sensor_pose"] = _pose_entry(
                    _one_each(np.asarray(sensor_poses, dtype=float), number, "sensor_poses")[i]
                )
        self.counts = array
        self.metadata = {
            "format": "blindcorner.capture/1",
            "sensor": sensor,
            "description": description,
            "bin_width_ps": float(bin_width_ps),
            "rows": int(rows or 0),
            "columns": int(columns or 0),
            "bins": bins,
            "captures": entries,
        }
        self.sources = [source] * number
        self.indices = list(range(number))

    @classmethod
    def _from_core(cls, arrays: CoreArrays) -> Captures:
        counts, metadata, sources, indices = arrays
        return cls._of(counts, json.loads(metadata), sources, indices)

    @classmethod
    def _of(cls, counts: NDArray[np.float64], metadata: dict[str, Any], sources: list[str],
            indices: list[int]) -> Captures:
        captures = cls.__new__(cls)
        captures.counts = counts
        captures.metadata = metadata
        captures.sources = list(sources)
        captures.indices = list(indices)
        return captures

    def _arrays(self) -> CoreArrays:
        """The captures as the library takes them."""
        return (
            np.ascontiguousarray(self.counts, dtype=np.float64),
            json.dumps(self.metadata),
            self.sources,
            self.indices,
        )

    @property
    def rows(self) -> int:
        """Rows of zones."""
        return int(self.metadata["rows"])

    @property
    def columns(self) -> int:
        """Columns of zones."""
        return int(self.metadata["columns"])

    @property
    def zones(self) -> int:
        """Number of zones."""
        return int(self.counts.shape[1])

    @property
    def bins(self) -> int:
        """Bins of a histogram."""
        return int(self.counts.shape[2])

    @property
    def bin_width_ps(self) -> float:
        """Nominal width of a bin, ps; 0: not known."""
        return float(self.metadata.get("bin_width_ps", 0.0))

    @property
    def exposures(self) -> NDArray[np.float64]:
        """[captures] exposures that were averaged."""
        return np.array([e.get("exposures", 1.0) for e in self.metadata["captures"]])

    @property
    def truth(self) -> list[dict[str, float]]:
        """For each capture what is known of the object: x_m, yaw_rad, ...; may be empty."""
        return [dict(e.get("truth", {})) for e in self.metadata["captures"]]

    @property
    def sensor_poses(self) -> NDArray[np.float64]:
        """[captures, 4, 4] take sensor coordinates to the world, m; NaN: the capture has no pose of
        its own, so that of the scene is used."""
        return np.array([_pose_matrix(e.get("sensor_pose")) for e in self.metadata["captures"]])

    def cube(self) -> NDArray[np.float64]:
        """The counts as [captures, rows, columns, bins], a view of the same memory."""
        return self.counts.reshape(len(self), self.rows, self.columns, self.bins)

    def save(self, path: PathLike) -> None:
        """Writes a capture file (.exr), or .npz or .csv (docs/capture.md). Raises Error."""
        _core.save_captures(os.fspath(path), *self._arrays())

    def __len__(self) -> int:
        return int(self.counts.shape[0])

    def __getitem__(self, which: int | slice) -> Captures:
        if not isinstance(which, slice):
            place = which + len(self) if which < 0 else which
            if not 0 <= place < len(self):
                raise IndexError(f"capture {which} of {len(self)}")
            which = slice(place, place + 1)
        return Captures._of(
            self.counts[which],
            {**self.metadata, "captures": self.metadata["captures"][which]},
            self.sources[which],
            self.indices[which],
        )

    def __iter__(self) -> Iterator[Captures]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        width = f" of {self.bin_width_ps:.4g} ps" if self.bin_width_ps else ""
        name = self.metadata.get("sensor") or "no sensor named"
        total = self.counts.sum() / max(len(self), 1)
        return (
            f"Captures ({name}): {len(self)} of {self.rows} x {self.columns} zones, "
            f"{self.bins} bins{width}, {total:.4g} counts in a capture"
        )


def _one_each(values: Any, number: int, name: str) -> Any:
    if len(values) != number:
        raise Error(f"{name}: found {len(values)}, accepted: {number}, one for each capture")
    return values


def _pose_entry(matrix: NDArray[np.float64]) -> dict[str, list[float]]:
    """Position and unit quaternion (w, x, y, z) of a matrix [4, 4]."""
    m = matrix[:3, :3]
    # The largest component first keeps the others accurate (Shepperd 1978).
    squares = np.array([
        1 + m[0, 0] + m[1, 1] + m[2, 2], 1 + m[0, 0] - m[1, 1] - m[2, 2],
        1 - m[0, 0] + m[1, 1] - m[2, 2], 1 - m[0, 0] - m[1, 1] + m[2, 2],
    ])
    rows = np.array([
        [squares[0], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
        [m[2, 1] - m[1, 2], squares[1], m[1, 0] + m[0, 1], m[0, 2] + m[2, 0]],
        [m[0, 2] - m[2, 0], m[1, 0] + m[0, 1], squares[2], m[2, 1] + m[1, 2]],
        [m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[2, 1] + m[1, 2], squares[3]],
    ])
    row = rows[int(np.argmax(squares))]
    return {
        "position_m": [float(v) for v in matrix[:3, 3]],
        "quaternion_wxyz": [float(v) for v in row / np.linalg.norm(row)],
    }


def _pose_matrix(entry: Mapping[str, Any] | None) -> NDArray[np.float64]:
    if entry is None:
        return np.full((4, 4), np.nan)
    w, x, y, z = np.array(entry["quaternion_wxyz"]) / np.linalg.norm(entry["quaternion_wxyz"])
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = entry["position_m"]
    return matrix


def load_captures(path: PathLike) -> Captures:
    """Reads a capture file (.exr, docs/capture.md). Raises Error."""
    return Captures._from_core(_core.load_captures(os.fspath(path)))


def import_captures(
    *paths: PathLike,
    format: str = "auto",
    axes: str = "",
    array: str = "",
    pattern: str = "",
    rows: int = 0,
    columns: int = 0,
    bin_width_ps: float = 0.0,
    exposures: float | None = None,
    dispersion: float | None = None,
    truth: Sequence[Mapping[str, float]] | None = None,
    sensor: str = "",
    description: str = "",
    sensor_positions: str = "",
    axes_world: str = "x,y,z",
    sensor_yaw_rad: float = 0.0,
    i2c_address: int = 0,
    repeats: int = 0,
    topic: str = "",
) -> Captures:
    """Captures from other programs' files (docs/capture.md says what is read, and how).

    The options are those of ``blindcorner import``. ``axes`` is the order of an array's axes,
    ``pattern`` the columns of any text table, ``bin_width_ps`` the width of a bin, ps, where the
    file does not state it, ``truth`` what is known of the object in each capture. A ROS 2 bag
    (sqlite3, MCAP) with messages of a TMF882x is read with the package rosbags; ``topic`` names one
    of several. Warnings say what was left out or assumed, one line each. Raises Error that names
    file, place, what was found and what is accepted.
    """
    from ._bags import is_bag, load_bag

    if len(paths) == 1 and (format == "ros" or format == "auto" and is_bag(paths[0])):
        captures, told = load_bag(paths[0], topic=topic, i2c_address=i2c_address)
        captures.metadata.update(bin_width_ps=float(bin_width_ps), description=description)
        captures.metadata["sensor"] = sensor or captures.metadata["sensor"]
        for entry in captures.metadata["captures"]:
            entry.update({k: float(v) for k, v in (("exposures", exposures), ("dispersion", dispersion))
                          if v is not None})
    else:
        arrays, told = _core.import_captures(
            [os.fspath(p) for p in paths], format, axes, array, pattern, rows, columns,
            bin_width_ps * 1e-12, exposures, dispersion, sensor, description, sensor_positions,
            axes_world, sensor_yaw_rad, i2c_address, repeats,
        )
        captures = Captures._from_core(arrays)
    for line in told:
        warnings.warn(line, stacklevel=2)
    if truth is not None:
        for entry, known in zip(captures.metadata["captures"], _one_each(truth, len(captures), "truth")):
            entry["truth"] = {k: float(v) for k, v in known.items()}
    return captures
