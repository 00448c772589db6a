# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Press with a wanted force by an arm that accepts only velocities.

The contact is a spring: F = k·(h − z), with h the height of the untouched surface under the finger. Each period T the
controller sets the normal velocity

    u = −g·(e + ∫e dt / Ti),    e = F_wanted − F,

and it comes into effect after the loop delay. The stiffest contact and the longest delay are declared, and one gain
follows from them; nothing is estimated while it controls. A softer contact is pressed more slowly, and a loop that is
later than declared, or a contact that is stiffer, is named: at the first touch, or as soon as the force overshoots.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from statistics import fmean

import numpy as np

from texture_core.config import param
from texture_core.errors import InvalidParameter
from texture_exploration.arms.arm import ArmCommand, ArmState, Vector

# --------------------
# Stability limit of the force control, predicted from the sampled loop.
#
# The contact integrates the velocity to a force, F' = −k·u; u is held for a period T and comes into effect after a
# delay of (m + γ)·T, with a whole m and 0 ≤ γ < 1. The loop on the force error e is exactly
#
#     e[n+1] = e[n] + k·T·((1 − γ)·u[n−m] + γ·u[n−m−1]),    u[n] = −g·e[n],
#
# stable if all roots of zᵐ⁺² − zᵐ⁺¹ + g·k·T·((1 − γ)·z + γ) lie within the unit circle. The integral part is so slow
# that it has no part in that. Without sampling the stability limit is g·k·delay = π/2.
#
# Source: Åström & Wittenmark, Computer-Controlled Systems, 1997, section 2.3 (sampling a system with delay).

BISECTIONS = 40


def spectral_radius(gain_m_s_n: float, stiffness_n_m: float, delay_s: float, period_s: float) -> float:
    """Return the growth of a disturbance per period; below 1 it decays."""
    fraction, whole = math.modf(round(delay_s / period_s, 9))
    polynomial = np.zeros(int(whole) + 3)
    polynomial[:2] = 1.0, -1.0
    polynomial[-2:] += gain_m_s_n * stiffness_n_m * period_s * np.array([1.0 - fraction, fraction])
    return float(np.abs(np.roots(polynomial)).max())


@lru_cache(maxsize=4096)
def stability_limit_gain(stiffness_n_m: float, delay_s: float, period_s: float) -> float:
    """Return the lowest gain with which the loop is unstable, m/s/N."""
    high = 2.5 / (stiffness_n_m * period_s)  # a pure integrator is stable up to 2 / (k·T)
    low = 0.1 / (stiffness_n_m * (delay_s + period_s))
    for _ in range(BISECTIONS):
        middle = math.sqrt(low * high)
        stable = spectral_radius(middle, stiffness_n_m, delay_s, period_s) < 1.0
        low, high = (middle, high) if stable else (low, middle)
    return low


# --------------------
# The common formula of all speed limits: a contact presses by its stiffness times the distance until the arm stops.


def stopping_m_s(rise_n: float, stiffness_n_m: float, stop_s: float) -> float:
    """Return the speed from which an arm that stops after `stop_s` increases a contact force by `rise_n`."""
    return rise_n / (stiffness_n_m * stop_s)


# --------------------
# The declared contact, its gain, and the limits of the stability margin.

GAIN_MARGIN = 4.0  # below the stability limit: a delayed integrator is critically damped at π/2·e = 4.3
INTEGRAL_RATIO = 20.0  # integral time by response time on the stiffest contact: damped at a tenth of the stiffness
REACTION_PERIODS = 2.0  # from contact to the first response, in addition to the delay
FORCE_SPEED_M_S = 0.05  # the highest normal speed under force control
SLOWEST_APPROACH_M_S = 5e-5  # a slower descent over the usual 2 mm takes longer than 40 s
TOUCHING_N = 0.03


@dataclass(frozen=True)
class ForceLoopParams:
    """Parameters of the force control of an arm without a force mode."""

    loop_delay_s: float = param(
        0.02, 'Largest delay from a force to the motion that responds; larger: lower gain.', unit='s', low=0.0, high=0.1
    )
    max_stiffness_n_m: float = param(
        5000.0, 'Stiffest contact; larger: slower approach, lower gain.', unit='N/m', low=100.0, high=200000.0
    )
    max_impact_n: float = param(
        0.15, 'Largest impact on the stiffest surface; larger: faster approach.', unit='N', low=0.01, high=5.0
    )
    touching_n: float = param(
        TOUCHING_N, 'Force that counts as contact; above the noise of its sensor.', unit='N', low=0.005, high=5.0
    )

    def gain_m_s_n(self, period_s: float) -> float:
        """Return the gain, m/s/N: below the stability limit on the stiffest contact by the margin."""
        return stability_limit_gain(self.max_stiffness_n_m, self.loop_delay_s, period_s) / GAIN_MARGIN

    def integral_s(self, period_s: float) -> float:
        """Return the time constant of the integral part: many response times on the stiffest contact."""
        return INTEGRAL_RATIO / (self.gain_m_s_n(period_s) * self.max_stiffness_n_m)

    def approach_m_s(self, period_s: float) -> float:
        """Return how fast the finger may come down: the impact on the stiffest contact stays below its limit."""
        reaction_s = self.loop_delay_s + REACTION_PERIODS * period_s
        return min(FORCE_SPEED_M_S, stopping_m_s(self.max_impact_n, self.max_stiffness_n_m, reaction_s))


