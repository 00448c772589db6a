# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import asyncio
import json
import re
import socket
import threading
import time
from pathlib import Path

import pytest
from aiohttp import ClientSession, WSMsgType
from aiohttp.test_utils import TestClient, TestServer

from texture_bringup import dashboard
from texture_bringup.dashboard import BUTTONS, MAX_BODY_BYTES, VIEWERS, Access, Guesses, Recorder, Serving, make_app
from texture_bringup.feed import Feed
from texture_bringup.launcher import ChildLauncher
from texture_core.errors import InvalidParameter, LaunchFailed, MotionRefused

PAGE = Path(__file__).parents[1] / 'config' / 'dashboard'
TOKEN = 'a-secret-of-24-characters'
DEADLINE_S = 10.0
POST = b'POST /api/stop HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n'


class Nodes:
    """What the page's buttons reach, without nodes."""

    identity = 'namespace /<a>, ROS domain 1, user 0 of robot'

    def __init__(self):
        self.asked = []

    async def explore(self, asked):
        raise MotionRefused('speed_m_s is 9; allowed is 0.002 to 0.25 m/s')

    async def stop(self, asked):
        self.asked.append(asked)
        return {'success': True, 'message': 'nothing is moving'}

    add = record = tare = recover = check = collect = stop

    async def offered(self):
        return {'linear_slide': []}


def with_client(story, access=Access('127.0.0.1')):  # noqa: B008
    """Run a story against a server of its own."""

    async def run():
        nodes = Nodes()
        async with TestClient(TestServer(make_app(nodes, access, PAGE))) as client:
            return await asyncio.wait_for(story(client, nodes), DEADLINE_S)

    return asyncio.run(run())


async def post(client, name='stop', body='{}', **headers):
    headers = {'Content-Type': 'application/json', **headers}
    answer = await client.post(f'/api/{name}', data=body, headers=headers)
    return answer.status, await answer.text()


@pytest.mark.parametrize(
    ('path', 'kind'), [('/', 'text/html'), ('/dashboard.js', 'text/javascript'), ('/dashboard.css', 'text/css')]
)
def test_the_page_is_served_and_may_load_nothing_from_elsewhere(path, kind) -> None:
    async def story(client, _nodes):
        answer = await client.get(path)
        assert (answer.status, answer.content_type) == (200, kind)
        assert answer.headers['Content-Security-Policy'].startswith("default-src 'none'")
        assert not re.search(r'https?://|//\w+\.\w', (await answer.text()).replace("https:'", ''))

    with_client(story)


def test_the_page_asks_for_what_the_server_offers_and_for_all_of_it() -> None:
    asked = re.findall(r"ask\('(\w+)'", (PAGE / 'dashboard.js').read_text())
    asked += re.findall(r'data-ask="(\w+)"', (PAGE / 'index.html').read_text())
    assert set(asked) == set(BUTTONS)


def test_the_page_shows_at_once_what_each_button_does() -> None:
    script = (PAGE / 'dashboard.js').read_text()
    [table] = re.findall(r'^const DOING = {\n(.*?)^};', script, re.MULTILINE | re.DOTALL)
    assert set(re.findall(r"^  (\w+): '\w.* …',$", table, re.MULTILINE)) == set(BUTTONS)
    [asking] = re.findall(r'^async function ask\(.*?^}', script, re.MULTILINE | re.DOTALL)
    assert asking.index('DOING[name]') < asking.index('await fetch')


@pytest.mark.parametrize('path', ['/none', '/../package.xml', '/%2e%2e/package.xml', '/api/explore'])
def test_an_unknown_path_is_not_found(path) -> None:
    async def story(client, _nodes):
        answer = await client.get(path)
        assert answer.status in (404, 405)
        assert 'Content-Security-Policy' in answer.headers

    with_client(story)


