"""The outcome of a cross-validation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

from texture_estimation.model import TextureModel
from texture_evaluation import metrics
from texture_evaluation.cross_validation.accuracy_figures import figures
from texture_evaluation.metrics import SlideResult


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
        """Return the pooled figures, those of each fold, all with 95 % intervals, and the label of each test slide.

        `feature_set` is the fingerprint of the features, as in the card of a model, and `version` that of the suite.
        """
        return {
            'recipe': self.recipe,
            'feature_set': self.folds[0].model.feature_set,
            'version': version('texture_evaluation'),
            **figures(self.pooled),
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
