# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""`texture collect` and `texture check` on the emulated rig, over a sample that varies."""

import os
import re

import pytest

pytestmark = [pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

from texture_bringup.command import main
from texture_bringup.launcher import ChildLauncher
from texture_bringup.operator import Operator
from texture_core.errors import ExplorationError, MotionRefused
from texture_core.types import ExplorationRequest
from texture_evaluation.train import train_from_bags
from texture_recordings.dataset import SlideDataset

DOMAIN = 88
PATIENT = 'estimate_timeout_s: 1.0, signal_timeout_s: 3.0, state_timeout_s: 1.0'  # this machine may be busy
PATCH = 'patch_x_low_m: -0.05, patch_x_high_m: 0.05, patch_y_low_m: -0.04, patch_y_high_m: 0.04'
QUICK = ('--places', '2', '--most-places', '2', '--distance', '0.03', '--speed', '0.04', '0.05', '--bound', '0.1')
DEADLINE_S = 60.0
PLATE = ('--force', '1.5', '--distance', '0.12')


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp('collect')


@pytest.fixture(scope='module')
def operator(folder):
    params = folder / 'patient.yaml'
    params.write_text(f'/**: {{ros__parameters: {{{PATIENT}, {PATCH}}}}}')
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_LOG_DIR': str(folder)}
    given = {'devices': folder, 'scene': 'varying', 'surface': 'cork', 'recipe': 'default', 'explorer_params': params}
    before = os.environ.get('ROS_DOMAIN_ID')
    os.environ['ROS_DOMAIN_ID'] = str(DOMAIN)  # of the recorder and the commands
    with (
        ChildLauncher('emulator', given, environment, folder / 'nodes.log') as launcher,
        Operator('', DOMAIN, launcher.check) as operator,
    ):
        operator.wait_for_explorer(DEADLINE_S)
        operator.wait_for_signal(DEADLINE_S)
        yield operator
    if before is None:
        del os.environ['ROS_DOMAIN_ID']
    else:
        os.environ['ROS_DOMAIN_ID'] = before


def test_a_surface_is_collected_at_places_that_training_can_leave_out(operator, folder, capsys):
    bags = folder / 'bags'
    assert main(['collect', 'cork', str(bags), *QUICK]) == 0
    assert 'no other surface' in capsys.readouterr().out
    dataset = SlideDataset.from_bags([bags])
    assert len(dataset) >= 2
    assert len(set(dataset.condition('place'))) == len(dataset)
    touched = [next(one for one in slide.sliding) for slide in dataset]
    assert all(abs(one.x_m) < 0.05 and abs(one.y_m) < 0.04 for one in touched)

    operator.set_parameters('emulator', {'surface': 'sandpaper_240'})
    assert main(['collect', 'sandpaper', str(bags), *QUICK]) in (0, 1)
    assert 'left-out places correct' in capsys.readouterr().out
    train_from_bags('default', sorted(bags.iterdir()), out=folder / 'two')

    operator.set_parameters('explorer', {'patch_x_high_m': -0.05})
    assert main(['collect', 'suede', str(bags), *QUICK]) == 2
    assert 'no surface patch is set: touch the corners' in capsys.readouterr().err
    operator.set_parameters('explorer', {'patch_x_high_m': 0.05})


def test_a_stop_between_two_slides_ends_the_series(operator, folder):
    request = ExplorationRequest('linear_slide', distance_m=0.03)
    stopped = operator.watch_stops()
    assert operator.explore(request, stopped=stopped).success
    with Operator('', DOMAIN) as other:
        assert other.stop()[0]
    with pytest.raises(MotionRefused) as refused:
        operator.explore(request, stopped=stopped)
    assert refused.value.error is ExplorationError.STOPPED
    assert operator.explore(request, stopped=operator.watch_stops()).success  # of another series


def test_the_finger_is_checked_by_a_slide_over_the_plate(operator, folder, capsys):
    model = str(folder / 'two')
    operator.set_parameters('explorer', {'min_force_n': 1.2})  # above the default of the motion
    assert main(['check', model, '--store', *PLATE]) == 0
    assert 'is stored as the reference of the finger' in capsys.readouterr().out
    assert main(['check', model]) == 0  # repeats the slide that was stored
    # A short approach leaves noise and drift unmeasured.
    assert re.search(r'(the finger is|gain and response are) as trained', capsys.readouterr().out)
