# SPDX-License-Identifier: Apache-2.0
"""ros2 launch blindcorner_ros blindcorner.launch.py scene:=SCENE.json [parameters:=FILE.yaml]"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    usual = PathJoinSubstitution([FindPackageShare("blindcorner_ros"), "config", "blindcorner.yaml"])
    return LaunchDescription([
        DeclareLaunchArgument("scene", description="scene file, or the name of a bundled one"),
        DeclareLaunchArgument("parameters", default_value=usual, description="file of parameters"),
        Node(package="blindcorner_ros", executable="around_corner", name="around_corner",
             output="screen",
             parameters=[LaunchConfiguration("parameters"), {"scene": LaunchConfiguration("scene")}]),
    ])
