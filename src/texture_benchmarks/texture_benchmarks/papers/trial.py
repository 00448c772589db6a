"""Run a protocol: feel the slides, search for parameters if wanted, train on some slides, evaluate the others."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from texture_benchmarks.papers.method_result import MethodResult
from texture_benchmarks.papers.protocol import Mask, Method, MethodResults, PaperProtocol, RecognitionTask
from texture_benchmarks.papers.simulated_trials import Slides, gather
from texture_benchmarks.papers.tuning import TunedRecipe, tune
from texture_core.arrays import Array
from texture_core.errors import InvalidParameter
from texture_estimation.learners.learner import Codes
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.search.classification_task import ClassificationTask
from texture_estimation.search.fitness import decided_by_slide
from texture_estimation.search.recipe_space import RecipeSpace
from texture_estimation.search.shipped_spaces import OF_RECIPES
from texture_features.feature_set import InputFeatures
from texture_features.windowing.time_stretch import Stretched
from texture_simulation.scene import Scene

FAST, SLOW = 'signal', 'signal_static'
OUR_RECIPES = ('default', 'vibration-and-taxels')
TunedRecipes = Mapping[tuple[str, str], TunedRecipe[Recipe]]  # by task and recipe
NONE: TunedRecipes = {}


def outcomes(
    protocol: PaperProtocol, scene: Scene, seed: int, *, quick: bool, tuned: TunedRecipes = NONE, splits: int = 0
) -> MethodResults:
    """Return what comes out of each method in each task.

    Parameters
    ----------
    protocol
        Methods and tasks of the paper.
    scene
        Surfaces, sensor and effects.
    seed
        Of everything random.
    quick
        Whether fewer slides will do.
    tuned
        Recipes that were searched for.
    splits
        Each method is tried on at most so many splits; 0 for all.

    Returns
    -------
    MethodResults
        By task and method.
    """
    return {
        (task.name, method): outcome
        for task in protocol.tasks
        for method, outcome in of_task(protocol, task, scene, seed, quick=quick, tuned=tuned, splits=splits)
    }


def without_ours(protocol: PaperProtocol) -> PaperProtocol:
    """Return the protocol with the methods of the paper and their variations alone."""
    tasks = [
        replace(task, methods=tuple(method for method in task.methods if method.recipe not in OUR_RECIPES))
        for task in protocol.tasks
    ]
    return replace(protocol, tasks=tuple(tasks))


def of_task(
    protocol: PaperProtocol,
    task: RecognitionTask,
    scene: Scene,
    seed: int,
    *,
    quick: bool,
    tuned: TunedRecipes = NONE,
    splits: int = 0,
) -> Iterator[tuple[str, MethodResult]]:
    """Yield what comes out of each method in one task.

    One with a recipe that was searched for is tried on the first split alone: in the others it would be tested on
    slides that the search has seen.

    Parameters
    ----------
    protocol
        Methods and tasks of the paper.
    task
        The task.
    scene
        Surfaces, sensor and effects.
    seed
        Of everything random.
    quick
        Whether fewer slides will do.
    tuned
        Recipes that were searched for.
    splits
        Number of splits that are run; 0 for all.

    Yields
    ------
    (str, MethodResult)
        Name of the method, and its result.
    """
    slides, trained_on = _measured(protocol, task, scene, seed, quick=quick)
    for method in task.methods:
        found = tuned.get((task.name, method.recipe))
        recipe = found.recipe if found else recipe_of(method)
        most = 1 if found else min(filter(None, (method.splits, splits)), default=len(trained_on))
        yield method.name, evaluate_method(recipe, slides, trained_on[:most], method.views, singly=method.singly)


def searched(protocol: PaperProtocol, scene: Scene, seed: int, *, quick: bool) -> TunedRecipes:
    """Return the recipes for which the paper has a genetic search, found on what the first split is trained on.

    Parameters
    ----------
    protocol
        Methods and tasks of the paper.
    scene
        Surfaces, sensor and effects.
    seed
        Of everything random.
    quick
        Whether a short search will do.

    Returns
    -------
    TunedRecipes

    Raises
    ------
    InvalidParameter
        If the paper searches for none.
    """
    methods = {
        (task.name, method.recipe): (task, method)
        for task in protocol.tasks
        for method in reversed(task.methods)  # of several with one recipe, the first
        if method.recipe in OF_RECIPES
    }
    if not methods:
        raise InvalidParameter(
            f"experiment '{protocol.name}' has nothing to tune: its paper searches for no parameters; leave --tune out"
        )
    found = {}
    for key, (task, method) in methods.items():
        slides, trained_on = _measured(protocol, task, scene, seed, quick=quick)
        space = RecipeSpace.load(OF_RECIPES[method.recipe], recipe_of(method))
        found[key] = tune(space, slides.views[0].of(trained_on[0]), ClassificationTask(), seed, quick=quick)
    return found


def _measured(
    protocol: PaperProtocol, task: RecognitionTask, scene: Scene, seed: int, *, quick: bool
) -> tuple[Slides, Mask]:
    """Return the slides of a task, and which of them each split is trained on."""
    task = reduced(task, protocol.quick_count) if quick else task
    slow = any(SLOW in recipe_of(method).feature_set.topics for method in task.methods)
    slides = gather(scene, task, seed, slow=slow)
    return slides, protocol.divide(slides.codes, slides.conditions, np.random.default_rng(seed), quick)


def recipe_of(method: Method) -> Recipe:
    """Return the recipe as the protocol asks for it."""
    recipe = load_recipe(method.recipe)
    if method.stretch_to_m_s or method.also:
        recipe = _with_motion(recipe, method)
    windows = method.windows or recipe.feature_set.windows
    inputs = tuple(_changed(item, method.features) for item in recipe.feature_set.inputs)
    learner: Any = recipe.learner
    return replace(
        recipe,
        feature_set=replace(recipe.feature_set, windows=windows, inputs=inputs, _layouts={}),
        learner=replace(learner, **method.learner),
        training=replace(recipe.training, hop_s=method.windows.hop_s) if method.windows else recipe.training,
    )


def _with_motion(recipe: Recipe, method: Method) -> Recipe:
    content = recipe.as_mapping()
    vibration = content['inputs'][FAST]
    features = [*vibration['features'], *method.also]
    content['inputs'][FAST] = {'stretch_to_m_s': method.stretch_to_m_s, 'features': features}
    return Recipe.from_mapping(content, recipe.name)


def _changed(item: InputFeatures, parameters: Mapping[str, Mapping[str, Any]]) -> InputFeatures:
    features: list[tuple[str, Any]] = list(item.features)
    changed = tuple((name, _with_parameters(feature, parameters.get(name, {}))) for name, feature in features)
    return replace(item, features=changed)


def _with_parameters(feature: Any, parameters: Mapping[str, Any]) -> Any:
    if isinstance(feature, Stretched):
        return replace(feature, feature=_with_parameters(feature.feature, parameters))
    return replace(feature, **parameters)


def evaluate_method(
    recipe: Recipe,
    slides: Slides,
    trained_on: Mask,
    views: Sequence[int] = (),
    *,
    singly: bool = False,
    beside: Array | None = None,
) -> MethodResult:
    """Learn from the slides of each split and evaluate all.

    Parameters
    ----------
    recipe
        What learns and classifies.
    slides
        What was measured.
    trained_on : (n_divisions, n_slides)
        Which are used for training.
    views
        Which views of the slides are used; () for all.
    singly
        See `Method`.
    beside : (n_slides, n_values) or None
        Values of each slide that its windows have beside the features.

    Returns
    -------
    MethodResult
        Of all splits together.
    """
    to_learn = replace(recipe.feature_set, windows=recipe.training_windows, _layouts={})
    trained, owner = slides.extract(to_learn, views)
    asked, slide = slides.extract(recipe.feature_set, views)
    if beside is not None:
        trained, asked = np.hstack((trained, beside[owner])), np.hstack((asked, beside[slide]))
    windows = recipe.feature_set.windows
    decided = np.empty(trained_on.shape, dtype=np.intp)
    rows_of = _halves_of_windows(owner, len(trained_on)) if singly else trained_on[:, owner]
    began = time.perf_counter()
    for number, rows in enumerate(rows_of):
        fitted = recipe.learner.fit(trained[rows], slides.codes[owner[rows]], owner[rows])
        scores = recipe.learner.predictor(fitted.parameters)(asked)
        decided[number], _ = decided_by_slide(scores, slide, recipe.evidence, windows.hop_s / windows.length_s)
    taken_s = (time.perf_counter() - began) / len(trained_on)
    known = np.zeros_like(trained_on) if singly else trained_on
    return MethodResult(slides.surfaces, slides.codes, slides.conditions, decided, known, taken_s, fitted.note)


def _halves_of_windows(owner: Codes, count: int) -> Mask:
    rng = np.random.default_rng(count)
    return np.stack([rng.permutation(len(owner)) < len(owner) // 2 for _ in range(count)])


def reduced(task: RecognitionTask, count: int) -> RecognitionTask:
    """Return the task with fewer slides: so many over each surface, as equally as may be among the visits."""
    each = max(1, count // len(task.visits))
    visits = tuple(replace(visit, count=min(visit.count, each)) for visit in task.visits)
    return replace(task, visits=visits)
