"""The web server in a thread of its own, beside whatever else the process does."""

from __future__ import annotations

import asyncio
import concurrent.futures
import threading

from aiohttp import web

from texture_bringup.dashboard.server import VIEWERS
from texture_core.errors import LaunchFailed

CLOSING_S = 5.0


class Serving:
    """Serve an application until closed.

    Raises
    ------
    LaunchFailed
        If the port cannot be had.
    """

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
                f"the dashboard cannot listen on '{host}' port {port}: {error.strerror or error}; choose another port"
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
        self._thread.join(CLOSING_S)

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
