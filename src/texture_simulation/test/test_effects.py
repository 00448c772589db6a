# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Each effect of the catalogue does what its name says, and nothing else."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from scipy import signal

from texture_simulation.effects import (
    EFFECTS,
    Dropouts,
    FingerSpread,
    ForceGain,
    Noise,
    PatchGrowth,
    SlideError,
    UnevenMotion,
    Unevenness,
)
from texture_simulation.path import Trajectory
from texture_simulation.scene import scene_from
from texture_simulation.sensor_models import SENSORS

RATE_HZ = 1000.0
CUTS = (0, 3, 3, 400, 401, 1000)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def on_signal(effect: Any, samples: np.ndarray, *, slow: bool = False, seed: int = 0) -> np.ndarray:
    return effect.start_signal(rng(seed), RATE_HZ, (), samples.shape[-1], slow=slow)(samples)


def along_x(speed_m_s: float, count: int = 1000, force_n: float = 1.0) -> Trajectory:
    x_m = speed_m_s * np.arange(count) / RATE_HZ
    return Trajectory(x_m, np.zeros_like(x_m), np.full_like(x_m, force_n))


def test_noise_has_the_stated_density_at_all_frequencies() -> None:
    made = on_signal(Noise(fast_count=20.0), np.zeros((200_000, 1)))[:, 0]
    _, density = signal.welch(made, RATE_HZ, nperseg=64)
    assert density[2:-2] == pytest.approx(2 * 20.0**2 / RATE_HZ, rel=0.1)
    assert on_signal(Noise(slow_count=3.0), np.zeros((50_000, 1)), slow=True).std() == pytest.approx(3.0, rel=0.02)


def test_dropouts_repeat_the_last_sample_for_so_long_and_so_often() -> None:
    samples = np.arange(200_000, dtype=float)[:, None]
    made = on_signal(Dropouts(per_s=2.0, length_s=0.02), samples)[:, 0]
    held = np.diff(made) == 0
    assert held.mean() == pytest.approx(0.04, rel=0.25)  # now and then one begins within another
    assert (made <= samples[:, 0]).all()
    runs = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], held, [0]]))))[::2]
    assert np.median(runs) == 20


def test_uneven_motion_displaces_the_skin_along_its_way_only() -> None:
    effect = UnevenMotion(distance_m=5e-4, length_m=0.01)
    path = along_x(0.1, 200_000)
    skin = effect.start_path(rng(), RATE_HZ, ())(path)
    for displaced_m in (skin.x_m - path.x_m, skin.y_m):
        assert displaced_m.std() == pytest.approx(5e-4, rel=0.05)
        assert np.corrcoef(displaced_m[:-300], displaced_m[300:])[0, 1] == pytest.approx(0.0, abs=0.05)
        assert np.abs(np.diff(displaced_m)).max() < 3e-5  # smooth: the skin never goes backwards
    still = effect.start_path(rng(), RATE_HZ, ())(along_x(0.0))
    assert np.ptp(still.x_m) == 0


def test_size_and_stiffness_of_the_contact_grow_with_the_cube_root_of_the_force() -> None:
    force_n = np.array([0.0, 1.0, 8.0])
    assert PatchGrowth().blur_growth(force_n) == pytest.approx([0.0, 1.0, 2.0])
    assert ForceGain().gain_growth(force_n) == pytest.approx([0.0, 1.0, 2.0])


def test_unevenness_has_its_spread_and_the_mean_1() -> None:
    x_m, y_m = np.meshgrid(np.linspace(0, 1, 1000), np.linspace(0, 1, 50))
    gain = Unevenness(relative=0.2).gain(Trajectory(x_m.ravel(), y_m.ravel(), np.ones(x_m.size)), 0)
    assert np.mean(gain) == pytest.approx(1.0, abs=0.01)
    assert np.std(gain) == pytest.approx(0.2, rel=0.05)


def test_a_finger_keeps_its_sensitivity_and_another_has_another() -> None:
    spread = FingerSpread(relative=0.1)
    gains = [float(spread.gain(along_x(0.1), finger)) for finger in range(500)]
    assert np.log(gains).std() == pytest.approx(0.1, rel=0.15)
    assert spread.gain(along_x(0.2), 7) == gains[7]


def test_slides_deviate_as_much_as_stated_and_never_turn_round() -> None:
    speed, force = SlideError(speed=0.02, force=0.5).slide(np.full(20_000, 0.1), np.full(20_000, 2.0), rng())
    assert speed.std() == pytest.approx(0.002, rel=0.03)
    assert force.min() > 0


SIGNAL = [effect for effect in EFFECTS.values() if hasattr(effect, 'start_signal')]


@pytest.mark.parametrize('kind', SIGNAL)
def test_blocks_of_samples_give_the_same_as_the_whole(kind: type) -> None:
    samples = rng(1).normal(0, 100, (1000, 2))
    through = kind().start_signal(rng(), RATE_HZ, (), 2, slow=False)
    pieces = np.concatenate([through(samples[a:b]) for a, b in itertools.pairwise(CUTS)])
    assert np.allclose(pieces, on_signal(kind(), samples))


def test_blocks_of_a_path_give_the_same_as_the_whole() -> None:
    path = along_x(0.1)
    through = UnevenMotion().start_path(rng(), RATE_HZ, ())
    pieces = [through(path.at(slice(a, b))) for a, b in itertools.pairwise(CUTS)]
    whole = UnevenMotion().start_path(rng(), RATE_HZ, ())(path)
    assert np.allclose(np.concatenate([piece.x_m for piece in pieces]), whole.x_m)


@pytest.mark.parametrize('name', EFFECTS)
@pytest.mark.parametrize('sensor', SENSORS)
def test_every_effect_works_with_every_sensor_and_is_off_unless_named(name: str, sensor: str) -> None:
    surfaces = {'rough': [{'kind': 'self_affine', 'seed': 5}]}
    bare = scene_from('bare', {'sensor': sensor, 'surfaces': surfaces})
    named = scene_from('named', {'sensor': sensor, 'surfaces': surfaces, 'effects': {name: {}}})
    assert not bare.effects
    assert named.without(name).effects == bare.effects
    kind = SENSORS[sensor]
    count = kind.step_points * round(0.2 * kind.path_rate_hz / kind.step_points)
    x_m = 0.1 * np.arange(count) / kind.path_rate_hz
    path = Trajectory(x_m, np.zeros_like(x_m), np.full_like(x_m, 2.0))
    measured = kind.make(named, named.surface('rough'), rng(), settled=True).streams(path)
    assert all(np.isfinite(samples).all() for samples in measured.values())
