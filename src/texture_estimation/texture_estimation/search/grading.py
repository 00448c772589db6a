"""Searches for recipes that grade roughness."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_estimation.roughness.checks import LEVEL, SKID
from texture_estimation.roughness.grades import Grades
from texture_estimation.roughness.head import GRADES
from texture_estimation.roughness.recipe import RoughnessRecipe
from texture_estimation.search.cost import operations
from texture_estimation.search.examples import Examples
from texture_estimation.search.grade_trial import GradeTrial
from texture_estimation.search.halves import Mask
from texture_estimation.search.judges.catalogue import grade_judge_of
from texture_features.feature_set import FeatureSet


@dataclass(frozen=True)
class Grading:
    """What is counted is how near the grades come; see `texture_estimation.search.task.Task`.

    Parameters
    ----------
    grades
        Of each surface, by people.
    """

    grades: Grades

    def described(self, recipe: RoughnessRecipe) -> FeatureSet:
        """Return the features that a head sees, not those of the checks, with the windows that it learns from."""
        inputs = tuple(
            dataclasses.replace(
                item, features=tuple((name, feature) for name, feature in item.features if name not in (SKID, LEVEL))
            )
            for item in recipe.feature_set.inputs
        )
        kept = tuple(item for item in inputs if item.features)
        return dataclasses.replace(recipe.feature_set, inputs=kept, windows=recipe.training_windows, _layouts={})

    def trial(
        self, recipe: RoughnessRecipe, values: Array, examples: Examples, halves: Mask, *, quick: bool
    ) -> GradeTrial:
        """Return the trial of a recipe."""
        table = np.array([self.grades.of(name) for name in examples.names])
        return GradeTrial(
            grade_judge_of(recipe.head_name, quick=quick),
            recipe.head,
            values,
            table[examples.codes],
            examples.codes,
            halves,
        )

    def cost(self, recipe: RoughnessRecipe, n_samples: int, n_values: int, examples: Examples) -> float:
        """Return about how many operations a window costs, half the examples being learnt."""
        features = [feature for item in self.described(recipe).inputs for _, feature in item.features]
        return operations(
            features,
            recipe.head,
            n_samples=n_samples,
            n_values=n_values,
            n_labels=len(GRADES),
            n_learnt=len(examples.codes) // 2,
        )
