# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""An arm of Universal Robots, through ur-rtde in a separate process."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.util
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import NamedTuple

from texture_core.config import param
from texture_core.errors import DeviceError
from texture_core.types import loopback_address
from texture_exploration.arms.arm import (
    STANDSTILL,
    ArmCommand,
    ArmState,
    SurfaceArm,
    SurfacePoseParams,
    Vector,
    ZeroingParams,
    claim,
    give_up_when_ending,
)

# --------------------
# Messages between the arm and its worker process: datagrams of JSON on a socket pair. To the worker goes a command, or
# null to stop; from it comes a report, or why it ended as text.

LARGEST = 4096


class UrCommand(NamedTuple):
    """Command to the arm in the base frame: a velocity, (3,), and perhaps a force that presses on the surface.

    `time_ns` is when it was commanded, of CLOCK_MONOTONIC: a command that waited for the worker is old.
    """

    time_ns: int
    velocity_m_s: Vector
    force_n: float | None


class UrReport(NamedTuple):
    """Newest measurement of the controller, in the base frame, and its status.

    `time_ns` is when it arrived, of CLOCK_MONOTONIC. `force_n` is the force of the surroundings on the tool; `zeroed`
    says that its sensor was zeroed since the arm was connected. `watchdog_s` is how long the controller's
    watchdog waits. `refused` is the command that the controller refused last, '' if none since the arm was connected.
    """

    time_ns: int
    position_m: Vector
    velocity_m_s: Vector
    force_n: Vector
    watchdog_s: float
    safety_mode: int
    playing: bool
    zeroed: bool
    refused: str = ''


# --------------------
# Parameters of an arm of Universal Robots.


@dataclass(frozen=True)
class UrArmParams(ZeroingParams, SurfacePoseParams):
    """Address of the controller, pose of the surface, and supervision of the arm."""

    ip: str = param('127.0.0.2', 'IP address of the controller; the default, and a path, are of the emulated one.')
    command_timeout_s: float = param(
        0.2, 'How long a command holds without a new one; afterwards the arm stops.', unit='s', low=0.02, high=2.0
    )
    watchdog_hz: float = param(
        10.0, 'Rate of commands below which the controller stops the arm.', unit='Hz', low=1.0, high=50.0
    )
    connect_timeout_s: float = param(
        10.0, 'How long the arm may take to be ready before connecting fails.', unit='s', low=0.5, high=60.0
    )


RATE_HZ = 250.0  # of commands and states: half of that of an e-Series
DELAY_S = 0.02  # from a force to the motion that responds to it: walls were pressed with 26 to 40 N at 50 mm/s
# Time that a controller may take to stop, to end force control and to zero; its watchdog waits as long.
ACKNOWLEDGE_S = 1.0
PROBE_S = 1.5  # time that it may take to answer the first requests

# --------------------
# The worker process, for its parent: start it, exchange messages with it, end it.

MODULE = 'texture_exploration.arms.ur_worker'
STOPPING_S = 1.5 + 2 * ACKNOWLEDGE_S  # to brake, and for the acknowledgements of a stop and of the end of force control
FINAL_MESSAGE_S = 0.05


