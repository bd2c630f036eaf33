# SPDX-License-Identifier: Apache-2.0
"""Hidden objects as robots speak of them: position, heading, a 6 x 6 covariance, 95 % ellipses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .. import _core
from .._scene import Scene
from ._moments import Floats, Hypothesis

#: Squared radius of the region that holds 95 % of a normal distribution in the plane: the quantile
#: of chi-square with two degrees of freedom, -2 ln 0.05.
CHI_SQUARE_95 = -2 * math.log(0.05)
#: Row and column of a ROS covariance (x, y, z, roll, pitch, yaw) for each component of a pose.
ROS_ROWS = {"x_m": 0, "y_m": 1, "z_m": 2, "yaw_rad": 5}


@dataclass(frozen=True, eq=False)
class Estimate:
    """One hidden object in one explanation, in the map frame."""

    name: str
    weight: float  #: of the explanation, given that there is an object
    position: Floats  #: [3] of the object's anchor, m
    yaw_rad: float
    size: float  #: factor on all lengths
    covariance: Floats  #: [6, 6] of x, y, z (m), roll, pitch, yaw (rad)
    footprint: Floats  #: [corners, 2] seen from above, m
    triangles: Floats  #: [n, 3, 3] its surface, m

    def ellipse(self) -> tuple[float, float, float]:
        """Semi-axes (m, the longer first) and direction (rad) of the 95 % region of x and y."""
        values, vectors = np.linalg.eigh(self.covariance[:2, :2])
        minor, major = np.sqrt(CHI_SQUARE_95 * np.maximum(values, 0))
        return float(major), float(minor), math.atan2(vectors[1, 1], vectors[0, 1])

    def ellipse_points(self, corners: int = 48) -> Floats:
        """[corners, 2] the 95 % region as a polygon, m."""
        major, minor, angle = self.ellipse()
        turns = np.linspace(0, 2 * np.pi, corners, endpoint=False)
        along, across = major * np.cos(turns), minor * np.sin(turns)
        cosine, sine = math.cos(angle), math.sin(angle)
        return self.position[:2] + np.stack(
            [cosine * along - sine * across, sine * along + cosine * across], axis=1)


def ros_covariance(unknowns: list[str], name: str, several: bool, covariance: Floats) -> Floats:
    """[6, 6] of one object. A component that is not among the unknowns has a variance of 0, because
    the scene states it or the model assumes it (objects stand upright)."""
    picked, rows = [], []
    for i, unknown in enumerate(unknowns):
        owner, _, component = unknown.rpartition(".")
        if component in ROS_ROWS and (not several or owner == name):
            picked.append(i)
            rows.append(ROS_ROWS[component])
    matrix = np.zeros((6, 6))
    matrix[np.ix_(rows, rows)] = covariance[np.ix_(picked, picked)]
    return matrix


def estimates(scene: Scene, hypothesis: Hypothesis) -> list[Estimate]:
    """The objects that an explanation has, in the scene's order."""
    bodies = _core.objects_at(scene._core, hypothesis.pose)
    found = []
    for name, x, y, z, yaw, size, footprint, triangles in bodies:
        if not len(footprint):
            continue
        covariance = ros_covariance(scene.unknowns, name, len(bodies) > 1, hypothesis.covariance)
        found.append(Estimate(name, hypothesis.weight, np.array([x, y, z]), yaw, size, covariance,
                              footprint, triangles))
    return found


# --- What the zones look at -------------------------------------------------------------------------


def zone_points(scene: Scene, sensor: Floats) -> Floats:
    """[zones, 3] points where the middle of each zone meets the first known surface, m, in the map
    frame; NaN: it meets none. ``sensor`` [4, 4] takes sensor coordinates to the map."""
    axes = _core.zone_axes(scene._core) @ sensor[:3, :3].T
    surfaces = [triangles for _, _, _, triangles in _core.surfaces(scene._core)]
    distances = ray_distances(sensor[:3, 3], axes, np.concatenate(surfaces or [np.empty((0, 3, 3))]))
    points: Floats = sensor[:3, 3] + axes * distances[:, np.newaxis]
    return points


def ray_distances(origin: Floats, axes: Floats, triangles: Floats) -> Floats:
    """[rays] distances to the first of the triangles [n, 3, 3] along unit vectors [rays, 3], m;
    NaN: none is met. Moeller and Trumbore 1997, both sides."""
    if not len(triangles):
        return np.full(len(axes), np.nan)
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(axes[:, np.newaxis], v)  # [rays, n, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / np.einsum("rnk,nk->rn", p, u)
        s = origin - a
        first = np.einsum("rnk,nk->rn", p, s) * inverse
        q = np.cross(s, u)
        second = np.einsum("rk,nk->rn", axes, q) * inverse
        distance = np.einsum("nk,nk->n", v, q) * inverse
        inside = (first >= 0) & (second >= 0) & (first + second <= 1) & (distance > 1e-9)
    nearest = np.where(inside, distance, np.inf).min(axis=1)
    return np.where(np.isfinite(nearest), nearest, np.nan)


@dataclass(frozen=True, eq=False)
class ZoneScan:
    """One row of zones as a laser scan: rays from right to left in the sensor's plane."""

    first_rad: float  #: of the first ray, counter-clockwise from the sensor's axis
    step_rad: float  #: from ray to ray
    ranges: Floats  #: [columns] to the surface that the zone looks at, m; infinite: none
    intensities: Floats  #: [columns] counts of the zone; empty without histograms


def zone_scan(scene: Scene, sensor: Floats, counts: Floats | None = None) -> ZoneScan | None:
    """The middle row of zones (the lower of two). None: a zone's direction is not known. The scan's
    step is constant; the zones' angles are evenly spaced but for the effect of the tangent."""
    columns = slice(scene.rows // 2 * scene.columns, (scene.rows // 2 + 1) * scene.columns)
    axes = _core.zone_axes(scene._core)[columns]
    if not np.isfinite(axes).all():
        return None
    angles = np.arctan2(axes[:, 1], axes[:, 0])
    order = np.argsort(angles)
    points = zone_points(scene, sensor)[columns][order]
    ranges = np.linalg.norm(points - sensor[:3, 3], axis=1)
    step = 0.0 if len(order) == 1 else float(angles[order[-1]] - angles[order[0]]) / (len(order) - 1)
    intensities = np.empty(0) if counts is None else counts[columns][order].sum(axis=1)
    return ZoneScan(float(angles[order[0]]), step, np.where(np.isnan(ranges), np.inf, ranges),
                    intensities)
