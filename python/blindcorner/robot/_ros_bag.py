# SPDX-License-Identifier: Apache-2.0
"""rosbag2 with ROS 2 messages, written by rosbags (PyPI)."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from .._core import Error
from .._scene import PathLike
from ._moments import Moment, Setting
from ._publish import Naming, needs
from ._ros_messages import RosMessages


class RosbagsMake:
    """Makes rosbags' messages, whose fields have no defaults of their own."""

    def __init__(self) -> None:
        try:
            from rosbags.interfaces import Nodetype
            from rosbags.typesys import Stores, get_typestore
        except ImportError:
            raise needs("rosbags") from None
        self._nodes = Nodetype
        #: The oldest distribution that is maintained: later ones read its messages.
        self.store = get_typestore(Stores.ROS2_HUMBLE)

    def __call__(self, kind: str, **fields: Any) -> Any:
        for name, described in self.store.fielddefs[kind][1]:
            if name not in fields:
                fields[name] = self._default(described)
        return self.store.types[kind](**fields)

    def _default(self, described: Any) -> Any:
        node, what = described
        if node == self._nodes.NAME:
            return self(what)
        if node == self._nodes.BASE:
            kind = what[0]
            return "" if kind == "string" else False if kind == "bool" else 0.0 if "float" in kind else 0
        (element, inner), length = what
        if element == self._nodes.BASE and inner[0] != "string":
            kind = {"byte": "uint8", "octet": "uint8", "char": "uint8"}.get(inner[0], inner[0])
            return np.zeros(length, dtype=kind)
        return [self._default((element, inner)) for _ in range(length)]


class RosBag:
    """A bag in a new directory: messages of a setting and its moments, in their order.

        with RosBag("out", setting) as bag:
            bag.add(moment)
    """

    def __init__(self, path: PathLike, setting: Setting, naming: Naming = Naming(),
                 storage: str = "mcap") -> None:
        """``storage``: mcap or sqlite3. Raises Error if the directory exists already."""
        make = RosbagsMake()
        from rosbags.rosbag2 import StoragePlugin, Writer

        plugins = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}
        if storage not in plugins:
            raise Error(f'storage: found "{storage}", accepted: {", ".join(plugins)}')
        if Path(path).exists():
            raise Error(f"{os.fspath(path)}: is there already, accepted: a new directory")
        self.path = Path(path)
        self.setting = setting
        self.messages = RosMessages(make, naming)
        self._store = make.store
        self._connections: dict[str, Any] = {}
        # Version 8 states qualities of service as older distributions write them, too.
        self._writer = Writer(self.path, version=8, storage_plugin=plugins[storage])
        try:
            self._writer.open()
        except OSError as error:
            raise Error(f"{os.fspath(path)}: {error.strerror}") from None
        self._started = False

    def add(self, moment: Moment) -> None:
        """Writes one moment. Before the first one, it writes what is at rest."""
        if not self._started:
            self._started = True
            for rest in (self.messages.mount, self.messages.surroundings):
                self._write(rest(self.setting, moment.time_s), moment.time_s, lasting=True)
        self._write(self.messages.moment(self.setting, moment), moment.time_s)

    def _write(self, messages: Iterable[tuple[str, str, Any]], time_s: float,
               lasting: bool = False) -> None:
        for topic, kind, message in messages:
            if topic not in self._connections:
                self._connections[topic] = self._writer.add_connection(
                    topic, kind, typestore=self._store, offered_qos_profiles=[_quality(lasting)])
            self._writer.write(self._connections[topic], self.messages.naming.nanoseconds(time_s),
                               self._store.serialize_cdr(message, kind))

    def close(self) -> None:
        """Writes what is needed to complete the bag."""
        self._writer.close()

    def __enter__(self) -> RosBag:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()


def _quality(lasting: bool) -> Any:
    """Reliable, keeping the last ten messages. ``lasting``: keeping the last one, which subscribers
    that come later also get."""
    from rosbags.interfaces import (Qos, QosDurability, QosHistory, QosLiveliness, QosReliability,
                                    QosTime)

    forever = QosTime(9223372036, 854775807)
    return Qos(QosHistory.KEEP_LAST, 1 if lasting else 10, QosReliability.RELIABLE,
               QosDurability.TRANSIENT_LOCAL if lasting else QosDurability.VOLATILE, forever, forever,
               QosLiveliness.AUTOMATIC, forever, False)
