"""Roughness of unseen textures (Rispal, Rana & Duchaine), on simulated surfaces with the paper's grades."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import norm

from texture_benchmarks.papers.experiment import Experiment, ExperimentResult
from texture_benchmarks.papers.interval import mean
from texture_benchmarks.papers.protocol import Finding
from texture_benchmarks.papers.recipe_digest import digest_of
from texture_benchmarks.papers.report import finding_as_json
from texture_benchmarks.papers.roughness_answers import Answers
from texture_benchmarks.papers.roughness_charts import Series, coverage_chart, grades_chart
from texture_benchmarks.papers.roughness_report import lines
from texture_benchmarks.papers.roughness_slides import FORCE_N, SPEED_M_S, USED_S, Setup, SimulatedTextures
from texture_benchmarks.papers.roughness_tuning import TARGET_S, TunedRegressor, tune
from texture_benchmarks.roughness.grade_latency import times_us
from texture_estimation.roughness.grades import TEST, TRAIN, read_grades
from texture_estimation.roughness.model import RoughnessModel
from texture_estimation.roughness.roughness_recipe import RoughnessRecipe, load_roughness_recipe
from texture_estimation.roughness.training import train_grades
from texture_features.labelled_features import LabelledFeatures
from texture_simulation.effects.skids import Skids
from texture_simulation.scene import load_scene

SCENE, GRADES = 'roughness', 'ets_roughness'
SCANS, QUICK_SCANS = 200, 12
OTHER_SCANS, QUICK_OTHER_SCANS = 50, 4
SPLITS, QUICK_SPLITS = 20, 2
QUICK_STEP = 8  # between the textures that the paper's regressors have left out
OURS = 'roughness'
RECIPES = {
    'ANN1': 'ets-roughness-ann1',
    'ANN5': 'ets-roughness-ann5',
    'SVM5': 'ets-roughness-svm5',
    'ANN1, sigmoid': 'ets-roughness-ann1-sigmoid',
    'ANN5, sigmoid': 'ets-roughness-ann5-sigmoid',
    'ours': OURS,
}
# The paper's Table II: mean absolute error of training and test textures, and standard deviation within a texture.
PAPER = {'ANN1': (0.65, 1.13, 0.59, 0.59), 'ANN5': (0.24, 1.02, 0.60, 0.55), 'SVM5': (0.25, 1.30, 0.64, 0.77)}
COLUMNS = ('seen', 'unseen', 'std_seen', 'std_unseen')
ONE_PERSON = 0.82  # grades from the mean of the others: 81 materials, 11 people, another study (ViPer)
SPEEDS_M_S, FORCES_N = (0.10, 0.15, 0.20), (1.0, 2.5, 5.0)
SKIDS_PER_S = 3.0
TIMED, QUICK_TIMED = 2000, 50
NOMINAL = np.array([0.5, 0.6, 0.7, 0.8, 0.9, 0.95])
TARGETS = {
    'ours_unseen': 0.80,
    'ours_left_out': 0.80,
    'ours_other_speeds': 0.9,
    'coverage_90': [0.85, 0.95],
    'window_to_grade_us': 200.0,
    'tuning_s': TARGET_S,
}


def run(experiment: Experiment) -> ExperimentResult:
    """Learn the paper's 15 textures, grade its 10 others; leave each of the 25 out; go faster and slower."""
    setup = _setup(experiment)
    recipes = {name: load_roughness_recipe(recipe) for name, recipe in RECIPES.items()}
    train, test = setup.grades.used_for(TRAIN), setup.grades.used_for(TEST)
    tuned = _tuned(setup, recipes, experiment) if experiment.tune else {}
    recipes |= {name: one.recipe for name, one in tuned.items()}
    if experiment.papers_only:
        return _table_2(setup, {name: recipe for name, recipe in recipes.items() if recipe.name != OURS})
    models = {name: train_grades(one, setup.examples(one, train), setup.grades, name) for name, one in recipes.items()}
    answers = {
        name: {
            'seen': setup.ask(models[name], setup.examples(recipe, train)),
            'unseen': setup.ask(models[name], setup.examples(recipe, test)),
            'left_out': _leave_one_out(setup, recipe),
        }
        for name, recipe in recipes.items()
    }
    numbers: dict[str, Any] = {
        'seed': experiment.seed,
        'recipes': {recipe: digest_of(recipe) for recipe in RECIPES.values()},
        'paper': {name: dict(zip(COLUMNS, row, strict=True)) for name, row in PAPER.items()},
        'one_person': ONE_PERSON,
        'targets': TARGETS,
        'always_the_middle': {part: float(np.abs(3.0 - one.true).mean()) for part, one in answers['ours'].items()},
        'regressors': {name: {part: one.figures() for part, one in parts.items()} for name, parts in answers.items()},
        'calibration': {name: model.card['calibration'] for name, model in models.items()},
        'other_conditions_unseen': {
            name: _other_conditions(setup, models[name], recipe, test) for name, recipe in recipes.items()
        },
        'skids': _skids(setup, models['ours'], test),
        'ours_other_splits': _other_splits(setup, recipes['ours']),
        'window_to_grade_us': _latency(setup, models['ours'], test[0], QUICK_TIMED if experiment.quick else TIMED),
        'tuning': {name: one.figures() for name, one in tuned.items()},
        'findings': [finding_as_json(finding) for finding in findings(answers)],
        'by_texture': {name: _by_texture(parts) for name, parts in answers.items()},
        'ours_left_out_by_texture': answers['ours']['left_out'].by_texture(),
    }
    return ExperimentResult(
        name='roughness',
        measured=(
            f'mean absolute error in grades of single windows of {USED_S} s, {SPEED_M_S} m/s, {FORCE_N} N; '
            'windows to which a regressor gives no grade are counted apart'
        ),
        data=(
            f'simulated: {len(setup.textures)} surfaces whose shape is guessed from the descriptions in the paper, '
            f"{setup.scans} scans each; grades: the paper's Table I, by people on the real textures"
        ),
        split=f"by texture, the paper's: {len(train)} for training, {len(test)} for test",
        numbers=numbers,
        charts=_charts(setup, answers, numbers['ours_other_splits'], experiment),
        lines=tuple(lines(numbers, setup.grades)),
    )


