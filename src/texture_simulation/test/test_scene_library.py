# SPDX-License-Identifier: Apache-2.0
"""The scenes that the package ships, and what is written about them."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from texture_core.config import find_file, shipped
from texture_simulation.scene import load_scene
from texture_simulation.sensor_models import SENSORS
from texture_simulation.surfaces import KINDS

FILES = sorted(shipped('texture_simulation', 'config/scenes').values())
SENSOR_OF = {
    'ets_linear': 'tsf85_3x4', 'ets_circular': 'tsf85_3x4', 'ets_fine': 'tsf85_3x4', 'roughness': 'tsf85',
    'jamali': 'daq', 'kaboli': 'biotac', 'kaboli_shapes': 'biotac', 'hu': 'pvdf',
}  # fmt: skip


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.stem)
def test_a_scene_says_what_it_is_and_where_its_sizes_come_from(path: Path) -> None:
    scene, text = load_scene(str(path)), path.read_text(encoding='utf-8')
    assert scene.sensor in SENSORS
    assert scene.sensor == SENSOR_OF.get(path.stem, scene.sensor)
    assert 'All lengths in metres' in text or 'All values are' in text
    assert 'guess' in text or 'printed' in text
    assert ('Experiment:' in text) == (path.stem in SENSOR_OF)


def test_all_terms_of_the_library_are_used_by_some_scene() -> None:
    used = {type(term) for path in FILES for s in load_scene(str(path)).surfaces.values() for term in s.terms}
    assert used == set(KINDS.values())


def test_grades_of_people_lie_apart_one_for_each_texture() -> None:
    with (find_file('ets_roughness', 'texture_simulation', 'config/grades', 'grades', '.csv')).open(
        encoding='utf-8'
    ) as file:
        rows = list(csv.DictReader(file))
    assert {row['texture'] for row in rows} == set(load_scene('roughness').surfaces)
    assert all(1.0 <= float(row['grade']) <= 5.0 for row in rows)
