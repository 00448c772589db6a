# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest
from scipy import signal as scipy_signal
from scipy.signal import lfilter

from texture_core.errors import InvalidData, InvalidParameter
from texture_features.feature_set import FEATURES
from texture_features.features.spectral import (
    PacinianPower,
    PeakToMedianPower,
    SpectralExponent,
    hann,
    mean_over_segments,
    segment_densities,
)
from texture_features.features.taxels import SpatialBandPower, SpatialVariation
from texture_features.windows import WindowBatch

RATE_HZ = 1000.0
EVERY = pytest.mark.parametrize('name', FEATURES)


def noise(*shape, seed=0):
    return np.random.default_rng(seed).normal(size=shape)


def tone(frequency_hz, n_samples=1000, amplitude=1.0):
    return amplitude * np.sin(2 * np.pi * frequency_hz * np.arange(n_samples) / RATE_HZ)[:, None]


def windows(samples, speed_m_s=0.1, force_n=2.0):
    leading = np.asarray(samples).shape[:-2]
    speed, force = np.full(leading, speed_m_s), np.full(leading, force_n)
    return WindowBatch(np.asarray(samples), RATE_HZ, speed, force, tangential_force_n=0.5 * force)


DIFFICULT = {
    'zero': np.zeros((500, 2)),
    'constant': np.full((500, 2), 0.1),
    'one sample': noise(1, 2),
    'two samples': noise(2, 2),
    'three samples': noise(3, 1),
    'tone': tone(120.0),
    'one channel twice': np.repeat(noise(500, 1), 2, axis=1),
    'channels that hardly differ': noise(500, 1) + 1e-9 * noise(500, 2, seed=1),
    'in many units': noise(500, 2) * [1e-6, 1e6],
    'far from zero': 1e6 + noise(500, 2),
    'one spike': np.where(np.arange(500) == 250, 1.0, 0.0)[:, None],
    'between the ends of a float32': 3e38 * (-1.0) ** np.arange(500)[:, None],
    'at the smallest of a float32': 1e-45 * (-1.0) ** np.arange(500)[:, None],
}


@EVERY
@pytest.mark.filterwarnings('error::RuntimeWarning')
@pytest.mark.parametrize('samples', DIFFICULT.values(), ids=DIFFICULT)
def test_any_finite_window_gives_finite_values(name, samples):
    assert np.isfinite(FEATURES[name]()(windows(samples))).all()


# By feature: how its values of a signal follow from those of one 1000 times as weak, and whether an offset changes none
# of them.
SAME, TIMES, SHIFTED, OTHER = 'the same', 'times 1000', 'plus log 1000 squared', 'none of these'
LAWS = {
    'mean_log_bands': (SHIFTED, True),
    'low_fft_bins': (SHIFTED, True),
    'hjorth': (OTHER, True),
    'moments': (OTHER, True),
    'power_autocorrelation': (SAME, True),
    'mean': (TIMES, False),
    'log_variance': (SHIFTED, True),
    'log_difference_variance': (SHIFTED, True),
    'pacinian_power': (SHIFTED, True),
    'spectral_exponent': (SAME, True),
    'temporal_variation': (OTHER, True),
    'spatial_variation': (SHIFTED, True),
    'spatial_band_power': (SHIFTED, True),
    'peak_to_median_power': (SAME, True),
    'mean_spatial_bands': (OTHER, True),
    'mean_statistics': (OTHER, False),
    'difference_correlation': (OTHER, True),
    'load_level': (SHIFTED, False),
    'speed': (SAME, True),
    'force': (SAME, True),
    'friction': (SAME, True),
}


