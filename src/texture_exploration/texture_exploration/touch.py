# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters and speeds of approach, contact and lift of a finger."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texture_core.config import param
from texture_exploration.force_control import stopping_m_s
from texture_exploration.paths import ramp_s

REACTION_S = 0.03  # from contact to standstill: two states of the arm, two steps of the exploration
STEP_S = 0.014  # of exploration and arm, by which an arm stops later than its delay
WALL_SHARE = 4.5  # times the force limit, with which a wall as stiff as declared may press until the arm stops
IMPACT = 0.8  # of the wanted force
HARMLESS_N = 0.5  # below this force the watchdog of an arm does not limit the approach


def stop_s(delay_s: float) -> float:
    """Return the time from a contact to the stop of an arm."""
    return max(REACTION_S, delay_s + STEP_S)


@dataclass(frozen=True)
class TouchParams:
    """Parameters of approach, contact, acceleration and lift; states beyond a peak are not steady."""

    travel_speed_m_s: float = param(
        0.05, 'Highest speed on the way to the start; lower for a stiff contact.', unit='m/s', low=0.01, high=1.0
    )
    approach_speed_m_s: float = param(
        0.02, 'Highest speed towards the surface; lower for a small force.', unit='m/s', low=0.001, high=0.1
    )
    approach_stiffness_n_m: float = param(
        2000.0, 'Stiffest contact, also from the side; larger: slower motion.', unit='N/m', low=10.0, high=200000.0
    )
    approach_travel_m: float = param(
        0.05, 'Longest way down in search of the surface; then it aborts.', unit='m', low=0.001, high=0.5
    )
    unheard_force_fraction = 1.5  # of the wanted force, that an arm may reach until its watchdog stops it
    contact_force_n: float = param(
        0.2, 'Force above which the finger counts as in contact; larger: a harder touch.', unit='N', low=0.02, high=5.0
    )
    force_tolerance: float = param(
        0.1, 'Fraction of the wanted force within which it has settled; larger: sooner.', low=0.01, high=0.5
    )
    speed_tolerance: float = param(
        0.05, 'Fraction of the wanted speed within which it is reached; larger: sooner.', low=0.005, high=0.5
    )
    settle_s = 0.1  # that the force must stay within its tolerance before the finger slides
    acceleration_m_s2: float = param(
        1.0, 'Highest acceleration along the surface; larger: shorter ramps.', unit='m/s²', low=0.05, high=10.0
    )
    jerk_m_s3 = 50.0  # along the surface: ramps of 0.1 s up to 0.05 m/s
    arm_lag_s = 0.005  # after which an arm follows a command: the direction on a curved path is led by it
    lost_force_fraction = 0.25  # of the wanted force, below which contact counts as lost
    lost_contact_s: float = param(
        0.1, 'Loss of contact that aborts a slide; shorter ones are bounces.', unit='s', low=0.02, high=5.0
    )
    stall_speed_fraction = 0.25  # of the commanded way, below which a sliding finger counts as stalled
    stall_s = 0.25  # over which the commanded way and that of a sliding finger are compared
    mean_force_fraction = 0.3  # error of the mean force with which a slide succeeds
    peak_force_fraction: float = param(
        0.5, 'Fraction by which a slide may exceed its force for a moment and succeed.', low=0.05, high=20.0
    )
    mean_speed_fraction: float = param(
        0.2, 'Largest error of the mean speed, as a fraction, of a slide that succeeds.', low=0.02, high=5.0
    )
    peak_speed_fraction: float = param(
        0.5, 'Fraction by which a slide may exceed its speed for 50 ms and succeed.', low=0.05, high=20.0
    )
    lift_speed_m_s = 0.05  # away from the surface, once the direction of the normal is proven
    clearance_m = 0.005  # least rise after a contact

    def approach_m_s(self, force_n: float, watchdog_s: float = 0.0, delay_s: float = 0.0) -> float:
        """Return how fast the finger may come down to press with a force.

        An arm that loses its commands at the moment of contact keeps moving until its watchdog stops it. Until then
        the force stays below `unheard_force_fraction` of the wanted one on a contact of `approach_stiffness_n_m`. For
        `watchdog_s` and `delay_s` see `texture_exploration.arms.arm.ArmState`.
        """
        heard_m_s = stopping_m_s(IMPACT * force_n, self.approach_stiffness_n_m, stop_s(delay_s))
        allowed_n, unheard_s = max(self.unheard_force_fraction * force_n, HARMLESS_N), watchdog_s + REACTION_S
        unheard_m_s = stopping_m_s(allowed_n, self.approach_stiffness_n_m, unheard_s) if watchdog_s else math.inf
        return min(self.approach_speed_m_s, heard_m_s, unheard_m_s)

    def travel_m_s(self, limit_n: float, delay_s: float) -> float:
        """Return the highest speed on a path with possible obstacles, for an impact below a force."""
        return min(self.travel_speed_m_s, stopping_m_s(limit_n, self.approach_stiffness_n_m, stop_s(delay_s)))

    def slide_m_s(self, limit_n: float, delay_s: float) -> float:
        """Return the highest sliding speed: beyond the force limit a wall presses until the arm stops."""
        return stopping_m_s((WALL_SHARE - 1.0) * limit_n, self.approach_stiffness_n_m, delay_s + STEP_S)

    def ramp_s(self, speed_m_s: float) -> float:
        """Return the time to gain or lose a speed."""
        return ramp_s(speed_m_s, self.acceleration_m_s2, self.jerk_m_s3)
