# SPDX-License-Identifier: Apache-2.0
"""Tune a recipe on labelled bags by a genetic search, and write what was found as recipe files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from texture_core.config import writing
from texture_core.errors import InvalidData, InvalidParameter
from texture_estimation import search
from texture_estimation.recipe import Recipe, load_recipe, with_channels
from texture_estimation.roughness import RoughnessRecipe, load_roughness_recipe, read_grades
from texture_evaluation.charts import COLOURS, chart, line_styles, pareto_front
from texture_features.feature_set import FeatureSet
from texture_features.windows import CutWindow, WindowParams
from texture_recordings.dataset import SlideDataset

# --------------------
# Charts of genetic searches: how they converge, and the front of accuracy and computing.

NAMED = 10  # lines of more searches than this are not named


def convergence_chart(searches: Mapping[str, Sequence[search.Generation]], title: str, path: str | Path) -> Path:
    """Draw the fitness of the best individual over the generations, a line for each search.

    Parameters
    ----------
    searches
        Name of the search → its generations.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
    """
    with chart(path, (7.5, 4.2), title) as figure:
        axes = figure.subplots()
        for (name, history), style in zip(searches.items(), cycle(line_styles()), strict=False):
            best = [100 * one.best.fitness for one in history]
            label = name if len(searches) <= NAMED else None
            axes.step([one.number for one in history], best, where='mid', label=label, **style)
        axes.set(xlabel='generation', ylabel='fitness of the best individual (%)')
        if len(searches) <= NAMED:
            axes.legend(loc='lower right')
    return Path(path)


def search_front_chart(fronts: Mapping[str, Sequence[tuple[float, float]]], title: str, path: str | Path) -> Path:
    """Draw the recipes of each search by cost and fitness, and the front that none of them betters.

    Parameters
    ----------
    fronts
        Name of the search → (operations of a window, fitness from 0 to 1) of each recipe.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
    """
    with chart(path, (7.5, 4.2), title) as figure:
        axes = figure.subplots()
        for number, (name, points) in enumerate(fronts.items()):
            colour = COLOURS[number % len(COLOURS)]
            best = [points[index] for index in pareto_front(points)]
            axes.plot([cost for cost, _ in points], [100 * share for _, share in points], '.', color=colour)
            axes.step(
                [cost for cost, _ in best], [100 * share for _, share in best],
                where='post', color=colour, linewidth=1, label=name,
            )  # fmt: skip
        axes.set(xscale='log', xlabel='operations from the samples of a window to the decision', ylabel='fitness (%)')
        axes.legend(loc='lower right')
    return Path(path)


Tell = Callable[[str, search.Generation], None]


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


def cut_of(dataset: SlideDataset, feature_set: FeatureSet) -> search.Cut:
    """Return what gives the windows of all slides, by window parameters; each length is cut once."""

    @cache
    def cut(windows: WindowParams) -> search.LabelledWindows:
        plan = replace(feature_set, windows=windows, _layouts={})
        return search.LabelledWindows.from_events(_named_windows(dataset, plan), feature_set.window_names)

    return cut


def optimise_from_bags(
    wanted: Wanted,
    params: search.SearchParams,
    out: str | Path,
    *,
    resume: bool = False,
    tell: Tell = lambda *_: None,
) -> Written:
    """Tune a recipe and write it as `out`, with checkpoint and chart beside it; within `workers`, on several cores.

    Parameters
    ----------
    wanted
        Recipe and slides.
    params
        Population, generations and so on.
    out
        Path of the recipe that is written, such as 'best.yaml'.
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
    search_slides = search.SearchSlides(cut_of(dataset, feature_set), params.halves, params.seed)
    checkpoint = checkpoint_of(target)
    if resume and not written_checkpoints(target):
        raise InvalidData(f"there is no checkpoint '{checkpoint}' to go on from; leave '--resume' out to start again")
    options: dict[str, Any] = {'checkpoint': checkpoint, 'resume': checkpoint if resume else None}
    found: search.SearchResult | search.PairSearchResult
    if wanted.per_pair:
        found = search.optimise_pairs(
            space, search_slides, params, tell=lambda pair, said: tell(' – '.join(pair), said), **options
        )
    else:
        task = search.RoughnessTask(read_grades(wanted.grades)) if wanted.grades else search.ClassificationTask()
        found = search.optimise(space, search_slides, params, task, tell=lambda said: tell('', said), **options)
    written = write_recipes(found, space.base, wanted.recipe, params, target)
    chart = _draw(found, wanted.recipe, params, target.with_suffix('.png'))
    return Written((*written.files, chart), written.lines)


def _draw(
    found: search.SearchResult | search.PairSearchResult, recipe: str, params: search.SearchParams, chart: Path
) -> Path:
    if isinstance(found, search.PairSearchResult):
        histories = {' – '.join(pair): one.history for pair, one in found.by_pair.items()}
        return convergence_chart(histories, f'{recipe}: a search for each pair', chart)
    if params.objective == 'front':
        points = [(one.searched.cost, one.fitness) for one in found.finalists]
        return search_front_chart({recipe: points}, f'{recipe}: accuracy and computing', chart)
    return convergence_chart({recipe: found.history}, f'{recipe}: the search', chart)


