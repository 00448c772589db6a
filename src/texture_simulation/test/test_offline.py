# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import itertools

import numpy as np
import pytest

from texture_core.types import NANOSECONDS, FingerState, Phase, lost_samples
from texture_drivers import tsf85 as tables
from texture_simulation.offline import (
    simulate_exploration,
    simulate_slide_streams,
)
from texture_simulation.path import FingerTrack, SimulatedSlide
from texture_simulation.scene import load_scene, scene_from
from texture_simulation.sensor_models import SENSORS

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


TABLE = {
    'surfaces': {'rough': [{'kind': 'self_affine', 'seed': 5}], 'flat': []},
    'effects': {'noise': {'fast_count': 20.0, 'slow_count': 5.0}, 'slide_error': {}, 'unevenness': {}},
}


def table(sensor: str):
    return scene_from('test', {**TABLE, 'sensor': sensor})


@pytest.mark.parametrize('sensor', SENSORS)
def test_an_exploration_is_made_with_every_sensor(sensor: str) -> None:
    scene, rng = table(sensor), np.random.default_rng(0)
    _, explored = simulate_exploration(scene, 'rough', 0.1, 2.0, 0.5, start_ns=0, exploration_id='one', rng=rng)
    for stream in SENSORS[sensor].streams:
        assert {batch.channels for batch in explored[stream.topic]} == {stream.channels}
        assert {batch.common_unit for batch in explored[stream.topic]} == {stream.unit}


@pytest.mark.parametrize('sensor', SENSORS)
def test_a_seed_is_one_set_of_scans_and_a_finger_keeps_its_traits(sensor: str) -> None:
    def measured(seed: int, finger: int = 0, surface: str = 'rough') -> np.ndarray:
        sliding = SimulatedSlide(0.1, 2.0, 0.2)
        return simulate_slide_streams(table(sensor), surface, 2, sliding, np.random.default_rng(seed), finger=finger)

    topics = measured(1)
    assert all(np.array_equal(topics[topic], measured(1)[topic]) for topic in topics)
    assert not np.array_equal(measured(1)['signal'], measured(2)['signal'])


MS = NANOSECONDS // 1000


def advance(track: FingerTrack, ms: int):
    return track.advance(ms * MS, 10, 2000.0)


def touching(ms: int, x_m: float = 0.0, vx_m_s: float = 0.0, force_n: float = 2.0) -> FingerState:
    return FingerState(ms * MS, x_m=x_m, vx_m_s=vx_m_s, force_n=force_n)


def test_nothing_is_touched_before_anything_is_reported() -> None:
    track = FingerTrack()
    assert not advance(track, 5).force_n.any()
    assert not track.touching


def test_an_arm_silent_for_long_has_stopped_and_still_presses() -> None:
    track = FingerTrack()
    track.update(touching(0, 0.0, 0.1))
    advance(track, 150)
    moved = advance(track, 250)
    later = advance(track, 300)
    assert np.ptp(later.x_m) == 0.0
    assert later.x_m[0] == moved.x_m[-1]
    assert later.force_n.tolist() == [2.0] * 10


def test_being_put_elsewhere_is_no_slide() -> None:
    track = FingerTrack()
    track.update(touching(0))
    advance(track, 5)
    track.update(touching(5, x_m=0.2))
    assert advance(track, 10).x_m.tolist() == [0.2] * 10
