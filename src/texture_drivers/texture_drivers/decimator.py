"""Lower the rate of a stream by a whole factor, without folding what lies above the new band into it."""

from __future__ import annotations

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from texture_core.arrays import Array

HALF_WIDTH = 12  # of the filter, in samples of the lower rate
CUTOFF = 0.42  # of the lower rate: half of the amplitude is left there
KAISER_BETA = 6.0  # up to 0.34 of the lower rate all passes, from 0.5 on everything is damped by 60 dB


class Decimator:
    """Filter blocks of samples that follow each other, and keep every `factor`-th sample.

    Output `k` is the filtered value at input `k · factor`: the filter is symmetric, so nothing is delayed. An output
    needs the inputs of 12 output periods around it, so those around a gap are left out.

    Parameters
    ----------
    factor
        1 passes everything through.
    """

    def __init__(self, factor: int) -> None:
        self._factor = factor
        self._taps = taps(factor)
        self._half = len(self._taps) // 2
        self._begin = self._next = 0  # index of the first sample in the buffer, and of the one after it
        self._buffer: NDArray[np.float32] | None = None

    def feed(self, first: int, samples: NDArray[np.float32]) -> tuple[int, NDArray[np.float32]]:
        """Return the outputs that have become possible, and the index of the first of them.

        Parameters
        ----------
        first
            Index of the first sample; a jump is a gap.
        samples : (n_samples, n_channels)
            The next ones.

        Returns
        -------
        int
            Index of the first output, at the lower rate.
        (n_outputs, n_channels)
            May be empty.
        """
        if self._buffer is None or first != self._next:
            self._buffer, self._begin = samples[:0], first
        buffer = np.concatenate([self._buffer, samples])
        self._next = first + len(samples)
        output = math.ceil((self._begin + self._half) / self._factor)
        start = output * self._factor - self._half - self._begin
        if len(buffer) < start + len(self._taps):
            self._buffer = buffer
            return output, samples[:0]
        windows = sliding_window_view(buffer[start:], len(self._taps), axis=0)[:: self._factor]
        used = start + len(windows) * self._factor
        self._buffer, self._begin = buffer[used:], self._begin + used
        return output, (windows @ self._taps).astype(np.float32)


def taps(factor: int) -> Array:
    """Return the coefficients of the low-pass before lowering a rate by `factor`: a sinc in a Kaiser window.

    Returns
    -------
    (2 · 12 · factor + 1,)
        Symmetric, with the sum 1; only [1] for a factor of 1.
    """
    if factor == 1:
        return np.ones(1)
    half = HALF_WIDTH * factor
    places = np.arange(-half, half + 1)
    sinc = np.sinc(2 * CUTOFF * places / factor) * np.kaiser(len(places), KAISER_BETA)
    return np.asarray(sinc / sinc.sum())
