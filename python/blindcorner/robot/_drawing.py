# SPDX-License-Identifier: Apache-2.0
"""Pictures of a moment, before they become markers of ROS or entities of Foxglove."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .. import _core
from ._estimates import Estimate, estimates, zone_points
from ._moments import Floats, Moment, Setting, Vehicle

Colour = tuple[float, float, float, float]  # red, green, blue, opacity, 0 to 1

WALL: Colour = (0.62, 0.64, 0.68, 0.6)
RELAY: Colour = (0.75, 0.72, 0.6, 0.8)
ANSWER: Colour = (0.84, 0.19, 0.15, 1.0)
TRUTH: Colour = (0.1, 0.6, 0.25, 1.0)
VEHICLE: Colour = (0.13, 0.4, 0.67, 0.8)
LIGHT: Colour = (0.95, 0.8, 0.1, 0.6)
#: Least opacity of an explanation, so that rivals of little weight can be seen.
FAINTEST = 0.15
#: Explanations below this share are drawn without a label.
LEAST_LABEL = 0.05
#: How far below itself a level surface is drawn, m, so that a grid on it is seen.
BELOW_M = 0.01
#: Thickness of lines as a share of the edge of a grid's cell.
LINE_SHARE = 0.3


@dataclass(frozen=True, eq=False)
class Line:
    """A polygon, or pairs of points that are joined (``pairs``)."""

    name: str
    points: Floats  #: [n, 3] m, map frame
    colour: Colour
    width: float  #: m
    pairs: bool = False


@dataclass(frozen=True, eq=False)
class Faces:
    """Triangles."""

    name: str
    triangles: Floats  #: [n, 3, 3] m, map frame
    colour: Colour


@dataclass(frozen=True, eq=False)
class Box:
    """The vehicle's body, about its middle."""

    name: str
    vehicle: Vehicle
    size: Floats  #: [3] m
    colour: Colour


@dataclass(frozen=True, eq=False)
class Label:
    """A text that faces the viewer."""

    name: str
    position: Floats  #: [3] m, map frame
    text: str
    height: float  #: m
    colour: Colour


Part = Line | Faces | Box | Label


def surfaces(setting: Setting) -> list[Part]:
    """The known surfaces."""
    parts: list[Part] = []
    for name, relay, _, triangles in _core.surfaces(setting.scene._core):
        level = np.ptp(triangles[..., 2]) == 0
        parts.append(Faces(name, triangles - [0, 0, BELOW_M * level], RELAY if relay else WALL))
    return parts


def _outline(name: str, corners: Floats, z: float, colour: Colour, width: float) -> Line:
    return Line(name, np.column_stack([corners, np.full(len(corners), z)]), colour, width)


def _text(estimate: Estimate, presence: float) -> str:
    return f"{estimate.name} {100 * presence * estimate.weight:.0f} %"


def _answer(setting: Setting, moment: Moment) -> list[Part]:
    parts: list[Part] = []
    width = LINE_SHARE * setting.grid.cell_m
    presence = moment.presence or 0.0
    for number, mode in enumerate(moment.modes):
        share = presence * mode.weight
        colour = (*ANSWER[:3], FAINTEST + (1 - FAINTEST) * min(max(share, 0.0), 1.0))
        for found in estimates(setting.scene, mode):
            name = f"{found.name}/{number}"
            z = float(found.position[2])
            if all(map(math.isfinite, found.ellipse())):
                parts.append(_outline(f"{name}/ellipse95", found.ellipse_points(), z, colour, width))
            parts.append(Faces(f"{name}/body", found.triangles, (*ANSWER[:3], 0.5 * colour[3])))
            top = found.position + [0, 0, float(np.ptp(found.triangles[..., 2]))]
            if share >= LEAST_LABEL:
                parts.append(Label(f"{name}/text", top, _text(found, presence), 4 * width, ANSWER))
    return parts


def moving(setting: Setting, moment: Moment) -> list[Part]:
    """All that changes: explanations with their 95 % ellipses, the truth, the vehicle, and what the
    zones look at."""
    parts = _answer(setting, moment)
    width = LINE_SHARE * setting.grid.cell_m
    if moment.truth is not None:
        for name, _, _, z, _, _, footprint, _ in _core.objects_at(setting.scene._core, moment.truth):
            if len(footprint):
                parts.append(_outline(f"{name}/truth", footprint, z, TRUTH, width))
    if moment.vehicle is not None and setting.body is not None:
        parts.append(Box("vehicle", moment.vehicle, setting.body, VEHICLE))
    sensor = setting.sensor(moment)
    ends = zone_points(setting.scene, sensor)
    ends = ends[np.isfinite(ends).all(axis=1)]
    if len(ends):
        rays = np.stack([np.broadcast_to(sensor[:3, 3], ends.shape), ends], axis=1).reshape(-1, 3)
        parts.append(Line("zones", rays, LIGHT, width / 3, pairs=True))
    return parts
