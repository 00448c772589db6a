"""Shares of windows and slides that are right, with 95 % intervals by bootstrap over slides; exact at 0 and 100 %."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_evaluation import metrics
from texture_evaluation.metrics import SlideResult

RESAMPLES, CONFIDENCE = 2000, 0.95  # of the bootstrap


def figures(results: Sequence[SlideResult]) -> dict[str, Any]:
    """Return the shares of windows and slides that are right, with 95 % intervals, and how many slides there are.

    Parameters
    ----------
    results
        Of the test slides.

    Returns
    -------
    dict
        A share is None where no slide is long enough, and so is its interval.
    """
    return {
        'n_slides': len(results),
        'n_windows': sum(len(result.window_labels) for result in results),
        'window_accuracy': metrics.window_accuracy(results) if results else None,
        'slide_accuracy': metrics.accuracy_at_end(results) if results else None,
        'accuracy_at_s': dict(metrics.accuracy_at_times(results)),
        'window_accuracy_interval': interval(window_counts(results)) if results else None,
        'slide_accuracy_interval': interval(slide_counts(results)) if results else None,
        'accuracy_at_s_interval': {f'{seconds:.1f}': _interval_at(results, seconds) for seconds in metrics.TIMES_S},
    }


def _interval_at(results: Sequence[SlideResult], seconds: float) -> list[float] | None:
    """Return the interval of `metrics.accuracy_at`, over the slides that are long enough; None without any."""
    ends = [(result.surface, result.after(seconds)) for result in results]
    right = [(end.label == surface, 1) for surface, end in ends if end is not None]
    return interval(np.array(right, dtype=np.float64)) if right else None


def interval(counts: Array) -> list[float]:
    """Return the 95 % interval of a share by bootstrap over slides: windows of a slide are not independent.

    Where all answers or none are right, every resample is the same: the interval is then the exact one-sided bound on
    the share of slides, about 3/n wide.

    Parameters
    ----------
    counts : (n_slides, 2)
        Number of right answers and of all answers of each slide, see `window_counts` and `slide_counts`.

    Sources: Efron & Tibshirani 1993, chapter 13 (percentile interval); Clopper & Pearson 1934, at 0 and n of n.
    """
    right, answers = counts.sum(axis=0)
    if right in (0.0, answers):
        edge = float((1.0 - CONFIDENCE) ** (1.0 / np.count_nonzero(counts[:, 1])))
        return [edge, 1.0] if right else [0.0, 1.0 - edge]
    drawn = np.random.default_rng(0).integers(len(counts), size=(RESAMPLES, len(counts)))
    sums = counts[drawn].sum(axis=1)
    edges = np.quantile(sums[:, 0] / sums[:, 1], [(1.0 - CONFIDENCE) / 2, (1.0 + CONFIDENCE) / 2])
    return [float(edge) for edge in edges]


def window_counts(results: Sequence[SlideResult]) -> Array:
    """Return right and all windows of each slide, (n_slides, 2).

    Returns
    -------
    (n_slides, 2)
        Whole numbers.
    """
    counts = [(sum(label == one.surface for label in one.window_labels), len(one.window_labels)) for one in results]
    return np.array(counts, dtype=np.float64)


def slide_counts(results: Sequence[SlideResult]) -> Array:
    """Return whether each slide is right, and 1, (n_slides, 2).

    Returns
    -------
    (n_slides, 2)
        0 or 1, and 1.
    """
    return np.array([(one.estimates[-1].label == one.surface, 1) for one in results], dtype=np.float64)
