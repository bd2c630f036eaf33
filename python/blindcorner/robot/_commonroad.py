# SPDX-License-Identifier: Apache-2.0
"""A drive as a CommonRoad scenario and the trajectory that solves it, by commonroad-io (PyPI)."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from .._core import Error
from .._drive import Drive
from .._scene import PathLike
from ._moments import Floats, Moment, Setting
from ._publish import needs

#: A surface that is no higher is a kerb, which the vehicle drives over, m (docs/drive.md).
KERB_M = 0.05
#: Thickness of a wall that is seen edge-on, m: shapes of CommonRoad have an area.
WALL_M = 0.02
#: Numbers in the file. Those of obstacles count up from FIRST_OBSTACLE_ID.
PROBLEM_ID, LANELET_ID, FIRST_OBSTACLE_ID = 1, 2, 100


def solution_path(path: PathLike) -> Path:
    """Where the trajectory goes: beside the scenario."""
    return Path(path).with_suffix(".solution.xml")


def write_commonroad(path: PathLike, setting: Setting, moments: Sequence[Moment]) -> None:
    """Writes the scenario, and beside it the trajectory (``solution_path``).

    Known surfaces in the vehicle's way are static obstacles; hidden objects are where they truly
    were; the vehicle's start and goal are the planning problem, and its trajectory the solution.
    CommonRoad asks for a lanelet: it is the way that was driven, twice as wide as the vehicle.
    Raises Error without a drive, or for a drive that ended within a frame.
    """
    try:
        from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
        from commonroad.common.solution import CommonRoadSolutionWriter
        from commonroad.common.util import FileFormat
        from commonroad.scenario.scenario import Tag
    except ImportError:
        raise needs("commonroad-io") from None
    if setting.drive is None or any(moment.vehicle is None for moment in moments):
        raise Error(f"{os.fspath(path)}: found no vehicle, accepted: a drive")
    if len(moments) < 2:
        raise Error(f"{os.fspath(path)}: found {len(moments)} frames, accepted: 2 or more")
    build = _Builder(setting, setting.drive, moments)
    writer = CommonRoadFileWriter(
        build.scenario(), build.problems(), author="blindcorner", affiliation="",
        source=f"simulated drive {setting.drive.name}", tags={Tag.URBAN, Tag.SIMULATED},
        file_format=FileFormat.XML)
    solution = CommonRoadSolutionWriter(build.solution())
    try:
        writer.write_to_file(os.fspath(path), OverwriteExistingFile.ALWAYS)
        place = solution_path(path)
        solution.write_to_file(os.fspath(place.parent), place.name, overwrite=True)
    except OSError as error:
        raise Error(f"{os.fspath(path)}: {error.strerror}") from None


class _Builder:
    """Parts of the two files. Steps of time are the frames of the sensor."""

    def __init__(self, setting: Setting, drive: Drive, moments: Sequence[Moment]) -> None:
        self.setting = setting
        self.moments = moments
        self.drive = drive
        self.body: Floats = drive._core.body
        self.dt = 1.0 / drive._core.rate
        self.name = re.sub(r"[^A-Za-z0-9]", "", self.drive.name.title()) or "Drive"

    def identity(self) -> Any:
        from commonroad.scenario.scenario import ScenarioID

        return ScenarioID(country_id="ZAM", map_name=self.name, map_id=1, configuration_id=1,
                          obstacle_behavior="T", prediction_id=1)

    def scenario(self) -> Any:
        from commonroad.scenario.scenario import Scenario

        scenario = Scenario(self.dt, self.identity())
        scenario.add_objects(self._lanelet())
        number = FIRST_OBSTACLE_ID
        for obstacle in [*self._walls(), *self._hidden()]:
            scenario.add_objects(obstacle(number))
            number += 1
        return scenario

    def _lanelet(self) -> Any:
        """The way that was driven, and the vehicle's length before and after it."""
        from commonroad.scenario.lanelet import Lanelet, LaneletType

        length, width, _ = self.body
        vehicles: list[Any] = [m.vehicle for m in self.moments]
        way = [np.array([v.x_m, v.y_m]) for v in vehicles]
        kept = [way[0]]
        for point in way[1:]:
            # Points closer than this would fold the inner side in a tight turn.
            if np.linalg.norm(point - kept[-1]) >= length / 2:
                kept.append(point)
        first, last = (np.array([math.cos(v.yaw_rad), math.sin(v.yaw_rad)]) for v in
                       (vehicles[0], vehicles[-1]))
        middle = np.array([kept[0] - length * first, *kept, way[-1] + length * last])
        along = np.gradient(middle, axis=0)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        left = width * np.stack([-along[:, 1], along[:, 0]], axis=1)
        return Lanelet(middle + left, middle, middle - left, LANELET_ID,
                       lanelet_type={LaneletType.URBAN})

    # --- What stands and moves ---

    def _walls(self) -> list[Any]:
        """Functions that make the static obstacles, given their numbers."""
        from commonroad.scenario.obstacle import ObstacleType

        return [
            self._static(ObstacleType.ROAD_BOUNDARY, corners)
            for _, _, corners, triangles in _core.surfaces(self.setting.scene._core)
            if triangles[..., 2].max() > KERB_M and triangles[..., 2].min() < self.body[2]
        ]

    def _static(self, kind: Any, corners: Floats) -> Any:
        from commonroad.scenario.obstacle import StaticObstacle

        middle = corners.mean(axis=0)
        shape, yaw = _shape(corners - middle)
        return lambda number: StaticObstacle(number, kind, shape, _initial(middle, yaw, 0.0))

    def _hidden(self) -> list[Any]:
        """Functions that make the hidden objects, given their numbers. Objects that stand are
        dynamic obstacles too, because static ones have no kind."""
        truths = [m.truth for m in self.moments]
        if any(truth is None for truth in truths):
            return []
        places = [_core.objects_at(self.setting.scene._core, truth) for truth in truths]
        makers = []
        for track in zip(*places):
            name, _, _, _, _, _, corners, _ = track[0]
            if not len(corners):
                continue
            positions = np.array([[x, y] for _, x, y, *_ in track])
            yaws = np.array([yaw for _, _, _, _, yaw, *_ in track])
            makers.append(self._moving(name, corners, positions, yaws))
        return makers

    def _moving(self, name: str, corners: Floats, positions: Floats, yaws: Floats) -> Any:
        from commonroad.prediction.prediction import TrajectoryPrediction
        from commonroad.scenario.obstacle import DynamicObstacle
        from commonroad.scenario.state import CustomState
        from commonroad.scenario.trajectory import Trajectory

        c, s = math.cos(yaws[0]), math.sin(yaws[0])
        shape, turned = _shape((corners - positions[0]) @ np.array([[c, -s], [s, c]]))
        yaws = yaws + turned
        speeds = np.linalg.norm(np.gradient(positions, self.dt, axis=0), axis=1)
        states = [
            CustomState(time_step=step, position=positions[step], orientation=_angle(yaws[step]),
                        velocity=float(speeds[step]))
            for step in range(1, len(positions))
        ]
        prediction = TrajectoryPrediction(Trajectory(1, states), shape)
        first = _initial(positions[0], yaws[0], float(speeds[0]))
        return lambda number: DynamicObstacle(number, _kind(name), shape, first, prediction)

    # --- What drives ---

    def problems(self) -> Any:
        from commonroad.common.util import Interval
        from commonroad.planning.goal import GoalRegion
        from commonroad.planning.planning_problem import PlanningProblem, PlanningProblemSet
        from commonroad.scenario.state import CustomState

        vehicle: Any = self.moments[0].vehicle
        start = _initial(np.array([vehicle.x_m, vehicle.y_m]), vehicle.yaw_rad, vehicle.speed_m_per_s)
        last = math.ceil(self.drive._core.time_limit / self.dt)
        goal = CustomState(time_step=Interval(0, last), position=self._goal())
        return PlanningProblemSet([PlanningProblem(PROBLEM_ID, start, GoalRegion([goal]))])

    def _goal(self) -> Any:
        """The finish line or the last point, enlarged by the way of one step, because the drive
        ends between two frames."""
        import shapely
        from commonroad.geometry.occupancy.circle_occupancy import CircleOccupancy
        from commonroad.geometry.occupancy.rect_occupancy import RectOccupancy

        step = self.dt * max(m.vehicle.speed_m_per_s for m in self.moments if m.vehicle)
        line = self.drive._core.finish_line
        if line is None:
            return CircleOccupancy(radius=self.drive._core.goal_tolerance + step,
                                   circle_center=shapely.Point(*self.drive.route[-1]))
        along = line[1] - line[0]
        return RectOccupancy(rect_center=shapely.Point(*line.mean(axis=0)), width=2 * step,
                             length=float(np.linalg.norm(along)),
                             orientation=math.atan2(along[1], along[0]))

    def solution(self) -> Any:
        """The trajectory of the vehicle's reference point, as that of a point mass: CommonRoad's
        vehicle models have reference points and bodies of their own."""
        from commonroad.common.solution import (CostFunction, PlanningProblemSolution, Solution,
                                                VehicleModel, VehicleType)
        from commonroad.scenario.state import PMState
        from commonroad.scenario.trajectory import Trajectory

        states = []
        for step, moment in enumerate(self.moments):
            v: Any = moment.vehicle
            states.append(PMState(time_step=step, position=np.array([v.x_m, v.y_m]),
                                  velocity=v.speed_m_per_s * math.cos(v.yaw_rad),
                                  velocity_y=v.speed_m_per_s * math.sin(v.yaw_rad)))
        return Solution(self.identity(), [PlanningProblemSolution(
            PROBLEM_ID, VehicleModel.PM, VehicleType.BMW_320i, CostFunction.WX1,
            Trajectory(0, states))])


