# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The process that talks to a UR controller at 250 Hz, its stream of commands and its watchdog."""

from __future__ import annotations

import contextlib
import enum
import importlib
import json
import os
import signal
import socket
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from texture_core.config import from_mapping
from texture_exploration.arms.arm import CALM_NS, ZERO_RISE_M, FreeAir, SurfaceFrame, Vector
from texture_exploration.arms.ur import (
    ACKNOWLEDGE_S,
    LARGEST,
    PROGRAM_PLAYING,
    RATE_HZ,
    UrArmParams,
    UrCommand,
    UrReport,
)
from texture_exploration.force_control import FORCE_SPEED_M_S

# --------------------
# The watchdog of the controller: it stops the arm without messages, and it waits while a command is executed.
#
# While ur-rtde waits until a command is acknowledged it sends nothing, so that the watchdog would stop the arm in the
# middle of a stop. Nor may anything else be sent then: it would overwrite the command.

MARGIN = 3.0  # of the period, over the time that the controller took to acknowledge the watchdog itself


class Watchdog:
    """Set the watchdog of the controller, and time the commands for which it has to wait."""

    def __init__(
        self,
        control: Any,
        params: UrArmParams,
        guard: Callable[[float], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.armed = False
        self._control = control
        self._period_s = self.moving_s = 1.0 / params.watchdog_hz
        self._patient_s = max(ACKNOWLEDGE_S, self._period_s)
        self._guard = guard
        self._clock = clock

    def arm(self) -> bool:
        """Let the watchdog guard a moving arm; return whether the controller agreed.

        A controller that acknowledges this late would be stopped by it at once: then it waits a little longer.
        """
        with self.patient():
            pass
        return self.armed

    @contextmanager
    def patient(self) -> Iterator[None]:
        """Let the watchdog wait during the block, and guard a moving arm again afterwards."""
        took_s = self._set(self._patient_s)
        self.armed = False
        try:
            yield
        finally:
            self.moving_s = max(self._period_s, min(MARGIN * took_s, self._patient_s))
            self._set(self.moving_s)

    def call(self, command: Callable[..., Any], *arguments: Any) -> bool:
        """Send a command that is acknowledged; return whether the controller accepted it."""
        self._guard(self._patient_s)
        return bool(command(*arguments))

    def _set(self, period_s: float) -> float:
        """Return the duration."""
        begin_s = self._clock()
        self.armed = self.call(self._control.setWatchdog, 1.0 / period_s)
        return self._clock() - begin_s


# --------------------
# Send commands to the arm through ur-rtde, one per cycle.
#
# All commands pass through the same registers of the controller, which its script reads every 2 ms. Commands that
# stream are not acknowledged: a second one would overwrite the first before it is read. So each cycle sends one of
# them, and commands that must hold are repeated.

ACCELERATION_M_S2 = 2.0  # towards a new velocity: 50 mm/s after 25 ms
# Force control about a fixed frame; the other axes may deviate by 0.1 m and 20°, as in PolyScope.
FORCE_FRAME_FIXED = 2
FORCE_DEVIATION_M = 0.1
FORCE_DEVIATION_RAD = 0.349
STOP_DECELERATION_M_S2 = 10.0  # the default of ur-rtde
TURN_NS = 100_000_000  # in which an arm has turned back


class Mode(enum.Enum):
    """Mode of the arm."""

    STANDSTILL = enum.auto()
    SPEED = enum.auto()
    FORCE = enum.auto()  # speed along the surface, force along its normal


class UrCommandStream:
    """Turn the newest command of the arm into calls of ur-rtde."""

    def __init__(self, control: Any, params: UrArmParams, watchdog: Watchdog) -> None:
        self.trusted = False
        self.refused = ''  # the command that the controller refused last
        self._control = control
        self._params = params
        self._watchdog = watchdog
        self._frame = SurfaceFrame(params.surface_pose)
        self._air = FreeAir(ZERO_RISE_M, params.zero_steady_n)
        self._measured_ns = self._rest_ns = 0
        self._mode = Mode.STANDSTILL
        self._braking = False
        self._next_is_speed = False
        self._led_m_s: Vector = (0.0, 0.0, 0.0)  # the newest velocity sent
        self._turned_ns = -TURN_NS

    def observe(self, time_ns: int, position_m: Vector, force_n: Vector) -> None:
        """Take the newest measurement of the controller, in the base frame."""
        self._measured_ns = time_ns
        self._air.update(time_ns, self._frame.place(position_m), self._frame.direction(force_n)[2])

    def cycle(self, ur_command: UrCommand | None) -> None:
        """Send what is due; None commands standstill, and so does a force before the force sensor is zeroed."""
        if ur_command is not None and ur_command.force_n is not None and not self.trusted:
            ur_command = None
        mode = Mode.STANDSTILL
        if ur_command is not None:
            mode = Mode.SPEED if ur_command.force_n is None else Mode.FORCE
        self._braking &= mode is Mode.STANDSTILL
        if mode is not self._mode and not self._change(mode, ur_command):
            return
        if mode is Mode.FORCE:
            self._air.presume_contact()
        if ur_command is None:
            self._hold_still()
        elif mode is Mode.FORCE:
            self._force(ur_command)
        else:
            self._speed(ur_command)

    def stand_still(self) -> bool:
        """Stop at once, and return when the arm is at rest, or with False when the controller refused.

        Commands that are acknowledged are not overwritten.
        """
        with self._watchdog.patient():
            rests = self._taken('speedStop', self._watchdog.call(self._control.speedStop, STOP_DECELERATION_M_S2))
            if self._mode is Mode.FORCE:
                rests &= self._end_force()
        if rests:
            self._mode = Mode.STANDSTILL
        return rests

    def _end_force(self) -> bool:
        """End force control; return whether the controller did: otherwise the finger still presses."""
        return self._taken('forceModeStop', self._watchdog.call(self._control.forceModeStop))

    def _taken(self, name: str, taken: bool) -> bool:
        if not taken:
            self.refused = name
        return taken

    def _change(self, mode: Mode, ur_command: UrCommand | None) -> bool:
        """Leave the present mode; return whether the new one has begun."""
        # A command that streams takes effect at once; those that follow wait for each other.
        if self._mode is Mode.FORCE and ur_command is not None and self._turns_back(ur_command.velocity_m_s):
            # The finger has met something, and would be driven into it until the end of force control is acknowledged.
            self._speed(ur_command._replace(velocity_m_s=self._along(ur_command.velocity_m_s)))
            return False
        if mode is Mode.STANDSTILL and not self._braking:
            self._braking = True
            self._control.speedL([0.0] * 6, STOP_DECELERATION_M_S2, 1.0 / RATE_HZ)
            return False
        # A mode that the controller refuses to leave is still there, and the next cycle tries again.
        if mode is Mode.STANDSTILL:
            if not self.stand_still():
                return False
        elif self._mode is Mode.FORCE:
            with self._watchdog.patient():
                ended = self._end_force()
            if not ended:
                return False
        # The watchdog guards every mode but standstill; at rest one that waits too long is set again.
        late = self._mode is Mode.STANDSTILL and self._watchdog.moving_s > 1.0 / self._params.watchdog_hz
        if mode is not Mode.STANDSTILL and (late or not self._watchdog.armed) and not self._watchdog.arm():
            return False
        self._mode = mode
        self._rest_ns = self._measured_ns
        self._braking = self._next_is_speed = False
        return True

    def _hold_still(self) -> None:
        """Zero the force sensor as soon as the arm has calmed down in free air."""
        if self._air.proven and self._measured_ns - self._rest_ns > CALM_NS:
            with self._watchdog.patient():
                taken = self._watchdog.call(self._control.zeroFtSensor)
            if taken:
                self.trusted = True
                self._air.presume_contact()  # the force is another one now; the next zeroing needs a new proof
            else:
                self._rest_ns = self._measured_ns  # free air is still proven: try again after another rest
        self._control.kickWatchdog()

    def _speed(self, ur_command: UrCommand) -> None:
        velocity = [*ur_command.velocity_m_s, 0.0, 0.0, 0.0]
        if self._turns_back(ur_command.velocity_m_s):
            self._turned_ns = self._measured_ns
        self._led_m_s = ur_command.velocity_m_s
        # A finger that turns back has met something: as hard as a stop.
        turns = self._measured_ns - self._turned_ns < TURN_NS
        self._control.speedL(velocity, STOP_DECELERATION_M_S2 if turns else ACCELERATION_M_S2, 1.0 / RATE_HZ)

    def _turns_back(self, velocity_m_s: Vector) -> bool:
        return sum(now * before for now, before in zip(velocity_m_s, self._led_m_s, strict=True)) < 0.0

    def _along(self, velocity_m_s: Vector) -> Vector:
        """Return the part of a velocity along the surface: force control still leads the other one."""
        x, y, _ = self._frame.direction(velocity_m_s)
        return self._frame.to_base((x, y, 0.0))

    def _force(self, ur_command: UrCommand) -> None:
        """Command force and sliding alternately."""
        self._next_is_speed = not self._next_is_speed
        if not self._next_is_speed:
            self._speed(ur_command)
            return
        normal_only = [0, 0, 1, 0, 0, 0]
        wrench = [0.0, 0.0, -(ur_command.force_n or 0.0), 0.0, 0.0, 0.0]
        limits = [*(FORCE_DEVIATION_M,) * 2, FORCE_SPEED_M_S, *(FORCE_DEVIATION_RAD,) * 3]
        frame = list(self._params.surface_pose)
        self._taken('forceMode', self._control.forceMode(frame, normal_only, wrench, FORCE_FRAME_FIXED, limits))


# --------------------
# The process that talks to the controller through ur-rtde, so that nothing ur-rtde waits for stops the node.
#
# The constructors of ur-rtde hold Python's global lock and wait without a limit, and a command may wait for minutes.
# Here an alarm of the kernel ends the process when it hangs; the watchdog of the controller then stops the arm. The
# process ends, with the arm at rest, when its parent is gone.

VARIABLES = ['timestamp', 'actual_TCP_pose', 'actual_TCP_speed', 'actual_TCP_force', 'safety_mode', 'runtime_state']
HANGING_S = 2.0  # no command takes longer
SILENT_S = 0.1  # without a state of the controller, after which it gets no more commands
LATE_S = 0.02
OTHER_PROGRAM = (
    'the program on the controller was stopped, and another user started one; check who uses the arm, and connect again'
)
MOST_CHARACTERS = 500  # of a reason
LOST = 'the connection to the controller was lost; is it still on, and the cable in place?'


class Observer:
    """Reports the measurements of the controller, in a separate thread: commands may take a while.

    `newest` is the last report, None before the first; `idle` is set by each in which no program plays; `zeroed`,
    `refused` and `watchdog_s` come from the other thread.

    Silence counts only while this thread is awake, so that a stalled machine is not reported as a dead controller.
    """

    def __init__(self, receive: Any, channel: socket.socket, params: UrArmParams) -> None:
        self.connected = True
        self.silent = self.zeroed = self.idle = False
        self.refused = ''
        self.watchdog_s = 1.0 / params.watchdog_hz
        self.newest: UrReport | None = None
        self._receive = receive
        self._channel = channel
        self._period_s = 1.0 / RATE_HZ
        self._stamp = -1.0
        self._silent_for_s = 0.0

    def run(self) -> None:
        """Check in every cycle for a new state."""
        last_s = time.monotonic()
        try:
            while self.connected and self._receive.isConnected():
                now_s = time.monotonic()
                self._poll(min(now_s - last_s, LATE_S))
                last_s = now_s
                time.sleep(self._period_s)  # the exact waitPeriod of ur-rtde burns processor time
        finally:
            self.connected = False

    def _poll(self, passed_s: float) -> None:
        stamp = self._receive.getTimestamp()
        self._silent_for_s += passed_s
        if stamp != self._stamp:
            self._stamp, self._silent_for_s = stamp, 0.0
            self._report()
        self.silent = self._silent_for_s > SILENT_S

    def _report(self) -> None:
        receive = self._receive
        report = UrReport(
            time_ns=time.monotonic_ns(),
            position_m=_vector(receive.getActualTCPPose()),
            velocity_m_s=_vector(receive.getActualTCPSpeed()),
            force_n=_vector(receive.getActualTCPForce()),
            watchdog_s=self.watchdog_s,
            safety_mode=receive.getSafetyMode(),
            playing=receive.getRuntimeState() == PROGRAM_PLAYING,
            zeroed=self.zeroed,
            refused=self.refused,
        )
        self.newest = report
        self.idle |= not report.playing
        try:
            self._channel.send(json.dumps(report).encode(), socket.MSG_DONTWAIT)
        except BlockingIOError:
            pass  # a parent that does not read has no use for old states
        except OSError:
            self.connected = False


class Worker:
    """Owns the interfaces of ur-rtde from the first to the last moment of the process."""

    def __init__(self, params: UrArmParams, channel: socket.socket) -> None:
        self._params = params
        self._channel = channel
        self._frame = SurfaceFrame(params.surface_pose)
        receive_class = importlib.import_module('rtde_receive').RTDEReceiveInterface
        control_class = importlib.import_module('rtde_control').RTDEControlInterface
        # Remote control has been checked already.
        flags = control_class.FLAG_UPLOAD_SCRIPT | control_class.FLAG_DISABLE_REMOTE_CONTROL_CHECK
        receive = receive_class(params.ip, RATE_HZ, VARIABLES)
        self._control = control_class(params.ip, RATE_HZ, flags)
        self._observer = Observer(receive, channel, params)
        self._watchdog = Watchdog(self._control, params, lambda seconds: set_alarm(seconds + HANGING_S))
        self._commands = UrCommandStream(self._control, params, self._watchdog)
        self._ur_command: UrCommand | None = None
        self._measured_ns = 0
        self._was_playing = False
        self._stopped = False  # the program was stopped, and not by us
        self._other_program = False  # and another one was started since

    def run(self) -> str:
        """Run until the parent or the controller is gone; return the reason in a sentence."""
        try:
            if not self._watchdog.arm():
                raise RuntimeError('the controller did not accept the watchdog, without which the arm does not move')
            threading.Thread(target=self._observer.run, name='observer', daemon=True).start()
            while self._receive_commands():
                if not (self._observer.connected and self._control.isConnected()):
                    return LOST
                self._watch_program()
                if self._other_program:
                    return OTHER_PROGRAM
                self._cycle()
        except RuntimeError as error:
            return f'{LOST} ({error})'
        finally:
            self._let_go()
        return ''

    def _cycle(self) -> None:
        begin = self._control.initPeriod()
        set_alarm(HANGING_S)
        # Take the newest measurement.
        newest, commands = self._observer.newest, self._commands
        if newest is not None and newest.time_ns != self._measured_ns:
            self._measured_ns = newest.time_ns
            commands.observe(newest.time_ns, newest.position_m, newest.force_n)
        # A program that starts would find the last command in its register and obey it: take it back. A controller that
        # does not answer would execute a command late, when it is outdated.
        if self._stopped:
            self._control.kickWatchdog()
        elif not self._observer.silent:
            commands.cycle(self._ur_command)
        # After the cycle and not at once: a force that is reported as zeroed is from after the zeroing.
        self._observer.zeroed, self._observer.refused = commands.trusted, commands.refused
        self._observer.watchdog_s = self._watchdog.moving_s
        self._control.waitPeriod(begin)

    def _watch_program(self) -> None:
        """Detect another program: one that plays again after a stop was started by others.

        It may be one of theirs that reads the same registers, or ours that ur-rtde started, without its watchdog.
        """
        # A command that waits for its acknowledgement may outlast the stop: the observer has seen it.
        idle, self._observer.idle = self._observer.idle, False
        newest = self._observer.newest
        playing = newest is not None and newest.playing
        self._other_program |= (self._stopped or (idle and self._was_playing)) and playing
        self._was_playing |= playing
        self._stopped = self._was_playing and not playing

    def _let_go(self) -> None:
        """Stop the arm and end its program, at any end of this process."""
        # Commands to a program that is not ours, or on a lost connection, would make ur-rtde start its program again.
        ours = not self._stopped and not self._other_program
        if ours and self._observer.connected and not self._observer.silent and self._control.isConnected():
            with contextlib.suppress(RuntimeError):
                self._commands.stand_still()
                set_alarm(HANGING_S)
                self._control.stopScript()

    def _receive_commands(self) -> bool:
        """Take the newest command of the parent; return whether the parent is still there."""
        try:
            while data := self._channel.recv(LARGEST, socket.MSG_DONTWAIT):
                content = json.loads(data)
                self._ur_command = UrCommand._make(content) if content else None
        except BlockingIOError:
            if self._ur_command is not None:
                age_s = (time.monotonic_ns() - self._ur_command.time_ns) * 1e-9
                if age_s > self._holds_s(self._ur_command):
                    self._ur_command = None
            return True
        except OSError:
            pass
        return False

    def _holds_s(self, ur_command: UrCommand) -> float:
        """Return for how long a command holds: a velocity towards the surface no longer than the watchdog waits."""
        params = self._params
        falls = ur_command.force_n is None and self._frame.direction(ur_command.velocity_m_s)[2] < 0.0
        return min(params.command_timeout_s, 1.0 / params.watchdog_hz) if falls else params.command_timeout_s


def _vector(values: Sequence[float]) -> Vector:
    x, y, z, *_ = values
    return x, y, z


def set_alarm(seconds: float) -> None:
    """Let the kernel end this process unless it sets the alarm again in time, independent of Python's lock."""
    signal.setitimer(signal.ITIMER_REAL, seconds)


def main() -> None:
    """Run as `python -m texture_exploration.arms.ur_worker DESCRIPTOR PARAMETERS`; the arm starts it."""
    descriptor, values = sys.argv[1:]
    channel = socket.socket(fileno=int(descriptor))
    params = from_mapping(UrArmParams, json.loads(values))
    # Ctrl-C reaches all processes of a terminal; the parent decides when the arm has done its last movement.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    set_alarm(params.connect_timeout_s)
    try:
        worker = Worker(params, channel)
        reason = worker.run()
    except RuntimeError as error:  # the way in which ur-rtde reports a fault
        reason = str(error)
    except Exception as error:  # an error of ours: the arm was stopped, and the error is reported to the parent
        traceback.print_exc()
        reason = f'the process that talks to the controller failed ({error!r}) and stopped the arm; connect again'
    if reason:
        channel.send(json.dumps(reason[:MOST_CHARACTERS]).encode())
    # Closing the interfaces of ur-rtde takes seconds; the end of the process also closes their connections.
    os._exit(0)


if __name__ == '__main__':
    main()
