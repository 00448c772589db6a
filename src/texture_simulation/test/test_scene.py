# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import InvalidParameter, UnknownName
from texture_simulation.scene import load_scene, scene_from


def test_the_bench_has_at_least_ten_surfaces_that_differ() -> None:
    scene = load_scene('twelve_textures')
    x_m = np.linspace(0, 0.05, 1000)
    heights = [surface.height_m(x_m, 0 * x_m, 0 * x_m + 1e-4) for surface in scene.surfaces.values()]
    assert len(heights) >= 10
    assert np.corrcoef(heights).shape == np.unique(np.corrcoef(heights), axis=0).shape
    assert all(np.isfinite(height).all() for height in heights)


def test_effects_are_off_unless_named() -> None:
    effects = scene_from('bare', {'surfaces': {'flat': []}}).effects
    assert effects == {}


def test_an_unknown_surface_or_scene_gets_the_nearest_name() -> None:
    with pytest.raises(UnknownName, match="did you mean 'ridge_1mm'"):
        load_scene('twelve_textures').surface('ridge_1m')
    with pytest.raises(UnknownName, match="did you mean 'twelve_textures'"):
        load_scene('twelve_texture')


@pytest.mark.parametrize(
    ('content', 'complaint'),
    [
        (None, 'no mapping `surfaces`'),
        ({'surfaces': {}, 'weather': {}}, 'weather'),
        ({'surfaces': {'a': {'kind': 'grating'}}}, "surface 'a'.*list of terms"),
        ({'surfaces': {'a': [{'kind': 'grating', 'pitch_mm': 2}]}}, "did you mean 'pitch_m'"),
        ({'surfaces': {'a': [{'kind': 'grating', 'pitch_m': -1.0}]}}, 'pitch_m'),
        ({'surfaces': {}, 'effects': {'noise': {'fast_count': 'loud'}}}, "effect 'noise'.*'loud'"),
    ],
)
def test_a_wrong_scene_is_refused_with_its_place(content: object, complaint: str) -> None:
    with pytest.raises(InvalidParameter, match=complaint):
        scene_from('mine', content)


def test_an_unknown_kind_gets_the_nearest_one() -> None:
    with pytest.raises(UnknownName, match="did you mean 'grating'"):
        scene_from('mine', {'surfaces': {'a': [{'kind': 'grting'}]}})


def test_a_file_that_is_no_yaml_is_refused(tmp_path: Path) -> None:
    path = tmp_path / 'bad.yaml'
    path.write_text('surfaces: [')
    with pytest.raises(InvalidParameter, match='no YAML'):
        load_scene(str(path))
