# SPDX-License-Identifier: Apache-2.0
"""Stands in for rclpy, tf2_ros and the message packages, so that the node is tested without ROS.

Messages have the fields of ROS 2 Humble (from rosbags), and take what the classes that ROS generates
take: no whole number for a float, arrays of their own kind, nothing out of range.
"""

import array
import sys
import threading
import types
from collections import defaultdict

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from blindcorner._bags import DEFINITION, MESSAGE

STORE = get_typestore(Stores.ROS2_HUMBLE)
STORE.register(get_types_from_msg(DEFINITION, MESSAGE))
STORE.register(get_types_from_msg(f"std_msgs/Header header\n{DEFINITION}", "stamped_msgs/msg/Measure"))

CODES = {"int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q",
         "uint64": "Q", "float32": "f", "float64": "d"}
CLASSES = {}


def get_message(kind):
    """The class of a type."""
    if kind not in CLASSES:
        CLASSES[kind] = type(kind.rsplit("/", 1)[1], (Message,), {
            "kind": kind, "fields": dict(STORE.fielddefs[kind][1])})
    return CLASSES[kind]


class Message:
    """A message whose fields begin with their defaults and take values of their own types only."""

    kind, fields = "", {}

    def __init__(self, **values):
        for name, described in self.fields.items():
            object.__setattr__(self, name, default(described))
        for name, value in values.items():
            setattr(self, name, value)

    @classmethod
    def get_fields_and_field_types(cls):
        return {name: str(described) for name, described in cls.fields.items()}

    def __setattr__(self, name, value):
        assert name in self.fields, f"{self.kind} has no field {name}"
        assert suits(self.fields[name], value), f"{self.kind}.{name}: {type(value)} {value!r:.80}"
        object.__setattr__(self, name, value)


def default(described):
    node, what = described
    if node == Nodetype.NAME:
        return get_message(what)()
    if node == Nodetype.BASE:
        kind = what[0]
        return "" if kind == "string" else False if kind == "bool" else 0.0 if "float" in kind else 0
    (element, inner), length = what
    if element == Nodetype.BASE and inner[0] in CODES:
        if node == Nodetype.ARRAY:
            return np.zeros(length, dtype=inner[0])
        return array.array(CODES[inner[0]])
    return [default((element, inner)) for _ in range(length)]


def suits(described, value):
    node, what = described
    if node == Nodetype.NAME:
        return isinstance(value, get_message(what))
    if node == Nodetype.BASE:
        return base_suits(what[0], value)
    (element, inner), length = what
    if element == Nodetype.BASE and inner[0] in CODES:
        if node == Nodetype.ARRAY:
            return isinstance(value, np.ndarray) and (value.dtype, value.shape) == (inner[0], (length,))
        return isinstance(value, array.array) and value.typecode == CODES[inner[0]]
    return isinstance(value, list) and all(suits((element, inner), v) for v in value)


def base_suits(kind, value):
    if kind in ("string", "bool"):
        return isinstance(value, str if kind == "string" else bool)
    if "float" in kind:
        return isinstance(value, float)
    if not isinstance(value, int) or isinstance(value, bool):
        return False
    if kind not in CODES:
        return 0 <= value < 256
    limits = np.iinfo(kind)
    return limits.min <= value <= limits.max


# --- The graph: who publishes and who listens -------------------------------------------------------


class World:
    """What the node under test sees of ROS."""

    def __init__(self):
        self.parameters = {}  #: that are set from outside
        self.published = defaultdict(list)  #: messages by topic
        self.quality = {}  #: of publishers by topic
        self.callbacks = {}  #: of subscriptions by topic
        self.warnings = []
        self.transforms = {}  #: (target, source): TransformStamped, or what looking it up raises
        self.asked = []  #: (target, source, ns) of transforms
        self.now_ns = 1_700_000_000_123_456_789
        self.changed = threading.Condition()

    def wait(self, reached, timeout=60.0):
        """Waits until something holds; whether it does."""
        with self.changed:
            return self.changed.wait_for(reached, timeout)

    def happened(self):
        with self.changed:
            self.changed.notify_all()


WORLD = World()


class Node:
    def __init__(self, name):
        self.name = name
        self._parameters = {}

    def declare_parameter(self, name, value):
        given = WORLD.parameters.get(name, value)
        if type(given) is not type(value):
            raise TypeError(f"parameter {name}")
        self._parameters[name] = types.SimpleNamespace(value=given)

    def get_parameter(self, name):
        return self._parameters[name]

    def create_subscription(self, kind, topic, callback, quality):
        assert issubclass(kind, Message)
        WORLD.callbacks[topic] = callback
        return object()

    def create_publisher(self, kind, topic, quality):
        assert topic not in WORLD.quality, f"{topic} has a publisher"
        WORLD.quality[topic] = quality

        def publish(message):
            assert isinstance(message, kind)
            WORLD.published[topic].append(message)
            WORLD.happened()

        return types.SimpleNamespace(publish=publish)

    def get_clock(self):
        return types.SimpleNamespace(now=lambda: types.SimpleNamespace(nanoseconds=WORLD.now_ns))

    def get_logger(self):
        def warning(text, throttle_duration_sec=None):
            WORLD.warnings.append(text)
            WORLD.happened()

        return types.SimpleNamespace(warning=warning)

    def destroy_node(self):
        pass


class TransformException(Exception):
    pass


class Buffer:
    def lookup_transform(self, target, source, time, timeout=None):
        WORLD.asked.append((target, source, time.nanoseconds))
        found = WORLD.transforms.get((target, source))
        if found is None:
            raise TransformException(f'"{source}" does not exist')
        return found


class QoSProfile:
    def __init__(self, depth, durability=None):
        self.depth, self.durability = depth, durability


def value_class(name):
    """A class that keeps its keywords: Time, Duration."""
    return type(name, (), {"__init__": lambda self, **values: self.__dict__.update(values)})


def install():
    """Puts the stand-ins where Python looks for modules."""
    def module(name, **members):
        made = types.ModuleType(name)
        made.__dict__.update(members)
        sys.modules[name] = made

    module("rclpy", init=lambda args=None: None, spin=lambda node: None, ok=lambda: False,
           shutdown=lambda: None)
    module("rclpy.node", Node=Node)
    module("rclpy.time", Time=value_class("Time"))
    module("rclpy.duration", Duration=value_class("Duration"))
    module("rclpy.qos", QoSProfile=QoSProfile, qos_profile_sensor_data="sensor data",
           DurabilityPolicy=types.SimpleNamespace(TRANSIENT_LOCAL="transient local"))
    module("tf2_ros", Buffer=Buffer, TransformException=TransformException,
           TransformListener=lambda buffer, node: object())
    for kind in STORE.fielddefs:
        package, folder, name = kind.split("/")
        if f"{package}.{folder}" not in sys.modules:
            module(package)
            module(f"{package}.{folder}")
        setattr(sys.modules[f"{package}.{folder}"], name, get_message(kind))
