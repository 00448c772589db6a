"""Fitness of a roughness recipe on half splits of extracted windows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.roughness.regressor import ROUGH, SMOOTH, RoughnessRegressor
from texture_estimation.search.halves import Mask
from texture_estimation.search.racing import HalfScorer
from texture_estimation.search.surrogates.regressor_surrogate import RegressorSurrogate

WORST = ROUGH - SMOOTH


@dataclass(frozen=True, eq=False)
class RoughnessFitness:
    """Evaluation of one recipe; see `texture_estimation.search.racing.FitnessFunction`.

    The score is 1 for the grade that people gave, and falls by a quarter for each grade off; 0 where there is no grade.
    So it is 1 - (mean absolute error) / 4. The paper says that its search takes "the results of learning and testing",
    which it tells as errors, and does not say what a missing grade counts.

    Parameters
    ----------
    surrogate
        The head, or what stands for it.
    regressor
        As the recipe has it.
    values : (n, n_features)
    grades, textures : (n,)
        Grade by people, and number of the texture.
    halves : (n_halves, n)

    Examples
    --------
    >>> from texture_estimation.roughness.gaussian_process import GaussianProcess
    >>> from texture_estimation.search.surrogates.exact_regressor import exact_grades
    >>> textures = np.repeat(np.arange(4), 4)
    >>> grades = 1.0 + textures
    >>> values = grades[:, None] + 0.01 * np.random.default_rng(0).standard_normal((16, 1))
    >>> halves = (np.arange(16) % 2 == 0)[None]
    >>> fitness = RoughnessFitness(exact_grades, GaussianProcess(), values, grades, textures, halves)
    >>> min(fitness.start()(0)) > 0.9
    True
    """

    surrogate: RegressorSurrogate
    regressor: RoughnessRegressor
    values: Array
    grades: Array
    textures: Codes
    halves: Mask

    def start(self) -> HalfScorer:
        """Return what gives the scores of training and other windows of a half."""
        graded = self.surrogate(self.regressor, self.values, self.grades, self.textures)

        def half(number: int) -> tuple[float, float]:
            training = self.halves[number]
            scores = nearness(graded(training), self.grades)
            return float(scores[training].mean()), float(scores[~training].mean())

        return half


def nearness(grades: Array, true: Array) -> Array:
    """Return 1 - |error| / 4 of each grade, (n,); 0 for NaN.

    Parameters
    ----------
    grades : (n,)
        Estimated grades; NaN for none.
    true : (n,)
        Grades that people gave.

    Returns
    -------
    (n,)
        0 to 1.
    """
    near: Array = 1.0 - np.minimum(np.abs(np.nan_to_num(grades, nan=np.inf) - true), WORST) / WORST
    return near
