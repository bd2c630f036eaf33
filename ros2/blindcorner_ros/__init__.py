# SPDX-License-Identifier: Apache-2.0
"""A ROS 2 node around the Python package blindcorner (docs/robot.md)."""
