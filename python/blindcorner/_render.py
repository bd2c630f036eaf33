# SPDX-License-Identifier: Apache-2.0
"""Captures that a forward model makes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from . import _core
from ._captures import Captures
from ._scene import PoseLike, Scene, SensorPoseLike, named, sensor_matrix


def render(
    scene: Scene,
    *,
    pose: PoseLike | Sequence[Mapping[str, float]] | None = None,
    random: int = 0,
    sensor_pose: SensorPoseLike | Sequence[SensorPoseLike] | None = None,
    frames: int = 0,
    photons: float = 0.0,
    seed: int = 1,
    model: str = "reference",
    noiseless: bool = False,
    empty: bool = False,
    sampling: float | None = None,
    tolerance: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Captures:
    """Captures of a scene, as ``blindcorner render`` makes them: the same seed gives the same counts.

    pose: of the object, by names (``{"x_m": 0.3, "yaw_deg": 20}``; names left out keep the scene's
        values), or a vector or an array [poses, unknowns] (m, rad, 1). Each pose of a list makes a
        capture.
    random: number of further poses, drawn from the scene's prior.
    sensor_pose: by names or as a matrix [4, 4] (m), or a list of them. ``frames`` spreads this
        number of poses along the way through them.
    photons: of the third bounce in a capture, over an equal background; 0: the scene's exposure.
    model: "reference", or the faster "fast" (with its ``tolerance``, a share of the peak).
    noiseless: expected counts, without ambient light; empty: without an object.
    progress: called with the number of captures done and that of all.
    Returns captures with the true pose and the sensor's. Raises Error.
    """
    poses: list[list[tuple[str, float]]] = []
    if isinstance(pose, Mapping):
        poses = [named(pose)]
    elif isinstance(pose, Sequence) and any(isinstance(p, Mapping) for p in pose):
        poses = [named(p) for p in pose]  # type: ignore[arg-type]
    elif pose is not None:
        vectors = np.atleast_2d(np.asarray(pose, dtype=float))
        poses = [list(zip(scene.unknowns, scene.pose(v).tolist())) for v in vectors]
    sensors = []
    if sensor_pose is not None:
        several = isinstance(sensor_pose, Sequence) or (
            isinstance(sensor_pose, np.ndarray) and sensor_pose.ndim == 3
        )
        for one in sensor_pose if several else [sensor_pose]:  # type: ignore[union-attr]
            sensors.append(sensor_matrix(scene, one))  # type: ignore[arg-type]
    arrays = _core.render(
        scene._core, poses, random, sensors, frames, model, noiseless, empty, seed, photons,
        sampling, tolerance, progress,
    )
    captures = Captures._from_core(arrays)
    captures.sources = [f"render({scene.name})"] * len(captures)
    return captures
