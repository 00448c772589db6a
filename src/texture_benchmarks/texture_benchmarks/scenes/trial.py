"""Ablation of the terms of a simulated scene: recognition with each term and without it."""

from __future__ import annotations

import itertools
import time
import zlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

from texture_benchmarks.scenes.touch_protocols import TouchProtocol, variants
from texture_core.arrays import Array, Samples
from texture_simulation.scene import Scene
from texture_simulation.sensors.catalogue import SENSORS
from texture_simulation.simulated_slide import SimulatedSlide
from texture_simulation.slide_batches import simulate_slide_streams

BANDS = 24  # of the spectrum, each of equal width on a logarithmic scale
LOWEST_HZ = 5.0
MIN_POWER = 1e-12
CONFIDENCE = 0.95
MIN_CHANGE = 0.01  # of the accuracy, or of the decisions: an effect with less change needs no term

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class SlideFeatures:
    """Features of slides, (n, n_features), and the number of the surface of each, (n,)."""

    values: Array
    codes: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class MeanDifference:
    """A mean difference over repetitions, in shares, and its half interval of 95 %."""

    mean: float
    half: float

    @property
    def matters(self) -> bool:
        """Whether it is certain, and large enough to be seen."""
        return bool(abs(self.mean) > self.half and abs(self.mean) >= MIN_CHANGE)

    @property
    def most(self) -> float:
        """How large it may be, whichever sign it has."""
        return abs(self.mean) + self.half


@dataclass(frozen=True, eq=False)
class TermEffect:
    """What happens when a term is removed.

    Parameters
    ----------
    term
        Name.
    easier
        Accuracy without the term, in learning and in the test, less that with it.
    unprepared
        Accuracy on slides with the term of a model trained without it, less that of one trained with it.
    changed
        Share of the test slides decided otherwise by a model trained without it, less that by one trained with it from
        other slides.
    paper
        Accuracy of the paper's method without the term, in learning and in the test, less that with it, if known.
    cost_us
        What the term adds to the computing time of a slide.
    """

    term: str
    easier: MeanDifference
    unprepared: MeanDifference
    changed: MeanDifference
    paper: MeanDifference | None = None
    cost_us: float = 0.0

    @property
    def verdict(self) -> str:
        """Return 'decides' if it certainly changes something, 'idle' if certainly nothing of note, else 'open'."""
        known = [self.easier, self.unprepared, *([self.paper] if self.paper else [])]
        if any(item.matters for item in known) or (self.changed.matters and self.changed.mean > 0):
            return 'decides'
        return 'idle' if max(item.most for item in known) < MIN_CHANGE else 'open'


@dataclass(frozen=True, eq=False)
class Ablation:
    """A scene and the influence of each of its terms.

    Parameters
    ----------
    scene
        Name.
    accuracy, paper
        With which its surfaces are distinguished, and by the paper's method, if known.
    tested
        How many slides.
    term_effects
        Of its terms.
    slide_us
        Computing time of a slide.
    """

    scene: str
    accuracy: float
    tested: int
    term_effects: Sequence[TermEffect] = field(default=())
    slide_us: float = 0.0
    paper: float | None = None


def ablate(
    scene: Scene, touch_protocol: TouchProtocol, slides: int, repeats: int, seed: int, *, terms: Collection[str] = ()
) -> Ablation:
    """Return the effect of each term of a scene.

    Parameters
    ----------
    scene, touch_protocol
        What is touched, and how.
    slides
        To train on, and as many to test, about: as many of each surface.
    repeats
        How often all is repeated.
    seed
        Of everything random.
    terms
        Those to remove, one at a time; all if empty.

    Returns
    -------
    Ablation
        Change of accuracy and of features by each term.
    """
    others = {term: other for term, other in variants(scene, touch_protocol).items() if not terms or term in terms}
    rows = [_repeat(scene, others, touch_protocol, slides, [seed, number]) for number in range(repeats)]
    accuracy = float(np.mean([row.right for row in rows]))
    term_effects = [_term_effect(term, rows) for term in others]
    return Ablation(scene.name, accuracy, repeats * rows[0].tested, term_effects)


