# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Press with a wanted force by an arm that knows velocities alone.

The contact is a spring: F = k·(h − z), with h the height of the untouched surface under the finger. Each period T the
controller sets the normal velocity

    u = −g·(e + ∫e dt / Ti) + dh/dt,    e = F_wanted − F,

and it comes into effect after the loop delay. The feed-forward dh/dt is not the arm's own movement: z + F/k is h
whatever the controller does, so its slope is a disturbance that is observed, and adds no loop as far as k is right.
k is estimated while the finger comes into contact, and g follows from it: see `texture_exploration.force_control`. The
delay is measured while it comes down; if it is longer than declared, gain and speed are reduced accordingly.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from texture_core.config import param
from texture_core.types import Array

# --------------------
# How late an arm follows a normal velocity, measured above the surface, and how late its force, at the first touch.

LONGEST_S = 0.15  # a longer lag is not told apart from an arm that does not move
SAMPLES = 10  # of which the mean counts
CHANGED = 0.02  # share by which a velocity differs from the one before
LAG_SLOWEST_M_S = 1e-5
BLOCK = 5  # samples of which the mean is compared with that of the ones before
STOPPED = 0.03  # share of the first speed below which a finger stands
RISING = 4.0  # times its noise that a mean must rise to count
LAGS_S = np.arange(0.0, 0.2, 0.002)  # that are tried; a longer one shows by a force that never stops to rise
SURE = 12.0  # variances of the noise by which a lag must explain the force better than none


class LagEstimate:
    """Estimate the lag from how far the finger is behind the way that was asked for.

    From rest the arm is asked for a constant velocity v. After t it has been asked for W = v·t and, following a lag d
    late, has gone v·(t − d): so d = (W − gone) / v, whatever the shape of the start, once it has lasted longer than d.
    """

    def __init__(self) -> None:
        self.value_s = math.nan
        self._asked_m_s = 0.0
        self._rest_m = math.nan  # height at rest; NaN if the present velocity did not begin at rest
        self._way_m = 0.0
        self._constant_s = math.inf  # nobody has asked for anything yet
        self._lags_s: list[float] = []

    def update(self, height_m: float, asked_m_s: float, dt_s: float) -> None:
        """Take what was measured now, and what is asked for from now on."""
        self._way_m += self._asked_m_s * dt_s
        self._constant_s += dt_s
        if self._asked_m_s == 0.0:
            self._at_rest(height_m)
        elif self._constant_s > LONGEST_S and not math.isnan(self._rest_m):
            self._add((self._way_m - (height_m - self._rest_m)) / self._asked_m_s)
        if abs(asked_m_s - self._asked_m_s) > CHANGED * abs(self._asked_m_s):
            self._change(asked_m_s)

    def _at_rest(self, height_m: float) -> None:
        # Before, it may still be moving.
        self._rest_m = height_m if self._constant_s > LONGEST_S else math.nan
        self._way_m = 0.0

    def _add(self, lag_s: float) -> None:
        # Later samples would add the error of the speed itself.
        if len(self._lags_s) < SAMPLES:
            self._lags_s.append(min(LONGEST_S, max(0.0, lag_s)))
            if len(self._lags_s) == SAMPLES:
                self.value_s = sum(self._lags_s) / SAMPLES

    def _change(self, asked_m_s: float) -> None:
        if self._asked_m_s != 0.0:
            self._rest_m = math.nan
        self._asked_m_s = asked_m_s if abs(asked_m_s) >= LAG_SLOWEST_M_S else 0.0
        self._constant_s = 0.0
        self._lags_s = []


def fitted_lag_s(track: Array, samples: Array, noise_n: float) -> float:
    """Return how much later than the height the force is, 0 if none explains it better: F(t) = a − k·z(t − lag)."""
    heights = np.interp(samples[:, :1] - LAGS_S, track[:, 0], track[:, 1])
    heights, forces = heights - heights.mean(axis=0), samples[:, 1] - samples[:, 1].mean()
    shared, spread = forces @ heights, (heights**2).sum(axis=0)
    explained = np.where((shared < 0.0) & (spread > 0.0), shared**2 / np.maximum(spread, 1e-30), 0.0)
    best = int(explained.argmax())
    return float(LAGS_S[best]) if explained[best] - explained[0] > SURE * noise_n**2 else 0.0


