# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What disturbs a real finger, one class each; a scene names those that it needs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from texture_core.config import param
from texture_core.types import Array, Samples
from texture_simulation.path import Trajectory, interpolated_field

# --------------------
# Where in the chain from slide to sample an effect acts is defined by the method that it has:
#
# slide(speed_m_s, force_n, rng)              a slide begins: (count,) planned speeds and forces become others
# start_path(rng, rate_hz, batch_shape)       where the skin goes: a `TrajectoryFilter`
# blur_growth(force_n), gain_growth(force_n)  how much larger the contact, how much stiffer it is than at 1 N: (...)
# gain(path, finger)                          how strongly a texture is sensed at places by one individual: (..., n)
# start_signal(rng, rate_hz, batch_shape, channels, *, slow)
#                                             samples in counts, (..., n_samples, n_channels): a `SignalFilter`
#
# What has a memory is started once and then called block by block; what lies between the blocks is continuous.

BatchShape = tuple[int, ...]  # () for one slide, (count,) for many at once
TrajectoryFilter = Callable[[Trajectory], Trajectory]
SignalFilter = Callable[[Samples], Samples]


# --------------------
# A sphere pressed on a plane (Hertz): size and stiffness of the contact grow with the cube root of the force.


HERTZ = 1 / 3  # exponent of both


@dataclass(frozen=True)
class PatchGrowth:
    """The contact, over which the skin averages, grows with the force."""

    def blur_growth(self, force_n: Array) -> Array:
        """Return how much larger the contact is than at 1 N; 0 N gives 0."""
        return np.asarray(np.maximum(force_n, 0.0) ** HERTZ)


@dataclass(frozen=True)
class ForceGain:
    """The contact is the stiffer, the harder it is pressed: the same height changes the force more."""

    def gain_growth(self, force_n: Array) -> Array:
        """Return how much stronger a texture is measured than at 1 N; 0 N gives 0."""
        return np.asarray(np.maximum(force_n, 0.0) ** HERTZ)


# --------------------
# No two fingers of a kind are equally sensitive.

SALT = 41  # so that the gain of a finger is drawn independently of its other traits


@dataclass(frozen=True)
class FingerSpread:
    """Each specimen of the sensor has another sensitivity to textures."""

    relative: float = param(0.1, 'Relative spread of the sensitivity from finger to finger.', low=0.0, high=0.5)
    skin: float = param(
        0.0,
        'Relative spread of the skin from finger to finger: a thicker one touches over a larger area and is softer.',
        low=0.0,
        high=0.5,
    )
    noise: float = param(0.0, 'Relative spread of the strength of the noise from finger to finger.', low=0.0, high=1.0)

    def gain(self, path: Trajectory, finger: int) -> Array | float:
        """Return the factor of a finger, the same at all points."""
        return self.factors(finger)[0]

    def factors(self, finger: int) -> tuple[float, float, float]:
        """Return the factors of a finger: of its sensitivity, of the thickness of its skin, and of its noise."""
        drawn = np.random.default_rng([SALT, finger]).standard_normal(3)
        gain, thicker, noisier = np.exp(np.array([self.relative, self.skin, self.noise]) * drawn)
        return float(gain), float(thicker), float(noisier)


# --------------------
# A bad contact in a cable.


@dataclass(frozen=True)
class Dropouts:
    """Occasionally all channels freeze for a moment: the converter repeats its last sample.

    Samples that are missing altogether are a fault of the line: see devices/fingers.py.
    """

    per_s: float = param(0.5, 'Rate of dropouts.', unit='1/s', low=0.0, high=100.0)
    length_s: float = param(
        0.02, 'Duration of a dropout, in which the last good sample is repeated.', unit='s', low=1e-3, high=1.0
    )

    def start_signal(
        self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape, channels: int, *, slow: bool
    ) -> SignalFilter:
        """Return what holds the samples."""
        length = max(1, round(self.length_s * rate_hz))
        held = np.zeros((*batch_shape, 1, channels))  # the last good sample
        left = np.zeros(batch_shape, dtype=np.intp)  # samples that are still to be held

        def hold(samples: Samples) -> Samples:
            nonlocal held, left
            count = samples.shape[-2]
            if not count:
                return samples
            number = np.arange(count)
            begins = rng.random((*batch_shape, count)) < self.per_s / rate_hz
            last = np.maximum.accumulate(np.where(begins, number, left[..., None] - length - 1), axis=-1)
            bad = number - last < length
            source = np.maximum.accumulate(np.where(bad, -1, number), axis=-1)
            joined = np.concatenate([held, samples], axis=-2)
            result: Samples = np.take_along_axis(joined, source[..., None] + 1, axis=-2)
            held, left = result[..., -1:, :], np.maximum(last[..., -1] + length - count, 0)
            return result

        return hold


# --------------------
# Noise of the electronics.


@dataclass(frozen=True)
class Noise:
    """White noise on every sample: its density is 2·count²/rate, from 0 Hz to half the rate."""

    fast_count: float = param(25.0, 'Standard deviation of the noise on the fast channels.', unit='count', low=0.0)
    slow_count: float = param(8.0, 'Standard deviation of the noise on the slow channels.', unit='count', low=0.0)

    def start_signal(
        self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape, channels: int, *, slow: bool
    ) -> SignalFilter:
        """Return what adds the noise."""
        spread = self.slow_count if slow else self.fast_count

        def add(samples: Samples) -> Samples:
            # Single precision costs half as much, and its last bit lies far below a count.
            return samples + spread * rng.standard_normal(samples.shape, dtype=np.float32)

        return add