def test_a_command_is_passed_on_and_a_refusal_is_reported() -> None:
    async def story(client, nodes):
        assert (await post(client, body='{"on": true}'))[0] == 200
        assert (await post(client, body='{}', **{'Content-Type': 'application/json; charset=none'}))[0] == 200
        assert nodes.asked == [{'on': True}, {}]
        status, text = await post(client, 'explore')
        assert (status, json.loads(text)['success']) == (409, False)
        assert 'allowed is 0.002' in text
        assert json.loads(await (await client.get('/api/motions')).text()) == {'linear_slide': []}

    with_client(story)


@pytest.mark.parametrize(
    ('body', 'headers', 'status'),
    [
        ('x' * (MAX_BODY_BYTES + 1), {}, 413),
        ('{', {}, 400),
        ('[]', {}, 400),
        (r'{"label": "\ud800"}', {}, 400),
        ('{}', {'Content-Type': 'text/plain'}, 415),
        ('{}', {'Origin': 'http://evil.example'}, 403),
        ('{}', {'Origin': 'null'}, 403),
        ('{}', {'Origin': 'http://['}, 403),
        ('{}', {'Host': 'evil.example'}, 403),
        ('{}', {'Host': '192.0.2.1:8085'}, 403),
        ('{}', {'Host': '['}, 403),
    ],
)
def test_a_request_that_is_too_large_broken_or_of_another_page_is_refused_and_reaches_no_node(
    body, headers, status
) -> None:
    async def story(client, nodes):
        assert (await post(client, body=body, **headers))[0] == status
        assert nodes.asked == []

    with_client(story)


def test_a_page_knows_its_dashboard_and_another_one_takes_no_command_from_it() -> None:
    async def story(client, nodes):
        assert (
            'data-dashboard="namespace /&lt;a&gt;, ROS domain 1, user 0 of robot"'
            in await (await client.get('/')).text()
        )
        other = await client.post('/api/stop', params={'dashboard': 'namespace /b'}, json={})
        sentence = f'this address now belongs to another dashboard ({Nodes.identity}): reload the page'
        assert (other.status, (await other.json())['message'], nodes.asked) == (409, sentence, [])
        ours = await client.post('/api/stop', params={'dashboard': Nodes.identity}, json={})
        assert (ours.status, nodes.asked) == (200, [{}])

    with_client(story)


def test_each_start_of_a_dashboard_has_another_run_identifier() -> None:
    runs = []

    async def story(client, _nodes):
        for _ in range(2):
            async with client.ws_connect('/ws') as page:
                runs.append((await page.receive_json())['run'])

    with_client(story)
    with_client(story)
    assert runs[0] == runs[1] != runs[2] == runs[3]


def test_the_web_socket_sends_the_newest_frame_and_is_closed_to_other_pages() -> None:
    async def story(client, _nodes):
        async with client.ws_connect('/ws') as page:
            assert (await page.receive_json())['dashboard'] == Nodes.identity
            client.app[VIEWERS].show('{"number": 1}')
            assert await page.receive_json() == {'number': 1}
        answer = await client.get('/ws', headers={'Origin': 'http://evil.example', 'Upgrade': 'websocket'})
        assert answer.status == 403

    with_client(story)


def test_a_page_that_does_not_read_misses_frames_and_keeps_nobody_waiting() -> None:
    async def story(client, _nodes):
        async with client.ws_connect('/ws') as slow, client.ws_connect('/ws') as quick:
            for number in range(200):
                client.app[VIEWERS].show(json.dumps({'number': number, 'rest': 'x' * 100_000}))
                await asyncio.sleep(0)
            while (await quick.receive_json()).get('number', 0) < 199:
                pass
            assert not slow.closed

    with_client(story)


