# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from texture_bringup.commands.scene import caption, picture
from texture_simulation.scene import load_scene
from texture_simulation.scene_view import SceneView, ViewPlan, lines_hz, view

PNG = b'\x89PNG'


def shown(scene: str, surface: str, **plan: float) -> SceneView:
    return view(load_scene(scene), surface, ViewPlan(**plan), np.random.default_rng(0))


def test_the_highest_peak_stands_where_ridges_must_have_their_line() -> None:
    seen = shown('ets_linear', 'ridge_2a', speed_m_s=0.1)
    assert seen.lines_hz == [50.0]
    assert seen.frequency_hz[seen.density.argmax()] == pytest.approx(50.0, abs=seen.frequency_hz[1])


def test_lines_follow_the_angle_between_way_and_ridges() -> None:
    ridges, grid = (load_scene('ets_circular').surface(name) for name in ('ridge_2', 'grid_2'))
    assert lines_hz(ridges, 0.2, math.pi / 3) == pytest.approx([50.0])
    assert lines_hz(ridges, 0.2, math.pi / 2) == []
    assert lines_hz(grid, 0.14, math.pi / 6) == pytest.approx([50.0, 50.0 * math.sqrt(3)])


def test_the_skin_senses_less_than_the_surface_has() -> None:
    seen = shown('ets_fine', 'scratched_plastic')
    assert seen.blurred_m.std() < 0.9 * seen.sharp_m.std()


def test_pictures_of_a_slide_and_of_a_whole_scene_are_drawn(tmp_path: Path) -> None:
    line, circle = shown('hu', 'linen_1', duration_s=0.2), shown('jamali', 'tile_1', duration_s=0.3, radius_m=0.01)
    for number, seen in enumerate(([line], [line, circle])):
        title = caption('linen', 'pvdf', ViewPlan())
        assert picture(seen, title, tmp_path / f'{number}.png').read_bytes().startswith(PNG)
