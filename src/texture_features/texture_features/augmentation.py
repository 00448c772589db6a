# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Copies of training windows under computed disturbances, so that a model covers what lies next to its training."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.types import NANOSECONDS, Array, ExplorationState, TactileSignal
from texture_features.feature_set import CHUNK, MOTION, AugmentedFeatures, FeatureCopies, FeatureSet
from texture_features.windows import CutWindow, WindowBatch, WindowEvent, WindowParams, cut_recording

# --------------------
# How training examples are augmented.


@dataclass(frozen=True)
class Augmentation:
    """Changes of the training slides that a classifier is to tolerate.

    Speed and noise change the signals of copies of each slide. Gain and slide jitter change the features of each drawn
    example: a gain adds a constant to the logarithm of a power or an amplitude, and slide jitter adds a random multiple
    of the deviation of a training slide from the mean of its class, which is noise with the covariance that slides of
    one class have among themselves.
    """

    copies: int = param(
        0,
        'Number of augmented copies that are made of each training slide; 0 disables the augmentation.',
        low=0,
        high=100,
    )
    speed_range: float = param(
        0.15,
        'Largest relative change of the speed of a copy, to either side; half of the copies keep the speed they have.',
        low=0.0,
        high=1.0,
    )
    noise_range: float = param(
        0.05,
        'Largest standard deviation of the white noise added to a copy, relative to that of the slide; half of the '
        'copies stay without noise, and small values are more frequent than large ones.',
        low=0.0,
        high=10.0,
    )
    gain_range: float = param(
        1.6, 'Largest factor by which the vibration of a drawn example is amplified or attenuated.', low=1.0, high=10.0
    )
    gain_probability: float = param(0.7, 'Fraction of the drawn examples whose gain is changed.', low=0.0, high=1.0)
    slide_jitter: float = param(
        1.5,
        'Standard deviation of the factor by which a slide deviation is added to a drawn example; larger values make '
        'the classifier tolerate more drift and cost accuracy without drift.',
        low=0.0,
        high=10.0,
    )
    clean_fraction: float = param(
        0.43, 'Fraction of the drawn examples that are of the undisturbed slides.', low=0.0, high=1.0
    )
    disturbed_copies: int = param(
        6,
        'Number of strongly disturbed copies of each slide on which early stopping is fitted; no classifier is '
        'trained on them.',
        low=0,
        high=100,
    )


# --------------------
# Disturbances of the windows of one slide: one kind at a time, by a strength.

BURST_S = 0.01  # samples are lost by the packet
CURVE_TERMS = 5  # of the random response of another finger over frequency
RATIO_LIMIT = 40  # numerator and denominator of a speed ratio: the resampling filter grows with them


@dataclass(frozen=True, eq=False)
class SlideWindows:
    """Windows of one input over one slide."""

    samples: Array
    rate_hz: float
    starts_s: Array
    vibration: bool

    @property
    def mean(self) -> Array:
        """Mean of each channel over the slide, (n_channels,)."""
        return self.samples.mean(axis=(0, 1))

    @property
    def rms(self) -> Array:
        """Root mean square of each channel about its mean over the slide, (n_channels,)."""
        return self.samples.std(axis=(0, 1))


# Takes the windows of one input, a strength, of which each disturbance defines the unit, and the source of all that is
# random; returns the samples (n_windows, n_samples, n_channels) as the disturbance would change them.
Disturbance = Callable[[SlideWindows, float, np.random.Generator], Array]


def at_speed(windows: SlideWindows, speed: float, count: int) -> Array:
    """Return the first `count` samples of each window as they are at a multiple of the speed.

    The windows must hold at least speed · count samples.
    """
    longer = windows.samples
    ratio = Fraction(1.0 / speed).limit_denominator(RATIO_LIMIT)
    if ratio != 1:
        taps = _resampling_filter(max(ratio.numerator, ratio.denominator))
        from scipy.signal import resample_poly  # noqa: PLC0415

        longer = resample_poly(longer, ratio.numerator, ratio.denominator, axis=1, window=taps, padtype='line')
    return longer[:, :count]


