# SPDX-License-Identifier: Apache-2.0
"""About instrument and scene: calibration, what the model needs, the error to expect."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._captures import Captures
from ._scene import PathLike, PoseLike, Scene

#: Tolerance of the models that a fit begins with, a share of the signal's peak.
FIRST_TOLERANCE = 0.1


class Calibration:
    """What captures say about the instrument (docs/instrument.md)."""

    def __init__(self, scene: Scene, text: str) -> None:
        self.before = scene  #: the scene that was calibrated
        self._text = text
        self.document: dict[str, Any] = json.loads(text)  #: fields of the instrument file

    @property
    def scene(self) -> Scene:
        """The scene with everything that was found out, as ``fit --instrument`` uses it."""
        core = self.before._core
        return Scene(_core.Scene.from_text(_core.patched_text(core.text, self._text), core.path,
                                           core.nominal_bin_width_s))

    @property
    def parameters(self) -> list[dict[str, Any]]:
        """Name, prior, value and standard error of each parameter, and whether the data determine
        it."""
        return self.document["parameters"]

    def to_dict(self) -> dict[str, Any]:
        """The fields of the instrument file."""
        return self.document

    def save(self, path: PathLike) -> None:
        """Writes an instrument file for ``fit --instrument`` and :meth:`Scene.load`. Raises Error."""
        _core.write_atomically(os.fspath(path), self._text)

    def __repr__(self) -> str:
        lines = [f"Calibration of {self.before.name} from {self.document['captures_used']} captures"]
        for parameter in self.parameters:
            lines.append("  " + ", ".join(f"{k} {_short(v)}" for k, v in parameter.items()))
        return "\n".join(lines + [f"  {note}" for note in self.document.get("notes", [])])


def _short(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def calibrate(
    scene: Scene,
    captures: Captures,
    *,
    no_object: bool = False,
    assignments: bool = True,
    wraps: bool = True,
    background: bool = True,
    variance_scale: bool = True,
    progress: Callable[[float], None] | None = None,
) -> Calibration:
    """Finds out about the instrument (time zero, pulse, gains, noise, background) from captures of
    known objects (their ``truth``), or of none (``no_object``), as ``blindcorner calibrate``.

    assignments: find out which relay spot belongs to which zone. wraps: find out where time axes
    wrap.
    background: estimate static light of each zone. variance_scale: scale the noise until fits of
    these captures are honest. progress: called with the share that is done, 0 to 1. Raises Error.
    """
    text = _core.calibrate(scene._core, *captures._arrays(), no_object, assignments, wraps,
                           background, variance_scale, progress)
    return Calibration(scene, text)


@dataclass(frozen=True)
class Explanation:
    """What the forward model does for a scene, what it leaves out and why, and how many photons to
    expect. Counts are of one capture at one pose."""

    scene: str
    kernel: str  #: lambertian, brdf_pairs, retro_single or retro_pairs: how the object carries light
    terms: list[dict[str, Any]]  #: name, used, reason, bound (share of the peak; None: unknown)
    zones: dict[str, NDArray[np.float64]]
    """[zones] ``direct``, ``three_bounce``, ``peak`` (counts), ``gate_bins``,
    ``background_per_bin`` (counts), ``signal_to_noise``"""
    exponents: dict[str, float]  #: d log counts / d log distance at this pose
    sampling: dict[str, int]  #: lit_points, seen_points, object_points of the model
    hints: list[str]  #: about the scene, and about the pose

    def __repr__(self) -> str:
        lines = [f"scene {self.scene}: {self.kernel} kernel"]
        for term in self.terms:
            used = "used" if term["used"] else "left out"
            bound = "" if term["used"] or term["bound"] is None else f", at most {term['bound']:.2g}"
            lines.append(f"  {term['name']:<38} {used}{bound}: {term['reason']}")
        total = self.zones["three_bounce"].sum()
        noise = np.sqrt((self.zones["signal_to_noise"] ** 2).sum())
        lines.append(f"  {total:.4g} three-bounce counts in a capture, signal to noise {noise:.3g}")
        return "\n".join(lines + self.hints)


def explain(scene: Scene, pose: PoseLike | None = None, *,
            tolerance: float = FIRST_TOLERANCE, **components: float) -> Explanation:
    """What ``blindcorner explain`` prints, without the timings.

    pose: of the object for the photons, as for :meth:`Scene.pose`; by default the scene's own.
    tolerance: of the fast model, a share of the signal's peak. Raises Error.
    """
    vector = scene.pose(pose, **components) if components else scene.pose(pose)
    found = json.loads(_core.explain(scene._core, vector, tolerance))
    zones = found["zones"]
    return Explanation(
        scene.name,
        found["kernel"],
        found["terms"],
        {name: np.array([zone[name] for zone in zones], dtype=float) for name in zones[0]},
        found["exponents"],
        found.get("sampling", {}),
        found["hints"] + found["pose_hints"],
    )


@dataclass(frozen=True, eq=False)
class PoseBound:
    """Bounds on the errors with the object at one pose; covariances [unknowns, unknowns], m, rad, 1."""

    pose: NDArray[np.float64]  #: [unknowns]
    photons: float  #: expected of the object's light
    cramer_rao: NDArray[np.float64]  #: of the photons alone
    with_prior: NDArray[np.float64]  #: the prior counted as a measurement (van Trees)
    ambiguity: NDArray[np.float64]  #: Weiss and Weinstein's, for poses that look alike
    position_error_m: float  #: m, over all unknown positions: the larger of the last two
    ambiguous: bool  #: the ambiguity bound is the larger one
    detection_probability: float  #: share of captures in which the object would be noticed

    def __repr__(self) -> str:
        kind = ", ambiguous" if self.ambiguous else ""
        return (
            f"PoseBound at {np.array2string(self.pose, precision=3)}: {self.position_error_m:.3g} m"
            f"{kind}, noticed in {100 * self.detection_probability:.0f} % of captures, "
            f"{self.photons:.4g} photons"
        )


class Bound:
    """The error that no method beats, and where nothing would be noticed (docs/bound.md)."""

    def __init__(self, scene: Scene, core: _core.Bound) -> None:
        self.scene = scene
        self._core = core

    @property
    def exposures(self) -> float:
        """Exposures averaged in a capture."""
        return self._core.exposures

    @property
    def prior_error_m(self) -> float:
        """Position error of an answer that does not look at the capture, m."""
        return self._core.prior_error_m

    def at(self, pose: PoseLike | None = None, *, brightness: float = 1.0,
           **components: float) -> PoseBound:
        """The bounds with the object at a pose (as for :meth:`Scene.pose`), ``brightness`` times as
        bright as the scene states. Raises Error."""
        vector = self.scene.pose(pose, **components) if components else self.scene.pose(pose)
        return PoseBound(**self._core.at(vector, brightness))


def bound(
    scene: Scene,
    *,
    photons: float = 0.0,
    exposures: float | None = None,
    ambient: float | None = None,
    test_poses: int = 1000,
    prior: bool = True,
    tolerance: float = 0.05,
    seed: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Bound:
    """The error to expect, before there is a capture; ask the returned :class:`Bound` about places.

    photons: of the third bounce on average over the search region, over an equal background; 0: the
        scene's own exposure. exposures, ambient (counts per bin of one exposure): if stated, they
        replace those values.
    test_poses: poses that a place may be mistaken for. prior: count what the scene says of the pose.
    tolerance: of the fast model, a share of the peak. seed: of simulated empty captures.
    progress: called with the number of test poses done and that of all. Raises Error.
    """
    return Bound(scene, _core.Bound.make(scene._core, photons, exposures, ambient, test_poses, prior,
                                         tolerance, seed, progress))
