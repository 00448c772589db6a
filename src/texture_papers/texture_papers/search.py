# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The genetic search of Roberge et al. and Rispal et al.: features and learner, for each pair of textures too."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from texture_core.config import library, writing
from texture_core.errors import InvalidParameter
from texture_core.types import AnyArray, Array
from texture_estimation.recipe import Recipe
from texture_estimation.roughness import ROUGH, SMOOTH, Grades
from texture_features.feature_set import AGAIN
from texture_papers.roberge import decided_by_slide, fitted_predictor
from texture_papers.slides import Mask, SlideArrays


@dataclass(frozen=True)
class SearchParams:
    """Size of a search; 20 individuals, 30 generations and 20 halves are the papers'."""

    population: int = 20
    generations: int = 30
    halves: int = 20
    search_halves: int = 4  # of the halves, those on which each individual is scored; the finalists on all
    finalists: int = 3
    seed: int = 0

    def __post_init__(self) -> None:
        low = {'population': 4, 'generations': 1, 'halves': 2}
        for name, least in low.items():
            if (value := getattr(self, name)) < least:
                raise InvalidParameter(f'{name} of a search is {value}; it is at least {least}')

    def __str__(self) -> str:
        few = min(self.search_halves, self.halves)
        return f'{self.population} individuals, {self.generations} generations, {few} of {self.halves} halves'


QUICK = SearchParams(population=4, generations=2, halves=2, finalists=1)

# What is varied: Roberge et al., section IV; Rispal et al., section IV.D. Box constraint and kernel scale have 20
# values a decade: finer ones are not distinguished by accuracy.
RANGES: Mapping[str, tuple[Any, ...]] = {
    'peaks': tuple(range(2, 16)),
    'gap_hz': tuple(float(gap) for gap in range(5, 51)),
    'order': ('frequency', 'intensity'),
    'signal_energy': (False, True),
    'arc_length': (False, True),
    'speed': ('unused', 'input', 'stretch'),
    'force': (False, True),
    'hidden': tuple(range(5, 51)),
    'box': tuple(float(f'{value:.4g}') for value in np.geomspace(0.01, 10.0, 61)),
    'kernel_scale': tuple(float(f'{value:.4g}') for value in np.geomspace(1e-5, 1e5, 201)),
}
PEAKS = 'texture_papers.roberge:SpectralPeaks'
USED = {'signal_energy': 'texture_papers.roberge:SignalEnergy', 'arc_length': 'texture_papers.roberge:ArcLength',
        'force': 'force'}  # fmt: skip
STRETCH_M_S = 0.15  # the middle one of the speeds
OF_PEAKS = ('peaks', 'gap_hz', 'order', 'signal_energy', 'arc_length')
MOTIONS = {'ets-linear': (*OF_PEAKS, 'speed', 'force'), 'ets-circular': OF_PEAKS, 'ets-fine': OF_PEAKS,
           'ets-roughness': OF_PEAKS}  # fmt: skip
Individual = Mapping[str, Any]  # value by variable
HalfScore = tuple[float, float]  # on what was trained, and on what was not


def variables_of(recipe: str) -> tuple[str, ...]:
    """Return the names of what the paper of a recipe varies; () if it searches for nothing."""
    motion = next((name for name in MOTIONS if recipe.startswith(name)), None)
    if motion is None or 'pairs' in recipe:
        return ()
    return (*MOTIONS[motion], *(('hidden',) if '-ann' in recipe else ('box', 'kernel_scale')))


def varied(base: Any, individual: Individual) -> Any:
    """Return the recipe, of textures or of roughness, that an individual stands for."""
    content = copy.deepcopy(base.as_mapping())
    section = content['inputs']['signal']
    names = (PEAKS, 'speed', *USED.values())
    kept = [one for one in section['features'] if next(iter(one)) not in names]
    [points] = [one[PEAKS]['points'] for one in section['features'] if PEAKS in one]
    peaks = {name: individual[name] for name in ('peaks', 'gap_hz', 'order')}
    chosen = [feature for name, feature in USED.items() if individual.get(name)]
    chosen += ['speed'] if individual.get('speed') == 'input' else []
    section['features'] = [{PEAKS: {**peaks, 'points': points}}, *({name: {}} for name in chosen), *kept]
    section['stretch_to_m_s'] = STRETCH_M_S if individual.get('speed') == 'stretch' else 0.0
    [learner] = content['learner' if isinstance(base, Recipe) else 'regressor'].values()
    box = 'box_constraint' if 'box_constraint' in learner else 'c'
    renamed = {'hidden': 'hidden', 'box': box, 'kernel_scale': 'kernel_scale'}
    learner.update({renamed[name]: value for name, value in individual.items() if name in renamed})
    return base.from_mapping(content, base.name)


