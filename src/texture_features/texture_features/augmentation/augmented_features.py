"""Augmented and disturbed copies of labelled slides, as features."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from texture_core.arrays import Array
from texture_core.signal import NANOSECONDS
from texture_features.augmentation.augmentation import Augmentation
from texture_features.augmentation.disturbances import (
    DISTURBANCES,
    KINDS,
    SlideWindows,
    add_noise,
    at_speed,
)
from texture_features.augmentation.feature_copies import AugmentedFeatures, FeatureCopies
from texture_features.feature_set import FeatureSet
from texture_features.windowing.windows import CutWindow, WindowEvent, WindowParams

GAIN_STEP = 1.25  # ratio of the two gains at which the response of the features is measured
NOISE = 'noise'
PROBABILITY = 0.5  # of a change of speed, and of noise, in a copy
Cut = Callable[[WindowParams], Sequence[WindowEvent]]
Batches = Mapping[str, SlideWindows]


class Augmenter:
    """Collect the copies of slides, one slide after the other.

    Parameters
    ----------
    feature_set
        Features, and how the windows are cut for training.
    augmentation
        What is changed, and how much.
    seed
        Of the random changes.

    Examples
    --------
    >>> augmenter = Augmenter(FeatureSet.load('fast'), Augmentation(copies=2))
    >>> augmenter.add('slide', lambda params: [])  # a slide without a window has no copies
    >>> augmenter.result() is None
    True
    """

    def __init__(self, feature_set: FeatureSet, augmentation: Augmentation, seed: int = 0) -> None:
        self._features = feature_set
        self._augmentation = augmentation
        self._seed = seed
        self._slides = 0
        self._copies: list[tuple[Array, str, int, str]] = []
        self._disturbed: list[tuple[Array, str, int, str]] = []
        self._responses: list[Array] = []

    def add(self, name: str, cut: Cut) -> None:
        """Add the copies of a slide.

        Parameters
        ----------
        name
            Of the slide, as in the labelled features.
        cut
            Returns the windows of the slide for the given length and hop.
        """
        rng = np.random.default_rng([self._seed, self._slides])
        self._slides += 1
        windows = [event for event in cut(self._features.windows) if isinstance(event, CutWindow)]
        if not windows:
            return
        self._responses.append(self._gain_response(windows[0]))
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
        response: Array = np.mean(self._responses, axis=0)
        return AugmentedFeatures(_gathered(self._copies), _gathered(self._disturbed or self._copies[:0]), response)

    def _longer(self, cut: Cut, times: float) -> list[CutWindow]:
        """Return longer windows, from which others can be cut at a higher speed."""
        own = self._features.windows
        # One sample more, so that rounding leaves enough for the last sample of a resampled window.
        params = dataclasses.replace(own, length_s=own.length_s * times + 0.02)
        return [event for event in cut(params) if isinstance(event, CutWindow)]

    def _augmented(self, longer: Sequence[CutWindow], like: CutWindow, rng: np.random.Generator) -> tuple[Array, str]:
        widest = math.log1p(self._augmentation.speed_range)
        speed = math.exp(rng.uniform(-widest, widest)) if rng.random() < PROBABILITY else 1.0
        batches = _at_speed(_batches(longer, self._features.window_names), like, speed)
        noisy = rng.random() < PROBABILITY
        if noisy:
            strength = self._augmentation.noise_range * rng.random() ** 2
            batches = _changed(batches, lambda windows: add_noise(windows, strength, rng))
        return self._extract(batches, longer, like, speed), NOISE if noisy else ''

    def _disturb(self, kind: str, cut: Cut, windows: Sequence[CutWindow], rng: np.random.Generator) -> Array | None:
        strengths = DISTURBANCES[kind]
        strength = strengths.draw(rng)
        disturbance = strengths.disturbance
        if disturbance is None:
            longer = self._longer(cut, max(strength, 1.0))
            if not longer:
                return None
            batches = _at_speed(_batches(longer, self._features.window_names), windows[0], strength)
            return self._extract(batches, longer, windows[0], strength)
        batches = _changed(
            _batches(windows, self._features.window_names), lambda batch: disturbance(batch, strength, rng)
        )
        return self._extract(batches, windows, windows[0], 1.0)

    def _extract(self, batches: Batches, windows: Sequence[CutWindow], like: CutWindow, speed: float) -> Array:
        """Return the features (n_windows, n_features) of changed samples."""
        events = [
            dataclasses.replace(
                window,
                length_s=like.length_s,
                speed_m_s=speed * window.speed_m_s,
                windows={
                    topic: dataclasses.replace(window.windows[topic], samples=batch.samples[number])
                    for topic, batch in batches.items()
                },
            )
            for number, window in enumerate(windows)
        ]
        return np.stack([vector.values for vector in self._features.extract_many(events)])

    def _gain_response(self, window: CutWindow) -> Array:
        topic = self._features.window_names[0]
        own = window.windows[topic]
        louder = {**window.windows, topic: dataclasses.replace(own, samples=GAIN_STEP * own.samples)}
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


def _gathered(parts: Sequence[tuple[Array, str, int, str]]) -> FeatureCopies:
    lengths = [len(values) for values, *_ in parts]
    if not parts:
        nothing = np.zeros(0, dtype=str)
        return FeatureCopies(np.zeros((0, 0), np.float32), nothing, np.zeros(0, np.intp), nothing)
    groups, copies, kinds = (np.repeat([part[column] for part in parts], lengths) for column in (1, 2, 3))
    values = np.concatenate([values.astype(np.float32) for values, *_ in parts])
    return FeatureCopies(values, groups, copies.astype(np.intp), kinds)
