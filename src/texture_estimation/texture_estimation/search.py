# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Genetic search of a recipe's parameters: what is varied, how an individual is evaluated, what is found.

As Roberge et al. do it: 20 individuals, 30 generations; the fitness is the mean of learning and test accuracy over
random halves of the slides. pymoo provides the algorithm, joblib the cores.
"""

from __future__ import annotations

import copy
import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from texture_core.config import (
    MB,
    find,
    find_file,
    library,
    load_json,
    load_yaml,
    param,
    safe_repr,
    shipped,
    writing,
)
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import Array
from texture_estimation.evidence_rules import EvidenceRule, MajorityVote, followed
from texture_estimation.learners.learner import Codes, log_softmax
from texture_estimation.model import replace_file
from texture_estimation.recipe import Recipe, check_keys
from texture_estimation.roughness import LEVEL, ROUGH, SMOOTH, STICK_SLIP, Grades, RoughnessRecipe
from texture_features.feature_set import FeatureSet
from texture_features.windows import CutWindow, WindowBatch, WindowEvent, WindowParams

Mask = NDArray[np.bool_]

# --------------------
# Slides of known surfaces as windows, not yet described: the features are what an individual varies.

CHUNK = 64  # windows described in one go: what they and their spectra take should fit the processor's cache


@dataclass(frozen=True, eq=False)
class LabelledWindows:
    """Windows of labelled slides, all of one rate and length in each input."""

    inputs: Mapping[str, WindowBatch]
    labels: NDArray[np.str_]
    groups: NDArray[np.str_]

    @classmethod
    def from_events(cls, events: Iterable[WindowEvent], topics: Sequence[str]) -> LabelledWindows:
        """Stack the windows of labelled slides."""
        cut = [event for event in events if isinstance(event, CutWindow) and event.surface]
        if not cut:
            raise InvalidData('there is no window of a labelled surface; record slides with a surface named')
        speed, force = (np.array([getattr(event, name) for event in cut]) for name in ('speed_m_s', 'force_n'))
        inputs = {}
        for topic in topics:
            windows = [event.windows[topic] for event in cut]
            kinds = {(item.rate_hz, item.samples.shape, item.channels) for item in windows}
            if len(kinds) > 1:
                raise InvalidData(
                    f"the windows of '{topic}' differ in rate, length or channels: "
                    f'{sorted(str(kind) for kind in kinds)}; use slides of one sensor'
                )
            samples = np.stack([item.samples for item in windows])
            inputs[topic] = WindowBatch(samples, windows[0].rate_hz, speed, force, channels=windows[0].channels)
        return cls(inputs, np.array([e.surface for e in cut]), np.array([e.exploration_id for e in cut]))

    def rows(self, chosen: Mask) -> LabelledWindows:
        """Return some of the windows; `chosen` is (n,)."""
        inputs = {topic: _rows(item, chosen) for topic, item in self.inputs.items()}
        return LabelledWindows(inputs, self.labels[chosen], self.groups[chosen])

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The surfaces, in the order of their numbers."""
        return tuple(np.unique(self.labels).tolist())

    @cached_property
    def codes(self) -> Codes:
        """Number of each window's surface, (n,)."""
        return np.asarray(np.unique(self.labels, return_inverse=True)[1]).reshape(-1)

    @cached_property
    def slides(self) -> Codes:
        """Number of each window's slide, (n,)."""
        return np.asarray(np.unique(self.groups, return_inverse=True)[1]).reshape(-1)

    def values(self, features: FeatureSet) -> Array:
        """Return the features of each window, (n, n_features)."""
        parts = (slice(start, start + CHUNK) for start in range(0, len(self.labels), CHUNK))
        inputs = [self.inputs[name] for name in features.window_names]
        values = np.concatenate([features.values([_rows(item, part) for item in inputs]) for part in parts])
        if not np.isfinite(values).all():
            named = ', '.join(name for item in features.inputs for name, _ in item.features)
            raise InvalidData(f'a feature is not finite in some windows; leave it out of the search (of {named})')
        return values


def _rows(windows: WindowBatch, rows: Mask | slice) -> WindowBatch:
    """Return some windows of a batch."""
    speed, force = windows.speed_m_s[rows], windows.force_n[rows]
    return WindowBatch(windows.samples[rows], windows.rate_hz, speed, force, channels=windows.channels)


