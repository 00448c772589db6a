import numpy as np
import pytest
from scipy import signal as scipy_signal

from texture_core.errors import InvalidData
from texture_features.feature import WindowBatch
from texture_features.feature_set import FEATURES
from texture_features.features.spectral import LogBands
from texture_features.features.temporal import hjorth
from texture_features.spectra import hann, mean_over_segments, segment_densities

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


@EVERY
@pytest.mark.parametrize(
    'samples',
    [np.zeros((500, 2)), np.full((500, 2), 0.1), noise(1, 2), noise(2, 2), noise(3, 1), tone(120.0)],
    ids=['zero', 'constant', 'one sample', 'two samples', 'three samples', 'tone'],
)
def test_any_finite_window_gives_finite_values(name, samples):
    assert np.isfinite(FEATURES[name]()(windows(samples))).all()


@EVERY
@pytest.mark.parametrize('scale', [1e-6, 1e6])
def test_weak_and_strong_signals_give_finite_values(name, scale):
    samples = (scale * noise(500, 2)).astype(np.float32).astype(np.float64)
    assert np.isfinite(FEATURES[name]()(windows(samples))).all()


# How the values of a signal follow from those of one 1000 times as weak; the rest says nothing of the kind.
SAME, TIMES, SQUARED, SHIFTED = 'the same', 'times 1000', 'times 1000 squared', 'plus log 1000 squared'
SCALING = {
    'log_bands': SHIFTED,
    'mean_log_bands': SHIFTED,
    'low_fft_bins': SHIFTED,
    'log_variance': SHIFTED,
    'log_difference_variance': SHIFTED,
    'short_time_fourier': SHIFTED,
    'mean': TIMES,
    'log_shares': SAME,
    'relative_changes': SAME,
    'power_autocorrelation': SAME,
    'load_level': SHIFTED,
    'speed': SAME,
    'force': SAME,
    'friction': SAME,
    'slide_onset': SAME,
}


@pytest.mark.parametrize(('name', 'law'), SCALING.items())
def test_the_gain_of_the_sensor_acts_as_declared(name, law):
    feature = FEATURES[name]()
    weak, strong = feature(windows(noise(500, 2))), feature(windows(1000.0 * noise(500, 2)))
    expected = {SAME: weak, TIMES: 1e3 * weak, SQUARED: 1e6 * weak, SHIFTED: weak + np.log(1e6)}[law]
    np.testing.assert_allclose(strong, expected, rtol=1e-9)


@EVERY
def test_values_come_for_each_channel_and_name(name):
    feature = FEATURES[name]()
    pairs = getattr(feature, 'per_pair', False)  # of three channels there are three
    channels = 3 if feature.per_channel or pairs else 1
    assert feature(windows(noise(500, 3))).shape == (channels, len(feature.names))
    assert len(set(feature.names)) == len(feature.names)


@EVERY
def test_many_windows_give_the_very_values_of_each(name):
    samples = noise(4, 500, 3)
    feature = FEATURES[name]()
    together = feature(windows(samples))
    for window, values in zip(samples, together, strict=True):
        np.testing.assert_array_equal(feature(windows(window)), values)


@EVERY
def test_the_samples_are_not_changed(name):
    samples = noise(300, 2)
    before = samples.copy()
    FEATURES[name]()(windows(samples))
    np.testing.assert_array_equal(samples, before)


@pytest.mark.parametrize('shape', [(0, 2), (500, 0), (500,)])
def test_empty_windows_are_refused(shape):
    with pytest.raises(InvalidData, match='at least one'):
        WindowBatch(np.zeros(shape), RATE_HZ)


@pytest.mark.parametrize(
    'name',
    [
        'log_bands',
        'mean_log_bands',
        'low_fft_bins',
        'hjorth',
        'log_variance',
        'log_difference_variance',
        'power_autocorrelation',
    ],
)
def test_an_offset_of_the_sensor_changes_nothing(name):
    feature = FEATURES[name]()
    np.testing.assert_allclose(feature(windows(noise(500, 2) + 100.0)), feature(windows(noise(500, 2))), rtol=1e-6)


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


def test_the_density_of_white_noise_adds_up_to_its_variance():
    rows = noise(1, 100_000)
    power = mean_over_segments(segment_densities(rows, RATE_HZ, 256, 128, 128)).sum() * RATE_HZ / 256
    assert power == pytest.approx(rows.var(), rel=0.02)


def test_the_highest_band_holds_the_tone():
    feature = LogBands(bands=32)
    highest = int(feature(windows(tone(203.0)))[0].argmax())
    assert feature.names[highest] == '13'  # band k reaches around k · 500 Hz / 32


