# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 package; the Python package blindcorner has to be installed beside it (docs/robot.md)."""

from setuptools import setup

NAME = "blindcorner_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/blindcorner.launch.py"]),
        (f"share/{NAME}/config", ["config/blindcorner.yaml"]),
    ],
    install_requires=["setuptools", "blindcorner"],
    zip_safe=True,
    description="Publishes where a hidden object is, from histograms of a single-photon LiDAR",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"around_corner = {NAME}.node:main"]},
)