# Cuts the windows that a recipe asks for; called with equal parameters, it should answer with the same object.
Cut = Callable[[WindowParams], LabelledWindows]

# --------------------
# Random halves of the slides: one for training, one to test on.


def random_halves(codes: Codes, groups: Codes, count: int, rng: np.random.Generator) -> Mask:
    """Return which examples are used for training in each of `count` splits, (count, n).

    Half of the slides of each label, rounded down, are used for training; all windows of a slide are on one side.

    Source: Roberge et al., "Textures recognition through tactile exploration", section IV.
    """
    slides, first = np.unique(groups, return_index=True)
    of_label = [slides[codes[first] == code] for code in np.unique(codes)]
    fewest = min(map(len, of_label))
    if fewest < 2:
        raise InvalidData(
            f'a surface has {fewest} slides; two at least are needed, one for training and one to test on'
        )
    halves = np.zeros((count, len(codes)), dtype=bool)
    for mask in halves:
        training = [rng.permutation(members)[: len(members) // 2] for members in of_label]
        mask[:] = np.isin(groups, np.concatenate(training))
    return halves


@dataclass(frozen=True, eq=False)
class SearchSlides:
    """Windows and halves of the same slides, however the windows are cut."""

    cut: Cut
    n_halves: int = 20
    seed: int = 0
    labels: tuple[str, ...] = ()
    _known: dict[WindowParams, tuple[LabelledWindows, Mask]] = field(default_factory=dict, repr=False)

    def split(self, windows: WindowParams) -> tuple[LabelledWindows, Mask]:
        """Return the windows, and which of them are used for training in each half, (n_halves, n)."""
        if windows not in self._known:
            examples = self.cut(windows)
            halves = random_halves(examples.codes, examples.slides, self.n_halves, np.random.default_rng(self.seed))
            if self.labels:
                chosen = np.isin(examples.labels, self.labels)
                examples, halves = examples.rows(chosen), halves[:, chosen]
            self._known[windows] = (examples, halves)
        return self._known[windows]


# --------------------
# How well an individual does: shares of right decisions on what was trained and on what was not.

UNDECIDED = -1
HalfScore = tuple[float, float]  # learning and test score of one half


def fitness(scores: Sequence[HalfScore]) -> float:
    """Return the mean of learning and test accuracy over all halves.

    Source: Roberge et al., "Textures recognition through tactile exploration", section IV.
    """
    return float(np.mean(scores))


def decisions(scores: Array) -> Codes:
    """Return the label with the highest score, (n,) of (n, n_labels); UNDECIDED where several share it."""
    best = scores.max(axis=1, keepdims=True)
    chosen: Codes = scores.argmax(axis=1)
    chosen[(scores == best).sum(axis=1) > 1] = UNDECIDED
    return chosen


def shares_right(decided: Codes, codes: Codes, training: Mask) -> HalfScore:
    """Return the shares of right decisions among the training and among the other examples; undecided is not right."""
    right = decided == codes
    return float(right[training].mean()), float(right[~training].mean())


def decided_by_slide(scores: Array, slides: Codes, rule: EvidenceRule, hop_share: float) -> tuple[Codes, Codes]:
    """Return what each slide is taken for by all its windows, (n_slides,), and the row of its first window."""
    evidence = rule.window_evidence(log_softmax(scores))
    first = np.unique(slides, return_index=True)[1]
    ends = [followed(rule, evidence[slides == slides[row]], min(hop_share, 1.0)) for row in first]
    posteriors = [rule.log_posterior(means[-1], counts[-1], 1.0) for means, counts in ends]
    return decisions(np.stack(posteriors)), first


def nearness(grades: Array, true: Array) -> Array:
    """Return 1 - |error| / 4 of each grade, (n,); 0 for NaN, which is no grade."""
    worst = ROUGH - SMOOTH
    return 1.0 - np.minimum(np.abs(np.nan_to_num(grades, nan=np.inf) - true), worst) / worst


@dataclass(frozen=True, eq=False)
class Trial:
    """A recipe on the halves of some windows; plain data that may travel to another machine.

    `task` says what is learned; `values` are (n, n_features), `codes` and `slides` (n,), `halves` (n_halves, n).
    """

    task: ClassificationTask | RoughnessTask
    recipe: Any
    values: Array
    names: tuple[str, ...]
    codes: Codes
    slides: Codes
    halves: Mask

    def __call__(self, number: int) -> HalfScore:
        """Return learning and test score on a half."""
        return self.task.score(self, self.halves[number])


@dataclass(frozen=True)
class ClassificationTask:
    """Surfaces are told apart. Right windows count; with a majority vote, whose windows are parts, right slides."""

    def features(self, recipe: Recipe) -> FeatureSet:
        """Return the features with the windows that `train` is trained on."""
        return replace(recipe.feature_set, windows=recipe.training_windows, _layouts={})

    def score(self, trial: Trial, training: Mask) -> HalfScore:
        """Fit the learner to a half as `train` would, and return learning and test accuracy."""
        recipe, windows = trial.recipe, trial.recipe.training_windows
        fitted = recipe.learner.fit(trial.values[training], trial.codes[training], trial.slides[training])
        scores = recipe.learner.predictor(fitted.parameters)(trial.values)
        if isinstance(recipe.evidence, MajorityVote):
            decided, first = decided_by_slide(scores, trial.slides, recipe.evidence, windows.hop_s / windows.length_s)
            return shares_right(decided, trial.codes[first], training[first])
        return shares_right(decisions(scores), trial.codes, training)


@dataclass(frozen=True)
class RoughnessTask:
    """Roughness is graded. The score is 1 for the grade that people gave, and a quarter less for each grade off.

    The paper says that its search takes "the results of learning and testing", which it tells as errors, and does not
    say what a missing grade counts: 0 here.
    """

    grades: Grades

    def features(self, recipe: RoughnessRecipe) -> FeatureSet:
        """Return the features of the regressor, without those of the checks, with the training windows."""
        inputs = tuple(
            replace(item, features=tuple(one for one in item.features if one[0] not in (STICK_SLIP, LEVEL)))
            for item in recipe.feature_set.inputs
        )
        kept = tuple(item for item in inputs if item.features)
        return replace(recipe.feature_set, inputs=kept, windows=recipe.training_windows, _layouts={})

    def score(self, trial: Trial, training: Mask) -> HalfScore:
        """Fit the regressor to a half as `train` would, and return how near its grades come."""
        regressor = trial.recipe.regressor
        true = np.array([self.grades.of(name) for name in trial.names])[trial.codes]
        parameters = regressor.fit(trial.values[training], true[training], trial.codes[training])
        near = nearness(regressor.predictor(parameters)(trial.values)[0], true)
        return float(near[training].mean()), float(near[~training].mean())


# --------------------
# Which parts of a recipe a search varies: a table in YAML, and the recipes that individuals stand for.

Value = int | float | str
Individual = tuple[Value, ...]  # one value for each variable, in the order of the space
PER_DECADE = 20  # values of a logarithmic range: nobody tells 1.00 from 1.01 of a box constraint by its accuracy
MAX_INCLUDES, MAX_VALUES = 10, 100_000
KEYS = ('description', 'include', 'variables', 'recipes', 'pairs_of', 'learners')  # the last three: whom it belongs to
PACKAGE, FOLDER = 'texture_estimation', 'config/search'


Change = tuple[str, tuple[str, ...], Any]  # what is done, where, and with which value


def change_recipe(recipe: dict[str, Any], action: str, path: tuple[str, ...], value: Any = None) -> None:
    """Change a recipe written as mappings and lists: 'set' a value at a path, or 'use' or 'drop' a feature there."""
    place: Any = _place_in(recipe, path[:-1], path)
    last = path[-1]
    if action == 'set':
        whole = isinstance(place.get(last), float) and isinstance(value, int)
        place[last] = float(value) if whole else value
        return
    position = next((index for index, entry in enumerate(place) if last in entry), None)
    if action == 'use' and position is None:
        place.append({last: dict(value or {})})
    elif action == 'drop' and position is not None:
        del place[position]


def _place_in(content: Any, way: Sequence[str], path: Sequence[str]) -> Any:
    """Return what stands in a recipe along keys and names of features."""
    for step in way:
        if isinstance(content, list):
            content = next((entry for entry in content if step in entry), {})
        if not isinstance(content, Mapping) or step not in content:
            raise InvalidParameter(
                f"the recipe has no '{'/'.join(path)}', which the search varies ('{step}' is not there); "
                'add it to the recipe, or give a search space that fits with --search'
            )
        content = content[step]
    return content


@dataclass(frozen=True)
class Axis:
    """A variable: its values in an order, and what each does to a recipe."""

    values: tuple[Value, ...]
    path: tuple[str, ...] = ()
    edits: Mapping[str, tuple[Change, ...]] | None = None

    def edits_for(self, value: Value) -> tuple[Change, ...]:
        """Return the changes that a value stands for."""
        return (('set', self.path, value),) if self.edits is None else self.edits[str(value)]


@dataclass(frozen=True)
class RecipeSpace:
    """The variables of a recipe, of textures or of roughness."""

    base: Any
    axes: Mapping[str, Axis]

    @classmethod
    def load(cls, name_or_path: str, base: Any) -> RecipeSpace:
        """Read a table of variables, by the name of a shipped one or by path."""
        space = cls(base, _read(name_or_path))
        if not space.axes:
            raise InvalidParameter(f"search space '{name_or_path}' has no variables; name one at least")
        space.recipe(tuple(axis.values[0] for axis in space.axes.values()))  # refused now, not amid a search
        return space

    def individual(self, numbers: Iterable[float]) -> Individual:
        """Return the individual with the value of that number for each variable."""
        return tuple(axis.values[int(n)] for axis, n in zip(self.axes.values(), numbers, strict=True))

    def recipe(self, individual: Individual) -> Any:
        """Return the recipe that an individual stands for."""
        content = copy.deepcopy(self.base.as_mapping())
        for axis, value in zip(self.axes.values(), individual, strict=True):
            for change in axis.edits_for(value):
                change_recipe(content, *change)
        return self.base.from_mapping(content, self.base.name)

    def of_base(self) -> list[int]:
        """Return the number of each variable's value that is nearest to the recipe itself."""
        content = self.base.as_mapping()
        return [self._nearest(axis, content) for axis in self.axes.values()]

    def _nearest(self, axis: Axis, content: Mapping[str, Any]) -> int:
        if axis.edits is not None:
            same = (self._changes_nothing(edits, content) for edits in axis.edits.values())
            return next((number for number, found in enumerate(same) if found), 0)
        value = _place_in(content, axis.path, axis.path)
        if value in axis.values:
            return axis.values.index(value)
        numbers = all(isinstance(one, int | float) for one in (value, *axis.values))
        return int(np.abs(np.array(axis.values) - value).argmin()) if numbers else 0

    def _changes_nothing(self, edits: Sequence[Change], content: Mapping[str, Any]) -> bool:
        changed = copy.deepcopy(dict(content))
        for change in edits:
            change_recipe(changed, *change)
        return bool(self.base.from_mapping(changed, '').as_mapping() == content)


def space_for(key: str, name: str) -> str | None:
    """Return the name of the shipped search space that lists a name under `key`; None if none does."""
    spaces = shipped(PACKAGE, FOLDER)
    return next((stem for stem, path in spaces.items() if name in load_yaml(path, 'search space').get(key, ())), None)


def _read(name_or_path: str, depth: int = 0) -> dict[str, Axis]:
    path = find_file(name_or_path, PACKAGE, FOLDER, 'search space')
    content = load_yaml(path, 'search space')
    if not isinstance(content, Mapping):
        raise InvalidParameter(f"search space '{path}' holds no mapping; 'variables' is needed")
    check_keys(content, KEYS, f"search space '{path}'")
    included, variables = content.get('include') or [], content.get('variables') or {}
    if not isinstance(included, list) or not isinstance(variables, Mapping) or depth > MAX_INCLUDES:
        raise InvalidParameter(
            f"search space '{path}': 'include' is a list, at most {MAX_INCLUDES} deep, and 'variables' a mapping"
        )
    axes: dict[str, Axis] = {}
    for other in included:
        axes.update(_read(str(other), depth + 1))
    for name, entry in variables.items():
        axes[str(name)] = _axis(entry, f"search space '{path.stem}', variable '{name}'")
    return axes


def _axis(entry: Any, where: str) -> Axis:
    if not isinstance(entry, Mapping) or 'kind' not in entry:
        raise InvalidParameter(
            f"{where}: came {safe_repr(entry)}; a mapping with 'kind' ({', '.join(KINDS)}) is needed"
        )
    try:
        axis = find(KINDS, str(entry['kind']), 'kind of variable')(entry)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InvalidParameter(f'{where}: {dict(entry)} cannot be used ({type(error).__name__}: {error})') from error
    except InvalidParameter as error:
        raise InvalidParameter(f'{where}: {error}') from error
    if not axis.values or len(set(axis.values)) < len(axis.values):
        raise InvalidParameter(f'{where}: the values are {list(axis.values)[:9]}; name each once, and one at least')
    return axis


def _integer(entry: Mapping[str, Any]) -> Axis:
    low, high = (int(value) for value in _range(int(entry['low']), int(entry['high'])))
    if high - low >= MAX_VALUES:
        raise InvalidParameter(f'a range goes from {low} to {high}; at most {MAX_VALUES} values are allowed')
    return Axis(tuple(range(low, high + 1)), _path(entry['set']))


def _log(entry: Mapping[str, Any]) -> Axis:
    low, high = _range(float(entry['low']), float(entry['high']))
    if not (low > 0 and high / low < math.inf):
        raise InvalidParameter(f'a logarithmic range is {low} to {high}; it must start above 0 and end')
    values = np.geomspace(low, high, round(math.log10(high / low) * PER_DECADE) + 1)
    return Axis(tuple(float(f'{value:.4g}') for value in values), _path(entry['set']))


def _choice(entry: Mapping[str, Any]) -> Axis:
    options = entry['options']
    if not isinstance(options, Mapping):
        return Axis(tuple(map(str, options)), _path(entry['set']))
    edits = {str(option): tuple(map(_edit, steps or ())) for option, steps in options.items()}
    return Axis(tuple(edits), edits=edits)


def _use(entry: Mapping[str, Any]) -> Axis:
    path = _path(entry['feature'])
    return Axis(('no', 'yes'), edits={'no': (('drop', path, None),), 'yes': (('use', path, None),)})


def _edit(step: Mapping[str, Any]) -> Change:
    [(action, path)] = [(key, value) for key, value in step.items() if key != 'to']
    find(dict.fromkeys(('set', 'use', 'drop')), str(action), 'change of a recipe')
    return str(action), _path(path), step.get('to')


def _path(text: Any) -> tuple[str, ...]:
    return tuple(str(text).split('/'))


def _range(low: float, high: float) -> tuple[float, float]:
    if not low < high:
        raise InvalidParameter(f'a range goes from {low} to {high}; the first must be the smaller')
    return low, high


KINDS: Mapping[str, Callable[[Mapping[str, Any]], Axis]] = {
    'integer': _integer,
    'log': _log,
    'choice': _choice,
    'use': _use,
}


# --------------------
# The search itself, and the file in which its scores are kept.

WIDTH_INDEX = 3.0  # of crossover and mutation: low indices make wide steps, which variables of few values need
CROSSOVER_SHARE = 0.9
MAX_BYTES = 50 * MB  # of a checkpoint; a search of 10 000 individuals writes 10


@dataclass(frozen=True)
class SearchParams:
    """How long and for what is searched; population and generations are those of Roberge et al."""

    population: int = param(
        20, 'Number of individuals in a generation; more search wider and take longer.', low=4, high=1000
    )
    generations: int = param(
        30, 'Number of generations, including the first one; more search longer.', low=1, high=10_000
    )
    halves: int = param(20, 'Number of random half splits on which the finalists are evaluated.', low=2, high=1000)
    search_halves: int = param(
        4, 'Number of these half splits on which each individual is evaluated during the search.', low=1, high=1000
    )
    seed: int = param(0, 'Seed of the random half splits and of the search; equal seeds give equal results.', low=0)
    finalists: int = param(3, 'Number of best individuals that are evaluated on all half splits.', low=1, high=1000)


@dataclass(frozen=True)
class Generation:
    """What is reported after each generation: its number of how many, the best alive, and how many were tried.

    `evaluated` counts without what a checkpoint knew.
    """

    number: int
    of: int
    best: Individual
    fitness: float  # of the best; larger is better
    tried: int
    evaluated: int


@dataclass(frozen=True, eq=False)
class Finalist:
    """A recipe evaluated on every half: its fitness in the search, and learning and test score of each half."""

    recipe: Any
    individual: Individual
    searched: float
    scores: tuple[HalfScore, ...]

    @property
    def fitness(self) -> float:
        """Mean of learning and test score over all halves."""
        return fitness(self.scores)


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The best of the search, best first, and one entry a generation."""

    finalists: tuple[Finalist, ...]
    history: tuple[Generation, ...]

    @property
    def best(self) -> Finalist:
        """The finalist with the highest fitness."""
        return self.finalists[0]


def _algorithm(space: RecipeSpace, params: SearchParams) -> Any:
    """Return pymoo's algorithm; the recipe itself takes part in the first generation, the others are drawn."""
    library('pymoo', 'searches', 'search')
    from pymoo.algorithms.soo.nonconvex.ga import GA  # noqa: PLC0415
    from pymoo.config import Config  # noqa: PLC0415
    from pymoo.core.problem import Problem  # noqa: PLC0415
    from pymoo.core.repair import Repair  # noqa: PLC0415
    from pymoo.core.termination import NoTermination  # noqa: PLC0415
    from pymoo.operators.crossover.sbx import SBX  # noqa: PLC0415
    from pymoo.operators.mutation.pm import PM  # noqa: PLC0415

    class Snap(Repair):  # type: ignore[misc]
        """Bring points to values of the space, so that equal individuals are known as such."""

        def _do(self, problem: Any, points: Array, **_: Any) -> Array:
            return np.clip(np.rint(points), 0, counts - 1)

    # pymoo's compiled parts would save nothing here, and it prints a notice of their lack.
    Config.warnings['not_compiled'] = False
    counts = np.array([len(axis.values) for axis in space.axes.values()], dtype=np.float64)
    drawn = np.floor(np.random.default_rng(params.seed).random((params.population - 1, len(counts))) * counts)
    algorithm = GA(
        pop_size=params.population,
        sampling=np.vstack([space.of_base(), drawn]),
        crossover=SBX(eta=WIDTH_INDEX, prob=CROSSOVER_SHARE),
        mutation=PM(eta=WIDTH_INDEX),
        repair=Snap(),
        eliminate_duplicates=True,
    )
    # every value has a stretch of length 1, the first and the last one, too
    problem = Problem(n_var=len(counts), n_obj=1, xl=-0.5, xu=counts - 0.5)
    algorithm.setup(problem, termination=NoTermination(), seed=params.seed)
    return algorithm


def optimise(
    space: RecipeSpace,
    slides: SearchSlides,
    params: SearchParams,
    task: ClassificationTask | RoughnessTask,
    *,
    checkpoint: str | Path | None = None,
    resume: str | Path | None = None,
    tell: Callable[[Generation], None] = lambda _: None,
) -> SearchResult:
    """Search the space, then evaluate the best on all halves; within `workers`, on several cores."""
    if (slides.n_halves, slides.seed) != (params.halves, params.seed):
        raise InvalidParameter(
            f'the slides have {slides.n_halves} half splits with seed {slides.seed}, the search asks for '
            f'{params.halves} with seed {params.seed}; give both the same'
        )
    few = min(params.search_halves, params.halves)
    identity = _identity(space, slides, task, params)
    known = read_scores(resume, identity) if resume else {}
    n_read = len(known)
    alive: list[Individual] = []
    history: list[Generation] = []

    def rank(one: Individual) -> tuple[float, str]:
        return known[one], str(one)

    algorithm = _algorithm(space, params)
    for number in range(1, params.generations + 1):
        offspring = algorithm.ask()
        if offspring is None:  # nothing new is left in a small space
            break
        tried = [space.individual(point) for point in offspring.get('X')]
        new = [one for one in dict.fromkeys(tried) if one not in known]
        trials = trials_of(space, slides, task, new)
        known.update(zip(new, map(fitness, _evaluated(trials, few)), strict=True))
        offspring.set('F', np.array([[-known[one]] for one in tried]))
        algorithm.tell(infills=offspring)
        alive = [space.individual(point) for point in algorithm.pop.get('X')]
        best = max(alive, key=rank)
        history.append(Generation(number, params.generations, best, known[best], len(known), len(known) - n_read))
        if checkpoint:
            write_scores(checkpoint, identity, known)
        tell(history[-1])
    chosen = sorted(dict.fromkeys(alive), key=rank, reverse=True)[: params.finalists]
    trials = trials_of(space, slides, task, chosen)
    finalists = [
        Finalist(trial.recipe, one, known[one], scores)
        for one, trial, scores in zip(chosen, trials, _evaluated(trials, params.halves), strict=True)
    ]
    return SearchResult(tuple(sorted(finalists, key=lambda one: -one.fitness)), tuple(history))


def trials_of(
    space: RecipeSpace,
    slides: SearchSlides,
    task: ClassificationTask | RoughnessTask,
    individuals: Sequence[Individual],
) -> list[Trial]:
    """Return the trials of individuals; their features are computed on this machine."""
    recipes = [space.recipe(one) for one in individuals]
    splits = [slides.split(recipe.training_windows) for recipe in recipes]
    values = Parallel(backend='threading')(
        delayed(examples.values)(task.features(recipe)) for recipe, (examples, _) in zip(recipes, splits, strict=True)
    )
    return [
        Trial(task, recipe, columns, examples.names, examples.codes, examples.slides, halves)
        for recipe, (examples, halves), columns in zip(recipes, splits, values, strict=True)
    ]


def _evaluated(trials: Sequence[Trial], n_halves: int) -> list[tuple[HalfScore, ...]]:
    """Return the scores of each trial on so many halves."""
    scores = Parallel()(delayed(scored_alone)(trial, number) for trial in trials for number in range(n_halves))
    return [tuple(scores[place * n_halves : (place + 1) * n_halves]) for place in range(len(trials))]


def single_blas_thread() -> AbstractContextManager[Any]:
    """Keep linear algebra from starting threads of its own within a `with` block: the cores are busy already."""
    return threadpool_limits(limits=1, user_api='blas')


def scored_alone(trial: Callable[[int], HalfScore], number: int) -> HalfScore:
    """Return the scores of a trial on the half of this number, with linear algebra on one core."""
    with single_blas_thread():  # on a worker elsewhere, too
        return trial(number)


def _identity(
    space: RecipeSpace, slides: SearchSlides, task: ClassificationTask | RoughnessTask, params: SearchParams
) -> str:
    """Return what the scores of a search belong to, in sixteen letters."""
    examples, halves = slides.split(space.base.training_windows)
    told = [space.base.as_mapping(), repr(space.axes), repr(task), params.search_halves]
    digest = hashlib.sha256(json.dumps(told, sort_keys=True, default=str).encode())
    for windows in examples.inputs.values():
        digest.update(np.ascontiguousarray(windows.samples).tobytes())
    digest.update('\n'.join([*examples.labels, *examples.groups]).encode() + halves.tobytes())
    return digest.hexdigest()[:16]


def write_scores(path: str | Path, identity: str, known: Mapping[Individual, float]) -> None:
    """Write the checkpoint, the fitness by individual; a reader never sees half a file."""
    scores = [[list(individual), scored] for individual, scored in known.items()]
    with writing(path):
        replace_file(Path(path).expanduser(), (json.dumps({'search': identity, 'scores': scores}) + '\n').encode())


def read_scores(path: str | Path, identity: str) -> dict[Individual, float]:
    """Return what a checkpoint holds."""
    try:
        content = load_json(Path(path).expanduser(), MAX_BYTES)
        found = content['search']
        known = {tuple(one): float(value) for one, value in content['scores']}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InvalidData(
            f"checkpoint '{path}' cannot be read: {error}; give a file that 'texture optimise' has written"
        ) from error
    if found != identity:
        raise InvalidData(
            f"checkpoint '{path}' belongs to another search; "
            'give the same recipe, bags and options as then, or start again without it'
        )
    return known
