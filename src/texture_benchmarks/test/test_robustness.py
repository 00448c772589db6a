# SPDX-License-Identifier: Apache-2.0
import dataclasses
import json
import math
import os
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import BENCHMARKS
from texture_benchmarks.recipes import comparable
from texture_benchmarks.robustness import (
    CONDITIONS,
    DEGRADATIONS,
    FORCE_N,
    LATER,
    SCENE,
    SLIDE_S,
    SPEED_M_S,
    TOPIC,
    Degradation,
    TouchConditions,
    TrainedModels,
    _sticking,
    _usual,
    breakdown,
    degraded,
    robustness_tables,
    simulate_slide_signals,
)
from texture_benchmarks.robustness import simulate_slide_signals as simulate
from texture_benchmarks.study import BenchmarkOptions
from texture_benchmarks.trust import (
    RECIPES,
    ROWS,
    SIMULATED,
    TRAINED_SLIDES,
    UNDISTURBED,
    UNDISTURBED_SIMULATED,
    DisturbanceSweep,
    Outcome,
    disturbed,
    grid_panels,
    run,
)
from texture_core.types import ExplorationState, Phase, Rejection, TactileSignal, TextureEstimate
from texture_estimation.decisions import ErrorBound
from texture_estimation.recipe import load_recipe, with_channels
from texture_evaluation.metrics import SlideResult
from texture_recordings.dataset import LabelledSlide, SlideDataset
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import load_scene

pytestmark = pytest.mark.ros

DATA = Path(os.environ.get('TEXTURE_DATA') or Path(__file__).resolve().parents[4] / 'shared' / 'data')
DOCS = Path(__file__).resolve().parents[3] / 'docs'
RATE_HZ = 1000.0


@pytest.fixture(params=DEGRADATIONS)
def degradation(request: pytest.FixtureRequest) -> Degradation:
    return DEGRADATIONS[request.param]


def samples() -> np.ndarray:
    return 5.0 + np.random.default_rng(0).normal(size=(3000, 2)) * [1.0, 20.0]


def changed(name: str, strength: float) -> np.ndarray:
    return DEGRADATIONS[name].change(samples(), RATE_HZ, strength, np.random.default_rng(1))


def test_no_strength_leaves_the_samples_as_they_are(degradation: Degradation) -> None:
    same = degradation.change(samples(), RATE_HZ, degradation.nothing, np.random.default_rng(1))
    np.testing.assert_array_equal(same, samples())


def test_any_strength_gives_finite_samples_or_says_that_it_loses_some(degradation: Degradation) -> None:
    for strength in degradation.strengths:
        found = degradation.change(samples(), RATE_HZ, strength, np.random.default_rng(1))
        assert found.ndim == 2
        assert np.isfinite(found).all() or degradation.loses


def test_degradations_do_what_they_say() -> None:
    np.testing.assert_allclose((changed('white noise', 1.0) - samples()).std(axis=0), samples().std(axis=0), rtol=0.1)
    np.testing.assert_allclose((changed('offset drift', 3.0) - samples())[1000], 3.0 * samples().std(axis=0))
    assert np.isnan(changed('lost samples', 0.1)).mean() == pytest.approx(0.1, abs=0.05)
    assert (np.diff(changed('losses hidden', 0.5), axis=0) == 0).mean() == pytest.approx(0.5, abs=0.1)
    assert len(changed('faster than trained', 2.0)) == 1500
    np.testing.assert_allclose(np.ptp(changed('clipping', 0.5), axis=0), samples().std(axis=0))


def test_wear_halves_the_power_at_its_cut_off() -> None:
    tone = np.sin(2 * np.pi * 20.0 * np.arange(5000) / RATE_HZ)[:, None]
    worn = DEGRADATIONS['wear'].change(tone, RATE_HZ, 20.0, np.random.default_rng(1))
    assert worn[1000:].var() / tone.var() == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ('strengths', 'shares', 'expected'),
    [
        ((0.0, 1.0, 2.0), (1.0, 0.95, 0.85), 1.5),
        ((1.0, 0.5), (0.5, 0.4), 0.75),
        ((math.inf, 100.0, 50.0), (1.0, 0.5, 0.1), 100.0),
        ((0.0, 1.0), (1.0, 0.9), None),
    ],
)
def test_a_curve_breaks_down_where_it_crosses_nine_tenths_of_its_start(strengths, shares, expected) -> None:
    assert breakdown(strengths, shares, 0.9) == (expected and pytest.approx(expected))


