# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Each paper as a user repeats it on the emulator: its sensor, motion and recipes, from exploring to a live answer."""

import os
import re
import shlex
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytestmark = [pytest.mark.benchmark, pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'


from texture_bringup.command import main
from texture_bringup.commands.explore import NO_MODEL
from texture_bringup.operator import Operator
from texture_core.config import find_file
from texture_core.types import FeatureVector
from texture_estimation.model import load_model
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train
from texture_exploration.presets import load_preset
from texture_features.feature_set import LabelledFeatures

DOMAIN = 87
Launch = Callable[..., AbstractContextManager[Any]]
TRIES = 3  # a sample that a busy machine loses costs the only window of a slide
# This machine may be busy; a late command is caught up with, which looks fast.
PATIENT = {'estimate_timeout_s': 20.0, 'peak_speed_fraction': 5.0}


def slide(operator: Operator, surface: str) -> tuple[str, list[FeatureVector]]:
    """Explore as Kaboli et al. do; return the id, and the features of the launched nodes."""
    for _ in range(TRIES):
        explored, vectors = operator.explore_with_features(replace(load_preset('kaboli')[0], surface=surface))
        assert explored.success, explored.message
        if vectors:
            return explored.exploration_id, vectors
    raise AssertionError('no slide had a window')


def test_the_running_classifier_learns_a_new_object_online_slide_by_slide_as_kaboli_et_al_do(
    launched: Launch, tmp_path: Path
) -> None:
    recipe = find_file('kaboli-pa', 'texture_estimation', 'config/recipes', 'recipe')
    given = {'sensor': 'biotac', 'recipe': recipe, 'scene': 'kaboli', 'surface': 'orange', 'watch_signal': False}
    with launched('emulator', DOMAIN, tmp_path, PATIENT, **given) as launcher:
        operator = launcher.operator(senses=False)
        vectors, surfaces = [], {}
        for surface in ('orange', 'toothbrush'):
            operator.set_parameters('emulator', {'surface': surface})
            for _ in range(3):
                exploration_id, found = slide(operator, surface)
                vectors += found
                surfaces[exploration_id] = surface
        examples = LabelledFeatures.from_vectors(vectors, surfaces)
        model = train(load_recipe('kaboli-pa'), examples, 'model').save(tmp_path / 'model')
        operator.set_parameters('classifier', {'model': str(model)})
        operator.set_parameters('emulator', {'surface': 'pine_ball'})
        counts = [operator.add('pine_ball', slide(operator, '')[0])[0] for _ in range(3)]
        assert 0 < counts[0] < counts[1] < counts[2]
        assert operator.explore(load_preset('kaboli')[0]).texture.label == 'pine_ball'


PAGE = Path(__file__).parents[3] / 'docs' / 'papers.md'
LIVE = re.findall(r'^ {4}texture launch \w+ sensor:=.*(?:\n {4}.*)+', PAGE.read_text(), re.MULTILINE)


@pytest.mark.parametrize('lines', LIVE, ids=[re.search(r'recipe:=(\S+)', lines)[1] for lines in LIVE])
def test_the_live_lines_of_the_page_record_two_surfaces_and_train_a_model_as_printed(
    launched: Launch, lines: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('ROS_DOMAIN_ID', str(DOMAIN))
    [launch, *orders] = [shlex.split(line, comments=True) for line in lines.splitlines()]
    given = dict(word.split(':=') for word in launch[3:])
    with launched(launch[2], DOMAIN, tmp_path, PATIENT, **given) as launcher:
        launcher.operator(senses=False)
        for order in orders[:-1]:
            # There is no label without a model.
            assert main(order[1:]) == (NO_MODEL if order[1] == 'explore' else 0)
    assert main(orders[-1][1:]) == 0
    surfaces = {order[order.index('--surface') + 1] for order in orders if '--surface' in order}
    assert load_model(tmp_path / orders[-1][-1]).labels == tuple(sorted(surfaces))
