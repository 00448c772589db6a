"""Searches for recipes that distinguish surfaces."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from texture_core.arrays import Array
from texture_estimation.recipe import Recipe
from texture_estimation.search.classification_fitness import ClassificationFitness
from texture_estimation.search.cost import operations
from texture_estimation.search.halves import Mask
from texture_estimation.search.labelled_windows import LabelledWindows
from texture_estimation.search.surrogates.catalogue import surrogate_of
from texture_features.feature_set import FeatureSet


@dataclass(frozen=True)
class ClassificationTask:
    """What is counted is right decisions; see `texture_estimation.search.search_task.SearchTask`.

    Examples
    --------
    >>> from texture_estimation.recipe import Recipe
    >>> recipe = Recipe.from_mapping({'inputs': {'signal': {'features': ['mean']}}}, 'mine')
    >>> ClassificationTask().feature_set_of(recipe).topics
    ('signal',)
    """

    def feature_set_of(self, recipe: Recipe) -> FeatureSet:
        """Return the feature set with the windows that `train` is trained on."""
        return dataclasses.replace(recipe.feature_set, windows=recipe.training_windows, _layouts={})

    def fitness_function(
        self, recipe: Recipe, values: Array, examples: LabelledWindows, halves: Mask, *, quick: bool
    ) -> ClassificationFitness:
        """Return the trial of a recipe."""
        windows = recipe.training_windows
        return ClassificationFitness(
            surrogate=surrogate_of(recipe.learner, quick=quick),
            learner=recipe.learner,
            rule=recipe.evidence,
            values=values,
            codes=examples.codes,
            slides=examples.slides,
            halves=halves,
            hop_share=windows.hop_s / windows.length_s,
        )

    def cost(self, recipe: Recipe, n_samples: int, n_values: int, examples: LabelledWindows) -> float:
        """Return about how many operations a window costs, with half the examples for training."""
        features = [feature for item in recipe.feature_set.inputs for _, feature in item.features]
        return operations(
            features,
            recipe.learner,
            n_samples=n_samples,
            n_values=n_values,
            n_labels=len(examples.names),
            n_training=len(examples.codes) // 2,
        )