@pytest.mark.parametrize('name', sorted({*FEATURES, *LAWS}))
def test_gain_and_offset_of_the_sensor_act_as_declared(name):
    assert name in LAWS, f"list in LAWS of this file how gain and offset of the sensor act on '{name}'"
    law, offset_free = LAWS[name]
    feature, samples = FEATURES[name](), noise(500, 2)
    weak, strong, shifted = (feature(windows(changed)) for changed in (samples, 1000.0 * samples, samples + 100.0))
    expected = {SAME: weak, TIMES: 1e3 * weak, SHIFTED: weak + np.log(1e6)}
    found = [holds for holds, values in expected.items() if np.allclose(strong, values, rtol=1e-9, atol=0.0)]
    assert (found or [OTHER]) == [law]
    assert np.allclose(shifted, weak, rtol=1e-6, atol=0.0) == offset_free


@EVERY
def test_values_come_for_each_channel_and_name(name):
    feature = FEATURES[name]()
    pairs = getattr(feature, 'per_pair', False)  # of three channels there are three
    channels = 3 if feature.per_channel or pairs else 1
    assert feature(windows(noise(500, 3))).shape == (channels, len(feature.names))
    assert len(set(feature.names)) == len(feature.names)


@EVERY
def test_many_windows_give_the_very_values_of_each(name):
    samples, speeds = noise(4, 500, 3), np.array([0.02, np.nan, 0.1, 0.0])
    feature = FEATURES[name]()
    together = feature(windows(samples, speeds))
    for window, speed, values in zip(samples, speeds, together, strict=True):
        np.testing.assert_array_equal(feature(windows(window, speed)), values)


@pytest.mark.parametrize('shape', [(0, 2), (500, 0), (500,)])
def test_empty_windows_are_refused(shape):
    with pytest.raises(InvalidData, match='at least one'):
        WindowBatch(np.zeros(shape), RATE_HZ)


@pytest.mark.parametrize('n_samples', [100, 256, 500, 1100])
def test_density_agrees_with_scipy(n_samples):
    rows = noise(3, n_samples)
    length = min(n_samples, 256)
    _, expected = scipy_signal.welch(
        rows, RATE_HZ, window=hann(length), nperseg=length, noverlap=128 if length == 256 else None, nfft=256
    )
    np.testing.assert_allclose(
        mean_over_segments(segment_densities(rows, RATE_HZ, 256, 128, 128)), expected[:, 1:], rtol=1e-9, atol=1e-15
    )


@EVERY
@pytest.mark.parametrize('speed_m_s', [0.0, np.nan, -0.1])
def test_without_a_speed_what_needs_one_is_not_a_number_and_the_rest_is_as_ever(name, speed_m_s):
    still, moving = (FEATURES[name]()(windows(noise(500, 2), speed_m_s=speed)) for speed in (speed_m_s, 0.1))
    assert np.array_equal(still, moving) or np.isnan(still).all() or name == 'speed'
    if 'at_speed_m_s' in FEATURES[name].__dataclass_fields__:
        assert np.isnan(FEATURES[name](at_speed_m_s=0.1)(windows(noise(500, 2), speed_m_s=speed_m_s))).all()


def plain_typical_bands(row):
    cuts = [row[start : start + 64] for start in range(0, len(row) - 63, 16)]
    each = [scipy_signal.periodogram(cut, RATE_HZ, window=hann(64), detrend='constant')[1][1:] for cut in cuts]
    return np.mean(np.log(each), axis=0)


def plain_moments(row):
    orders = [np.append(np.diff(row, n), np.zeros(n)) for n in range(3)]
    power = np.array([np.mean(x**2) for x in orders])
    return np.concatenate(
        (
            np.log(power),
            np.log([np.mean(np.abs(x)) for x in orders]),
            np.array([np.mean(x**3) for x in orders]) / power**1.5,
            np.log([np.mean(x**4) for x in orders] / power**2),
        )
    )


def plain_power_echo(row):
    values = []
    for power in (row[:-1] ** 2, np.diff(row) ** 2):
        count = len(power) - 64
        for lag in (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64):
            echo = np.mean([power[t] * power[t + lag] for t in range(count)])
            values.append(np.log(echo / power.mean() ** 2 + 1e-3))
    return values


