# SPDX-License-Identifier: Apache-2.0
"""Messages of ROS from the package's fields, and the other way round."""

import array
import importlib

import numpy as np


def message_class(kind):
    """The class of a type such as "std_msgs/msg/Header". Raises ImportError or AttributeError where
    there is none, ValueError for what is no type."""
    package, folder, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.{folder}"), name)


def make(kind, **fields):
    """A message of a type such as "std_msgs/msg/Header"; fields that are left out keep their
    defaults. What blindcorner.robot.RosMessages makes messages with."""
    message = message_class(kind)()
    for name, value in fields.items():
        if isinstance(value, np.ndarray):
            kept = getattr(message, name)
            # Arrays of fixed length are numpy's, others the standard library's.
            if isinstance(kept, array.array):
                value = array.array(kept.typecode, value.tolist())
        setattr(message, name, value)
    return message


def nanoseconds(stamp):
    """Of builtin_interfaces/msg/Time."""
    return stamp.sec * 10**9 + stamp.nanosec


def matrix(transform):
    """[4, 4] of geometry_msgs/msg/Transform, m."""
    place, turn = transform.translation, transform.rotation
    x, y, z, w = np.array([turn.x, turn.y, turn.z, turn.w]) / np.linalg.norm(
        [turn.x, turn.y, turn.z, turn.w])
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), place.x],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), place.y],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), place.z],
        [0, 0, 0, 1],
    ])
