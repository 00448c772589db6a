"""Where in the chain from slide to sample an effect acts: each stage is one protocol.

A slide begins: `SlideEffect`. The finger goes its way: `PathEffect`. The skin senses a texture: `GrowthEffect`,
`TextureEffect`. The force shakes the skin: `ForceEffect`. Samples are taken: `SignalEffect`. What has a memory is
started once and then called block by block; what lies between the blocks is continuous.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np

from texture_core.arrays import Array, Samples
from texture_simulation.trajectory import Trajectory

BatchShape = tuple[int, ...]  # () for one slide, (count,) for many at once
TrajectoryFilter = Callable[[Trajectory], Trajectory]
ForceFilter = Callable[[Trajectory, Array], Array]
SignalFilter = Callable[[Samples], Samples]


@runtime_checkable
class SlideEffect(Protocol):
    """Changes what was planned."""

    def slide(self, speed_m_s: Array, force_n: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return speed and force as they become, of the same shape.

        Parameters
        ----------
        speed_m_s : (count,)
            Planned speeds.
        force_n : (count,)
            Planned normal forces.
        rng
            Random numbers of this effect.

        Returns
        -------
        (count,), (count,)
            Speeds in m/s and forces in N.
        """


@runtime_checkable
class PathEffect(Protocol):
    """Changes where the skin is."""

    def start_path(self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape) -> TrajectoryFilter:
        """Return what turns the next piece of path, (..., n) points, into the skin's own.

        Parameters
        ----------
        rng
            Random numbers of this effect.
        rate_hz
            Sampling rate of the samples or points.
        batch_shape
            () for one slide, (count,) for many at once.

        Returns
        -------
        callable
            Takes and returns a Trajectory; keeps a state from piece to piece.
        """


@runtime_checkable
class GrowthEffect(Protocol):
    """Lets what the skin makes of a texture depend on the force."""

    def blur_growth(self, force_n: Array) -> Array | float:
        """Return how much larger the contact is than at 1 N.

        Parameters
        ----------
        force_n : (...)
            Normal force.

        Returns
        -------
        (...)
            Factor of the contact size, of the shape of `force_n`.
        """

    def gain_growth(self, force_n: Array) -> Array | float:
        """Return how much stronger a texture is measured than at 1 N.

        Parameters
        ----------
        force_n : (...)
            Normal force.

        Returns
        -------
        (...)
            Factor of the stiffness, of the shape of `force_n`.
        """


@runtime_checkable
class TextureEffect(Protocol):
    """Changes how strongly the texture is measured."""

    def gain(self, path: Trajectory, finger: int) -> Array | float:
        """Return the gain at places, (..., n), for one individual of the sensor.

        Parameters
        ----------
        path
            Places on the sample.
        finger
            Which individual of the sensor.

        Returns
        -------
        (..., n), or a number
            Factor of the texture.
        """


@runtime_checkable
class ForceEffect(Protocol):
    """Changes how the force on the skin varies."""

    def start_force(self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape) -> ForceFilter:
        """Return what turns the variation along the next piece of path, (..., n) N, into another.

        Parameters
        ----------
        rng
            Random numbers of this effect.
        rate_hz
            Sampling rate of the samples or points.
        batch_shape
            () for one slide, (count,) for many at once.

        Returns
        -------
        callable
            Takes and returns (..., n) N; keeps a state from piece to piece.
        """


@runtime_checkable
class SignalEffect(Protocol):
    """Changes what is measured."""

    def start_signal(
        self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape, channels: int, *, slow: bool
    ) -> SignalFilter:
        """Return what turns the next samples, (..., n_samples, n_channels) counts, into those with the effect.

        Parameters
        ----------
        rng
            Random numbers of this effect.
        rate_hz
            Sampling rate of the samples or points.
        batch_shape
            () for one slide, (count,) for many at once.
        channels
            Number of channels.
        slow
            Whether the stream is the slow one.

        Returns
        -------
        callable
            Takes and returns (..., n_samples, n_channels) counts; keeps a state from piece to piece.
        """
