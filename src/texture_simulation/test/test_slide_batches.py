# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from texture_simulation.offline import record, simulate_exploration, simulate_slide_streams, simulate_slides
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import load_scene, scene_from
from texture_simulation.sensor_models import SENSORS

TABLE = {
    'surfaces': {'rough': [{'kind': 'self_affine', 'seed': 5}], 'flat': []},
    'effects': {'noise': {'fast_count': 20.0, 'slow_count': 5.0}, 'slide_error': {}, 'unevenness': {}},
}
PAPERS = ('ets_linear', 'ets_circular', 'ets_fine', 'roughness', 'jamali', 'kaboli', 'hu')


def table(sensor: str):
    return scene_from('test', {**TABLE, 'sensor': sensor})


@pytest.mark.parametrize('sensor', SENSORS)
def test_scans_have_the_shape_of_the_fast_stream_and_are_all_different(sensor: str) -> None:
    stream = SENSORS[sensor].fast
    measured = simulate_slides(table(sensor), 'rough', 3, SimulatedSlide(0.1, 2.0, 0.5), np.random.default_rng(0))
    assert measured.shape == (3, round(0.5 * stream.rate_hz), len(stream.channels))
    assert np.isfinite(measured).all()
    assert (np.ptp(measured, axis=0) > 0).any()


@pytest.mark.parametrize('sensor', SENSORS)
def test_a_recording_and_an_exploration_are_made_with_every_sensor(sensor: str) -> None:
    scene, rng = table(sensor), np.random.default_rng(0)
    _, explored = simulate_exploration(scene, 'rough', 0.1, 2.0, 0.5, start_ns=0, exploration_id='one', rng=rng)
    recorded = record(scene, 'rough', 0.1, 2.0, 0.5, rng=rng)
    for stream in SENSORS[sensor].streams:
        for made in (explored, recorded):
            assert {batch.channels for batch in made[stream.topic]} == {stream.channels}
            assert {batch.common_unit for batch in made[stream.topic]} == {stream.unit}


@pytest.mark.parametrize('sensor', SENSORS)
def test_a_seed_is_one_set_of_scans_and_a_finger_keeps_its_traits(sensor: str) -> None:
    def measured(seed: int, finger: int = 0, surface: str = 'rough') -> np.ndarray:
        sliding = SimulatedSlide(0.1, 2.0, 0.2)
        return simulate_slide_streams(table(sensor), surface, 2, sliding, np.random.default_rng(seed), finger=finger)

    topics = measured(1)
    assert all(np.array_equal(topics[topic], measured(1)[topic]) for topic in topics)
    assert not np.array_equal(measured(1)['signal'], measured(2)['signal'])


def test_speed_force_and_direction_may_differ_from_scan_to_scan() -> None:
    ridges = {'ridges': [{'kind': 'grating', 'pitch_m': 2e-3, 'depth_m': 1e-4}]}
    scene = scene_from('test', {'surfaces': ridges})
    speed, angle = np.array([0.1, 0.2, 0.2]), np.array([0.0, 0.0, np.pi / 3])
    measured = simulate_slides(scene, 'ridges', 3, SimulatedSlide(speed, 2.0, 1.0, angle), np.random.default_rng(0))[
        ..., 0
    ]
    lines = np.abs(np.fft.rfft(measured * np.hanning(1000), axis=1)).argmax(axis=1)
    assert lines == pytest.approx(speed * np.cos(angle) / 2e-3, abs=1)


@pytest.mark.parametrize('name', PAPERS)
def test_every_surface_of_every_paper_can_be_measured(name: str) -> None:
    scene = load_scene(name)
    rng = np.random.default_rng(0)
    for surface in scene.surfaces:
        measured = simulate_slides(scene, surface, 1, SimulatedSlide(0.1, 2.0, 0.1), rng)
        assert np.isfinite(measured).all()
        assert measured.std() > 0