def test_beyond_loopback_the_token_is_needed_once_and_then_a_cookie_carries_it() -> None:
    async def story(client, nodes):
        assert (await client.get('/')).status == 401
        assert (await client.get('/ws')).status == 401
        assert (await client.get('/', params={'token': 'wrong' * 6})).status == 401
        assert (await client.get('/', params={'token': 'ä'})).status == 401
        assert (await post(client))[0] == 401
        answer = await client.get('/', params={'token': TOKEN}, allow_redirects=False)
        assert (answer.status, answer.headers['Location']) == (303, '/')
        assert 'HttpOnly' in answer.headers['Set-Cookie']
        assert 'SameSite=Strict' in answer.headers['Set-Cookie']
        assert nodes.asked == []
        assert (await post(client, Authorization=f'Bearer {TOKEN}'))[0] == 200
        assert (await post(client, Cookie=f'texture_token={TOKEN}'))[0] == 200

    with_client(story, Access('0.0.0.0', TOKEN, ('robot',)))


def test_the_address_of_the_page_carries_the_token_where_one_is_needed(monkeypatch) -> None:
    monkeypatch.setenv('TEXTURE_DASHBOARD_TOKEN', '')
    assert Access.to_this_machine('127.0.0.1').url(8085) == 'http://127.0.0.1:8085/'
    assert Access.to_this_machine('::1').url(8085) == 'http://[::1]:8085/'
    access = Access.to_this_machine('0.0.0.0')
    assert access.url(8085).endswith(f':8085/?token={access.token}')
    assert access.is_our_host(socket.gethostname())
    monkeypatch.setenv('TEXTURE_DASHBOARD_TOKEN', TOKEN)
    assert Access.to_this_machine('0.0.0.0').token == TOKEN


@pytest.mark.parametrize('token', ['', 'short'])
def test_beyond_loopback_there_is_no_page_without_a_good_token(token) -> None:
    with pytest.raises(InvalidParameter, match='at least 16'):
        Access('0.0.0.0', token)


def test_an_address_that_sends_wrong_tokens_waits_longer_after_each_and_one_and_the_same_counts_once() -> None:
    now = [0.0]
    guesses = Guesses(lambda: now[0])
    for number in range(9):
        for _ in range(100):  # an open page asks with the token of yesterday
            guesses.note('a', f'guess {number}')
    assert guesses.wait_s('a') == 16.0
    assert guesses.wait_s('b') == 0.0
    now[0] = 16.0
    assert guesses.wait_s('a') == 0.0
    for number in range(2000):
        guesses.note('a', f'another {number}')
    assert guesses.wait_s('a') == 300.0


@pytest.mark.parametrize('address', ['/', '/?token=always', '/api/motions?token=always'])
def test_many_guesses_at_once_are_not_checked_nor_what_follows(address) -> None:
    async def story(client, nodes):
        async def guess(number):
            return (await client.get(address, headers={'Authorization': f'Bearer {number}'})).status

        statuses = await asyncio.gather(*(guess(number) for number in range(200)))
        assert (statuses.count(401), statuses.count(429)) == (6, 194)
        status, text = await post(client, Authorization=f'Bearer {TOKEN}')
        assert (status, nodes.asked) == (429, [])
        assert 'too many wrong tokens came from 127.0.0.1; the next is checked in 2 s' in text

    with_client(story, Access('0.0.0.0', TOKEN, ('robot',)))


def answered(access: Access, sent: bytes) -> bytes:
    """Return all that a server answers to these bytes until it closes the connection."""
    serving = Serving(make_app(Nodes(), access, PAGE), '127.0.0.1', 0)
    try:
        with socket.create_connection(('127.0.0.1', serving.port), timeout=DEADLINE_S) as line:
            line.sendall(sent)
            return b''.join(iter(lambda: line.recv(4096), b''))
    finally:
        serving.close()


@pytest.mark.parametrize(
    ('sent', 'answer'),
    [
        (b'', b''),
        (b'GET / HTTP/1.1\r\nHost: localho', b''),
        (b'GET / HTTP/1.1\r\nHost: localhost\r\n\r\nGET / HT', b'HTTP/1.1 200 OK'),
        (POST + b'Content-Length: 9\r\n\r\n{"on"', b'HTTP/1.1 408 Request Timeout'),
    ],
    ids=['nothing', 'half a head', 'half a second request', 'half a body'],
)
def test_a_connection_whose_request_does_not_come_to_its_end_is_closed(sent, answer, monkeypatch) -> None:
    monkeypatch.setattr(dashboard, 'REQUEST_S', 0.2)
    monkeypatch.setattr(dashboard, 'LOOK_S', 0.05)
    received = answered(Access('127.0.0.1'), sent)
    assert received.partition(b'\r\n')[0] == answer


