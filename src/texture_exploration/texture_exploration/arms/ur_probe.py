"""Find out in plain Python, within a fixed time, whether a UR controller is there and ready.

ur-rtde waits without a limit for a controller that does not answer; so it is only told to connect where one does.
"""

from __future__ import annotations

import struct
import time
from contextlib import closing

from texture_core.errors import DeviceError
from texture_exploration.arms.tcp_connection import TcpConnection
from texture_exploration.arms.ur_tables import (
    CONTROLLER_VERSION,
    DASHBOARD_BANNER,
    DASHBOARD_PORT,
    DATA,
    FIRST_WITH_REMOTE_CONTROL,
    FIRST_WITHOUT_DASHBOARD,
    OLDEST,
    PROTOCOL_VERSION,
    REQUEST_VERSION,
    RTDE_PORT,
    SETUP_INPUTS,
    SETUP_OUTPUTS,
    START,
)

HEADER = struct.Struct('>HB')
STATE = struct.Struct('>BI')  # recipe, runtime state
RUNTIME_HZ = 10.0
FREE_MODES = ('NORMAL', 'REDUCED')
UNLOCK_WAIT_S = 8.0  # the controller refuses for 5 s
UNLOCK_RETRY_S = 0.25


def rtde_version(ip: str, timeout_s: float) -> tuple[int, int]:
    """Return the major and minor version of the controller.

    Raises
    ------
    DeviceError
        If there is none, or it does not answer in time.
    """
    with closing(TcpConnection(ip, RTDE_PORT, timeout_s)) as line:
        _ask(line, REQUEST_VERSION, struct.pack('>H', PROTOCOL_VERSION))
        answer = _ask(line, CONTROLLER_VERSION, b'')
    if len(answer) < 8:
        raise DeviceError(f'{ip}:{RTDE_PORT} does not tell its version; is it a UR controller?')
    major, minor = struct.unpack_from('>2I', answer)
    return major, minor


def runtime_state(ip: str, timeout_s: float) -> int:
    """Return the runtime state of the controller: 1 if no program runs or pauses.

    Raises
    ------
    DeviceError
        If it does not answer in time.
    """
    with closing(TcpConnection(ip, RTDE_PORT, timeout_s)) as line:
        _ask(line, REQUEST_VERSION, struct.pack('>H', PROTOCOL_VERSION))
        _ask(line, SETUP_OUTPUTS, struct.pack('>d', RUNTIME_HZ) + b'runtime_state')
        _ask(line, START, b'')
        data = _await(line, DATA)
    if len(data) != STATE.size:
        raise DeviceError(f'{ip}:{RTDE_PORT} does not tell whether a program runs; is it a UR controller?')
    state: int
    _, state = STATE.unpack(data)
    return state


def claims_register(ip: str, name: str, timeout_s: float) -> bool:
    """Return whether an input register is free, by claiming it for a moment.

    Parameters
    ----------
    ip
        Address of the controller.
    name
        Name of the input register, such as 'input_double_register_24'.
    timeout_s
        Longest time to wait for the answers.

    Returns
    -------
    bool
        False if another program writes the register.

    Raises
    ------
    DeviceError
        If the controller does not answer in time.
    """
    with closing(TcpConnection(ip, RTDE_PORT, timeout_s)) as line:
        _ask(line, REQUEST_VERSION, struct.pack('>H', PROTOCOL_VERSION))
        return b'IN_USE' not in _ask(line, SETUP_INPUTS, name.encode())


def _ask(line: TcpConnection, kind: int, payload: bytes) -> bytes:
    """Send a message and return the payload of the answer of the same type."""
    line.send(HEADER.pack(HEADER.size + len(payload), kind) + payload)
    return _await(line, kind)


def _await(line: TcpConnection, kind: int) -> bytes:
    """Return the payload of the next message of a type; others, such as texts, are passed over."""
    while True:
        size, answered = HEADER.unpack(line.read(HEADER.size))
        answer = line.read(max(0, size - HEADER.size))
        if answered == kind:
            return answer


class DashboardClient(TcpConnection):
    """The dashboard server of a controller: a line is asked, a line is answered."""

    def __init__(self, ip: str, timeout_s: float) -> None:
        super().__init__(ip, DASHBOARD_PORT, timeout_s)
        try:
            banner = self.read_line()
            if DASHBOARD_BANNER not in banner:
                raise DeviceError(f"{self._where} greets with '{banner}' and not as the dashboard of a UR controller")
        except DeviceError:
            self.close()
            raise

    def ask(self, line: str) -> str:
        """Return the answer to a command."""
        self.send(line.encode() + b'\n')
        return self.read_line()


def check_ready(ip: str, timeout_s: float, unlock: bool) -> tuple[int, int]:
    """Return the version of a controller whose arm can move; release a protective stop if `unlock` says so.

    Parameters
    ----------
    ip
        Address of the controller.
    timeout_s
        Longest time for all questions and answers.
    unlock
        Whether a protective stop is released.

    Returns
    -------
    (int, int)
        Version of the controller, such as (5, 12).

    Raises
    ------
    DeviceError
        With what stands in the way, and what to do.
    """
    end_s = time.monotonic() + timeout_s
    version = rtde_version(ip, timeout_s)
    _check_version(ip, version)
    if version[0] >= FIRST_WITHOUT_DASHBOARD:
        return version
    with closing(DashboardClient(ip, max(0.1, end_s - time.monotonic()))) as dashboard:
        mode = dashboard.ask('robotmode')
        if 'RUNNING' not in mode:
            raise DeviceError(f"the arm at {ip} answers '{mode}'; switch it on and release its brakes")
        if version >= FIRST_WITH_REMOTE_CONTROL and 'true' not in dashboard.ask('is in remote control'):
            raise DeviceError(f'the arm at {ip} is under local control; switch the pendant to remote control')
        safety = _safety(dashboard)
    if safety in FREE_MODES:
        return version
    if safety != 'PROTECTIVE_STOP' or not unlock:
        raise DeviceError(
            f'the arm at {ip} is held by its safety system ({safety}); find out why, release it on the pendant, '
            'and ask again'
        )
    unlock_protective_stop(ip, timeout_s)
    return version


def _check_version(ip: str, version: tuple[int, int]) -> None:
    oldest = OLDEST.get(version[0], min(OLDEST.values()))
    if version < oldest:
        raise DeviceError(
            f'the controller at {ip} has the software {version[0]}.{version[1]}, which is too old for force control, '
            f'zeroing of the force sensor or the watchdog; update it to {oldest[0]}.{oldest[1]} or newer'
        )


def unlock_protective_stop(ip: str, timeout_s: float) -> None:
    """Release a protective stop, as soon as the controller allows it.

    Raises
    ------
    DeviceError
        If it does not.
    """
    end_s = time.monotonic() + UNLOCK_WAIT_S
    while True:
        with closing(DashboardClient(ip, timeout_s)) as dashboard:
            if _safety(dashboard) in FREE_MODES:
                return
            answer = dashboard.ask('unlock protective stop')
        if time.monotonic() > end_s:
            raise DeviceError(f"the controller at {ip} does not release the protective stop: '{answer}'")
        time.sleep(UNLOCK_RETRY_S)


def _safety(dashboard: DashboardClient) -> str:
    """Return the safety mode, such as NORMAL."""
    return dashboard.ask('safetymode').rpartition(' ')[2]
