# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The dashboard as an operator meets it: the emulator, and the requests and the WebSocket of the page."""

import asyncio
import json
import os
import socket
import time
import urllib.request
from concurrent.futures import ThreadPoolExecutor

import aiohttp
import pytest

pytestmark = [pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

from texture_bringup.launcher import ChildLauncher

DOMAIN = 90
DEADLINE_S = 90.0
NODES = {'emulator', 'sensor', 'explorer', 'feature_extractor', 'classifier', 'dashboard'}
SURFACES = ('glass', 'ridge_2mm_deep')
# Slow enough that there is time to press stop on a busy machine.
LONG = {'motion': 'linear_slide', 'speed_m_s': 0.005, 'force_n': 1.0, 'distance_m': 0.15}
SHORT = {'motion': 'linear_slide', 'speed_m_s': 0.05, 'force_n': 1.0, 'distance_m': 0.08}


class Wire:
    """The requests that the page sends, and the frames that it gets."""

    def __init__(self, address):
        self._address = address
        self.until(lambda frame: {light['name'] for light in frame['lights'] if light['colour'] == 'green'} == NODES)

    def post(self, name, body):
        request = urllib.request.Request(
            f'{self._address}api/{name}', json.dumps(body).encode(), {'Content-Type': 'application/json'}
        )
        with urllib.request.urlopen(request, timeout=DEADLINE_S) as answer:
            return json.load(answer)['message']

    def until(self, condition):
        newest = None

        async def watch():
            nonlocal newest
            async with aiohttp.ClientSession() as session, session.ws_connect(f'{self._address}ws') as frames:
                async for frame in frames:
                    newest = json.loads(frame.data)
                    if condition(newest):
                        return

        try:
            asyncio.run(asyncio.wait_for(watch(), DEADLINE_S))
        except TimeoutError:
            pytest.fail(f'the deadline passed; the newest frame: {newest}')


def free_tcp_port():
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp('dashboard')


@pytest.fixture(scope='module')
def address(folder, two_surfaces):
    """Return the address of the page of a bench that knows two surfaces."""
    port = free_tcp_port()
    given = {
        'devices': folder,
        'surface': SURFACES[1],
        'model': two_surfaces / 'model.npz',
    }
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_LOG_DIR': str(folder)}
    page = {'dashboard': 'true', 'dashboard_port': port}
    with ChildLauncher('emulator', {**given, **page}, environment, folder / 'nodes.log') as launcher:
        wait_for_page(f'http://127.0.0.1:{port}/', launcher)
        yield f'http://127.0.0.1:{port}/'


def wait_for_page(address, launcher):
    deadline = time.monotonic() + DEADLINE_S
    while True:
        launcher.check()
        try:
            urllib.request.urlopen(address, timeout=5.0).close()
        except OSError:
            assert time.monotonic() < deadline
            time.sleep(0.2)
        else:
            return


def test_an_operator_explores_sees_the_estimate_tares_and_stops_the_next_exploration(address) -> None:
    operator = Wire(address)
    # A busy machine delays the emulated arm, and the explorer aborts: once more, as an operator would.
    said = next((said for _ in range(3) if 'completed' in (said := operator.post('explore', SHORT))), '')
    assert said
    operator.until(lambda frame: frame['texture']['final'] and frame['texture']['label'] in SURFACES)
    # Too few samples come while the machine is busy; the operator is told so, and presses again.
    assert any(operator.post('tare', {}).endswith(' tared') for _ in range(5))
    with ThreadPoolExecutor() as pool:
        aborted = pool.submit(operator.post, 'explore', LONG)
        operator.until(lambda frame: frame['state']['phase'] == 'slide')
        assert 'lifted' in operator.post('stop', {})
        assert 'stopped on request' in aborted.result(DEADLINE_S)
    operator.until(lambda frame: frame['past'][0]['phase'] == 'aborted')
