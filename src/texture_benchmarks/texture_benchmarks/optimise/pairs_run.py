"""What the search for each pair of textures chooses in the experiments of Roberge et al., and all pairs together."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from texture_benchmarks.optimise.pairs_seeds import counts, over_seeds
from texture_benchmarks.papers import ets_circular, ets_fine, ets_linear
from texture_benchmarks.papers.interval import share
from texture_benchmarks.papers.protocol import Mask, PaperProtocol, RecognitionTask
from texture_benchmarks.papers.simulated_trials import gather
from texture_benchmarks.papers.trial import reduced
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_core.errors import InvalidParameter
from texture_estimation.learners.learner import Codes
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.search.classification_task import ClassificationTask
from texture_estimation.search.feature_cache import FeatureCache
from texture_estimation.search.fitness import UNDECIDED, decided_by_slide, decisions
from texture_estimation.search.generation import SearchParams
from texture_estimation.search.joined_pairs import joined_recipe
from texture_estimation.search.pairs import Pair, PairSearchResult, optimise_pairs
from texture_estimation.search.parallel import threaded_map
from texture_estimation.search.recipe_space import RecipeSpace
from texture_estimation.search.search_slides import SearchSlides
from texture_estimation.search.slide_arrays import SlideArrays
from texture_simulation.scene import load_scene

NAME = 'optimise-pairs'
# 13 individuals and 10 generations are the paper's for ten textures; otherwise it has 20 and 30, always 20 halves.
SMALL = SearchParams(population=13, generations=10, halves=6, finalists=1)
QUICK = SearchParams(population=4, generations=2, halves=2, finalists=1)
QUICK_SLIDES, QUICK_SURFACES = 24, 3
SEEDS, QUICK_SEEDS = 5, 2


@dataclass(frozen=True)
class PairCase:
    """Searches of one experiment: its protocol and task, the recipe, what is varied, and the size of the search."""

    protocol: PaperProtocol
    task: RecognitionTask
    recipe: str
    space: str
    params: SearchParams


CASES: Mapping[str, PairCase] = {
    'linear, ANN': PairCase(ets_linear.PROTOCOL, ets_linear.PROTOCOL.tasks[0], 'ets-linear-ann', 'ets-ann', SMALL),
    'linear, SVM': PairCase(ets_linear.PROTOCOL, ets_linear.PROTOCOL.tasks[0], 'ets-linear-svm', 'ets-svm', SMALL),
    'circular, ANN': PairCase(
        ets_circular.PROTOCOL, ets_circular.PROTOCOL.tasks[0], 'ets-circular-ann', 'ets-circular-ann', SMALL
    ),
    'circular, SVM': PairCase(
        ets_circular.PROTOCOL, ets_circular.PROTOCOL.tasks[0], 'ets-circular-svm', 'ets-circular-svm', SMALL
    ),
    'ten textures, ANN': PairCase(ets_fine.PROTOCOL, ets_fine.PROTOCOL.tasks[0], 'ets-fine-ann', 'ets-fine-ann', SMALL),
    'ten textures, SVM': PairCase(ets_fine.PROTOCOL, ets_fine.PROTOCOL.tasks[0], 'ets-fine-svm', 'ets-fine-svm', SMALL),
}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Search for each pair of each experiment with several seeds, count the choices, and test all pairs together."""
    seeds = range(options.seed, options.seed + (QUICK_SEEDS if options.quick else SEEDS))
    return result_of(
        {
            name: over_seeds({seed: run_case(case, replace(options, seed=seed)) for seed in seeds})
            for name, case in CASES.items()
        }
    )


def result_of(cases: Mapping[str, Any]) -> BenchmarkResult:
    """Return the figures of the cases as a result.

    Parameters
    ----------
    cases
        What `over_seeds` returns, by name.

    Returns
    -------
    BenchmarkResult
        With the counts of what was chosen.
    """
    return BenchmarkResult(
        name=NAME,
        measured='variables that genetic searches choose for each pair of textures; slides recognised by all pairs',
        data='simulated: ' + '; '.join(f'{name}: {case["slides"]} slides' for name, case in cases.items()),
        split='searched and trained on a random half of the slides, tested on the other half',
        numbers={'cases': dict(cases)},
    )


