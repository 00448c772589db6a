"""From exact values to what a converter sends, with the effects on the way."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Samples
from texture_simulation.effects.protocols import BatchShape, SignalEffect
from texture_simulation.scene import Scene

Integer = TypeVar('Integer', bound=np.integer[Any])


class Converter:
    """Turn samples of one stream into whole counts within a range.

    Parameters
    ----------
    scene
        Whose effects on the signal are applied.
    rng
        Their randomness.
    rate_hz, channels
        Of the stream.
    limits
        Least and most count.
    batch_shape
        () for one slide, (count,) for many at once.
    slow
        Whether it is the slow stream beside the fast one.
    scale
        Counts of this converter for one count of the effects, which are those of a TSF-85.
    """

    def __init__(
        self,
        scene: Scene,
        rng: np.random.Generator,
        rate_hz: float,
        channels: int,
        limits: tuple[int, int],
        *,
        batch_shape: BatchShape,
        slow: bool = False,
        scale: float = 1.0,
    ) -> None:
        self._limits = limits
        self._scale = scale
        self._filters = [
            effect.start_signal(rng, rate_hz, batch_shape, channels, slow=slow)
            for effect in scene.effects_of(SignalEffect)
        ]

    def exact(self, counts: Samples) -> Samples:
        """Return the next samples, (..., n_samples, n_channels), with the effects, clipped and whole.

        Parameters
        ----------
        counts : (..., n_samples, n_channels)
            What the sensor measures, in counts that need not be whole.

        Returns
        -------
        (..., n_samples, n_channels)
            Counts.
        """
        if self._filters:
            counts = counts / self._scale
            for apply in self._filters:
                counts = apply(counts)
            counts = counts * self._scale
        whole = np.rint(counts)
        return np.clip(whole, *self._limits, out=whole)

    def counts(self, counts: Samples, kind: type[Integer]) -> NDArray[Integer]:
        """Return the same as whole numbers.

        Parameters
        ----------
        counts : (..., n_samples, n_channels)
            What the sensor measures, in counts that need not be whole.
        kind
            Integer type of numpy.

        Returns
        -------
        (..., n_samples, n_channels)
            Counts of the type `kind`.
        """
        whole: NDArray[Integer] = self.exact(counts).astype(kind)
        return whole
