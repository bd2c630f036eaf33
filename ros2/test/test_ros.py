# SPDX-License-Identifier: Apache-2.0
"""The node with ROS itself, where rclpy is installed: two processes that talk through DDS."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import blindcorner as bc

HERE = Path(__file__).parent


def test_what_the_node_says_goes_through_ros(tmp_path):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(
        [str(HERE.parent), os.environ.get("PYTHONPATH", "")]), "ROS_DOMAIN_ID": "77",
        "ROS_LOG_DIR": str(tmp_path)}
    known = subprocess.run([sys.executable, "-c", "import rclpy, nav_msgs.msg, visualization_msgs.msg"],
                           env=environment, capture_output=True, text=True, timeout=60)
    if known.returncode:
        pytest.skip(f"rclpy is not installed ({known.stderr.splitlines()[-1]})")
    arguments = ["--ros-args", "-p", "scene:=tmf8828_wall.json", "-p", "use_tf:=false", "-p",
                 "publish_tf:=false", "-p", "histogram_type:=std_msgs/msg/Float64MultiArray"]
    node = subprocess.Popen([sys.executable, "-m", "blindcorner_ros.node", *arguments], env=environment,
                            stderr=subprocess.PIPE, text=True)
    try:
        file = bc.bundled("captures/tmf8828_wall.exr")
        talked = subprocess.run([sys.executable, str(HERE / "talk.py"), file, "2"], env=environment,
                                capture_output=True, text=True, timeout=120)
        assert talked.returncode == 0, talked.stderr
        node.send_signal(signal.SIGINT)
        _, told = node.communicate(timeout=30)
    finally:
        node.kill()
        node.wait()
    assert node.returncode == 0, told
    heard = json.loads(talked.stdout)
    scene = bc.Scene.load(bc.bundled("tmf8828_wall.json"))
    counts = bc.load_captures(file).counts
    result = bc.Tracker(scene).advance(bc.Captures(counts, rows=3, columns=3))
    assert heard["presence"][0] == pytest.approx(result.presence_probability, abs=1e-9)
    np.testing.assert_allclose(heard["pose"][0][:2], result.modes[0].pose[:2], atol=1e-6)
    covariance = np.reshape(heard["pose"][0][2:], (6, 6))
    np.testing.assert_allclose(covariance[:2, :2], result.modes[0].covariance[:2, :2], rtol=1e-4)
    assert heard["grid"][0][2] > 10 and heard["answer"][0]["frame"] == 0
    # Published before anybody listened.
    assert heard["scene"] == [1 + len(scene.to_dict()["surfaces"])]
