# SPDX-License-Identifier: Apache-2.0
"""Answers and drives where a robot's other data are: Foxglove, ROS 2, CommonRoad (docs/robot.md).

    import blindcorner as bc
    import blindcorner.robot as robot

    setting, moments = robot.of_run(bc.drive(bc.bundled("robot_drive.json"), perception="oracle"))
    with robot.Foxglove(setting, file="drive.mcap") as out:
        for moment in moments:
            out.add(moment)

Foxglove needs foxglove-sdk, bags need rosbags, CommonRoad needs commonroad-io: ``pip install
"blindcorner[robot]"`` installs all three. Frames are those of ROS: x ahead, y left, z up (REP 103);
``map``, ``base_link`` and the sensor's own (REP 105). Lengths are metres, angles radians.
"""

from .._bags import histograms_of
from ._commonroad import solution_path, write_commonroad
from ._estimates import Estimate, estimates, zone_points, zone_scan
from ._foxglove import Foxglove
from ._moments import (
    Grid,
    Hypothesis,
    LiveAnswers,
    Moment,
    Setting,
    Vehicle,
    hypotheses,
    of_answer,
    of_drive_document,
    of_results,
    of_run,
    read_document,
)
from ._publish import Naming, stated
from ._ros_bag import RosBag
from ._ros_messages import RosMessages

__all__ = [
    "Estimate",
    "Foxglove",
    "Grid",
    "Hypothesis",
    "LiveAnswers",
    "Moment",
    "Naming",
    "RosBag",
    "RosMessages",
    "Setting",
    "Vehicle",
    "estimates",
    "histograms_of",
    "hypotheses",
    "of_answer",
    "of_drive_document",
    "of_results",
    "of_run",
    "read_document",
    "solution_path",
    "stated",
    "write_commonroad",
    "zone_points",
    "zone_scan",
]
