"""Give blocks of samples their running index, so that a jump of the index is exactly what was lost."""

from __future__ import annotations

from texture_core.errors import DeviceError

RATE_CHECK_S = 1.0
MAX_FAILED_CHECKS = 3  # so many in a row are no hiccup
RATE_TOLERANCE = 0.02  # far more than clocks differ, far less than a wrong setting


class BlockCounter:
    """Count samples by the device's time of each block, cross-checked with the numbers of the frames they came in.

    The time says how many samples are missing, whoever lost them: frames lost on the line show in their numbers too,
    what is missing beyond them was left out by the device itself and counts as `overrun`.

    Parameters
    ----------
    rate_hz
        Nominal rate, by the device's clock.
    name
        What the samples are of, for the error sentence.
    """

    def __init__(self, rate_hz: float, name: str) -> None:
        self.next_index = 0
        self.overrun = 0  # samples that the device itself left out
        self._rate_hz = rate_hz
        self._name = name
        self._next_us: float | None = None
        self._restart_check()

    @property
    def next_us(self) -> float | None:
        """When the next sample is due by the device's clock; None before the first block."""
        return self._next_us

    def resume(self, missing: int) -> None:
        """Go on after an interruption with another time; `missing` samples are lost."""
        self.next_index += missing
        self._next_us = None
        self._restart_check()

    def place(self, time_us: int, rows: int, lost_frames: int) -> int:
        """Return the index of a block's first sample.

        Parameters
        ----------
        time_us
            Device's time of the first sample, unwrapped.
        rows
            Samples in the block.
        lost_frames
            Frames of this stream missing just before it.

        Returns
        -------
        int
            Running index, from 0.

        Raises
        ------
        DeviceError
            If device and settings do not mean the same rate.
        """
        skipped = 0
        if self._next_us is not None:
            skipped = max(0, round((time_us - self._next_us) * self._rate_hz / 1e6))
        self.overrun += max(0, skipped - lost_frames * rows)
        self._check_rate(time_us, rows, lost_frames)
        index = self.next_index + skipped
        self.next_index = index + rows
        self._next_us = time_us + rows * 1e6 / self._rate_hz
        return index

    def _restart_check(self) -> None:
        self._since_us: int | None = None
        self._rows = 0
        self._failed_checks = 0

    def _check_rate(self, time_us: int, rows: int, lost_frames: int) -> None:
        """Compare rows with time over stretches in which no frame was lost."""
        if lost_frames or self._since_us is None:
            self._since_us, self._rows = time_us, rows
            return
        elapsed_s = (time_us - self._since_us) / 1e6
        if elapsed_s >= RATE_CHECK_S:
            self._check_rate_deviation(self._rows / elapsed_s)
            self._since_us, self._rows = time_us, 0
        self._rows += rows

    def _check_rate_deviation(self, rate_hz: float) -> None:
        off = abs(rate_hz / self._rate_hz - 1) > RATE_TOLERANCE
        self._failed_checks = self._failed_checks + 1 if off else 0
        if self._failed_checks == MAX_FAILED_CHECKS:
            raise DeviceError(
                f"'{self._name}' delivers {rate_hz:.4g} samples in a second of the device's clock, and "
                f'{self._rate_hz:.4g} are set; correct the rate in the settings, or lighten the load of the device'
            )