class WorkerLink:
    """One worker process, from its start to its end."""

    def __init__(self, params: UrArmParams, lock: int) -> None:
        self.report: UrReport | None = None
        self._failure = ''
        self._timeout_s = params.connect_timeout_s
        self._state_received = threading.Event()
        self._channel, end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        command = [sys.executable, '-m', MODULE, str(end.fileno()), json.dumps(dataclasses.asdict(params))]
        with end:
            self.process = subprocess.Popen(
                command, pass_fds=[end.fileno(), lock], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
            )
        self._reader = threading.Thread(target=self._read, name='ur_link', daemon=True)
        self._reader.start()

    def wait_for_report(self) -> None:
        """Return when the first report has come."""
        end_s = time.monotonic() + self._timeout_s
        while not self._state_received.wait(POLL_S):
            give_up_when_ending()
            if time.monotonic() > end_s:
                raise DeviceError(
                    f'the controller did not let the arm be ready within {self._timeout_s:g} s; '
                    'look at its pendant, and restart it if it hangs'
                )
        self.check()

    def check(self) -> None:
        """Return if the worker is running."""
        if not self._reader.is_alive() or self.report is None:
            raise DeviceError(self._why_ended())

    def send(self, command: UrCommand | None) -> None:
        """Send a command to the worker, or that it is to stop, without waiting.

        A worker that does not read gets no more: commands expire, and the age of its report shows whether it hangs.
        """
        try:
            self._channel.send(json.dumps(command).encode(), socket.MSG_DONTWAIT)
        except BlockingIOError as error:
            if command is None:
                raise DeviceError('the process that talks to the controller does not read a stop') from error
        except OSError as error:
            raise DeviceError(self._why_ended()) from error

    def end(self) -> None:
        """Stop the arm and end the worker; kill it if it does not end: then the watchdog stops the arm."""
        self._channel.shutdown(socket.SHUT_RDWR)
        try:
            self.process.wait(STOPPING_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._reader.join()
        self._channel.close()

    def _read(self) -> None:
        with contextlib.suppress(OSError):
            while data := self._channel.recv(LARGEST):
                content = json.loads(data)
                if isinstance(content, str):
                    self._failure = content
                else:
                    self.report = UrReport._make(content)
                    self._state_received.set()
        self._state_received.set()

    def _why_ended(self) -> str:
        self._reader.join(FINAL_MESSAGE_S)  # the last message of the worker may still be on its way
        if self._failure:
            return self._failure
        if self.process.poll() == -signal.SIGALRM:
            return 'the controller stopped answering in the middle of a command; look at its pendant, and connect again'
        return 'the process that talks to the controller ended; connect again'


# --------------------
# Facts about controllers of Universal Robots.
#
# Source: the RTDE guide and the dashboard guide of Universal Robots.

DASHBOARD_PORT = 29999
FIRST_WITH_REMOTE_CONTROL = (5, 6)
# Oldest software by series: the oldest CB3 that ur-rtde 1.6.5 is tested with (its README); an e-Series with remote
# control.
OLDEST: Mapping[int, tuple[int, int]] = {3: (3, 12), 5: (5, 6)}
CB3 = 3  # the series without a force sensor in the flange

PROGRAM_PLAYING = 2  # runtime_state

# safety_mode -> why the arm cannot move; what is not listed lets it move
SAFETY_FAULTS: Mapping[int, str] = {
    3: 'protective stop',
    4: 'recovery mode',
    5: 'safeguard stop',
    6: 'emergency stop of the system',
    7: 'emergency stop of the robot',
    8: 'violation of a safety limit',
    9: 'fault of the safety system',
    10: 'a joint must be validated',
    11: 'undefined safety mode',
    12: 'safeguard stop of the automatic mode',
    13: 'three-position enabling stop',
}


# --------------------
# Check in plain Python, within a fixed time, whether a UR controller is present and ready.
#
# ur-rtde waits without a limit for a controller that does not answer; so it only connects to one that does.

FREE_MODES = ('NORMAL', 'REDUCED')
UNLOCK_WAIT_S = 8.0  # the controller refuses for 5 s
UNLOCK_RETRY_S = 0.25


@contextmanager
def dashboard(ip: str) -> Iterator[Callable[[str], str]]:
    """Ask the dashboard server of a controller: one line per request, one line per answer, all within `PROBE_S`."""
    where, end_s = f'{ip}:{DASHBOARD_PORT}', time.monotonic() + PROBE_S
    try:
        connection = socket.create_connection((ip, DASHBOARD_PORT), PROBE_S)
    except OSError as error:
        if not isinstance(error, ConnectionRefusedError):
            what = "is the controller on, and is parameter 'ip' its address?"
            raise DeviceError(f'{where} cannot be reached: {error}; {what}') from error
        raise DeviceError(
            f"nothing listens on {where}; is the controller on, and is parameter 'ip' its address? For "
            "PolyScope X, which has no dashboard, use the arm 'ros_controllers' with ur_robot_driver"
        ) from error

    def ask(request: str) -> str:
        line = b''
        with contextlib.suppress(OSError):
            connection.sendall(request.encode())
            while not line.endswith(b'\n'):
                connection.settimeout(max(0.001, end_s - time.monotonic()))
                if not (byte := connection.recv(1)):
                    break
                line += byte
        if not line.endswith(b'\n'):
            raise DeviceError(
                f'{where} takes connections but does not answer as a UR controller within {PROBE_S:g} s; '
                "wait until it has started, restart it, or correct parameter 'ip'"
            )
        return line.decode('utf-8', 'replace').strip()

    with connection:
        ask('')  # its greeting
        yield lambda request: ask(request + '\n')


def check_ready(ip: str) -> tuple[int, int]:
    """Return the version of a controller whose arm can move."""
    with dashboard(ip) as ask:
        version = _checked_version(ip, ask('PolyscopeVersion'))
        mode = ask('robotmode')
        if 'RUNNING' not in mode:
            raise DeviceError(f"the arm at {ip} answers '{mode}'; switch it on and release its brakes")
        if version >= FIRST_WITH_REMOTE_CONTROL and 'true' not in ask('is in remote control'):
            raise DeviceError(f'the arm at {ip} is under local control; switch the pendant to remote control')
        safety = _safety(ask)
    if safety not in FREE_MODES:
        raise DeviceError(
            f'the arm at {ip} is held by its safety system ({safety}); find the cause, release it on the '
            'pendant, and repeat the request'
        )
    return version


def _checked_version(ip: str, answer: str) -> tuple[int, int]:
    """Return the major and minor version in an answer such as 'URSoftware 5.12.2.1101534 (Nov 02 2022)'."""
    numbers = re.search(r'(\d+)\.(\d+)', answer)
    if numbers is None:
        raise DeviceError(
            f"the controller at {ip} answers '{answer}' when asked for its version; is it a UR controller?"
        )
    version = int(numbers[1]), int(numbers[2])
    oldest = OLDEST.get(version[0], min(OLDEST.values()))
    if version < oldest:
        raise DeviceError(
            f'the controller at {ip} has the software {version[0]}.{version[1]}, which is too old for force control, '
            f'zeroing of the force sensor or the watchdog; update it to {oldest[0]}.{oldest[1]} or newer'
        )
    return version


def unlock_protective_stop(ip: str) -> None:
    """Release a protective stop, as soon as the controller allows it."""
    end_s = time.monotonic() + UNLOCK_WAIT_S
    while True:
        with dashboard(ip) as ask:
            if _safety(ask) in FREE_MODES:
                return
            answer = ask('unlock protective stop')
        if time.monotonic() > end_s:
            raise DeviceError(f"the controller at {ip} does not release the protective stop: '{answer}'")
        time.sleep(UNLOCK_RETRY_S)


def _safety(ask: Callable[[str], str]) -> str:
    """Return the safety mode, such as NORMAL."""
    return ask('safetymode').rpartition(' ')[2]


# --------------------
# Make sure that connecting stops no program of another user on a UR controller: ur-rtde stops any program.

SAMPLE_PERIOD_S = 0.05
UR_PROGRAM_STOPPING_S = 2.0
WATCHDOG_S = 0.5  # in addition to its period, until it has ended a program


def check_program(params: UrArmParams, *, pause_is_ours: bool) -> None:
    """Return if no program runs or pauses on the controller.

    A stop by the safety system may pause the program of the connection before: `pause_is_ours`, and is stopped. A
    control script of ours whose process was killed is ended by its watchdog.
    """
    ip = params.ip
    end_s = time.monotonic() + max(ACKNOWLEDGE_S, 1.0 / params.watchdog_hz) + WATCHDOG_S
    while program := _program(ip):
        if pause_is_ours and program.upper().startswith('PAUSED'):
            with dashboard(ip) as ask:
                ask('stop')
            pause_is_ours, end_s = False, time.monotonic() + UR_PROGRAM_STOPPING_S
        elif time.monotonic() > end_s:
            raise DeviceError(
                f"another program is on the controller at {ip} ('{program}'), and connecting would stop it; stop it on "
                'the pendant'
            )
        time.sleep(SAMPLE_PERIOD_S)


def _program(ip: str) -> str:
    """Return the program that runs or pauses, as the controller reports it; '' if there is none."""
    with dashboard(ip) as ask:
        running, state = ask('running'), ask('programState')
    return state if 'true' in running.lower() or not state.upper().startswith('STOPPED') else ''


BASE_FRAME_ID = 'base'  # as in ur_robot_driver and the description of UR, without a prefix
POLL_S = 0.01


class UrArm(SurfaceArm):
    """A Universal Robots e-Series through ur-rtde; each wait for the controller has a timeout.

    Parameters
    ----------
    params
        The arm, the surface and the supervision.
    """

    Params = UrArmParams
    noisy_force = True  # in double precision
    _params: UrArmParams

    def __init__(self, params: UrArmParams = UrArmParams()) -> None:
        super().__init__(replace(params, ip=loopback_address(params.ip)))
        self._link: WorkerLink | None = None
        self._lock = -1  # on the address; also held by the worker, which stops the arm
        self._series = 0  # of the controller that was connected last
        self._paused = False  # a stop by the safety system may have left our program paused

    def check(self) -> None:
        """Ask the controller whether its arm can move; no program is started.

        Raises
        ------
        DeviceError
            If it cannot be reached, or its arm cannot move.
        """
        check_ready(self._params.ip)

    def connect(self) -> None:
        """Reach the controller and start its control program.

        Raises
        ------
        DeviceError
            If it cannot be reached, its arm cannot move, or a program of another user is there.
        """
        self.close()
        if importlib.util.find_spec('rtde_control') is None:
            raise DeviceError(
                "the arm 'ur' needs the package ur-rtde, which is not installed here: 'pip install ur-rtde==1.6.5'; "
                'it exists for Python up to 3.12 on Linux with an x86-64 processor'
            )
        params = self._params
        try:
            self._lock = claim(f'ur {params.ip}', STOPPING_S)
            version = check_ready(params.ip)
            check_program(params, pause_is_ours=self._paused)
            self._link, self._series = WorkerLink(params, self._lock), version[0]
            self._link.wait_for_report()
        except DeviceError:
            self.close()
            raise

    def warning(self) -> str:
        """Return in a sentence that a command was refused, or that a CB3 only estimates forces; '' if neither."""
        report = self._link and self._link.report
        if report and report.refused:
            return (
                f"the controller at {self._params.ip} refused '{report.refused}', which is sent again until it is "
                'taken; look at its pendant, then call `texture deactivate` and `texture activate`'
            )
        if self._series != CB3:
            return ''
        return (
            f'the controller at {self._params.ip} is a CB3, which estimates forces within about 10 N: the actual force '
            'may be far from the requested one; use an e-Series, or a force sensor in the flange'
        )

    def close(self) -> None:
        """Stop and end the worker process."""
        link, self._link = self._link, None
        if link is not None:
            self._paused = link.report is not None and link.report.safety_mode in SAFETY_FAULTS
            link.end()
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def state(self) -> ArmState:
        """Return the newest state."""
        report = self._report()
        frame = self._frame
        force = frame.direction(report.force_n)
        return ArmState(
            time_ns=report.time_ns,
            position=frame.place(report.position_m),
            velocity=frame.direction(report.velocity_m_s),
            force_n=force[2],
            fault=self._fault(report),
            watchdog_s=report.watchdog_s,
            along_n=force[:2],
            delay_s=DELAY_S,
        )

    def command(self, command: ArmCommand) -> None:
        """Send a command to the worker.

        The force sensor is zeroed in free air only, at rest after a rise of 3 mm without a change of the force.

        Raises
        ------
        CommandRefused
            If a number is not finite or out of its range, or a force is wanted before the force sensor was zeroed since
            the arm was connected; the arm stops.
        DeviceError
            If the arm cannot be reached.
        """
        self._check(command)
        if command == STANDSTILL:
            self.stop()
            return
        normal_m_s = command.normal_m_s if command.force_n is None else 0.0
        velocity = self._frame.to_base((*command.tangential_m_s, normal_m_s))
        self._connected().send(UrCommand(time.monotonic_ns(), velocity, command.force_n))

    def stop(self) -> None:
        """Let the worker stop the arm."""
        self._connected().send(None)

    def recover(self) -> None:
        """Release a protective stop; the arm is to be connected again, by a caller who makes sure that it may move.

        Raises
        ------
        DeviceError
            If the controller does not allow it.
        """
        self.close()
        unlock_protective_stop(self._params.ip)

    @property
    def base_frame_id(self) -> str:
        """Name of the base frame on tf."""
        return BASE_FRAME_ID

    @property
    def zeroed(self) -> bool:
        """Whether the force sensor was zeroed since the arm was connected."""
        return self._report().zeroed

    def _connected(self) -> WorkerLink:
        if self._link is None:
            raise DeviceError('the arm is not connected; connect it first')
        return self._link

    def _report(self) -> UrReport:
        link = self._connected()
        link.check()
        assert link.report is not None
        return link.report

    def _fault(self, report: UrReport) -> str:
        if report.safety_mode in SAFETY_FAULTS:
            return SAFETY_FAULTS[report.safety_mode]
        return '' if report.playing else 'its control program was stopped, by hand or by its watchdog'