def scan_s(scene: Scene, touch_protocol: TouchProtocol, count: int) -> float:
    """Return the computing time of a slide, mean over all surfaces, `count` slides of each at once.

    Parameters
    ----------
    scene
        Surfaces, sensor and effects.
    touch_protocol
        Speed, force and duration.
    count
        Slides over each surface.

    Returns
    -------
    float
        s.
    """
    rng = np.random.default_rng(0)
    began = time.thread_time()
    for surface in scene.surfaces:
        simulate_slide_streams(scene, surface, count, _sliding(touch_protocol, count, 0.0), rng)
    return (time.thread_time() - began) / (count * len(scene.surfaces))


def timed(ablation: Ablation, scene: Scene, touch_protocol: TouchProtocol, count: int, repeats: int) -> Ablation:
    """Return the same with the time that each term takes: medians of measurements taken in turn.

    Parameters
    ----------
    ablation
        Effects of the terms.
    scene
        Surfaces, sensor and effects.
    touch_protocol
        Speed, force and duration.
    count
        Slides over each surface.
    repeats
        Number of measurements.

    Returns
    -------
    Ablation
    """
    others = variants(scene, touch_protocol)
    compared = [scene, *(others[term_effect.term] for term_effect in ablation.term_effects)]
    for made in compared:
        scan_s(made, touch_protocol, count)  # makes what is made once
    taken_us = 1e6 * np.array([[scan_s(made, touch_protocol, count) for made in compared] for _ in range(repeats)])
    costs_us = np.median(taken_us[:, :1] - taken_us, axis=0)[1:]
    term_effects = [
        replace(term_effect, cost_us=float(cost))
        for term_effect, cost in zip(ablation.term_effects, costs_us, strict=True)
    ]
    return replace(ablation, term_effects=term_effects, slide_us=float(np.median(taken_us[:, 0])))


def simulate_features(
    scene: Scene, touch_protocol: TouchProtocol, count: int, seed: Sequence[int], fingers: Sequence[int]
) -> SlideFeatures:
    """Return `count` slides over each surface, assigned to the fingers; their randomness follows from the seed.

    Parameters
    ----------
    scene
        Surfaces, sensor and effects.
    touch_protocol
        Speed, force and duration.
    count
        Slides over each surface.
    seed
        Of everything random.
    fingers
        Individuals of the sensor, taken in turn.

    Returns
    -------
    SlideFeatures
    """
    values = [
        np.concatenate(
            [_extracted(scene, name, touch_protocol, count, ([*seed, finger], finger)) for finger in fingers]
        )
        for name in scene.surfaces
    ]
    codes = np.repeat(np.arange(len(values)), [len(part) for part in values])
    return SlideFeatures(np.concatenate(values), codes)


