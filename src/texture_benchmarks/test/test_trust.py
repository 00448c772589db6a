# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import dataclasses
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.study import BenchmarkOptions
from texture_benchmarks.trust import (
    RECIPES,
    ROWS,
    SCENE,
    TRAINED,
    TRAINED_SLIDES,
    UNDISTURBED,
    VIBRATION,
    DisturbanceSweep,
    Outcome,
    at_other_speed,
    breakdown,
    breakdown_strengths,
    breakdowns,
    disturbed,
    ordered,
    run,
    simulate,
)
from texture_core.types import ExplorationState, Phase, Rejection, TactileSignal, TextureEstimate
from texture_estimation.acceptance import slides_needed
from texture_estimation.recipe import load_recipe
from texture_evaluation.metrics import SlideResult
from texture_recordings.slides import LabelledSlide
from texture_simulation.scene import load_scene

pytestmark = pytest.mark.ros

RATE_HZ = 1000.0


def samples() -> np.ndarray:
    return 5.0 + np.random.default_rng(0).normal(size=(3000, 2)) * [1.0, 20.0]


def changed(row: str, strength: float, of: np.ndarray | None = None) -> np.ndarray:
    return ROWS[row].change(samples() if of is None else of, RATE_HZ, strength, np.random.default_rng(1))


def test_disturbances_do_what_they_say() -> None:
    np.testing.assert_allclose((changed('white noise', 1.0) - samples()).std(axis=0), samples().std(axis=0), rtol=0.1)
    np.testing.assert_allclose((changed('offset drift', 3.0) - samples())[1000], 3.0 * samples().std(axis=0))
    np.testing.assert_allclose(changed('gain', 0.5), 0.5 * samples())
    assert np.isnan(changed('lost samples', 0.1)).mean() == pytest.approx(0.1, abs=0.05)
    assert (np.diff(changed('hidden losses', 0.5), axis=0) == 0).mean() == pytest.approx(0.5, abs=0.1)
    assert len(changed('speed', 2.0)) == 1500
    np.testing.assert_allclose(np.ptp(changed('clipped', 0.5), axis=0), samples().std(axis=0))


def test_wear_halves_the_power_at_its_cut_off() -> None:
    tone = np.sin(2 * np.pi * 20.0 * np.arange(5000) / RATE_HZ)[:, None]
    worn = changed('wear', 20.0, tone)
    assert worn[1000:].var() / tone.var() == pytest.approx(0.5, abs=0.05)


def test_half_the_speed_halves_the_frequency() -> None:
    tone = np.sin(2 * np.pi * 100.0 * np.arange(2000) / RATE_HZ)[:, None]
    slower = at_other_speed(tone, 1.0, 0.5)
    expected = np.sin(2 * np.pi * 50.0 * np.arange(4000) / RATE_HZ)
    np.testing.assert_allclose(slower[100:-100, 0], expected[100:-100], atol=0.01)


@pytest.mark.parametrize(
    ('shares', 'expected'),
    [((1.0, 0.95, 0.85), 1.5), ((0.5, 0.4), 0.5), ((1.0, 0.9), None), ((0.0, 0.0), None)],
)
def test_a_curve_breaks_down_where_it_crosses_nine_tenths_of_its_start(shares, expected) -> None:
    assert breakdown(range(len(shares)), shares) == (expected and pytest.approx(expected))


def test_factors_break_down_on_both_sides_of_one() -> None:
    ends = {name: Outcome(10, 0, 0, 0, 0, 10, (1.0, 1.0)) for _, name in ordered(ROWS['gain'])}
    worst = dataclasses.replace(ends[UNDISTURBED], label_right=0)
    lowest, *_, highest = (name for _, name in ordered(ROWS['gain']))
    found = breakdowns(ROWS['gain'], {**ends, lowest: worst, highest: worst})
    assert found == pytest.approx([0.9, 7.1])
    assert breakdown_strengths(ROWS['gain'], {**ends, lowest: worst, highest: worst}) == pytest.approx([0.68, 1.46])


def test_what_the_training_covers_is_read_from_the_recipe() -> None:
    augmentation = load_recipe('default').augmentation
    covered = {name: row.trained(augmentation) for name, row in ROWS.items()}
    assert covered['gain'] == pytest.approx((1 / 1.6, 1.6))
    assert covered['white noise'] == (0.0, 0.05)
    assert covered['speed'] == pytest.approx((0.85, 1.15))
    assert {name for name, own in covered.items() if own} == {'gain', 'white noise', 'speed'}


