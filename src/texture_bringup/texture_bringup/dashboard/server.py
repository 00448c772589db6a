"""The web server of the dashboard: static page, a WebSocket of frames, a few commands. Knows no ROS."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

from aiohttp import WSCloseCode, web

from texture_bringup.dashboard.access import COOKIE, Access
from texture_core.errors import TextureError
from texture_core.plain_data import parse_json

MAX_BODY_BYTES = 4096
MAX_MESSAGE_BYTES = 1024
MAX_VIEWERS = 16
HEARTBEAT_S = 10.0
CLOSING_S = 1.0
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


class Commands(Protocol):
    """What the page can ask for; a TextureError is shown to the user."""

    async def explore(self, asked: Mapping[str, Any]) -> Answer:
        """Explore until it is over."""

    async def stop(self, asked: Mapping[str, Any]) -> Answer:
        """Stop what moves."""

    async def add(self, asked: Mapping[str, Any]) -> Answer:
        """Add an exploration, or undo it."""

    async def record(self, asked: Mapping[str, Any]) -> Answer:
        """Begin or end a recording."""

    async def offered(self) -> Answer:
        """Return the motions with their numbers."""

    def replay(self, exploration_id: str) -> str | None:
        """Return the kept frames of an exploration as JSON; None if it is not kept."""


class Viewers:
    """The newest frame for everybody who looks; who is slow misses frames and keeps nobody waiting."""

    def __init__(self) -> None:
        self._frame = ''
        self.number = 0
        self._news = asyncio.Event()
        self.sockets: set[web.WebSocketResponse] = set()

    def show(self, frame: str) -> None:
        """Replace the frame; called in the loop of the server."""
        self._frame, self.number = frame, self.number + 1
        self._news.set()
        self._news = asyncio.Event()

    async def send_to(self, socket: web.WebSocketResponse, sent: int) -> None:
        """Send the newest frame after number `sent`, again and again, until the socket closes."""
        while not socket.closed:
            if sent == self.number:
                await self._news.wait()
            sent = self.number
            await socket.send_str(self._frame)


VIEWERS: web.AppKey[Viewers] = web.AppKey('viewers', Viewers)


def make_app(commands: Commands, access: Access, page: Path) -> web.Application:
    """Return the application; `page` is the folder of the static files.

    Parameters
    ----------
    commands
        Carries out what the page asks for.
    access
        Who may ask for what.
    page
        Folder of the static files.

    Returns
    -------
    web.Application
        Not started yet.
    """
    app = web.Application(middlewares=[_guard(access)], client_max_size=MAX_BODY_BYTES)
    viewers = app[VIEWERS] = Viewers()
    app.router.add_get('/ws', _watch(viewers))
    app.router.add_get('/api/motions', _motions(commands))
    app.router.add_get('/api/past/{id}', _past(commands))
    for name in ('explore', 'stop', 'add', 'record'):
        app.router.add_post(f'/api/{name}', _command(getattr(commands, name)))
    for path, (file, kind) in PAGE.items():
        app.router.add_get(path, _static(page / file, kind))
    app.on_shutdown.append(_close_sockets)
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


def _token_of(request: web.Request) -> str:
    return request.cookies.get(COOKIE, '') or request.headers.get('Authorization', '').removeprefix('Bearer ')


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
    if not access.knows(_token_of(request)):
        return _said(401, 'this page needs its token: open the address that the dashboard printed, with ?token=')
    return None


def _watch(viewers: Viewers) -> Handler:
    async def watch(request: web.Request) -> web.StreamResponse:
        if len(viewers.sockets) >= MAX_VIEWERS:
            return _said(503, f'{MAX_VIEWERS} pages are open already; close one')
        before = viewers.number  # old by now, as no frames are made while nobody looks
        socket = web.WebSocketResponse(heartbeat=HEARTBEAT_S, max_msg_size=MAX_MESSAGE_BYTES, timeout=CLOSING_S)
        await socket.prepare(request)
        viewers.sockets.add(socket)
        sending = asyncio.create_task(viewers.send_to(socket, before))
        try:
            async for _ in socket:  # a page says nothing; this notices when it goes
                pass
        finally:
            viewers.sockets.discard(socket)
            sending.cancel()
            await asyncio.gather(sending, return_exceptions=True)
        return socket

    return watch


def _command(command: Callable[[Mapping[str, Any]], Awaitable[Answer]]) -> Handler:
    async def act(request: web.Request) -> web.StreamResponse:
        # Another page could send a form without asking; it cannot send JSON.
        if request.content_type != 'application/json':
            return _said(415, f'the request is {request.content_type}; application/json is needed')
        try:
            asked = parse_json(await request.text())
        except ValueError:
            return _said(400, 'the request is no JSON')
        if not isinstance(asked, dict):
            return _said(400, 'the request is no JSON object')
        try:
            return web.json_response(await command(asked))
        except TextureError as error:
            return _said(409, str(error))

    return act


def _motions(commands: Commands) -> Handler:
    async def motions(_request: web.Request) -> web.StreamResponse:
        return web.json_response(await commands.offered())

    return motions


def _past(commands: Commands) -> Handler:
    async def past(request: web.Request) -> web.StreamResponse:
        replay = commands.replay(request.match_info['id'])
        if replay is None:
            return _said(404, 'this exploration is no longer kept')
        return web.Response(text=replay, content_type='application/json')

    return past


def _static(file: Path, kind: str) -> Handler:
    async def static(_request: web.Request) -> web.StreamResponse:
        return web.Response(text=file.read_text(encoding='utf-8'), content_type=kind, charset='utf-8')

    return static


def _said(status: int, message: str) -> web.Response:
    return web.json_response({'success': False, 'message': message}, status=status)


async def _close_sockets(app: web.Application) -> None:
    for socket in tuple(app[VIEWERS].sockets):
        await socket.close(code=WSCloseCode.GOING_AWAY)