def _angle(yaw: float) -> float:
    return math.remainder(float(yaw), 2 * math.pi)


def _initial(position: Floats, yaw: float, speed: float) -> Any:
    from commonroad.scenario.state import InitialState

    return InitialState(time_step=0, position=np.asarray(position, dtype=float), orientation=_angle(yaw),
                        velocity=speed, acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)


def _shape(corners: Floats) -> tuple[Any, float]:
    """The shape of corners that are relative to the object's position: a polygon, or a thin
    rectangle for two corners. Also the yaw (rad) at which the shape lies as the corners do."""
    from commonroad.geometry.obstacle_shapes.polygon_obstacle_shape import PolygonObstacleShape
    from commonroad.geometry.obstacle_shapes.rect_obstacle_shape import RectObstacleShape

    if len(corners) >= 3:
        return PolygonObstacleShape(tuple((float(x), float(y)) for x, y in corners)), 0.0
    along = corners[1] - corners[0]
    return (RectObstacleShape(width=WALL_M, length=float(np.linalg.norm(along))),
            math.atan2(along[1], along[0]))


def _kind(name: str) -> Any:
    """CommonRoad's type of obstacle for an object of that name."""
    from commonroad.scenario.obstacle import ObstacleType

    words = {"cycl": ObstacleType.BICYCLE, "bike": ObstacleType.BICYCLE,
             "person": ObstacleType.PEDESTRIAN, "pedestrian": ObstacleType.PEDESTRIAN,
             "car": ObstacleType.CAR}
    return next((kind for word, kind in words.items() if word in name.lower()), ObstacleType.UNKNOWN)
