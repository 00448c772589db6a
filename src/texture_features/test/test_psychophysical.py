import numpy as np
import pytest
from scipy.signal import lfilter

from texture_core.errors import InvalidParameter
from texture_features.feature import WindowBatch
from texture_features.features.spectral import PacinianPower, PeakToMedianPower, SpectralExponent
from texture_features.features.taxels import SpatialBandPower, SpatialVariation
from texture_features.features.temporal import TemporalVariation

RATE_HZ = 1000.0
SPEEDS = (0.10, 0.15, 0.20)


def times(n_samples=2000):
    return np.arange(n_samples) / RATE_HZ


def windows(row, speed_m_s=0.15, force_n=2.0):
    return WindowBatch(np.asarray(row)[:, None], RATE_HZ, np.array(speed_m_s), np.array(force_n))


def wave(speed_m_s, pitch_m=1e-3, height=3.0):
    """Return what a finger gives that measures the rate of change of a sine of the surface."""
    turns = 2 * np.pi * speed_m_s / pitch_m
    return height * turns * np.cos(turns * times())


def value(feature, window):
    return float(feature(window)[0, 0])


def test_a_tone_at_the_best_frequency_has_its_own_power() -> None:
    tone = 2.0 * np.sin(2 * np.pi * 250.0 * times())
    assert value(PacinianPower(rate_of_change=False), windows(tone)) == pytest.approx(np.log(2.0), abs=0.05)


def test_an_octave_off_the_best_frequency_twelve_decibels_are_missing() -> None:
    feature = PacinianPower(rate_of_change=False, points=512)
    best, low, high = (value(feature, windows(np.sin(2 * np.pi * hz * times()))) for hz in (250.0, 125.0, 499.0))
    for off in (low, high):
        assert 10 * (best - off) / np.log(10) == pytest.approx(12.0, abs=0.3)


def test_weighed_at_one_speed_a_ridge_is_as_rough_whatever_the_speed() -> None:
    measured = [value(PacinianPower(), windows(wave(v), v)) for v in SPEEDS]
    constant = [value(PacinianPower(at_speed_m_s=0.15), windows(wave(v), v)) for v in SPEEDS]
    assert np.ptp(measured) > 2.0
    assert np.ptp(constant) < 0.1


@pytest.mark.parametrize(('coefficients', 'exponent'), [([1.0], 0.0), ([1.0, -0.999], 2.0)])
def test_white_noise_has_the_exponent_zero_and_its_sum_two(coefficients, exponent) -> None:
    noise = np.random.default_rng(0).normal(size=200_000)
    row = lfilter([1.0], coefficients, noise)
    feature = SpectralExponent(points=512, low_hz=20.0, high_hz=100.0)
    assert value(feature, windows(row)) == pytest.approx(exponent, abs=0.1)


def test_the_rate_of_change_adds_two_to_the_exponent() -> None:
    noise = np.random.default_rng(0).normal(size=20_000)
    plain, integrated = (value(SpectralExponent(rate_of_change=r), windows(noise)) for r in (False, True))
    assert integrated - plain == pytest.approx(2.0, abs=1e-9)


def test_a_band_without_two_lines_has_no_exponent() -> None:
    assert value(SpectralExponent(low_hz=400.0, high_hz=401.0), windows(np.sin(times()))) == 0.0


def test_temporal_variation_of_a_ramp_is_its_slope() -> None:
    assert value(TemporalVariation(lag_s=0.004), windows(3.0 * np.arange(100.0))) == pytest.approx(np.log(12.0))


@pytest.mark.parametrize('speed_m_s', SPEEDS)
def test_spatial_variation_of_a_wave_is_that_of_places_apart_at_any_speed(speed_m_s) -> None:
    # The mean square of h·(sin(φ + δ) - sin φ) is h²·(1 - cos δ).
    expected = np.log(3.0**2 * (1 - np.cos(2 * np.pi * 0.25)))
    feature = SpatialVariation(lag_m=2.5e-4, points=512)
    assert value(feature, windows(wave(speed_m_s), speed_m_s)) == pytest.approx(expected, abs=0.06)


def test_the_spatial_level_is_that_of_the_surface_at_any_speed() -> None:
    levels = np.array([SpatialBandPower()(windows(wave(v), v))[0] for v in SPEEDS])
    assert set(levels.argmax(axis=1)) == {1}  # 1 mm lies in the second of four bands from 2 mm to 0.45 mm
    assert np.ptp(levels[:, 1]) < 0.1


def test_the_density_in_waves_per_metre_adds_up_to_the_power() -> None:
    feature = SpatialBandPower(bands=1, longest_m=0.15 / 100, shortest_m=0.15 / 300, rate_of_change=False)
    tone = 2.0 * np.sin(2 * np.pi * 200.0 * times())
    power = np.exp(value(feature, windows(tone))) * (300 - 100) / 0.15
    assert power == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize('feature', [SpatialBandPower(bands=2), SpatialVariation(), PacinianPower(at_speed_m_s=0.1)])
def test_without_a_speed_there_is_no_value(feature) -> None:
    assert np.isnan(feature(windows(wave(0.15), np.nan))).all()


@pytest.mark.parametrize('feature', [SpatialBandPower, SpatialVariation, PacinianPower])
def test_hertz_takes_the_force_out(feature) -> None:
    light = value(feature(force_exponent=2 / 3), windows(wave(0.15), force_n=1.0))
    firm = value(feature(force_exponent=2 / 3), windows(8 ** (1 / 3) * wave(0.15), force_n=8.0))
    assert light == pytest.approx(firm, abs=1e-9)


def test_waves_the_wrong_way_round_are_refused() -> None:
    with pytest.raises(InvalidParameter, match='must be longer'):
        SpatialBandPower(longest_m=1e-4)


def test_a_skid_stands_out_and_an_even_hum_does_not() -> None:
    hum = np.sin(2 * np.pi * 100.0 * times(500))
    skid = np.where((times(500) > 0.2) & (times(500) < 0.22), 10.0, 1.0) * hum
    assert abs(value(PeakToMedianPower(), windows(hum))) < 0.1
    assert value(PeakToMedianPower(), windows(skid)) > 3.0
    still = np.where((times(500) > 0.2) & (times(500) < 0.25), 0.01, 1.0) * hum
    assert value(PeakToMedianPower(), windows(still)) < 0.2
    assert value(PeakToMedianPower(segments=20, reference='minimum'), windows(still)) > 3.0