def slide_signals(samples: np.ndarray, rate_hz: float, batch: int) -> LabelledSlide:
    """Return a slide that came in batches."""
    slide = LabelledSlide(Path(), 'a/1', 'a', 1, 0, None)
    state = ExplorationState(0, 'a/1', 'linear_slide', Phase.SLIDE, steady_s=len(samples) / rate_hz, surface='a')
    signals = [
        TactileSignal(0, 'pac', ('pac',), (), rate_hz, first, samples[first : first + batch].astype(np.float32))
        for first in range(0, len(samples), batch)
    ]
    return dataclasses.replace(slide, signals={TOPIC: signals}, states=[state])


def test_a_slide_is_degraded_as_a_whole_though_it_came_in_batches() -> None:
    time_s = np.arange(4400) / 2200.0
    slide = slide_signals(np.sin(2 * np.pi * 100.0 * time_s)[:, None], 2200.0, batch=44)
    slower = degraded(slide, DEGRADATIONS['slower than trained'], 0.5, RATE_HZ, np.random.default_rng(0))
    [signal] = slower.signals[TOPIC]
    assert (signal.sampling_rate_hz, signal.samples.shape) == (RATE_HZ, (2000, 1))
    expected = np.sin(2 * np.pi * 50.0 * np.arange(2000) / RATE_HZ)
    np.testing.assert_allclose(signal.samples[100:-100, 0], expected[100:-100], atol=0.01)


def test_recipes_of_the_same_features_count_the_same_windows_and_lost_ones_are_not_cut() -> None:
    rng = np.random.default_rng(0)
    slides = [
        dataclasses.replace(item, surface=name, exploration_id=f'{name}/{number}', number=number)
        for name, size in (('weak', 1.0), ('strong', 5.0))
        for number in range(3)
        for item in [slide_signals(size * rng.normal(size=(2000, 1)), RATE_HZ, 2000)]
    ]
    recipes = [
        comparable(with_channels(load_recipe(name), 'fast'), RATE_HZ, of_motion=False)
        for name in ('kaboli-pa', 'kaboli-em')
    ]
    trained_models = TrainedModels.trained(recipes, slides)
    assert trained_models.counts(slides)['kaboli-pa'] == (24, 24)
    assert {count.cut for count in trained_models.counts(slides, 0.5).values()} == {24}
    holed = [degraded(item, DEGRADATIONS['lost samples'], 0.05, RATE_HZ, rng) for item in slides]
    assert trained_models.counts(holed)['kaboli-pa'].cut < 12


@pytest.mark.parametrize('name', CONDITIONS)
def test_simulated_slides_have_windows_and_differ_from_those_trained(name: str) -> None:
    condition = CONDITIONS[name]
    few = {surface: load_scene(SCENE).surfaces[surface] for surface in ('leather', 'ridge_2mm_deep')}

    def touch_conditions(how: TouchConditions) -> list[np.ndarray]:
        scene = dataclasses.replace(how.scene, surfaces={name: how.scene.surfaces[name] for name in few})
        how = dataclasses.replace(how, scene=scene, sliding=dataclasses.replace(how.sliding, duration_s=0.5))
        slides = simulate_slide_signals(how, len(how.fingers), np.random.default_rng(0))
        recipe = load_recipe('fast')
        return [vector.values for _, own in SlideDataset(tuple(slides)).vectors(recipe.feature_set) for vector in own]

    otherwise = condition.touch_conditions(condition.strengths[-1])
    usual, worst = touch_conditions(_sticking(1.0) if name == 'stick-slip' else _usual()), touch_conditions(otherwise)
    assert (len(usual), len(worst)) == (2, 2 * len(otherwise.fingers))
    assert max(np.abs(values - usual[0]).max() for values in worst[: len(otherwise.fingers)]) > 0.1


def test_the_page_shows_what_the_bench_measured() -> None:
    numbers = json.loads((DOCS / 'charts' / 'robustness.json').read_text())['numbers']
    assert robustness_tables(numbers) == (DOCS / 'charts' / 'robustness.md').read_text()


@pytest.mark.benchmark
@pytest.mark.skipif(not DATA.is_dir(), reason=f'no recorded data in {DATA}; set TEXTURE_DATA to its folder')
def test_noise_breaks_what_was_trained_without_it(tmp_path: Path) -> None:
    result = BENCHMARKS['robustness'](BenchmarkOptions(tmp_path, DATA, quick=True))
    assert set(result.numbers) < {*DEGRADATIONS, LATER, *CONDITIONS}
    assert {found['slides'] for found in result.numbers.values()} == {'recorded', 'simulated'}
    own = result.numbers['white noise']['recipes']['peaks-naive-bayes']
    assert own['window_accuracy'][0] > own['window_accuracy'][-1]
    assert '| `peaks-naive-bayes` |' in (tmp_path / 'robustness.md').read_text()


