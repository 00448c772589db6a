"""Tune a recipe on labelled bags by a genetic search, and write what was found as recipe files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from texture_core.errors import InvalidData, InvalidParameter
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.roughness.grades import read_grades
from texture_estimation.roughness.recipe import RoughnessRecipe, load_roughness_recipe
from texture_estimation.search.classification_task import ClassificationTask
from texture_estimation.search.genetic_search import Generation, SearchParams
from texture_estimation.search.labelled_windows import Cut, LabelledWindows
from texture_estimation.search.optimise import optimise
from texture_estimation.search.pairs import optimise_pairs
from texture_estimation.search.parallel import ParallelMap, dask_map, threaded_map
from texture_estimation.search.recipe_space import RecipeSpace
from texture_estimation.search.roughness_task import RoughnessTask
from texture_estimation.search.search_slides import SearchSlides
from texture_evaluation.found_recipes import Wanted, Written, checkpoint_of, write_found, write_pairs
from texture_evaluation.train import with_channels
from texture_features.feature_set import FeatureSet
from texture_features.windowing.windows import CutWindow, WindowParams
from texture_recordings.slide_dataset import SlideDataset

# The search space of a recipe, or else of its learner.
OF_RECIPES: Mapping[str, str] = {
    'ets-linear-ann': 'ets-ann',
    'ets-linear-ann-vote': 'ets-ann',
    'ets-linear-svm': 'ets-svm',
    'ets-linear-svm-vote': 'ets-svm',
    'ets-circular-ann': 'ets-circular-ann',
    'ets-circular-svm': 'ets-circular-svm',
    'ets-fine-ann': 'ets-fine-ann',
    'ets-fine-svm': 'ets-fine-svm',
    'ets-roughness-ann1': 'ets-roughness-ann1',
    'ets-roughness-ann5': 'ets-roughness-ann5',
    'ets-roughness-svm5': 'ets-roughness-svm5',
}
# All pairs of one model share the length of the windows, so it is not searched for each of them.
OF_PAIRS: Mapping[str, str] = {
    'ets-circular-ann': 'ets-circular-pairs-ann',
    'ets-circular-svm': 'ets-circular-pairs-svm',
}
OF_LEARNERS: Mapping[str, str] = {
    'ann_pairs': 'ann-pairs',
    'svm_pairs': 'svm-pairs',
    'svm_rbf': 'svm-rbf',
    'mlp': 'mlp',
}
Tell = Callable[[str, Generation], None]


def cut_of(dataset: SlideDataset, feature_set: FeatureSet) -> Cut:
    """Return what gives the windows of all slides, by window parameters; each length is cut once."""

    @cache
    def cut(windows: WindowParams) -> LabelledWindows:
        plan = replace(feature_set, windows=windows, _layouts={})
        # Unlike ids of explorations, names of slides are unique over all bags.
        named = (
            replace(event, exploration_id=slide.name)
            for slide, events in dataset.windows(plan)
            for event in events
            if isinstance(event, CutWindow)
        )
        return LabelledWindows.from_events(named, feature_set.topics)

    return cut


def optimise_from_bags(
    wanted: Wanted,
    params: SearchParams,
    out: str | Path,
    *,
    over: Callable[[], AbstractContextManager[ParallelMap]] = threaded_map,
    resume: bool = False,
    tell: Tell = lambda *_: None,
) -> Written:
    """Tune a recipe and write it as `out`, with checkpoint and chart beside it.

    Parameters
    ----------
    wanted
        Recipe and slides.
    params
        Population, generations and so on.
    out
        Path of the recipe that is written, such as 'best.yaml'.
    over
        Gives what the work is spread over.
    resume
        Go on from the checkpoint beside `out`.
    tell
        Called after each generation with the pair of surfaces ('' for all) and what it brought.

    Returns
    -------
    Written
        What was found, and the paths of the files.

    Raises
    ------
    TextureError
        With one sentence, if recipe, bags, search space or checkpoint are wrong.
    InvalidParameter
        If the folder of `out` does not exist.
    InvalidData
        If there is no checkpoint to go on from.
    """
    target = Path(out).expanduser()
    if not target.parent.is_dir():
        raise InvalidParameter(f"there is no folder '{target.parent}' for '{target.name}'; name another place")
    space = _space(wanted)
    feature_set = space.base.feature_set
    dataset = SlideDataset.from_bags(wanted.bags, wanted.slides, topics=feature_set.topics)
    search_slides = SearchSlides(cut_of(dataset, feature_set), params.halves, params.seed)
    checkpoint = checkpoint_of(target)
    if resume and not _checkpoints(checkpoint):
        raise InvalidData(f"there is no checkpoint '{checkpoint}' to go on from; leave '--resume' out to start again")
    options: dict[str, Any] = {'checkpoint': checkpoint, 'resume': checkpoint if resume else None}
    with over() as parallel_map:
        if wanted.per_pair:
            pairs = optimise_pairs(
                space,
                search_slides,
                params,
                parallel_map=parallel_map,
                tell=lambda pair, said: tell(' – '.join(pair), said),
                **options,
            )
            return write_pairs(pairs, space.base, wanted, params, target)
        task: Any = RoughnessTask(read_grades(wanted.grades)) if wanted.grades else ClassificationTask()
        found = optimise(
            space, search_slides, params, task, parallel_map=parallel_map, tell=lambda said: tell('', said), **options
        )
    return write_found(found, wanted, params, target)


def parallel_map_for(jobs: int, dask: str) -> Callable[[], AbstractContextManager[ParallelMap]]:
    """Return what spreads over so many cores (-1: all), or over a Dask cluster if its address is given."""
    return (lambda: dask_map(dask)) if dask else (lambda: threaded_map(jobs))


def _space(wanted: Wanted) -> RecipeSpace[Any]:
    recipe: Recipe | RoughnessRecipe
    if wanted.grades:
        recipe = load_roughness_recipe(wanted.recipe)
        learner = recipe.regressor_name
    else:
        recipe = with_channels(load_recipe(wanted.recipe), wanted.channels)
        learner = recipe.learner_name
    of_pairs = OF_PAIRS.get(recipe.name) if wanted.per_pair else None
    search = wanted.search or of_pairs or OF_RECIPES.get(recipe.name) or OF_LEARNERS.get(learner)
    if not search:
        raise InvalidParameter(
            f"recipe '{recipe.name}' has no search space of its own, nor has '{learner}'; "
            'say with --search FILE what is to be varied'
        )
    return RecipeSpace.load(search, recipe)


def _checkpoints(path: Path) -> list[Path]:
    """Return the checkpoint, or those of the pairs."""
    return [path] if path.is_file() else sorted(path.parent.glob(f'{path.stem}-*-vs-*{path.suffix}'))