class ForceLag:
    """Measure how late the force follows the finger: it is told to stop, and the force goes on rising for the lag.

    Only measurements that are new count: on a busy machine the same one is seen in many periods, which is no force that
    stands.
    """

    def __init__(self, noise_n: float) -> None:
        self.value_s = math.nan
        self._noise_n = noise_n
        self._samples: deque[tuple[float, float, float]] = deque(maxlen=2 * BLOCK)  # time, height and force
        self._first_m_s = self._begin_s = math.nan  # speed as it began to stop
        self._stood_s = self._rose_s = math.nan
        self._calm = 0  # samples since the force rose

    def update(self, time_ns: int, height_m: float, force_n: float) -> bool:
        """Take a sample; return whether it is over: the force stands, or it never stopped to rise."""
        time_s = time_ns * 1e-9
        if self._samples and time_s <= self._samples[-1][0]:
            return False
        self._samples.append((time_s, height_m, force_n))
        samples = list(self._samples)
        if math.isnan(self._begin_s):
            self._begin_s = time_s
        if len(samples) >= BLOCK and len({force_n for _, _, force_n in samples[-BLOCK:]}) == 1:
            self.value_s = 0.0
            return True  # without any noise: constant or frozen, which a movement shows
        if len(samples) < 2 * BLOCK:
            return False
        took_s, went_m, rose_n = (
            (sum(row[of] for row in samples[BLOCK:]) - sum(row[of] for row in samples[:BLOCK])) / BLOCK
            for of in range(3)
        )
        self._calm += 1
        if rose_n > RISING * self._noise_n * math.sqrt(2.0 / BLOCK):
            self._rose_s, self._calm = time_s, 0
        speed_m_s = abs(went_m) / took_s
        if math.isnan(self._first_m_s):
            self._first_m_s = max(speed_m_s, LAG_SLOWEST_M_S)
        if math.isnan(self._stood_s) and speed_m_s <= STOPPED * self._first_m_s:
            self._stood_s, self._rose_s, self._calm = time_s, time_s, 0
        if math.isnan(self._stood_s):
            # A place that is noisy hides when it stood: no arm goes on for longer than LONGEST_S.
            if time_s - self._begin_s <= 4 * LONGEST_S:
                return False
            self._stood_s = self._begin_s + LONGEST_S
            self._rose_s = max(self._stood_s, self._rose_s)  # in this order NaN is no rise
        lag_s = self._rose_s - self._stood_s
        if lag_s > LONGEST_S or self._calm > 2 * BLOCK:
            self.value_s = lag_s
            return True
        return False


# --------------------
# How fast the surface rises under a finger that presses on it and moves along.

MIN_POINTS = 3
OBSERVED = 8  # heights that tell the slope: fewer follow a bump better, but shake with a finger that sticks and slips
SHORTEST_M = 1e-6  # way over which a slope is told
LIKELY_SLOPE = 0.2
LIKELY_BEND_1_M = 0.5  # half of the second derivative; higher bends are followed the better k is known


class SlopeObserver:
    """How fast the surface will rise under the finger, freed from what the controller does itself.

    A parabola through the last heights over the way tells the slope where the finger will be when the answer comes
    into effect; times the speed that is commanded now, it is the rise then.
    """

    def __init__(self, ahead_s: float) -> None:
        self._ahead_s = ahead_s
        self._points: deque[tuple[float, float]] = deque(maxlen=OBSERVED)

    @property
    def running(self) -> bool:
        """Whether it has seen a height."""
        return bool(self._points)

    def restart(self) -> None:
        """The finger left the surface."""
        self._points.clear()

    def update(
        self, travelled_m: float, surface_m: float, speed_m_s: float, noise_m: float, doubt: float = 0.0
    ) -> float:
        """Return how fast the surface will rise, m/s."""
        self._points.append((travelled_m, surface_m))
        if len(self._points) < MIN_POINTS:
            return 0.0
        travelled, height = np.array(self._points).T
        unit = max(float(travelled[-1] - travelled[0]), SHORTEST_M)
        travelled = (travelled - travelled_m) / unit
        shapes = np.stack([travelled, travelled**2], axis=1)
        shapes = shapes - shapes.mean(axis=0)
        # Likely slopes and bends, as if they had been seen once beside the heights.
        likely = np.diag([noise_m / (LIKELY_SLOPE * unit), noise_m / (LIKELY_BEND_1_M * unit**2)]) ** 2
        slope, curvature = np.linalg.solve(shapes.T @ shapes + likely, shapes.T @ (height - height.mean()))
        ahead = min(1.0, speed_m_s * self._ahead_s / unit)
        # As it sets off, a late arm has gone much less than it goes until the answer: the noise counts so many times.
        sure = 1.0 / (1.0 + (doubt * max(1.0, speed_m_s * self._ahead_s / unit)) ** 2)
        return float(sure * (slope + 2 * curvature * ahead) / unit * speed_m_s)


