# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The emulator is explored with motions that are chosen one by one."""

import math
import os
from dataclasses import replace

import numpy as np
import pytest

pytestmark = [pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

from texture_bringup.command import main
from texture_bringup.launcher import ChildLauncher
from texture_bringup.operator import Operator
from texture_evaluation.train import train_from_bags
from texture_simulation.offline import SlidePlan, write_simulated

DOMAIN = 79
PATIENT = '/**: {ros__parameters: {estimate_timeout_s: 10.0, signal_timeout_s: 3.0}}'  # this machine may be busy
DEADLINE_S = 60.0
PLAN = SlidePlan(slides=8, speed_m_s=0.1, force_n=2.0, slide_s=0.9)
TEXTURES = ('ridges_x', 'ridges_y')


def trained(folder, directions):
    """Return the path of a model that knows two prints, of which one is the other turned by a quarter."""
    rng = np.random.default_rng(0)
    bags = [
        bag
        for number, direction in enumerate(directions)
        for bag in write_simulated(
            folder / f'bags{number}', replace(PLAN, direction_rad=direction), rng, 'oriented', TEXTURES
        )
    ]
    train_from_bags('default', bags, out=folder / 'model')
    return str(folder / 'model.npz')


@pytest.fixture(scope='module')
def model(tmp_path_factory):
    # An eighth between the two: this way both feel the same.
    return trained(tmp_path_factory.mktemp('model'), (math.pi / 4, 0.0))


@pytest.fixture
def bench(tmp_path, monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', str(DOMAIN))
    monkeypatch.setenv('ROS_LOG_DIR', str(tmp_path))
    (tmp_path / 'patient.yaml').write_text(PATIENT)
    given = {'devices': tmp_path, 'scene': 'oriented', 'surface': 'ridges_x'}
    given['explorer_params'] = tmp_path / 'patient.yaml'
    with ChildLauncher(
        'emulator', {**given, 'recipe': 'default'}, dict(os.environ), tmp_path / 'nodes.log'
    ) as launcher:
        with Operator('', DOMAIN, launcher.check) as operator:
            operator.wait_for_explorer(DEADLINE_S)
            operator.wait_for_signal(DEADLINE_S)
            operator.wait_for_listeners(('features',), 1, launcher.check)
        yield launcher


def test_the_slide_that_reports_the_textures_apart_is_made_and_recognises_them(model, bench, capsys) -> None:
    assert main(['identify', model, '--most', '4', '--sure', '0.99']) == 0
    said = capsys.readouterr().out
    assert 'slide 1: linear_slide, direction 0°, 0.1 m/s, 2 N' in said
    assert 'texture: ridges_x, probability' in said