EVERY_ROW = [row.name(strength) for row in ROWS.values() for strength in row.strengths]


@pytest.fixture(scope='module')
def slide() -> LabelledSlide:
    conditions = TouchConditions(load_scene(SCENE), SimulatedSlide(SPEED_M_S, FORCE_N, SLIDE_S))
    return simulate(conditions, 1, np.random.default_rng(0))[0]


@pytest.fixture(params=ROWS)
def row(request: pytest.FixtureRequest) -> DisturbanceSweep:
    return ROWS[request.param]


def samples_of_trust(item: LabelledSlide) -> np.ndarray:
    return np.concatenate([batch.samples for batch in item.signals['signal']])


def test_every_row_changes_the_samples_and_keeps_the_slide(row: DisturbanceSweep, slide: LabelledSlide) -> None:
    for strength in row.strengths:
        # A short slide may lose nothing of one in a thousand, so some seeds are tried.
        changed = [disturbed(slide, row, strength, np.random.default_rng(seed)) for seed in range(40)]
        assert changed[0].name == slide.name
        before = samples_of_trust(slide)
        assert any(_differ(samples_of_trust(one), before) for one in changed)


def _differ(own: np.ndarray, before: np.ndarray) -> bool:
    return own.shape != before.shape or not np.array_equal(own, before, equal_nan=True)


def test_the_same_other_finger_touches_all_slides(slide: LabelledSlide) -> None:
    finger = ROWS['another finger']
    one, other = (samples_of_trust(disturbed(slide, finger, 2.0, np.random.default_rng(seed))) for seed in (0, 1))
    np.testing.assert_array_equal(one, other)


def estimate(label: str, *, known: bool, decided: bool, evidence_s: float, final: bool = False) -> TextureEstimate:
    return TextureEstimate(
        stamp_ns=0, exploration_id='e', final=final, label=label, decided=decided, windows=1,
        rejection=Rejection.NONE if known else Rejection.NOVEL,
        evidence_s=evidence_s,
    )  # fmt: skip


def test_outcomes_are_counted_at_the_first_decided_estimate_and_at_the_end() -> None:
    undecided = estimate('felt', known=True, decided=False, evidence_s=0.5)
    right = estimate('cork', known=True, decided=True, evidence_s=1.0)
    wrong = estimate('felt', known=True, decided=True, evidence_s=1.5)
    rejected = estimate('cork', known=False, decided=False, evidence_s=2.0)
    slides = [[undecided, right, wrong], [undecided, wrong, rejected], [undecided, rejected], []]
    outcome = Outcome.of([SlideResult('cork', [], estimates) for estimates in slides])
    assert dataclasses.astuple(outcome) == (4, 1, 1, 0, 1, pytest.approx(1.5), 2)


@pytest.mark.benchmark
def test_the_quick_form_on_simulated_slides_gives_figures_and_a_chart(tmp_path: Path) -> None:
    result = run(BenchmarkOptions(out=tmp_path, quick=True))
    assert [chart.name for chart in result.charts] == ['trust.png']
    outcomes = result.numbers['fast']['outcomes']
    assert 'simulated' in result.data
    assert len(outcomes) == 1 + 8 + 3 + 2
    clean = outcomes[UNDISTURBED]
    assert clean['slides'] == 36
    assert clean['label_right'] > 18  # chance is 3
    for outcome in outcomes.values():
        assert outcome['early_right'] + outcome['early_wrong'] <= outcome['slides']
    told = result.numbers['told_outside_what_was_trained']['fast']
    assert told == {'undisturbed, simulated': 0.0, 'circle, simulated': 1.0}


def test_the_grid_shows_every_disturbance_once() -> None:
    shown = [name for ticks in grid_panels([*EVERY_ROW, *SIMULATED]).values() for _, name in ticks]
    assert sorted({*shown} - {UNDISTURBED, UNDISTURBED_SIMULATED}) == sorted([*EVERY_ROW, *SIMULATED])


@pytest.mark.parametrize('name', RECIPES)
def test_so_many_slides_are_simulated_that_each_recipe_may_be_certain(name: str) -> None:
    slides = TRAINED_SLIDES * len(load_scene(SCENE).surfaces)
    assert ErrorBound(slides, load_recipe(name).training.max_error_rate).shown
