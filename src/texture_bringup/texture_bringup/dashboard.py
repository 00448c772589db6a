# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The dashboard: a web page with the state of the nodes, and its server."""

from __future__ import annotations

import asyncio
import concurrent.futures
import hmac
import ipaddress
import json
import math
import os
import re
import secrets
import socket
import threading
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from aiohttp import WSCloseCode, web
from numpy.typing import NDArray

from texture_bringup.launcher import ChildLauncher
from texture_core.config import parse_json
from texture_core.errors import InvalidParameter, LaunchFailed, TextureError
from texture_core.types import (
    ENDED,
    ExplorationState,
    ModelInfo,
    Phase,
    Rejection,
    RoughnessEstimate,
    TactileSignal,
    TextureEstimate,
)
from texture_exploration.motions import DEFAULTS
from texture_exploration.safety import SafetyLimits

# --------------------
# Who may use the page: requests of this page alone, and beyond loopback only with the token.

TOKEN_VARIABLE = 'TEXTURE_DASHBOARD_TOKEN'
COOKIE = 'texture_token'
MIN_TOKEN = 16


@dataclass(frozen=True)
class Access:
    """What is asked of a request."""

    host: str
    token: str = ''
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if (self.token and len(self.token) < MIN_TOKEN) or (not self.token and not is_loopback(self.host)):
            raise InvalidParameter(
                f"the token of the dashboard has {len(self.token)} characters; beyond loopback (host is '{self.host}') "
                f'at least {MIN_TOKEN} are needed'
            )

    @classmethod
    def to_this_machine(cls, host: str) -> Access:
        """Return the access by all names of this machine, with the token of the environment, else one made now.

        On loopback the page needs no token, and only 'localhost' is a right name.
        """
        token = os.environ.get(TOKEN_VARIABLE, '')
        if is_loopback(host):
            return cls(host, token)
        name = socket.gethostname().lower()
        return cls(host, token or secrets.token_urlsafe(24), (host.lower(), name, f'{name}.local'))

    def url(self, port: int) -> str:
        """Return the address of the page, with its token."""
        host = socket.gethostname() if self.host in ('0.0.0.0', '::') else self.host
        host = f'[{host}]' if ':' in host else host
        return f'http://{host}:{port}/' + (f'?token={self.token}' if self.token else '')

    def knows(self, given: str) -> bool:
        """Return whether a request carries the token, compared in constant time; True if none is needed."""
        return not self.token or hmac.compare_digest(given.encode(), self.token.encode())

    def is_our_host(self, host: str) -> bool:
        """Return whether a Host header names this machine: an address, or one of its names.

        A page elsewhere that lets its name point here (DNS rebinding) comes with its own name.
        """
        name = _name(f'//{host}')
        if name in ('localhost', *self.names):
            return True
        return is_loopback(name) if is_loopback(self.host) else _is_address(name)

    def is_our_origin(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request that changes something comes from this page, or from no page at all."""
        origin = headers.get('Origin')
        return origin is None or urlsplit(origin).netloc == headers.get('Host', '')


def is_loopback(host: str) -> bool:
    """Return whether an address or name can be reached from this machine alone."""
    return host == 'localhost' or (_is_address(host) and ipaddress.ip_address(host).is_loopback)


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _name(url: str) -> str:
    try:
        return (urlsplit(url).hostname or '').lower()
    except ValueError:
        return ''


# --------------------
# Which numbers each motion takes, with default and range: what the buttons of the page offer.


def offered(limits: SafetyLimits) -> dict[str, list[dict[str, Any]]]:
    """Return the numbers of each motion: name, default, lowest, highest and unit."""
    return {
        motion: [
            {'name': name, 'default': value, **dict(zip(('low', 'high', 'unit'), limits.range(name), strict=True))}
            for name, value in defaults.items()
        ]
        for motion, defaults in DEFAULTS.items()
    }


# --------------------
# One light per node: green, yellow or red; a node that has fallen silent is red, one that has ended is grey.

SILENT_S = 5.0  # nodes report once a second
MAX_LIGHTS = 64
MAX_CHARACTERS = 300
ENDED_COLOURS = {'OK': 'grey', 'WARN': 'yellow', 'ERROR': 'red'}
COLOURS = {'OK': 'green', 'WARN': 'yellow', 'ERROR': 'red'}


class NodeStatuses:
    """Keep what each node said last."""

    def __init__(self) -> None:
        # Level, message, time (of a clock that only rises, s), and whether the node has ended with that.
        self._lights: dict[str, tuple[str, str, float, bool]] = {}

    def update(self, name: str, level: str, message: str, time_s: float, ended: bool = False) -> None:
        """Take note of a report; when there are too many names, the one silent for longest is forgotten."""
        self._lights.pop(name, None)
        self._lights[name[:MAX_CHARACTERS]] = level, message[:MAX_CHARACTERS], time_s, ended
        if len(self._lights) > MAX_LIGHTS:
            del self._lights[next(iter(self._lights))]

    def newest(self, name: str) -> tuple[str, str] | None:
        """Return level and message of what a node said last; None if it never did."""
        return self._lights[name][:2] if name in self._lights else None

    def shown(self, time_s: float) -> list[dict[str, str]]:
        """Return name, colour and sentence of each light, by name."""
        found = []
        for name, (level, message, said_s, ended) in sorted(self._lights.items()):
            colour, text = COLOURS.get(level, 'red'), message
            if ended:
                colour, text = ENDED_COLOURS.get(level, 'red'), f'ended: {message}'
            elif time_s - said_s > SILENT_S:
                colour, text = 'red', f'silent for {time_s - said_s:.0f} s; it said last: {message}'
            found.append({'name': name, 'colour': colour, 'message': text})
        return found


# --------------------
# The recordings that the page asks for: each a process of its own, one at a time.


class Recorder:
    """Begins and ends recordings."""

    def __init__(self, folder: Path, namespace: str) -> None:
        self.bag = ''  # that is being recorded
        self.fault = ''  # with which the last recording ended
        self._folder = folder
        self._namespace = namespace.strip('/')
        self._child: ChildLauncher | None = None

    def begin(self, name: str) -> str:
        """Begin a recording of this name; return what is to be said."""
        if self._child is not None:
            raise InvalidParameter(f"'{self.bag}' is being recorded already; end that first")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            arguments = {'out': self._folder / name, 'namespace': self._namespace}
            self._child = ChildLauncher('record', arguments, os.environ, self._folder / f'{name}.log').__enter__()
        except OSError as error:
            raise InvalidParameter(f"nothing can be recorded in '{self._folder}': {error.strerror}") from error
        self.fault = ''
        self.bag = str(self._folder / name)
        return f"recording to '{self.bag}'"

    def end(self) -> str:
        """Complete the recording, if there is one; return what is to be said."""
        child, self._child = self._child, None
        if child is None:
            return 'nothing is being recorded'
        child.stop()
        bag, self.bag = self.bag, ''
        return f"'{bag}' is complete"

    def watch(self) -> None:
        """Take note of a recording that ended by itself."""
        child = self._child
        if child is None:
            return
        try:
            child.check()
        except LaunchFailed as error:
            self._child, self.bag, self.fault = None, '', str(error)


# --------------------
# The newest samples of one stream, and how they are drawn with few numbers.

MAX_SAMPLES = 100_000


class Ring:
    """Keep the newest samples of the first channel of a stream."""

    def __init__(self, length_s: float) -> None:
        self._length_s = length_s
        self._samples: NDArray[np.float64] = np.zeros(0)  # of the whole length, NaN where none came yet
        self._next: int | None = None
        self.rate_hz = 0.0
        self.sensor = ''
        self.channel = ''
        self.unit = ''
        self.lost = 0

    def update(self, signal: TactileSignal) -> None:
        """Append a batch; a stream of another sensor or rate starts again, lost samples leave a gap of NaN."""
        if (signal.sensor, signal.sampling_rate_hz) != (self.sensor, self.rate_hz):
            self._begin(signal)
        gap = 0 if self._next is None else max(0, signal.first_sample - self._next)
        self._next = signal.next_sample
        self.lost += gap
        fresh = signal.samples[:, 0].astype(np.float64)
        if gap:
            fresh = np.concatenate([np.full(min(gap, len(self._samples)), np.nan), fresh])
        self._samples = np.concatenate([self._samples, fresh])[-len(self._samples) :]

    def newest(self, length_s: float) -> NDArray[np.float64]:
        """Return the newest samples, (n_samples,), oldest first; NaN where none came yet."""
        count = min(len(self._samples), round(length_s * self.rate_hz))
        return self._samples[len(self._samples) - count :]

    def _begin(self, signal: TactileSignal) -> None:
        size = int(np.clip(round(self._length_s * signal.sampling_rate_hz), 1, MAX_SAMPLES))
        self._samples = np.full(size, np.nan)
        self._next = None
        self.rate_hz, self.sensor = signal.sampling_rate_hz, signal.sensor
        self.channel, self.unit = signal.channels[0], signal.common_unit


def envelope(samples: NDArray[np.float64], points: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the least and the greatest sample of `points` stretches: no peak is lost, however few are drawn."""
    points = min(points, len(samples))
    if points == 0:
        return np.zeros(0), np.zeros(0)
    edges = np.linspace(0, len(samples), points, endpoint=False).astype(int)
    low = np.fmin.reduceat(samples, edges)
    high = np.fmax.reduceat(samples, edges)
    return low, high


def spectrum_db(samples: NDArray[np.float64], bins: int) -> NDArray[np.float64]:
    """Return the amplitude from 0 Hz to half the rate in dB of one unit, the greatest of each bin; empty if gaps.

    A sine of amplitude 1 reads 0 dB (Hann window, its gain taken out).
    """
    if len(samples) < 16 or not np.isfinite(samples).all():
        return np.zeros(0)
    window = np.hanning(len(samples))
    amplitude = 2.0 * np.abs(np.fft.rfft(window * (samples - samples.mean()))) / window.sum()
    bins = min(bins, len(amplitude))
    edges = np.linspace(0, len(amplitude), bins, endpoint=False).astype(int)
    levels: NDArray[np.float64] = 20.0 * np.log10(np.maximum(np.maximum.reduceat(amplitude, edges), 1e-6))
    return levels


# --------------------
# The web server of the dashboard: static page, a WebSocket of frames, a few commands. Knows no ROS.

BUTTONS = ('explore', 'stop', 'add', 'record', 'tare', 'recover', 'check', 'collect')
MAX_BODY_BYTES = 4096
MAX_MESSAGE_BYTES = 1024
MAX_VIEWERS = 16
HEARTBEAT_S = 10.0
SERVER_CLOSING_S = 1.0
PAGE: Mapping[str, tuple[str, str]] = {
    '/': ('index.html', 'text/html'),
    '/dashboard.js': ('dashboard.js', 'text/javascript'),
    '/dashboard.css': ('dashboard.css', 'text/css'),
}
HEADERS = {
    'Content-Security-Policy': "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src data:; form-action 'none'; base-uri 'none'; frame-ancestors 'none'",
    'X-Content-Type-Options': 'nosniff',
    'Referrer-Policy': 'no-referrer',
    'Cache-Control': 'no-store',
}
Answer = Mapping[str, Any]
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Viewers:
    """The newest frame for everybody who looks; who is slow misses frames and keeps nobody waiting."""

    def __init__(self) -> None:
        self._frame = ''
        self._number = 0
        self._news = asyncio.Event()
        self.sockets: set[web.WebSocketResponse] = set()

    def show(self, frame: str) -> None:
        """Replace the frame; called in the loop of the server."""
        self._frame, self._number = frame, self._number + 1
        self._news.set()
        self._news = asyncio.Event()

    async def watch(self, request: web.Request) -> web.StreamResponse:
        """Send frames to who asked, until that page closes."""
        if len(self.sockets) >= MAX_VIEWERS:
            return _said(503, f'{MAX_VIEWERS} pages are open already; close one')
        before = self._number  # old by now, as no frames are made while nobody looks
        socket = web.WebSocketResponse(heartbeat=HEARTBEAT_S, max_msg_size=MAX_MESSAGE_BYTES, timeout=SERVER_CLOSING_S)
        await socket.prepare(request)
        self.sockets.add(socket)
        sending = asyncio.create_task(self._send_to(socket, before))
        try:
            async for _ in socket:  # a page says nothing; this notices when it goes
                pass
        finally:
            self.sockets.discard(socket)
            sending.cancel()
            await asyncio.gather(sending, return_exceptions=True)
        return socket

    async def _send_to(self, socket: web.WebSocketResponse, sent: int) -> None:
        """Send the newest frame after number `sent`, again and again, until the socket closes."""
        while not socket.closed:
            if sent == self._number:
                await self._news.wait()
            sent = self._number
            await socket.send_str(self._frame)


VIEWERS: web.AppKey[Viewers] = web.AppKey('viewers', Viewers)


def make_app(commands: Any, access: Access, page: Path) -> web.Application:
    """Return the application, which is not started yet."""
    app = web.Application(middlewares=[_guard(access)], client_max_size=MAX_BODY_BYTES)
    viewers = app[VIEWERS] = Viewers()

    async def motions(_request: web.Request) -> web.StreamResponse:
        return web.json_response(await commands.offered())

    async def static(request: web.Request) -> web.StreamResponse:
        file, kind = PAGE[request.path]
        text = (page / file).read_text(encoding='utf-8')
        return web.Response(text=text, content_type=kind, charset='utf-8')

    async def close(_app: web.Application) -> None:
        for viewer in tuple(viewers.sockets):
            await viewer.close(code=WSCloseCode.GOING_AWAY)

    app.router.add_get('/ws', viewers.watch)
    app.router.add_get('/api/motions', motions)
    for name in BUTTONS:
        app.router.add_post(f'/api/{name}', _command(getattr(commands, name)))
    for path in PAGE:
        app.router.add_get(path, static)
    app.on_shutdown.append(close)
    return app


def _guard(access: Access) -> Any:
    """Return what every request passes first."""

    @web.middleware
    async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
        try:
            refusal = _refusal(access, request)
            # Not `or`: to Ubuntu's aiohttp, 3.9, a response in which nothing was stored is false.
            response = await handler(request) if refusal is None else refusal
        except web.HTTPException as error:
            error.headers.update(HEADERS)
            raise
        if not response.prepared:
            response.headers.update(HEADERS)
        return response

    return guard


def _refusal(access: Access, request: web.Request) -> web.StreamResponse | None:
    """Return why a request is refused, or the answer that turns a token in the address into a cookie."""
    if not access.is_our_host(request.headers.get('Host', '')):
        return _said(403, 'this page is reached by another name; use the address that the dashboard printed')
    changes = request.method != 'GET' or request.path == '/ws'
    if changes and not access.is_our_origin(request.headers):
        return _said(403, 'the request comes from another page; use the page of the dashboard')
    given = request.query.get('token', '')
    if request.path == '/' and given and access.token and access.knows(given):
        answer = web.Response(status=303, headers={'Location': '/'})
        answer.set_cookie(COOKIE, given, httponly=True, samesite='Strict')
        return answer
    carried = request.cookies.get(COOKIE, '') or request.headers.get('Authorization', '').removeprefix('Bearer ')
    if not access.knows(carried):
        return _said(401, 'this page needs its token: open the address that the dashboard printed, with ?token=')
    return None


def _command(command: Callable[[Mapping[str, Any]], Awaitable[Answer]]) -> Handler:
    async def act(request: web.Request) -> web.StreamResponse:
        # Another page could send a form without asking; it cannot send JSON.
        if request.content_type != 'application/json':
            return _said(415, f'the request is {request.content_type}; application/json is needed')
        try:
            asked = parse_json(await request.text())
        except ValueError:
            return _said(400, 'the request is not JSON')
        if not isinstance(asked, dict):
            return _said(400, 'the request is not a JSON object')
        try:
            return web.json_response(await command(asked))
        except TextureError as error:
            return _said(409, str(error))

    return act


def _said(status: int, message: str) -> web.Response:
    return web.json_response({'success': False, 'message': message}, status=status)


# --------------------
# The web server in a thread of its own, beside whatever else the process does.

SERVING_CLOSING_S = 5.0


class Serving:
    """Serve an application until closed."""

    def __init__(self, app: web.Application, host: str, port: int) -> None:
        self._app = app
        self._loop = asyncio.new_event_loop()
        self._runner = web.AppRunner(app, shutdown_timeout=1.0, access_log=None)
        self._started: concurrent.futures.Future[int] = concurrent.futures.Future()
        self._thread = threading.Thread(target=self._serve, args=(host, port), name='web server')
        self._thread.start()
        try:
            self.port = self._started.result()
        except OSError as error:
            self._thread.join()
            raise LaunchFailed(
                f"the dashboard cannot listen on '{host}' port {port}: {error.strerror or error}; "
                'choose another host or port'
            ) from error

    @property
    def watched(self) -> bool:
        """Whether a page is open."""
        return bool(self._app[VIEWERS].sockets)

    def show(self, frame: str) -> None:
        """Give a frame to all viewers; never waits for them."""
        self._loop.call_soon_threadsafe(self._app[VIEWERS].show, frame)

    def close(self) -> None:
        """Close all connections, and join the thread."""
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(SERVING_CLOSING_S)

    def _serve(self, host: str, port: int) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._started.set_result(self._loop.run_until_complete(self._start(host, port)))
        except OSError as error:
            self._loop.run_until_complete(self._runner.cleanup())
            self._loop.close()
            self._started.set_exception(error)
            return
        self._loop.run_forever()
        self._loop.run_until_complete(self._runner.cleanup())
        self._loop.close()

    async def _start(self, host: str, port: int) -> int:
        await self._runner.setup()
        site = web.TCPSite(self._runner, host, port)
        await site.start()
        return int(self._runner.addresses[0][1])


# --------------------
# The image of the slow channels: how far each is from where it rested, and where it lies.

PLACE = re.compile(r'.*_(\d+)_(\d+)')  # 'taxel_6_3': row and column
MAX_CHANNELS = 1024
RESTING_SHARE = 0.05  # of a batch in the resting value: follows a drift of seconds, not a touch
LEAST_NOISES = 10.0  # range of the colours in standard deviations of the noisiest channel, so that noise stays pale


class Taxels:
    """Keep the newest image and the resting one."""

    def __init__(self) -> None:
        self.channels: tuple[str, ...] = ()
        self.places: list[tuple[int, int]] = []
        self.unit = ''
        self._resting: NDArray[np.float64] = np.zeros(0)
        self._newest: NDArray[np.float64] = np.zeros(0)
        self._power: NDArray[np.float64] = np.zeros(0)  # of the noise of each channel

    def update(self, signal: TactileSignal, touching: bool) -> None:
        """Take the newest sample; while nothing is touched it moves the resting image."""
        newest = signal.samples[-1:, :MAX_CHANNELS].astype(np.float64)
        if not len(newest):
            return
        if signal.channels[:MAX_CHANNELS] != self.channels:
            self.channels, self.unit = signal.channels[:MAX_CHANNELS], signal.common_unit
            self.places = places_of(self.channels)
            self._resting, self._power = newest[0], np.zeros(newest.shape[1])
        self._newest = newest[0]
        if not touching:
            known = np.where(np.isfinite(self._resting), self._resting, self._newest)
            step = np.nan_to_num(self._newest - known, posinf=0.0, neginf=0.0)
            self._resting = known + RESTING_SHARE * step
            self._power += RESTING_SHARE * np.where(np.isfinite(self._newest), step**2 - self._power, 0.0)

    @property
    def image(self) -> NDArray[np.float64]:
        """How far each channel is from its resting value, (n_channels,)."""
        return self._newest - self._resting

    @property
    def least_range(self) -> float:
        """Smallest value that has the full colour, in the unit of the channels; 0 while no noise was measured."""
        return LEAST_NOISES * float(np.sqrt(self._power.max(initial=0.0)))


def places_of(channels: tuple[str, ...]) -> list[tuple[int, int]]:
    """Return row and column of each channel: as its name tells, else line by line in a square."""
    named = [PLACE.fullmatch(channel) for channel in channels]
    if named and all(named):
        return [(int(match[1]), int(match[2])) for match in named if match]
    columns = int(np.ceil(np.sqrt(len(channels)))) or 1
    return [divmod(number, columns) for number in range(len(channels))]


# --------------------
# What the page shows: the newest of everything, in bounded memory, as one JSON text a frame.

FRAME_PERIOD_S = 0.1
MAX_EXPLORATIONS = 12  # that are listed; the page itself keeps the frames that it has shown of them, for replay
SIGNAL_S, SPECTRUM_S = 2.0, 0.5
POINTS, BINS = 240, 128
MAX_LABELS = 200
DIGITS = 4
IDLE = ExplorationState(0, '', '', Phase.IDLE)


class Feed:
    """Take what the nodes publish; give frames. Used from one thread at a time."""

    def __init__(self) -> None:
        self._past: dict[str, dict[str, Any]] = {}  # summaries by exploration, the newest last
        self.node_statuses = NodeStatuses()
        self._ring = Ring(SIGNAL_S)
        self._taxels = Taxels()
        self._state = IDLE
        self._texture = TextureEstimate(0, '')
        self._model = ModelInfo(0)
        self._roughness = RoughnessEstimate(0, '')
        self.recording = ''  # folder that is being recorded to
        self.working = ''  # what a sub-command that the page has started said last

    def on_signal(self, signal: TactileSignal) -> None:
        """Take a batch of the fast stream."""
        self._ring.update(signal)

    def on_static(self, signal: TactileSignal) -> None:
        """Take a batch of the slow stream."""
        self._taxels.update(signal, touching=self._state.phase not in ENDED)

    def on_state(self, state: ExplorationState) -> None:
        """Take what the finger is doing; a new exploration begins without evidence."""
        if state.exploration_id and state.exploration_id not in self._past:
            self._texture = TextureEstimate(state.stamp_ns, state.exploration_id)
            self._roughness = RoughnessEstimate(state.stamp_ns, state.exploration_id)
        self._state = state
        if state.exploration_id:
            seen = {'motion': state.motion, 'phase': state.phase.value, 'surface': state.surface}
            self._note(state.exploration_id, seen)

    def on_texture(self, estimate: TextureEstimate) -> None:
        """Take an estimate; one of an exploration before the present one only enters its summary."""
        reported = {'label': estimate.label, 'confidence': _number(estimate.confidence), 'known': estimate.known}
        if estimate.exploration_id in self._past:
            self._note(estimate.exploration_id, reported)
        if estimate.exploration_id == self._texture.exploration_id or not self._texture.exploration_id:
            self._texture = estimate

    def on_model(self, model: ModelInfo) -> None:
        """Take the labels of the classifier's model."""
        self._model = model

    def on_roughness(self, estimate: RoughnessEstimate) -> None:
        """Take an estimate; one of an exploration before the present one only enters its summary."""
        if estimate.exploration_id in self._past:
            self._note(estimate.exploration_id, {'grade': _number(estimate.grade)})
        if estimate.exploration_id == self._roughness.exploration_id or not self._roughness.exploration_id:
            self._roughness = estimate

    def _note(self, exploration_id: str, seen: Mapping[str, Any]) -> None:
        """Add to the summary of an exploration; the oldest is forgotten."""
        self._past[exploration_id] = {**self._past.get(exploration_id, {}), **seen, 'id': exploration_id}
        if len(self._past) > MAX_EXPLORATIONS:
            del self._past[next(iter(self._past))]

    def frame(self, time_s: float) -> str:
        """Return everything the page shows at a time of the monotonic clock, s."""
        frame = {
            'signal': self._signal(),
            'spectrum': self._spectrum(),
            'taxels': self._image(),
            'state': self._shown_state(),
            'texture': self._evidence(),
            'roughness': {name: _plain(value) for name, value in asdict(self._roughness).items()},
            'lights': self.node_statuses.shown(time_s),
            'past': list(reversed(self._past.values())),
            'recording': self.recording,
            'working': self.working,
        }
        return json.dumps(frame, allow_nan=False)

    def _signal(self) -> dict[str, Any]:
        ring = self._ring
        low, high = envelope(ring.newest(SIGNAL_S), POINTS)
        names = {'sensor': ring.sensor, 'channel': ring.channel, 'unit': ring.unit}
        return {**names, 'low': _numbers(low), 'high': _numbers(high), 'length_s': SIGNAL_S, 'lost': ring.lost}

    def _spectrum(self) -> dict[str, Any]:
        levels = spectrum_db(self._ring.newest(SPECTRUM_S), BINS)
        return {'db': _numbers(levels), 'high_hz': self._ring.rate_hz / 2}

    def _image(self) -> dict[str, Any]:
        taxels = self._taxels
        least = {'least_range': _number(taxels.least_range)}
        return {'values': _numbers(taxels.image), 'places': taxels.places, 'unit': taxels.unit, **least}

    def _missing(self, what: str, name: str) -> str:
        """Return that there is no estimate yet and what its node says, if that node is not well."""
        status = self.node_statuses.newest(name)
        if status is None:
            return f'no {what} yet, and no {name} reports on /diagnostics'
        level, message = status
        return f'no {what} yet' + ('' if level == 'OK' else f': {message}')

    def _shown_state(self) -> dict[str, Any]:
        return {name: _plain(value) for name, value in asdict(self._state).items()}

    def _evidence(self) -> dict[str, Any]:
        """Return the estimate with the most probable labels first."""
        estimate, model = self._texture, self._model
        fits = (estimate.model, estimate.revision) == (model.model, model.revision)  # else the labels come in a moment
        labels = model.labels if fits else ()
        pairs = sorted(zip(estimate.probabilities, labels, strict=False), reverse=True)[:MAX_LABELS]
        shown = {name: _plain(value) for name, value in asdict(estimate).items()} | {'known': estimate.known}
        shown['missing'] = '' if estimate.label or estimate.message else self._missing('estimate', 'classifier')
        shown['labels'] = [label for _, label in pairs]
        shown['probabilities'] = _numbers(probability for probability, _ in pairs)
        return shown


def _plain(value: Any) -> Any:
    """Return a value as JSON can carry it exactly: NaN as null, nanoseconds as text."""
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, Phase):
        return value.value
    if isinstance(value, Rejection):
        return value.name.lower().replace('_', ' ')
    return str(value) if isinstance(value, int) and abs(value) > 2**53 else value


def _number(value: float) -> float | None:
    return float(f'{value:.{DIGITS}g}') if math.isfinite(value) else None


def _numbers(values: Iterable[float] | np.ndarray[Any, np.dtype[np.float64]]) -> list[float | None]:
    return [_number(float(value)) for value in values]
