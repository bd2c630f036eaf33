# SPDX-License-Identifier: Apache-2.0
"""Moments as ROS 2 messages, which rosbags or the classes of rclpy make."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from .._captures import _pose_entry
from ._drawing import Box, Faces, Line, Part, moving, surfaces
from ._estimates import Estimate, zone_scan
from ._moments import Floats, Grid, Moment, Setting
from ._publish import Naming, half_turn, stated

#: Makes a message of a type from fields; fields that are left out have the type's default.
Make = Callable[..., Any]

# Constants of visualization_msgs/msg/Marker.
CUBE, LINE_STRIP, LINE_LIST, TEXT_VIEW_FACING, TRIANGLE_LIST = 1, 4, 5, 9, 11
ADD, DELETE_ALL = 0, 3


class RosMessages:
    """(topic, type, message) of a setting and of its moments."""

    def __init__(self, make: Make, naming: Naming = Naming()) -> None:
        naming.validate()
        self._make = make
        self.naming = naming

    # --- Parts ---

    def stamp(self, time_s: float) -> Any:
        """builtin_interfaces/msg/Time of a moment."""
        seconds, nanoseconds = divmod(self.naming.nanoseconds(time_s), 10**9)
        return self._make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)

    def header(self, time_s: float, frame: str = "") -> Any:
        """std_msgs/msg/Header, by default of the map frame."""
        return self._make("std_msgs/msg/Header", stamp=self.stamp(time_s),
                          frame_id=frame or self.naming.map_frame)

    def _point(self, point: Floats) -> Any:
        return self._make("geometry_msgs/msg/Point", **dict(zip("xyz", map(float, point))))

    def _vector(self, *values: float) -> Any:
        return self._make("geometry_msgs/msg/Vector3", **dict(zip("xyz", map(float, values))))

    def _turn(self, yaw: float) -> Any:
        z, w = half_turn(yaw)
        return self._make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=z, w=w)

    def _pose(self, position: Floats, yaw: float) -> Any:
        return self._make("geometry_msgs/msg/Pose", position=self._point(position),
                          orientation=self._turn(yaw))

    # --- Topics ---

    def pose(self, estimate: Estimate, time_s: float) -> Any:
        """geometry_msgs/msg/PoseWithCovarianceStamped; the covariance row by row."""
        pose = self._make("geometry_msgs/msg/PoseWithCovariance",
                          pose=self._pose(estimate.position, estimate.yaw_rad),
                          covariance=np.ascontiguousarray(estimate.covariance.ravel()))
        return self._make("geometry_msgs/msg/PoseWithCovarianceStamped", header=self.header(time_s),
                          pose=pose)

    def grid(self, grid: Grid, occupancy: Floats, time_s: float) -> Any:
        """nav_msgs/msg/OccupancyGrid: 0 to 100 per cent, -1 where nothing is known."""
        known = np.isfinite(occupancy)
        cells = np.where(known, np.rint(100 * np.where(known, occupancy, 0)), -1).astype(np.int8)
        info = self._make("nav_msgs/msg/MapMetaData", map_load_time=self.stamp(time_s),
                          resolution=float(grid.cell_m), width=grid.columns, height=grid.rows,
                          origin=self._pose(np.array([grid.x_m, grid.y_m, 0.0]), 0.0))
        return self._make("nav_msgs/msg/OccupancyGrid", header=self.header(time_s), info=info,
                          data=cells.ravel())

    def presence(self, probability: float) -> Any:
        """std_msgs/msg/Float64."""
        return self._make("std_msgs/msg/Float64", data=float(probability))

    def path(self, points: Floats, time_s: float) -> Any:
        """nav_msgs/msg/Path; a pose looks towards the next one."""
        steps = np.diff(points, axis=0)
        yaws = np.arctan2(steps[:, 1], steps[:, 0]) if len(steps) else np.zeros(1)
        yaws = np.append(yaws, yaws[-1])
        poses = [
            self._make("geometry_msgs/msg/PoseStamped", header=self.header(time_s),
                       pose=self._pose(np.append(point, 0.0), float(yaw)))
            for point, yaw in zip(points, yaws)
        ]
        return self._make("nav_msgs/msg/Path", header=self.header(time_s), poses=poses)

    def transform(self, parent: str, child: str, matrix: Floats, time_s: float) -> Any:
        """geometry_msgs/msg/TransformStamped: [4, 4] takes the child's coordinates to the parent's."""
        entry = _pose_entry(matrix)
        turn = dict(zip("wxyz", entry["quaternion_wxyz"]))
        return self._make(
            "geometry_msgs/msg/TransformStamped", header=self.header(time_s, parent),
            child_frame_id=child,
            transform=self._make("geometry_msgs/msg/Transform",
                                 translation=self._vector(*entry["position_m"]),
                                 rotation=self._make("geometry_msgs/msg/Quaternion", **turn)))

    def scan(self, setting: Setting, moment: Moment) -> Any | None:
        """sensor_msgs/msg/LaserScan of the middle row of zones. None: where they look is not
        known."""
        sensor = setting.sensor(moment)
        scan = zone_scan(setting.scene, sensor, moment.counts)
        if scan is None:
            return None
        finite = scan.ranges[np.isfinite(scan.ranges)]
        return self._make(
            "sensor_msgs/msg/LaserScan",
            header=self.header(moment.time_s, self.naming.sensor_frame),
            angle_min=scan.first_rad,
            angle_max=scan.first_rad + scan.step_rad * (len(scan.ranges) - 1),
            angle_increment=scan.step_rad, range_min=0.0,
            range_max=float(2 * finite.max()) if len(finite) else 1.0,
            ranges=scan.ranges.astype(np.float32), intensities=scan.intensities.astype(np.float32))

    def answer(self, moment: Moment) -> Any:
        """std_msgs/msg/String: JSON of flags, error and what else is known."""
        text = json.dumps({"time_s": moment.time_s, "presence_probability": moment.presence,
                           "flags": moment.flags, "error": moment.error, **moment.notes})
        return self._make("std_msgs/msg/String", data=text)

    # --- Markers ---

    def _marker(self, part: Part, number: int, time_s: float) -> Any:
        scale, points, text = (1.0, 1.0, 1.0), [], ""
        pose = self._pose(np.zeros(3), 0.0)
        if isinstance(part, Line):
            kind, scale = (LINE_LIST if part.pairs else LINE_STRIP), (part.width, 0.0, 0.0)
            closed = part.points if part.pairs else np.concatenate([part.points, part.points[:1]])
            points = [self._point(p) for p in closed]
        elif isinstance(part, Faces):
            kind, points = TRIANGLE_LIST, [self._point(p) for p in part.triangles.reshape(-1, 3)]
        elif isinstance(part, Box):
            kind, scale = CUBE, tuple(part.size)
            middle = np.array([part.vehicle.x_m, part.vehicle.y_m, part.size[2] / 2])
            pose = self._pose(middle, part.vehicle.yaw_rad)
        else:
            kind, scale, text = TEXT_VIEW_FACING, (0.0, 0.0, part.height), part.text
            pose = self._pose(part.position, 0.0)
        return self._make(
            "visualization_msgs/msg/Marker", header=self.header(time_s), ns=part.name, id=number,
            type=kind, action=ADD, pose=pose, scale=self._vector(*scale), points=points, text=text,
            color=self._make("std_msgs/msg/ColorRGBA", **dict(zip("rgba", map(float, part.colour)))))

    def markers(self, parts: list[Part], time_s: float) -> Any:
        """visualization_msgs/msg/MarkerArray that replaces the one before."""
        clear = self._make("visualization_msgs/msg/Marker", header=self.header(time_s),
                           action=DELETE_ALL, pose=self._pose(np.zeros(3), 0.0))
        return self._make("visualization_msgs/msg/MarkerArray", markers=[
            clear, *(self._marker(part, i, time_s) for i, part in enumerate(parts))])

    # --- All of it ---

    def mount(self, setting: Setting, time_s: float = 0.0) -> Iterator[tuple[str, str, Any]]:
        """Where the sensor is mounted, or where it stands; published once, transient local."""
        parent, matrix = self.naming.map_frame, setting.scene.sensor_pose
        if setting.mount is not None:
            parent, matrix = self.naming.base_frame, setting.mount
        static = self.transform(parent, self.naming.sensor_frame, matrix, time_s)
        yield ("/tf_static", "tf2_msgs/msg/TFMessage",
               self._make("tf2_msgs/msg/TFMessage", transforms=[static]))

    def surroundings(self, setting: Setting, time_s: float = 0.0) -> Iterator[tuple[str, str, Any]]:
        """The known surfaces; published once, transient local."""
        yield (self.naming.topic("scene"), "visualization_msgs/msg/MarkerArray",
               self.markers(surfaces(setting), time_s))

    def answers(self, setting: Setting, moment: Moment) -> Iterator[tuple[str, str, Any]]:
        """What a moment says of hidden objects: poses, presence, grid, words."""
        topic = self.naming.topic
        for found in stated(setting, moment, self.naming):
            yield (topic(found.name, "pose"), "geometry_msgs/msg/PoseWithCovarianceStamped",
                   self.pose(found, moment.time_s))
        if moment.presence is not None:
            yield topic("presence"), "std_msgs/msg/Float64", self.presence(moment.presence)
        occupancy = setting.occupancy(moment)
        if occupancy is not None:
            yield (topic("grid"), "nav_msgs/msg/OccupancyGrid",
                   self.grid(setting.grid, occupancy, moment.time_s))
        yield topic("answer"), "std_msgs/msg/String", self.answer(moment)

    def views(self, setting: Setting, moment: Moment) -> Iterator[tuple[str, str, Any]]:
        """What viewers show: the zones as a laser scan, and markers."""
        scan = self.scan(setting, moment)
        if scan is not None:
            yield self.naming.topic("zones"), "sensor_msgs/msg/LaserScan", scan
        yield (self.naming.topic("markers"), "visualization_msgs/msg/MarkerArray",
               self.markers(moving(setting, moment), moment.time_s))

    def moment(self, setting: Setting, moment: Moment) -> Iterator[tuple[str, str, Any]]:
        """All messages of what changes."""
        topic, naming = self.naming.topic, self.naming
        if moment.vehicle is not None:
            place = self.transform(naming.map_frame, naming.base_frame, moment.vehicle.matrix,
                                   moment.time_s)
            yield ("/tf", "tf2_msgs/msg/TFMessage",
                   self._make("tf2_msgs/msg/TFMessage", transforms=[place]))
        yield from self.answers(setting, moment)
        if moment.path is not None:
            yield topic("plan"), "nav_msgs/msg/Path", self.path(moment.path, moment.time_s)
        yield from self.views(setting, moment)
