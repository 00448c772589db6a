"""Stability limit of the force control: predicted from the sampled loop, and found by simulation.

The contact integrates the velocity to a force, F' = −k·u; u is held for a period T and comes into effect after a delay
of (m + γ)·T, with a whole m and 0 ≤ γ < 1. With s = Σ e·T, the loop on the force error e is exactly

    e[n+1] = e[n] + k·T·((1 − γ)·u[n−m] + γ·u[n−m−1]),    s[n+1] = s[n] + T·e[n+1],    u[n] = −g·(e[n] + s[n] / Ti),

a linear map; it is stable if all its eigenvalues lie within the unit circle. Only the products g·k·T, delay / T and
Ti / T matter. Without the integral part and without sampling the stability limit is g·k·delay = π/2.

Source: Åström & Wittenmark, Computer-Controlled Systems, 1997, section 2.3 (sampling a system with delay).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Protocol

import numpy as np

from texture_core.arrays import Array

BISECTIONS = 40
CYCLES = 60  # a simulated loop is judged after so many delays
SMALL = 0.1
FINE = 20  # simulation steps per period


@dataclass(frozen=True)
class LoopModel:
    """Force control on a contact: stiffness k, gain g, delay, period T and time constant Ti of the integral part."""

    stiffness_n_m: float
    gain_m_s_n: float
    delay_s: float
    period_s: float
    integral_s: float = math.inf


class NormalVelocityController(Protocol):
    """What is simulated; see `texture_exploration.force_control.ForceController`."""

    def update(self, error_n: float, dt_s: float) -> float:
        """Return the normal velocity, positive away from the surface."""


def loop_matrix(loop: LoopModel) -> Array:
    """Return the matrix of the loop; the state is e, s if there is an integral part, and m + 1 velocities.

    Returns
    -------
    (m + 3, m + 3) or (m + 2, m + 2)
    """
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
    return _bisect(loop, lambda gain: spectral_radius(replace(loop, gain_m_s_n=gain)) < 1.0)


def simulated_stability_limit_gain(
    loop: LoopModel, controller: Callable[[LoopModel], NormalVelocityController]
) -> float:
    """Return the gain from which the running controller makes a disturbance grow, m/s/N."""
    return _bisect(loop, lambda gain: disturbance_decays(replace(loop, gain_m_s_n=gain), controller), bisections=12)


def disturbance_decays(loop: LoopModel, controller: Callable[[LoopModel], NormalVelocityController]) -> bool:
    """Run a controller on a spring, finely integrated, after a jolt of 1 N; return whether the swinging shrinks."""
    running = controller(loop)
    fine_s = loop.period_s / FINE
    late = round(loop.delay_s / fine_s)
    periods = math.ceil(CYCLES * (loop.delay_s + loop.period_s) / loop.period_s)
    error, peaks = 1.0, np.empty(periods)
    velocities = np.zeros(late + FINE * periods)
    for period in range(periods):
        now = FINE * period
        velocities[late + now : late + now + FINE] = running.update(error, loop.period_s)
        error += loop.stiffness_n_m * fine_s * float(velocities[now : now + FINE].sum())
        peaks[period] = abs(error)
        if peaks[period] > 1e6:
            return False
    third = periods // 3
    # The integral part may leave a small slow rest that still rises; a swinging that grows began with 1.
    return bool(peaks[-third:].max() < max(SMALL, peaks[third : 2 * third].max()))


def stability_chart(
    stiffness_n_m: Sequence[float],
    delay_s: Sequence[float],
    controller: Callable[[LoopModel], NormalVelocityController],
    period_s: float = 0.004,
    integral_s: float = 0.5,
) -> dict[str, Array]:
    """Return the data of a chart: the stability limit of the gain over stiffness and delay, predicted and simulated.

    Parameters
    ----------
    stiffness_n_m
        Stiffnesses of the contact, N/m, s of them.
    delay_s
        Delays of the loop, d of them.
    controller
        Makes the controller of a loop.
    period_s
        Time between two commands.
    integral_s
        Integral time of the controller.

    Returns
    -------
    dict
        'stiffness_n_m' (s,), 'delay_s' (d,), and 'predicted' and 'simulated' (s, d) in m/s/N.
    """
    loops = [[LoopModel(k, 0.0, delay, period_s, integral_s) for delay in delay_s] for k in stiffness_n_m]
    return {
        'stiffness_n_m': np.array(stiffness_n_m, dtype=float),
        'delay_s': np.array(delay_s, dtype=float),
        'predicted': np.array([[stability_limit_gain(loop) for loop in row] for row in loops]),
        'simulated': np.array([[simulated_stability_limit_gain(loop, controller) for loop in row] for row in loops]),
    }


def _bisect(loop: LoopModel, stable: Callable[[float], bool], bisections: int = BISECTIONS) -> float:
    """Return the lowest gain that is not stable, around that of the pure delay, π / 2 / (k · delay)."""
    high = 2.5 / (loop.stiffness_n_m * loop.period_s)  # a pure integrator bears 2 / (k·T)
    # Far below, the integral part makes a slow swing, which a short run could take for an unstable one.
    low = 0.1 / (loop.stiffness_n_m * (loop.delay_s + loop.period_s))
    for _ in range(bisections):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low