# --------------------
# Stability limit of the force control, predicted from the sampled loop.
#
# The contact integrates the velocity to a force, F' = −k·u; u is held for a period T and comes into effect after a
# delay of (m + γ)·T, with a whole m and 0 ≤ γ < 1. With s = Σ e·T, the loop on the force error e is exactly
#
#     e[n+1] = e[n] + k·T·((1 − γ)·u[n−m] + γ·u[n−m−1]),    s[n+1] = s[n] + T·e[n+1],    u[n] = −g·(e[n] + s[n] / Ti),
#
# a linear map; it is stable if all its eigenvalues lie within the unit circle. Only the products g·k·T, delay / T and
# Ti / T matter. Without the integral part and without sampling the stability limit is g·k·delay = π/2.
#
# Source: Åström & Wittenmark, Computer-Controlled Systems, 1997, section 2.3 (sampling a system with delay).

BISECTIONS = 40


@dataclass(frozen=True)
class LoopModel:
    """Force control on a contact: stiffness k, gain g, delay, period T and time constant Ti of the integral part."""

    stiffness_n_m: float
    gain_m_s_n: float
    delay_s: float
    period_s: float
    integral_s: float = math.inf


def loop_matrix(loop: LoopModel) -> Array:
    """Return the matrix of the loop; the state is e, s if there is an integral part, and m + 1 velocities."""
    share, whole = math.modf(round(loop.delay_s / loop.period_s, 9))
    waiting = int(whole) + 1
    matrix = np.zeros((2 + waiting, 2 + waiting))
    answer = np.zeros(2 + waiting)
    answer[0], answer[1] = -loop.gain_m_s_n, -loop.gain_m_s_n / loop.integral_s
    step = loop.stiffness_n_m * loop.period_s
    error = np.zeros(2 + waiting)
    error[0] = 1.0
    error[1 + waiting] += step * share  # the oldest velocity
    newer = answer if waiting == 1 else np.eye(2 + waiting)[waiting]
    error += step * (1 - share) * newer
    matrix[0] = error
    matrix[1] = loop.period_s * error
    matrix[1, 1] += 1.0
    matrix[2] = answer
    for place in range(3, 2 + waiting):
        matrix[place, place - 1] = 1.0
    return matrix if math.isfinite(loop.integral_s) else np.delete(np.delete(matrix, 1, axis=0), 1, axis=1)


def spectral_radius(loop: LoopModel) -> float:
    """Return by how much a disturbance grows each period, the spectral radius; below 1 it dies out."""
    return float(np.abs(np.linalg.eigvals(loop_matrix(loop))).max())


@lru_cache(maxsize=4096)
def stability_limit_gain(loop: LoopModel) -> float:
    """Return the gain from which the loop is unstable, m/s/N, by its eigenvalues; its own gain does not count."""
    return lowest_unstable_gain(loop, lambda gain: spectral_radius(replace(loop, gain_m_s_n=gain)) < 1.0)


def lowest_unstable_gain(loop: LoopModel, stable: Callable[[float], bool], bisections: int = BISECTIONS) -> float:
    """Return the lowest gain that is not stable, around that of the pure delay, π / 2 / (k · delay)."""
    high = 2.5 / (loop.stiffness_n_m * loop.period_s)  # a pure integrator bears 2 / (k·T)
    # Far below, the integral part makes a slow swing, which a short run could take for an unstable one.
    low = 0.1 / (loop.stiffness_n_m * (loop.delay_s + loop.period_s))
    for _ in range(bisections):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


# --------------------
# Stiffness of a contact, estimated while the force rises.

