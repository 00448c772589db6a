# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The genetic search of Roberge et al. and Rispal et al.: features and learner, also for each pair of textures."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.config import library, writing, yaml_text
from texture_core.types import AnyArray, Array
from texture_estimation.learners.learner import Codes, log_softmax, standardisation
from texture_estimation.recipe import Recipe
from texture_estimation.roughness import ROUGH, SMOOTH, Grades
from texture_features.feature_set import AGAIN
from texture_papers.roberge import SvmPairs, by_frequency, decided_by_slide, fitted_predictor, pairs_won
from texture_papers.slides import Mask, SlideArrays


@dataclass(frozen=True)
class SearchParams:
    """Size of a search; 20 individuals, 30 generations and 20 halves are the papers'."""

    population: int = 20
    generations: int = 30
    halves: int = 20
    seed: int = 0

    def __str__(self) -> str:
        return f'{self.population} individuals, {self.generations} generations, {self.halves} halves'


QUICK = SearchParams(population=4, generations=2, halves=2)

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
    """Return the recipe, of textures or of roughness, that an individual encodes."""
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
    """Return the accuracies on slides."""
    codes = np.unique(scans.labels, return_inverse=True)[1]
    owner = np.repeat(np.arange(len(codes)), len(values) // len(codes))
    rows = training[owner]
    if isinstance(recipe.learner, SvmPairs) and codes.max() == 1:
        scores = log_softmax(pairs_won(decisions_of_pair(recipe.learner, values, codes[owner], rows)))
    else:
        scores = fitted_predictor(recipe.learner, values[rows], codes[owner[rows]], owner[rows])(values)
    windows = recipe.training_windows
    right = decided_by_slide(scores, len(codes), recipe.evidence, windows.hop_s / windows.length_s) == codes
    return float(right[training].mean()), float(right[~training].mean())


def decisions_of_pair(learner: SvmPairs, X: Array, y: Codes, rows: Mask) -> Array:
    """Return the decisions of the machine of two labels that is trained on some rows, (n, 1), as `SvmPairs` has them.

    The kernel is a product of matrices here, which takes a tenth of the time of libsvm's loop.
    """
    from sklearn import config_context  # noqa: PLC0415  # scikit-learn takes a second to import
    from sklearn.svm import SVC  # noqa: PLC0415

    mean, scale = standardisation(X[rows])
    points = (X - mean) / (scale * learner.kernel_scale)
    squares, one = np.einsum('ij,ij->i', points, points)[:, None], np.ones((len(X), 1))
    # exp(-|a - b|²) with -|a - b|² = 2ab - a² - b² as one product.
    kernel = np.hstack((2.0 * points, -squares, -one)) @ np.hstack((points, one, squares))[rows].T
    np.exp(np.minimum(kernel, 0.0, out=kernel), out=kernel)
    with config_context(assume_finite=True, skip_parameter_validation=True):
        machine = SVC(C=learner.box_constraint, kernel='precomputed').fit(kernel[rows], y[rows])
    weights = np.zeros(kernel.shape[1])
    weights[machine.support_] = machine.dual_coef_[0]
    decided: Array = kernel @ weights + machine.intercept_[0]
    return -decided[:, None]


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


@dataclass(frozen=True)
class Found:
    """The best individual of a search, its mean learning and test score, and the best few: another begins with them."""

    individual: Individual
    learning: float
    test: float
    tried: int
    best: Sequence[Individual] = ()


class Described:
    """The features of scans by the recipes of a search; what several recipes share is computed once."""

    def __init__(self, base: Any, scans: SlideArrays) -> None:
        self.base, self.scans = base, scans
        self._blocks: dict[str, Array] = {}

    def __call__(self, recipe: Any) -> Array:
        """Return the features of a recipe that differs from the base in features and stretch alone."""
        section = recipe.as_mapping()['inputs']['signal']
        stretch = section.get('stretch_to_m_s', 0.0)
        blocks = [self._values(stretch, *entry) for one in section['features'] for entry in one.items()]
        return np.concatenate(blocks, axis=1)

    def _values(self, stretch: float, name: str, parameters: Mapping[str, Any]) -> Array:
        """Return one feature; of peaks the first of the most that are searched for."""
        if name != PEAKS:
            return self._block(stretch, {name: parameters})
        most = max(RANGES['peaks'])
        all_peaks = self._block(stretch, {name: {**parameters, 'peaks': most, 'order': 'intensity'}})
        peaks = all_peaks.reshape(len(all_peaks), -1, most, 2)[:, :, : parameters['peaks']]
        peaks = by_frequency(peaks) if parameters['order'] == 'frequency' else peaks
        return peaks.reshape(len(peaks), -1)

    def _block(self, stretch: float, feature: Mapping[str, Any]) -> Array:
        if (key := str((stretch, feature))) not in self._blocks:
            content = self.base.as_mapping()
            section = {**content['inputs']['signal'], 'stretch_to_m_s': stretch, 'features': [feature]}
            recipe = self.base.from_mapping({**content, 'inputs': {'signal': section}}, self.base.name)
            self._blocks[key] = self.scans.values(recipe)
        return self._blocks[key]


def search(
    base: Any,
    scans: SlideArrays,
    params: SearchParams,
    score: Score = recognition,
    *,
    start: Sequence[Individual] = (),
) -> Found:
    """Return the best individual by the mean of learning and test score over the halves.

    Individuals of another search may be the first.

    Source: Roberge et al., "Textures recognition through tactile exploration", section IV.
    """
    names = variables_of(base.name)
    halves = random_halves(scans.labels, params.halves, params.seed)
    described = Described(base, scans)
    known: dict[tuple[int, ...], Array] = {}

    def individual(point: Sequence[float]) -> dict[str, Any]:
        return {name: RANGES[name][int(number)] for name, number in zip(names, point, strict=True)}

    def scores(point: Sequence[float]) -> Array:
        recipe = varied(base, individual(point))
        values = described(recipe)
        return np.mean([score(recipe, values, scans, half) for half in halves], axis=0)

    begun = [[RANGES[name].index(one[name]) for name in names] for one in start]
    algorithm = _algorithm([len(RANGES[name]) for name in names], params, begun)
    for _ in range(params.generations):
        offspring = algorithm.ask()
        if offspring is None:  # nothing new is left in a small space
            break
        points = [tuple(int(number) for number in point) for point in offspring.get('X')]
        for point in points:
            if point not in known:
                known[point] = scores(point)
        offspring.set('F', np.array([[-known[point].mean()] for point in points]))
        algorithm.tell(infills=offspring)
    best = sorted(known, key=lambda point: (-known[point].mean(), point))[: params.population]
    learning, test = known[best[0]].round(4).tolist()
    return Found(individual(best[0]), learning, test, len(known), [individual(point) for point in best])


def _algorithm(counts: Sequence[int], params: SearchParams, begun: Sequence[Sequence[int]]) -> Any:
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
    drawn = np.floor(np.random.default_rng(params.seed).random((params.population, len(counts))) * counts).astype(int)
    drawn[: len(begun)] = begun[: params.population] or drawn[:0]
    steps = {'eta': 3.0, 'vtype': float, 'repair': RoundingRepair()}
    algorithm = GA(pop_size=params.population, sampling=drawn, crossover=SBX(prob=0.9, **steps),
                   mutation=PM(**steps), eliminate_duplicates=True)  # fmt: skip
    problem = Problem(n_var=len(counts), n_obj=1, xl=0, xu=np.array(counts) - 1, vtype=int)
    algorithm.setup(problem, termination=NoTermination(), seed=params.seed)
    return algorithm


@dataclass(frozen=True, eq=False)
class Tuned:
    """A recipe that was searched for, with one set of variables or one for each pair."""

    recipe: Any
    params: SearchParams
    found: Mapping[str, Found]  # by pair, such as 'cork / felt'; by '' for all textures
    scans: int

    def as_json(self) -> dict[str, Any]:
        """Return size, and scores and variables of each pair."""
        found = {
            pair: {'learning': one.learning, 'test': one.test, 'tried': one.tried, 'variables': dict(one.individual)}
            for pair, one in self.found.items()
        }
        return {'size': str(self.params), 'scans': self.scans, 'found': found}

    def write(self, path: Path) -> Path:
        """Write the recipe as a file that `texture train` reads, the size of the search at its top; return its path."""
        text = yaml_text(self.recipe.as_mapping())
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(
                f'# Found by a search of {self.params}, seed {self.params.seed}, on {self.scans} scans.\n{text}'
            )
        return path


def tuned_pairs(base: Any, params: SearchParams, found: Mapping[tuple[str, ...], Found], scans: int) -> Tuned:
    """Return the recipe in which each pair of textures has the variables that were found for it."""
    recipes = {pair: varied(base, one.individual) for pair, one in found.items()}
    return Tuned(joined_recipe(recipes, base), params, {' / '.join(pair): one for pair, one in found.items()}, scans)


def joined_recipe(recipes: Mapping[tuple[str, ...], Recipe], base: Recipe) -> Recipe:
    """Return the recipe of one model in which each pair of textures has the features and the learner of its recipe.

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
    about = f'{base.description} Each pair with separate variables.'.strip()
    return Recipe.from_mapping({**shared, 'description': about, 'inputs': inputs, 'learner': learner},
                               f'{base.name}-pairs')  # fmt: skip
