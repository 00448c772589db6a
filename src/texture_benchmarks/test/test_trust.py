import dataclasses
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.robustness import FORCE_N, SCENE, SLIDE_S, SPEED_M_S, TouchConditions
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
from texture_benchmarks.trust import simulate as simulate_row
from texture_core.types import TextureEstimate
from texture_estimation.decisions import ErrorBound
from texture_estimation.recipe import load_recipe
from texture_evaluation.metrics import SlideResult
from texture_recordings.dataset import LabelledSlide
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import load_scene

EVERY_ROW = [row.name(strength) for row in ROWS.values() for strength in row.strengths]


@pytest.fixture(scope='module')
def slide() -> LabelledSlide:
    conditions = TouchConditions(load_scene(SCENE), SimulatedSlide(SPEED_M_S, FORCE_N, SLIDE_S))
    return simulate(conditions, 1, np.random.default_rng(0))[0]


@pytest.fixture(params=ROWS)
def row(request: pytest.FixtureRequest) -> DisturbanceSweep:
    return ROWS[request.param]


def samples(item: LabelledSlide) -> np.ndarray:
    return np.concatenate([batch.samples for batch in item.signals['signal']])


def test_every_row_changes_the_samples_and_keeps_the_slide(row: DisturbanceSweep, slide: LabelledSlide) -> None:
    for strength in row.strengths:
        # A short slide may lose nothing of one in a thousand, so some seeds are tried.
        changed = [disturbed(slide, row, strength, np.random.default_rng(seed)) for seed in range(40)]
        assert changed[0].name == slide.name
        before = samples(slide)
        assert any(_differ(samples(one), before) for one in changed)


def _differ(own: np.ndarray, before: np.ndarray) -> bool:
    return own.shape != before.shape or not np.array_equal(own, before, equal_nan=True)


def test_the_same_other_finger_touches_all_slides(slide: LabelledSlide) -> None:
    finger = ROWS['another finger']
    one, other = (samples(disturbed(slide, finger, 2.0, np.random.default_rng(seed))) for seed in (0, 1))
    np.testing.assert_array_equal(one, other)


def estimate(label: str, *, known: bool, decided: bool, evidence_s: float, final: bool = False) -> TextureEstimate:
    return TextureEstimate(
        stamp_ns=0, exploration_id='e', final=final, label=label, known=known, decided=decided, windows=1,
        evidence_s=evidence_s,
    )  # fmt: skip


def test_outcomes_are_counted_at_the_first_certain_estimate_and_at_the_end() -> None:
    unsure = estimate('felt', known=True, decided=False, evidence_s=0.5)
    right = estimate('cork', known=True, decided=True, evidence_s=1.0)
    wrong = estimate('felt', known=True, decided=True, evidence_s=1.5)
    rejected = estimate('cork', known=False, decided=False, evidence_s=2.0)
    slides = [[unsure, right, wrong], [unsure, wrong, rejected], [unsure, rejected], []]
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


def test_the_grid_shows_undisturbed_slides_where_no_change_lies() -> None:
    panels = grid_panels(
        ['gain × 0.5', 'gain × 2', 'white noise 3 % of the rms', 'force × 0.8, simulated', UNDISTURBED]
    )
    assert panels == {
        'gain × …': [('0.5', 'gain × 0.5'), ('1', UNDISTURBED), ('2', 'gain × 2')],
        'white noise … % of the rms': [('none', UNDISTURBED), ('3', 'white noise 3 % of the rms')],
        'force × …,\nsimulated': [('0.8', 'force × 0.8, simulated'), ('1', UNDISTURBED_SIMULATED)],
    }


def test_the_grid_shows_every_disturbance_once() -> None:
    shown = [name for ticks in grid_panels([*EVERY_ROW, *SIMULATED]).values() for _, name in ticks]
    assert sorted({*shown} - {UNDISTURBED, UNDISTURBED_SIMULATED}) == sorted([*EVERY_ROW, *SIMULATED])


@pytest.mark.parametrize('name', RECIPES)
def test_so_many_slides_are_simulated_that_each_recipe_may_be_certain(name: str) -> None:
    slides = TRAINED_SLIDES * len(load_scene(SCENE).surfaces)
    assert ErrorBound(slides, load_recipe(name).training.max_error_rate).shown


def test_simulated_slides_tell_their_conditions_only_if_asked_to() -> None:
    told, untold = (
        simulate_row(SIMULATED['circle, simulated'], 1, np.random.default_rng(0), told=told)[0]
        for told in (True, False)
    )
    assert (told.motion_name, told.speed_m_s, told.force_n) == ('circular', SPEED_M_S, FORCE_N)
    assert untold.motion_name == 'linear_slide'
    assert np.isnan([untold.speed_m_s, untold.force_n]).all()
