"""An experiment over several seeds: other slides each time, so that means and intervals are over simulations."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t

from texture_benchmarks.papers.experiment import Experiment, ExperimentResult, Run
from texture_benchmarks.papers.interval import Interval
from texture_benchmarks.papers.recipe_digest import digest_of
from texture_benchmarks.papers.report import VERDICTS
from texture_core.errors import InvalidParameter

LEVEL = 0.95
SPLITS = 2  # of a further seed: what differs between seeds are the slides


def over_seeds(run: Run, name: str, experiment: Experiment, count: int) -> ExperimentResult:
    """Run an experiment with so many seeds, and add means and intervals over them to the result of the first.

    The first seed is run as the experiment asks, and written. Each further one is run on at most two splits, without
    our own recipes, and kept in the folder `seeds`. What is there already, with the recipes as they are now, is not run
    again.

    Parameters
    ----------
    run
        Runs the experiment with one seed.
    name
        Name of the experiment.
    experiment
        First seed, folder and options.
    count
        Number of seeds, at least 2.

    Returns
    -------
    ExperimentResult
        That of the first seed, with means and intervals over all.

    Raises
    ------
    InvalidParameter
        If fewer than two seeds are asked for.
    """
    if count < 2:
        raise InvalidParameter(f'{count} seeds were asked for; two or more are needed for an interval over seeds')
    first = _first(run, name, experiment)
    further = replace(experiment, splits=SPLITS, papers_only=True, tune=False)
    others = [_kept(run, name, replace(further, seed=experiment.seed + number)) for number in range(1, count)]
    numbers = with_seeds(first.numbers, others)
    return replace(first, numbers=numbers, lines=(*first.lines, *lines(numbers)))


def _first(run: Run, name: str, experiment: Experiment) -> ExperimentResult:
    """Return the result of the first seed, as it was written if it was."""
    path = experiment.out / f'{name}.json'
    if path.is_file() and not experiment.quick and not experiment.tune:
        content = json.loads(path.read_text(encoding='utf-8'))
        numbers = content['numbers']
        if numbers.get('seed') == experiment.seed and is_current(numbers):
            texts = {key: content[key] for key in ('name', 'measured', 'data', 'split')}
            return ExperimentResult(**texts, numbers=numbers, charts=tuple(map(Path, content['charts'])))
    result = run(experiment)
    result.write(experiment.out)
    return result


def is_current(numbers: Mapping[str, Any]) -> bool:
    """Return whether numbers are those of the recipes as they are defined now."""
    recipes = numbers.get('recipes', {})
    return bool(recipes) and all(digest_of(recipe) == stored for recipe, stored in recipes.items())


def _kept(run: Run, name: str, experiment: Experiment) -> Mapping[str, Any]:
    """Return the numbers of one further seed, from the folder if they are there."""
    path = experiment.out / 'seeds' / f'{name}-{experiment.seed}{"-reduced" if experiment.quick else ""}.json'
    if path.is_file():
        numbers: Mapping[str, Any] = json.loads(path.read_text(encoding='utf-8'))
        if is_current(numbers):
            return numbers
    with tempfile.TemporaryDirectory() as folder:
        numbers = run(replace(experiment, out=Path(folder))).numbers
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(numbers, ensure_ascii=False) + '\n', encoding='utf-8')
    return numbers


def with_seeds(first: Mapping[str, Any], others: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the numbers of the first seed with mean and interval over all seeds beside each figure and finding."""
    numbers: dict[str, Any] = json.loads(json.dumps(first))
    runs = [numbers, *others]
    numbers['seeds'] = [run['seed'] for run in runs]
    for task, methods in numbers.get('tasks', {}).items():
        for method, figures in methods.items():
            found = [run['tasks'][task][method]['test'][0] for run in runs if method in run['tasks'][task]]
            _add(figures, found)
            for name, part in figures.get('conditions', {}).items():
                same = [run['tasks'][task].get(method, {}).get('conditions', {}).get(name) for run in runs]
                _add(part, [one['test'][0] for one in same if one])
    for regressor, parts in numbers.get('regressors', {}).items():
        for part, figures in parts.items():
            found = [
                run['regressors'][regressor][part]['error']
                for run in runs
                if part in run['regressors'].get(regressor, {})
            ]
            _add(figures, found)
    for finding in numbers['findings']:
        same = [one for run in runs for one in run['findings'] if one['claim'] == finding['claim']]
        _add(finding, [one['interval'][0] for one in same])
        if 'over_seeds' in finding:
            finding['verdict'] = VERDICTS[verdict(Interval(*finding['over_seeds']), reaches=finding['reaches'])]
    return numbers


def verdict(interval: Interval, *, reaches: bool) -> bool | None:
    """Return whether a claim holds; None if the interval does not decide.

    Parameters
    ----------
    interval
        Of what decides.
    reaches
        Whether the claim is that a figure is reached; else it is that the interval lies above 0.
    """
    return interval.high >= 0.0 if reaches else interval.above()


def mean_over_seeds(values: Sequence[float]) -> Interval:
    """Return the mean of one figure of each seed, and the interval of the mean by Student's t, 95 %."""
    array = np.asarray(values, dtype=np.float64)
    centre, n = float(array.mean()), len(array)
    reach = float(t.ppf(0.5 + LEVEL / 2.0, n - 1) * array.std(ddof=1) / np.sqrt(n))
    return Interval(centre, centre - reach, centre + reach)


def lines(numbers: Mapping[str, Any]) -> Iterator[str]:
    """Yield the means over seeds as a table for people."""
    yield f'over {len(numbers["seeds"])} seeds: mean, and its interval of 95 %'
    for name, values in _over_seeds(numbers.get('tasks', {})):
        mean, low, high = (100 * value for value in values)
        yield f'  {name}: {mean:.1f} % ({low:.1f} to {high:.1f})'
    for name, (mean, low, high) in _over_seeds(numbers.get('regressors', {})):
        yield f'  {name}: {mean:.2f} ({low:.2f} to {high:.2f}) grades'
    for finding in numbers['findings']:
        if 'over_seeds' in finding:
            mean, low, high = finding['over_seeds']
            yield f'  {finding["verdict"]:14} {finding["claim"]}: {mean:+.3f} ({low:+.3f} to {high:+.3f})'


def _add(figures: dict[str, Any], found: Sequence[float]) -> None:
    if len(found) > 1:
        figures['by_seed'] = list(found)
        figures['over_seeds'] = mean_over_seeds(found).as_json()


def _over_seeds(groups: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[str, Sequence[float]]]:
    """Yield the name, and mean and interval over seeds, of each member of each group that has them."""
    for group, members in groups.items():
        for member, figures in members.items():
            if 'over_seeds' in figures:
                yield f'{group}, {member}', figures['over_seeds']
