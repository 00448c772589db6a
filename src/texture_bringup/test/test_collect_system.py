# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The collector and `texture check` on the emulated rig, over a sample that varies."""

import os
import re
from dataclasses import asdict, replace

import pytest

pytestmark = [pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

from rclpy.action import ActionClient
from texture_msgs import action, msg, srv

from texture_bringup.command import main
from texture_bringup.launcher import ChildLauncher
from texture_bringup.nodes.collector import collect_surface
from texture_bringup.operator import Operator
from texture_core.errors import CollectionError
from texture_core.ros_testing import LocalGraph, filled
from texture_evaluation.collection import CollectionParams
from texture_evaluation.train import train_from_bags
from texture_recordings.dataset import SlideDataset

DOMAIN = 88
PATIENT = 'estimate_timeout_s: 1.0, signal_timeout_s: 3.0, state_timeout_s: 1.0'  # this machine may be busy
PATCH = 'patch_x_low_m: -0.05, patch_x_high_m: 0.05, patch_y_low_m: -0.04, patch_y_high_m: 0.04'
QUICK = CollectionParams(
    places=2, most_places=2, distance_m=0.03, speed_low_m_s=0.04, speed_high_m_s=0.05, bound=0.1
)  # fmt: skip
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


def test_a_surface_is_collected_at_places_that_training_can_leave_out(operator, folder):
    texts = []
    end, bag = collect_surface(operator, 'cork', folder / 'bags', QUICK, lambda text, slides: texts.append(text))
    assert end.error is CollectionError.NONE, end.message
    assert 'no other surface' in end.message
    dataset = SlideDataset.from_bags([bag])
    assert len(dataset) == end.slides >= 2
    assert len(set(dataset.condition('place'))) == len(dataset)
    touched = [next(one for one in slide.sliding) for slide in dataset]
    assert all(abs(one.x_m) < 0.05 and abs(one.y_m) < 0.04 for one in touched)

    operator.set_parameters('emulator', {'surface': 'sandpaper_240'})
    end, other = collect_surface(operator, 'sandpaper', folder / 'bags', QUICK, lambda text, slides: texts.append(text))
    assert 'left-out places correct' in end.message, end.message
    train_from_bags('default', [bag, other], out=folder / 'two')


@pytest.fixture
def collector(operator, folder):
    """Return the graph of a client of the collector, as its launch file starts it."""
    environment = {**os.environ, 'ROS_LOG_DIR': str(folder)}
    with (
        ChildLauncher('collector', {}, environment, folder / 'collector.log') as launcher,
        LocalGraph(DOMAIN, DEADLINE_S) as graph,
    ):
        graph.until(lambda: launcher.check() or graph.peer.count_services('collect'))
        yield graph


def request_of(params, surface, folder):
    return filled(msg.CollectionRequest(), {**asdict(params), 'surface': surface, 'folder': str(folder / 'bags')})


def test_a_cancelled_collection_keeps_its_slides_and_a_missing_patch_is_named(collector, operator, folder):
    request = request_of(replace(QUICK, places=3, most_places=9, bound=0.9), 'suede', folder)
    client, slides = ActionClient(collector.peer, action.Collect, 'collect'), []
    collector.until(client.server_is_ready)
    sent = client.send_goal_async(
        action.Collect.Goal(request=request), lambda message: slides.append(message.feedback.slides)
    )
    collector.until(lambda: slides)
    sent.result().cancel_goal_async()
    ended = sent.result().get_result_async()
    collector.until(ended.done)
    result = ended.result().result.result
    assert (result.error_code, slides[0]) == (CollectionError.CANCELLED, 3), result.message
    assert result.slides == len(SlideDataset.from_bags([result.bag])) >= 3

    operator.set_parameters('explorer', {'patch_x_high_m': -0.05})
    service = collector.peer.create_client(srv.Collect, 'collect')
    collector.until(service.service_is_ready)
    answer = service.call_async(srv.Collect.Request(request=request))
    collector.until(answer.done)
    assert answer.result().result.error_code == CollectionError.INVALID_REQUEST
    assert answer.result().result.message.startswith('no surface patch is taught: touch the corners')
    operator.set_parameters('explorer', {'patch_x_high_m': 0.05})


def test_the_finger_is_checked_by_a_slide_over_the_plate(operator, folder, capsys):
    model = str(folder / 'two')
    operator.set_parameters('explorer', {'min_force_n': 1.2})  # above the default of the motion
    assert main(['check', model, '--store', *PLATE]) == 0
    assert 'is stored as the reference of the finger' in capsys.readouterr().out
    assert main(['check', model]) == 0  # repeats the slide that was stored
    # A short approach leaves noise and drift unmeasured.
    assert re.search(r'(the finger is|gain and response are) as trained', capsys.readouterr().out)
