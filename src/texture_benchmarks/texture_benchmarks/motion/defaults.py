"""What the shipped controllers bear: stability, margins and bumps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from texture_benchmarks.motion.trial import (
    ARM,
    SLIDE,
    SURFACES,
    simulate_force_controlled_slide,
)
from texture_core.arrays import Array
from texture_exploration.arms.simulated import RATE_HZ
from texture_exploration.force_control import ForceLoopParams
from texture_exploration.stability import stability_limit_gain

SPEEDS_M_S = (0.1, 0.07, 0.05, 0.035, 0.025, 0.018, 0.0125, 0.01, 0.007, 0.005)
TARGETS = {
    'force_rms': 0.05,
    'overshoot': 0.2,
    'speed_error': 0.02,
    'radius_error_m': 0.001,
    'border_error': 0.1,
    'margin': 2.0,
}


def bump_speed_m_s(stiffness_n_m: float) -> float:
    """Return the highest of `SPEEDS_M_S` at which a bump of 2 mm is followed as well as asked, without a force mode."""
    arm = replace(ARM, stiffness_n_m=stiffness_n_m, **SURFACES['bump of 2 mm'])
    fits = (
        v
        for v in SPEEDS_M_S
        if simulate_force_controlled_slide(arm, replace(SLIDE, speed_m_s=v)).force_rms <= TARGETS['force_rms']
    )
    return next(fits, 0.0)


def defaults(border: Mapping[str, Array]) -> Array:
    """Return the gains that are chosen for the stiffnesses and delays of a chart, (s, d).

    Parameters
    ----------
    border
        Data of the chart: 'stiffness_n_m' (s,) and 'delay_s' (d,).

    Returns
    -------
    (s, d)
        m/s/N.
    """
    return np.array(
        [
            [ForceLoopParams(loop_delay_s=delay).default_gain(stiffness, 1 / RATE_HZ) for delay in border['delay_s']]
            for stiffness in border['stiffness_n_m']
        ]
    )


def margins() -> dict[str, float]:
    """Return how many times stiffer, and later, the contact may be than expected before the chosen gain is unstable."""
    params, period_s = ForceLoopParams(), 1 / RATE_HZ
    gain = params.default_gain(params.max_stiffness_n_m, period_s)
    delays = np.linspace(1.0, 20.0, 191)
    loop = params.loop(params.max_stiffness_n_m, period_s)
    late = [stability_limit_gain(replace(loop, delay_s=float(f) * params.loop_delay_s)) > gain for f in delays]
    return {'stiffness': stability_limit_gain(loop) / gain, 'delay': float(delays[np.argmin(late)])}