def random_halves(labels: AnyArray, count: int, seed: int) -> Mask:
    """Return which scans are trained on in each of `count` halves of each label, (count, n).

    Source: Roberge et al., "Textures recognition through tactile exploration", section IV.
    """
    halves = np.zeros((count, len(labels)), dtype=bool)
    rng = np.random.default_rng(seed)
    for half in halves:
        for label in np.unique(labels):
            rows = rng.permutation(np.flatnonzero(labels == label))
            half[rows[: len(rows) // 2]] = True
    return halves


# Learning and test score of a recipe, whose features of all windows are (n, n_features), on one half of the scans.
Score = Callable[[Any, Array, SlideArrays, Mask], HalfScore]


def recognition(recipe: Any, values: Array, scans: SlideArrays, training: Mask) -> HalfScore:
    """Return the shares of slides that are recognised."""
    codes = np.unique(scans.labels, return_inverse=True)[1]
    owner = np.repeat(np.arange(len(codes)), len(values) // len(codes))
    rows = training[owner]
    predictor = fitted_predictor(recipe.learner, values[rows], codes[owner[rows]], owner[rows])
    windows = recipe.training_windows
    right = decided_by_slide(predictor(values), len(codes), recipe.evidence, windows.hop_s / windows.length_s) == codes
    return float(right[training].mean()), float(right[~training].mean())


def grading(grades: Grades) -> Score:
    """Return what scores 1 for the grade that people gave, a quarter less for each grade off, and 0 for no grade.

    The paper has "the results of learning and testing" and does not give what a missing grade counts.
    """

    def score(recipe: Any, values: Array, scans: SlideArrays, training: Mask) -> HalfScore:
        codes = np.unique(scans.labels, return_inverse=True)[1]
        true = np.array([grades.of(name) for name in scans.labels])
        predictor = recipe.regressor.predictor(recipe.regressor.fit(values[training], true[training], codes[training]))
        errors = np.abs(np.nan_to_num(predictor(values)[0], nan=np.inf) - true)
        near = 1.0 - np.minimum(errors, ROUGH - SMOOTH) / (ROUGH - SMOOTH)
        return float(near[training].mean()), float(near[~training].mean())

    return score


@dataclass(frozen=True, eq=False)
class Found:
    """The best individual of a search, its recipe, and mean learning and test score over all halves."""

    recipe: Any
    individual: Individual
    learning: float
    test: float
    tried: int

    def as_json(self) -> dict[str, Any]:
        """Return scores and variables."""
        scores = {'learning': round(self.learning, 4), 'test': round(self.test, 4)}
        return {**scores, 'tried': self.tried, 'variables': dict(self.individual)}


def search(base: Any, scans: SlideArrays, params: SearchParams, score: Score = recognition) -> Found:
    """Return the best recipe; the fitness is the mean of learning and test score over some of the halves.

    Source: Roberge et al., "Textures recognition through tactile exploration", section IV.
    """
    names = variables_of(base.name)
    halves = random_halves(scans.labels, params.halves, params.seed)
    known: dict[tuple[int, ...], float] = {}

    def individual(point: Sequence[float]) -> Individual:
        return {name: RANGES[name][int(number)] for name, number in zip(names, point, strict=True)}

    def scores(point: Sequence[float], count: int) -> Array:
        recipe = varied(base, individual(point))
        values = scans.values(recipe)
        return np.array([score(recipe, values, scans, half) for half in halves[:count]])

    algorithm = _algorithm([len(RANGES[name]) for name in names], params)
    for _ in range(params.generations):
        offspring = algorithm.ask()
        if offspring is None:  # nothing new is left in a small space
            break
        points = [tuple(int(number) for number in point) for point in offspring.get('X')]
        for point in points:
            if point not in known:
                known[point] = float(scores(point, min(params.search_halves, params.halves)).mean())
        offspring.set('F', np.array([[-known[point]] for point in points]))
        algorithm.tell(infills=offspring)
    finalists = sorted(known, key=lambda point: (-known[point], point))[: params.finalists]
    on_all = {point: scores(point, params.halves).mean(axis=0) for point in finalists}
    best = max(finalists, key=lambda point: float(on_all[point].mean()))
    learning, test = on_all[best].tolist()
    return Found(varied(base, individual(best)), individual(best), learning, test, len(known))


def _algorithm(counts: Sequence[int], params: SearchParams) -> Any:
    """Return pymoo's genetic algorithm over numbers of values; low indices make wide steps, as few values need."""
    library('pymoo', 'searches', 'search')
    from pymoo.algorithms.soo.nonconvex.ga import GA  # noqa: PLC0415
    from pymoo.config import Config  # noqa: PLC0415
    from pymoo.core.problem import Problem  # noqa: PLC0415
    from pymoo.core.termination import NoTermination  # noqa: PLC0415
    from pymoo.operators.crossover.sbx import SBX  # noqa: PLC0415
    from pymoo.operators.mutation.pm import PM  # noqa: PLC0415
    from pymoo.operators.repair.rounding import RoundingRepair  # noqa: PLC0415

    Config.warnings['not_compiled'] = False  # its compiled parts would save nothing here
    drawn = np.floor(np.random.default_rng(params.seed).random((params.population, len(counts))) * counts)
    steps = {'eta': 3.0, 'vtype': float, 'repair': RoundingRepair()}
    algorithm = GA(pop_size=params.population, sampling=drawn.astype(int), crossover=SBX(prob=0.9, **steps),
                   mutation=PM(**steps), eliminate_duplicates=True)  # fmt: skip
    problem = Problem(n_var=len(counts), n_obj=1, xl=0, xu=np.array(counts) - 1, vtype=int)
    algorithm.setup(problem, termination=NoTermination(), seed=params.seed)
    return algorithm


@dataclass(frozen=True, eq=False)
class Tuned:
    """A recipe that was searched for, with one set of variables or one for each pair, and what it took."""

    recipe: Any
    params: SearchParams
    found: Mapping[str, Found]  # by pair, such as 'cork / felt'; by '' for all textures
    seconds: float
    scans: int

    def as_json(self) -> dict[str, Any]:
        """Return size, time, and scores and variables of each pair."""
        size = {'size': str(self.params), 'scans': self.scans, 'seconds': round(self.seconds, 1)}
        return {**size, 'found': {pair: one.as_json() for pair, one in self.found.items()}}

    def write(self, path: Path) -> Path:
        """Write the recipe as a file that `texture train` reads, the size of the search at its top; return its path."""
        text = yaml.safe_dump(self.recipe.as_mapping(), sort_keys=False, allow_unicode=True, width=120)
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(
                f'# Found by a search of {self.params}, seed {self.params.seed}, on {self.scans} scans.\n{text}'
            )
        return path


def tune(base: Any, scans: SlideArrays, params: SearchParams, score: Score | None = None) -> Tuned:
    """Search for one set of variables by a score; without one, for a set for each pair of textures, then joined."""
    began = time.perf_counter()
    if score is not None:
        found = {'': search(base, scans, params, score)}
        return Tuned(found[''].recipe, params, found, time.perf_counter() - began, len(scans.labels))
    pairs = list(combinations(np.unique(scans.labels).tolist(), 2))
    found = {' / '.join(pair): search(base, scans.of(np.isin(scans.labels, pair)), params) for pair in pairs}
    recipe = joined_recipe({pair: found[' / '.join(pair)].recipe for pair in pairs}, base)
    return Tuned(recipe, params, found, time.perf_counter() - began, len(scans.labels))


def joined_recipe(recipes: Mapping[tuple[str, ...], Recipe], base: Recipe) -> Recipe:
    """Return the recipe of one model in which each pair of textures has the features and the learner of its own recipe.

    Each input of a pair's recipe becomes one of the joined recipe, 'signal#1' and so on; equal ones are shared.
    """
    inputs: dict[str, Any] = {}
    pairs = []
    for pair, recipe in recipes.items():
        content = recipe.as_mapping()
        section = content['inputs']['signal']
        name = next((one for one, known in inputs.items() if known == section), f'signal{AGAIN}{len(inputs) + 1}')
        inputs[name] = section
        pairs.append({'pair': list(pair), 'inputs': [name], 'learner': content['learner']})
    shared = base.as_mapping()
    learner = {'texture_papers.roberge:TunedPairs': {'learner': shared['learner'], 'pairs': pairs}}
    about = f'{base.description} Each pair with variables of its own.'.strip()
    return Recipe.from_mapping({**shared, 'description': about, 'inputs': inputs, 'learner': learner},
                               f'{base.name}-pairs')  # fmt: skip
