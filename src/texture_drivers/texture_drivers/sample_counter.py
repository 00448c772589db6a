"""Give every sample its running index, so that a jump of the index is exactly what was lost."""

from __future__ import annotations

import enum
from collections.abc import Sequence

SHORT_COUNTER = 1 << 16


class StampStatus(enum.Enum):
    """Status of a stamp, assessed with its neighbours."""

    GOOD = enum.auto()
    DAMAGED = enum.auto()
    RESTARTED = enum.auto()  # the device counts from another start value
    PENDING = enum.auto()  # odd, and the next stamp is not known yet


class SampleCounter:
    """Count samples through the device's own stamps, one tick a sample.

    A stamp that does not follow its forerunner is a loss if the next stamp goes on from there, and a damaged stamp if
    not; so the last one given is left open when it is odd. A sample that comes one tick early (a device that samples a
    trifle faster than its clock ticks) is numbered through, and evens out a tick skipped later.

    Parameters
    ----------
    longest_gap
        A jump above this, or backwards, that the next stamp confirms is no loss: the device restarted.
    """

    def __init__(self, longest_gap: int = 2000) -> None:
        self.next_index = 0
        self.lost = 0
        self.damaged_stamps = 0
        self._longest_gap = longest_gap
        self._last: int | None = None
        self._early = 0

    def interrupt(self) -> None:
        """Number on, whatever the next stamp is."""
        self._last = None
        self._early = 0

    def skip(self, samples: int) -> None:
        """Number on behind samples that are known to be lost."""
        self.lost += samples
        self.next_index += samples

    def place(self, stamps: Sequence[int | None]) -> tuple[list[int], bool]:
        """Return the index of each stamp's sample as far as decided, and whether the device restarted after those.

        Parameters
        ----------
        stamps : (n_samples,)
            Ticks of the device, of 64 bits or wrapping at 16; None for a sample without.
        """
        indices: list[int] = []
        for position, stamp in enumerate(stamps):
            status = self._classify(stamp, stamps[position + 1 : position + 2])
            if status in (StampStatus.RESTARTED, StampStatus.PENDING):
                return indices, status is StampStatus.RESTARTED
            self.damaged_stamps += status is StampStatus.DAMAGED
            indices.append(self._take(stamp if status is StampStatus.GOOD else None))
        return indices, False

    def _classify(self, stamp: int | None, following: Sequence[int | None]) -> StampStatus:
        step = _ticks(self._last, stamp)
        if step in (0, 1):
            return StampStatus.GOOD
        if not following:
            return StampStatus.PENDING
        onward = _ticks(stamp, following[0])
        if 1 < step <= self._longest_gap:
            return StampStatus.GOOD if 1 <= onward <= self._longest_gap else StampStatus.DAMAGED
        return StampStatus.RESTARTED if onward == 1 else StampStatus.DAMAGED

    def _take(self, stamp: int | None) -> int:
        """Return the index of the next sample; without a stamp it follows directly."""
        step = _ticks(self._last, stamp)
        if step == 0:
            self._early = 1
        skipped = max(0, step - 1)
        compensated = min(self._early, skipped)
        self._early -= compensated
        self.lost += skipped - compensated
        index = self.next_index + skipped - compensated
        self.next_index = index + 1
        self._last = stamp if stamp is not None or self._last is None else self._last + 1
        return index


def _ticks(last: int | None, stamp: int | None) -> int:
    """Return how many ticks a stamp lies after another, 1 if either is unknown."""
    if last is None or stamp is None:
        return 1
    ticks = stamp - last
    wrapped = last < SHORT_COUNTER and ticks < -SHORT_COUNTER // 2
    return ticks + SHORT_COUNTER if wrapped else ticks
