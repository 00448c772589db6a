# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Free air is proven by a rise without a change of the force, never by the height alone."""

import numpy as np
import pytest

from texture_exploration.arms.arm import FreeAir

STEP_NS = 4_000_000
RISE_M, STEADY_N = 0.003, 0.5


class Finger:
    """A finger over an elastic surface at height 0, with a force sensor that has an offset."""

    def __init__(self, height_m, stiffness_n_m=2000.0, offset_n=0.0, noise_n=0.0):
        self.air = FreeAir(RISE_M, STEADY_N)
        self.height_m, self.x_m = height_m, 0.0
        self._stiffness_n_m, self._offset_n, self._noise_n = stiffness_n_m, offset_n, noise_n
        self._rng = np.random.default_rng(3)
        self._time_ns = 0
        self.force_n = lambda: self._stiffness_n_m * max(0.0, -self.height_m)

    def go(self, seconds, up_m_s=0.0, along_m_s=0.0):
        for _ in range(round(seconds / (STEP_NS * 1e-9))):
            self._time_ns += STEP_NS
            self.height_m += up_m_s * STEP_NS * 1e-9
            self.x_m += along_m_s * STEP_NS * 1e-9
            force = self.force_n() + self._offset_n + self._noise_n * self._rng.standard_normal()
            self.air.update(self._time_ns, (self.x_m, 0.0, self.height_m), force)
        return self.air.proven


def test_rest_proves_nothing_however_high_the_finger_is():
    assert not Finger(0.1).go(10.0)


@pytest.mark.parametrize('offset_n', [0.0, -8.0, 8.0])
def test_a_rise_through_air_proves_it_whatever_the_offset_of_the_sensor(offset_n):
    finger = Finger(0.01, offset_n=offset_n, noise_n=0.1)
    assert not finger.go(0.1, 0.02)
    assert finger.go(0.1, 0.02)


@pytest.mark.parametrize('stiffness_n_m', [200.0, 2000.0, 20000.0])
def test_a_rise_in_contact_proves_nothing_until_the_finger_has_left_the_surface(stiffness_n_m):
    finger = Finger(-5.0 / stiffness_n_m, stiffness_n_m)
    while finger.height_m < RISE_M - STEADY_N / stiffness_n_m:
        assert not finger.go(0.004, 0.02)
    assert finger.go(0.5, 0.02)


def test_contact_ends_the_proof_and_a_new_rise_renews_it():
    finger = Finger(0.002)
    assert finger.go(0.4, 0.02)
    assert finger.go(0.4, -0.02)
    assert not finger.go(0.2, -0.02)
    assert not finger.go(1.0)
    assert finger.go(1.0, 0.02)


def test_what_was_pressed_on_may_still_touch():
    finger = Finger(0.01)
    assert finger.go(0.4, 0.02)
    finger.air.presume_contact()
    assert not finger.go(1.0)


def test_a_force_held_along_a_slope_is_no_free_air():
    finger = Finger(0.0)
    finger.force_n = lambda: 3.0
    assert not finger.go(2.0, up_m_s=0.01, along_m_s=0.02)


def test_a_force_that_is_no_number_proves_nothing():
    finger = Finger(0.01, offset_n=float('nan'))
    assert not finger.go(1.0, 0.02)
