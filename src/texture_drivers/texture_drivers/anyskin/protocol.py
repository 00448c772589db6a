"""The AnySkin's protocol: bytes to frames. Knows no port and no clock."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_drivers.anyskin import tables

Values = NDArray[np.float32]
LOCK_FRAMES = 3  # so many in a row, and nothing between them, make sure where frames begin


class FrameRun(NamedTuple):
    """Consecutive frames.

    Parameters
    ----------
    missing
        Frames that must have been there before it, by the number of bytes that were passed over.
    values : (n_frames, n_magnetometers, 4)
        Temperature (°C) and field along x, y, z (µT) of each magnetometer.
    """

    missing: int
    values: Values


class FrameParser:
    """Turn a byte stream into frames, whatever is lost or added on the way.

    A frame has no header, number or checksum: only its length, CR LF at its end and the range of its values show it,
    and the values may hold CR LF, too. So a frame is believed only where three fit in a row, the first of them only
    behind CR LF (a byte more or less at its beginning would change a value and not its end), and, from there on, as
    long as each follows the one before without a byte between. A changed bit that leaves a value in its range cannot
    be seen.

    Parameters
    ----------
    magnetometers
        How many the board has.
    """

    def __init__(self, magnetometers: int = tables.MAGNETOMETERS) -> None:
        self.frames = 0
        self.refused = 0  # frames that did not fit while it was certain where they begin
        self.refused_bytes = 0
        self._size = tables.frame_bytes(magnetometers)
        self._values_shape = (magnetometers, tables.QUANTITIES)
        self._buffer = b''
        self.restart()

    def restart(self) -> None:
        """Forget where frames begin, as after opening the port."""
        self._locked = False
        self._before = b''  # the last two bytes before the buffer
        self._passed: int | None = None  # bytes passed over since the last frame; None before the first one
        self._buffer = b''

    def feed(self, data: bytes) -> list[FrameRun]:
        """Return the frames completed by `data`; what is refused is counted. Keeps fewer bytes than three frames."""
        self._buffer += data
        runs: list[FrameRun] = []
        while self._locked or self._find_start():
            values = self._leading_frames()
            if len(values):
                runs.append(FrameRun(self._missing(), values))
            if len(self._buffer) < self._size:
                break
            self.refused += 1
            self._locked = False
        return runs

    def _missing(self) -> int:
        missing, self._passed = round((self._passed or 0) / self._size), 0
        return missing

    def _leading_frames(self) -> Values:
        """Take the valid frames at the beginning of the buffer."""
        values, valid = self._decode(self._buffer)
        count = len(valid) if valid.all() else int(valid.argmin())
        self._buffer = self._buffer[count * self._size :]
        self._before = tables.END if count else self._before
        self.frames += count
        return values[:count]

    def _find_start(self) -> bool:
        """Drop what comes before three valid frames in a row; return whether there are such."""
        end = self._buffer.find(tables.END, self._size - len(tables.END))
        while end >= 0:
            start = end + len(tables.END) - self._size
            candidates = self._buffer[start : start + LOCK_FRAMES * self._size]
            _, valid = self._decode(candidates)
            if valid.all():
                self._pass_over(start)
                self._locked = len(valid) == LOCK_FRAMES
                if self._locked and self._before != tables.END:
                    self._pass_over(self._size)
                return self._locked
            end = self._buffer.find(tables.END, end + 1)
        self._pass_over(max(0, len(self._buffer) - self._size + 1))
        return False

    def _pass_over(self, count: int) -> None:
        self._before = (self._before + self._buffer[:count])[-len(tables.END) :]
        self._buffer = self._buffer[count:]
        self.refused_bytes += count
        if self._passed is not None:
            self._passed += count

    def _decode(self, data: bytes) -> tuple[Values, NDArray[np.bool_]]:
        """Return the values of the whole frames in `data`, (n, n_magnetometers, 4), and whether each is valid, (n,)."""
        count = len(data) // self._size
        frames = np.frombuffer(data, dtype=np.uint8, count=count * self._size).reshape(count, self._size)
        content, ends = frames[:, : -len(tables.END)], frames[:, -len(tables.END) :]
        values = np.ascontiguousarray(content).view(tables.VALUE).reshape(count, *self._values_shape)
        ended = (ends == np.frombuffer(tables.END, dtype=np.uint8)).all(axis=1)
        return values, ended & in_range(values)


def in_range(values: Values) -> NDArray[np.bool_]:
    """Return whether all values of each frame, (n_frames, n_magnetometers, 4), can have been measured, (n_frames,).

    Parameters
    ----------
    values : (n_frames, n_magnetometers, 4)
        Temperature in °C, then the field along x, y and z, as sent.

    Returns
    -------
    (n_frames,) bool
    """
    with np.errstate(invalid='ignore'):  # NaN is in no range
        temperature_c, magnitudes = values[..., 0], np.abs(values)
        warm = (temperature_c >= tables.LOWEST_TEMPERATURE_C) & (temperature_c <= tables.HIGHEST_TEMPERATURE_C)
        weak = (magnitudes[..., 1:] <= tables.LARGEST_FIELD_UT).all(axis=(1, 2))
        measured = ((magnitudes >= tables.SMALLEST) | (magnitudes == 0)).all(axis=(1, 2))
    valid: NDArray[np.bool_] = warm.all(axis=1) & weak & measured
    return valid
