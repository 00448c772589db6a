"""The features of the default recipe against their formulas, written down plainly."""

import numpy as np
import pytest
from scipy import signal as scipy_signal

from texture_features.feature import WindowBatch
from texture_features.feature_set import FEATURES
from texture_features.spectra import hann

RATE_HZ = 1000.0


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