# --------------------
# A robot does not move quite evenly, and the skin creeps.

# Cubic B-spline through normal values: the standard deviation of its sum in the mean over a section.
SPLINE_SPREAD = math.sqrt(151 / 315)


@dataclass(frozen=True)
class UnevenMotion:
    """The skin is ahead of the planned path or behind it by a smooth random distance."""

    distance_m: float = param(
        5e-4, 'Standard deviation of the distance from the path, along x and along y.', unit='m', low=0.0, high=0.01
    )
    length_m: float = param(0.015, 'Way over which the distance changes.', unit='m', low=1e-3, high=1.0)

    def start_path(self, rng: np.random.Generator, rate_hz: float, batch_shape: BatchShape) -> TrajectoryFilter:
        """Return what displaces the skin."""
        knots = np.empty((2, *batch_shape, 0))
        travelled = np.zeros((*batch_shape, 1))  # in sections
        last: tuple[Array, Array] | None = None

        def displace(path: Trajectory) -> Trajectory:
            nonlocal knots, travelled, last
            if not len(path):
                return path
            # How far along its way each point is: at rest nothing changes.
            shape = (*batch_shape, len(path))
            x_m, y_m = np.broadcast_to(path.x_m, shape), np.broadcast_to(path.y_m, shape)
            from_x_m, from_y_m = (x_m[..., :1], y_m[..., :1]) if last is None else last
            steps_m = np.hypot(np.diff(x_m, prepend=from_x_m), np.diff(y_m, prepend=from_y_m))
            at = travelled + np.cumsum(steps_m, axis=-1) / self.length_m
            last, travelled = (x_m[..., -1:], y_m[..., -1:]), at[..., -1:]
            # A smooth curve near normal values, one a section.
            section = at.astype(np.intp)
            missing = max(0, int(section.max()) + 4 - knots.shape[-1])
            drawn = [rng.standard_normal((2, *batch_shape, 1)) for _ in range(missing)]
            knots = np.concatenate([knots, *drawn], axis=-1)
            t = at - section  # fraction of the section between the middle ones of four values of a cubic B-spline
            weights = (1 - t) ** 3 / 6, (3 * t**3 - 6 * t**2 + 4) / 6, (-3 * t**3 + 3 * t**2 + 3 * t + 1) / 6, t**3 / 6
            size_m = self.distance_m / SPLINE_SPREAD
            dx_m, dy_m = (
                size_m * sum(w * np.take_along_axis(one, section + i, axis=-1) for i, w in enumerate(weights))
                for one in knots
            )
            return Trajectory(x_m + dx_m, y_m + dy_m, path.force_n)

        return displace


# --------------------
# A robot is not quite as fast and does not press quite as hard as it should.

MIN_FRACTION = 0.05  # of the request


@dataclass(frozen=True)
class SlideError:
    """Speed and force deviate from slide to slide (offline recordings; a simulated arm has other errors)."""

    speed: float = param(0.01, 'Relative standard deviation of the speed from slide to slide.', low=0.0, high=0.5)
    force: float = param(0.04, 'Relative standard deviation of the force from slide to slide.', low=0.0, high=0.5)

    def slide(self, speed_m_s: Array, force_n: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return speed and force as they become, of the same shape."""
        return (
            speed_m_s * np.maximum(MIN_FRACTION, 1 + self.speed * rng.standard_normal(speed_m_s.shape)),
            force_n * np.maximum(MIN_FRACTION, 1 + self.force * rng.standard_normal(force_n.shape)),
        )


# --------------------
# No sample is everywhere the same.

# Plane waves of 16 to 45 mm in four directions, with phases of no meaning.
WAVES_1_M = 2 * np.pi * np.array([[38.0, 11.0], [-17.0, 57.0], [29.0, -33.0], [9.0, 20.0]])
PHASES = np.array([0.3, 1.9, 4.1, 5.2])
KNOT_M = 1e-3  # straight between such places it is wrong by 2 % of its variation at most


@dataclass(frozen=True)
class Unevenness:
    """The texture is measured more strongly in some places of a sample than in others."""

    relative: float = param(
        0.1, 'Relative standard deviation of the texture strength over some centimetres.', low=0.0, high=1.0
    )

    def gain(self, path: Trajectory, finger: int) -> Array | float:
        """Return the gain at places, (..., n): mean 1, standard deviation `relative`, never below 0."""
        return interpolated_field(self._at, path.x_m, path.y_m, KNOT_M) if len(path) else 1.0

    def _at(self, x_m: Array, y_m: Array) -> Array:
        waves = sum(np.cos(kx * x_m + ky * y_m + phase) for (kx, ky), phase in zip(WAVES_1_M, PHASES, strict=True))
        return np.maximum(1 + self.relative * np.sqrt(2 / len(PHASES)) * waves, 0.0)


# --------------------
# The effects by name, in the order in which they act.

EFFECTS: Mapping[str, type] = {
    'slide_error': SlideError,  # the robot is faster or slower, presses harder or less than it should
    'uneven_motion': UnevenMotion,  # the skin is ahead of its path or behind
    'patch_growth': PatchGrowth,  # a harder pressed finger senses fine textures less
    'force_gain': ForceGain,  # a harder pressed finger senses textures more
    'unevenness': Unevenness,  # no sample is everywhere the same
    'finger_spread': FingerSpread,  # no finger is as sensitive as another
    'noise': Noise,  # of the electronics
    'dropouts': Dropouts,  # moments in which the signal is frozen
}
