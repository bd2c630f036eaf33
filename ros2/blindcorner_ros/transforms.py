# SPDX-License-Identifier: Apache-2.0
"""Where the sensor was, by tf."""

from blindcorner import Error
from rclpy.duration import Duration
from rclpy.time import Time
from tf2_ros import Buffer, TransformException, TransformListener

from .messages import matrix


class SensorPoses:
    """Listens to tf on behalf of a node."""

    def __init__(self, node, map_frame, sensor_frame, timeout_s):
        self._buffer = Buffer()
        self._listener = TransformListener(self._buffer, node)
        self._frames = map_frame, sensor_frame
        self._timeout = Duration(seconds=timeout_s)

    def at(self, stamp_ns):
        """[4, 4] takes sensor coordinates to the map, m. Waits as long as it may; raises
        blindcorner.Error where tf does not know."""
        try:
            found = self._buffer.lookup_transform(*self._frames, Time(nanoseconds=stamp_ns),
                                                  timeout=self._timeout)
        except TransformException as error:
            raise Error(f"tf: {error}") from None
        return matrix(found.transform)
