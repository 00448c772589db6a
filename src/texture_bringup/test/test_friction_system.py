# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Friction as a feature on the emulated UR, from exploring to a live answer."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

pytestmark = [pytest.mark.benchmark, pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

from texture_bringup.launcher import ChildLauncher
from texture_bringup.operator import Operator
from texture_core.config import find_file
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train
from texture_exploration.presets import load_preset
from texture_features.feature_set import LabelledFeatures
from texture_simulation.devices.ur import (
    ControllerProcess,
    UrControllerParams,
)
from texture_simulation.friction import sliding_coefficient
from texture_simulation.scene import load_scene

DOMAIN = 89
ADDRESS = '127.0.0.112'
DEADLINE_S = 60.0
RECIPE, SCENE = 'friction-svm', 'sticky'
SHEETS = ('dusty_plastic', 'oiled_plastic')  # the skin glides on both, with coefficients of friction of 0.3 and 0.07
SLIDES, LIVE, TRIES = 4, 3, 3
# This machine may be busy.
PATIENT = {
    'estimate_timeout_s': 20.0,
    'state_timeout_s': 1.5,
    'silence_s': 1.5,
    'watchdog_hz': 1.0,
    'connect_timeout_s': 30.0,
}
REQUEST = load_preset('ets-linear').requests[0]


def coefficient_of(sheet: str) -> float:
    return float(sliding_coefficient(load_scene(SCENE).surface(sheet).friction, np.array(REQUEST.speed_m_s)))


def lay(operator: Operator, sheet: str) -> None:
    """Put another sheet under the finger: another relief for the sensor, another friction for the robot."""
    operator.set_parameters('emulator', {'surface': sheet})
    robot = ControllerProcess(UrControllerParams(ip=ADDRESS))
    assert robot.ask(f'emulate friction {coefficient_of(sheet)}').startswith('set to')


def explore(operator: Operator, surface: str = '') -> tuple[Any, list[Any]]:
    """Explore once; a sample that a busy machine loses may cost the windows of a slide."""
    for _ in range(TRIES):
        explored, vectors = operator.explore_with_features(replace(REQUEST, surface=surface))
        assert explored.success, explored.message
        if any(not vector.last for vector in vectors):
            return explored, vectors
    raise AssertionError(f'no window of {REQUEST}')


def launch(out: Path) -> ChildLauncher:
    parameters = out / 'patient.yaml'
    parameters.write_text(yaml.safe_dump({'/**': {'ros__parameters': PATIENT}}))
    given = {
        'ip': ADDRESS,
        'sensor': 'tsf85',
        'devices': out,
        'recipe': find_file(RECIPE, 'texture_estimation', 'config/recipes', 'recipe'),
        'scene': SCENE,
        'surface': SHEETS[0],
        'watch_signal': False,
        'explorer_params': parameters,
    }
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_LOG_DIR': str(out)}
    return ChildLauncher('ur', given, environment, out / 'nodes.log')


def test_the_emulated_ur_measures_the_friction_of_sheets_that_are_learned_and_named_live(tmp_path: Path) -> None:
    launcher = launch(tmp_path)
    with launcher, Operator(domain_id=DOMAIN, guard=launcher.check) as operator:
        operator.wait_for_explorer(DEADLINE_S)
        operator.wait_for_listeners(('features', 'exploration'), 1, launcher.check)
        vectors, surfaces = [], {}
        for sheet in SHEETS:
            lay(operator, sheet)
            for _ in range(SLIDES):
                explored, own = explore(operator, sheet)
                vectors += own
                surfaces[explored.exploration_id] = sheet
        examples = LabelledFeatures.from_vectors(vectors, surfaces)
        model = train(load_recipe(RECIPE), examples, 'model').save(tmp_path / 'model')
        operator.set_parameters('classifier', {'model': str(model)})
        named = [explore(operator)[0].texture for _ in range(LIVE)]
    for sheet in SHEETS:
        measured = [
            vector.values[vector.names.index('signal/friction')]
            for vector in vectors
            if not vector.last and surfaces[vector.exploration_id] == sheet
        ]
        # Its noise of 0.02 N over 1 N and more, and the lag of the reported force.
        assert np.median(measured) == pytest.approx(coefficient_of(sheet), abs=0.03), sheet
    assert all(estimate.final for estimate in named)
    assert np.mean([estimate.label == SHEETS[-1] for estimate in named]) > 0.5, named
