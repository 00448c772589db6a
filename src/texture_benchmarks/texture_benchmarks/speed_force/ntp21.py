"""Textures under a taxel array at speeds and forces that were not in the training set.

Each texture lies in one place and every slide begins there: a whole slide shows the same stretch each time. What is
recognised there is this stretch of the texture; single windows start anywhere on it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from texture_benchmarks.speed_force.conditions import extracted, slide_trial, speed_mm_s
from texture_benchmarks.speed_force.held_out import (
    EvaluateSplit,
    HeldOutResult,
    Mask,
    one_out,
    recognised,
    run,
    run_chosen,
)
from texture_core.arrays import AnyArray, Array
from texture_estimation.learners.learner import Learner
from texture_estimation.learners.svm_rbf import SvmRbf
from texture_estimation.recipe import load_recipe
from texture_features.array_speed import ArraySpeedEstimator
from texture_features.feature import Feature, WindowBatch
from texture_features.features.centred_log_ratio import CentredLogRatio
from texture_features.features.mean_spatial_bands import MeanSpatialBands
from texture_features.features.spatial_bands import SpatialBands
from texture_recordings.slide_dataset import SlideDataset
from texture_recordings.slide_samples import SlideSamples

SLOW_MM_S = 60.0  # "slow" is trained, faster is tested
CANDIDATES = tuple((bands, floor) for bands in (16, 32, 64) for floor in (1e-7, 1e-9))
SPEEDS_M_S: Array = np.geomspace(0.005, 0.5, 300, dtype=np.float64)  # among which the array looks for its own
SPANNED, MISTAKES = 0.95, 9  # how much of the error of the array's speed is trained, in how many steps
RECIPE = 'any-speed'
# A window of 0.6 s does not quite fit into a slide of 0.6 s: it starts with its first sample and ends with its last.
WINDOW_S, HOP_S = 0.59, 0.1
TRAINED_HOP_M = 3e-3
# Of windows trained as if their speed had been mistaken: there are many of them.
TRAINED_BANDS, WINDOW_MISTAKES, FAR_HOP_M = 32, 5, 12e-3


@dataclass(frozen=True, eq=False)
class Ntp21:
    """The protocols on one set of slides.

    Parameters
    ----------
    dataset
        The slides.
    learner
        What learns.
    candidates
        Number of bands and floor, of which the training chooses; without floors for windows.
    """

    dataset: SlideDataset
    learner: Learner = field(default_factory=SvmRbf)
    candidates: Sequence[tuple[int, float]] = CANDIDATES

    @cached_property
    def samples(self) -> list[SlideSamples]:
        """Samples of each slide."""
        return self.dataset.samples('signal')

    def splits(self) -> dict[str, dict[str, tuple[Mask, Mask]]]:
        """Return train and test slides by protocol and by what is left out.

        Returns
        -------
        dict
            Protocol → what is left out → train and test slides, (n_slides,) bool each.
        """
        speed, force = speed_mm_s(self.dataset), self.dataset.condition('force')
        slow = speed <= SLOW_MM_S
        return {
            'one speed out': one_out(speed),
            'one force out': one_out(force),
            'slow to fast': {f'over {SLOW_MM_S:g}': (slow, ~slow)},
        }

    def whole(self) -> dict[str, HeldOutResult]:
        """Return how whole slides are recognised from the mean over the taxels, with the bands chosen in training."""
        windows = [slide.windows() for slide in self.samples]
        trials = {
            f'{bands} bands, floor {floor:g}': self._trial([MeanSpatialBands(bands=bands, floor=floor)], windows)
            for bands, floor in self.candidates
        }
        inner = {'one force out': [self.dataset.condition('force')]}
        return {
            name: run_chosen(trials, parts, inner.get(name, [speed_mm_s(self.dataset)]))
            for name, parts in self.splits().items()
        }

    def whole_with(self, features: Sequence[Feature]) -> dict[str, HeldOutResult]:
        """Return how whole slides are recognised by features as they are."""
        trial = self._trial(features, [slide.windows() for slide in self.samples])
        return {name: run(trial, parts) for name, parts in self.splits().items()}

    def whole_with_pattern(self) -> dict[str, HeldOutResult]:
        """Return the same if each taxel counts by itself: the pattern knows how a texture was mounted."""
        return self.whole_with([SpatialBands(), CentredLogRatio()])

    def whole_over_time(self) -> dict[str, HeldOutResult]:
        """Return the same by bands of frequency instead of waves per metre: all slides as if at one speed."""
        slides = self.samples
        middle_m_s = float(np.sqrt(SPEEDS_M_S[0] * SPEEDS_M_S[-1]))
        trial = self._trial([MeanSpatialBands()], [slide.windows(speed_m_s=middle_m_s) for slide in slides])
        return {name: run(trial, parts) for name, parts in self.splits().items()}

    def whole_without_speed(self) -> tuple[dict[str, HeldOutResult], dict[str, Any]]:
        """Return the same if the speed of the tested slides is estimated by the array, and how well that is done.

        Speeds are known in the training. Each slide there is trained at its speed and as if the array had mistaken it,
        by up to the error that 95 % of the training slides stay below.
        """
        errors: list[Array] = []

        def trial(train: Mask, test: Mask) -> Mask:
            known = np.array([slide.speed_m_s for slide in self.samples])
            array = self._array(train)
            estimated = np.array([array(slide.samples, slide.rate_hz, SPEEDS_M_S) for slide in self.samples])
            wrong = np.abs(np.log(estimated / known))
            errors.append(np.expm1(wrong[test]))
            most = float(np.quantile(wrong[train], SPANNED))
            trained = [self._extracted_at(known * factor) for factor in np.exp(np.linspace(-most, most, MISTAKES))]
            names, surfaces = (np.tile(of[train], MISTAKES) for of in (self.dataset.names, self.dataset.labels))
            return recognised(
                self.learner,
                (np.concatenate([values[train] for values in trained]), surfaces, names),
                (self._extracted_at(estimated)[test], self.dataset.labels[test]),
            )

        outcomes = {name: run(trial, parts) for name, parts in self.splits().items()}
        share = np.concatenate(errors)
        return outcomes, {
            'median_error': round(float(np.median(share)), 4),
            'share_within_10_percent': round(float((share < 0.1).mean()), 4),
        }

    def windows(self, trained: str = 'same distance') -> HeldOutResult:
        """Return how single windows are recognised by the recipe any-speed, one speed left out.

        The number of its bands is chosen in the training, where another speed is left out in turn.

        Parameters
        ----------
        trained
            'same distance': a model for the tested speed, trained windows of the distance that is slid at it in 0.59 s;
            'all distances': one model, trained windows of the distances of all speeds; 'same time': windows of 0.59 s.
        """
        speed = speed_mm_s(self.dataset)
        trials = {
            f'{bands} bands': self._window_trial(recipe_features(bands), trained)
            for bands in sorted({bands for bands, _ in self.candidates})
        }
        return run_chosen(trials, one_out(speed), [speed])

    def windows_without_speed(self) -> tuple[HeldOutResult, dict[str, float]]:
        """Return the same if the array measures the speed, until the end of each tested window, and its median error.

        One model, trained windows of the distances of all speeds as if the array had mistaken them, by up to the error
        that 95 % of the training slides stay below in the window in their middle.
        """
        speed, surfaces, names = speed_mm_s(self.dataset), self.dataset.labels, self.dataset.names
        features, slides, errors = recipe_features(TRAINED_BANDS), self.samples, {}
        distances = TRAINED['all distances'](np.unique(speed), 0.0)

        def trial(train: Mask, test: Mask) -> Mask:
            array = self._array(train)
            middle = [_measured(array, slides[number], middle=True) for number in np.flatnonzero(train)]
            most = float(np.quantile(np.abs(np.log(np.concatenate(middle))), SPANNED))
            factors = np.exp(np.linspace(-most, most, WINDOW_MISTAKES))
            trained = [(number, way) for number in np.flatnonzero(train) for way in distances]
            cuts = [_cut(slides[number], way, FAR_HOP_M) for number, way in trained]
            counts = [len(cut.samples) for cut in cuts]
            owners = np.tile(np.repeat([number for number, _ in trained], counts), WINDOW_MISTAKES)
            values = extracted(features, [_wrong(cut, factor) for factor in factors for cut in cuts])
            tested = [_cut(slides[number], None) for number in np.flatnonzero(test)]
            measured = [_measured(array, slides[number]) for number in np.flatnonzero(test)]
            errors[f'{speed[test][0]:g}'] = round(float(np.median(np.abs(np.concatenate(measured) - 1.0))), 4)
            asked = extracted(features, [_wrong(cut, ratio) for cut, ratio in zip(tested, measured, strict=True)])
            labels = np.repeat(surfaces[test], [len(cut.samples) for cut in tested])
            return recognised(self.learner, (values, surfaces[owners], names[owners]), (asked, labels))

        return run(trial, one_out(speed)), errors

    def _trial(self, features: Sequence[Feature], windows: Sequence[WindowBatch]) -> EvaluateSplit:
        return slide_trial(self.dataset, self.learner, extracted(features, windows))

    def _extracted_at(self, speeds_m_s: Array) -> Array:
        """Return mean spatial bands of all slides as if at these speeds, (n, n_bands)."""
        pairs = zip(self.samples, speeds_m_s, strict=True)
        return extracted([MeanSpatialBands()], [slide.windows(speed_m_s=float(speed)) for slide, speed in pairs])

    def _array(self, train: Mask) -> ArraySpeedEstimator:
        """Return the array with the positions of its taxels estimated in training."""
        slides = [slide for slide, use in zip(self.samples, train, strict=True) if use]
        return ArraySpeedEstimator.fit([(slide.samples, slide.rate_hz, slide.speed_m_s) for slide in slides])

    def _window_trial(self, features: Sequence[Feature], trained: str) -> EvaluateSplit:
        """Return what trains windows of some distances and tests windows of 0.59 s."""
        speed, surfaces, names = speed_mm_s(self.dataset), self.dataset.labels, self.dataset.names

        @cache
        def cut(distance_m: float | None) -> tuple[Array, AnyArray]:
            return self._cut(features, distance_m)

        def trial(train: Mask, test: Mask) -> Mask:
            distances = TRAINED[trained](np.unique(speed), float(speed[test][0]))
            parts = [_of(*cut(distance), train) for distance in distances]
            values, owners = (np.concatenate(part) for part in zip(*parts, strict=True))
            tested, tested_owners = _of(*cut(None), test)
            return recognised(
                self.learner, (values, surfaces[owners], names[owners]), (tested, surfaces[tested_owners])
            )

        return trial

    def _cut(self, features: Sequence[Feature], distance_m: float | None) -> tuple[Array, AnyArray]:
        """Return windows of all slides, described, (n, n_features), and the number of the slide of each, (n,)."""
        windows = [_cut(slide, distance_m) for slide in self.samples]
        owners = np.repeat(np.arange(len(windows)), [len(window.samples) for window in windows])
        return extracted(features, windows), owners


def recipe_features(bands: int) -> list[Feature]:
    """Return the features of the recipe any-speed, with so many bands."""
    features = [feature for item in load_recipe(RECIPE).feature_set.inputs for _, feature in item.features]
    return [replace(item, bands=bands) if isinstance(item, MeanSpatialBands) else item for item in features]


def _measured(array: ArraySpeedEstimator, slide: SlideSamples, *, middle: bool = False) -> Array:
    """Return the speed that the array has measured until the end of each window of 0.59 s, in that which the slide has.

    Of the window in the middle alone, if wanted.
    """
    windows = _cut(slide, None).samples
    ends = windows.shape[1] + round(HOP_S * slide.rate_hz) * np.arange(len(windows))
    asked = ends[len(ends) // 2 :][:1] if middle else ends
    ratio: Array = np.array([array(slide.samples[:end], slide.rate_hz, SPEEDS_M_S) for end in asked]) / slide.speed_m_s
    return ratio


def _wrong(windows: WindowBatch, ratio: Array | float) -> WindowBatch:
    """Return windows as if their speed were another."""
    return WindowBatch(windows.samples, windows.rate_hz, windows.speed_m_s * ratio, windows.force_n)


def _cut(slide: SlideSamples, distance_m: float | None, hop_m: float = TRAINED_HOP_M) -> WindowBatch:
    """Return windows of a distance, `hop_m` apart, or of 0.59 s, 0.1 s apart; the whole slide if it is shorter."""
    if distance_m is None:
        length_s, hop_s = WINDOW_S, HOP_S
    else:
        length_s, hop_s = distance_m / slide.speed_m_s, hop_m / slide.speed_m_s
    length = min(max(2, round(length_s * slide.rate_hz)), len(slide.samples))
    hop = max(1, round(hop_s * slide.rate_hz))
    samples = sliding_window_view(slide.samples, length, axis=0)[::hop].swapaxes(-1, -2)
    count = len(samples)
    return WindowBatch(samples, slide.rate_hz, np.full(count, slide.speed_m_s), np.full(count, slide.force_n))


def _of(values: Array, owners: AnyArray, use: Mask) -> tuple[Array, AnyArray]:
    """Return the windows of the slides in use."""
    return values[use[owners]], owners[use[owners]]


# Which distances (m) are trained, None for 0.59 s, given all speeds and the tested one (mm/s).
TRAINED: Mapping[str, Callable[[AnyArray, float], Sequence[float | None]]] = {
    'same distance': lambda speeds, tested: [tested / 1000.0 * WINDOW_S],
    'all distances': lambda speeds, tested: [speed / 1000.0 * WINDOW_S for speed in speeds],
    'same time': lambda speeds, tested: [None],
}
