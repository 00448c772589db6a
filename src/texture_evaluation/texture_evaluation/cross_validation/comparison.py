"""Compare two recipes on the same test slides: an exact test, and the difference with an interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import binomtest

from texture_core.arrays import Array
from texture_core.errors import InvalidData
from texture_evaluation.cross_validation.accuracy_figures import CONFIDENCE, RESAMPLES, slide_counts, window_counts
from texture_evaluation.cross_validation.cross_validation import CrossValidation


@dataclass(frozen=True)
class PairedComparison:
    """Two recipes on the same test slides.

    Parameters
    ----------
    first, second
        Names of the recipes.
    n_slides
        Number of slides that both were tested on.
    only_first, only_second
        Number of slides that the one alone recognises. A slide that is tested in several folds is recognised if it is
        in more than half of them.
    p_value
        Probability of at least such a difference if both were equally good: exact McNemar test, two-sided.
    p_value_adjusted
        The same, adjusted for all comparisons that were made together (Holm).
    slide_difference, window_difference
        Second minus first share that is right.
    slide_interval, window_interval
        Their 95 % intervals by bootstrap over slides.
    """

    first: str
    second: str
    n_slides: int
    only_first: int
    only_second: int
    p_value: float
    p_value_adjusted: float
    slide_difference: float
    slide_interval: tuple[float, float]
    window_difference: float
    window_interval: tuple[float, float]

    def as_json(self) -> dict[str, Any]:
        """Return the figures."""
        return dict(vars(self))


def compare(first: CrossValidation, second: CrossValidation) -> PairedComparison:
    """Compare two recipes that were cross-validated on the same splits.

    Parameters
    ----------
    first, second
        Results of `cross_validate` with the same data set and splitter.

    Returns
    -------
    PairedComparison
        Positive differences mean that the second is better.

    Raises
    ------
    InvalidData
        If no slide was tested by both.

    Notes
    -----
    Sources: McNemar 1947, the exact form by the binomial distribution; Efron & Tibshirani 1993, chapter 13.
    """
    slides = sorted(_tested(first) & _tested(second))
    if not slides:
        raise InvalidData(f"no slide was tested by '{first.recipe}' and by '{second.recipe}'; use the same split")
    right, windows = (
        np.stack([_counts(result, slides, of_windows=of_windows) for result in (first, second)])
        for of_windows in (False, True)
    )
    recognised = right[..., 0] > 0.5 * right[..., 1]
    only_first, only_second = (int((recognised[a] & ~recognised[b]).sum()) for a, b in ((0, 1), (1, 0)))
    p_value = mcnemar(only_first, only_second)
    slide_difference, slide_interval = _difference(right)
    window_difference, window_interval = _difference(windows)
    return PairedComparison(
        first.recipe, second.recipe, len(slides), only_first, only_second, p_value, p_value,
        slide_difference, slide_interval, window_difference, window_interval,
    )  # fmt: skip


def compare_all(results: Sequence[CrossValidation]) -> list[PairedComparison]:
    """Compare each recipe with the first, the p values adjusted for their number.

    Returns
    -------
    list of PairedComparison
        In the order of the recipes.

    Notes
    -----
    Source: Holm 1979, "A simple sequentially rejective multiple test procedure".
    """
    compared = [compare(results[0], other) for other in results[1:]]
    order = np.argsort([one.p_value for one in compared], kind='stable')
    adjusted, least = [1.0] * len(compared), 0.0
    for rank, index in enumerate(order.tolist()):
        least = max(least, min(1.0, (len(compared) - rank) * compared[index].p_value))
        adjusted[index] = least
    return [replace(one, p_value_adjusted=p_value) for one, p_value in zip(compared, adjusted, strict=True)]


def mcnemar(only_first: int, only_second: int) -> float:
    """Return the exact two-sided p value of the McNemar test, 1 if the two never differ.

    Parameters
    ----------
    only_first, only_second
        Number of cases that the one alone gets right.

    Examples
    --------
    >>> round(mcnemar(1, 7), 4)
    0.0703
    """
    differing = only_first + only_second
    return float(binomtest(only_first, differing).pvalue) if differing else 1.0


def _tested(result: CrossValidation) -> set[str]:
    return {name for fold in result.folds for name in fold.results}


def _counts(result: CrossValidation, slides: Sequence[str], *, of_windows: bool) -> Array:
    """Return right and all answers of each slide over all folds, (n_slides, 2)."""
    place = {name: row for row, name in enumerate(slides)}
    counts = np.zeros((len(slides), 2))
    for fold in result.folds:
        kept = {name: one for name, one in fold.results.items() if name in place}
        if kept:
            own = (window_counts if of_windows else slide_counts)(list(kept.values()))
            counts[[place[name] for name in kept]] += own
    return counts


def _difference(counts: Array) -> tuple[float, tuple[float, float]]:
    """Return second minus first share, and its interval; `counts` is (2, n_slides, 2)."""
    shares = counts.sum(axis=1)
    rows = np.random.default_rng(0).integers(counts.shape[1], size=(RESAMPLES, counts.shape[1]))
    sums = counts[:, rows].sum(axis=2)
    drawn = sums[..., 0] / sums[..., 1]
    low, high = np.quantile(drawn[1] - drawn[0], [(1.0 - CONFIDENCE) / 2, (1.0 + CONFIDENCE) / 2])
    return float(shares[1, 0] / shares[1, 1] - shares[0, 0] / shares[0, 1]), (float(low), float(high))
