# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The scenes that the package ships, and what is written about them."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from texture_core.config import find_file, shipped
from texture_core.errors import InvalidParameter, UnknownName
from texture_drivers.catalogue import SENSORS as DRIVERS
from texture_simulation.emulator import LIVE_SENSORS
from texture_simulation.scene import load_scene, scene_from
from texture_simulation.sensor_models import SENSORS
from texture_simulation.surfaces import KINDS


def test_an_unknown_surface_or_scene_gets_the_nearest_name() -> None:
    with pytest.raises(UnknownName, match="did you mean 'ridge_1mm'"):
        load_scene('twelve_textures').surface('ridge_1m')
    with pytest.raises(UnknownName, match="no surface 'numpy:sqrt'"):  # `texture set` names it over the network
        load_scene('twelve_textures').surface('numpy:sqrt')
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
    with pytest.raises(InvalidParameter, match='is not YAML that can be read'):
        load_scene(str(path))


FILES = sorted(shipped('texture_simulation', 'config/scenes').values())
SENSOR_OF = {
    'ets_linear': 'tsf85_3x4', 'ets_circular': 'tsf85_3x4', 'ets_fine': 'tsf85_3x4', 'roughness': 'tsf85',
    'jamali': 'daq', 'kaboli': 'biotac', 'kaboli_shapes': 'biotac', 'hu': 'pvdf',
}  # fmt: skip


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.stem)
def test_a_scene_documents_what_it_is_and_where_its_sizes_come_from(path: Path) -> None:
    scene, text = load_scene(str(path)), path.read_text(encoding='utf-8')
    assert scene.sensor in SENSORS
    assert scene.sensor == SENSOR_OF.get(path.stem, scene.sensor)
    assert 'All lengths in metres' in text or 'All values are' in text
    assert 'guess' in text or 'printed' in text
    assert ('Experiment:' in text) == (path.stem in SENSOR_OF)


def test_all_terms_of_the_library_are_used_by_some_scene() -> None:
    used = {type(term) for path in FILES for s in load_scene(str(path)).surfaces.values() for term in s.terms}
    assert used == set(KINDS.values())


def test_grades_of_people_are_separate_one_for_each_texture() -> None:
    with (find_file('ets_roughness', 'texture_simulation', 'config/grades', 'grades', '.csv')).open(
        encoding='utf-8'
    ) as file:
        rows = list(csv.DictReader(file))
    assert {row['texture'] for row in rows} == set(load_scene('roughness').surfaces)
    assert all(1.0 <= float(row['grade']) <= 5.0 for row in rows)


@pytest.mark.parametrize('name', LIVE_SENSORS)
def test_an_emulated_sensor_has_a_driver_of_its_name(name):
    assert name in DRIVERS
