# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Each paper as a user repeats it on the emulator: its sensor, motion and recipes, from exploring to a live answer."""

import os
import re
import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
import yaml

pytestmark = [pytest.mark.benchmark, pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'


from texture_bringup.command import main
from texture_bringup.commands.explore import REJECTED
from texture_bringup.launcher import ChildLauncher
from texture_bringup.operator import Operator
from texture_core.config import find_file
from texture_core.types import ExplorationRequest
from texture_estimation.model import load_model
from texture_estimation.recipe import load_recipe
from texture_estimation.roughness import (
    load_roughness_recipe,
    read_grades,
    train_grades,
)
from texture_estimation.training import train
from texture_exploration.presets import load_preset
from texture_features.feature_set import LabelledFeatures

DOMAIN = 87
DEADLINE_S = 60.0
TRIES = 3  # a sample that a busy machine loses costs the only window of a slide
SMOOTH, ROUGH = 'glass', 'ridge_2mm_deep'
# This machine may be busy.
PATIENT = {'estimate_timeout_s': 20.0, 'state_timeout_s': 1.5}
# On a busy machine a late command is caught up with, which looks fast.
QUICK = {'peak_speed_fraction': 5.0}


@dataclass(frozen=True)
class Paper:
    """What a paper is repeated with on the emulator; so many slides over each surface are for training."""

    sensor: str
    preset: str
    recipe: str
    slides: int
    scene: str = 'twelve_textures'
    surfaces: tuple[str, str] = (SMOOTH, ROUGH)


ROUGHNESS = Paper('tsf85', 'ets-roughness', 'ets-roughness-ann1', 6)
ONLINE = Paper('biotac', 'kaboli', 'kaboli-pa', 3, 'kaboli', ('orange', 'toothbrush'))


def recipe_file(name: str) -> Path:
    kind = 'roughness' if name.startswith('ets-roughness') else 'recipes'
    return find_file(name, 'texture_estimation', f'config/{kind}', 'recipe')


class Rig:
    """The emulator with the sensor of a paper, in a ROS domain of its own."""

    def __init__(self, paper: Paper, out: Path) -> None:
        self.paper = paper
        self._out = out
        self._environment = {**os.environ, 'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_LOG_DIR': str(out)}
        parameters = out / 'patient.yaml'
        parameters.write_text(yaml.safe_dump({'/**': {'ros__parameters': PATIENT}}))
        given = {
            'sensor': paper.sensor,
            'devices': out,
            'recipe': recipe_file(paper.recipe),
            'scene': paper.scene,
            'surface': paper.surfaces[0],
            'watch_signal': False,
            'explorer_params': parameters,
        }
        self.launcher = self.started('emulator', given)
        self.operator = Operator(domain_id=DOMAIN, guard=self.launcher.check)

    def started(self, name: str, given: dict[str, object]) -> ChildLauncher:
        """Return a launch file that is to be started with arguments."""
        return ChildLauncher(name, given, self._environment, self._out / f'{name}.log')

    @property
    def request(self) -> ExplorationRequest:
        """The first motion of the preset."""
        return load_preset(self.paper.preset)[0]

    def explore(self, surface: str = '') -> tuple[Any, list[Any]]:
        """Explore as the paper did; return the result and the features of the launched nodes."""
        request = replace(self.request, surface=surface)
        for _ in range(TRIES):
            explored, vectors = self.operator.explore_with_features(request)
            assert explored.success, explored.message
            if vectors:
                return explored, vectors
        raise AssertionError(f'{self.paper.recipe}: no window of {request}')

    def examples(self) -> LabelledFeatures:
        """Explore both surfaces, and return the features that the launched nodes made of it."""
        vectors, surfaces = [], {}
        for surface in self.paper.surfaces:
            self.operator.set_parameters('emulator', {'surface': surface})
            for _ in range(self.paper.slides):
                explored, own = self.explore(surface)
                vectors += own
                surfaces[explored.exploration_id] = surface
        return LabelledFeatures.from_vectors(vectors, surfaces)


@contextmanager
def running(paper: Paper, out: Path) -> Iterator[Rig]:
    rig = Rig(paper, out)
    with rig.launcher, rig.operator:
        rig.operator.wait_for_explorer(DEADLINE_S)
        rig.operator.wait_for_listeners(('features', 'exploration'), 1, rig.launcher.check)
        yield rig


def test_a_recipe_of_rispal_et_al_trains_from_its_motion_and_grades_the_surface_live(tmp_path: Path) -> None:
    table = tmp_path / 'grades.csv'
    table.write_text(f'texture,grade\n{SMOOTH},1\n{ROUGH},5\n', encoding='utf-8')
    grades = read_grades(table)
    with running(ROUGHNESS, tmp_path) as rig:
        recipe = load_roughness_recipe(ROUGHNESS.recipe)
        train_grades(recipe, rig.examples(), grades, 'grades').save(tmp_path / 'grades')
        with rig.started('roughness', {'roughness_model': tmp_path / 'grades.json'}) as grading:
            rig.operator.wait_for_listeners(('roughness_features', 'roughness'), 1, grading.check)
            roughness = rig.explore()[0].roughness
    assert (roughness.valid, roughness.final) == (True, True), roughness
    assert roughness.grade == pytest.approx(5.0, abs=1.0)


def test_the_running_classifier_learns_a_new_object_online_slide_by_slide_as_kaboli_et_al_do(tmp_path: Path) -> None:
    with running(ONLINE, tmp_path) as rig:
        model = train(load_recipe(ONLINE.recipe), rig.examples(), 'model').save(tmp_path / 'model')
        rig.operator.set_parameters('classifier', {'model': str(model)})
        rig.operator.set_parameters('emulator', {'surface': 'pine_ball'})
        counts = []
        for _ in range(3):
            explored, _ = rig.explore()
            counts.append(rig.operator.add('pine_ball', explored.exploration_id)[0])
        assert 0 < counts[0] < counts[1] < counts[2]
        assert rig.explore()[0].texture.label == 'pine_ball'


PAGE = Path(__file__).parents[3] / 'docs' / 'papers.md'
LIVE = re.findall(r'^ {4}texture launch \w+ sensor:=.*(?:\n {4}.*)+', PAGE.read_text(), re.MULTILINE)


@pytest.mark.parametrize('lines', LIVE, ids=[re.search(r'recipe:=(\S+)', lines)[1] for lines in LIVE])
def test_the_live_lines_of_the_page_record_two_surfaces_and_train_a_model_as_printed(
    lines: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('ROS_DOMAIN_ID', str(DOMAIN))
    (tmp_path / 'patient.yaml').write_text(yaml.safe_dump({'/**': {'ros__parameters': {**PATIENT, **QUICK}}}))
    [launch, *orders] = [shlex.split(line, comments=True) for line in lines.splitlines()]
    own = {'devices': tmp_path, 'explorer_params': tmp_path / 'patient.yaml'}
    given = {**own, **dict(word.split(':=') for word in launch[3:])}
    launcher = ChildLauncher(launch[2], given, dict(os.environ), tmp_path / 'nodes.log')
    with launcher, Operator(domain_id=DOMAIN, guard=launcher.check) as operator:
        operator.wait_for_explorer(DEADLINE_S)
        operator.wait_for_listeners(('features', 'exploration'), 1, launcher.check)
        for order in orders[:-1]:
            # No label is accepted without a model.
            assert main(order[1:]) == (REJECTED if order[1] == 'explore' else 0)
    assert main(orders[-1][1:]) == 0
    surfaces = {order[order.index('--surface') + 1] for order in orders if '--surface' in order}
    assert load_model(tmp_path / orders[-1][-1]).labels == tuple(sorted(surfaces))
