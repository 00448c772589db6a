# SPDX-License-Identifier: Apache-2.0
import itertools

import numpy as np
import pytest

from texture_simulation.offline import record
from texture_simulation.path import Trajectory
from texture_simulation.scene import Scene, scene_from
from texture_simulation.sensor_models import TSF85_OVERSAMPLING as OVERSAMPLING
from texture_simulation.sensor_models import TSF85_PATH_RATE_HZ as PATH_RATE_HZ
from texture_simulation.sensor_models import Tsf85Model

PITCH_M = 1.5e-3


def scene_of(angle_rad: float = 0.0, noise_count: float = 0.0) -> Scene:
    term = {'kind': 'grating', 'pitch_m': PITCH_M, 'depth_m': 1e-4, 'angle_rad': angle_rad}
    rough = {'kind': 'self_affine', 'seed': 5}
    effects = {'patch_growth': {}, 'force_gain': {}, 'noise': {'fast_count': noise_count, 'slow_count': 0.0}}
    return scene_from('test', {'surfaces': {'sine': [term], 'rough': [rough]}, 'effects': effects})


def slide(scene: Scene, speed_m_s: float, surface: str = 'sine', seed: int = 0, force_n: float = 2.0):
    batches = record(scene, surface, speed_m_s, force_n, 2.0, rng=np.random.default_rng(seed))['signal']
    return np.concatenate([batch.samples for batch in batches])[:, 0]


def test_the_amplitude_grows_with_the_cube_root_of_the_force() -> None:
    scene = scene_of()
    # Stiffness F^(1/3), weakened by a blur that grows likewise.
    blur_m = scene.contact.blur_m * np.cbrt([1.0, 8.0])
    weakened = np.exp(-0.5 * (2 * np.pi * blur_m / PITCH_M) ** 2)
    ratio = slide(scene, 0.1, force_n=8.0)[500:].std() / slide(scene, 0.1, force_n=1.0)[500:].std()
    assert ratio == pytest.approx(2 * weakened[1] / weakened[0], rel=0.02)


@pytest.mark.parametrize('surface', ['sine', 'rough'])
def test_a_finger_at_rest_senses_only_noise(surface: str) -> None:
    assert not slide(scene_of(), 0.0, surface).any()
    noise = slide(scene_of(noise_count=25.0), 0.0, surface)
    assert noise.std() == pytest.approx(25.0, rel=0.1)
    assert np.isfinite(noise).all()


def test_too_strong_a_vibration_is_clipped_as_by_the_converter() -> None:
    scene = scene_from('t', {'surfaces': {'deep': [{'kind': 'grating', 'pitch_m': 2e-3, 'depth_m': 5e-3}]}})
    signal = slide(scene, 0.2, 'deep')
    assert (signal.min(), signal.max()) == (-32768, 32767)


def test_blocks_of_any_length_join_without_a_trace() -> None:
    n_points = 1200
    x_m = 0.1 * np.arange(n_points) / PATH_RATE_HZ
    path = Trajectory(x_m, 0 * x_m, np.full(n_points, 2.0))
    scene = scene_of()
    whole = Tsf85Model(scene, scene.surface('rough'), np.random.default_rng(3)).advance(path)
    pieces = Tsf85Model(scene, scene.surface('rough'), np.random.default_rng(3))
    ends = np.cumsum([0, 7, 5, 100, 1, 287, 200]) * OVERSAMPLING
    joined = [pieces.advance(path.at(np.arange(a, b))) for a, b in itertools.pairwise(ends)]
    # The blur sums as many harmonics as a block needs: not to the last bit the same.
    assert np.allclose(np.concatenate([dynamic for dynamic, _ in joined]), whole[0], atol=1)
    assert np.array_equal(np.concatenate([images for _, images in joined]), whole[1])


def test_the_image_rises_where_and_as_hard_as_the_finger_presses() -> None:
    scene = scene_from('t', {'surfaces': {'flat': []}})
    model = Tsf85Model(scene, scene.surface('flat'), np.random.default_rng(0))
    still = np.zeros(200)
    free, pressed = (model.advance(Trajectory(still, still, still + force))[1][-1] for force in (0.0, 2.0))
    rise = (pressed.astype(int) - free).reshape(7, 4)
    assert rise.sum() == pytest.approx(6000, abs=20)
    assert rise[3, 1] >= rise.max() - 1
    assert rise[0, 0] == 0