def test_a_token_that_is_no_text_is_a_wrong_one_and_is_counted() -> None:
    asked = b''.join(b'GET / HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer \xff%d\r\n' % i for i in range(7))
    asked = asked.replace(b'GET', b'\r\nGET').removeprefix(b'\r\n') + b'Connection: close\r\n\r\n'
    answers = answered(Access('0.0.0.0', TOKEN, ('robot',)), asked)
    assert re.findall(rb'HTTP/1.1 (\d+)', answers) == [b'401'] * 6 + [b'429']


def test_a_port_in_use_is_reported_and_nothing_is_left_running() -> None:
    first = Serving(make_app(Nodes(), Access('127.0.0.1'), PAGE), '127.0.0.1', 0)
    try:
        with pytest.raises(LaunchFailed, match='choose another host or port'):
            Serving(make_app(Nodes(), Access('127.0.0.1'), PAGE), '127.0.0.1', first.port)
        first.show('{}')
    finally:
        first.close()


def test_the_server_ends_while_a_page_is_open() -> None:
    serving = Serving(make_app(Nodes(), Access('127.0.0.1'), PAGE), '127.0.0.1', 0)

    async def watch():
        async with ClientSession() as session, session.ws_connect(f'http://127.0.0.1:{serving.port}/ws') as page:
            assert (await page.receive_json())['run']
            serving.show('{}')
            assert await page.receive_json() == {}
            closing = asyncio.create_task(asyncio.to_thread(serving.close))
            assert (await page.receive()).type is WSMsgType.CLOSE
            await closing  # raises if the loop of the server still runs

    asyncio.run(asyncio.wait_for(watch(), DEADLINE_S))


def test_what_a_button_has_begun_is_over_when_the_server_is_closed() -> None:
    begun, over = threading.Event(), threading.Event()

    def work():
        begun.set()
        time.sleep(2.0)  # longer than requests are waited for
        over.set()
        return {'success': True, 'message': ''}

    class Slow(Nodes):
        async def explore(self, asked):
            return await asyncio.get_running_loop().run_in_executor(None, work)

    serving = Serving(make_app(Slow(), Access('127.0.0.1'), PAGE), '127.0.0.1', 0)
    with socket.create_connection(('127.0.0.1', serving.port), timeout=DEADLINE_S) as line:
        line.sendall(POST.replace(b'stop', b'explore') + b'Content-Length: 2\r\n\r\n{}')
        assert begun.wait(DEADLINE_S)
        serving.close()
    assert over.is_set()


def test_a_recording_that_was_killed_is_named_with_its_cause_until_the_next_begins(tmp_path, monkeypatch) -> None:
    class Killed(ChildLauncher):
        end = 'the recorder was killed by SIGKILL'

        def __enter__(self):
            return self

    monkeypatch.setattr(dashboard, 'ChildLauncher', Killed)
    recorder, feed = Recorder(tmp_path, '/'), Feed()
    recorder.begin('now')
    recorder.watch()
    feed.fault = recorder.fault
    ended = f"the recording to '{tmp_path}/now' has ended: the recorder was killed by SIGKILL; the output of all nodes"
    assert feed.frame(0.0)['fault'] == f'{ended} is in {tmp_path}/now.log'
    assert recorder.bag == ''
    recorder.begin('later')
    assert recorder.fault == ''


def test_what_cannot_be_recorded_is_reported_and_nothing_is_left_to_end(tmp_path) -> None:
    (tmp_path / 'file').touch()
    recorder = Recorder(tmp_path / 'file', '/')
    with pytest.raises(InvalidParameter, match='nothing can be recorded in'):
        recorder.begin('now')
    recorder.watch()
    assert (recorder.bag, recorder.end()) == ('', 'nothing is being recorded')
