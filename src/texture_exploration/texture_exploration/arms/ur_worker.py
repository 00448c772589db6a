"""The process that talks to the controller through ur-rtde, so that nothing ur-rtde waits for stops the node.

The constructors of ur-rtde hold Python's global lock and wait without a limit, and a command may wait for minutes. Here
an alarm of the kernel ends the process when it hangs; the watchdog of the controller then stops the arm. The process
ends by itself, with the arm at rest, when its parent is gone.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import signal
import socket
import sys
import threading
import time
import traceback
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from texture_core.parameters import from_mapping
from texture_exploration.arms.protocol import Vector
from texture_exploration.arms.surface_frame import SurfaceFrame
from texture_exploration.arms.ur_command_stream import UrCommandStream
from texture_exploration.arms.ur_messages import (
    COMMAND,
    LARGEST,
    RECOVER,
    STOP,
    Counts,
    UrCommand,
    UrReport,
    failure_message,
)
from texture_exploration.arms.ur_params import UrArmParams
from texture_exploration.arms.ur_tables import PROGRAM_PLAYING
from texture_exploration.arms.ur_watchdog import Watchdog

VARIABLES = ['timestamp', 'actual_TCP_pose', 'actual_TCP_speed', 'actual_TCP_force', 'safety_mode', 'runtime_state']
HANGING_S = 2.0  # no command takes so long
RESTART_S = 5.0  # of the program on the controller
LATE_S = 0.02
OTHER_PROGRAM = (
    'the program on the controller was stopped, and somebody else started one; see who uses the arm, and connect again'
)
LOST = 'the connection to the controller was lost; is it still on, and the cable in place?'


class Observer:
    """Reports what the controller measures, in a thread of its own: commands may take a while.

    `newest` is the last report, None before the first; `unsteady`, `zeroed`, `watchdog_s` and `counts` come from the
    other thread.

    Silence counts only while this thread is awake, so that a machine that stalls is not taken for a dead controller.
    """

    def __init__(self, receive: Any, channel: socket.socket, params: UrArmParams) -> None:
        self.connected = True
        self.silent = self.unsteady = self.zeroed = False
        self.watchdog_s = 1.0 / params.watchdog_hz
        self.counts = Counts()
        self.newest: UrReport | None = None
        self._receive = receive
        self._channel = channel
        self._silence_s = params.silence_s
        self._period_s = 1.0 / params.rate_hz
        self._stamp = -1.0
        self._time_ns = time.monotonic_ns()
        self._silent_for_s = 0.0
        self._late = 0

    def run(self) -> None:
        """Look in every cycle whether there is news."""
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
        if stamp != self._stamp:
            self._stamp, self._time_ns = stamp, time.monotonic_ns()
            self._silent_for_s, self.silent = 0.0, False
            self._report()
            return
        previous_s, self._silent_for_s = self._silent_for_s, self._silent_for_s + passed_s
        self._late += previous_s <= LATE_S < self._silent_for_s
        if self._silent_for_s > self._silence_s and not self.silent:
            self.silent = True
            self._report()

    def _report(self) -> None:
        receive = self._receive
        report = UrReport(
            time_ns=self._time_ns,
            position_m=_vector(receive.getActualTCPPose()),
            velocity_m_s=_vector(receive.getActualTCPSpeed()),
            force_n=_vector(receive.getActualTCPForce()),
            watchdog_s=self.watchdog_s,
            safety_mode=receive.getSafetyMode(),
            playing=receive.getRuntimeState() == PROGRAM_PLAYING,
            silent=self.silent,
            unsteady=self.unsteady,
            zeroed=self.zeroed,
            counts=replace(self.counts, late=self._late),
        )
        self.newest = report
        try:
            self._channel.send(report.to_bytes(), socket.MSG_DONTWAIT)
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
        # Whether the arm is under remote control has been asked already.
        flags = control_class.FLAG_UPLOAD_SCRIPT | control_class.FLAG_DISABLE_REMOTE_CONTROL_CHECK
        if params.upper_range_registers:
            flags |= control_class.FLAG_UPPER_RANGE_REGISTERS
        receive = receive_class(params.ip, params.rate_hz, VARIABLES)
        self._control = control_class(params.ip, params.rate_hz, flags)
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
            self._set_watchdog()
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
        self._take_measurement()
        # What is sent to a controller that does not answer would be obeyed late, when nobody means it any more.
        if self._stopped:
            self._clear()
        elif not self._observer.silent:
            self._commands.cycle(self._ur_command)
        self._update_observer()
        self._control.waitPeriod(begin)

    def _take_measurement(self) -> None:
        """Pass on what was measured last."""
        newest = self._observer.newest
        if newest is not None and newest.time_ns != self._measured_ns:
            self._measured_ns = newest.time_ns
            self._commands.observe(newest.time_ns, newest.position_m, newest.force_n)

    def _update_observer(self) -> None:
        """Pass on to the observer what it reports beside the measurements."""
        commands, watchdog = self._commands, self._watchdog
        self._observer.unsteady, self._observer.zeroed = commands.unsteady, commands.trusted
        self._observer.watchdog_s = watchdog.moving_s
        self._observer.counts = Counts(
            refused=commands.refused,
            zeroed=commands.zeroings,
            slow_acknowledgements=watchdog.slow,
            slowest_acknowledgement_ms=round(watchdog.slowest_s * 1e3),
        )

    def _watch_program(self) -> None:
        """Notice whether another program runs than ours: one that plays again after a stop was started by others.

        It may be one of theirs that reads the same registers, or ours that ur-rtde started, without its watchdog.
        """
        playing = self._plays()
        self._was_playing |= playing
        self._other_program |= self._stopped and playing
        self._stopped = self._was_playing and not playing

    def _let_go(self) -> None:
        """Bring the arm to rest and end its program, whatever ends this process."""
        # Commands to a program that is not ours, or on a lost connection, would make ur-rtde start its own again.
        ours = not self._stopped and not self._other_program
        if ours and self._observer.connected and not self._observer.silent and self._control.isConnected():
            with contextlib.suppress(RuntimeError):
                self._commands.stand_still()
                set_alarm(HANGING_S)
                self._control.stopScript()

    def _receive_commands(self) -> bool:
        """Take over what the parent said last; return whether it is still there."""
        try:
            while data := self._channel.recv(LARGEST, socket.MSG_DONTWAIT):
                self._handle(data)
        except BlockingIOError:
            if self._ur_command is not None and self._age_s(self._ur_command) > self._holds_s(self._ur_command):
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

    @staticmethod
    def _age_s(ur_command: UrCommand) -> float:
        return (time.monotonic_ns() - ur_command.time_ns) * 1e-9

    def _handle(self, data: bytes) -> None:
        kind = data[:1]
        if kind == COMMAND:
            self._ur_command = UrCommand.from_bytes(data)
        elif kind == STOP:
            self._ur_command = None
        elif kind == RECOVER:
            self._recover()

    def _clear(self) -> None:
        """Take the last command back: a program that starts would find it in its register and obey it."""
        self._control.kickWatchdog()

    def _recover(self) -> None:
        """Start the program on the controller again."""
        set_alarm(RESTART_S + HANGING_S)
        self._ur_command = None
        self._clear()
        self._control.reuploadScript()
        end_s = time.monotonic() + RESTART_S
        while not (self._control.isProgramRunning() and self._plays()) and time.monotonic() < end_s:
            time.sleep(0.005)
        self._set_watchdog()
        self._commands.reset()
        self._stopped = False

    def _plays(self) -> bool:
        newest = self._observer.newest
        return newest is not None and newest.playing

    def _set_watchdog(self) -> None:
        if not self._watchdog.arm():
            raise RuntimeError('the controller did not take the watchdog, without which the arm does not move')


def _vector(values: Sequence[float]) -> Vector:
    x, y, z, *_ = values
    return x, y, z


def set_alarm(seconds: float) -> None:
    """Let the kernel end this process unless it sets the alarm again in time; no lock of Python can stop it."""
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
    except RuntimeError as error:  # so ur-rtde tells what it met
        reason = str(error)
    except Exception as error:  # an error of ours: the arm was stopped on the way out, and the parent is told
        traceback.print_exc()
        reason = f'the process that talks to the controller failed ({error!r}) and stopped the arm; connect again'
    if reason:
        channel.send(failure_message(reason))
    # To end the interfaces of ur-rtde takes seconds of sleep; the end of the process closes their connections too.
    os._exit(0)


if __name__ == '__main__':
    main()