def run_case(case: PairCase, options: BenchmarkOptions) -> dict[str, Any]:
    """Search for each pair on the training half of an experiment's slides, and test on the other half.

    Parameters
    ----------
    case
        Experiment and search.
    options
        Seed, and whether it must be quick.

    Returns
    -------
    dict
        Choices by pair, their counts, and shares of slides recognised.
    """
    slides, trained_on = measured(case, options)
    space = RecipeSpace.load(case.space, load_recipe(case.recipe))
    params = replace(QUICK if options.quick else case.params, seed=options.seed)
    began = time.process_time()
    with threaded_map() as parallel_map:
        found = optimise_pairs(
            space, SearchSlides(slides.of(trained_on), params.halves, params.seed), params, parallel_map=parallel_map
        )
    processor_s = time.process_time() - began
    chosen = {pair: space.variables.named(result.best.searched.individual) for pair, result in found.by_pair.items()}
    recipes = {pair: result.best.recipe for pair, result in found.by_pair.items()}
    pairs = list(combinations(np.unique(slides.labels).tolist(), 2))
    return {
        'slides': len(slides.labels),
        'population': params.population,
        'generations': params.generations,
        'halves': params.halves,
        'processor_s': round(processor_s, 1),
        'variables': {name: list(values) for name, *values in space.table()},
        'chosen': {' – '.join(pair): choice for pair, choice in chosen.items()},
        'counts': counts(list(chosen.values())),
        'pairs_test': [round(float(result.best.record.test.mean()), 4) for result in found.by_pair.values()],
        'within_the_search': {
            'learning': round(float(found.record.learning.mean()), 4),
            'test': round(float(found.record.test.mean()), 4),
        },
        'tested': {
            'as shipped': recognised(dict.fromkeys(pairs, space.base), slides, trained_on),
            'tuned by pair': recognised(recipes, slides, trained_on),
        },
        'joined': joined_text(found, space.base),
    }


def measured(case: PairCase, options: BenchmarkOptions) -> tuple[SlideArrays, Mask]:
    """Return the slides of a case, and which of them are searched and trained on, (n_slides,).

    Parameters
    ----------
    case
        Experiment.
    options
        Seed, and whether few slides will do.

    Returns
    -------
    SlideArrays
        Simulated.
    (n_slides,) bool
        The first half of the experiment's own split.
    """
    scene = load_scene(case.protocol.scene)
    task = case.task
    if options.quick:
        task = replace(reduced(task, QUICK_SLIDES), surfaces=tuple(scene.surfaces)[:QUICK_SURFACES])
    slides = gather(scene, task, options.seed, slow=False)
    rng = np.random.default_rng(options.seed)
    return slides.views[0], case.protocol.divide(slides.codes, slides.conditions, rng, options.quick)[0]


def recognised(recipes: Mapping[Pair, Recipe], slides: SlideArrays, trained_on: Mask) -> dict[str, Any]:
    """Return what the pairs decide together on the slides that none was trained on; each pair has windows of its own.

    Parameters
    ----------
    recipes
        Recipe of each pair.
    slides
        All slides.
    trained_on : (n_slides,) bool
        Which of them are trained on.

    Returns
    -------
    dict
        Share of the other slides that are recognised, with its interval of 95 % over slides, and unclassified.
    """
    names, codes = np.unique(slides.labels, return_inverse=True)
    cache = FeatureCache(slides)
    wins = np.zeros((len(codes), len(names)))
    for pair, recipe in recipes.items():
        numbers = [names.tolist().index(label) for label in pair]
        winners = _winners(recipe, cache, slides, trained_on & np.isin(codes, numbers), codes == numbers[1])
        rows = np.flatnonzero(winners != UNDECIDED)
        wins[rows, np.array(numbers)[winners[rows]]] += 1.0
    decided = decisions(wins)[~trained_on]
    return {
        'recognised': share((decided == codes[~trained_on]).astype(np.float64)).as_json(),
        'unclassified': round(float((decided == UNDECIDED).mean()), 4),
    }


def _winners(recipe: Recipe, cache: FeatureCache, slides: SlideArrays, training: Mask, second: Mask) -> Codes:
    """Return which of two labels each slide is taken for, 0, 1 or UNDECIDED, (n_slides,)."""
    owner = slides(recipe.training_windows).slides
    values = cache.values(ClassificationTask().feature_set_of(recipe))
    rows = training[owner]
    fitted = recipe.learner.fit(values[rows], second[owner[rows]].astype(np.intp), owner[rows])
    windows = recipe.training_windows
    scores = recipe.learner.predictor(fitted.parameters)(values)
    winners, _ = decided_by_slide(scores, owner, recipe.evidence, windows.hop_s / windows.length_s)
    return winners


def joined_text(found: PairSearchResult, base: Recipe) -> dict[str, Any] | str:
    """Return the recipe of one model of all pairs as a file would hold it, or the sentence that says why there is none.

    Parameters
    ----------
    found
        What was found for the pairs.
    base
        Recipe from which the search began.

    Returns
    -------
    dict or str
    """
    try:
        return joined_recipe({pair: one.best.recipe for pair, one in found.by_pair.items()}, base).as_mapping()
    except InvalidParameter as error:
        return str(error)
