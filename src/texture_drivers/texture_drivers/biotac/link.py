"""How the replies of a BioTac board reach this computer: what every link offers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol


class SpiFrame(NamedTuple):
    """The reply to all sampling commands of one frame.

    Parameters
    ----------
    epoch
        Changes when `number` and `time_us` begin again, as after opening or a reset.
    number
        Running number of the frame; a jump is a loss.
    time_us
        The device's clock at the start of slot 0.
    fingers
        How many BioTacs the board has places for.
    reply
        See `protocol.decode`.
    """

    epoch: int
    number: int
    time_us: int
    fingers: int
    reply: bytes


class SpiLink(Protocol):
    """The way to a board; `counts` are totals kept over reopening."""

    max_drift: float  # by what share its clock may be wrong
    serials: tuple[str, ...]  # serial number of the BioTac at each place, '' where there is none; () if not known

    def open(self) -> None:
        """Open the way and start sampling; DeviceError if it is not there."""

    def read(self) -> Sequence[SpiFrame]:
        """Wait for about one frame and return those that came, in order; DeviceError if the device is gone."""
        ...

    def close(self) -> None:
        """Stop; never raises, may be called twice."""

    @property
    def counts(self) -> Mapping[str, int]:
        """Return what went wrong on the way."""
        ...
