# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from scipy.signal import lfilter

from texture_drivers.pvdf import ChargeLeak, ForceReconstructor

RATE_HZ = 4096.0
LEAK = ChargeLeak(resistance_ohm=1e8, capacitance_f=1.06e-9)  # T = 0.106 s, corner 1.5 Hz


def leaked(force: np.ndarray) -> np.ndarray:
    """Return the charge, C, of a force that is constant between samples (Hu et al. 2014, eq. 5)."""
    return 21e-12 * lfilter([1.0, -1.0], [1.0, -np.exp(-1 / (0.106 * RATE_HZ))], force, axis=0)


@pytest.mark.parametrize('frequency_hz', [2.0, 10.0, 100.0, 1000.0])
def test_what_leaked_is_restored_in_the_pass_band(frequency_hz):
    force = np.sin(2 * np.pi * frequency_hz * np.arange(round(4 * RATE_HZ)) / RATE_HZ)[:, None]
    restored = ForceReconstructor(LEAK, RATE_HZ, from_hz=0.1).update(leaked(force))
    late = slice(len(force) // 2, None)
    assert np.abs(restored - force)[late].max() < 1.3 * 0.1 / frequency_hz + 0.001


def test_a_step_of_force_is_restored_and_lost_again_below_the_lowest_frequency():
    restored = ForceReconstructor(LEAK, RATE_HZ, from_hz=0.1).update(leaked(np.ones((8192, 1))))[:, 0]
    np.testing.assert_allclose(restored, np.exp(-2 * np.pi * 0.1 * np.arange(8192) / RATE_HZ), rtol=1e-6)


def test_batches_give_the_same_as_the_whole_and_a_restart_forgets():
    charge = leaked(np.random.default_rng(0).standard_normal((1000, 2)))
    whole = ForceReconstructor(LEAK, RATE_HZ, from_hz=0.1).update(charge)
    parts = ForceReconstructor(LEAK, RATE_HZ, from_hz=0.1)
    np.testing.assert_allclose(np.concatenate([parts.update(part) for part in np.split(charge, 10)]), whole, rtol=1e-9)
    parts.restart()
    np.testing.assert_allclose(parts.update(charge), whole, rtol=1e-9)
