# SPDX-License-Identifier: Apache-2.0
import itertools
import math

import numpy as np
import pytest

from texture_core.types import NANOSECONDS, Phase, lost_samples
from texture_drivers import tsf85 as tables
from texture_simulation.offline import simulate_exploration
from texture_simulation.scene import load_scene

START_NS = 1_700_000_000 * NANOSECONDS
SCENE = load_scene('twelve_textures')


def explore(surface='ridge_2mm_deep', seed=0, **more):
    rng = np.random.default_rng(seed)
    return simulate_exploration(SCENE, surface, 0.1, 2.0, 1.0, start_ns=START_NS, exploration_id='one', rng=rng, **more)


def test_the_phases_come_in_order_and_the_slide_is_covered_by_guarantees() -> None:
    states, _ = explore()
    phases = [state.phase for state in states]
    assert list(dict.fromkeys(phases)) == [Phase.APPROACH, Phase.CONTACT, Phase.SLIDE, Phase.LIFT, Phase.DONE]
    slide = [state for state in states if state.phase is Phase.SLIDE]
    covered_s = (slide[-1].stamp_ns - slide[0].stamp_ns) / NANOSECONDS + slide[-1].steady_s
    assert covered_s == pytest.approx(1.0)
    assert all(state.surface == 'ridge_2mm_deep' and state.exploration_id == 'one' for state in states)
    assert all((state.speed_m_s, state.force_n) == (0.1, 2.0) for state in slide)


def test_the_signals_cover_the_exploration_without_a_gap_and_named_as_the_driver_does() -> None:
    states, signals = explore()
    for topic, sensor in (('signal', tables.DYNAMIC_SENSOR), ('signal_static', tables.STATIC_SENSOR)):
        batches = signals[topic]
        assert lost_samples(batches) == 0
        assert (batches[0].stamp_ns, batches[0].sensor) == (START_NS, sensor)
        assert batches[-1].end_ns >= states[-1].stamp_ns
        assert all(abs(a.end_ns - b.stamp_ns) <= 1 for a, b in itertools.pairwise(batches))


def test_the_line_of_the_ridges_stands_in_the_slide_alone() -> None:
    states, signals = explore()
    signal = np.concatenate([batch.samples for batch in signals['signal']])[:, 0]
    begin = next((state.stamp_ns - START_NS) // 1_000_000 for state in states if state.phase is Phase.SLIDE)
    assert signal[:200].std() < 50
    spectrum = np.abs(np.fft.rfft(signal[begin : begin + 1000] * np.hanning(1000)))
    assert spectrum.argmax() == pytest.approx(50, abs=2)  # 0.1 m/s over 2 mm, within the speed error


def test_a_circle_meets_the_ridges_at_all_angles() -> None:
    states, signals = explore(radius_m=0.02)
    directions = [state.direction_rad for state in states if state.phase is Phase.SLIDE]
    assert directions[-1] - directions[0] == pytest.approx(0.9 * 0.1 / 0.02)
    assert states[0].motion == 'circular'
    assert math.isnan(states[0].direction_rad)
    assert np.isfinite(np.concatenate([batch.samples for batch in signals['signal']])).all()
