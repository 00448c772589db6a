"""Show what the nodes publish on a web page, and pass on what its buttons ask for."""

from __future__ import annotations

import asyncio
import os
import secrets
import socket
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from std_srvs.srv import Trigger
from texture_msgs import action, msg, srv

from texture_bringup.dashboard.access import Access, is_loopback
from texture_bringup.dashboard.feed import FRAME_PERIOD_S, Feed
from texture_bringup.dashboard.motions import offered
from texture_bringup.dashboard.server import make_app
from texture_bringup.dashboard.serving import Serving
from texture_bringup.launcher.child import ChildLauncher
from texture_core.errors import InvalidData, InvalidParameter, LaunchFailed, MotionAborted
from texture_core.exploration import ExplorationRequest
from texture_core.parameters import from_mapping, param
from texture_core.resources import folder
from texture_core.ros.conversions import from_msg, request_to_msg
from texture_core.ros.diagnostics import LEVELS, Diagnostics, Report
from texture_core.ros.parameters import declare
from texture_core.ros.qos import ESTIMATE_QOS, SENSOR_QOS, STATE_QOS
from texture_core.ros.run import run
from texture_exploration.safety import SafetyLimits

TOKEN_VARIABLE = 'TEXTURE_DASHBOARD_TOKEN'
ANSWER_DEADLINE_S = 30.0
ASKED_AGAIN_S = 2.0
FOUND_DEADLINE_S, FOUND_STEP_S = 5.0, 0.05
GONE_S = 10.0  # so long the explorer may be away before an exploration is given up
MOST_CHARACTERS = 200
LEVEL_NAMES = {value: name for name, value in LEVELS.items()}


@dataclass(frozen=True)
class DashboardParams:
    """Where the page is, and where recordings go."""

    host: str = param('127.0.0.1', 'Address to listen on; beyond loopback the page needs its token.')
    port: int = param(8085, 'Port to listen on; 0: any that is free.', low=0, high=65535)
    recordings: str = param('recordings', 'Folder in which the button `record` makes new bags.')


class Dashboard(Node):
    """Serve the page: subscriptions fill the feed, a timer shows its frame, commands become calls."""

    def __init__(self) -> None:
        super().__init__('dashboard')
        params = declare(self, DashboardParams)
        self._feed = Feed()
        self._bad = 0
        self._recordings = Path(params.recordings).expanduser()
        self._recorder: ChildLauncher | None = None
        self._trouble = ''
        self._make_clients()
        access = Access(params.host, _token(params.host), _names(params.host))
        self._serving = Serving(
            make_app(self, access, folder('texture_bringup', 'config/dashboard')), params.host, params.port
        )
        self._subscribe()
        self.create_timer(FRAME_PERIOD_S, self._show)
        Diagnostics(self, self._report)
        _announce(params.host, self._serving.port, access.token)

    def shutdown(self) -> None:
        """Complete a recording, and close the page."""
        self._end_recording()  # first: the recorder ends with the thread of the server that started it
        self._serving.close()

    # What the page asks for: coroutines of the web server's thread.

    async def explore(self, asked: Mapping[str, Any]) -> Mapping[str, Any]:
        """Explore until it is over."""
        if 'motion' not in asked:
            raise InvalidParameter('no motion is asked for; give its name as `motion`')
        request = from_mapping(ExplorationRequest, {name: _short(value) for name, value in asked.items()})
        await _ready(self._explorer.server_is_ready, 'explorer')
        goal = await _answer(self._explorer.send_goal_async(request_to_msg(request)), ANSWER_DEADLINE_S)
        ending = goal.get_result_async()
        seen_s = time.monotonic()
        while time.monotonic() - seen_s < GONE_S:
            try:
                result = (await _answer(ending, ASKED_AGAIN_S)).result
            except LaunchFailed:
                seen_s = time.monotonic() if self._explorer.server_is_ready() else seen_s
                continue
            return {'success': result.success, 'message': result.message, 'id': result.exploration_id}
        raise MotionAborted('the explorer has vanished; look at its output')

    async def stop(self, _asked: Mapping[str, Any]) -> Mapping[str, Any]:
        """Stop what moves."""
        return await self._ask(self._stop, Trigger.Request(), 'explorer')

    async def learn(self, asked: Mapping[str, Any]) -> Mapping[str, Any]:
        """Teach an exploration, the last one if it has no id, or undo the last lesson."""
        if asked.get('undo'):
            return await self._ask(self._undo, Trigger.Request(), 'classifier')
        label, exploration = (_short(str(asked.get(name, ''))).strip() for name in ('label', 'id'))
        if not label:
            raise InvalidParameter('the texture to learn has no name; give one')
        request = srv.LearnTexture.Request(label=label, exploration_id=exploration)
        return await self._ask(self._learn, request, 'classifier')

    async def record(self, asked: Mapping[str, Any]) -> Mapping[str, Any]:
        """Begin or end a recording; where it goes is not the page's choice."""
        work = self._begin_recording if asked.get('on') else self._end_recording
        message = await asyncio.get_running_loop().run_in_executor(None, work)
        return {'success': True, 'message': message}

    async def offered(self) -> Mapping[str, Any]:
        """Return the motions with their numbers, within the limits of the running explorer."""
        names = [item.name for item in fields(SafetyLimits)]
        if not self._limits.services_are_ready():
            return offered(SafetyLimits())
        try:
            answer = await _answer(self._limits.get_parameters(names), ASKED_AGAIN_S)
        except LaunchFailed:
            return offered(SafetyLimits())
        values = {name: value.double_value for name, value in zip(names, answer.values, strict=True)}
        return offered(SafetyLimits(**values))

    def replay(self, exploration_id: str) -> str | None:
        """Return the kept frames of an exploration."""
        return self._feed.history.replay(exploration_id)

    # ROS

    def _make_clients(self) -> None:
        self._explorer = ActionClient(self, action.Explore, 'explore')
        self._stop = self.create_client(Trigger, 'stop')
        self._learn = self.create_client(srv.LearnTexture, 'learn')
        self._undo = self.create_client(Trigger, 'undo_learning')
        self._limits = AsyncParameterClient(self, 'explorer')

    def _subscribe(self) -> None:
        feed = self._feed
        for kind, topic, take, qos in (
            (msg.TactileSignal, 'signal', feed.on_signal, SENSOR_QOS),
            (msg.TactileSignal, 'signal_static', feed.on_static, SENSOR_QOS),
            (msg.ExplorationState, 'exploration', feed.on_state, STATE_QOS),
            (msg.TextureEstimate, 'texture', feed.on_texture, ESTIMATE_QOS),
            (msg.RoughnessEstimate, 'roughness', feed.on_roughness, ESTIMATE_QOS),
        ):
            self.create_subscription(kind, topic, partial(self._on_message, take), qos)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)

    def _on_message(self, take: Any, message: Any) -> None:
        try:
            take(from_msg(message))
        except InvalidData as error:
            self._bad += 1
            self.get_logger().warning(f'left out: {error}', throttle_duration_sec=10.0)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        ours = self.get_namespace().rstrip('/') + '/'
        for status in message.status:
            if status.name.startswith(ours):
                level = LEVEL_NAMES.get(status.level, 'ERROR')
                self._feed.lights.update(status.name.removeprefix(ours), level, status.message, time.monotonic())

    def _show(self) -> None:
        self._watch_recorder()
        self._serving.show(self._feed.frame(time.monotonic()))

    def _report(self) -> Report:
        level = 'WARN' if self._trouble or self._bad else 'OK'
        return level, self._trouble or 'the page is served', {'bad_messages': self._bad}

    async def _ask(self, client: Any, request: Any, node: str) -> Mapping[str, Any]:
        await _ready(client.service_is_ready, node)
        answer = await _answer(client.call_async(request), ANSWER_DEADLINE_S)
        return {'success': answer.success, 'message': answer.message}

    def _begin_recording(self) -> str:
        if self._recorder is not None:
            raise InvalidParameter(f"'{self._feed.recording}' is being recorded already; end that first")
        name = datetime.now().strftime('%Y-%m-%d_%H-%M-%S')
        try:
            self._recordings.mkdir(parents=True, exist_ok=True)
            arguments = {'out': self._recordings / name, 'namespace': self.get_namespace().strip('/')}
            recorder = ChildLauncher('record', arguments, os.environ, self._recordings / f'{name}.log')
            self._recorder = recorder.__enter__()
        except OSError as error:
            raise InvalidParameter(f"nothing can be recorded in '{self._recordings}': {error.strerror}") from error
        self._trouble = ''
        self._feed.recording = str(self._recordings / name)
        return f"recording to '{self._feed.recording}'"

    def _end_recording(self) -> str:
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            return 'nothing is being recorded'
        recorder.stop()
        bag, self._feed.recording = self._feed.recording, ''
        return f"'{bag}' is complete"

    def _watch_recorder(self) -> None:
        recorder = self._recorder
        if recorder is None:
            return
        try:
            recorder.check()
        except LaunchFailed as error:
            self._recorder, self._feed.recording, self._trouble = None, '', str(error)