def _table_2(setup: Setup, recipes: Mapping[str, RoughnessRecipe]) -> ExperimentResult:
    """Return the errors of the paper's heads alone, on the textures trained and on the others, and the findings."""
    train, test = setup.grades.used_for(TRAIN), setup.grades.used_for(TEST)
    answers = {}
    for name, recipe in recipes.items():
        quick = _quickly(recipe, setup)
        model = train_grades(quick, setup.examples(quick, train), setup.grades, name)
        parts = {'seen': train, 'unseen': test}
        answers[name] = {part: setup.ask(model, setup.examples(recipe, of)) for part, of in parts.items()}
    return ExperimentResult(
        name='roughness',
        measured='mean absolute error in grades of single windows, by the heads of the paper',
        data=f'simulated: {len(setup.textures)} surfaces, {setup.scans} scans each',
        split=f"by texture, the paper's: {len(train)} for training, {len(test)} for test",
        numbers={
            'seed': setup.seed,
            'recipes': {recipe: digest_of(recipe) for name, recipe in RECIPES.items() if name in recipes},
            'regressors': {
                name: {part: one.figures() for part, one in parts.items()} for name, parts in answers.items()
            },
            'findings': [finding_as_json(finding) for finding in findings(answers)],
        },
    )


def findings(answers: Mapping[str, Mapping[str, Answers]]) -> list[Finding]:
    """Check what Table II tells, with a hidden layer as in the text and with a sigmoid one."""
    return [
        finding
        for suffix in ('', ', sigmoid')
        for ann1, ann5 in [(answers[f'ANN1{suffix}'], answers[f'ANN5{suffix}'])]
        for claim, rival, part in (
            ('five networks know trained textures better than one (0.24 to 0.65)', ann1, 'seen'),
            ('five networks grade unseen textures better than one (1.02 to 1.13)', ann1, 'unseen'),
            ('five networks grade unseen textures better than machines (1.02 to 1.30)', answers['SVM5'], 'unseen'),
        )
        for finding in [_better(f'{claim}{suffix}', ann5, rival, part)]
    ]