SOFTEST_N_M = 50.0
MOST_POINTS = 25  # more make a short rise no surer: what is left is no noise
RECENT_SHARE = 0.5  # of the force, from which on points count
MIN_RISE_N = 0.1  # of the force at the default of `TOUCHING_N`, before a stiffness can be told from noise
TOUCHING_N = 0.03


class StiffnessEstimate:
    """Estimate how stiff a contact is, by the slope of force over height while the force rises: least squares."""

    def __init__(self, touching_n: float = TOUCHING_N) -> None:
        self._touching_n = touching_n
        self._min_rise_n = MIN_RISE_N * touching_n / TOUCHING_N
        self.value_n_m = math.nan
        self.restart()

    @property
    def empty(self) -> bool:
        """Whether this contact has just begun."""
        return not self._points

    def restart(self) -> None:
        """The contact ended: forget the points, not the value."""
        self.fixed = False  # for the rest of this contact
        self._points: list[tuple[float, float]] = []

    def update(self, height_m: float, force_n: float) -> None:
        """Take a point; those before the contact are passed over."""
        if self.fixed or force_n < self._touching_n or not self._presses_on(height_m, force_n):
            return
        self._points.append((height_m, force_n))
        # A finger is the stiffer the harder it is pressed: what counts is how stiff it is now.
        highest_n = max(force_n for _, force_n in self._points)
        recent_n = min(RECENT_SHARE * highest_n, highest_n - 1.5 * self._min_rise_n)
        self._points = [point for point in self._points if point[1] >= recent_n]
        # The slope of many points is as sure over a shorter rise: its error falls with their root.
        rise_n = (highest_n - self._points[0][1]) * math.sqrt(min(MOST_POINTS, len(self._points)) / MIN_POINTS)
        if len(self._points) >= MIN_POINTS and rise_n > self._min_rise_n:
            self.value_n_m = max(SOFTEST_N_M, self._slope())

    def _presses_on(self, height_m: float, force_n: float) -> bool:
        """Return whether the finger is deeper or presses harder than before; by the force alone noise would choose."""
        if not self._points:
            return True
        before_m, before_n = self._points[-1]
        # A force that stays the same to the last bit may be frozen: no contact is that soft.
        return force_n > before_n or (height_m < before_m and force_n != before_n)

    def _slope(self) -> float:
        count = len(self._points)
        z_mean = sum(z for z, _ in self._points) / count
        f_mean = sum(f for _, f in self._points) / count
        spread = sum((z - z_mean) ** 2 for z, _ in self._points)
        shared = sum((z - z_mean) * (f - f_mean) for z, f in self._points)
        return -shared / spread if spread > 0 else math.nan


NOISE_SHARE = 1.0 / 6.0  # of the force that counts as touching: the least noise of the force that is supposed
LEAST_NOISE = 0.1  # of that; a reading may also stand still
BEARABLE = 0.2  # of the wanted force, that noise may cost by what looks like a slope
NOISE_SAMPLES = 50  # a finger that is pressed or lifted changes its force more: the calmest so many tell the noise
SLOWEST_M_S = 0.001  # below, the finger is at rest along the surface
SETTLED = 0.3  # from an error of this fraction of the wanted force on, the slope is observed
REACTION_PERIODS = 2.0  # from contact to the first answer, beside the delay
LONGEST_DELAY_S = 0.1  # of `ForceLoopParams`
UNDECLARED_PERIODS = 1.5  # a lag that is longer than declared by more than this counts
LATE_IMPACT = (
    3.0  # so many times 'max_impact_n' may be met by an arm that is later than declared: coming down takes long
)
INTEGRAL_LAGS = 20.0  # the integral part takes at least so many lags: a faster one adds to the overshoot
TRACK = 400  # heights that are remembered: 1.6 s at 250 Hz
FORCE_LAG_S = 0.03  # a force that is later than 'loop_delay_s' by more than this is not pressed by
FORCE_SPEED_M_S = 0.05  # the highest normal speed under force control
NEAR_M = 0.001  # above a surface whose height is known, the finger slows down to closing speed


