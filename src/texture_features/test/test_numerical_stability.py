"""Whatever a window is like, every feature is a finite number."""

import numpy as np
import pytest

from texture_features.feature import WindowBatch
from texture_features.feature_set import FEATURES

RATE_HZ = 1000.0
NOISE = np.random.default_rng(0).normal(size=(500, 2))
DIFFICULT = {
    'one channel twice': np.repeat(NOISE[:, :1], 2, axis=1),
    'channels that hardly differ': NOISE[:, :1] + 1e-9 * NOISE,
    'in many units': NOISE * [1e-6, 1e6],
    'far from zero': 1e6 + NOISE,
    'one spike': np.where(np.arange(500) == 250, 1.0, 0.0)[:, None],
    'between the ends of a float32': 3e38 * (-1.0) ** np.arange(500)[:, None],
    'at the smallest of a float32': 1e-45 * (-1.0) ** np.arange(500)[:, None],
}


@pytest.mark.filterwarnings('error::RuntimeWarning')
@pytest.mark.parametrize('name', FEATURES)
@pytest.mark.parametrize('samples', DIFFICULT.values(), ids=DIFFICULT)
def test_values_are_finite(name, samples):
    window = WindowBatch(samples, RATE_HZ, np.asarray(0.1), np.asarray(2.0), tangential_force_n=np.asarray(0.5))
    assert np.isfinite(FEATURES[name]()(window)).all()
