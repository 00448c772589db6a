"""Recipes that a search has found, written as files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from texture_core.errors import InvalidParameter
from texture_core.files import writing
from texture_estimation.recipe import Recipe
from texture_estimation.search.genetic_search import SearchParams
from texture_estimation.search.joined_pairs import joined_recipe
from texture_estimation.search.optimise import Finalist, SearchResult
from texture_estimation.search.pairs import PairSearchResult, beside
from texture_evaluation.optimise_charts import convergence_chart, search_front_chart


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


@dataclass(frozen=True)
class Written:
    """The files that a search has written, and what it found in lines for people."""

    files: tuple[Path, ...]
    lines: tuple[str, ...]


def checkpoint_of(out: str | Path) -> Path:
    """Return where the scores of a search are kept: 'best.yaml' → 'best.search.json'."""
    path = Path(out)
    return path.with_name(f'{path.stem}.search.json')


def write_found(found: SearchResult[Any], wanted: Wanted, params: SearchParams, target: Path) -> Written:
    """Write the recipes that a search found, with a chart beside them.

    Parameters
    ----------
    found
        What was found.
    wanted
        What was tuned.
    params
        Of the search.
    target
        Path of the recipe.

    Returns
    -------
    Written
        The files, and what was found in lines for people.

    Raises
    ------
    InvalidParameter
        If a file cannot be written.
    """
    recipes = {target: found.best}
    if params.objective == 'front':
        others = (one for one in found.finalists if one is not found.best)
        recipes |= {target.with_name(f'{target.stem}-{n}{target.suffix}'): one for n, one in enumerate(others, 2)}
    for path, finalist in recipes.items():
        write_recipe(finalist, path, _origin(wanted, params))
    chart = target.with_suffix('.png')
    if params.objective == 'front':
        costs = {f'{one.fitness:.4f}/{n}': (one.searched.cost, one.fitness) for n, one in enumerate(found.finalists)}
        search_front_chart({wanted.recipe: list(costs.values())}, f'{wanted.recipe}: accuracy and computing', chart)
    else:
        convergence_chart({wanted.recipe: found.found.history}, f'{wanted.recipe}: the search', chart)
    lines = [f'{path}: {_scores(finalist)}' for path, finalist in recipes.items()]
    return Written((*recipes, checkpoint_of(target), chart), tuple(lines))


def write_pairs(pairs: PairSearchResult, base: Recipe, wanted: Wanted, params: SearchParams, target: Path) -> Written:
    """Write the recipe that joins what the searches of all pairs found, those of the pairs, and a chart beside them.

    Parameters
    ----------
    pairs
        What was found.
    base
        Recipe from which the search began.
    wanted
        What was tuned.
    params
        Of the search.
    target
        Path of the recipe.

    Returns
    -------
    Written
        The files, and what was found in lines for people.

    Raises
    ------
    InvalidParameter
        If a file cannot be written.
    """
    recipes = {beside(target, pair): found.best for pair, found in pairs.by_pair.items()}
    for path, finalist in recipes.items():
        write_recipe(finalist, path, _origin(wanted, params))
    chart = target.with_suffix('.png')
    histories = {' – '.join(pair): found.found.history for pair, found in pairs.by_pair.items()}
    convergence_chart(histories, f'{wanted.recipe}: a search for each pair', chart)
    together = (
        f'all pairs together, most pairs won: training {100 * pairs.record.learning.mean():.1f} %, '
        f'tested {100 * pairs.record.test.mean():.1f} %'
    )
    lines = [f'{path}: {_scores(finalist)}' for path, finalist in recipes.items()]
    try:
        joined = joined_recipe({pair: found.best.recipe for pair, found in pairs.by_pair.items()}, base)
    except InvalidParameter as error:
        return Written((*recipes, chart), (*lines, together, f'no recipe of all pairs was written: {error}'))
    _write(joined, target, _origin(wanted, params), together)
    return Written((target, *recipes, chart), (*lines, f'{target}: {together}'))


def write_recipe(finalist: Finalist[Any], path: Path, origin: str) -> None:
    """Write a recipe as a file that `texture train` reads; where it comes from stands at the top.

    Parameters
    ----------
    finalist
        Recipe and its scores.
    path
        File that is written.
    origin
        Where it comes from, in words.

    Raises
    ------
    InvalidParameter
        If the file cannot be written.
    """
    _write(finalist.recipe, path, origin, _scores(finalist))


def _write(recipe: Any, path: Path, origin: str, scores: str) -> None:
    content = yaml.safe_dump(recipe.as_mapping(), sort_keys=False, allow_unicode=True, width=120)
    with writing(path):
        path.write_text(f'# {origin}\n# {scores}.\n{content}', encoding='utf-8')


def _origin(wanted: Wanted, params: SearchParams) -> str:
    return (
        f'Found by `texture optimise {wanted.recipe}`: {params.population} individuals, {params.generations} '
        f'generations, {params.halves} halves, seed {params.seed}.'
    )


def _scores(finalist: Finalist[Any]) -> str:
    record = finalist.record
    return (
        f'fitness {100 * finalist.fitness:.1f} %: training {100 * record.learning.mean():.1f} %, '
        f'tested {100 * record.test.mean():.1f} % over {record.halves} halves'
    )
