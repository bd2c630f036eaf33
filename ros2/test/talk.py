# SPDX-License-Identifier: Apache-2.0
"""talk.py CAPTURE.exr NUMBER: a program of its own beside the node, with ROS itself. Publishes captures
as arrays until so many answers have come; prints what came as one JSON object."""

import json
import sys
import time

import blindcorner as bc
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64, Float64MultiArray, MultiArrayDimension, String
from visualization_msgs.msg import MarkerArray

PERIOD_S, PATIENCE_S = 0.5, 60


def main(file, number):
    captures = bc.load_captures(file)
    rclpy.init()
    node = rclpy.create_node("talk")
    heard = {name: [] for name in ("pose", "presence", "grid", "answer", "scene")}

    def listen(kind, topic, name, keep, quality=10):
        return node.create_subscription(kind, topic, lambda m: heard[name].append(keep(m)), quality)

    lasting = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    ears = [
        listen(PoseWithCovarianceStamped, "/blindcorner/plate/pose", "pose", lambda m: [
            m.pose.pose.position.x, m.pose.pose.position.y, *m.pose.covariance.tolist()]),
        listen(Float64, "/blindcorner/presence", "presence", lambda m: m.data),
        listen(OccupancyGrid, "/blindcorner/grid", "grid", lambda m: [m.info.height, m.info.width, max(m.data)]),
        listen(String, "/blindcorner/answer", "answer", lambda m: json.loads(m.data)),
        listen(MarkerArray, "/blindcorner/scene", "scene", lambda m: len(m.markers), lasting),
    ]
    mouth = node.create_publisher(Float64MultiArray, "tmf882x", 10)
    message = Float64MultiArray()
    message.layout.dim = [MultiArrayDimension(size=n) for n in captures.counts.shape[1:]]
    message.data = captures.counts[0].ravel().tolist()
    end, following = time.monotonic() + PATIENCE_S, 0.0
    while len(heard["grid"]) < number and time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.05)
        # Nobody may listen yet: a message again and again, until there are answers.
        if time.monotonic() >= following and node.count_subscribers("tmf882x"):
            following = time.monotonic() + PERIOD_S
            mouth.publish(message)
    print(json.dumps(heard))
    del ears
    rclpy.shutdown()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