def batches(samples: np.ndarray, rate_hz: float, batch: int) -> LabelledSlide:
    """Return a slide that came in batches."""
    slide = LabelledSlide(Path(), 'a/1', 'a', 1, 0, None)
    state = ExplorationState(0, 'a/1', 'linear_slide', Phase.SLIDE, steady_s=len(samples) / rate_hz, surface='a')
    signals = [
        TactileSignal(0, 'pac', ('pac',), (), rate_hz, first, samples[first : first + batch].astype(np.float32))
        for first in range(0, len(samples), batch)
    ]
    return dataclasses.replace(slide, signals={VIBRATION: signals}, states=[state])


def test_a_slide_is_disturbed_as_a_whole_though_it_came_in_batches() -> None:
    tone = np.sin(2 * np.pi * 100.0 * np.arange(4400) / 2200.0)[:, None]
    in_one, in_many = (
        disturbed(batches(tone, 2200.0, size), ROWS['wear'], 100.0, np.random.default_rng(0)).signals[VIBRATION]
        for size in (4400, 44)
    )
    assert len(in_many) == 1
    np.testing.assert_array_equal(in_one[0].samples, in_many[0].samples)


def test_a_loss_stays_a_loss() -> None:
    slide = batches(np.ones((1000, 1)), 1000.0, 500)
    late = dataclasses.replace(slide.signals[VIBRATION][1], first_sample=600)
    slide = dataclasses.replace(slide, signals={VIBRATION: [slide.signals[VIBRATION][0], late]})
    found = disturbed(slide, ROWS['gain'], 2.0, np.random.default_rng(0)).signals[VIBRATION]
    assert [(run.first_sample, len(run.samples)) for run in found] == [(0, 500), (600, 500)]


@pytest.fixture(scope='module')
def slide() -> LabelledSlide:
    return simulate(TRAINED, 1, np.random.default_rng(0), conditions=True)[0]


@pytest.fixture(params=ROWS)
def row(request: pytest.FixtureRequest) -> DisturbanceSweep:
    return ROWS[request.param]


def vibration_of(item: LabelledSlide) -> np.ndarray:
    return np.concatenate([batch.samples for batch in item.signals['signal']])


def test_every_row_changes_the_samples_and_keeps_the_slide(row: DisturbanceSweep, slide: LabelledSlide) -> None:
    for strength in row.strengths:
        # A short slide may lose nothing of one in a thousand, so some seeds are tried.
        changed = [disturbed(slide, row, strength, np.random.default_rng(seed)) for seed in range(40)]
        assert changed[0].name == slide.name
        before = vibration_of(slide)
        assert any(_differ(vibration_of(one), before) for one in changed)


def _differ(own: np.ndarray, before: np.ndarray) -> bool:
    return own.shape != before.shape or not np.array_equal(own, before, equal_nan=True)


def test_the_same_other_finger_touches_all_slides(slide: LabelledSlide) -> None:
    finger = ROWS['another finger']
    one, other = (vibration_of(disturbed(slide, finger, 2.0, np.random.default_rng(seed))) for seed in (0, 1))
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
    assert dataclasses.astuple(outcome) == (4, 1, 1, 0, 1, 2, pytest.approx((0.0676, 0.9324), abs=1e-4))


@pytest.mark.benchmark
def test_the_quick_form_on_simulated_slides_gives_figures_of_all_compared(tmp_path: Path) -> None:
    result = run(BenchmarkOptions(out=tmp_path, quick=True))
    outcomes = result.numbers['default']['outcomes']
    assert 'simulated' in result.data
    assert len(outcomes) == 1 + 8 + 3 + 2
    assert len(result.numbers['SVC on log bands']['outcomes']) == 1 + 8 + 3
    clean = outcomes[UNDISTURBED]
    assert clean['slides'] == 36
    assert clean['label_right'] > 18  # chance is 3
    for outcome in outcomes.values():
        assert outcome['early_right'] + outcome['early_wrong'] <= outcome['slides']
        low, high = outcome['interval']
        assert low <= outcome['label_right'] / outcome['slides'] <= high
    outside = result.numbers['rejected_as_outside_training']['default']
    assert outside == {'undisturbed, simulated': 0.0, 'circle, simulated': 1.0}


@pytest.mark.parametrize('name', RECIPES)
def test_so_many_slides_are_simulated_that_each_recipe_may_be_certain(name: str) -> None:
    slides = TRAINED_SLIDES * len(load_scene(SCENE).surfaces)
    assert slides >= slides_needed(load_recipe(name).training.max_error_rate)
