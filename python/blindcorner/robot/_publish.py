# SPDX-License-Identifier: Apache-2.0
"""Names, frames and times that ROS and Foxglove share."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from .._core import Error
from ._estimates import Estimate, estimates
from ._moments import Moment, Setting


@dataclass(frozen=True)
class Naming:
    """Topics begin with ``prefix``; frames are those of REP 105."""

    prefix: str = "blindcorner"
    map_frame: str = "map"
    base_frame: str = "base_link"
    sensor_frame: str = "blindcorner_sensor"
    start_ns: int = 0  #: time of the moment at 0 s: ns since 1970, or since the used clock's zero
    #: Least probability of presence with which an object's pose is published.
    least_presence: float = 0.5

    def validate(self) -> None:
        """Raises Error naming the field that is out of range."""
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*", self.prefix):
            raise Error(f'prefix: found "{self.prefix}", accepted: letters, digits and underscores')
        if not 0 <= self.least_presence <= 1:
            raise Error(f"least_presence: found {self.least_presence}, accepted: 0 to 1")
        if not 0 <= self.start_ns < 2**31 * 10**9:
            raise Error(f"start: found {self.start_ns / 1e9:g} s, accepted: 0 to 2147483647 s")

    def topic(self, *parts: str) -> str:
        """"/prefix/part/...". Characters that topics may not hold become underscores."""
        words = [re.sub(r"[^A-Za-z0-9_]", "_", part) for part in parts]
        words = [f"_{word}" if word[:1].isdigit() else word for word in words]
        return "/".join(["", self.prefix, *words])

    def nanoseconds(self, time_s: float) -> int:
        """Time of a moment, ns since the clock's zero."""
        return self.start_ns + round(time_s * 1e9)


def half_turn(yaw: float) -> tuple[float, float]:
    """z and w of the quaternion of a turn about z."""
    return math.sin(yaw / 2), math.cos(yaw / 2)


def stated(setting: Setting, moment: Moment, naming: Naming) -> list[Estimate]:
    """The objects of the heaviest explanation. Empty if the presence is less probable than
    ``naming.least_presence``."""
    if moment.presence is None or moment.presence < naming.least_presence or not moment.modes:
        return []
    return estimates(setting.scene, moment.modes[0])


def needs(package: str, extra: str = "robot") -> Error:
    """The error that says which optional package is missing."""
    return Error(f'{package} is not installed, accepted: pip install "blindcorner[{extra}]"')
