# SPDX-License-Identifier: Apache-2.0
"""From histograms to the pose of the hidden object."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

from . import _core
from ._captures import Captures
from ._core import Error
from ._result import Result, Results
from ._scene import Scene

#: Called as a fit goes on, from any thread: what is being done, and which share of that is done.
FitProgress = Callable[[str, float], None]

OPTIONS = ("tolerance", "scored_poses", "starts", "importance_samples", "empty_captures",
           "cache_bytes", "seed")


def fit_options(given: dict[str, Any]) -> dict[str, Any]:
    """All options of a fit, with the library's defaults for those not given. Raises Error for other
    names."""
    for name in given:
        if name not in OPTIONS:
            raise Error(f'fit: found the option "{name}", accepted: {", ".join(OPTIONS)}')
    return {"tolerance": None, **_core.fit_defaults, **given}


class Fitter:
    """Fits captures of one scene. What it compiles for the scene serves all captures, in any
    thread.

    Options (those of ``blindcorner fit``, the same defaults):
        tolerance: tolerated error of the fast model, a share of the signal's peak; by default it
            follows from each capture.
        scored_poses: most poses scored before refinement; starts: most candidates refined.
        importance_samples: number drawn where Laplace's approximation fails; 0: never.
        empty_captures: number simulated for the false-alarm probability; 0: leave it out.
        cache_bytes: most memory for compiled sensor placements.
        seed: of everything random. The same seed gives the same result in any thread.
    """

    def __init__(
        self,
        scene: Scene,
        captures: Captures | None = None,
        *,
        progress: FitProgress | None = None,
        **options: Any,
    ) -> None:
        """``captures`` are those that will be fitted, if they are known. Bins that many of them
        fill up are left out (a warning says which). The number of captures that share a sensor pose
        decides how poses are scored. Raises Error."""
        suited = None
        if captures is not None:
            suited = _core.suit(scene._core, *captures._arrays())
            if suited.left_out:
                warnings.warn(suited.left_out, stacklevel=2)
        self._make(scene, suited, progress, options)

    def _make(self, scene: Scene, suited: _core.Suited | None, progress: FitProgress | None,
              options: dict[str, Any]) -> None:
        self.scene = scene
        self.options = fit_options(options)
        self._core = _core.Fitter.make(scene._core, suited, progress=progress, **self.options)

    @classmethod
    def _suited(cls, scene: Scene, suited: _core.Suited, options: dict[str, Any]) -> Fitter:
        fitter = cls.__new__(cls)
        fitter._make(scene, suited, None, options)
        return fitter

    def fit(self, capture: Captures) -> Result:
        """Pose of the hidden object from one capture. Raises Error if the capture does not suit
        the scene (zones, bins, values that are no counts)."""
        if len(capture) != 1:
            raise Error(f"capture: found {len(capture)} captures, accepted: one; fit_each takes many, "
                        "fit_joint makes one fit of them")
        result = self.fit_each(capture)[0]
        if result.error:
            raise Error(result.error)
        return result

    def fit_each(self, captures: Captures,
                 progress: Callable[[int, int], None] | None = None) -> Results:
        """Fits each capture by itself, several at a time. If one fails, the ``error`` of its result
        says why. ``progress`` is called with the number of captures done and that of all."""
        fits = self._core.fit_each(*captures._arrays(), progress)
        return Results([Result._of(self.scene, fit) for fit in fits], self.scene)

    def fit_joint(self, captures: Captures) -> Result:
        """One object seen in all captures, from different sensor poses. Raises Error."""
        result = Result._of(self.scene, self._core.fit_joint(*captures._arrays()))
        if result.error:
            raise Error(result.error)
        return result

    def __repr__(self) -> str:
        return f"Fitter of {self.scene!r}"


class Tracker:
    """A moving object in a sequence of frames: prediction, rival explanations, presence.

    How the object may move is the scene's field ``motion``. Frames come in the order of time; calls
    from several threads wait for each other.
    """

    def __init__(self, scene: Scene | Fitter, captures: Captures | None = None,
                 **options: Any) -> None:
        """``captures`` and ``options`` as for :class:`Fitter`, which may be given instead."""
        self.fitter = scene if isinstance(scene, Fitter) else Fitter(scene, captures, **options)
        self.scene = self.fitter.scene
        self._core = _core.Tracker.make(self.fitter._core)

    def advance(self, frame: Captures, dt: float | None = None) -> Result:
        """What is known after the next frame, one capture. ``dt``: s since the frame before; by
        default the scene's ``motion.frame_interval_s``. Raises Error for a frame that cannot be
        used; the object is then predicted across it."""
        if len(frame) != 1:
            raise Error(f"frame: found {len(frame)} captures, accepted: one")
        result = Result._of(self.scene, self._core.advance(*frame._arrays(), dt))
        if result.error:
            raise Error(result.error)
        return result

    def results(self) -> Results:
        """Results of all frames so far. ``track.smoothed_pose`` also uses the later frames."""
        return Results([Result._of(self.scene, fit) for fit in self._core.smoothed()], self.scene)


def fit(scene: Scene, capture: Captures, *, progress: FitProgress | None = None,
        **options: Any) -> Result:
    """Pose of the hidden object from one capture, as ``blindcorner fit SCENE CAPTURE`` finds it.
    Options as for :class:`Fitter`. Raises Error."""
    if len(capture) != 1:
        raise Error(f"capture: found {len(capture)} captures, accepted: one; fit_each takes many, "
                    "fit_joint makes one fit of them")
    return Fitter(scene, capture, progress=progress, **options).fit(capture)


def fit_each(scene: Scene, captures: Captures, *,
             progress: Callable[[int, int], None] | None = None, **options: Any) -> Results:
    """Each capture by itself, as ``blindcorner fit SCENE CAPTURES``. Options as for
    :class:`Fitter`; ``progress`` is called with the captures done and their number."""
    return Fitter(scene, captures, **options).fit_each(captures, progress)


def fit_joint(scene: Scene, captures: Captures, *, progress: FitProgress | None = None,
              **options: Any) -> Result:
    """One object seen in all captures, as ``blindcorner fit --joint``. Options as for
    :class:`Fitter`. Raises Error."""
    return Fitter(scene, captures, progress=progress, **options).fit_joint(captures)