def _space(wanted: Wanted) -> search.RecipeSpace:
    recipe: Recipe | RoughnessRecipe
    if wanted.grades:
        recipe = load_roughness_recipe(wanted.recipe)
        learner = recipe.regressor_name
    else:
        recipe = with_channels(load_recipe(wanted.recipe), wanted.channels)
        learner = recipe.learner_name
    of_pairs = search.space_for('pairs_of', recipe.name) if wanted.per_pair else None
    name = (
        wanted.search or of_pairs or search.space_for('recipes', recipe.name) or search.space_for('learners', learner)
    )
    if not name:
        raise InvalidParameter(
            f"recipe '{recipe.name}' has no search space of its own, nor has '{learner}'; "
            'say with --search FILE what is to be varied'
        )
    return search.RecipeSpace.load(name, recipe)


# --------------------
# Recipes that a search has found, written as files that `texture train` reads.


@dataclass(frozen=True)
class Written:
    """The files that a search has written, and what it found in lines for people.

    Examples
    --------
    >>> Written((checkpoint_of('best.yaml'),), ('nothing yet',)).files[0].name
    'best.search.json'
    """

    files: tuple[Path, ...]
    lines: tuple[str, ...]


def checkpoint_of(out: str | Path) -> Path:
    """Return where the scores of a search are kept: 'best.yaml' → 'best.search.json'."""
    path = Path(out)
    return path.with_name(f'{path.stem}.search.json')


def written_checkpoints(out: str | Path) -> list[Path]:
    """Return the checkpoint of a search that is there, or those of its pairs."""
    path = checkpoint_of(out)
    return [path] if path.is_file() else sorted(path.parent.glob(f'{path.stem}-*-vs-*{path.suffix}'))


def write_recipes(
    found: search.SearchResult | search.PairSearchResult,
    base: Any,
    tuned: str,
    params: search.SearchParams,
    target: Path,
) -> Written:
    """Write the best recipe, with the others of a front beside it; of pairs, theirs and the one that joins them.

    Where a recipe comes from and its scores stand at the top of its file.

    Parameters
    ----------
    found
        What was found.
    base
        Recipe from which the search began.
    tuned
        How it was named.
    params
        Parameters of the search.
    target
        Path of the recipe.

    Returns
    -------
    Written
        The files, with the checkpoint of a search that has one, and what was found.

    Raises
    ------
    InvalidParameter
        If a file cannot be written.
    """
    origin = (
        f'Found by `texture optimise {tuned}`: {params.population} individuals, {params.generations} '
        f'generations, {params.halves} halves, seed {params.seed}.'
    )
    files = _files(found, target, front=params.objective == 'front')
    for path, finalist in files.items():
        _write(finalist.recipe, path, origin, _scores(finalist))
    written = Written(tuple(files), tuple(f'{path}: {_scores(finalist)}' for path, finalist in files.items()))
    if isinstance(found, search.PairSearchResult):
        return _with_joined(written, found, base, origin, target)
    return Written((*written.files, checkpoint_of(target)), written.lines)


def _with_joined(written: Written, pairs: search.PairSearchResult, base: Recipe, origin: str, target: Path) -> Written:
    """Write the recipe that joins those of the pairs, or say why there is none."""
    together = f'all pairs together, most pairs won: {_shares(pairs.scores)}'
    try:
        joined = search.joined_recipe({pair: found.best.recipe for pair, found in pairs.by_pair.items()}, base)
    except InvalidParameter as error:
        return Written(written.files, (*written.lines, together, f'no recipe of all pairs was written: {error}'))
    _write(joined, target, origin, together)
    return Written((target, *written.files), (*written.lines, f'{target}: {together}'))


def _files(
    found: search.SearchResult | search.PairSearchResult, target: Path, *, front: bool
) -> Mapping[Path, search.Finalist]:
    if isinstance(found, search.PairSearchResult):
        return {search.beside(target, pair): one.best for pair, one in found.by_pair.items()}
    others = [one for one in found.finalists if front and one is not found.best]
    numbered = {target.with_name(f'{target.stem}-{n}{target.suffix}'): one for n, one in enumerate(others, 2)}
    return {target: found.best} | numbered


def _write(recipe: Any, path: Path, origin: str, scores: str) -> None:
    content = yaml.safe_dump(recipe.as_mapping(), sort_keys=False, allow_unicode=True, width=120)
    with writing(path):
        path.write_text(f'# {origin}\n# {scores}.\n{content}', encoding='utf-8')


def _scores(finalist: search.Finalist) -> str:
    return f'fitness {100 * finalist.fitness:.1f} %: {_shares(finalist.scores)} over {len(finalist.scores)} halves'


def _shares(scores: Sequence[search.HalfScore]) -> str:
    learning, test = 100.0 * np.mean(scores, axis=0)
    return f'training {learning:.1f} %, tested {test:.1f} %'
