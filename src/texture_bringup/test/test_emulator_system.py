# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The emulator and the page of the operator as a user starts them, in a namespace and a ROS domain of their own."""

import asyncio
import json
import os
import re
import signal
import socket
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from fnmatch import fnmatch
from pathlib import Path
from xml.etree import ElementTree

import aiohttp
import pytest

from texture_bringup.launcher import ChildLauncher
from texture_core import config as resources
from texture_core.errors import InvalidParameter, LaunchFailed
from texture_core.types import ExplorationRequest, Rejection
from texture_evaluation.train import train_from_bags, train_grades_from_bags

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

DOMAIN = 61
DEADLINE_S = 60.0
NODES = {'emulator', 'sensor', 'explorer', 'feature_extractor', 'classifier', 'dashboard'}
NODES |= {'roughness_features', 'roughness_estimator'}
SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.05, surface='ridge_2mm_deep')
STARTED = re.compile(r'\[launch\] (\S+) started \(process (\d+)\)')


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp('emulator')


def processes(launcher: ChildLauncher) -> dict[str, int]:
    """Return the process of each node, by its name."""
    return {name: int(number) for name, number in STARTED.findall(launcher.log.read_text())}


def is_running(pid: int) -> bool:
    return Path(f'/proc/{pid}').exists()


@pytest.fixture(scope='module')
def bags(two_surfaces):
    return sorted((two_surfaces / 'bags').iterdir())


@pytest.fixture(scope='module')
def roughness_model(folder, bags):
    grades = folder / 'grades.csv'
    grades.write_text('texture,grade\nglass,1\nridge_2mm_deep,5\n', encoding='utf-8')
    train_grades_from_bags('roughness', bags, grades, out=folder / 'rough')
    return folder / 'rough.json'


@pytest.fixture(scope='module')
def port():
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


@pytest.fixture(scope='module')
def emulator(launched, folder, roughness_model, port):
    given = {'namespace': 'left', 'surface': 'ridge_2mm_deep', 'roughness_model': roughness_model}
    given |= {'dashboard': 'true', 'dashboard_port': port}
    with launched('emulator', DOMAIN, folder, **given) as launcher:
        yield launcher


@pytest.fixture(scope='module')
def operator(emulator):
    return emulator.operator('left', listened=('exploration', 'features', 'roughness_features'))


@pytest.fixture(scope='module')
def models(folder, bags, two_surfaces):
    """Return the paths of a model on the vibration alone and of one with the taxels, both of simulated slides."""
    train_from_bags('vibration-and-taxels', bags, out=folder / 'taxels')
    return {'vibration': two_surfaces / 'model.npz', 'taxels': folder / 'taxels.npz'}


def test_the_security_policy_allows_all_that_the_nodes_use_and_nothing_moves_when_stopped(operator) -> None:
    policy = ElementTree.parse(resources.folder('texture_bringup', 'config/sros2') / 'policy.xml')
    allowed = {item.text for kind in ('topic', 'service') for item in policy.iter(kind)}
    allowed |= {f'{action.text}/_action/*' for action in policy.iter('action')}
    node = operator._node
    used = {name for name, _ in (*node.get_topic_names_and_types(), *node.get_service_names_and_types())}
    names = {name.removeprefix('/left') for name in used}
    assert {'/signal', '/explore', '/explore/_action/send_goal', '/roughness_features'} <= names
    assert [name for name in names if not any(fnmatch(name, pattern) for pattern in allowed)] == []
    assert operator.stop() == (True, 'no exploration is running; earlier requests are cancelled')
    operators = policy.find("enclaves/enclave[@path='/tactile_texture/operator']")
    called = {item.text for item in operators.iter('service')}
    # What `texture activate` calls.
    assert {f'/{one}/{name}_state' for one in ('sensor', 'explorer') for name in ('get', 'change')} <= called


def test_without_a_model_an_exploration_ends_well_says_what_is_missing_and_is_graded(operator) -> None:
    seen = []
    explored = operator.explore(SLIDE, lambda state, _texture: seen.append(state.phase.value))
    assert explored.success, explored.message
    assert 'slide' in seen
    assert explored.texture.final
    assert 'model' in explored.texture.message
    roughness = explored.roughness
    assert (roughness.valid, roughness.final, roughness.model) == (True, True, 'rough')
    assert roughness.grade > 3.0
    assert roughness.grade_std > 0.0


