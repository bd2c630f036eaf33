# SPDX-License-Identifier: Apache-2.0
"""Sees around corners: the pose of a hidden object from single-photon LiDAR histograms.

    import blindcorner as bc

    scene = bc.Scene.load(bc.bundled("tmf8828_wall.json"))
    captures = bc.load_captures(bc.bundled("captures/tmf8828_wall.exr"))
    result = bc.fit(scene, captures)

Lengths are metres, angles radians, times seconds, unless a name ends in another unit. Histograms
are numpy arrays [captures, zones, bins]; zones count row by row. Vectors and matrices over poses
follow the order of ``Scene.unknowns``. Mistakes raise :class:`Error`, whose one line names the
place, what was found and what is accepted. All calculations run without the
interpreter's lock, and Ctrl-C ends them.
"""

from ._core import Error, OutputError, set_threads
from ._core import version as __version__
from ._captures import Captures, import_captures, load_captures
from ._drive import Drive, DriveRun, Plan, drive, load_map, plan
from ._fit import Fitter, Tracker, fit, fit_each, fit_joint
from ._result import FittedHistograms, Mode, Result, Results, load_results
from ._scene import Scene, bundled, preset, presets
from ._studies import (
    Bound,
    Calibration,
    Explanation,
    PoseBound,
    bound,
    calibrate,
    explain,
)
from ._render import render

# Their full names are those under which users import them.
Error.__module__ = OutputError.__module__ = __name__

__all__ = [
    "Bound",
    "Calibration",
    "Captures",
    "Drive",
    "DriveRun",
    "Error",
    "Explanation",
    "FittedHistograms",
    "Fitter",
    "Mode",
    "OutputError",
    "Plan",
    "PoseBound",
    "Result",
    "Results",
    "Scene",
    "Tracker",
    "__version__",
    "bound",
    "bundled",
    "calibrate",
    "drive",
    "explain",
    "fit",
    "fit_each",
    "fit_joint",
    "import_captures",
    "load_captures",
    "load_map",
    "load_results",
    "plan",
    "preset",
    "presets",
    "render",
    "set_threads",
]
