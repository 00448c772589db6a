"""Novelty detection: how rare a slide is among those of the class for which it is taken."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_estimation.learners.learner import Codes
from texture_estimation.open_set.class_distance import ClassDistance

# Lengths of evidence at which tails and thresholds are fitted, in windows that do not overlap. The start of a slide is
# like no other part, so slides are compared by the same stretch: by all that was measured, up to the last of these.
EFFECTIVE_WINDOWS = (1.0, 1.5, 2.0, 3.0, 5.0)
# Spaces in which a slide is compared with the slides of its class, and the length of its start that is compared. The
# first windows of slides are compared by themselves, as this shows soonest that something differs.
FEATURES, HIDDEN, ONSET = 'features', 'hidden', 'onset'
SPACES: Mapping[str, float] = {FEATURES: EFFECTIVE_WINDOWS[-1], HIDDEN: EFFECTIVE_WINDOWS[-1], ONSET: 1.5}
# Negative log-odds of the best to the second label, and the negative fraction of the windows that agree with the best.
LOG_ODDS, AGREEMENT = 'log_odds', 'agreement'
OTHER_SCORES = (LOG_ODDS, AGREEMENT)
SCORES = (*SPACES, *OTHER_SCORES)
TAIL_QUANTILE = 0.9
MIN_SPREAD = 1e-6  # of a score, relative to its median: slides that are all the same
LEAST_AGREEMENT_SPREAD = 0.1  # in most slides all windows may agree, which makes one that does not no novelty
UNCOUNTED_SPREAD = 1e30  # of a score that is left out: its tail is zero


@dataclass(frozen=True, eq=False)
class NoveltyDetector:
    """Sum of the one-sided tails of several scores, and the threshold above which the surface is unknown.

    Each score is compared with those of training slides when they were held out and labelled rightly: what exceeds the
    median counts in units of the distance from the median to the 90 % quantile, which is the negative logarithm of an
    exponential tail but for a factor; what lies below counts nothing, so no score makes up for another. The thresholds
    are those of split conformal prediction.

    Source: Fisher 1932 for the sum of logarithms of tail probabilities; Vovk, Gammerman & Shafer 2005 for thresholds.

    Parameters
    ----------
    distances
        By space, in the order of the scores: mean features, mean outputs of the hidden layer if the classifier has one,
        mean features of the onset.
    medians, spreads : (n_levels, n_scores)
        Of the scores of held-out slides, by the effective window count.
    thresholds, distance_thresholds : (n_levels,)
        Largest novelty score of known surfaces at the false rejection rate: of all scores, and of the distances alone.
    distances_only
        Whether the distances alone count: the other scores of an incremental classifier are of another size.

    Examples
    --------
    >>> held_out = [np.random.default_rng(0).standard_normal((99, 3))] * len(EFFECTIVE_WINDOWS)
    >>> detector = NoveltyDetector.fit({}, held_out, false_rejection_rate=0.1)
    >>> scores = [detector.novelty_score(row.tolist(), 1.0) for row in held_out[0]]
    >>> sum(score > detector.threshold(1.0) for score in scores) <= 10  # of 99
    True
    """

    distances: Mapping[str, ClassDistance]
    medians: Array
    spreads: Array
    thresholds: Array
    distance_thresholds: Array
    distances_only: bool = False

    @classmethod
    def fit(
        cls,
        distances: Mapping[str, ClassDistance],
        held_out: Sequence[Array],
        false_rejection_rate: float,
        counted: Collection[str] = SCORES,
    ) -> NoveltyDetector:
        """Fit tails and thresholds.

        Parameters
        ----------
        distances
            Fitted to all slides.
        held_out : of each of EFFECTIVE_WINDOWS (n_slides, n_scores)
            Scores of slides when they were held out and labelled rightly.
        false_rejection_rate
            Fraction of the slides over known surfaces that may be taken for unknown: of new slides like those held out,
            no more are, on average. With too few slides for the fraction, none of those held out is.
        counted
            Which of OTHER_SCORES count; of the spaces, those in `distances` do.

        Returns
        -------
        NoveltyDetector
            With a threshold for each effective window count.
        """
        medians = np.stack([np.median(scores, axis=0) for scores in held_out])
        spreads = np.stack([np.quantile(scores, TAIL_QUANTILE, axis=0) for scores in held_out]) - medians
        spreads = np.maximum(spreads, MIN_SPREAD * (1.0 + np.abs(medians)))
        if spreads.shape[1] == len(distances) + len(OTHER_SCORES):
            spreads[:, -1] = np.maximum(spreads[:, -1], LEAST_AGREEMENT_SPREAD)
            spreads[:, len(distances) :][:, [name not in counted for name in OTHER_SCORES]] = UNCOUNTED_SPREAD
        tails = [
            np.maximum(scores - median, 0.0) / spread
            for scores, median, spread in zip(held_out, medians, spreads, strict=True)
        ]
        thresholds, distance_thresholds = (
            np.array([_conformal(tail[:, :count].sum(axis=1), false_rejection_rate) for tail in tails])
            for count in (None, len(distances))
        )
        return cls(distances, medians, spreads, thresholds, distance_thresholds)

    @cached_property
    def _levels(self) -> list[tuple[float, ...]]:
        """By level, one number after the other: threshold, then medians, then spreads of the scores that count."""
        count = len(self.distances) if self.distances_only else self.medians.shape[1]
        thresholds = self.distance_thresholds if self.distances_only else self.thresholds
        table = np.column_stack([thresholds, self.medians[:, :count], self.spreads[:, :count]])
        return [tuple(row) for row in table.tolist()]

    def novelty_score(self, scores: Sequence[float], effective_windows: float) -> float:
        """Return the novelty score from the scores of a slide after this effective window count."""
        return self.score_and_threshold(scores, effective_windows)[0]

    def threshold(self, effective_windows: float) -> float:
        """Return the largest novelty score of a known surface after this effective window count."""
        return self._row(effective_windows)[0]

    def score_and_threshold(self, scores: Sequence[float], effective_windows: float) -> tuple[float, float]:
        """Return the novelty score, and the largest one of a known surface.

        Parameters
        ----------
        scores
            Of a slide, as `SlideNovelty.scores` returns them.
        effective_windows
            Effective window count of the slide.

        Returns
        -------
        float
            Sum of the tails.
        float
            Threshold.
        """
        row = self._row(effective_windows)
        count = len(row) // 2
        tails = zip(scores, row[1 : 1 + count], row[1 + count :], strict=False)
        return sum((score - median) / spread for score, median, spread in tails if score > median), row[0]

    def _row(self, effective_windows: float) -> list[float]:
        """Return the row of `_levels`, linear between two levels."""
        after = bisect_right(EFFECTIVE_WINDOWS, effective_windows)
        if after == 0 or after == len(EFFECTIVE_WINDOWS):
            return list(self._levels[max(after - 1, 0)])
        low, high = EFFECTIVE_WINDOWS[after - 1], EFFECTIVE_WINDOWS[after]
        share = (effective_windows - low) / (high - low)
        pairs = zip(self._levels[after - 1], self._levels[after], strict=True)
        return [first + share * (second - first) for first, second in pairs]

    def with_slides(self, slides: Sequence[Mapping[str, Array]], classes: Codes) -> NoveltyDetector:
        """Return the detector of an incremental classifier, with added slides.

        Parameters
        ----------
        slides
            Mean of each slide by space, as `space_means` returns it.
        classes : (n_slides,)
            Number of the label of each.
        """
        distances = {
            space: distance.with_slides(np.stack([means[space] for means in slides]), classes)
            for space, distance in self.distances.items()
        }
        return replace(self, distances=distances, distances_only=True)

    def as_arrays(self) -> dict[str, AnyArray]:
        """Return the arrays for the model file.

        Returns
        -------
        dict
            Name of each field, and its array.
        """
        numbers = {name: getattr(self, name) for name in ('medians', 'spreads', 'thresholds', 'distance_thresholds')}
        spaces = {
            f'{space}/{name}': array
            for space, distance in self.distances.items()
            for name, array in distance.as_arrays().items()
        }
        return {**numbers, **spaces}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> NoveltyDetector:
        """Return what `as_arrays` gave."""
        distances = {
            space: ClassDistance.from_arrays(
                {
                    name.removeprefix(f'{space}/'): array
                    for name, array in arrays.items()
                    if name.startswith(f'{space}/')
                }
            )
            for space in SPACES
            if f'{space}/projection' in arrays
        }
        medians, spreads, thresholds, distance_thresholds = (
            np.asarray(arrays[name], dtype=np.float64)
            for name in ('medians', 'spreads', 'thresholds', 'distance_thresholds')
        )
        return cls(distances, medians, spreads, thresholds, distance_thresholds)


class SlideNovelty:
    """Accumulate what the scores of one slide depend on, window by window.

    Parameters
    ----------
    distances
        By space, as in `NoveltyDetector`.
    n_labels
        Number of labels of the classifier.

    Examples
    --------
    >>> classes = np.repeat([0, 1], 10)
    >>> means = 5.0 * classes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((20, 2))
    >>> distances = {'features': ClassDistance.fit(means, classes)}
    >>> novelty = SlideNovelty(distances, n_labels=2)
    >>> novelty.add(np.array([5.0, 5.0]), None, label=1, effective_windows=1.0)
    >>> own, other = novelty.scores(1, log_odds=1.0), novelty.scores(0, log_odds=1.0)
    >>> len(own) == len(other)
    True
    """

    def __init__(self, distances: Mapping[str, ClassDistance], n_labels: int) -> None:
        self._distances = distances
        self._sums: dict[str, Array] = {}
        self._counts = dict.fromkeys(distances, 0)
        self._votes = [0] * n_labels
        self._windows = 0
        # Sums stop changing after a few windows, that of the onset first, and the label rarely changes.
        self._found: dict[str, dict[int, float]] = {space: {} for space in distances}

    def add(self, values: Array, hidden: Array | None, label: int, effective_windows: float) -> None:
        """Add a window.

        Parameters
        ----------
        values : (n_features,)
        hidden : (n_hidden,) or None
            Outputs of the hidden layer.
        label
            Number of the best label of this window alone.
        effective_windows
            Effective window count including this window.
        """
        self._windows += 1
        self._votes[label] += 1
        if effective_windows > EFFECTIVE_WINDOWS[-1] + 1e-9 and self._sums:
            return
        for space in self._distances:
            if effective_windows > SPACES[space] + 1e-9 and self._counts[space]:
                continue
            own = hidden if space == HIDDEN and hidden is not None else values
            self._sums[space] = self._sums[space] + own if self._counts[space] else own
            self._counts[space] += 1
            self._found[space].clear()

    def scores(self, label: int, log_odds: float) -> list[float]:
        """Return the scores for a label: distances, then `OTHER_SCORES`; larger ones are rarer.

        Parameters
        ----------
        label
            Number of the best label of the slide.
        log_odds
            Mean evidence of it less that of the second best label.
        """
        distances = [self._distance(space, label) for space in self._distances]
        return [*distances, -log_odds, -self._votes[label] / self._windows]

    def _distance(self, space: str, label: int) -> float:
        found = self._found[space]
        if label not in found:
            found[label] = self._distances[space].score(self._sums[space] / self._counts[space], label)
        return found[label]


def space_means(values: Array, hidden: Array | None, overlap: float) -> dict[str, Array]:
    """Return the mean of the windows of a slide in each space.

    Parameters
    ----------
    values : (n_windows, n_features)
        In temporal order.
    hidden : (n_windows, n_hidden) or None
        Outputs of the hidden layer.
    overlap
        Distance of two windows over their length, at most 1.

    Returns
    -------
    dict
        Mean vector of each space, by its name.
    """
    by_space = {FEATURES: values, HIDDEN: hidden, ONSET: values}
    return {
        space: own[: window_count(SPACES[space], overlap)].mean(axis=0)
        for space, own in by_space.items()
        if own is not None
    }


def window_count(effective_windows: float, overlap: float) -> int:
    """Return how many windows count as so many that do not overlap."""
    return 1 + round((effective_windows - 1.0) / overlap)


def _conformal(novelty_scores: Array, false_rejection_rate: float) -> float:
    rank = max(1, int((len(novelty_scores) + 1) * false_rejection_rate))
    return float(np.sort(novelty_scores)[-rank])
