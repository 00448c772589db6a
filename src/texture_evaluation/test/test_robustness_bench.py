import math
import os
from pathlib import Path

import numpy as np
import pytest

from texture_evaluation.bench import BENCHES
from texture_evaluation.benches.result import Bench
from texture_evaluation.degradations import DEGRADATIONS, Degradation, breakdown, rms

DATA = Path(os.environ.get('TEXTURE_DATA') or Path(__file__).resolve().parents[4] / 'shared' / 'data')
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


def test_strengths_only_rise_or_only_fall(degradation: Degradation) -> None:
    assert list(degradation.strengths) in (sorted(degradation.strengths), sorted(degradation.strengths, reverse=True))


def test_degradations_do_what_they_say() -> None:
    np.testing.assert_allclose(rms(changed('white noise', 1.0) - samples()), rms(samples()), rtol=0.1)
    np.testing.assert_allclose((changed('offset drift', 3.0) - samples())[1000], 3.0 * rms(samples()))
    assert np.isnan(changed('lost samples', 0.1)).mean() == pytest.approx(0.1, abs=0.05)
    assert (np.diff(changed('losses hidden', 0.5), axis=0) == 0).mean() == pytest.approx(0.5, abs=0.1)
    assert len(changed('faster than taught', 2.0)) == 1500
    np.testing.assert_allclose(np.ptp(changed('clipping', 0.5), axis=0), rms(samples()))


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


@pytest.mark.skipif(not DATA.is_dir(), reason=f'no recorded data in {DATA}; set TEXTURE_DATA to its folder')
def test_noise_breaks_what_was_learnt_without_it(tmp_path: Path) -> None:
    result = BENCHES['robustness'](Bench(tmp_path, DATA, quick=True))
    assert all(chart.is_file() for chart in result.charts)
    assert set(result.numbers) == set(DEGRADATIONS)
    own = result.numbers['white noise']['recipes']['fast']
    assert own['window_accuracy'][0] > own['window_accuracy'][-1]
    rows = (tmp_path / 'robustness.md').read_text().splitlines()
    assert len(rows) == 3 + len(DEGRADATIONS)
