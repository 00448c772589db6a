# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Show what the nodes publish on a web page, and pass on what its buttons ask for."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from rclpy.node import Node
from std_srvs.srv import Trigger
from texture_msgs import msg

from texture_bringup.dashboard import Access, Recorder, Serving, make_app
from texture_bringup.feed import FRAME_PERIOD_S, Feed, number_text
from texture_bringup.operator import NOT_STOPPED, STOP_S, Operator, subscribe
from texture_core.config import folder, from_mapping, param
from texture_core.errors import ExplorationError, InvalidData, InvalidParameter, LaunchFailed, MotionRefused
from texture_core.ros import DiagnosticReport, Diagnostics, declare, quality_of_service, run
from texture_core.types import ExplorationRequest, checked_label
from texture_features.correction import read_reference

T = TypeVar('T')
EXPLORER_S, POLL_S = 5.0, 0.02
MAX_CHARACTERS = 200


@dataclass(frozen=True)
class DashboardParams:
    """Parameters of the web page and of its recordings."""

    host: str = param(
        '127.0.0.1',
        'Address to listen on; beyond loopback the page needs the token that is printed, or that of '
        'TEXTURE_DASHBOARD_TOKEN.',
    )
    port: int = param(8085, 'TCP port to listen on; 0 takes any free port.', low=0, high=65535)
    recordings: str = param('recordings', 'Folder in which the button `record` makes new bags.')


