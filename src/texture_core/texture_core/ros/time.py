"""ROS times as whole nanoseconds."""

from __future__ import annotations

from builtin_interfaces.msg import Time

from texture_core.signal import NANOSECONDS


def to_ns(stamp: Time) -> int:
    """Return a message stamp as nanoseconds."""
    return stamp.sec * NANOSECONDS + stamp.nanosec


def to_stamp(time_ns: int) -> Time:
    """Return nanoseconds as a message stamp."""
    seconds, nanoseconds = divmod(int(time_ns), NANOSECONDS)
    return Time(sec=seconds, nanosec=nanoseconds)