PLAIN = {'mean_log_bands': plain_typical_bands, 'moments': plain_moments, 'power_autocorrelation': plain_power_echo}


@pytest.mark.parametrize('shape', [(500, 1), (130, 3)])
@pytest.mark.parametrize('name', PLAIN)
def test_the_fast_way_to_the_values_gives_those_of_the_plain_formula(name, shape):
    samples = 3.0 * np.random.default_rng(0).normal(size=shape) + 20.0
    expected = [PLAIN[name](channel - channel.mean()) for channel in samples.T]
    np.testing.assert_allclose(FEATURES[name]()(WindowBatch(samples, RATE_HZ)), expected, rtol=1e-9, atol=1e-9)


SPEEDS = (0.10, 0.15, 0.20)


def times(n_samples=2000):
    return np.arange(n_samples) / RATE_HZ


def row_windows(row, speed_m_s=0.15, force_n=2.0):
    return WindowBatch(np.asarray(row)[:, None], RATE_HZ, np.array(speed_m_s), np.array(force_n))


def wave(speed_m_s, pitch_m=1e-3, height=3.0):
    """Return what a finger gives that measures the rate of change of a sine of the surface."""
    turns = 2 * np.pi * speed_m_s / pitch_m
    return height * turns * np.cos(turns * times())


def value(feature, window):
    return float(feature(window)[0, 0])


def test_weighed_at_one_speed_a_ridge_is_as_rough_whatever_the_speed() -> None:
    measured = [value(PacinianPower(), row_windows(wave(v), v)) for v in SPEEDS]
    constant = [value(PacinianPower(at_speed_m_s=0.15), row_windows(wave(v), v)) for v in SPEEDS]
    assert np.ptp(measured) > 2.0
    assert np.ptp(constant) < 0.1


@pytest.mark.parametrize(('coefficients', 'exponent'), [([1.0], 0.0), ([1.0, -0.999], 2.0)])
def test_white_noise_has_the_exponent_zero_and_its_sum_two(coefficients, exponent) -> None:
    noise = np.random.default_rng(0).normal(size=200_000)
    row = lfilter([1.0], coefficients, noise)
    feature = SpectralExponent(points=512, low_hz=20.0, high_hz=100.0)
    assert value(feature, row_windows(row)) == pytest.approx(exponent, abs=0.1)


@pytest.mark.parametrize('speed_m_s', SPEEDS)
def test_spatial_variation_of_a_wave_is_that_of_places_at_a_distance_at_any_speed(speed_m_s) -> None:
    # The mean square of h·(sin(φ + δ) - sin φ) is h²·(1 - cos δ).
    expected = np.log(3.0**2 * (1 - np.cos(2 * np.pi * 0.25)))
    feature = SpatialVariation(lag_m=2.5e-4, points=512)
    assert value(feature, row_windows(wave(speed_m_s), speed_m_s)) == pytest.approx(expected, abs=0.06)


def test_the_spatial_level_is_that_of_the_surface_at_any_speed() -> None:
    levels = np.array([SpatialBandPower()(row_windows(wave(v), v))[0] for v in SPEEDS])
    assert set(levels.argmax(axis=1)) == {1}  # 1 mm lies in the second of four bands from 2 mm to 0.45 mm
    assert np.ptp(levels[:, 1]) < 0.1


def test_waves_the_wrong_way_round_are_refused() -> None:
    with pytest.raises(InvalidParameter, match='must be longer'):
        SpatialBandPower(longest_m=1e-4)


def test_a_skid_stands_out_and_an_even_hum_does_not() -> None:
    hum = np.sin(2 * np.pi * 100.0 * times(500))
    skid = np.where((times(500) > 0.2) & (times(500) < 0.22), 10.0, 1.0) * hum
    assert abs(value(PeakToMedianPower(), row_windows(hum))) < 0.1
    assert value(PeakToMedianPower(), row_windows(skid)) > 3.0
    still = np.where((times(500) > 0.2) & (times(500) < 0.25), 0.01, 1.0) * hum
    assert value(PeakToMedianPower(), row_windows(still)) < 0.2
    assert value(PeakToMedianPower(segments=20, reference='minimum'), row_windows(still)) > 3.0


