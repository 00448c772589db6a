# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from texture_drivers.pvdf import ChargeLeak, ForceReconstructor, LeakingFilm

RATE_HZ = 4096.0
LEAK = ChargeLeak(resistance_ohm=1e8, capacitance_f=1.06e-9)  # T = 0.106 s, corner 1.5 Hz


def sine(frequency_hz, seconds=4.0):
    time_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    return np.sin(2 * np.pi * frequency_hz * time_s)[:, None]


def amplitude(samples):
    return np.sqrt(2) * samples[len(samples) // 2 :].std()


def test_a_step_of_force_decays_with_the_time_constant():
    charge = LeakingFilm(LEAK, RATE_HZ).update(np.ones((2000, 1)))
    time_s = np.arange(2000) / RATE_HZ
    np.testing.assert_allclose(charge[:, 0], 21e-12 * np.exp(-time_s / 0.106), rtol=1e-9)


def test_a_constant_force_leaves_no_charge():
    charge = LeakingFilm(LEAK, RATE_HZ).update(np.full((round(30 * 0.106 * RATE_HZ), 1), 5.0))
    assert abs(charge[-1, 0]) < 1e-12 * 21e-12 * 5.0
    assert LEAK.response(np.zeros(1))[0] == 0


@pytest.mark.parametrize('frequency_hz', [0.3, 1.5, 20.0, 300.0])
def test_a_vibration_is_weakened_as_the_transfer_function_says(frequency_hz):
    charge = LeakingFilm(LEAK, RATE_HZ).update(sine(frequency_hz, seconds=20.0))
    assert amplitude(charge) == pytest.approx(abs(LEAK.response(np.array([frequency_hz]))[0]), rel=0.01)


def test_at_the_corner_the_response_is_down_by_three_decibels():
    assert abs(LEAK.response(np.array([LEAK.corner_hz]))[0]) == pytest.approx(21e-12 / np.sqrt(2))


@pytest.mark.parametrize('frequency_hz', [2.0, 10.0, 100.0, 1000.0])
def test_what_leaked_is_restored_in_the_pass_band(frequency_hz):
    force = sine(frequency_hz)
    restored = ForceReconstructor(LEAK, RATE_HZ, from_hz=0.1).update(LeakingFilm(LEAK, RATE_HZ).update(force))
    late = slice(len(force) // 2, None)
    assert np.abs(restored - force)[late].max() < 1.3 * 0.1 / frequency_hz + 0.001


def test_batches_give_the_same_as_the_whole():
    force = np.random.default_rng(0).standard_normal((1000, 2))
    whole = LeakingFilm(LEAK, RATE_HZ).update(force)
    film = LeakingFilm(LEAK, RATE_HZ)
    np.testing.assert_allclose(np.concatenate([film.update(part) for part in np.split(force, 10)]), whole, rtol=1e-9)
