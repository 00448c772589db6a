"""Recipes that a search has found, written as files that `texture train` reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from texture_core.errors import InvalidParameter
from texture_core.files import writing
from texture_estimation.recipe import Recipe
from texture_estimation.search.generation import SearchParams
from texture_estimation.search.joined_pairs import joined_recipe
from texture_estimation.search.optimise import Finalist, SearchResult
from texture_estimation.search.pairs import PairSearchResult, beside
from texture_estimation.search.racing import HalfScores


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
    found: SearchResult[Any] | PairSearchResult, base: Any, tuned: str, params: SearchParams, target: Path
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
    if isinstance(found, PairSearchResult):
        return _with_joined(written, found, base, origin, target)
    return Written((*written.files, checkpoint_of(target)), written.lines)


def _with_joined(written: Written, pairs: PairSearchResult, base: Recipe, origin: str, target: Path) -> Written:
    """Write the recipe that joins those of the pairs, or say why there is none."""
    together = f'all pairs together, most pairs won: {_shares(pairs.record)}'
    try:
        joined = joined_recipe({pair: found.best.recipe for pair, found in pairs.by_pair.items()}, base)
    except InvalidParameter as error:
        return Written(written.files, (*written.lines, together, f'no recipe of all pairs was written: {error}'))
    _write(joined, target, origin, together)
    return Written((target, *written.files), (*written.lines, f'{target}: {together}'))


def _files(found: SearchResult[Any] | PairSearchResult, target: Path, *, front: bool) -> Mapping[Path, Finalist[Any]]:
    if isinstance(found, PairSearchResult):
        return {beside(target, pair): one.best for pair, one in found.by_pair.items()}
    others = [one for one in found.finalists if front and one is not found.best]
    numbered = {target.with_name(f'{target.stem}-{n}{target.suffix}'): one for n, one in enumerate(others, 2)}
    return {target: found.best} | numbered


def _write(recipe: Any, path: Path, origin: str, scores: str) -> None:
    content = yaml.safe_dump(recipe.as_mapping(), sort_keys=False, allow_unicode=True, width=120)
    with writing(path):
        path.write_text(f'# {origin}\n# {scores}.\n{content}', encoding='utf-8')


def _scores(finalist: Finalist[Any]) -> str:
    return f'fitness {100 * finalist.fitness:.1f} %: {_shares(finalist.record)} over {finalist.record.halves} halves'


def _shares(record: HalfScores) -> str:
    return f'training {100 * record.learning.mean():.1f} %, tested {100 * record.test.mean():.1f} %'