@lru_cache(maxsize=RATIO_LIMIT)
def _resampling_filter(rate: int) -> Array:
    """Return the low-pass that `resample_poly` designs at each call, which takes as long as the rest of the call."""
    from scipy.signal import firwin  # noqa: PLC0415  # takes 0.5 s, and only training needs it

    return firwin(20 * rate + 1, 1.0 / rate, window=('kaiser', 5.0))


def add_noise(windows: SlideWindows, strength: float, rng: np.random.Generator) -> Array:
    """Add white noise with a multiple, the strength, of the root mean square of the slide."""
    return windows.samples + strength * windows.rms * rng.standard_normal(windows.samples.shape)


def amplify(windows: SlideWindows, strength: float, _rng: np.random.Generator) -> Array:
    """Multiply the vibration by the strength; slow channels stay as they are."""
    return strength * windows.samples if windows.vibration else windows.samples


def add_drift(windows: SlideWindows, strength: float, _rng: np.random.Generator) -> Array:
    """Add an offset that grows by a multiple of the root mean square of the slide per second, from window to window."""
    times = windows.starts_s[:, None] + np.arange(windows.samples.shape[1]) / windows.rate_hz
    return windows.samples + strength * windows.rms * times[..., None]


def hold_lost(windows: SlideWindows, strength: float, rng: np.random.Generator) -> Array:
    """Replace a fraction of the vibration, by bursts of 10 ms, by the last value before; slow channels stay.

    The first sample of a window is never lost.
    """
    n_windows, n_samples, _ = windows.samples.shape
    if not windows.vibration:
        return windows.samples
    burst = max(1, round(BURST_S * windows.rate_hz))
    lost = np.repeat(rng.random((n_windows, -(-n_samples // burst))) < strength, burst, axis=1)[:, :n_samples]
    lost[:, 0] = False
    last = np.maximum.accumulate(np.where(lost, 0, np.arange(n_samples)), axis=1)
    return np.take_along_axis(windows.samples, last[..., None], axis=1)


def clip(windows: SlideWindows, strength: float, _rng: np.random.Generator) -> Array:
    """Limit the vibration to a multiple of its root mean square about the mean; slow channels stay as they are."""
    if not windows.vibration:
        return windows.samples
    limit = strength * windows.rms
    return np.clip(windows.samples, windows.mean - limit, windows.mean + limit)


def low_pass(windows: SlideWindows, strength: float, _rng: np.random.Generator) -> Array:
    """Filter the vibration by a low-pass of first order whose cut-off is a multiple of the sampling rate.

    Slow channels stay as they are.
    """
    if not windows.vibration:
        return windows.samples
    n_samples = windows.samples.shape[1]
    pole = math.exp(-2.0 * math.pi * strength)
    response = (1.0 - pole) / (1.0 - pole * np.exp(-2j * math.pi * np.fft.rfftfreq(n_samples)))
    deviation = windows.samples - windows.mean
    return windows.mean + np.fft.irfft(np.fft.rfft(deviation, axis=1) * response[:, None], n_samples, axis=1)


def other_finger(windows: SlideWindows, strength: float, rng: np.random.Generator) -> Array:
    """Filter the vibration by a smooth random response with this standard deviation in dB; shift slow channels.

    The mean over the slide stays for vibration; of slow channels the gains and offsets change.
    """
    n_channels = windows.samples.shape[2]
    deviation = windows.samples - windows.mean
    if not windows.vibration:
        gains = np.exp(0.05 * strength * rng.standard_normal(n_channels))
        return windows.mean + gains * deviation + 3.0 * strength * rng.standard_normal(n_channels)
    response = smooth_response(windows.samples.shape[1] // 2 + 1, strength, rng)
    filtered = np.fft.irfft(np.fft.rfft(deviation, axis=1) * response[:, None], windows.samples.shape[1], axis=1)
    return windows.mean + filtered


def smooth_response(count: int, strength_db: float, rng: np.random.Generator) -> Array:
    """Return a smooth random amplitude response over `count` frequencies from 0 to half the rate."""
    frequencies = np.linspace(0.0, 1.0, count)
    terms = np.cos(np.pi * np.arange(CURVE_TERMS)[:, None] * frequencies)
    curve = rng.standard_normal(CURVE_TERMS) @ terms / math.sqrt(3.0)  # standard deviation about 1
    return 10.0 ** (strength_db * curve / 20.0)


# Of each kind the disturbance, and its smallest and largest strength on which early stopping is fitted: from harmless
# to useless. A change of speed has none, as it needs longer windows.
DISTURBANCES: Mapping[str, tuple[Disturbance | None, float, float]] = {
    'speed': (None, 0.35, 2.2),
    'gain': (amplify, 0.4, 2.5),
    'noise': (add_noise, 0.003, 0.3),
    'finger': (other_finger, 0.3, 5.0),
    'drift': (add_drift, 0.1, 10.0),
    'held': (hold_lost, 0.003, 0.3),
    'clipped': (clip, 0.7, 4.0),
    'low-pass': (low_pass, 0.1, 1.0),
}
KINDS = tuple(DISTURBANCES)


# --------------------
# Augmented and disturbed copies of labelled slides, as features.

GAIN_STEP = 1.25  # ratio of the two gains at which the response of the features is measured
NOISE = 'noise'
PROBABILITY = 0.5  # of a change of speed, and of noise, in a copy
Cut = Callable[[WindowParams], Iterable[WindowEvent]]
Batches = Mapping[str, SlideWindows]
Copy = tuple[NDArray[np.float32], str, int, str]  # values (n_windows, n_features), slide, number, kind


class Augmenter:
    """Collect the copies of slides, one slide after the other."""

    def __init__(self, feature_set: FeatureSet, augmentation: Augmentation, seed: int = 0) -> None:
        self._features = feature_set
        self._augmentation = augmentation
        self._seed = seed
        self._slides = 0
        self._copies: list[Copy] = []
        self._disturbed: list[Copy] = []
        self._responses: dict[str, Array] = {}

    def add(
        self,
        name: str,
        events: Sequence[WindowEvent],
        signals: Mapping[str, Sequence[TactileSignal]],
        states: Sequence[ExplorationState],
    ) -> None:
        """Add the copies of a slide, of which the windows are cut already."""

        def cut(params: WindowParams) -> Iterable[WindowEvent]:
            used = {topic: signals[topic] for topic in self._features.topics}
            return cut_recording(used, states, params, self._features.window_names)

        rng = np.random.default_rng([self._seed, self._slides])
        self._slides += 1
        windows = [event for event in events if isinstance(event, CutWindow)]
        if not windows:
            return
        self._responses[name] = self._gain_response(windows[0])
        longest = 1.0 + self._augmentation.speed_range
        longer = self._longer(cut, longest)
        for copy in range(self._augmentation.copies if longer else 0):
            augmented, noise = self._augmented(longer, windows[0], rng)
            self._copies.append((augmented, name, copy, noise))
        for copy in range(self._augmentation.disturbed_copies):
            kind = KINDS[rng.integers(len(KINDS))]
            values = self._disturb(kind, cut, windows, rng)
            if values is not None:
                self._disturbed.append((values, name, copy, kind))

    def result(self) -> AugmentedFeatures | None:
        """Return the copies of all slides; None if there are none."""
        if not self._copies:
            return None
        return AugmentedFeatures(_gathered(self._copies), _gathered(self._disturbed), self._responses)

    def _longer(self, cut: Cut, times: float) -> list[CutWindow]:
        """Return longer windows, from which others can be cut at a higher speed."""
        own = self._features.windows
        # One sample more, so that rounding leaves enough for the last sample of a resampled window.
        params = dataclasses.replace(own, length_s=own.length_s * times + 0.02)
        return [event for event in cut(params) if isinstance(event, CutWindow)]

    def _augmented(
        self, longer: Sequence[CutWindow], like: CutWindow, rng: np.random.Generator
    ) -> tuple[NDArray[np.float32], str]:
        widest = math.log1p(self._augmentation.speed_range)
        speed = math.exp(rng.uniform(-widest, widest)) if rng.random() < PROBABILITY else 1.0
        batches = _at_speed(_batches(longer, self._features.window_names), like, speed)
        noisy = rng.random() < PROBABILITY
        if noisy:
            strength = self._augmentation.noise_range * rng.random() ** 2
            batches = _changed(batches, lambda windows: add_noise(windows, strength, rng))
        return self._extract(batches, longer, speed), NOISE if noisy else ''

    def _disturb(
        self, kind: str, cut: Cut, windows: Sequence[CutWindow], rng: np.random.Generator
    ) -> NDArray[np.float32] | None:
        disturbance, weakest, strongest = DISTURBANCES[kind]
        strength = math.exp(rng.uniform(math.log(weakest), math.log(strongest)))
        if disturbance is None:
            longer = self._longer(cut, max(strength, 1.0))
            if not longer:
                return None
            batches = _at_speed(_batches(longer, self._features.window_names), windows[0], strength)
            return self._extract(batches, longer, strength)
        batches = _changed(
            _batches(windows, self._features.window_names), lambda batch: disturbance(batch, strength, rng)
        )
        return self._extract(batches, windows, 1.0)

    def _extract(self, batches: Batches, windows: Sequence[CutWindow], speed: float) -> NDArray[np.float32]:
        """Return the features (n_windows, n_features) of changed samples."""
        motion: dict[str, Any] = {name: np.array([getattr(window, name) for window in windows]) for name in MOTION}
        motion['speed_m_s'] *= speed
        parts = [slice(start, start + CHUNK) for start in range(0, len(windows), CHUNK)]
        channels = {topic: windows[0].windows[topic].channels for topic in batches}
        values = [
            self._features.values(
                [
                    WindowBatch(
                        batch.samples[part],
                        batch.rate_hz,
                        channels=channels[topic],
                        **{name: each[part] for name, each in motion.items()},
                    )
                    for topic, batch in batches.items()
                ]
            )
            for part in parts
        ]
        return np.concatenate(values).astype(np.float32)

    def _gain_response(self, window: CutWindow) -> Array:
        topic = self._features.window_names[0]
        stretch = window.windows[topic]
        louder = {**window.windows, topic: dataclasses.replace(stretch, samples=GAIN_STEP * stretch.samples)}
        both = self._features.extract_many([window, dataclasses.replace(window, windows=louder)])
        return (both[1].values - both[0].values) / math.log(GAIN_STEP)


def _batches(windows: Sequence[CutWindow], topics: Iterable[str]) -> Batches:
    """Return the windows of each input; the first input is the vibration."""
    starts_s = np.array([window.start_ns - windows[0].start_ns for window in windows]) / NANOSECONDS
    return {
        topic: SlideWindows(
            np.stack([window.windows[topic].samples for window in windows]),
            windows[0].windows[topic].rate_hz,
            starts_s,
            vibration=number == 0,
        )
        for number, topic in enumerate(topics)
    }


def _changed(batches: Batches, change: Callable[[SlideWindows], Array]) -> Batches:
    return {topic: dataclasses.replace(batch, samples=change(batch)) for topic, batch in batches.items()}


def _at_speed(batches: Batches, like: CutWindow, speed: float) -> Batches:
    """Return windows as long as those of `like` at a multiple of the speed."""
    return {
        topic: dataclasses.replace(batch, samples=at_speed(batch, speed, len(like.windows[topic].samples)))
        for topic, batch in batches.items()
    }


def _gathered(parts: Sequence[Copy]) -> FeatureCopies:
    lengths = [len(values) for values, *_ in parts]
    if not parts:
        nothing = np.zeros(0, dtype=str)
        return FeatureCopies(np.zeros((0, 0), np.float32), nothing, np.zeros(0, np.intp), nothing)
    groups, copies, kinds = (np.repeat([part[column] for part in parts], lengths) for column in (1, 2, 3))
    values = np.concatenate([values for values, *_ in parts])
    return FeatureCopies(values, groups, copies.astype(np.intp), kinds)
