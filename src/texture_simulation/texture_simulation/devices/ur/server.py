"""The network of the emulated controller, and its clock.

One thread: it sleeps until the next cycle is due, looks what has come, lets the controller do its cycles, and sends.
"""

from __future__ import annotations

import selectors
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Protocol

from texture_core.errors import DeviceError
from texture_core.finger_state import FingerSender, FingerState
from texture_simulation.devices.ur.controller import EmulatedController
from texture_simulation.devices.ur.dashboard import DashboardSession
from texture_simulation.devices.ur.rtde import InputClaims, RtdeSession
from texture_simulation.devices.ur.script import ScriptSession
from texture_simulation.devices.ur.tables import DASHBOARD_PORT, RTDE_PORT, SCRIPT_PORT

# That are made up for; a process that was held up for longer has lost the time. Meanwhile it hears no commands, and no
# real controller moves for longer than its watchdog waits without one.
MAX_MISSED_CYCLES = 50
CHUNK = 65536


class Session(Protocol):
    """One conversation."""

    def greeting(self) -> bytes:
        """Return what the server says first."""

    def receive(self, data: bytes) -> bytes:
        """Take over what came; return the answer."""

    def package(self) -> bytes:
        """Return what is sent unasked in this cycle."""

    def close(self) -> None:
        """End it."""


class Server:
    """Serve a controller on its ports.

    Raises
    ------
    DeviceError
        If a port cannot be opened.
    """

    def __init__(self, controller: EmulatedController, ip: str, finger_port: int) -> None:
        self._controller = controller
        self._ip = ip
        claims = InputClaims()
        self._kinds: dict[int, Callable[[], Session]] = {
            RTDE_PORT: partial(RtdeSession, controller, claims),
            SCRIPT_PORT: partial(ScriptSession, controller),
        }
        if controller.version.dashboard:
            self._kinds[DASHBOARD_PORT] = partial(DashboardSession, controller, self._go_offline, self._go_silent)
        self._selector = selectors.DefaultSelector()
        self._listeners: list[socket.socket] = []
        self._sessions: dict[socket.socket, Session] = {}
        self._online_ns = 0
        self._offline_s = 0.0  # asked for
        self._silent_until_ns = 0
        self._finger = FingerReport(controller, finger_port)
        self._open()

    def run(self, stopped: Callable[[], bool]) -> None:
        """Serve until told to stop."""
        step_ns = round(self._controller.step_s * 1e9)
        due_ns = time.monotonic_ns()
        while not stopped():
            time.sleep(max(0, due_ns - time.monotonic_ns()) * 1e-9)
            missed = max(0, time.monotonic_ns() - due_ns) // step_ns
            due_ns += (1 + missed) * step_ns
            self._serve()
            for _ in range(min(missed, MAX_MISSED_CYCLES)):
                self._controller.catch_up()
            self._controller.tick()
            self._publish()

    def close(self) -> None:
        """Close all ports and connections."""
        for connection in list(self._sessions):
            self._hang_up(connection)
        for listener in self._listeners:
            self._selector.unregister(listener)
            listener.close()
        self._listeners = []

    def _open(self) -> None:
        for port, make_session in self._kinds.items():
            try:
                listener = socket.create_server((self._ip, port), backlog=8)
            except OSError as error:
                self.close()
                raise DeviceError(
                    f'the emulated UR controller cannot listen on {self._ip}:{port}: {error}; give each controller '
                    "a loopback address of its own, such as '127.0.0.3'"
                ) from error
            listener.setblocking(False)
            self._listeners.append(listener)
            self._selector.register(listener, selectors.EVENT_READ, partial(self._accept, listener, make_session))

    def _go_offline(self, seconds: float) -> None:
        self._offline_s = seconds

    def _go_silent(self, seconds: float) -> None:
        self._silent_until_ns = time.monotonic_ns() + int(seconds * 1e9)

    @property
    def _silent(self) -> bool:
        return time.monotonic_ns() < self._silent_until_ns

    def _serve(self) -> None:
        """Deal with what has come."""
        if self._silent:
            return
        for key, _ in self._selector.select(timeout=0):
            key.data()
        if self._offline_s:
            self.close()
            self._online_ns = time.monotonic_ns() + int(self._offline_s * 1e9)
            self._offline_s = 0.0
        if not self._listeners and time.monotonic_ns() >= self._online_ns:
            self._open()

    def _accept(self, listener: socket.socket, make_session: Callable[[], Session]) -> None:
        with suppress(BlockingIOError):
            connection, _ = listener.accept()
            connection.setblocking(False)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            session = self._sessions[connection] = make_session()
            self._selector.register(connection, selectors.EVENT_READ, partial(self._receive, connection, session))
            self._send(connection, session.greeting())

    def _receive(self, connection: socket.socket, session: Session) -> None:
        try:
            data = connection.recv(CHUNK)
        except OSError:
            data = b''
        if data:
            self._send(connection, session.receive(data))
        else:
            self._hang_up(connection)

    def _publish(self) -> None:
        if not self._silent:
            for connection, session in list(self._sessions.items()):
                self._send(connection, session.package())
        self._finger.send()

    def _send(self, connection: socket.socket, data: bytes) -> None:
        """Send all of it, or hang up on a client that does not read."""
        if not data:
            return
        try:
            sent = connection.send(data)
        except OSError:
            sent = 0
        if sent < len(data):
            self._hang_up(connection)

    def _hang_up(self, connection: socket.socket) -> None:
        session = self._sessions.pop(connection, None)
        if session is not None:
            self._selector.unregister(connection)
            session.close()
            connection.close()


class FingerReport:
    """Sends the finger state to the emulator in every cycle; nothing if the port is 0."""

    def __init__(self, controller: EmulatedController, port: int) -> None:
        self._controller = controller
        self._emulator = FingerSender(port)

    def send(self) -> None:
        """Send one datagram."""
        robot = self._controller.robot
        x, y, z = (robot.pose[:3] - robot.surface.origin).tolist()
        vx, vy, vz = robot.velocity[:3].tolist()
        self._emulator.send(FingerState(time.monotonic_ns(), x, y, z, vx, vy, vz, robot.pressing_n))
