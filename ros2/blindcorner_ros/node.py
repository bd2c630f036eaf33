# SPDX-License-Identifier: Apache-2.0
"""ros2 run blindcorner_ros around_corner --ros-args -p scene:=SCENE.json

Subscribes to histograms and tf, tracks the hidden object, publishes its pose, an occupancy grid and the
probability that there is one. Histograms are fitted in a thread of their own, the newest first: those
that come meanwhile are counted, not kept.
"""

import os
import sys
import threading
import time

import blindcorner as bc
import rclpy
from blindcorner import robot
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data

from .messages import make, message_class, nanoseconds

PARAMETERS = {
    "scene": "", "instrument": "", "histogram_topic": "tmf882x",
    "histogram_type": "tmf882x_interfaces/msg/TMF882XMeasure", "i2c_address": 0, "exposures": 1.0,
    "use_tf": True, "publish_tf": True, "tf_timeout_s": 0.1, "map_frame": "map",
    "sensor_frame": "blindcorner_sensor", "prefix": "blindcorner", "least_presence": 0.5,
    "cell_m": 0.0, "markers": True,
}
#: s between repetitions of a warning.
QUIET_S = 5.0
#: Frames that the topics keep for a subscriber that is slow.
DEPTH = 10


class Newest:
    """Hands the newest of what was put in to whoever waits; what nobody took in time is counted."""

    def __init__(self):
        self._changed = threading.Condition()
        self._item = None
        self._open = True
        self.skipped = 0

    def put(self, item):
        with self._changed:
            self.skipped += self._item is not None
            self._item = item
            self._changed.notify()

    def take(self):
        """Waits for an item; None once closed."""
        with self._changed:
            while self._open and self._item is None:
                self._changed.wait()
            item, self._item = (self._item if self._open else None), None
            return item

    def close(self):
        with self._changed:
            self._open = False
            self._changed.notify()


