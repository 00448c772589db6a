"""The outcome of a cross-validation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.plain_data import write_json
from texture_estimation.model import TextureModel
from texture_evaluation import metrics
from texture_evaluation.metrics import SlideResult

RESAMPLES, CONFIDENCE = 2000, 0.95  # of the bootstrap


@dataclass(frozen=True, eq=False)
class FoldResult:
    """What came out of one split.

    Parameters
    ----------
    name
        Number of the fold from 1, or the condition left out.
    trained_on
        Names of the training slides.
    results
        By the name of the test slide.
    model
        Trained on the training slides.
    train_s
        Processor time of the training, from features to the model, s.
    """

    name: str
    trained_on: tuple[str, ...]
    results: Mapping[str, SlideResult]
    model: TextureModel
    train_s: float


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Results of all folds, and pooled over them.

    Parameters
    ----------
    recipe
        Name of the recipe.
    labels
        All surfaces of the data set.
    folds
        In their order.
    unusable
        Names of test slides without a whole window, which count nowhere.
    """

    recipe: str
    labels: tuple[str, ...]
    folds: tuple[FoldResult, ...]
    unusable: tuple[str, ...] = ()

    @property
    def pooled(self) -> list[SlideResult]:
        """Results of all test slides of all folds."""
        return [result for fold in self.folds for result in fold.results.values()]

    def as_json(self) -> dict[str, Any]:
        """Return the pooled figures with 95 % intervals, those of each fold, and the label of each test slide."""
        return {
            'recipe': self.recipe,
            **figures(self.pooled),
            'window_accuracy_interval': interval(self.pooled, window_counts),
            'slide_accuracy_interval': interval(self.pooled, slide_counts),
            'labels': list(self.labels),
            'confusion': metrics.confusion(self.pooled, self.labels).tolist(),
            'folds': [
                {
                    'name': fold.name,
                    'trained_on': list(fold.trained_on),
                    **figures(list(fold.results.values())),
                    'slides': {name: result.estimates[-1].label for name, result in fold.results.items()},
                }
                for fold in self.folds
            ],
            'unusable': list(self.unusable),
        }

    def write(self, path: str | Path) -> None:
        """Write the figures as JSON; InvalidParameter if the file cannot be written."""
        write_json(self.as_json(), path)


def figures(results: Sequence[SlideResult]) -> dict[str, Any]:
    """Return the shares of windows and slides that are right, and how many slides there are; None without slides."""
    return {
        'n_slides': len(results),
        'n_windows': sum(len(result.window_labels) for result in results),
        'window_accuracy': metrics.window_accuracy(results) if results else None,
        'slide_accuracy': metrics.accuracy_at_end(results) if results else None,
        'accuracy_at_s': dict(metrics.accuracy_at_times(results)),
    }


def interval(results: Sequence[SlideResult], counts: Callable[[Sequence[SlideResult]], Array]) -> list[float]:
    """Return the 95 % interval of a share by bootstrap over slides: windows of a slide are not independent.

    Parameters
    ----------
    results
        Of the test slides.
    counts
        Gives right and all answers of each slide, (n_slides, 2).

    Source: Efron & Tibshirani 1993, chapter 13 (percentile interval).
    """
    pairs = counts(results)
    drawn = np.random.default_rng(0).integers(len(pairs), size=(RESAMPLES, len(pairs)))
    sums = pairs[drawn].sum(axis=1)
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
