"""How many principal components hold 99 % of the variance of one linen (Hu et al. 2014, section 5.2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from texture_benchmarks.papers import hu
from texture_benchmarks.papers.experiment import Experiment, ExperimentResult
from texture_benchmarks.papers.interval import mean
from texture_benchmarks.papers.protocol import Finding
from texture_benchmarks.papers.recipe_digest import digest_of
from texture_benchmarks.papers.report import finding_as_json
from texture_benchmarks.papers.simulated_trials import Slides, gather
from texture_benchmarks.papers.trial import recipe_of
from texture_core.arrays import Array
from texture_core.errors import InvalidParameter
from texture_estimation.learners.svm_max_wins import principal_components
from texture_simulation.scene import load_scene

NAME, PAPER = 'hu-components', 39
METHODS = {'magnitude': hu.BOTH, 'power': hu.POWER, 'logarithm': hu.LOG}
DIRECTIONS = ('x', 'y')
QUICK = ('linen_2', 'linen_3')  # fewer slides could not have 39 components
Counts = Mapping[str, Mapping[str, Mapping[str, int]]]  # by scale, direction and linen


def run(experiment: Experiment) -> ExperimentResult:
    """Count the components of each linen in each direction, of magnitudes, powers and their logarithms.

    Raises
    ------
    InvalidParameter
        If a search is asked for.
    """
    if experiment.tune:
        raise InvalidParameter(f"experiment '{NAME}' has nothing to tune; leave --tune out")
    [task] = hu.PROTOCOL.tasks
    task = replace(task, surfaces=QUICK) if experiment.quick else task
    slides = gather(load_scene(hu.PROTOCOL.scene), task, experiment.seed, slow=False)
    counts = {scale: components(slides, method) for scale, method in METHODS.items()}
    return ExperimentResult(
        name=NAME,
        measured='principal components that hold 99 % of the variance of the slides over one linen in one direction',
        data=f"simulated: scene '{hu.PROTOCOL.scene}', {task.visits[0].count} slides of each linen along x and along y",
        split='none: components are sought on all slides over one linen',
        numbers={
            'seed': experiment.seed,
            'recipes': {hu.BOTH: digest_of(hu.BOTH)},
            'paper': PAPER,
            'components': counts,
            'findings': [finding_as_json(finding) for finding in findings(counts)],
        },
        lines=tuple(
            f'{scale}, along {direction}: {", ".join(f"{name} {count}" for name, count in linens.items())}'
            for scale, directions in counts.items()
            for direction, linens in directions.items()
        ),
    )


def components(slides: Slides, method: str) -> Mapping[str, Mapping[str, int]]:
    """Return by direction and linen how many components the recipe of a method of the experiment keeps of one linen."""
    recipe = recipe_of(next(one for one in hu.PROTOCOL.tasks[0].methods if one.name == method))
    values, owner = slides.extract(recipe.feature_set)
    share = recipe.learner.variance  # type: ignore[attr-defined]  # of SvmMaxWins
    return {
        direction: {linen: kept(part[slides.codes[owner] == code], share) for code, linen in enumerate(slides.surfaces)}
        for direction, part in zip(DIRECTIONS, np.split(values, len(DIRECTIONS), axis=1), strict=True)
    }


def kept(values: Array, share: float) -> int:
    """Return how many components explain a share of the variance, the mean of each example subtracted (eq. 7).

    Parameters
    ----------
    values : (n_slides, n_points)
        Spectra.
    share
        Fraction of the variance, 0 to 1.

    Returns
    -------
    int

    Examples
    --------
    >>> import numpy as np
    >>> kept(np.array([[3.0, -3.0, 0.0, 0.0], [0.0, 0.0, 0.1, -0.1]]), 0.99)
    1
    """
    return principal_components(values - values.mean(axis=1, keepdims=True), share).shape[1]


def findings(counts: Counts) -> list[Finding]:
    """Check the 39 components of the paper with each reading of its spectrum, over linens and directions."""
    found = {scale: np.array([[*of.values()] for of in parts.values()]).ravel() for scale, parts in counts.items()}
    away = {scale: np.abs(values - PAPER) for scale, values in found.items()}
    return [
        *(_finding(f'one linen takes {PAPER} components or more: {scale}', values - PAPER, values, reaches=True)
          for scale, values in found.items()),
        *(_finding(f'not of the paper: magnitudes are nearer to its {PAPER} components than the {other}',
                   away[other] - away['magnitude'], found[other], reaches=False)
          for other in ('power', 'logarithm')),
    ]  # fmt: skip


def _finding(claim: str, difference: Array, values: Array, *, reaches: bool) -> Finding:
    interval = mean(difference)
    holds = interval.high >= 0.0 if reaches else interval.above()
    return Finding(claim, f'{values.mean():.1f} components, {values.min()} to {values.max()}', interval, holds, reaches)