def test_bursts_lie_above_what_is_typical_and_a_steady_hum_does_not():
    steady, bursts = tone(203.0), tone(203.0) * (np.arange(1000) % 250 < 50)[:, None]
    for samples, apart in ((steady, False), (bursts, True)):
        mean, typical = (FEATURES[name]()(windows(samples))[0, 12] for name in ('log_bands', 'mean_log_bands'))
        assert (mean - typical > 1.0) == apart


def test_low_lines_report_ridges_apart_that_share_a_band():
    feature = FEATURES['low_fft_bins'](points=256)
    lines = [feature.names[int(feature(windows(tone(hz)))[0].argmax())] for hz in (98.0, 106.0)]
    assert lines == ['25', '27']  # line k stands at k · 1000 / 256 Hz


def test_hjorth_of_a_tone_is_its_power_and_angular_frequency():
    activity, mobility, complexity = hjorth(tone(50.0, 10_000, amplitude=2.0).T)[0]
    assert activity == pytest.approx(2.0, rel=1e-3)
    assert mobility == pytest.approx(2 * np.sin(np.pi * 50.0 / RATE_HZ), rel=1e-3)
    assert complexity == pytest.approx(1.0, rel=1e-3)


@EVERY
@pytest.mark.parametrize('speed_m_s', [0.0, np.nan])
def test_without_a_speed_what_needs_one_is_not_a_number_and_the_rest_is_as_ever(name, speed_m_s):
    still, moving = (FEATURES[name]()(windows(noise(500, 2), speed_m_s=speed)) for speed in (speed_m_s, 0.1))
    assert np.array_equal(still, moving) or np.isnan(still).all() or name == 'speed'


def test_a_ramp_has_no_slope_variance():
    ramp = np.arange(50.0)[:, None]
    assert FEATURES['log_difference_variance'](floor=0.1)(windows(ramp))[0, 0] == pytest.approx(np.log(0.1))


def test_moments_of_a_tone_and_of_noise_are_those_of_their_distributions():
    feature = FEATURES['moments']()
    sine = dict(zip(feature.names, feature(windows(tone(50.0, amplitude=2.0)))[0], strict=True))
    assert sine['signal_log_power'] == pytest.approx(np.log(2.0))
    assert sine['signal_log_amplitude'] == pytest.approx(np.log(4.0 / np.pi), abs=0.02)
    assert sine['signal_log_kurtosis'] == pytest.approx(np.log(1.5), rel=1e-3)
    steps = np.log(2.0 * 4.0 * np.sin(np.pi * 50.0 / RATE_HZ) ** 2)
    assert sine['difference_log_power'] == pytest.approx(steps, rel=1e-2)
    assert sine['second_difference_log_power'] == pytest.approx(2.0 * steps - np.log(2.0), rel=1e-2)
    pushes = np.random.default_rng(0).exponential(size=(100_000, 1))
    values = dict(zip(feature.names, feature(windows(pushes))[0], strict=True))
    assert values['signal_skewness'] == pytest.approx(2.0, rel=0.05)
    assert values['signal_log_kurtosis'] == pytest.approx(np.log(9.0), rel=0.05)


def test_bursts_echo_as_long_as_they_last_and_noise_does_not():
    feature = FEATURES['power_autocorrelation']()
    assert feature.names[:7] == tuple(f'signal_{lag}' for lag in (1, 2, 3, 4, 6, 8, 12))
    hiss = noise(100_000, 1)
    np.testing.assert_allclose(feature(windows(hiss))[0, :12], 0.0, atol=0.02)
    bursts = hiss * (np.arange(100_000) % 128 < 16)[:, None]  # in an eighth of the time: a product is 8 times as large
    echo = dict(zip(feature.names, feature(windows(bursts))[0], strict=True))
    assert echo['signal_1'] == pytest.approx(np.log(8.0 * 15 / 16), abs=0.05)
    assert echo['signal_8'] == pytest.approx(np.log(8.0 * 8 / 16), abs=0.05)
    assert echo['signal_24'] < np.log(0.01)


def test_speed_and_force_pass_through_whatever_they_are():
    for speed in (0.0, 0.15, np.nan):
        np.testing.assert_array_equal(FEATURES['speed']()(windows(noise(5, 1), speed_m_s=speed)), [[speed]])
        np.testing.assert_array_equal(FEATURES['force']()(windows(noise(5, 1), force_n=speed)), [[speed]])
