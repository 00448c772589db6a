"""Searches for recipes that grade roughness."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_estimation.roughness.checks import LEVEL, STICK_SLIP
from texture_estimation.roughness.grades import Grades
from texture_estimation.roughness.regressor import GRADES
from texture_estimation.roughness.roughness_recipe import RoughnessRecipe
from texture_estimation.search.cost import operations
from texture_estimation.search.halves import Mask
from texture_estimation.search.labelled_windows import LabelledWindows
from texture_estimation.search.roughness_fitness import RoughnessFitness
from texture_estimation.search.surrogates.catalogue import regressor_surrogate_of
from texture_features.feature_set import FeatureSet


@dataclass(frozen=True)
class RoughnessTask:
    """What is counted is how near the grades come; see `texture_estimation.search.search_task.SearchTask`.

    Parameters
    ----------
    grades
        Of each surface, by people.

    Examples
    --------
    >>> task = RoughnessTask(Grades({'silk': 1.0, 'jute': 5.0}))
    >>> task.grades.of('jute')
    5.0
    """

    grades: Grades

    def feature_set_of(self, recipe: RoughnessRecipe) -> FeatureSet:
        """Return the features of the regressor, without those of the checks, with the training windows."""
        inputs = tuple(
            dataclasses.replace(
                item,
                features=tuple((name, feature) for name, feature in item.features if name not in (STICK_SLIP, LEVEL)),
            )
            for item in recipe.feature_set.inputs
        )
        kept = tuple(item for item in inputs if item.features)
        return dataclasses.replace(recipe.feature_set, inputs=kept, windows=recipe.training_windows, _layouts={})

    def fitness_function(
        self, recipe: RoughnessRecipe, values: Array, examples: LabelledWindows, halves: Mask, *, quick: bool
    ) -> RoughnessFitness:
        """Return the trial of a recipe."""
        table = np.array([self.grades.of(name) for name in examples.names])
        return RoughnessFitness(
            regressor_surrogate_of(recipe.regressor, quick=quick),
            recipe.regressor,
            values,
            table[examples.codes],
            examples.codes,
            halves,
        )

    def cost(self, recipe: RoughnessRecipe, n_samples: int, n_values: int, examples: LabelledWindows) -> float:
        """Return about how many operations a window costs, with half the examples for training."""
        features = [feature for item in self.feature_set_of(recipe).inputs for _, feature in item.features]
        return operations(
            features,
            recipe.regressor,
            n_samples=n_samples,
            n_values=n_values,
            n_labels=len(GRADES),
            n_training=len(examples.codes) // 2,
        )
