"""Windows of slides along x and along y of one exploration, joined into one."""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from texture_core.errors import InvalidParameter
from texture_core.window import Window

SEPARATOR = '@'  # 'signal@x': what is measured on 'signal' while the finger slides along x
AXES_RAD = {'x': 0.0, 'y': 0.5 * math.pi}
WITHIN_RAD = math.radians(30.0)  # a direction further from both axes is along neither
MOST_WAITING = 100  # windows along one axis that wait for their partners: a long slide must not fill the memory


def split_axis(name: str) -> tuple[str, str]:
    """Return the topic of an input, and the axis along which the finger slides there; '' for any direction.

    Raises
    ------
    InvalidParameter
        If the axis is not x or y.

    Examples
    --------
    >>> split_axis('signal@x'), split_axis('signal')
    (('signal', 'x'), ('signal', ''))
    """
    topic, separator, axis = name.partition(SEPARATOR)
    if separator and (axis not in AXES_RAD or not topic):
        raise InvalidParameter(
            f"input '{name}': a topic with an axis is needed, such as 'signal{SEPARATOR}x'; the axes are "
            f'{" and ".join(AXES_RAD)}'
        )
    return topic, axis


def axis_along(direction_rad: float) -> str:
    """Return the axis to or against which a direction points within 30 degrees; '' if there is none.

    Examples
    --------
    >>> axis_along(0.0), axis_along(-math.pi / 2), axis_along(math.pi / 4), axis_along(math.nan)
    ('x', 'y', '', '')
    """
    for axis, angle in AXES_RAD.items():
        # Written so that NaN is along none.
        if math.isfinite(direction_rad) and abs(math.remainder(direction_rad - angle, math.pi)) <= WITHIN_RAD:
            return axis
    return ''


class DirectedWindow(Protocol):
    """What is joined: a dataclass with the windows of all topics, and how the finger went meanwhile.

    Examples
    --------
    >>> from texture_features.windowing.windows import CutWindow
    >>> {'windows', 'speed_m_s', 'force_n', 'direction_rad'} <= set(CutWindow.__dataclass_fields__)
    True
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def windows(self) -> Mapping[str, Window]:
        """Windows by topic."""

    @property
    def speed_m_s(self) -> float:
        """Mean speed."""

    @property
    def force_n(self) -> float:
        """Mean normal force."""

    @property
    def tangential_force_n(self) -> float:
        """Mean force of the surface against the direction of travel."""

    @property
    def direction_rad(self) -> float:
        """Mean direction of travel."""


T = TypeVar('T', bound=DirectedWindow)


def check_axes(names: Iterable[str]) -> None:
    """Refuse names of inputs that cannot be joined.

    Raises
    ------
    InvalidParameter
        If an axis is not x or y, or some inputs name an axis and others do not.
    """
    names = tuple(names)
    axes = [split_axis(name)[1] for name in names]
    if any(axes) and not all(axes):
        raise InvalidParameter(
            f'the inputs {", ".join(names)} are some of slides along an axis and some of any direction; '
            f"name the axis of each, as in 'signal{SEPARATOR}x'"
        )


class AxisJoiner(Generic[T]):
    """Join the n-th window along x with the n-th along y of the same exploration, whichever comes first.

    Parameters
    ----------
    names
        Names of inputs, such as 'signal@x' and 'signal@y'.

    Raises
    ------
    InvalidParameter
        If some inputs name an axis and others do not.

    Examples
    --------
    >>> @dataclasses.dataclass
    ... class Slide:
    ...     direction_rad: float
    ...     speed_m_s: float
    ...     force_n: float = 1.0
    ...     tangential_force_n: float = 0.5
    ...     windows: dict = dataclasses.field(default_factory=lambda: {'signal': 'samples'})
    >>> joiner = AxisJoiner(['signal@x', 'signal@y'])
    >>> joiner.add(Slide(0.0, 0.02))  # waits for its partner
    >>> joined = joiner.add(Slide(math.pi / 2, 0.04))
    >>> tuple(joined.windows), round(joined.speed_m_s, 3), joiner.end()
    (('signal@x', 'signal@y'), 0.03, 0)
    """

    def __init__(self, names: Iterable[str]) -> None:
        names = tuple(names)
        check_axes(names)
        self._sources = {name: split_axis(name) for name in names}
        self._waiting: dict[str, deque[T]] = {axis: deque() for _, axis in self._sources.values() if axis}

    @property
    def joins(self) -> bool:
        """Whether the inputs name axes; else every window is whole as it is."""
        return bool(self._waiting)

    def add(self, window: T) -> T | None:
        """Return the window that is complete with this one; None if its partner is still to come, or it is none.

        Parameters
        ----------
        window
            Its windows are by topic.

        Returns
        -------
        window or None
            With windows by the names of the inputs, speed and force their means, and no direction.
        """
        waiting = self._waiting.get(axis_along(window.direction_rad))
        if waiting is None or len(waiting) >= MOST_WAITING:
            return None
        waiting.append(window)
        if not all(self._waiting.values()):
            return None
        parts = {axis: windows.popleft() for axis, windows in self._waiting.items()}
        several = tuple(parts.values())
        return dataclasses.replace(
            window,
            windows={name: parts[axis].windows[topic] for name, (topic, axis) in self._sources.items()},
            speed_m_s=sum(part.speed_m_s for part in several) / len(several),
            force_n=sum(part.force_n for part in several) / len(several),
            tangential_force_n=sum(part.tangential_force_n for part in several) / len(several),
            direction_rad=math.nan if len(several) > 1 else window.direction_rad,
        )

    def end(self) -> int:
        """Forget what has no partner, as the exploration is over; return how many windows that were."""
        left = sum(map(len, self._waiting.values()))
        for windows in self._waiting.values():
            windows.clear()
        return left
