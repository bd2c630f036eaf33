# SPDX-License-Identifier: Apache-2.0
"""ROS bags with histograms of TMF882x sensors as captures; needs rosbags (PyPI)."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._captures import Captures
from ._core import Error
from ._scene import PathLike

# Message of the driver uwgraphics/tmf882x, for bags that hold no definitions (ROS 2 Humble and older).
MESSAGE = "tmf882x_interfaces/msg/TMF882XMeasure"
DEFINITION = "\n".join(
    [f"int64 {name}" for name in ("num_zones", "num_bins")]
    + [f"int64[] {name}" for name in ("reference_hist", "hists")]
    + [f"int64 {name}" for name in ("i2c_address", "measurement_num", "temperature", "num_valid_results",
                                    "tick")]
    + [f"int64[] {name}" for name in ("depths_1", "confs_1", "depths_2", "confs_2")]
    + [f"string {name}" for name in ("histogram_type", "port")]
)
# Fields that hold the counts: of such messages, and of the elements of an array of histograms.
FIELDS = ("hists", "histograms")
PARTS = ("data", "bins", "counts", "values", "histogram")


def is_bag(path: PathLike) -> bool:
    """Whether a file or directory is a ROS bag, by its ending or its metadata.yaml."""
    place = Path(path)
    return place.suffix in (".bag", ".db3", ".mcap") or (place / "metadata.yaml").is_file()


def load_bag(path: PathLike, *, topic: str = "", i2c_address: int = 0) -> tuple[Captures, list[str]]:
    """Captures from a ROS 2 bag (sqlite3 or MCAP; ROS 1 as well), and what was left out or assumed.

    Messages are recognised by a field ``hists`` or ``histograms``, which for example
    ``tmf882x_interfaces/msg/TMF882XMeasure`` has. The field holds either all zones' counts in one
    array, beside ``num_zones`` and ``num_bins``, or an array of messages with an array of counts
    each. ``topic`` and ``i2c_address`` choose one of several sensors. Raises Error.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise Error(f"{os.fspath(path)}: ROS bags need the package rosbags (pip install rosbags)") from None
    place = Path(path)
    if place.suffix in (".db3", ".mcap") and (place.parent / "metadata.yaml").is_file():
        place = place.parent
    store = get_typestore(Stores.LATEST)
    store.register(get_types_from_msg(DEFINITION, MESSAGE))
    try:
        with AnyReader([place], default_typestore=store) as bag:
            found = [c for c in bag.connections if _has_histograms(bag.typestore, c.msgtype)]
            chosen = _chosen_topic(os.fspath(path), topic, sorted({c.topic for c in found}),
                                   sorted({c.msgtype for c in bag.connections}))
            messages, cut = _messages(bag, [c for c in found if c.topic == chosen])
    except Error:
        raise
    except Exception as error:  # rosbags raises anything for a file that is damaged
        raise Error(f"{os.fspath(path)}: cannot be read as a bag ({error})") from None
    captures, told = _captures(os.fspath(path), messages, i2c_address)
    return captures, [f"{os.fspath(path)}: {line}" for line in cut] + told


def _messages(bag: Any, connections: list[Any]) -> tuple[list[Any], list[str]]:
    """The messages before the first one that cannot be read, and lines that say why it cannot."""
    messages: list[Any] = []
    try:
        for connection, _, raw in bag.messages(connections):
            messages.append(bag.deserialize(raw, connection.msgtype))
    except Exception as error:
        if not messages:
            raise
        return messages, [f"ends with message {len(messages) - 1}: the next cannot be read ({error})"]
    return messages, []


def _has_histograms(store: Any, msgtype: str) -> bool:
    fields = store.fielddefs.get(msgtype)
    return fields is not None and any(name in FIELDS for name, _ in fields[1])


def _chosen_topic(path: str, topic: str, topics: list[str], types: list[str]) -> str:
    if not topics:
        raise Error(f"{path}: found messages of type {', '.join(types) or 'none'}, accepted: with a field "
                    f"{' or '.join(FIELDS)}, such as {MESSAGE}")
    if topic and topic not in topics:
        raise Error(f"{path}: topic: found {topic}, accepted: {', '.join(topics)}")
    if not topic and len(topics) > 1:
        raise Error(f"{path}: found histograms in the topics {', '.join(topics)}, accepted: topic= one of them")
    return topic or topics[0]


def histograms_of(message: Any) -> NDArray[np.float64]:
    """[zones, bins] counts of a message that ``load_bag`` takes, or of an array of std_msgs whose
    layout has the dimensions zones and bins, or rows, columns and bins. [0, 0]: the message holds
    no histograms. Raises ValueError."""
    if hasattr(message, "layout") and hasattr(message, "data"):
        sizes = [int(axis.size) for axis in message.layout.dim]
        if len(sizes) not in (2, 3):
            raise ValueError(f"a layout of {len(sizes)} dimensions")
        return np.asarray(message.data, dtype=np.float64).reshape(-1 if len(sizes) == 3 else sizes[0],
                                                                  sizes[-1])
    counts = next(getattr(message, name) for name in FIELDS if hasattr(message, name))
    if len(counts) == 0:
        return np.empty((0, 0))
    if hasattr(message, "num_zones") and hasattr(message, "num_bins"):
        return np.asarray(counts, dtype=np.float64).reshape(int(message.num_zones), int(message.num_bins))
    rows = [next((getattr(part, name) for name in PARTS if hasattr(part, name)), None) for part in counts]
    if any(row is None for row in rows):
        raise ValueError(f"histograms without {' or '.join(PARTS)}")
    return np.array(rows, dtype=np.float64)


def _captures(path: str, messages: list[Any], i2c_address: int) -> tuple[Captures, list[str]]:
    told = []
    addresses = sorted({int(getattr(m, "i2c_address", 0)) for m in messages})
    if i2c_address:
        messages = [m for m in messages if int(getattr(m, "i2c_address", 0)) == i2c_address]
    if len(addresses) > 1 and not messages or len(addresses) > 1 and not i2c_address:
        raise Error(f"{path}: found sensors with the I2C addresses {', '.join(map(str, addresses))}, "
                    "accepted: i2c_address= one of them")
    cubes, indices, empty = [], [], 0
    for number, message in enumerate(messages):
        try:
            cube = histograms_of(message)
        except ValueError as error:
            told.append(f"{path}: message {number}: is left out ({error})")
            continue
        if cube.size == 0:
            empty += 1
            continue
        cubes.append(cube)
        indices.append(number)
    if empty:
        told.append(f"{path}: {empty} of {len(messages)} messages hold no histograms and are left out")
    if not cubes:
        raise Error(f"{path}: found no histograms in {len(messages)} messages, accepted: at least one")
    (shape, _), *others = Counter(c.shape for c in cubes).most_common()
    for other, count in others:
        told.append(f"{path}: {count} messages of {other[0]} zones and {other[1]} bins are left out beside "
                    f"those of {shape[0]} and {shape[1]}")
    kept = [(cube, i) for cube, i in zip(cubes, indices) if cube.shape == shape]
    side = round(shape[0] ** 0.5)
    rows, columns = (side, side) if side * side == shape[0] else (1, shape[0])
    captures = Captures(np.array([cube for cube, _ in kept]), rows=rows, columns=columns,
                        sensor="tmf882x", source=path)
    captures.indices = [i for _, i in kept]
    told.append(f"{path}: {shape[0]} zones are taken as {rows} rows of {columns}; the width of a bin is the "
                "scene's unless stated")
    return captures, told