def extract_features(samples: Samples, rate_hz: float) -> Array:
    """Return the logarithm of the power in bands of each channel, (n, n_channels · BANDS).

    Parameters
    ----------
    samples : (n, n_samples, n_channels)
    rate_hz
        Sampling rate.

    Returns
    -------
    (n, n_channels · BANDS)
    """
    n_samples = samples.shape[1]
    spectrum = np.fft.rfft(samples * np.hanning(n_samples)[:, None], axis=1)
    edges_hz = np.geomspace(LOWEST_HZ, rate_hz / 2, BANDS + 1)
    edges = np.searchsorted(np.fft.rfftfreq(n_samples, 1 / rate_hz), edges_hz)
    # Below, bands may be narrower than a bin: such a band takes the bin it lies in.
    starts, ends = edges[:-1], np.maximum(edges[1:], edges[:-1] + 1)
    total = np.concatenate([np.zeros_like(samples[:, :1]), np.cumsum(np.abs(spectrum) ** 2, axis=1)], axis=1)
    ends = np.minimum(ends, total.shape[1] - 1)
    power = (total[:, ends] - total[:, np.minimum(starts, ends - 1)]) / n_samples
    return np.asarray(np.log10(np.maximum(power, 0.0) + MIN_POWER).reshape(len(samples), -1), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class _Row:
    """What one repetition gave: accuracy with all terms, and by term the three differences."""

    right: float
    tested: int
    differences: Mapping[str, tuple[float, float, float]]


def _repeat(
    scene: Scene, others: Mapping[str, Scene], touch_protocol: TouchProtocol, slides: int, seed: list[int]
) -> _Row:
    count = max(2, round(slides / len(scene.surfaces)))

    def training_features(of: Scene, part: int) -> SlideFeatures:
        each = max(1, count // len(touch_protocol.training_by))
        return simulate_features(of, touch_protocol, each, [*seed, part], touch_protocol.training_by)

    def tested(of: Scene) -> SlideFeatures:
        each = max(1, count // len(touch_protocol.tested_by))
        pressed = replace(touch_protocol, forces_n=touch_protocol.tested_forces_n or touch_protocol.forces_n)
        return simulate_features(of, pressed, each, [*seed, 2], touch_protocol.tested_by)

    predict, test = _learner(training_features(scene, 0)), tested(scene)
    answers, again = predict(test.values), _learner(training_features(scene, 1))(test.values)
    right, usual = float(np.mean(answers == test.codes)), float(np.mean(answers != again))
    differences = {}
    for term, other in others.items():
        own = _learner(training_features(other, 0))
        alone = tested(other)
        easier = float(np.mean(own(alone.values) == alone.codes)) - right
        unprepared = own(test.values)
        differences[term] = (
            easier,
            float(np.mean(unprepared == test.codes)) - right,
            float(np.mean(unprepared != answers)) - usual,
        )
    return _Row(right, len(test.codes), differences)


def _term_effect(term: str, rows: Sequence[_Row]) -> TermEffect:
    easier, unprepared, changed = zip(*(row.differences[term] for row in rows), strict=True)
    return TermEffect(term, difference(easier), difference(unprepared), difference(changed))


def difference(values: Sequence[float] | Array) -> MeanDifference:
    """Return the mean of differences, one of each repetition, with its interval.

    Parameters
    ----------
    values : (n_repetitions,)
    """
    mean = float(np.mean(values))
    if len(values) < 2:
        return MeanDifference(mean, np.inf)
    spread = float(np.std(values, ddof=1)) / np.sqrt(len(values))
    return MeanDifference(mean, float(stats.t.ppf((1 + CONFIDENCE) / 2, len(values) - 1)) * spread)


def _learner(measured: SlideFeatures) -> Callable[[Array], NDArray[np.intp]]:
    """Return what a linear discriminant with a shrunk covariance makes of examples."""
    middle, scale = measured.values.mean(axis=0), np.maximum(measured.values.std(axis=0), 1e-9)
    learner = LinearDiscriminantAnalysis(solver='lsqr', shrinkage='auto')
    learner.fit((measured.values - middle) / scale, measured.codes)

    def predict(values: Array) -> NDArray[np.intp]:
        return np.asarray(learner.predict((values - middle) / scale))

    return predict


def _extracted(
    scene: Scene, surface: str, touch_protocol: TouchProtocol, count: int, who: tuple[Sequence[int], int]
) -> Array:
    """Return the features of slides over one surface, (count, n_features), by a finger with a seed."""
    seed, finger = who
    rng = np.random.default_rng([*seed, zlib.crc32(surface.encode())])
    fast, *others = SENSORS[scene.sensor].streams
    parts = []
    for turned_rad in touch_protocol.turned_rad:
        sliding = _sliding(touch_protocol, count, turned_rad)
        measured = simulate_slide_streams(scene, surface, count, sliding, rng, finger=finger, slow=touch_protocol.slow)
        parts.append(extract_features(measured[fast.topic], fast.rate_hz))
        for stream in others if touch_protocol.slow else ():
            parts += [measured[stream.topic].mean(axis=1), np.log10(measured[stream.topic].std(axis=1) + 1.0)]
    return np.concatenate(parts, axis=1)


def _sliding(touch_protocol: TouchProtocol, count: int, turned_rad: float) -> SimulatedSlide:
    """Return slides that meet all conditions in turn."""
    conditions = list(
        itertools.product(touch_protocol.speeds_m_s, touch_protocol.forces_n, touch_protocol.directions_rad)
    )
    rows = np.array([conditions[number % len(conditions)] for number in range(count)])
    return SimulatedSlide(
        rows[:, 0], rows[:, 1], touch_protocol.duration_s, rows[:, 2] + turned_rad, touch_protocol.radius_m
    )
