# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Grades of roughness of textures never touched (Rispal et al.)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.config import find
from texture_core.types import Array, Window
from texture_estimation.roughness import (
    LEVEL,
    NORMAL_90,
    STICK_SLIP,
    TEST,
    TRAIN,
    RoughnessModel,
    RoughnessRecipe,
    load_roughness_recipe,
    read_grades,
    train_grades,
)
from texture_evaluation.charts import COLOURS, chart
from texture_features.feature_set import FeatureSet, LabelledFeatures
from texture_features.windows import CutWindow
from texture_papers.protocol import (
    Experiment,
    ExperimentResult,
    Finding,
    Interval,
    hash_of,
    mean,
    mean_over_seeds,
    strength,
    versions,
)
from texture_papers.report import ERRORS, drawn, figures_chart, finding_as_json
from texture_papers.search import QUICK, SearchParams, Tuned, grading, search, varied
from texture_papers.slides import ArrayStream, Mask, SlideArrays
from texture_simulation.offline import simulate_slides
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import Scene, load_scene
from texture_simulation.sensor_models import SENSORS


@dataclass(frozen=True, eq=False)
class Answers:
    """Grades of windows by a model, (n,) each; NaN where it gives no grade."""

    grades: Array
    stds: Array
    true: Array
    textures: Sequence[str]

    @classmethod
    def joined(cls, parts: Sequence[Answers]) -> Answers:
        """Return all answers as one."""
        return cls(
            np.concatenate([part.grades for part in parts]),
            np.concatenate([part.stds for part in parts]),
            np.concatenate([part.true for part in parts]),
            [name for part in parts for name in part.textures],
        )

    def figures(self) -> dict[str, Any]:
        """Return error, spread within a texture, fraction without a grade, and how often the 90 % interval holds."""
        given = np.isfinite(self.grades)
        errors = np.abs(self.grades - self.true)
        within = errors <= NORMAL_90 * self.stds
        # A texture is one opinion, however many windows it has; the spread is the mean over textures with a grade.
        of_textures = self.error_by_texture()
        means = list(of_textures.values())
        stds = [row['std'] for row in self.by_texture().values() if math.isfinite(row['std'])]
        return {
            'error': float(errors[given].mean()) if given.any() else None,
            'error_of_the_mean': float(np.std(means, ddof=1) / np.sqrt(len(means))) if len(means) > 1 else None,
            'std': float(np.mean(stds)) if stds else None,
            'without_grade': float(1.0 - given.mean()),
            # the paper writes 0 for no grade, and does not state whether it counts
            'error_none_as_0': float(np.where(given, errors, self.true).mean()),
            'coverage_90': float(within[given].mean()) if given.any() else None,
            'by_texture': {name: round(error, 4) for name, error in of_textures.items()},
        }

    def by_texture(self) -> dict[str, dict[str, float]]:
        """Return human grade, mean and standard deviation of each texture."""
        table = {}
        for name, rows in self._rows():
            given = self.grades[rows & np.isfinite(self.grades)]
            table[name] = {
                'human': float(self.true[rows][0]),
                'mean': float(given.mean()) if len(given) else float('nan'),
                'std': float(given.std()) if len(given) else float('nan'),
                'interval_std': float(self.stds[rows].mean()),
            }
        return table

    def error_by_texture(self) -> dict[str, float]:
        """Return the mean absolute error of each texture that got a grade."""
        errors = np.abs(self.grades - self.true)
        known = {name: errors[rows & np.isfinite(errors)] for name, rows in self._rows()}
        return {name: float(values.mean()) for name, values in known.items() if len(values)}

    def _rows(self) -> Iterator[tuple[str, Mask]]:
        """Yield each texture with its windows, (n,)."""
        names = np.asarray(self.textures)
        yield from ((name, names == name) for name in dict.fromkeys(self.textures))


SPEED_M_S, FORCE_N, SCAN_S, USED_S = 0.15, 2.5, 0.7, 0.5