class DashboardNode(Node):
    """Serve the page: subscriptions fill the feed, a timer shows its frame, commands become calls."""

    def __init__(self) -> None:
        super().__init__('dashboard')
        params = declare(self, DashboardParams)
        self._feed = Feed()
        self._info = msg.ExplorerInfo()
        self._bad = 0
        self._closing = False
        self.identity = (
            f'namespace {self.get_namespace()}, ROS domain {self.context.get_domain_id()}, '
            f'user {os.getuid()} of {socket.gethostname()}'
        )
        self._recordings = Path(params.recordings).expanduser()
        self._command: asyncio.subprocess.Process | None = None
        self._moving: set[object] = set()  # what was asked for since the last stop, until it is over
        self._recorder = Recorder(self._recordings, self.get_namespace())
        self._stop = self.create_client(Trigger, 'explorer/stop')
        access = Access.to_this_machine(params.host)
        self._serving = Serving(
            make_app(self, access, folder('texture_bringup', 'config/dashboard')), params.host, params.port
        )
        subscribe(self, self._feed, self._on_bad)
        qos = quality_of_service('explorer_info')
        self.create_subscription(msg.ExplorerInfo, 'explorer_info', partial(setattr, self, '_info'), qos)
        self.create_timer(FRAME_PERIOD_S, self._show)
        Diagnostics(self, self._report)
        # On the terminal alone, as a log would keep the token.
        print(f'dashboard: {access.url(self._serving.port)}', flush=True)

    def shutdown(self) -> None:
        """Complete a recording, stop a sub-command, and close the page."""
        self._closing = True
        self._interrupt()
        self._recorder.end()  # first: the recorder ends with the thread of the server that started it
        self._serving.close()

    # What the page asks for: coroutines of the web server's thread.

    async def explore(self, asked: Mapping[str, Any]) -> Mapping[str, Any]:
        """Explore until it is over."""
        if 'motion' not in asked:
            raise InvalidParameter('no motion is requested; give its name as `motion`')
        request = from_mapping(ExplorationRequest, {name: _short(value) for name, value in asked.items()})
        self._check_free()

        def explore(operator: Operator) -> Mapping[str, Any]:
            operator.wait_for_explorer(EXPLORER_S)
            result = operator.explore(request, stopped=stopped)
            if not result.exploration_id:
                raise MotionRefused(result.message, result.error)
            stopped_well = result.lifted and result.error in (ExplorationError.STOPPED, ExplorationError.CANCELLED)
            return {'success': result.success, 'stopped': stopped_well, 'message': result.message}

        with self._until_stopped() as stopped:
            return await self._operate(explore)

    async def stop(self, _requested: Mapping[str, Any]) -> Mapping[str, Any]:
        """Stop what moves, by a client that exists all the time: here nothing is waited for that can be avoided."""
        cancelled = ''
        if self._moving:  # once: a second signal would end a command before it has ended in order
            cancelled = '; what this page requested is cancelled'
            self._moving.clear()
            self._interrupt()
        future, deadline_s = None, time.monotonic() + STOP_S
        while future is None or not future.done():
            if future is None and self._stop.service_is_ready():
                future = self._stop.call_async(Trigger.Request())
            if time.monotonic() > deadline_s:
                raise LaunchFailed(f'{NOT_STOPPED}{cancelled}')
            await asyncio.sleep(POLL_S)
        return {'success': future.result().success, 'message': f'{future.result().message}{cancelled}'}

    async def tare(self, _asked: Mapping[str, Any]) -> Mapping[str, Any]:
        """Take the present level of the sensor as that without load."""
        return await self._call(
            'sensor/tare', "start a driver of this suite; tare a mapped sensor by its vendor's driver"
        )

    async def recover(self, _asked: Mapping[str, Any]) -> Mapping[str, Any]:
        """Free the arm from a fault."""
        return await self._call('explorer/recover', 'start an explorer')

    async def check(self, _asked: Mapping[str, Any]) -> Mapping[str, Any]:
        """Slide over the reference plate, and compare it with that of the training of the classifier's model."""
        with self._until_stopped() as stopped:
            [path] = await self._operate(lambda operator: operator.parameters('classifier', ['model']))
            if not path:
                raise InvalidParameter('the classifier has no model to compare the finger with; start it with one')
            read_reference(path)  # without one nothing need move
            return await self._run(stopped, 'check', path)

    async def collect(self, asked: Mapping[str, Any]) -> Mapping[str, Any]:
        """Record labelled slides at many places of the surface patch, into the folder `surfaces` of the recordings."""
        surface = checked_label(_short(str(asked.get('surface', ''))))
        if not surface or surface.startswith('-'):
            raise InvalidParameter('the surface to collect has no name; give one')
        with self._until_stopped() as stopped:
            return await self._run(stopped, 'collect', surface, str(self._recordings / 'surfaces'))

    async def add(self, asked: Mapping[str, Any]) -> Mapping[str, Any]:
        """Add an exploration, the last one if it has no id, or remove the last added slide."""
        if asked.get('undo'):
            return {'success': True, 'message': await self._operate(Operator.remove_last_added)}
        label, exploration = (_short(str(asked.get(name, ''))).strip() for name in ('label', 'id'))
        if not label:
            raise InvalidParameter('the texture to add has no name; give one')
        _, message = await self._operate(lambda operator: operator.add(label, exploration))
        return {'success': True, 'message': message}

    async def record(self, asked: Mapping[str, Any]) -> Mapping[str, Any]:
        """Begin or end a recording; where it goes is not the page's choice."""
        now = datetime.now().strftime('%Y-%m-%d_%H-%M-%S')
        work = partial(self._recorder.begin, now) if asked.get('on') else self._recorder.end
        message = await asyncio.get_running_loop().run_in_executor(None, work)
        return {'success': True, 'message': message}

    async def offered(self) -> Mapping[str, Any]:
        """Return the motions of the running explorer with their numbers; none while there is no explorer."""
        motions: dict[str, list[dict[str, Any]]] = {name: [] for name in self._info.motions}
        for one in self._info.numbers:
            number = {'name': one.field, 'default': one.default_value, 'low': one.low, 'high': one.high}
            motions[one.motion].append({**number, 'text': number_text(one.field, one.unit, one.low, one.high)})
        return motions

    # ROS

    def _on_bad(self, error: InvalidData) -> None:
        self._bad += 1
        self.get_logger().warning(f'left out: {error}', throttle_duration_sec=10.0)

    def _show(self) -> None:
        self._recorder.watch()
        self._feed.recording, self._feed.fault = self._recorder.bag, self._recorder.fault
        if self._serving.watched:
            self._serving.show(json.dumps(self._feed.frame(time.monotonic()), allow_nan=False))

    def _report(self) -> DiagnosticReport:
        fault = self._recorder.fault
        return 'WARN' if fault or self._bad else 'OK', fault or 'the page is served', {'bad_messages': self._bad}

    @contextlib.contextmanager
    def _until_stopped(self) -> Iterator[Callable[[], bool]]:
        """Note something that moves the arm until it is over; the function says whether Stop was pressed since."""
        one = object()
        self._moving.add(one)
        try:
            yield lambda: one not in self._moving
        finally:
            self._moving.discard(one)

    def _interrupt(self) -> None:
        if self._command is not None:
            with contextlib.suppress(ProcessLookupError):
                self._command.send_signal(signal.SIGINT)

    async def _run(self, stopped: Callable[[], bool], name: str, *arguments: str) -> Mapping[str, Any]:
        """Run a sub-command of `texture`, one at a time; the page shows each line of it, the last at its end."""
        self._check_free()
        self._feed.working = f'{name}: starting'
        command = [sys.executable, '-m', 'texture_bringup.command', name, *arguments]
        namespace = self.get_namespace().strip('/')
        line = ''
        try:
            self._command = await asyncio.create_subprocess_exec(
                *command, '--namespace', namespace, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT
            )
            if stopped():
                self._interrupt()
            assert self._command.stdout is not None
            async for output in self._command.stdout:
                line = output.decode(errors='replace').strip().removeprefix('texture: ') or line
                self._feed.working = f'{name}: {line}'
            return {'success': await self._command.wait() == 0, 'message': line}
        finally:
            self._command, self._feed.working = None, ''

    async def _call(self, service: str, advice: str) -> Mapping[str, Any]:
        success, message = await self._operate(lambda operator: operator.call(service, advice))
        return {'success': success, 'message': message}

    async def _operate(self, work: Callable[[Operator], T]) -> T:
        """Let an operator do something in another thread; it is left when the page closes."""

        def operate() -> T:
            with Operator(self.get_namespace(), guard=self._check_open) as operator:
                return work(operator)

        return await asyncio.get_running_loop().run_in_executor(None, operate)

    def _check_free(self) -> None:
        """Refuse what moves the arm while the page runs a sub-command that does."""
        if self._feed.working:
            raise InvalidParameter(f'the page already runs: {self._feed.working}; wait for it, or press Stop')

    def _check_open(self) -> None:
        if self._closing:
            raise LaunchFailed('the dashboard was closed')


def _short(value: Any) -> Any:
    if isinstance(value, str) and len(value) > MAX_CHARACTERS:
        raise InvalidParameter(f'a text has {len(value)} characters; allowed are {MAX_CHARACTERS}')
    return value


def main() -> None:
    """Run the node."""
    run(DashboardNode)