def _better(claim: str, first: Mapping[str, Answers], second: Mapping[str, Answers], part: str) -> Finding:
    """Check that the error of one is smaller, texture by texture: windows of one texture are one opinion."""
    errors = [one[part].error_by_texture() for one in (first, second)]
    both = [name for name in errors[0] if name in errors[1]]
    gain = mean(np.array([errors[1][name] - errors[0][name] for name in both]))
    here = ' against '.join(f'{one[part].figures()["error"]:.2f}' for one in (first, second))
    return Finding(claim, f'{here} grades, {len(both)} textures', gain, gain.above())


def _by_texture(parts: Mapping[str, Answers]) -> dict[str, dict[str, float]]:
    return {**parts['seen'].by_texture(), **parts['unseen'].by_texture()}


def _setup(experiment: Experiment) -> Setup:
    many = not experiment.quick
    return Setup(
        SimulatedTextures(load_scene(SCENE), experiment.seed),
        read_grades(GRADES),
        SCANS if many else QUICK_SCANS,
        OTHER_SCANS if many else QUICK_OTHER_SCANS,
        SPLITS if many else QUICK_SPLITS,
        experiment.seed,
        experiment.quick,
    )


def _tuned(setup: Setup, recipes: Mapping[str, RoughnessRecipe], experiment: Experiment) -> dict[str, TunedRegressor]:
    """Return the paper's regressors after its search, and write their recipes; ours has no search."""
    scans = setup.simulated.scans(setup.grades.used_for(TRAIN), setup.scans, SPEED_M_S, FORCE_N)
    tuned = {name: tune(recipes[name], scans, setup.grades, experiment.seed, quick=experiment.quick) for name in PAPER}
    for name, one in tuned.items():
        one.write(experiment.out / f'{RECIPES[name]}.yaml')
    return tuned


def _leave_one_out(setup: Setup, recipe: RoughnessRecipe) -> Answers:
    """Return the grades of each texture by a model of all others; a quick run skips some of the paper's."""
    examples = _thinned(setup.examples(recipe, setup.textures), setup.other_scans)
    parts = []
    for texture in setup.textures[:: QUICK_STEP if setup.quick and recipe.name != OURS else 1]:
        held = examples.labels == texture
        model = train_grades(_quickly(recipe, setup), _rows(examples, ~held), setup.grades)
        parts.append(setup.ask(model, _rows(examples, held)))
    return Answers.joined(parts)


def _quickly(recipe: RoughnessRecipe, setup: Setup) -> RoughnessRecipe:
    """Return a recipe with a coarse calibration if it is the paper's, which has none, or in a hurry: it takes time."""
    if recipe.name == OURS and not setup.quick:
        return recipe
    return replace(recipe, training=replace(recipe.training, folds=2))


def _other_conditions(
    setup: Setup, model: RoughnessModel, recipe: RoughnessRecipe, textures: Sequence[str]
) -> dict[str, dict[str, Any]]:
    """Return the figures of unseen textures at speeds and forces, none but one of each trained."""
    conditions = [(speed, FORCE_N) for speed in SPEEDS_M_S] + [(SPEED_M_S, force) for force in FORCES_N]
    return {
        f'{speed:.2f} m/s, {force:g} N': setup.ask(model, setup.examples(recipe, textures, speed, force)).figures()
        for speed, force in dict.fromkeys(conditions)
    }


