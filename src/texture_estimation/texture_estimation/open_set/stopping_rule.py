"""Early stopping of a slide by a rule fitted on held-out slides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array

Mask = NDArray[np.bool_]
# Rules tried: end at this confidence and novelty score, or after so much sliding whatever they are. Without a novelty
# detector the novelty score is 0. In windows that do not overlap.
CONFIDENCES = 1.0 - np.geomspace(0.5, 1e-4, 50)
MAX_WINDOWS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0)
NEVER = 1e6
# Smaller ones make later slides of a session, which drift, wait for long (trained on slides 1-20, tested on 21-30).
NOVELTY_SCORES = (NEVER, 9.0, 6.0)
# The limit for the start of a slide grows by this factor with each effective window: a limit that ends at one moment
# lets many slides end right after it. Chosen among 3, 4, 5, 6 and 8 on slides 21-30, trained on 1-20.
EARLY_GROWTH = 6.0
MAX_EARLY_WINDOWS = 20.0  # beyond, the limit grows no more, so that it stays a number


@dataclass(frozen=True)
class StoppingRule:
    """Truncated sequential test: stop at a confidence threshold, or after a number of effective windows.

    Source: Wald 1945 for a decision at a threshold of the evidence; the end after some time, as with one window in a
    hundred that would go on for ever, is fitted with the threshold.

    Parameters
    ----------
    confidence
        Decision threshold on the probability of the best label.
    max_windows
        Effective window count at which a slide is stopped whatever the confidence.
    novelty_score
        Largest novelty score at which a slide is stopped.
    early_novelty_score
        Largest one after the first window, if it is smaller, and EARLY_GROWTH times as much after each further
        effective window: little evidence shows little of what is novel.

    Examples
    --------
    >>> rule = StoppingRule(confidence=0.95, max_windows=10.0)
    >>> rule.certain(0.9, 2.0), rule.certain(0.96, 2.0), rule.certain(0.5, 10.0)
    (False, True, True)
    """

    confidence: float = 0.95
    max_windows: float = NEVER
    novelty_score: float = NEVER
    early_novelty_score: float = NEVER

    def certain(self, confidence: float, effective_windows: float, novelty_score: float = 0.0) -> bool:
        """Return whether the slide may end.

        Parameters
        ----------
        confidence
            Probability of the best label, 0 to 1.
        effective_windows
            Effective window count so far.
        novelty_score
            Novelty score so far.

        Returns
        -------
        bool
        """
        growing = EARLY_GROWTH ** (min(effective_windows, MAX_EARLY_WINDOWS) - 1.0)
        limit = min(self.novelty_score, self.early_novelty_score * growing)
        confident = confidence >= self.confidence and novelty_score <= limit
        return confident or effective_windows >= self.max_windows


@dataclass(frozen=True, eq=False)
class SlideCourse:
    """What was said of one held-out slide after each window.

    Parameters
    ----------
    confidences : (n_windows,)
        Of the best label.
    right : (n_windows,)
        Whether it is the true one.
    effective_windows : (n_windows,)
        Length of the evidence.
    known : (n_windows,)
        Whether the surface was taken for known; all without a novelty detector.
    novelty_scores : (n_windows,)
        0 without a novelty detector.
    disturbance
        Kind of the disturbance; '' for none.

    Examples
    --------
    >>> right = np.array([False, True])
    >>> course = SlideCourse(np.array([0.6, 0.99]), right, np.array([1.0, 1.2]), np.array([True, True]), np.zeros(2))
    >>> fit_open_set_rule([course] * 30, wrong=0.02, wrong_disturbed=0.02).certain(0.99, 1.2)
    True
    """

    confidences: Array
    right: Mask
    effective_windows: Array
    known: Mask
    novelty_scores: Array
    disturbance: str = ''


def fit_stopping_rule(
    confidences: Sequence[Array], right: Sequence[Mask], effective_window_counts: Sequence[Array], wrong: float
) -> StoppingRule:
    """Return the rule with the shortest mean slide whose error rate is at most `wrong`.

    If no rule reaches the error rate, the one with the lowest error rate is returned.

    Parameters
    ----------
    confidences, right, effective_window_counts : of each slide (n_windows,)
        After each window: confidence of the best label, whether it is the true one, length of the evidence.
    wrong
        Share of the slides that may be decided wrongly.

    Returns
    -------
    StoppingRule
    """
    tried = [StoppingRule(confidence, longest) for confidence, longest in product(CONFIDENCES.tolist(), MAX_WINDOWS)]
    outcomes = _outcomes(tried, confidences, right, effective_window_counts)
    least = max(wrong, min(errors for errors, _ in outcomes))
    good = [(mean, number) for number, (errors, mean) in enumerate(outcomes) if errors <= least]
    return tried[min(good)[1]]


def fit_open_set_rule(
    courses: Sequence[SlideCourse], wrong: float, wrong_disturbed: float, early_novelty_score: float = NEVER
) -> StoppingRule:
    """Return the rule with the shortest mean undisturbed slide that rarely stops a slide with a wrong label.

    A slide is stopped only while its surface is taken for known. Errors under disturbances are counted over all kinds
    together: of each kind alone there are so few that the worst one would decide by chance. If no rule reaches the
    error rates, the one that exceeds them least is returned.

    Parameters
    ----------
    courses
        Of undisturbed slides and of disturbed copies.
    wrong
        Share of the undisturbed slides that may be stopped with a wrong label.
    wrong_disturbed
        The same of the disturbed copies.
    early_novelty_score
        Of the rule, as it is.

    Returns
    -------
    StoppingRule
    """
    table = _CourseTable(courses, early_novelty_score)
    best, rule = (np.inf, np.inf), StoppingRule()
    for confidence, novelty_score in product(CONFIDENCES.tolist(), NOVELTY_SCORES):
        errors, disturbed_errors, windows = table.outcome(confidence, novelty_score)
        excess = max(0.0, errors - wrong) + max(0.0, disturbed_errors - wrong_disturbed)
        if (excess, windows) < best:
            best, rule = (excess, windows), StoppingRule(confidence, NEVER, novelty_score, early_novelty_score)
    return rule


class _CourseTable:
    """Courses as arrays (n_slides, n_windows), the shorter ones filled with what never stops a slide."""

    def __init__(self, courses: Sequence[SlideCourse], early_novelty_score: float) -> None:
        self._novelty = _filled([course.novelty_scores for course in courses], np.inf)
        self._windows = _filled([course.effective_windows for course in courses], np.nan)
        known = _filled([course.known for course in courses], 0.0) > 0.0
        growing = EARLY_GROWTH ** (np.fmin(self._windows, MAX_EARLY_WINDOWS) - 1.0)
        known &= self._novelty <= early_novelty_score * growing
        self._confidences = np.where(known, _filled([course.confidences for course in courses], -1.0), -1.0)
        self._wrong = _filled([~course.right for course in courses], 0.0) > 0.0
        self._whole = np.array([course.effective_windows[-1] for course in courses])
        self._undisturbed = np.array([not course.disturbance for course in courses])

    def outcome(self, confidence: float, novelty_score: float) -> tuple[float, float, float]:
        """Return the share of slides stopped with a wrong label, undisturbed and disturbed, and the mean evidence.

        The evidence is that of undisturbed slides, in effective windows; without disturbed ones, none of them is wrong.
        """
        stops = (self._confidences >= confidence) & (self._novelty <= novelty_score)
        places, stopped = stops.argmax(axis=1), stops.any(axis=1)
        rows = np.arange(len(places))
        wrong = stopped & self._wrong[rows, places]
        taken = np.where(stopped, self._windows[rows, places], self._whole)
        undisturbed = self._undisturbed
        disturbed = wrong[~undisturbed]
        disturbed_errors = float(disturbed.mean()) if len(disturbed) else 0.0
        return float(wrong[undisturbed].mean()), disturbed_errors, float(taken[undisturbed].mean())


def _outcomes(
    rules: Sequence[StoppingRule],
    confidences: Sequence[Array],
    right: Sequence[Mask],
    effective_window_counts: Sequence[Array],
) -> list[tuple[float, float]]:
    """Return of each rule the share of wrong decisions, and the mean length of the evidence they took."""
    windows, confident = _filled(effective_window_counts, -np.inf), _filled(confidences, -np.inf)
    wrong = _filled([~correct for correct in right], 0.0) > 0.0
    rows, last = np.arange(len(right)), np.array([len(correct) - 1 for correct in right])

    def outcome(rule: StoppingRule) -> tuple[float, float]:
        over = (confident >= rule.confidence) | (windows >= rule.max_windows)
        places = np.where(over.any(axis=1), over.argmax(axis=1), last)
        return float(wrong[rows, places].mean()), float(windows[rows, places].mean())

    return [outcome(rule) for rule in rules]


def _filled(rows: Sequence[Array | Mask], value: float) -> Array:
    """Return the rows as an array (n_rows, longest), the shorter ones filled with a value."""
    table = np.full((len(rows), max(len(row) for row in rows)), value)
    for number, row in enumerate(rows):
        table[number, : len(row)] = row
    return table