def test_a_model_of_simulated_slides_recognises_the_surface_of_the_emulator(operator, models) -> None:
    operator.set_parameters('classifier', {'model': str(models['vibration'])})
    explored = operator.explore(SLIDE)
    assert (explored.texture.label, explored.texture.final) == ('ridge_2mm_deep', True)
    assert explored.texture.confidence == pytest.approx(0.05 ** (1 / 8))  # no more is shown by 8 slides
    assert explored.texture.rejection is Rejection.TOO_LITTLE_TRAINING
    assert '8 slides could be held out' in explored.texture.message


# Slow enough that there is time to press stop on a busy machine.
LONG = {'motion': 'linear_slide', 'speed_m_s': 0.005, 'force_n': 1.0, 'distance_m': 0.15}
SHORT = {'motion': 'linear_slide', 'speed_m_s': 0.05, 'force_n': 1.0, 'distance_m': 0.08}


class Wire:
    """The requests that the page sends, and the frames that it gets."""

    def __init__(self, address):
        self._address, self.answers = address, {}
        self.until(lambda frame: {light['name'] for light in frame['lights'] if light['colour'] == 'green'} == NODES)

    def post(self, name, body):
        request = urllib.request.Request(
            f'{self._address}api/{name}', json.dumps(body).encode(), {'Content-Type': 'application/json'}
        )
        try:
            answer = urllib.request.urlopen(request, timeout=DEADLINE_S)
        except urllib.error.HTTPError as refused:
            answer = refused
        with answer:
            self.answers[name] = json.load(answer)
            return self.answers[name]['message']

    def until(self, condition):
        newest = None

        async def watch():
            nonlocal newest
            async with aiohttp.ClientSession() as session, session.ws_connect(f'{self._address}ws') as frames:
                async for frame in frames:
                    newest = json.loads(frame.data)
                    if 'lights' in newest and condition(newest):  # the first message names the dashboard
                        return

        try:
            asyncio.run(asyncio.wait_for(watch(), DEADLINE_S))
        except TimeoutError:
            pytest.fail(f'the deadline passed; the newest frame: {newest}')


def test_an_operator_explores_sees_the_estimate_tares_and_stops_the_next_exploration(operator, port) -> None:
    page = Wire(f'http://127.0.0.1:{port}/')
    # A busy machine delays the emulated arm, and the explorer aborts: once more, as an operator would.
    said = next((said for _ in range(3) if 'completed' in (said := page.post('explore', SHORT))), '')
    assert said
    page.until(lambda frame: frame['texture']['final'] and frame['texture']['label'] == 'ridge_2mm_deep')
    # Too few samples come while the machine is busy; the operator is told so, and presses again.
    assert any(page.post('tare', {}).endswith(' tared') for _ in range(5))
    with ThreadPoolExecutor() as pool:
        aborted = pool.submit(page.post, 'explore', LONG)
        page.until(lambda frame: frame['state']['phase'] == 'slide')
        assert 'lifted' in page.post('stop', {})
        assert 'stopped on request' in aborted.result(DEADLINE_S)
        assert page.answers['explore']['stopped']  # which is no fault: the finger is lifted
        # Before the explorer has the request.
        stopped = pool.submit(page.post, 'explore', LONG)
        page.until(lambda _frame: 'what this page requested is cancelled' in page.post('stop', {}))
        assert re.search('stopped|cancelled', stopped.result(DEADLINE_S))
    page.until(lambda frame: ' aborted ' in frame['past'][0]['text'])


def test_the_sample_can_be_swapped_and_an_unknown_one_gets_the_nearest(operator, models) -> None:
    operator.set_parameters('classifier', {'model': str(models['vibration'])})
    operator.set_parameters('emulator', {'surface': 'glass'})
    assert operator.explore(SLIDE).texture.label == 'glass'
    with pytest.raises(InvalidParameter, match="did you mean 'leather'"):
        operator.set_parameters('emulator', {'surface': 'lether'})


def test_a_model_of_another_recipe_is_not_used_and_the_estimate_says_so(operator, models) -> None:
    operator.set_parameters('classifier', {'model': str(models['taxels'])})
    estimate = operator.explore(SLIDE).texture
    assert estimate.label == ''
    assert 'signal_static' in estimate.message
    with pytest.raises(InvalidParameter, match='nowhere'):
        operator.set_parameters('classifier', {'model': '/nowhere'})


def test_the_death_of_a_node_is_noticed_with_its_name_and_nothing_is_left(operator, emulator) -> None:
    pids = processes(emulator)
    assert set(pids) == {f'left/{name}' for name in NODES}
    os.kill(pids['left/classifier'], signal.SIGKILL)
    with pytest.raises(LaunchFailed, match='the launch ended because left/classifier was killed by SIGKILL'):
        for _ in range(1000):
            operator.wait_for_signal(DEADLINE_S)
    assert not any(is_running(pid) for pid in pids.values())
