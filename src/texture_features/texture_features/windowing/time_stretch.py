"""Time stretch: what a signal would have been at another speed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import AnyArray, Array, Samples
from texture_features.feature import Feature, WindowBatch

# A finger that hardly moves tells nothing of another speed, and must not ask for endless samples.
LARGEST_FACTOR = 10.0


@dataclass(frozen=True)
class Stretched:
    """A feature of windows that are first brought to one speed; itself a feature.

    A window of n samples at speed v becomes one of n · v / `to_m_s` samples at the same rate: the surface passes as it
    would at that speed. What then lies above half the rate is left out, not folded back. The feature gets the
    speed after stretching. A window whose speed is unknown or not above 0 stays as it is; no window becomes more than
    ten times as long or as short.

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.D.4.

    Examples
    --------
    >>> from texture_features.features.speed import Speed
    >>> tone = np.sin(2 * np.pi * 100.0 * np.arange(2048) / 1000.0)[:, None]  # at 0.1 m/s
    >>> window = WindowBatch(tone, 1000.0, np.array(0.1))
    >>> Stretched(Speed(), to_m_s=0.05)(window).item()  # after stretching
    0.05
    """

    feature: Feature
    to_m_s: float

    @property
    def per_channel(self) -> bool:
        """As the feature says."""
        return self.feature.per_channel

    @property
    def names(self) -> tuple[str, ...]:
        """Those of the feature."""
        return self.feature.names

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the values of the feature."""
        parts = list(self._parts(windows))
        extracted = [self.feature(part) for _, part in parts]
        values = np.empty((*windows.samples.shape[:-2], *extracted[0].shape[-2:]))
        for (chosen, _), block in zip(parts, extracted, strict=True):
            values[chosen] = block
        return values

    def _parts(self, windows: WindowBatch) -> Iterator[tuple[AnyArray, WindowBatch]]:
        """Yield the windows in groups of one stretched length, each with where it comes from."""
        known: dict[int, tuple[AnyArray, WindowBatch]] = windows.shared(
            ('stretched', self.to_m_s), lambda: self._cut(windows)
        )
        yield from known.values()

    def _cut(self, windows: WindowBatch) -> dict[int, tuple[AnyArray, WindowBatch]]:
        leading = windows.samples.shape[:-2]
        speed, force = (np.broadcast_to(values, leading) for values in (windows.speed_m_s, windows.force_n))
        lengths = stretched_lengths(speed, windows.samples.shape[-2], self.to_m_s)
        groups = {}
        for length in np.unique(lengths).tolist():
            chosen = lengths == length
            factor = windows.samples.shape[-2] / length
            samples = resample(windows.samples[chosen], length)
            stretched = WindowBatch(
                samples, windows.rate_hz, speed[chosen] * factor, force[chosen], channels=windows.channels
            )
            groups[length] = (chosen, stretched)
        return groups


def stretched_lengths(speed_m_s: Array, n_samples: int, to_m_s: float) -> AnyArray:
    """Return how many samples windows have after stretching, (...).

    Parameters
    ----------
    speed_m_s : (...)
        Speed of each window; NaN if unknown.
    n_samples
        Samples of a window before stretching.
    to_m_s
        Speed to which windows are brought.

    Returns
    -------
    (...)
        Whole numbers, at least 1.
    """
    speed = np.asarray(speed_m_s, dtype=np.float64)
    moving = speed > 0  # False for NaN
    factor = np.clip(np.where(moving, speed, to_m_s) / to_m_s, 1.0 / LARGEST_FACTOR, LARGEST_FACTOR)
    lengths: AnyArray = np.maximum(1, np.rint(n_samples * factor)).astype(np.intp)
    return np.where(n_samples > 1, lengths, 1)


def resample(samples: Samples, length: int) -> Samples:
    """Return the band-limited signal through the samples at `length` equal steps over the same time.

    The line from the first to the last sample is taken out before the Fourier transform, which sees the signal as
    periodic, and put back after it.

    Parameters
    ----------
    samples : (..., n_samples, n_channels)

    Returns
    -------
    (..., length, n_channels)
    """
    n_samples = samples.shape[-2]
    if length == n_samples:
        return samples
    rows = np.ascontiguousarray(samples.swapaxes(-1, -2))
    first = rows[..., :1]
    rise = rows[..., -1:] - first
    waves = np.fft.rfft(rows - first - rise * (np.arange(n_samples) / n_samples))
    bins = min(n_samples, length) // 2 + 1
    steps = np.fft.irfft(waves[..., :bins], length) * (length / n_samples)
    stretched: Samples = (steps + first + rise * (np.arange(length) / length)).swapaxes(-1, -2)
    return stretched
