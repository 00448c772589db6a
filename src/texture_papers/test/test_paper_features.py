# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Known answers of the features that the papers add: peaks, correlation, whole spectra."""

import numpy as np
import pytest
from scipy import signal as scipy_signal
from scipy import stats

from texture_features.feature_set import FeatureSet
from texture_features.features.spectral import hann, long_densities
from texture_features.windows import WindowBatch
from texture_papers.hu import Spectrum
from texture_papers.jamali import MeanAmplitude, RegionPeaks, region_peaks
from texture_papers.kaboli import Correlation, MeanHjorth, cell_means
from texture_papers.roberge import ArcLength, SignalEnergy, SpectralPeaks

RATE_HZ = 1000.0


def noise(*shape, seed=0):
    return np.random.default_rng(seed).normal(size=shape)


def tone(frequency_hz, n_samples=1000, amplitude=1.0):
    return amplitude * np.sin(2 * np.pi * frequency_hz * np.arange(n_samples) / RATE_HZ)[:, None]


def windows(samples, rate_hz=RATE_HZ):
    return WindowBatch(np.asarray(samples), rate_hz, np.full(samples.shape[:-2], 0.1), np.full(samples.shape[:-2], 2.0))


def spectrum_of(energies, width=4):
    """Return a spectrum of regions of given energies, each in the second of its bins; bin 0 is extra."""
    amplitudes = np.zeros((len(energies), width))
    amplitudes[:, 1] = np.sqrt(energies)
    return np.concatenate(([9.0], amplitudes.ravel()))


def grown_one_by_one(energies, count):
    """Return the regions of each peak as Jamali & Sammut's loop finds them, in the order in which peaks open."""
    peaks = []
    for region in np.argsort(-np.asarray(energies), kind='stable'):
        near = [peak for peak in peaks if region - 1 in peak or region + 1 in peak]
        if near:
            near[0] |= {region}.union(*near[1:])
            peaks = [peak for peak in peaks if peak not in near[1:]]
        else:
            peaks.append({region})
        if len(peaks) == count:
            return peaks
    return None


@pytest.mark.parametrize('count', [2, 3, 5])
def test_peaks_are_those_of_the_loop_in_the_paper(count):
    rng = np.random.default_rng(count)
    for _ in range(200):
        energies = rng.permutation(24) + 1.0
        peaks = grown_one_by_one(energies, count)
        if peaks is not None:
            best = [max(peak, key=lambda region: energies[region]) * 4 + 2 for peak in peaks]
            np.testing.assert_array_equal(region_peaks(spectrum_of(energies), count, 24), best)


def test_region_peaks_find_the_tones_by_strength_or_by_frequency():
    samples = tone(310.0) + tone(120.0, amplitude=0.5) + tone(200.0, amplitude=0.25)
    for order, expected in (('intensity', [310.0, 120.0, 200.0]), ('frequency', [120.0, 200.0, 310.0])):
        values = RegionPeaks(order=order)(windows(samples))[0]
        np.testing.assert_allclose(values, expected, atol=1.0)


def test_spectral_peaks_have_the_transform_of_2048_points():
    values = SpectralPeaks(peaks=1)(windows(tone(125.3, 500)))[0]
    step_hz = RATE_HZ / 2048
    assert values[0] == pytest.approx(round(125.3 / step_hz) * step_hz)
    assert values[1] == pytest.approx(1.0, rel=0.05)


def test_the_mean_amplitude_of_a_tone_around_an_offset_is_its_integral():
    # The integral of |sin + a|: (2 / pi) · (sqrt(1 - a²) + a · asin(a)).
    expected = 2 / np.pi * (np.sqrt(1 - 0.25**2) + 0.25 * np.arcsin(0.25))
    assert MeanAmplitude()(windows(tone(51.0) + 0.25))[0, 0] == pytest.approx(expected, rel=2e-3)


def test_the_spectrum_is_scipys_periodogram_as_power_magnitude_or_logarithm():
    samples = noise(500, 2)
    _, density = scipy_signal.periodogram(samples, RATE_HZ, window=hann(500), nfft=2048, axis=0)
    density = density[1:].T
    for scale, expected in (('power', density), ('magnitude', np.sqrt(density)), ('log', np.log(density))):
        np.testing.assert_allclose(Spectrum(points=1024, scale=scale)(windows(samples)), expected, rtol=1e-8)


def test_long_windows_are_averaged_over_half_overlapping_segments():
    rows = noise(2, 1000)
    _, expected = scipy_signal.welch(rows, RATE_HZ, window=hann(256), nperseg=256)
    np.testing.assert_allclose(long_densities(rows, RATE_HZ, 128), expected[:, 1:], rtol=1e-8)


def joined(fast, slow, fast_hz=2200.0, slow_hz=100.0):
    return WindowBatch(fast, fast_hz, joined=(WindowBatch(slow, slow_hz),))