class AroundCorner(Node):
    """The node. Raises blindcorner.Error for parameters that cannot be used."""

    def __init__(self):
        super().__init__("around_corner")
        for name, usual in PARAMETERS.items():
            self.declare_parameter(name, usual)
        scene = load_scene(self.value("scene"), self.value("instrument"))
        self.setting = robot.Setting(scene, cell_m=self.value("cell_m") or None)
        self.tracker = bc.Tracker(scene)
        # Times are counted from here, so that stamps come out as they came in, to the nanosecond.
        self.start_ns = self.get_clock().now().nanoseconds
        self.messages = robot.RosMessages(make, robot.Naming(
            prefix=self.value("prefix"), map_frame=self.value("map_frame"),
            sensor_frame=self.value("sensor_frame"), start_ns=self.start_ns,
            least_presence=self.value("least_presence")))
        self._outs = {}
        self._last_ns = None
        self._frames = 0
        self._newest = Newest()
        kind = histogram_message(self.value("histogram_type"))
        self._poses = self._sensor_poses()
        self._publish_rest()
        self._subscription = self.create_subscription(
            kind, self.value("histogram_topic"), self._arrived, qos_profile_sensor_data)
        self._worker = threading.Thread(target=self._work, daemon=True)
        self._worker.start()

    def value(self, name):
        """Value of a parameter."""
        return self.get_parameter(name).value

    def destroy_node(self):
        self._newest.close()
        self._worker.join()
        super().destroy_node()

    # --- In: histograms and where the sensor was ---

    def _arrived(self, message):
        address = self.value("i2c_address")
        if address and getattr(message, "i2c_address", address) != address:
            return
        header = getattr(message, "header", None)
        stamp = nanoseconds(header.stamp) if header is not None else 0
        # A driver without a header, or a clock that was never set: it is from now.
        self._newest.put((message, stamp or self.get_clock().now().nanoseconds, time.monotonic()))

    def _sensor_poses(self):
        """What tf says; None where the sensor stands as the scene says."""
        if not self.value("use_tf"):
            return None
        from .transforms import SensorPoses

        return SensorPoses(self, self.value("map_frame"), self.value("sensor_frame"),
                           self.value("tf_timeout_s"))

    def _capture(self, message, sensor):
        """One capture. Raises blindcorner.Error, or ValueError for histograms that are none."""
        counts = robot.histograms_of(message)
        scene = self.setting.scene
        if counts.shape != (scene.zones, scene.bins):
            raise bc.Error(f"histograms: found {counts.shape[0]} zones of {counts.shape[1]} bins, "
                           f"accepted: {scene.zones} of {scene.bins}")
        return bc.Captures(counts, rows=scene.rows, columns=scene.columns,
                           exposures=self.value("exposures"),
                           sensor_poses=None if sensor is None else sensor[None])

    # --- The work ---

    def _work(self):
        while (item := self._newest.take()) is not None:
            try:
                self._frame(*item)
            except (bc.Error, ValueError) as error:
                self._warn(f"frame left out: {error}")

    def _frame(self, message, stamp_ns, arrived):
        if self._last_ns is not None and stamp_ns < self._last_ns:
            self._warn("time went back: tracking begins anew")
            self.tracker, self._last_ns = bc.Tracker(self.tracker.fitter), None
        if stamp_ns == self._last_ns:
            return  # the same frame again
        sensor = None if self._poses is None else self._poses.at(stamp_ns)
        capture = self._capture(message, sensor)
        dt = None if self._last_ns is None else (stamp_ns - self._last_ns) * 1e-9
        # Also where the frame cannot be used: the object is then predicted across it.
        self._last_ns = stamp_ns
        result = self.tracker.advance(capture, dt)
        entry = dict(result.to_dict()["captures"][0], frame=self._frames, skipped=self._newest.skipped,
                     latency_ms=1e3 * (time.monotonic() - arrived))
        self._frames += 1
        self._publish(robot.of_answer(entry, (stamp_ns - self.start_ns) * 1e-9, sensor=sensor,
                                      counts=capture.counts[0]))

    def _warn(self, text):
        self.get_logger().warning(text, throttle_duration_sec=QUIET_S)

    # --- Out ---

    def _publish_rest(self):
        """What does not change, for whoever comes later too."""
        rests = [self.messages.surroundings] if self.value("markers") else []
        # With tf, where the sensor is mounted is the robot's to say.
        if self._poses is None and self.value("publish_tf"):
            rests.append(self.messages.mount)
        quality = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for rest in rests:
            for topic, kind, message in rest(self.setting):
                self._out(topic, kind, quality).publish(message)

    def _publish(self, moment):
        for topic, kind, message in self.messages.answers(self.setting, moment):
            self._out(topic, kind, DEPTH).publish(message)
        if self.value("markers"):
            for topic, kind, message in self.messages.views(self.setting, moment):
                self._out(topic, kind, DEPTH).publish(message)

    def _out(self, topic, kind, quality):
        if topic not in self._outs:
            self._outs[topic] = self.create_publisher(message_class(kind), topic, quality)
        return self._outs[topic]


def load_scene(name, instrument):
    """A scene file, or a bundled one. Raises blindcorner.Error."""
    if not name:
        raise bc.Error('parameter scene: found "", accepted: a scene file, or the name of a bundled one')
    return bc.Scene.load(name if os.path.exists(name) else bc.bundled(name), instrument or None)


def histogram_message(kind):
    """Class of the messages with histograms. Raises blindcorner.Error where there is none."""
    try:
        found = message_class(kind)
    except (AttributeError, ImportError, ValueError) as error:
        raise bc.Error(f'parameter histogram_type: found "{kind}", accepted: a message whose package is '
                       f"installed ({error})") from None
    fields = set(found.get_fields_and_field_types())
    if not ({"hists", "histograms"} & fields or {"layout", "data"} <= fields):
        raise bc.Error(f'parameter histogram_type: found "{kind}" with {", ".join(sorted(fields))}, '
                       "accepted: a message with hists or histograms, or an array of std_msgs")
    return found


def main(args=None):
    """Runs the node until Ctrl-C."""
    rclpy.init(args=args)
    node = None
    try:
        node = AroundCorner()
        rclpy.spin(node)
    except bc.Error as error:
        print(f"blindcorner: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 0
    finally:
        if node is not None:
            node.destroy_node()
        if rclpy.ok():
            rclpy.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
