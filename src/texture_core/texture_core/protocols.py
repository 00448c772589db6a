"""What the parts of the suite expect of each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from texture_core.signal import TactileSignal


class Sensor(Protocol):
    """A tactile sensor: opened, read in batches, closed; any number of times.

    `read` blocks for about one batch and returns what arrived, keyed by topic ('signal', 'signal_static');
    it may return nothing. A device that is gone raises DeviceError from `open` or `read`; the caller closes and
    opens again. `counts` are running totals of this sensor object, kept over reopening. A sensor may also have
    `details`: what it reports about itself, such as its 'serial number', by name, for the diagnostics; `limits`: the
    lowest and the highest sample by topic, of all channels or of each, to tell when one is saturated; and `set_bias()`:
    makes the device take its present state for none, and returns the seconds that this takes.
    """

    def open(self) -> None:
        """Open the device and start its stream; DeviceError if it cannot be reached."""

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Return the batches completed since the last call, by topic."""

    def close(self) -> None:
        """Stop the stream and close the device; never raises, may be called twice."""

    @property
    def counts(self) -> Mapping[str, int]:
        """Running totals, such as 'samples', 'lost', 'bogus' and 'reopened'."""

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic, for the diagnostics."""