def _skids(setup: Setup, model: RoughnessModel, textures: Sequence[str]) -> dict[str, Any]:
    """Return how many windows are refused, with skids and without, and what the grades contribute that are left."""
    scene = load_scene(SCENE)
    skidding = SimulatedTextures(replace(scene, effects={**scene.effects, 'skids': Skids(SKIDS_PER_S)}), setup.seed)
    said: dict[str, Any] = {'per_s': SKIDS_PER_S}
    for name, simulated in (('with', skidding), ('without', setup.simulated)):
        one = replace(setup, simulated=simulated)
        answers = one.ask(model, one.examples(model.recipe, textures, SPEED_M_S, FORCE_N))
        vectors = model.recipe.feature_set.extract_many(
            event for texture in textures for event in simulated.events(texture, setup.scans, SPEED_M_S, FORCE_N)
        )
        refused = np.array([bool(model.checks.refusal(vector)) for vector in vectors])
        errors = np.abs(answers.grades - answers.true)
        said[name] = {
            'refused': float(refused.mean()),
            'error_of_all': float(errors.mean()),
            'error_of_the_others': float(errors[~refused].mean()) if not refused.all() else None,
        }
    return said


def _other_splits(setup: Setup, recipe: RoughnessRecipe) -> dict[str, Any]:
    """Return errors, and how often intervals hold, on unseen textures, over random choices of the training textures.

    With ten textures a share of 90 % rests on one of them; many choices say whether the intervals are honest.
    """
    rng = np.random.default_rng(setup.seed)
    examples = _thinned(setup.examples(recipe, setup.textures), setup.other_scans)
    n_train = len(setup.grades.used_for(TRAIN))
    found, errors, shares = [], [], []
    for _ in range(setup.splits):
        trained_on = rng.permutation(setup.textures)[:n_train]
        known = np.isin(examples.labels, trained_on)
        said = setup.ask(train_grades(recipe, _rows(examples, known), setup.grades), _rows(examples, ~known))
        miss = np.abs(said.grades - said.true)
        found.append([float((miss <= norm.ppf(0.5 + share / 2.0) * said.stds).mean()) for share in NOMINAL])
        errors.append(float(miss.mean()))
        shares.append(said.figures()['coverage_90'])
    return {
        'splits': setup.splits,
        'error': float(np.mean(errors)),
        'nominal': NOMINAL.tolist(),
        'covered': np.mean(found, axis=0).tolist(),
        'coverage_90': float(np.mean(shares)),
        'coverage_90_std': float(np.std(shares)),
    }


def _latency(setup: Setup, model: RoughnessModel, texture: str, count: int) -> dict[str, float]:
    windows = list(setup.simulated.events(texture, setup.other_scans, SPEED_M_S, FORCE_N))
    median, p99 = np.percentile(times_us(model, windows, count), (50, 99))
    return {'median': float(median), 'p99': float(p99)}


def _rows(examples: LabelledFeatures, rows: Any) -> LabelledFeatures:
    return replace(examples, values=examples.values[rows], labels=examples.labels[rows], groups=examples.groups[rows])


def _thinned(examples: LabelledFeatures, count: int) -> LabelledFeatures:
    """Return the first so many windows of each texture."""
    kept = np.concatenate([np.flatnonzero(examples.labels == name)[:count] for name in dict.fromkeys(examples.labels)])
    return _rows(examples, kept)


def _charts(
    setup: Setup, answers: Mapping[str, Mapping[str, Answers]], splits: Mapping[str, Any], experiment: Experiment
) -> tuple[Any, ...]:
    panels = {
        f'{name}: training and unseen textures': {
            'training': Series.of(answers[name]['seen'].by_texture()),
            'unseen': Series.of(answers[name]['unseen'].by_texture()),
        }
        for name in ('ANN5', 'ours')
    }
    panels['ours: each texture left out in turn'] = {'unseen': Series.of(answers['ours']['left_out'].by_texture())}
    where = f'simulated, {len(setup.textures)} textures'
    return (
        grades_chart(panels, setup.textures, f'Roughness as people grade it, and as it is estimated ({where})',
                     experiment.out / 'roughness_grades.png'),
        coverage_chart(np.array(splits['nominal']), np.array(splits['covered']),
                       f'Do the intervals hold on unseen textures?\n{splits["splits"]} random choices ({where})',
                       experiment.out / 'roughness_coverage.png'),
    )  # fmt: skip