SPATIAL_RATE_HZ = 400.0
PITCH_M = 4e-3
SPEEDS_M_S = (0.02, 0.05, 0.1)
PLACES_M = np.array([0.0, 1e-3, 5e-3, 9e-3])


def slide(speed_m_s, distance_m=0.05, places_m=PLACES_M, surface=None):
    """Slide an array of taxels over a surface: each measures the height at its place."""
    along = np.arange(round(distance_m / speed_m_s * SPATIAL_RATE_HZ)) / SPATIAL_RATE_HZ * speed_m_s
    surface = surface or (lambda x: np.sin(2 * np.pi * x / PITCH_M))
    return surface(along[:, None] + places_m)


def measured(speed_m_s, **options):
    return WindowBatch(slide(speed_m_s, **options), SPATIAL_RATE_HZ, np.array(speed_m_s))


def rough(seed=0, waves=60):
    """Return a surface of many waves, 2 to 20 mm long."""
    rng = np.random.default_rng(seed)
    per_m, phase = rng.uniform(50.0, 500.0, waves), rng.uniform(0.0, 2 * np.pi, waves)
    return lambda x: np.sin(2 * np.pi * x[..., None] * per_m + phase).sum(axis=-1)


def test_spatial_bands_are_those_of_the_surface_not_of_the_speed():
    feature = FEATURES['mean_spatial_bands'](bands=8, longest_m=20e-3, shortest_m=2e-3, normalised=False)
    slow, fast = (feature(measured(speed, distance_m=0.5, surface=rough())) for speed in (0.05, 0.1))
    np.testing.assert_allclose(slow, fast, atol=0.02)


def test_the_power_in_all_bands_adds_up_to_the_variance():
    feature = FEATURES['mean_spatial_bands'](bands=64, longest_m=0.1, shortest_m=1e-3, normalised=False)
    density = np.exp(feature(measured(0.05, distance_m=0.5, places_m=PLACES_M[:1])))[0]
    assert (density * np.diff(feature.edges_per_m)).sum() == pytest.approx(0.5, rel=0.02)


def test_the_mean_over_the_taxels_does_not_know_which_measured_it():
    samples = slide(0.05) * np.array([1.0, 2.0, 3.0, 4.0])
    for name in ('mean_spatial_bands', 'mean_statistics'):
        feature = FEATURES[name]()
        there, swapped = (feature(WindowBatch(x, SPATIAL_RATE_HZ, np.array(0.05))) for x in (samples, samples[:, ::-1]))
        np.testing.assert_allclose(there, swapped, rtol=1e-9)


def test_a_harder_touch_leaves_the_normalised_bands_and_no_offset_counts():
    feature = FEATURES['mean_spatial_bands'](floor=1e-30)
    soft = feature(measured(0.05, surface=rough()))
    hard = feature(WindowBatch(5.0 + 3.0 * slide(0.05, surface=rough()), SPATIAL_RATE_HZ, np.array(0.05)))
    np.testing.assert_allclose(soft, hard, atol=1e-4)


def test_shape_has_its_closed_forms():
    ramp = np.arange(8.0)[:, None]
    level, log_variance, rise, absolute, above, skewness = FEATURES['mean_statistics']()(
        WindowBatch(-ramp, SPATIAL_RATE_HZ)
    )[0]
    assert (level, log_variance) == (pytest.approx(-3.5), pytest.approx(np.log(5.25), abs=1e-4))
    assert (rise, absolute, above) == (pytest.approx(-6.0), pytest.approx(6.0), pytest.approx(0.5))
    assert skewness == pytest.approx(0.0, abs=1e-9)
