# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is done to slides so that they differ from the training: computed on the signals, or simulated."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, lfilter_zi, resample_poly

from texture_core.types import Array, TactileSignal, join_batches
from texture_features.augmentation import Augmentation, smooth_response
from texture_recordings.dataset import LabelledSlide, SlideDataset
from texture_simulation.offline import simulate_slide_streams
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import load_scene
from texture_simulation.sensor_models import SENSORS


def at_other_speed(samples: Array, speed_m_s: float, wanted_m_s: float) -> Array:
    """Return samples (n, n_channels) taken at one speed as they would be at another, at the same rate.

    What frequency does to the sensor and to friction stays that of the speed they were taken at.
    """
    ratio = Fraction(speed_m_s / wanted_m_s).limit_denominator(1000)
    values: Array = resample_poly(samples, ratio.numerator, ratio.denominator, axis=0, padtype='line')
    return values


VIBRATION = 'signal'
BURST_S = 0.01  # samples are lost by the packet
FINGER_SEED = 7  # the same other finger for all slides

# (samples (n, n_channels), rate in Hz, strength, random) -> samples
Change = Callable[[Array, float, float, np.random.Generator], Array]


def _noisy(samples: Array, _rate_hz: float, strength: float, rng: np.random.Generator) -> Array:
    noise: Array = strength * samples.std(axis=0) * rng.standard_normal(samples.shape)
    return samples + noise