class SimulatedTextures:
    """Scans of textures, described: each texture is simulated once."""

    def __init__(self, scene: Scene, seed: int, *, quick: bool = False) -> None:
        self.seed, self.quick = seed, quick
        self.grades = read_grades(GRADES)
        self.textures = tuple(self.grades.grades)  # in the order of the table
        self.scans, self.scans_left_out = QUICK_COUNTS if quick else COUNTS
        self._scene, self._fast = scene, find(SENSORS, scene.sensor, 'sensor model').fast
        self._scans: dict[tuple[str, int], Array] = {}

    def extract(self, features: FeatureSet, textures: Sequence[str], count: int) -> LabelledFeatures:
        """Return one window of this many scans over each texture."""
        events = [event for texture in textures for event in self.events(texture, count)]
        vectors = features.extract_many(events)
        return LabelledFeatures.from_vectors(vectors, {event.exploration_id: event.surface for event in events})

    def events(self, texture: str, count: int) -> Iterator[CutWindow]:
        """Yield the window of each scan, USED_S long."""
        for number, samples in enumerate(self._measured(texture, count)):
            window = Window(samples, self._fast.rate_hz, self._fast.channels, 0, SPEED_M_S, FORCE_N)
            yield CutWindow(0, f'{texture}/{number}', USED_S, USED_S, {'signal': window}, SPEED_M_S, FORCE_N, texture)

    def _measured(self, texture: str, count: int) -> Array:
        if (texture, count) not in self._scans:
            place = list(self._scene.surfaces).index(texture)
            rng = np.random.default_rng([self.seed, place, round(1e4 * SPEED_M_S), round(1e3 * FORCE_N), count])
            samples = simulate_slides(self._scene, texture, count, SimulatedSlide(SPEED_M_S, FORCE_N, SCAN_S), rng)
            self._scans[texture, count] = samples[:, : round(USED_S * self._fast.rate_hz)].astype(np.float64)
        return self._scans[texture, count]

    def slides(self, textures: Sequence[str], count: int) -> SlideArrays:
        """Return the same scans as plain arrays, for a search."""
        samples = np.concatenate([self._measured(texture, count) for texture in textures])
        same = np.ones(len(samples))
        streams = {'signal': ArrayStream(samples, self._fast.rate_hz)}
        return SlideArrays(streams, np.repeat(np.array(textures), count), SPEED_M_S * same, FORCE_N * same)

    def ask(self, model: RoughnessModel, examples: LabelledFeatures) -> Answers:
        """Return the grade of each window by a model."""
        grades, stds = model.grade(examples.values)
        true = np.array([self.grades.of(label) for label in examples.labels])
        return Answers(grades, model.calibration.window_std(stds), true, examples.labels.tolist())


def errors_chart(result: ExperimentResult, out: Path) -> Path:
    """Draw the error of each regressor, the means over seeds, next to the paper's."""
    panels = {
        f'{part} textures': {
            name: (paper[part], Interval(*result.numbers['regressors'][name][part]['over_seeds']))
            for name, paper in result.numbers['paper'].items()
        }
        for part in ('seen', 'unseen')
    }
    title = f'roughness: errors of grades, paper and simulation; {SLIDES}; {result.split}'
    return figures_chart(panels, title, out / 'experiment_roughness.png', drawn(result.numbers), ERRORS)


SHADES = {'training': COLOURS[2], 'unseen': COLOURS[0]}  # green and blue as in the paper
# Of each texture: the human grade, mean and standard deviation of the estimates, and that of the interval.
ByTexture = Mapping[str, Mapping[str, float | None]]