def test_correlations_are_scipys_on_the_grid_of_the_slow_input():
    fast, slow = noise(1100, 1), noise(50, 3, seed=1)
    averaged = fast[:, 0].reshape(50, 22).mean(axis=1)
    pearson = np.mean([stats.pearsonr(averaged, column)[0] for column in slow.T])
    spearman = np.mean([stats.spearmanr(averaged, column)[0] for column in slow.T])
    np.testing.assert_allclose(Correlation()(joined(fast, slow)), [[pearson, spearman]], atol=1e-12)


@pytest.mark.parametrize(
    ('fast', 'slow'),
    [(np.full((1100, 1), 0.1), noise(50, 3)), (noise(1100, 1), np.full((50, 3), 0.3)), (noise(22, 1), noise(1, 3))],
    ids=['constant fast', 'constant slow', 'one sample'],
)
def test_what_does_not_vary_correlates_with_nothing(fast, slow):
    np.testing.assert_array_equal(Correlation()(joined(fast, slow)), [[0.0, 0.0]])


def test_cells_share_all_samples_though_rates_are_no_multiples():
    rows = np.arange(500.0)[None]
    cells = cell_means(rows, 30)
    np.testing.assert_allclose(cells[0], np.arange(30) * 500 / 30 + 8.0, atol=1.01)


BIOTAC = ('tdc', 'tac', 'pdc', *(f'electrode{number}' for number in range(1, 20)))


def test_the_recipes_of_kaboli_take_the_19_electrodes_of_a_biotac_alone():
    samples = noise(200, len(BIOTAC))
    for recipe in ('kaboli-svm', 'kaboli-pa', 'kaboli-em'):
        inputs = {item.topic: dict(item.features) for item in FeatureSet.load(recipe).inputs}
        mean = inputs['signal_static']['texture_papers.kaboli:MeanHjorth'](
            WindowBatch(samples, 100.0, channels=BIOTAC)
        )[0, 0]
        electrodes = [number for number, name in enumerate(BIOTAC) if name.startswith('electrode')]
        assert len(electrodes) == 19
        assert mean == pytest.approx(samples[:, electrodes].var(axis=0).mean())
        assert (
            inputs['signal+signal_static']['texture_papers.kaboli:Correlation'].omit
            == inputs['signal_static']['texture_papers.kaboli:MeanHjorth'].omit
        )


# What every feature of a paper must do, as those of texture_features

EVERY = (ArcLength, Correlation, MeanAmplitude, MeanHjorth, RegionPeaks, SignalEnergy, SpectralPeaks, Spectrum)
GAINS = {SignalEnergy: 1e6, MeanAmplitude: 1e3, RegionPeaks: 1.0, Correlation: 1.0}


@pytest.mark.parametrize('cls', EVERY)
def test_many_windows_give_the_very_values_of_each_and_no_sample_is_changed(cls):
    feature, samples = cls(), noise(4, 500, 3)
    before = samples.copy()
    together = feature(windows(samples))
    assert together.shape == (4, 3 if feature.per_channel else 1, len(feature.names))
    for window, values in zip(samples, together, strict=True):
        np.testing.assert_array_equal(feature(windows(window)), values)
    np.testing.assert_array_equal(samples, before)


@pytest.mark.parametrize('cls', EVERY)
@pytest.mark.parametrize('samples', [np.zeros((500, 2)), np.ones((1, 2)), 1e6 * noise(500, 2), 1e-6 * noise(500, 2)])
def test_silence_single_samples_and_any_gain_give_finite_values(cls, samples):
    assert np.isfinite(cls()(windows(samples))).all()


@pytest.mark.parametrize(('cls', 'factor'), GAINS.items())
def test_the_gain_of_the_sensor_acts_as_declared_on_paper_features(cls, factor):
    weak, strong = cls()(windows(noise(500, 2))), cls()(windows(1000.0 * noise(500, 2)))
    np.testing.assert_allclose(strong, factor * weak, rtol=1e-9)


def test_spectral_peaks_are_the_tones_by_strength_or_by_frequency():
    samples = windows(tone(310.0) + tone(120.0, amplitude=0.5))
    for order, expected in (('intensity', [310.0, 1.0, 120.0, 0.5]), ('frequency', [120.0, 0.5, 310.0, 1.0])):
        feature = SpectralPeaks(peaks=2, order=order)
        assert feature.names == ('1/frequency_hz', '1/amplitude', '2/frequency_hz', '2/amplitude')
        np.testing.assert_allclose(feature(samples)[0], expected, rtol=0.05)


def test_integral_and_arc_length_have_their_closed_forms():
    assert SignalEnergy()(windows(tone(50.0, amplitude=2.0)))[0, 0] == pytest.approx(2.0, rel=1e-6)
    ramp = np.arange(11.0)[:, None] * 3.0
    line = WindowBatch(ramp, rate_hz=0.25)  # steps of 4 s and 3 units: 5 long
    assert ArcLength()(line)[0, 0] == pytest.approx(50.0)