class ForceController:
    """The PI part, with a limit of the speed and no windup at it."""

    def __init__(self, gain_m_s_n: float, integral_s: float, max_speed_m_s: float = math.inf) -> None:
        self._gain_m_s_n = gain_m_s_n
        self._integral_s = integral_s
        self._max_m_s = max_speed_m_s
        self._sum_ns = 0.0

    def restart(self) -> None:
        """Discard the past errors."""
        self._sum_ns = 0.0

    def update(self, error_n: float, dt_s: float) -> float:
        """Return the normal velocity, positive away from the surface, for a force error, wanted less measured."""
        added = self._sum_ns + error_n * dt_s
        wanted = -self._gain_m_s_n * (error_n + added / self._integral_s)
        limited = min(self._max_m_s, max(-self._max_m_s, wanted))
        # Anti-windup: an error that only pushes further against the limit is not added up.
        if limited == wanted or (wanted > 0) == (error_n > 0):
            self._sum_ns = added
        return limited


# --------------------
# The loop: come down, rest at the first touch until the force is constant, press.

SLOWEST_M_S = 0.001  # below, the finger is at rest along the surface
LEFT_FRACTION = 0.5  # of the force that counts as touching, below which the finger has left
LATE_S = 0.03  # beyond 'loop_delay_s', by which arm or force may be late
HALF_S = 0.05  # of the time in which the force must be constant, once the finger is at rest
FEWEST = 5  # samples in each half
ROSE_FRACTION = 0.5  # of the force that counts as touching, by which the mean of a half may exceed that of the other
HARD = 2.0  # impacts as declared, beyond which the impact is harder than possible


class ForceLoop:
    """Come down and press with the wanted force: the force mode of an arm that has none."""

    def __init__(self, params: ForceLoopParams, period_s: float) -> None:
        self._params = params
        self.approach_m_s = params.approach_m_s(period_s)
        if self.approach_m_s < SLOWEST_APPROACH_M_S:
            raise InvalidParameter(
                f"'loop_delay_s' of {params.loop_delay_s:g} s with 'max_stiffness_n_m' of {params.max_stiffness_n_m:g} "
                f"N/m and 'max_impact_n' of {params.max_impact_n:g} N allows an approach at "
                f'{1e3 * self.approach_m_s:.2g} mm/s, and {1e3 * SLOWEST_APPROACH_M_S:g} mm/s are needed; use a faster '
                'arm or a softer fingertip, or allow a larger impact'
            )
        self._controller = ForceController(params.gain_m_s_n(period_s), params.integral_s(period_s), FORCE_SPEED_M_S)
        self._touched: ArmState | None = None  # start of the rest after the touch; None without contact
        self._resting: list[ArmState] = []  # since the finger must be at rest
        self._heard = False
        self.doubt = ''  # in a sentence, why this force must not be used for control

    def restart(self) -> None:
        """The finger is not under force control, or left the surface."""
        self._controller.restart()
        self._touched, self._heard, self._resting = None, False, []

    def velocity(self, command: ArmCommand, state: ArmState, held_s: float) -> Vector:
        """Return the velocity for a command, m/s: a wanted force by the loop; down no faster than it can still stop."""
        if command.force_n is None:
            self.restart()
            self.doubt = ''  # a lift begins after it was reported
            return (*command.tangential_m_s, max(command.normal_m_s, -self.approach_m_s))
        return (*command.tangential_m_s, self._normal_m_s(command.force_n, command, state, held_s))

    def _normal_m_s(self, wanted_n: float, command: ArmCommand, state: ArmState, dt_s: float) -> float:
        """Return the normal velocity that leads to a wanted force."""
        touching_n = self._params.touching_n
        if state.force_n < (touching_n if self._touched is None else LEFT_FRACTION * touching_n):
            self.restart()
            return -self.approach_m_s
        self._touched = self._touched or state
        sliding = math.hypot(*command.tangential_m_s) > SLOWEST_M_S
        if not sliding and not self._heard:
            self._listen(self._touched, state)
            return 0.0
        if not sliding:
            self._controller.restart()  # a spring at rest needs no integral part, and a soft one would oscillate
        return self._controller.update(wanted_n - state.force_n, dt_s)

    def _listen(self, touched: ArmState, state: ArmState) -> None:
        """Rest until the force must be constant; delays are found by the stamps of the force."""
        params = self._params
        must_rest_ns = touched.time_ns + round((params.loop_delay_s + LATE_S) * 1e9)
        if state.time_ns <= must_rest_ns or (self._resting and state.time_ns <= self._resting[-1].time_ns):
            return
        self._resting.append(state)
        resting_ns = state.time_ns - self._resting[0].time_ns
        middle_ns = state.time_ns - resting_ns // 2
        first = [one.force_n for one in self._resting if one.time_ns <= middle_ns]
        last = [one.force_n for one in self._resting if one.time_ns > middle_ns]
        if resting_ns < 2e9 * HALF_S or min(len(first), len(last)) < FEWEST:
            return
        self._heard, rose_n, met_n = True, fmean(last) - fmean(first), fmean(last) - touched.force_n
        most_n = params.touching_n + HARD * params.max_impact_n
        if rose_n > ROSE_FRACTION * params.touching_n:
            what = f'the force continued to rise by {rose_n:.2f} N while the finger was at rest on the surface'
        elif met_n > most_n:
            what = f'the force rose by {met_n:.2f} N after the first touch, and {most_n:.2f} N are the most to expect'
        else:
            return
        self.doubt = (
            f"{what}: arm or force is later than 'loop_delay_s' of {1e3 * params.loop_delay_s:.0f} ms, or the contact "
            f"stiffer than 'max_stiffness_n_m' of {params.max_stiffness_n_m:g} N/m; find the cause of the delay, such "
            'as a filter, or declare it'
        )
