"""Tune a recipe on labelled bags by a genetic search, and write what was found as recipe files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from texture_core.errors import InvalidData, InvalidParameter
from texture_estimation.channels import with_channels
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.roughness.grades import read_grades
from texture_estimation.roughness.roughness_recipe import RoughnessRecipe, load_roughness_recipe
from texture_estimation.search.classification_task import ClassificationTask
from texture_estimation.search.generation import Generation, SearchParams
from texture_estimation.search.labelled_windows import Cut, LabelledWindows
from texture_estimation.search.optimise import SearchResult, optimise
from texture_estimation.search.pairs import PairSearchResult, optimise_pairs
from texture_estimation.search.parallel import ParallelMap, threaded_map
from texture_estimation.search.recipe_files import Written, checkpoint_of, write_recipes, written_checkpoints
from texture_estimation.search.recipe_space import RecipeSpace
from texture_estimation.search.roughness_task import RoughnessTask
from texture_estimation.search.search_slides import SearchSlides
from texture_estimation.search.shipped_spaces import shipped_space
from texture_evaluation.optimise_charts import convergence_chart, search_front_chart
from texture_features.feature_set import FeatureSet
from texture_features.windowing.windows import CutWindow, WindowParams
from texture_recordings.slide_dataset import SlideDataset

Tell = Callable[[str, Generation], None]


@dataclass(frozen=True)
class Wanted:
    """What is tuned, and on which slides.

    Parameters
    ----------
    recipe
        Name of a shipped recipe, or path of any; of a roughness recipe if there are `grades`.
    bags
        Bags, or folders of bags.
    search
        Name or path of the search space; '' for that of the recipe or its learner.
    slides
        Which slides of each surface, such as '1-30'; '' for all.
    channels
        'fast' leaves all inputs of the recipe but `signal` out.
    grades
        CSV file with the grade of every surface, or the name of a shipped table; '' to distinguish surfaces.
    per_pair
        Tune the variables of each pair of surfaces by themselves; one recipe joins them.
    """

    recipe: str
    bags: tuple[str, ...]
    search: str = ''
    slides: str = ''
    channels: str = 'all'
    grades: str = ''
    per_pair: bool = False

    def __post_init__(self) -> None:
        if self.grades and self.per_pair:
            raise InvalidParameter('grades are not told pair by pair; leave --per-pair or --grades out')


def _named_windows(dataset: SlideDataset, plan: FeatureSet) -> Iterator[CutWindow]:
    """Yield the windows by names of slides: unlike ids of explorations, these are unique over all bags."""
    for slide, events in dataset.windows(plan):
        yield from (replace(event, exploration_id=slide.name) for event in events if isinstance(event, CutWindow))


def cut_of(dataset: SlideDataset, feature_set: FeatureSet) -> Cut:
    """Return what gives the windows of all slides, by window parameters; each length is cut once."""

    @cache
    def cut(windows: WindowParams) -> LabelledWindows:
        plan = replace(feature_set, windows=windows, _layouts={})
        return LabelledWindows.from_events(_named_windows(dataset, plan), feature_set.window_names)

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
    if resume and not written_checkpoints(target):
        raise InvalidData(f"there is no checkpoint '{checkpoint}' to go on from; leave '--resume' out to start again")
    options: dict[str, Any] = {'checkpoint': checkpoint, 'resume': checkpoint if resume else None}
    found: SearchResult[Any] | PairSearchResult
    with over() as parallel_map:
        options['parallel_map'] = parallel_map
        if wanted.per_pair:
            found = optimise_pairs(
                space, search_slides, params, tell=lambda pair, said: tell(' – '.join(pair), said), **options
            )
        else:
            task: Any = RoughnessTask(read_grades(wanted.grades)) if wanted.grades else ClassificationTask()
            found = optimise(space, search_slides, params, task, tell=lambda said: tell('', said), **options)
    written = write_recipes(found, space.base, wanted.recipe, params, target)
    chart = _draw(found, wanted.recipe, params, target.with_suffix('.png'))
    return Written((*written.files, chart), written.lines)


def _draw(found: SearchResult[Any] | PairSearchResult, recipe: str, params: SearchParams, chart: Path) -> Path:
    if isinstance(found, PairSearchResult):
        histories = {' – '.join(pair): one.found.history for pair, one in found.by_pair.items()}
        return convergence_chart(histories, f'{recipe}: a search for each pair', chart)
    if params.objective == 'front':
        points = [(one.searched.cost, one.fitness) for one in found.finalists]
        return search_front_chart({recipe: points}, f'{recipe}: accuracy and computing', chart)
    return convergence_chart({recipe: found.found.history}, f'{recipe}: the search', chart)


def _space(wanted: Wanted) -> RecipeSpace[Any]:
    recipe: Recipe | RoughnessRecipe
    if wanted.grades:
        recipe = load_roughness_recipe(wanted.recipe)
        learner = recipe.regressor_name
    else:
        recipe = with_channels(load_recipe(wanted.recipe), wanted.channels)
        learner = recipe.learner_name
    return RecipeSpace.load(wanted.search or shipped_space(recipe.name, learner, per_pair=wanted.per_pair), recipe)
