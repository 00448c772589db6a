# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import dataclasses
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.study import BenchmarkOptions
from texture_benchmarks.trust import ROWS, UNDISTURBED, VIBRATION, disturbed, outcome, run
from texture_core.types import ExplorationState, Phase, Rejection, TactileSignal, TextureEstimate
from texture_evaluation.metrics import SlideResult
from texture_recordings.slides import LabelledSlide

pytestmark = pytest.mark.ros

RATE_HZ = 1000.0


def changed(row: str, strength: float, samples: np.ndarray) -> np.ndarray:
    """Return the vibration of a slide under a disturbance."""
    [run] = disturbed(batches(samples, RATE_HZ, 100), ROWS[row], strength, np.random.default_rng(1)).signals[VIBRATION]
    return run.samples


def test_strengths_are_in_the_units_that_the_rows_name() -> None:
    samples = 5.0 + np.random.default_rng(0).normal(size=(3000, 1)) * 20.0
    rms = samples.std()
    assert (changed('white noise', 1.0, samples) - samples).std() == pytest.approx(rms, rel=0.1)
    assert (changed('offset drift', 3.0, samples) - samples)[1000] == pytest.approx(3.0 * rms, rel=1e-3)
    assert changed('gain', 0.5, samples) == pytest.approx(0.5 * samples)
    assert (np.diff(changed('hidden losses', 0.5, samples), axis=0) == 0).mean() == pytest.approx(0.5, abs=0.1)
    assert np.ptp(changed('clipped', 0.5, samples)) == pytest.approx(rms, rel=1e-3)


def test_wear_halves_the_power_at_its_cut_off_and_half_the_speed_the_frequency() -> None:
    time_s = np.arange(4000)[:, None] / RATE_HZ
    tone = np.sin(2 * np.pi * 100.0 * time_s)
    assert changed('wear', 20.0, np.sin(2 * np.pi * 20.0 * time_s)).var() / tone.var() == pytest.approx(0.5, abs=0.05)
    slower = changed('speed', 0.5, tone)
    np.testing.assert_allclose(slower[100:-100], np.sin(2 * np.pi * 50.0 * time_s)[100:-100], atol=0.01)


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


def test_the_same_other_finger_touches_all_slides() -> None:
    slide = batches(np.random.default_rng(0).standard_normal((1000, 1)), RATE_HZ, 100)
    one, other = (
        disturbed(slide, ROWS['another finger'], 2.0, np.random.default_rng(seed)).signals[VIBRATION][0].samples
        for seed in (0, 1)
    )
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
    slides = [[undecided, right, wrong], [undecided, wrong, rejected], [undecided, rejected], [undecided]]
    found = outcome([SlideResult('cork', [], estimates) for estimates in slides])
    assert found.pop('interval') == pytest.approx([0.025, 0.975])
    assert list(found.values()) == [4, 1, 1, 0, 2, 2]


@pytest.mark.benchmark
def test_the_quick_form_gives_figures_of_all_compared(tmp_path: Path, data: Path) -> None:
    numbers = run(BenchmarkOptions(tmp_path, data, quick=True)).numbers
    assert len(numbers['default']['outcomes']) == len(numbers['SVC on log bands']['outcomes']) == 1 + 8 + 4
    assert numbers['default']['outcomes'][UNDISTURBED]['correct'] > 12  # of 18
    for one in numbers['default']['outcomes'].values():
        assert one['early_correct'] + one['early_wrong'] <= one['slides'] == 18
        low, high = one['interval']
        assert low <= one['correct'] / one['slides'] <= high
