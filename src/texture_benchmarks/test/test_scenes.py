# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import BENCHMARKS
from texture_benchmarks.scenes import (
    FRICTION,
    PATCH,
    TOUCH_PROTOCOLS,
    TouchProtocol,
    ablate,
    completed,
    difference,
    extract_features,
    variants,
)
from texture_benchmarks.study import BenchmarkOptions
from texture_simulation.effects import EFFECTS
from texture_simulation.scene import Scene, load_scene, scene_from

pytestmark = pytest.mark.ros

TOUCHING = TouchProtocol((0.1,), (1.0, 8.0), duration_s=0.2)


def two_ridges(**effects: dict) -> Scene:
    surfaces = {
        name: [{'kind': 'grating', 'pitch_m': 2e-3, 'depth_m': depth}] for name, depth in (('a', 4e-6), ('b', 6e-6))
    }
    return scene_from('ridges', {'surfaces': surfaces, 'effects': effects})


def test_every_band_holds_the_power_of_its_frequencies() -> None:
    time_s = np.arange(1000) / 1000
    tones = np.stack([np.sin(2 * np.pi * hertz * time_s) for hertz in (20.0, 200.0)])[..., None]
    bands = extract_features(tones, 1000.0)
    edges_hz = np.geomspace(5.0, 500.0, bands.shape[1] + 1)
    for band, hertz in zip(bands.argmax(axis=1), (20.0, 200.0), strict=True):
        assert edges_hz[band] - 2 <= hertz <= edges_hz[band + 1] + 2


def test_a_term_that_decides_is_found_and_one_that_does_nothing_changes_nothing() -> None:
    scene = two_ridges(noise={'fast_count': 300.0}, unevenness={'relative': 1e-6})
    terms = ablate(scene, variants(scene, TOUCHING), TOUCHING, 80, repeats=4, seed=0)
    easier = terms['noise']['accuracy_without']
    assert easier['change'] > max(0.05, easier['half_interval'])
    assert abs(terms['unevenness']['accuracy_trained_without']['change']) < 0.05


def test_what_grows_with_the_force_stays_at_its_mean_when_removed_and_comes_back_the_same(monkeypatch) -> None:
    scene = two_ridges(patch_growth={})
    removed = variants(scene, TOUCHING)['patch_growth']
    assert removed.contact.blur_m == pytest.approx(scene.contact.blur_m * 4.5 ** (1 / 3))
    monkeypatch.setattr('texture_benchmarks.scenes.REMOVED_EFFECTS', {'ridges': dict(scene.effects)})
    again = completed(removed, TOUCHING)
    assert again.effects == scene.effects
    assert again.contact.blur_m == pytest.approx(scene.contact.blur_m)


def test_friction_and_the_patch_filter_can_be_removed_as_effects_can() -> None:
    scene = load_scene('sticky')
    others = variants(scene, TOUCH_PROTOCOLS['sticky'])
    assert set(others) == {*scene.effects, PATCH, FRICTION}
    assert all(surface.friction is None for surface in others[FRICTION].surfaces.values())
    assert others[PATCH].contact.blur_m < scene.contact.blur_m


def test_a_difference_has_an_interval_of_student_t() -> None:
    assert difference([0.0, 0.01, 0.02]) == {'change': 0.01, 'half_interval': 0.0248}  # 4.303 of 0.01 / √3
    assert difference([0.1]) == {'change': 0.1, 'half_interval': np.inf}


def test_every_effect_is_measured_in_a_scene() -> None:
    scenes_of_all = [completed(load_scene(name), touch_protocol) for name, touch_protocol in TOUCH_PROTOCOLS.items()]
    assert {effect for scene in scenes_of_all for effect in scene.effects} == set(EFFECTS)


@pytest.mark.benchmark
def test_scenes_are_cheap_and_every_term_is_weighed(tmp_path: Path) -> None:
    result = BENCHMARKS['scenes'](BenchmarkOptions(tmp_path, quick=True))
    numbers = result.numbers
    assert all(drawn.is_file() for drawn in result.charts)
    assert numbers['scan_ms']['ets_linear']['together_ms'] < 10
    assert set(load_scene('ets_linear').effects) < set(numbers['terms']['ets_linear'])
