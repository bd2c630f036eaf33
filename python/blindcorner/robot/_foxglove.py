# SPDX-License-Identifier: Apache-2.0
"""Foxglove: MCAP files and a WebSocket server with Foxglove's own schemas, by foxglove-sdk (PyPI)."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from .._captures import _pose_entry
from .._core import Error
from .._scene import PathLike
from ._drawing import Box, Colour, Faces, Line, Part, moving, surfaces
from ._estimates import zone_scan
from ._moments import Floats, Moment, Setting
from ._publish import Naming, half_turn, needs, stated

#: JSON schema of the answers, for Foxglove's plots and tables.
ANSWER_SCHEMA = {
    "type": "object",
    "title": "blindcorner.answer",
    "properties": {
        "time_s": {"type": "number"},
        "presence_probability": {"type": ["number", "null"]},
        "flags": {"type": "array", "items": {"type": "string"}},
        "error": {"type": "string"},
        "modes": {"type": "integer"},
    },
}


class Foxglove:
    """Publishes a setting and its moments to a file, to viewers that connect, or to both.

        with Foxglove(setting, file="out.mcap") as out:
            out.add(moment)
    """

    def __init__(self, setting: Setting, naming: Naming = Naming(), *, file: PathLike | None = None,
                 host: str | None = None, port: int = 8765) -> None:
        """``file``: MCAP, replaced if it exists. ``host``: where a WebSocket server listens
        (127.0.0.1: viewers of this machine only); None: there is no server. ``port`` 0: any that is
        free. Raises Error."""
        try:
            import foxglove
            from foxglove import channels, messages
        except ImportError:
            raise needs("foxglove-sdk") from None
        naming.validate()
        self.setting = setting
        self.naming = naming
        self._m, self._channels = messages, channels
        # With a context for each, several publishers of one process do not see each other's topics.
        self._context = foxglove.Context()
        self._json = foxglove.Channel
        self._open: dict[str, Any] = {}
        self._writer = self._server = None
        if file is not None:
            try:
                self._writer = foxglove.open_mcap(os.fspath(Path(file)), allow_overwrite=True,
                                                  context=self._context)
            except Exception as error:  # the SDK has its own error
                raise Error(f"{os.fspath(file)}: cannot be written ({error})") from None
        if host is not None:
            try:
                self._server = foxglove.start_server(name="blindcorner", host=host, port=port,
                                                     context=self._context)
            except Exception as error:
                self.close()
                raise Error(f"{host}:{port}: no server can listen there ({error})") from None

    @property
    def port(self) -> int | None:
        """Port that the server listens on; None: there is none."""
        return self._server.port if self._server is not None else None

    def add(self, moment: Moment) -> None:
        """Publishes one moment. The known surfaces come with each: viewers may connect at any time,
        and a viewer that jumps in a file looks back for the last message only."""
        self._transforms(moment)
        self._log("scene", "SceneUpdate", self._scene(surfaces(self.setting), moment), moment)
        self._log("markers", "SceneUpdate", self._scene(moving(self.setting, moment), moment), moment)
        self._answers(moment)
        if moment.path is not None:
            self._log("plan", "PosesInFrame", self._path(moment.path, moment), moment)
        sensor = self.setting.sensor(moment)
        scan = zone_scan(self.setting.scene, sensor, moment.counts)
        if scan is not None:
            self._log("zones", "LaserScan", self._m.LaserScan(
                timestamp=self._stamp(moment), frame_id=self.naming.sensor_frame,
                pose=self._pose(np.zeros(3), 0.0), start_angle=scan.first_rad,
                end_angle=scan.first_rad + scan.step_rad * (len(scan.ranges) - 1),
                ranges=scan.ranges.tolist(), intensities=scan.intensities.tolist()), moment)

    def _answers(self, moment: Moment) -> None:
        for found in stated(self.setting, moment, self.naming):
            self._log((found.name, "pose"), "PoseInFrame", self._m.PoseInFrame(
                timestamp=self._stamp(moment), frame_id=self.naming.map_frame,
                pose=self._pose(found.position, found.yaw_rad)), moment)
        occupancy = self.setting.occupancy(moment)
        if occupancy is not None:
            self._log("grid", "Grid", self._grid(occupancy, moment), moment)
        self._answer(moment)

    def _answer(self, moment: Moment) -> None:
        topic = self.naming.topic("answer")
        if topic not in self._open:
            self._open[topic] = self._json(topic, schema=ANSWER_SCHEMA, context=self._context)
        text = {"time_s": moment.time_s, "presence_probability": moment.presence, "flags": moment.flags,
                "error": moment.error, "modes": len(moment.modes), **moment.notes}
        self._open[topic].log(json.dumps(text), log_time=self.naming.nanoseconds(moment.time_s))

    def _log(self, parts: str | tuple[str, ...], kind: str, message: Any, moment: Moment) -> None:
        topic = self.naming.topic(*([parts] if isinstance(parts, str) else parts))
        self._log_topic(topic, kind, message, moment)

    def _log_topic(self, topic: str, kind: str, message: Any, moment: Moment) -> None:
        if topic not in self._open:
            channel = getattr(self._channels, f"{kind}Channel")
            self._open[topic] = channel(topic, context=self._context)
        self._open[topic].log(message, log_time=self.naming.nanoseconds(moment.time_s))

    # --- Messages ---

    def _stamp(self, moment: Moment) -> Any:
        seconds, nanoseconds = divmod(self.naming.nanoseconds(moment.time_s), 10**9)
        return self._m.Timestamp(sec=seconds, nsec=nanoseconds)

    def _pose(self, position: Floats, yaw: float) -> Any:
        z, w = half_turn(yaw)
        x, y, height = (float(v) for v in position)
        return self._m.Pose(position=self._m.Vector3(x=x, y=y, z=height),
                            orientation=self._m.Quaternion(x=0.0, y=0.0, z=z, w=w))

    def _transforms(self, moment: Moment) -> None:
        naming, setting = self.naming, self.setting
        links = [(naming.map_frame, naming.sensor_frame, setting.sensor(moment))]
        if moment.vehicle is not None and setting.mount is not None:
            links = [(naming.map_frame, naming.base_frame, moment.vehicle.matrix),
                     (naming.base_frame, naming.sensor_frame, setting.mount)]
        transforms = []
        for parent, child, matrix in links:
            entry = _pose_entry(matrix)
            w, x, y, z = entry["quaternion_wxyz"]
            px, py, pz = entry["position_m"]
            transforms.append(self._m.FrameTransform(
                timestamp=self._stamp(moment), parent_frame_id=parent, child_frame_id=child,
                translation=self._m.Vector3(x=px, y=py, z=pz),
                rotation=self._m.Quaternion(x=x, y=y, z=z, w=w)))
        self._log_topic("/tf", "FrameTransforms", self._m.FrameTransforms(transforms=transforms), moment)

    def _grid(self, occupancy: Floats, moment: Moment) -> Any:
        """Probability of each cell as a 32-bit float; NaN where nothing is known."""
        grid = self.setting.grid
        data = np.ascontiguousarray(occupancy, dtype="<f4")
        field = self._m.PackedElementField(name="probability", offset=0,
                                           type=self._m.PackedElementFieldNumericType.Float32)
        return self._m.Grid(
            timestamp=self._stamp(moment), frame_id=self.naming.map_frame,
            pose=self._pose(np.array([grid.x_m, grid.y_m, 0.0]), 0.0), column_count=grid.columns,
            cell_size=self._m.Vector2(x=grid.cell_m, y=grid.cell_m), row_stride=4 * grid.columns,
            cell_stride=4, fields=[field], data=data.tobytes())

    def _path(self, points: Floats, moment: Moment) -> Any:
        steps = np.diff(points, axis=0)
        yaws = [math.atan2(y, x) for x, y in steps] or [0.0]
        poses = [self._pose(np.append(p, 0.0), yaw) for p, yaw in zip(points, [*yaws, yaws[-1]])]
        return self._m.PosesInFrame(timestamp=self._stamp(moment), frame_id=self.naming.map_frame,
                                    poses=poses)

    def _points(self, points: Floats) -> list[Any]:
        return [self._m.Point3(x=x, y=y, z=z) for x, y, z in np.asarray(points).tolist()]

    def _colour(self, colour: Colour) -> Any:
        return self._m.Color(**dict(zip("rgba", map(float, colour))))

    def _entity(self, part: Part, moment: Moment) -> Any:
        colour = self._colour(part.colour)
        shapes: dict[str, Any] = {}
        if isinstance(part, Line):
            kinds = self._m.LinePrimitiveLineType
            shapes["lines"] = [self._m.LinePrimitive(
                type=kinds.LineList if part.pairs else kinds.LineLoop, pose=self._pose(np.zeros(3), 0.0),
                thickness=part.width, points=self._points(part.points), color=colour)]
        elif isinstance(part, Faces):
            shapes["triangles"] = [self._m.TriangleListPrimitive(
                pose=self._pose(np.zeros(3), 0.0), points=self._points(part.triangles.reshape(-1, 3)),
                color=colour)]
        elif isinstance(part, Box):
            length, width, height = (float(v) for v in part.size)
            middle = np.array([part.vehicle.x_m, part.vehicle.y_m, height / 2])
            shapes["cubes"] = [self._m.CubePrimitive(
                pose=self._pose(middle, part.vehicle.yaw_rad),
                size=self._m.Vector3(x=length, y=width, z=height), color=colour)]
        else:
            shapes["texts"] = [self._m.TextPrimitive(
                pose=self._pose(part.position, 0.0), billboard=True, font_size=part.height,
                color=colour, text=part.text)]
        return self._m.SceneEntity(timestamp=self._stamp(moment), frame_id=self.naming.map_frame,
                                   id=part.name, **shapes)

    def _scene(self, parts: list[Part], moment: Moment) -> Any:
        clear = self._m.SceneEntityDeletion(timestamp=self._stamp(moment),
                                            type=self._m.SceneEntityDeletionType.All)
        return self._m.SceneUpdate(deletions=[clear],
                                   entities=[self._entity(part, moment) for part in parts])

    def close(self) -> None:
        """Ends file and server."""
        if self._writer is not None:
            self._writer.close()
        if self._server is not None:
            self._server.stop()
        self._writer = self._server = None

    def __enter__(self) -> Foxglove:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()
