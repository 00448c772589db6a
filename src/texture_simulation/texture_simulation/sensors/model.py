"""What every simulated sensor has in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from texture_core.arrays import Samples
from texture_simulation.scene import Scene
from texture_simulation.skin_contact import SkinContact
from texture_simulation.surfaces.surface import Surface
from texture_simulation.trajectory import Trajectory


class SensorModel(Protocol):
    """Turns a path, block by block, into what the sensor publishes; what lies between the blocks is continuous."""

    touch: SkinContact

    def streams(self, path: Trajectory, *, slow: bool = True) -> Mapping[str, Samples]:
        """Return samples by topic, (..., n_samples, n_channels) in the unit the driver publishes.

        Parameters
        ----------
        path
            The next points, whole steps of the sensor.
        slow
            Whether the slow stream is wanted, too.

        Returns
        -------
        mapping
            Topic → (..., n_samples, n_channels).
        """


@dataclass(frozen=True)
class SimulatedStream:
    """What a topic holds."""

    topic: str
    sensor: str
    channels: tuple[str, ...]
    unit: str
    rate_hz: float
    delay_s: float = 0.0  # of the first sample, after the beginning


class MakeModel(Protocol):
    """How a model is made."""

    def __call__(
        self,
        scene: Scene,
        surface: Surface,
        rng: np.random.Generator,
        *,
        finger: int = 0,
        batch_shape: tuple[int, ...] = (),
        settled: bool = False,
    ) -> SensorModel:
        """Return a model.

        Parameters
        ----------
        scene, surface
            How the finger senses, and what.
        rng
            All randomness: where a sample is touched, what the effects do.
        finger
            Which individual of the sensor: its traits are its own and stay the same.
        batch_shape
            () for one slide at a time, (count,) for many at once.
        settled
            Whether its filters have forgotten how the touch began.

        Returns
        -------
        SensorModel
        """


@dataclass(frozen=True)
class SensorKind:
    """A simulated sensor.

    Parameters
    ----------
    make
        The model.
    path_rate_hz
        Points of the path a second.
    step_points
        Points of a whole step: a path must consist of such.
    streams
        What it publishes; the fast one first.
    """

    make: MakeModel
    path_rate_hz: float
    step_points: int
    streams: tuple[SimulatedStream, ...]

    @property
    def fast(self) -> SimulatedStream:
        """The fast stream."""
        return self.streams[0]


def individual_rng(finger: int) -> np.random.Generator:
    """Return the randomness out of which an individual of a sensor is made."""
    return np.random.default_rng([finger, 7])