async def _ready(is_ready: Callable[[], bool], node: str) -> None:
    """Wait until a node can be asked: one that has just started is found a moment later.

    Raises
    ------
    LaunchFailed
        If it is not there in time.
    """
    deadline_s = time.monotonic() + FOUND_DEADLINE_S
    while not is_ready():
        if time.monotonic() > deadline_s:
            raise LaunchFailed(f'no {node} answers; is it running?')
        await asyncio.sleep(FOUND_STEP_S)


async def _answer(future: Future, deadline_s: float) -> Any:
    """Return the result of a future of ROS, which the executor's thread completes.

    Raises
    ------
    LaunchFailed
        If it does not come in time.
    """
    loop = asyncio.get_running_loop()
    answered: asyncio.Event = asyncio.Event()
    future.add_done_callback(lambda _future: loop.call_soon_threadsafe(answered.set))
    try:
        await asyncio.wait_for(answered.wait(), deadline_s)
    except asyncio.TimeoutError as error:
        raise LaunchFailed(f'no answer within {deadline_s:.0f} s') from error
    return future.result()


def _short(value: Any) -> Any:
    if isinstance(value, str) and len(value) > MOST_CHARACTERS:
        raise InvalidParameter(f'a text has {len(value)} characters; allowed are {MOST_CHARACTERS}')
    return value


def _token(host: str) -> str:
    """Return the token of the environment, else a new one where one is needed."""
    return os.environ.get(TOKEN_VARIABLE, '') or ('' if is_loopback(host) else secrets.token_urlsafe(24))


def _names(host: str) -> tuple[str, ...]:
    """Return the names of this machine; none on loopback, where only 'localhost' is right."""
    if is_loopback(host):
        return ()
    name = socket.gethostname().lower()
    return (host.lower(), name, f'{name}.local')


def _announce(host: str, port: int, token: str) -> None:
    """Print the address; on the terminal alone, as a log would keep the token."""
    shown = {'0.0.0.0': socket.gethostname(), '::': socket.gethostname()}.get(host, host)
    shown = f'[{shown}]' if ':' in shown else shown
    print(f'dashboard: http://{shown}:{port}/' + (f'?token={token}' if token else ''), flush=True)


def main() -> None:
    """Run the node."""
    run(Dashboard)
