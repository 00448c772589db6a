# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The dashboard: a web page with the state of the nodes, and its server."""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import hmac
import html
import ipaddress
import json
import os
import re
import secrets
import socket
import threading
import time
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from aiohttp import WSCloseCode, WSMsgType, web

from texture_bringup.launcher import ChildLauncher
from texture_core.config import parse_json
from texture_core.errors import InvalidParameter, LaunchFailed, TextureError

# --------------------
# Access to the page: only requests of this page, and beyond loopback only with the token.

TOKEN_VARIABLE = 'TEXTURE_DASHBOARD_TOKEN'
COOKIE = 'texture_token'
MIN_TOKEN = 16
FREE_GUESSES, LONGEST_WAIT_S, MAX_ADDRESSES = 5, 300.0, 1000


@dataclass(frozen=True)
class Access:
    """Conditions that a request must meet."""

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
        return not self.token or hmac.compare_digest(given.encode(errors='surrogatepass'), self.token.encode())

    def is_our_host(self, host: str) -> bool:
        """Return whether a Host header names this machine: an address, or one of its names.

        A page of another host whose name resolves to this machine (DNS rebinding) comes with another name.
        """
        name = _name(f'//{host}')
        if name in ('localhost', *self.names):
            return True
        return is_loopback(name) if is_loopback(self.host) else _is_address(name)

    def is_our_origin(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request that changes something comes from this page, or from no page at all."""
        host = headers.get('Host', '')
        return headers.get('Origin') in (None, f'http://{host}', f'https://{host}')


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


class Guesses:
    """Wrong tokens by address: after a few, each doubles the time until the next is checked.

    A repeated token counts once: it comes from an open page with an outdated token and is no guess.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._wrong: dict[str, tuple[int, float, str]] = {}  # their number, and time and text of the last

    def wait_s(self, address: str) -> float:
        """Return for how long no token from an address is checked."""
        count, last_s, _ = self._wrong.get(address, (0, 0.0, ''))
        if count <= FREE_GUESSES:
            return 0.0
        doublings = min(count - FREE_GUESSES, 60)  # a power of thousands overflows
        return max(0.0, last_s + min(2.0**doublings, LONGEST_WAIT_S) - self._clock())

    def note(self, address: str, token: str) -> None:
        """Count a wrong token; above MAX_ADDRESSES the one that is silent for longest is removed."""
        count, last_s, last = self._wrong.pop(address, (0, 0.0, ''))
        self._wrong[address] = (count, last_s, last) if token == last else (count + 1, self._clock(), token)
        if len(self._wrong) > MAX_ADDRESSES:
            del self._wrong[next(iter(self._wrong))]


# --------------------
# The recordings that the page starts: each in a separate process, one at a time.


class Recorder:
    """Begins and ends recordings."""

    def __init__(self, folder: Path, namespace: str) -> None:
        self.bag = ''  # that is being recorded
        self.fault = ''  # with which the last recording ended
        self._folder = folder
        self._namespace = namespace.strip('/')
        self._child: ChildLauncher | None = None

    def begin(self, name: str) -> str:
        """Begin a recording of this name; return a message."""
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
        """Complete the recording, if there is one; return a message."""
        child, self._child = self._child, None
        if child is None:
            return 'nothing is being recorded'
        child.stop()
        bag, self.bag = self.bag, ''
        ends = re.findall(r'is complete(: .*)', child.log.read_text(errors='replace'))
        return f"'{bag}' is complete{ends[-1] if ends else ''}"

    def watch(self) -> None:
        """Note a recording that ended on an error."""
        if self._child is not None and self._child.end:
            end, log = self._child.end, self._child.log
            self.fault = f"the recording to '{self.bag}' has ended: {end}; the output of all nodes is in {log}"
            self._child, self.bag = None, ''


# --------------------
# The web server of the dashboard: static page, a WebSocket of frames, a few commands. Knows no ROS.

BUTTONS = ('explore', 'stop', 'add', 'record', 'tare', 'recover', 'check', 'collect')
MAX_BODY_BYTES = 4096
MAX_MESSAGE_BYTES = 1024
MAX_VIEWERS = 16
HEARTBEAT_S = 10.0
NEWS_S = 0.03  # how often it is looked whether there is a new frame
REQUEST_S, LOOK_S = 15.0, 1.0  # that a request may take to come, and how often that is looked at
SERVER_CLOSING_S = 1.0
ENDS = (WSMsgType.CLOSE, WSMsgType.CLOSING, WSMsgType.CLOSED, WSMsgType.ERROR)
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
    """The newest frame for all viewers; a slow viewer misses frames and delays no other."""

    def __init__(self, hello: str) -> None:
        self._hello = hello  # the first message to each
        self._frame = ''
        self._number = 0
        self.sockets: set[web.WebSocketResponse] = set()

    def show(self, frame: str) -> None:
        """Replace the frame; called in the loop of the server."""
        self._frame, self._number = frame, self._number + 1

    async def watch(self, request: web.Request) -> web.StreamResponse:
        """Send frames to the page of a request until it closes."""
        if len(self.sockets) >= MAX_VIEWERS:
            return _failure(503, f'{MAX_VIEWERS} pages are open already; close one')
        sent = self._number  # outdated, as no frames are made without a viewer
        socket = web.WebSocketResponse(heartbeat=HEARTBEAT_S, max_msg_size=MAX_MESSAGE_BYTES, timeout=SERVER_CLOSING_S)
        await socket.prepare(request)
        self.sockets.add(socket)
        try:
            await socket.send_str(self._hello)
            while not socket.closed:
                if sent != self._number:
                    sent = self._number
                    await socket.send_str(self._frame)
                with contextlib.suppress(asyncio.TimeoutError):
                    # A page sends nothing; this detects when it closes. Of one that is being closed here, aiohttp 3.9
                    # answers at once and is not closed yet.
                    if (await socket.receive(NEWS_S)).type in ENDS:
                        break
        except ConnectionError:  # it closed while a frame was sent
            pass
        finally:
            self.sockets.discard(socket)
        return socket


VIEWERS: web.AppKey[Viewers] = web.AppKey('viewers', Viewers)
BUSY: web.AppKey[set[Any]] = web.AppKey('busy', set)  # connections whose request is being answered


def make_app(commands: Any, access: Access, page: Path) -> web.Application:
    """Return the application, which is not started yet.

    `commands.identity` names the nodes behind the page: an open page of others gets no frame and reaches no node.
    """
    identity = commands.identity
    app = web.Application(middlewares=[_guard(access)], client_max_size=MAX_BODY_BYTES)
    viewers = app[VIEWERS] = Viewers(json.dumps({'dashboard': identity, 'run': secrets.token_hex(8)}))
    app[BUSY] = set()

    async def motions(_request: web.Request) -> web.StreamResponse:
        return web.json_response(await commands.offered())

    async def static(request: web.Request) -> web.StreamResponse:
        file, kind = PAGE[request.path]
        text = (page / file).read_text(encoding='utf-8').replace('$DASHBOARD', html.escape(identity))
        return web.Response(text=text, content_type=kind, charset='utf-8')

    async def secure(_request: web.Request, response: web.StreamResponse) -> None:
        response.headers.update(HEADERS)

    async def close(_app: web.Application) -> None:
        for viewer in tuple(viewers.sockets):
            await viewer.close(code=WSCloseCode.GOING_AWAY)

    app.router.add_get('/ws', viewers.watch)
    app.router.add_get('/api/motions', motions)
    for name in BUTTONS:
        app.router.add_post(f'/api/{name}', _command(getattr(commands, name), identity))
    for path in PAGE:
        app.router.add_get(path, static)
    app.on_response_prepare.append(secure)
    app.on_shutdown.append(close)
    return app


def _guard(access: Access) -> Any:
    """Return the middleware that checks every request."""
    guesses = Guesses()

    @web.middleware
    async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
        request.app[BUSY].add(request.protocol)
        try:
            refusal = _refusal(access, guesses, request)
            # Not `or`: to Ubuntu's aiohttp, 3.9, a response in which nothing was stored is false.
            return await handler(request) if refusal is None else refusal
        finally:
            request.app[BUSY].discard(request.protocol)

    return guard


def _refusal(access: Access, guesses: Guesses, request: web.Request) -> web.StreamResponse | None:
    """Return why a request is refused, or the answer that turns a token in the address into a cookie."""
    if not access.is_our_host(request.headers.get('Host', '')):
        return _failure(403, 'this host name is not accepted; use the address that the dashboard printed')
    changes = request.method != 'GET' or request.path == '/ws'
    if changes and not access.is_our_origin(request.headers):
        return _failure(403, 'the request comes from another page; use the page of the dashboard')
    address = request.remote or ''
    if access.token and (wait_s := guesses.wait_s(address)):
        return _failure(429, f'too many wrong tokens came from {address}; the next is checked in {wait_s:.0f} s')
    given = request.query.get('token', '')
    if request.path == '/' and given and access.token and access.knows(given):
        answer = web.Response(status=303, headers={'Location': '/'})
        answer.set_cookie(COOKIE, given, httponly=True, samesite='Strict')
        return answer
    carried = request.cookies.get(COOKIE, '') or request.headers.get('Authorization', '').removeprefix('Bearer ')
    if not access.knows(carried):
        if given or carried:
            guesses.note(address, f'{given} {carried}')  # both were checked
        return _failure(401, 'this page needs its token: open the address that the dashboard printed, with ?token=')
    return None


def _command(command: Callable[[Mapping[str, Any]], Awaitable[Answer]], identity: str) -> Handler:
    async def act(request: web.Request) -> web.StreamResponse:
        # Another page could send a form without asking; it cannot send JSON.
        if request.content_type != 'application/json':
            return _failure(415, f'the request is {request.content_type}; application/json is needed')
        try:
            asked = parse_json((await asyncio.wait_for(request.read(), REQUEST_S)).decode())
            json.dumps(asked, ensure_ascii=False).encode()  # half a character, '\ud800', is a ValueError here
        except asyncio.TimeoutError:
            return _failure(408, f'the request was not complete within {REQUEST_S:g} s')
        except ValueError:
            return _failure(400, 'the request is not JSON in UTF-8')
        if not isinstance(asked, dict):
            return _failure(400, 'the request is not a JSON object')
        try:
            if request.query.get('dashboard', identity) != identity:
                raise InvalidParameter(f'this address now belongs to another dashboard ({identity}): reload the page')
            return web.json_response(await command(asked))
        except TextureError as error:
            return _failure(409, str(error))

    return act


def _failure(status: int, message: str) -> web.Response:
    return web.json_response({'success': False, 'message': message}, status=status)


# --------------------
# The web server in a separate thread of the process.


class Serving:
    """Serve an application until closed."""

    def __init__(self, app: web.Application, host: str, port: int) -> None:
        self._app = app
        self._loop = asyncio.new_event_loop()
        self._closing = asyncio.Event()
        self._started: concurrent.futures.Future[int] = concurrent.futures.Future()
        self._thread = threading.Thread(
            target=self._loop.run_until_complete, args=(self._serve(host, port),), name='web server'
        )
        self._thread.start()
        try:
            self.port = self._started.result()
        except OSError as error:
            self._thread.join()
            self._loop.close()
            raise LaunchFailed(
                f"the dashboard cannot listen on '{host}' port {port}: {error.strerror or error}; "
                'choose another host or port, in a launch by dashboard_port:='
            ) from error

    @property
    def watched(self) -> bool:
        """Whether a page is open."""
        return bool(self._app[VIEWERS].sockets)

    def show(self, frame: str) -> None:
        """Give a frame to all viewers; never waits for them."""
        self._loop.call_soon_threadsafe(self._app[VIEWERS].show, frame)

    def close(self) -> None:
        """Close all connections, and join the thread and its workers: none may use ROS while that is shut down."""
        self._loop.call_soon_threadsafe(self._closing.set)
        self._thread.join()
        self._loop.close()

    async def _serve(self, host: str, port: int) -> None:
        runner = web.AppRunner(self._app, shutdown_timeout=1.0, access_log=None)
        await runner.setup()
        try:
            await web.TCPSite(runner, host, port).start()
            self._started.set_result(int(runner.addresses[0][1]))
            silent = self._loop.create_task(self._close_silent(runner))
            await self._closing.wait()
            silent.cancel()
        except OSError as error:
            self._started.set_exception(error)
        finally:
            await runner.cleanup()
            await self._loop.shutdown_default_executor()

    async def _close_silent(self, runner: web.AppRunner) -> None:
        """Close each connection whose next request does not come in time."""
        since_s: dict[Any, float] = {}
        while True:
            await asyncio.sleep(LOOK_S)
            now_s, server = self._loop.time(), runner.server
            waiting = [one for one in (server.connections if server else ()) if one not in self._app[BUSY]]
            since_s = {one: since_s.get(one, now_s) for one in waiting}
            for one, begun_s in since_s.items():
                if now_s - begun_s > REQUEST_S:
                    one.force_close()