def _amplified(samples: Array, _rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    return strength * samples


def _drifting(samples: Array, rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    seconds = np.arange(len(samples))[:, None] / rate_hz
    drift: Array = strength * samples.std(axis=0) * seconds
    return samples + drift


def _worn(samples: Array, rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    """Low-pass of first order with the strength as its cut-off, Hz, at rest at the first sample."""
    pole = math.exp(-2.0 * math.pi * strength / rate_hz)
    b, a = [1.0 - pole], [1.0, -pole]
    worn: Array = lfilter(b, a, samples, axis=0, zi=lfilter_zi(b, a)[:, None] * samples[:1])[0]
    return worn


def _lost(samples: Array, rate_hz: float, strength: float, rng: np.random.Generator) -> Array:
    return np.where(_gaps(len(samples), rate_hz, strength, rng)[:, None], math.nan, samples)


def _held(samples: Array, rate_hz: float, strength: float, rng: np.random.Generator) -> Array:
    gaps = _gaps(len(samples), rate_hz, strength, rng)
    gaps[0] = False
    last_there = np.maximum.accumulate(np.where(gaps, 0, np.arange(len(samples))))
    held: Array = samples[last_there]
    return held


def _gaps(count: int, rate_hz: float, share: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return which samples are missing, (count,), whole bursts at a time."""
    burst = max(1, round(BURST_S * rate_hz))
    return np.repeat(rng.random(-(-count // burst)) < share, burst)[:count]


def _clipped(samples: Array, _rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    middle, limit = samples.mean(axis=0), strength * samples.std(axis=0)
    return np.clip(samples, middle - limit, middle + limit)


def _hurried(samples: Array, _rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    """Return the way at another speed: less of it in the same time, or all of it in less."""
    return at_other_speed(samples, 1.0, strength)[: len(samples)]


def _filtered(samples: Array, _rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    """Filter the vibration by one smooth random response (dB), the same for all slides."""
    rng = np.random.default_rng([FINGER_SEED, round(1000 * strength), True])
    mean: Array = samples.mean(axis=0)
    response = smooth_response(len(samples) // 2 + 1, strength, rng)
    filtered: Array = np.fft.irfft(np.fft.rfft(samples - mean, axis=0) * response[:, None], len(samples), axis=0)
    return mean + filtered


def _other_taxels(samples: Array, _rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    """Give the slow channels other gains and offsets, the same for all slides."""
    rng = np.random.default_rng([FINGER_SEED, round(1000 * strength), False])
    mean: Array = samples.mean(axis=0)
    gains = np.exp(0.05 * strength * rng.standard_normal(samples.shape[1]))
    offsets = 3.0 * strength * rng.standard_normal(samples.shape[1])
    changed: Array = mean + gains * (samples - mean) + offsets
    return changed


@dataclass(frozen=True)
class DisturbanceSweep:
    """One disturbance at several strengths."""

    change: Change  # What is done to the vibration
    strengths: Sequence[float]  # How strongly
    form: str  # Name of the disturbance at a strength
    slow: Change | None = None  # What is done to the slow channels; None leaves them as they are
    percent: bool = False  # Whether the name gives the strength in percent
    nothing: float = 0.0  # Strength at which nothing changes; 1 for factors
    # Which strengths the classifier is trained on; None where it is trained on none
    trained: Callable[[Augmentation], tuple[float, float] | None] = lambda _: None

    @property
    def is_factor(self) -> bool:
        """Whether strengths below and above that of no change are measured."""
        return self.nothing == 1.0

    def name(self, strength: float) -> str:
        """Return the name of the disturbance at this strength."""
        return self.form.format(100.0 * strength if self.percent else strength)

    def tick(self, strength: float) -> str:
        """Return the strength as a number, in percent where the name gives it so."""
        return f'{100.0 * strength if self.percent else strength:g}'


ROWS: Mapping[str, DisturbanceSweep] = {
    'gain': DisturbanceSweep(
        _amplified,
        (0.5, 0.7, 0.8, 0.9, 1.1, 1.25, 1.4, 2.0),
        'gain × {:g}',
        nothing=1.0,
        trained=lambda augmentation: (1.0 / augmentation.gain_range, augmentation.gain_range),
    ),
    'white noise': DisturbanceSweep(
        _noisy,
        (0.003, 0.01, 0.03, 0.1),
        'white noise {:g} % of the rms',
        slow=_noisy,
        percent=True,
        trained=lambda augmentation: (0.0, augmentation.noise_range),
    ),
    'speed': DisturbanceSweep(
        _hurried,
        (0.4, 0.7, 0.9, 0.95, 1.05, 1.1, 1.4, 2.0),
        'speed × {:g}',
        slow=_hurried,
        nothing=1.0,
        trained=lambda augmentation: (1.0 - augmentation.speed_range, 1.0 + augmentation.speed_range),
    ),
    'another finger': DisturbanceSweep(_filtered, (0.5, 1.0, 2.0, 4.0), 'another finger, {:g} dB', slow=_other_taxels),
    'wear': DisturbanceSweep(_worn, (800.0, 500.0, 300.0), 'low-pass {:g} Hz', nothing=math.inf),
    'offset drift': DisturbanceSweep(_drifting, (0.1, 1.0, 10.0), 'drift {:g} rms/s', slow=_drifting),
    'lost samples': DisturbanceSweep(_lost, (0.001, 0.005, 0.01), 'lost samples {:g} %', percent=True),
    'hidden losses': DisturbanceSweep(_held, (0.003, 0.01, 0.03, 0.1), 'hidden losses {:g} %', percent=True),
    'clipped': DisturbanceSweep(_clipped, (3.0, 2.0, 1.0), 'clipped at {:g} rms', nothing=math.inf),
}


def disturbed(item: LabelledSlide, row: DisturbanceSweep, strength: float, rng: np.random.Generator) -> LabelledSlide:
    """Return a slide under a disturbance of this strength; what nothing is done to stays as it came."""
    changes = {topic: row.change if topic == VIBRATION else row.slow for topic in item.signals}
    signals = {
        topic: [_changed(run, change, strength, rng) for run in join_batches(item.signals[topic])]
        for topic, change in changes.items()
        if change
    }
    return dataclasses.replace(item, signals={**item.signals, **signals})


def _changed(run: TactileSignal, change: Change, strength: float, rng: np.random.Generator) -> TactileSignal:
    samples = change(run.samples.astype(np.float64), run.sampling_rate_hz, strength, rng)
    return dataclasses.replace(run, samples=samples.astype(np.float32))


SCENE, SPEED_M_S, FORCE_N, SLIDE_S = 'twelve_textures', 0.1, 2.0, 3.0
CIRCLE_M = 0.005  # radius
TRAINED_MOTION = 'linear_slide'


@dataclass(frozen=True, eq=False)
class Condition:
    """How a surface is explored."""

    sliding: SimulatedSlide  # Speed, force, direction and radius
    motion: str = TRAINED_MOTION  # Name of the exploratory motion


TRAINED = Condition(SimulatedSlide(SPEED_M_S, FORCE_N, SLIDE_S))


def _force(times: float) -> Condition:
    return Condition(dataclasses.replace(TRAINED.sliding, force_n=times * FORCE_N))


SIMULATED: Mapping[str, Condition] = {
    **{f'force × {times:g}, simulated': _force(times) for times in (0.5, 0.7, 0.8, 1.25, 1.4, 2.0)},
    'circle, simulated': Condition(dataclasses.replace(TRAINED.sliding, radius_m=CIRCLE_M), 'circular'),
    'across, simulated': Condition(dataclasses.replace(TRAINED.sliding, direction_rad=math.pi / 2)),
}


def simulate(condition: Condition, count: int, rng: np.random.Generator, *, told: bool) -> SlideDataset:
    """Return `count` slides over each surface of the scene, with all streams of its sensor."""
    scene = load_scene(SCENE)
    parts = {
        surface: simulate_slide_streams(scene, surface, count, condition.sliding, rng) for surface in scene.surfaces
    }
    streams = {stream.topic: stream for stream in SENSORS[scene.sensor].streams}
    sliding = condition.sliding
    circle = bool(sliding.radius_m)
    return SlideDataset.from_arrays(
        {topic: [samples for part in parts.values() for samples in part[topic]] for topic in streams},
        [surface for surface in parts for _ in range(count)],
        {topic: stream.rate_hz for topic, stream in streams.items()},
        channels={topic: stream.channels for topic, stream in streams.items()},
        motion=condition.motion if told else TRAINED_MOTION,
        speed_m_s=float(sliding.speed_m_s) if told else math.nan,
        force_n=float(sliding.force_n) if told else math.nan,
        direction_rad=float(sliding.direction_rad) if told and not circle else math.nan,
    )