@dataclass(frozen=True)
class ForceLoopParams:
    """Parameters of the force control of an arm without a force mode."""

    loop_delay_s: float = param(
        0.008,
        'Largest delay from a measured force to the motion that answers it; larger values lower the gain.',
        unit='s',
        low=0.0,
        high=0.1,
    )
    max_stiffness_n_m: float = param(
        5000.0,
        'Stiffest contact of finger and surface that is expected; larger values lower the '
        'approach speed and the first gain.',
        unit='N/m',
        low=100.0,
        high=200000.0,
    )
    gain_margin: float = param(
        4.0,
        'By which factor the gain stays below the stability limit; a larger factor is more stable and slower.',
        low=2.0,
        high=50.0,
    )
    integral_s: float = param(
        0.5,
        'Time constant of the integral part; a longer time removes a constant force error more slowly.',
        unit='s',
        low=0.05,
        high=100.0,
    )
    max_impact_n: float = param(
        0.15,
        'Largest impact force on the stiffest surface before the arm can react; a larger force '
        'allows a faster approach.',
        unit='N',
        low=0.01,
        high=5.0,
    )

    touching_n: float = param(
        TOUCHING_N,
        'Force above which the force control takes the finger for touching; it must exceed the noise of the '
        'force sensor. A larger force meets the surface harder.',
        unit='N',
        low=0.005,
        high=5.0,
    )

    def loop(self, stiffness_n_m: float, period_s: float, gain_m_s_n: float = 0.0) -> LoopModel:
        """Return the closed loop on a contact."""
        return LoopModel(stiffness_n_m, gain_m_s_n, self.loop_delay_s, period_s, self.integral_s)

    def default_gain(self, stiffness_n_m: float, period_s: float) -> float:
        """Return the gain for a contact, m/s/N: below the stability limit by the margin."""
        return stability_limit_gain(self.loop(stiffness_n_m, period_s)) / self.gain_margin

    @property
    def max_impact_depth_m(self) -> float:
        """Impact per stiffness, m: how deep the finger may run into the stiffest surface."""
        return self.max_impact_n / self.max_stiffness_n_m


class ForceController:
    """The PI part, with a limit of the speed and no windup at it."""

    def __init__(self, gain_m_s_n: float, integral_s: float, max_speed_m_s: float = math.inf) -> None:
        self._gain_m_s_n = gain_m_s_n
        self._integral_s = integral_s
        self._max_m_s = max_speed_m_s
        self._sum_ns = 0.0

    @property
    def gain_m_s_n(self) -> float:
        """Normal speed per force error, m/s/N."""
        return self._gain_m_s_n

    @gain_m_s_n.setter
    def gain_m_s_n(self, gain_m_s_n: float) -> None:
        # The integral part goes on at most at the speed that it has: what a hundredth of the gain added up is no error
        # now, and on a harder base less speed is wanted.
        self._sum_ns *= min(1.0, self._gain_m_s_n / gain_m_s_n)
        self._gain_m_s_n = gain_m_s_n

    def restart(self) -> None:
        """Forget the past errors."""
        self._sum_ns = 0.0

    def update(self, error_n: float, dt_s: float, feed_forward_m_s: float = 0.0, down_m_s: float = math.inf) -> float:
        """Return the normal velocity, positive away from the surface, for a force error, wanted less measured.

        Towards the surface it is at most `down_m_s`.
        """
        added = self._sum_ns + error_n * dt_s
        wanted = feed_forward_m_s - self._gain_m_s_n * (error_n + added / self._integral_s)
        limited = min(self._max_m_s, max(-min(self._max_m_s, down_m_s), wanted))
        # Anti-windup: an error that only pushes further against the limit is not added up.
        if limited == wanted or (wanted > 0) == (error_n > 0):
            self._sum_ns = added
        return limited


class ContactState(NamedTuple):
    """State of the contact: height of the finger, distance travelled along the surface, force, when it was measured."""

    time_ns: int
    height_m: float
    travelled_m: float
    force_n: float