def grades_chart(panels: Mapping[str, Mapping[str, ByTexture]], path: str | Path) -> Path:
    """Draw the estimates of each texture next to its human grade, a panel for each regressor (the paper's Fig. 7).

    The thick bar is one standard deviation over the windows, the thin one the 90 % interval of a window.
    """
    human = {name: row['human'] for series in panels.values() for one in series.values() for name, row in one.items()}
    order = sorted(human, key=lambda texture: human[texture] or 0.0)
    place = {name: index for index, name in enumerate(order)}
    title = (
        f'Roughness: people, and models on simulated slides. {SLIDES}; thick bar: one standard deviation over them, '
        'thin: 90 % interval of a slide, no dot: no grade given'
    )
    with chart(path, (5.8, 0.22 * len(order) + 2.2), title) as figure:
        columns = figure.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False)[0]
        for axes, (name, series) in zip(columns, panels.items(), strict=True):
            axes.scatter(list(human.values()), [place[texture] for texture in human], marker='|', s=90,
                         color=COLOURS[5], label='people', zorder=4)  # fmt: skip
            for kind, one in series.items():
                _grade_bars(axes, one, place, kind)
            axes.set(title=name.replace('ours', OURS).replace(', ', ',\n'), xlim=(0.2, 5.8), xticks=range(1, 6))
        columns[0].set_yticks(range(len(order)), [name.replace('_', ' ') for name in order])
        columns[0].set_ylim(len(order) - 0.4, -0.6)
        columns[len(columns) // 2].set_xlabel('grade, 1 (smooth) to 5 (rough)')
        figure.legend(*columns[0].get_legend_handles_labels(), loc='outside lower left', ncols=3)
    return Path(path)


def _grade_bars(axes: Any, table: ByTexture, place: Mapping[str, int], kind: str) -> None:
    at = [place[name] for name in table]
    means, stds, claimed = (
        np.array([row[name] for row in table.values()], dtype=np.float64) for name in ('mean', 'std', 'interval_std')
    )
    half = NORMAL_90 * claimed
    axes.errorbar(means, at, xerr=half, fmt='none', color=SHADES[kind], linewidth=0.8, alpha=0.6, zorder=2)
    axes.errorbar(means, at, xerr=stds, fmt='o', markersize=4, color=SHADES[kind], linewidth=3, alpha=0.85, label=kind,
                  zorder=3)  # fmt: skip


SCENE, GRADES = 'roughness', 'ets_roughness'
SCANS = 200
SLIDES = f'25 textures, {SCANS} slides each'
# Scans of each texture, and those with a texture left out.
COUNTS, QUICK_COUNTS = (SCANS, 50), (12, 4)
QUICK_STEP = 8  # between the textures that the paper's regressors have left out
OURS = 'roughness'
RECIPES = {
    'ANN1': 'ets-roughness-ann1',
    'ANN5': 'ets-roughness-ann5',
    'SVM5': 'ets-roughness-svm5',
    'ours': OURS,
}
# The paper's Table II: mean absolute error of training and test textures, and standard deviation within a texture.
PAPER = {'ANN1': (0.65, 1.13, 0.59, 0.59), 'ANN5': (0.24, 1.02, 0.60, 0.55), 'SVM5': (0.25, 1.30, 0.64, 0.77)}
COLUMNS = ('seen', 'unseen', 'std_seen', 'std_unseen')
ONE_PERSON = 0.82  # grades from the mean of the others: 81 materials, 11 people, another study (ViPer)


def run(experiment: Experiment) -> ExperimentResult:
    """Learn the paper's 15 textures and grade its 10 others; leave each of the 25 out.

    With a search, the paper's regressors alone, with the variables found on the 15.
    """
    simulated = SimulatedTextures(load_scene(SCENE), experiment.seed, quick=experiment.quick)
    train, test = simulated.grades.used_for(TRAIN), simulated.grades.used_for(TEST)
    tuned = _searched(simulated, experiment) if experiment.tune else {}
    recipes = {name: tuned[name].recipe if tuned else load_roughness_recipe(RECIPES[name]) for name in tuned or RECIPES}
    answers = {}
    for name, recipe in recipes.items():
        quick = _quickly(recipe, simulated)
        model = train_grades(
            quick, simulated.extract(quick.feature_set, train, simulated.scans), simulated.grades, name
        )
        parts = {'seen': train, 'unseen': test}
        answers[name] = {
            part: simulated.ask(model, simulated.extract(recipe.feature_set, of, simulated.scans))
            for part, of in parts.items()
        }
        if not experiment.seed and not tuned:  # 25 models of each recipe: of the first seed alone
            answers[name]['left_out'] = _leave_one_out(simulated, recipe)
    grades = {} if experiment.seed or tuned else _grades(answers)
    return ExperimentResult(
        name=f'roughness{"-tuned" if tuned else ""}',
        measured=(
            f'mean absolute error in grades of single windows of {USED_S} s, {SPEED_M_S} m/s, {FORCE_N} N; '
            'windows to which a regressor gives no grade are counted apart'
        ),
        data=(
            f'simulated: {len(simulated.textures)} surfaces whose shape is guessed from the descriptions in the paper, '
            f"{simulated.scans} scans each; grades: the paper's Table I, by people on the real textures"
        ),
        split=f"by texture, the paper's: {len(train)} for training, {len(test)} for test",
        numbers={
            'seed': experiment.seed,
            'digests': digests(tuned=experiment.tune),
            'paper': {name: dict(zip(COLUMNS, row, strict=True)) for name, row in PAPER.items()},
            'one_person': ONE_PERSON,
            'always_the_middle': {part: float(np.abs(3.0 - one.true).mean()) for part, one in answers['ANN1'].items()},
            'regressors': {name: {part: one.figures() for part, one in of.items()} for name, of in answers.items()},
            'grades': grades,
            'tuning': {name: one.as_json() for name, one in tuned.items()},
            'findings': [finding_as_json(finding) for finding in findings(answers)],
        },
        charts=(grades_chart(grades, experiment.out / 'roughness_grades.png'),) if grades else (),
    )


def digests(*, tuned: bool = False) -> dict[str, str]:
    """Return the digest of each regressor's rows as they are now.

    The recipe, the grades of people and, of three scans of each texture, the features and the regressor's grades.
    """
    simulated = SimulatedTextures(load_scene(SCENE), 0, quick=True)
    return {
        **{
            name: _digest(simulated, load_roughness_recipe(one))
            for name, one in RECIPES.items()
            if name in PAPER or not tuned
        },
        **({'search': hash_of([str(OF_HEADS), SEARCHED_SCANS])} if tuned else {}),
        'versions': versions(),
    }


def _digest(simulated: SimulatedTextures, recipe: RoughnessRecipe) -> str:
    examples = simulated.extract(recipe.feature_set, simulated.textures, 3)
    true = np.array([simulated.grades.of(label) for label in examples.labels])
    textures = np.unique(examples.labels, return_inverse=True)[1]
    definition = {key: value for key, value in recipe.as_mapping().items() if key in ('windows', 'inputs', 'regressor')}
    parameters = recipe.regressor.fit(examples.values, true, textures)
    grades = recipe.regressor.predictor(parameters)(examples.values)[0]
    return hash_of(
        [definition, COUNTS, simulated.grades.grades, strength(examples.values), np.round(grades, 2).tolist()]
    )


def findings(answers: Mapping[str, Mapping[str, Answers]]) -> list[Finding]:
    """Check what Table II reports."""
    return [
        finding
        for ann1, ann5 in [(answers['ANN1'], answers['ANN5'])]
        for claim, rival, part in (
            ('five networks know trained textures better than one (0.24 to 0.65)', ann1, 'seen'),
            ('five networks grade unseen textures better than one (1.02 to 1.13)', ann1, 'unseen'),
            ('five networks grade unseen textures better than machines (1.02 to 1.30)', answers['SVM5'], 'unseen'),
        )
        for finding in [_better(claim, ann5, rival, part)]
    ]


def _better(claim: str, first: Mapping[str, Answers], second: Mapping[str, Answers], part: str) -> Finding:
    """Check that the error of one is smaller, texture by texture: windows of one texture are one opinion."""
    errors = [one[part].error_by_texture() for one in (first, second)]
    both = [name for name in errors[0] if name in errors[1]]
    gains = {name: round(errors[1][name] - errors[0][name], 4) for name in both}
    gain = mean_over_seeds(list(gains.values())) if len(both) > 1 else mean(np.array([*gains.values()]))
    here = ' against '.join(f'{one[part].figures()["error"] or math.nan:.2f}' for one in (first, second))
    return Finding(claim, f'{here} grades, {len(both)} textures', gain, by_texture=gains)


SEARCHED_SCANS = 40  # of each texture, of the 200, for a search
OF_HEADS = SearchParams()  # the paper's


def _searched(simulated: SimulatedTextures, experiment: Experiment) -> dict[str, Tuned]:
    """Search the variables of the paper's regressors on its 15 textures; the recipes are written next to the result.

    As in the paper, each half holds windows of every texture: the search does not see how a new texture fares.
    """
    params = replace(QUICK if experiment.quick else OF_HEADS, seed=experiment.seed)
    train = simulated.grades.used_for(TRAIN)
    scans = simulated.slides(train, min(SEARCHED_SCANS, simulated.scans))
    tuned = {}
    for name in PAPER:
        base = checkless(load_roughness_recipe(RECIPES[name]))
        found = search(base, scans, params, grading(simulated.grades))
        tuned[name] = Tuned(varied(base, found.individual), params, {'': found}, len(scans.labels))
        tuned[name].write(experiment.out / f'{RECIPES[name]}-tuned-{experiment.seed}.yaml')
    return tuned


def checkless(recipe: RoughnessRecipe) -> RoughnessRecipe:
    """Return a recipe without the features that only its checks need."""
    inputs = tuple(
        replace(item, features=tuple(one for one in item.features if one[0] not in (STICK_SLIP, LEVEL)))
        for item in recipe.feature_set.inputs
    )
    kept = tuple(item for item in inputs if item.features)
    return replace(recipe, feature_set=replace(recipe.feature_set, inputs=kept))


def _leave_one_out(simulated: SimulatedTextures, recipe: RoughnessRecipe) -> Answers:
    """Return the grades of each texture by a model of all others; a quick run skips some of the paper's."""
    examples = simulated.extract(recipe.feature_set, simulated.textures, simulated.scans)
    first = [np.flatnonzero(examples.labels == name)[: simulated.scans_left_out] for name in simulated.textures]
    examples = examples.take(np.concatenate(first))
    parts = []
    for texture in simulated.textures[:: QUICK_STEP if simulated.quick and recipe.name != OURS else 1]:
        held = examples.labels == texture
        model = train_grades(_quickly(recipe, simulated), examples.take(~held), simulated.grades)
        parts.append(simulated.ask(model, examples.take(held)))
    return Answers.joined(parts)


def _quickly(recipe: RoughnessRecipe, simulated: SimulatedTextures) -> RoughnessRecipe:
    """Return a recipe with a coarse calibration if it is the paper's, which has none, or in a hurry: it takes time."""
    if recipe.name == OURS and not simulated.quick:
        return recipe
    return replace(recipe, training=replace(recipe.training, folds=2))


def _grades(answers: Mapping[str, Mapping[str, Answers]]) -> dict[str, Any]:
    """Return what the chart shows, by panel and by whether a texture was trained; null where no window got a grade."""
    panels = {name: {'training': answers[name]['seen'], 'unseen': answers[name]['unseen']} for name in ('ANN5', 'ours')}
    panels['ours, left out'] = {'unseen': answers['ours']['left_out']}
    return {
        panel: {
            kind: {
                texture: {key: round(value, 4) if math.isfinite(value) else None for key, value in row.items()}
                for texture, row in one.by_texture().items()
            }
            for kind, one in series.items()
        }
        for panel, series in panels.items()
    }