class ForceLoop:
    """Come down, estimate the stiffness, press with the wanted force: the force mode of an arm that has none."""

    def __init__(self, params: ForceLoopParams, period_s: float) -> None:
        self._params = params
        self._period_s = period_s
        self.stiffness = StiffnessEstimate(params.touching_n)
        self.lag = LagEstimate()
        self._declared = params  # what was declared; `_params` holds what was measured
        self._observer = self._new_observer()
        self._surface_m: float | None = None  # where the finger met it last
        self._chosen_for = math.nan
        self._forces: list[float] = []
        self._noise_n = math.inf
        self._newest_ns = -1
        self._track: deque[tuple[float, float]] = deque(maxlen=TRACK)  # newest times and heights, s and m
        self._touched: list[tuple[float, float]] = []  # times and forces while it listens, s and N
        self._touch: ForceLag | None = None  # while the finger stands after the first touch, to hear the force
        self._heard = False
        self.force_lag_s = 0.0
        self.controller = self._new_controller()

    def restart(self) -> None:
        """The finger is not under force control, or the command ended."""
        self.controller.restart()
        self._observer.restart()

    def observe(self, contact: ContactState, speed_m_s: float = 0.0) -> None:
        """Take note of a contact, whatever is commanded; call it once a period. Sliding tells nothing of stiffness."""
        if contact.time_ns > self._newest_ns:
            self._newest_ns = contact.time_ns
            self._track.append((contact.time_ns * 1e-9, contact.height_m))
            self._note_noise(contact.force_n)
        if contact.force_n < self._params.touching_n:
            self.stiffness.restart()
            self._touch, self._heard = None, False
            return
        if self.stiffness.empty:
            self._surface_m = contact.height_m
        if speed_m_s > SLOWEST_M_S:
            self.stiffness.fixed = True
        # The force is that of where the finger was; with the newest height a late one looks soft as it is pressed.
        self.stiffness.update(self._height_m(contact), contact.force_n)
        self._choose_gain()

    def _height_m(self, contact: ContactState) -> float:
        """Return where the finger was when the force was what it is now told to be."""
        if not (self._heard and self.force_lag_s):
            return contact.height_m
        times_s, heights_m = zip(*self._track, strict=True)
        return float(np.interp(contact.time_ns * 1e-9 - self.force_lag_s, times_s, heights_m))

    @property
    def noise_n(self) -> float:
        """Standard deviation of the force, N, as measured above the surface; what `touching_n` supposes until then."""
        supposed_n = NOISE_SHARE * self._params.touching_n
        return max(LEAST_NOISE * supposed_n, self._noise_n) if math.isfinite(self._noise_n) else supposed_n

    def asked(self, height_m: float, asked_m_s: float, dt_s: float) -> None:
        """Take note of the velocity that was asked for in the end: it tells how late the arm follows."""
        self.lag.update(height_m, asked_m_s, dt_s)
        if self.stiffness.empty:  # a gain is not changed in contact
            self._adapt_to_lag()

    def velocity_m_s(self, wanted_n: float, contact: ContactState, speed_m_s: float, dt_s: float) -> float:
        """Return the normal velocity that leads to a wanted force, at a commanded speed along the surface."""
        height_m, force_n = contact.height_m, contact.force_n
        if force_n < self._params.touching_n:
            self.restart()
            return -self.approach_m_s(height_m)
        if speed_m_s <= SLOWEST_M_S and not self._heard:
            self._listen(contact)
            return 0.0
        estimated_n_m = self.stiffness.value_n_m
        settled = abs(wanted_n - force_n) < SETTLED * wanted_n
        feed_forward_m_s = 0.0
        if not math.isnan(estimated_n_m) and (settled or self._observer.running):
            feed_forward_m_s = self._observer.update(
                contact.travelled_m,
                self._height_m(contact) + force_n / estimated_n_m,
                speed_m_s,
                max(self.noise_n, NOISE_SHARE * self._params.touching_n) / estimated_n_m,
                self.noise_n / (BEARABLE * wanted_n),
            )
        down_m_s = math.inf if speed_m_s > SLOWEST_M_S else self._pressing_m_s(wanted_n)
        return self.controller.update(wanted_n - force_n, dt_s, feed_forward_m_s, down_m_s)

    def doubt(self) -> str:
        """Return in a sentence why nobody should press by this force, '' if one may."""
        allowed_s = FORCE_LAG_S + self._declared.loop_delay_s
        if self.force_lag_s <= allowed_s:
            return ''
        declared_ms = 1e3 * self._declared.loop_delay_s
        return (
            f'the force rose for {1e3 * self.force_lag_s:.0f} ms or more after the finger stood still on the surface, '
            f"and {1e3 * allowed_s:.0f} ms are allowed with a 'loop_delay_s' of {declared_ms:.0f} ms; find what makes "
            'the force late, such as a filter, or declare it'
        )

    def _listen(self, contact: ContactState) -> None:
        """Stand until the force does, and take over how late it is, before anything is pressed."""
        if self._touch is None:
            self._touch, self._touched = ForceLag(self.noise_n), []
        self._touched.append((contact.time_ns * 1e-9, contact.force_n))
        if not self._touch.update(contact.time_ns, contact.height_m, contact.force_n):
            return
        self._heard = True
        fitted_s = fitted_lag_s(np.array(self._track), np.array(self._touched), self.noise_n)
        self.force_lag_s = max(self._touch.value_s, fitted_s)
        if self.force_lag_s:  # what was seen so far was seen too late
            self.stiffness.restart()
            self.stiffness.value_n_m = math.nan
        self._adapt_to_lag()
        self._choose_gain()

    def _note_noise(self, force_n: float) -> None:
        self._forces.append(force_n)
        if len(self._forces) == NOISE_SAMPLES:
            self._noise_n = min(self._noise_n, statistics.pstdev(self._forces))
            self._forces = []

    def _pressing_m_s(self, wanted_n: float) -> float:
        """Return how fast the finger may be pressed on: what is soft now may have a hard base."""
        depth_m = wanted_n / self._declared.max_stiffness_n_m  # the impact on it is at most the wanted force
        return depth_m * self._patience / self._reaction_s(self._params)

    def approach_m_s(self, height_m: float) -> float:
        """Return how fast the finger may come down: slowly where the surface may be."""
        params = self._params
        reaction_s = self._reaction_s(params)
        slow_m_s = min(FORCE_SPEED_M_S, self._closing_m / reaction_s)
        if self._surface_m is None:
            return slow_m_s
        above_m = height_m - self._surface_m - NEAR_M
        return min(FORCE_SPEED_M_S, max(slow_m_s, above_m / (4 * reaction_s)))

    @property
    def _closing_m(self) -> float:
        """How deep the finger may run into the surface before it reacts, m."""
        depth_m = self._declared.max_impact_depth_m
        estimated_n_m = self.stiffness.value_n_m
        if self._delayed and not self.stiffness.empty and not math.isnan(estimated_n_m):
            depth_m *= max(1.0, self._declared.max_stiffness_n_m / estimated_n_m)
        return depth_m * self._patience

    @property
    def _patience(self) -> float:
        """How many times harder than declared an arm that is later than declared may meet a surface."""
        return min(LATE_IMPACT, self._reaction_s(self._params) / self._reaction_s(self._declared))

    def _reaction_s(self, params: ForceLoopParams) -> float:
        return params.loop_delay_s + REACTION_PERIODS * self._period_s

    @property
    def _delayed(self) -> bool:
        return self._params.loop_delay_s > self._declared.loop_delay_s

    def _adapt_to_lag(self) -> None:
        """Take over the measured lag if it is longer than declared."""
        lag_s = self.lag.value_s + self.force_lag_s
        declared = self._declared
        late = lag_s > declared.loop_delay_s + UNDECLARED_PERIODS * self._period_s  # not if it is NaN
        delay_s = math.ceil(lag_s * 1e3) * 1e-3 if late else declared.loop_delay_s
        if delay_s == self._params.loop_delay_s:
            return
        integral_s = max(declared.integral_s, INTEGRAL_LAGS * delay_s) if late else declared.integral_s
        self._params = replace(declared, loop_delay_s=min(delay_s, LONGEST_DELAY_S), integral_s=integral_s)
        self._observer = self._new_observer()
        self.controller = self._new_controller()
        self._chosen_for = math.nan

    def _new_observer(self) -> SlopeObserver:
        return SlopeObserver(self._params.loop_delay_s + 0.5 * self._period_s)

    def _new_controller(self) -> ForceController:
        params = self._params
        gain = params.default_gain(params.max_stiffness_n_m, self._period_s)
        return ForceController(gain, params.integral_s, FORCE_SPEED_M_S)

    def _choose_gain(self) -> None:
        estimated_n_m = self.stiffness.value_n_m
        if math.isnan(estimated_n_m) or estimated_n_m == self._chosen_for:
            return
        self._chosen_for = estimated_n_m
        self.controller.gain_m_s_n = self._params.default_gain(estimated_n_m, self._period_s)
