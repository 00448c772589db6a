"""The process that talks to the controller through ur-rtde, so that nothing ur-rtde waits for stops the node.

The constructors of ur-rtde hold Python's global lock and wait without a limit, and a command may wait for minutes. Here
an alarm of the kernel ends the process when it hangs; the watchdog of the controller then stops the arm. The process
ends by itself, with the arm at rest, when its parent is gone.
"""

from __future__ import annotations

import importlib
import json
import os
import signal
import socket
import sys
import threading
import time
from typing import Any

from texture_core.parameters import from_mapping
from texture_exploration.arms.ur_messages import LARGEST, RECOVER, STOP, WISH, Report, Wish, trouble
from texture_exploration.arms.ur_params import UrArmParams
from texture_exploration.arms.ur_pilot import Pilot
from texture_exploration.arms.ur_tables import PROGRAM_PLAYING

VARIABLES = ['timestamp', 'actual_TCP_pose', 'actual_TCP_speed', 'actual_TCP_force', 'safety_mode', 'runtime_state']
HANGING_S = 2.0  # no command takes so long
RESTART_S = 5.0  # of the program on the controller
LATE_S = 0.02
LOST = 'the connection to the controller was lost; is it still on, and the cable in place?'


class Observer:
    """Reports what the controller measures, in a thread of its own: commands may take a while.

    Silence counts only while this thread is awake, so that a machine that stalls is not taken for a dead controller.
    """

    def __init__(self, receive: Any, channel: socket.socket, params: UrArmParams) -> None:
        self.silent = False
        self.refused = 0
        self.connected = True
        self._receive = receive
        self._channel = channel
        self._silence_s = params.silence_s
        self._period_s = 1.0 / params.rate_hz
        self._stamp = -1.0
        self._time_ns = time.monotonic_ns()
        self._quiet_s = 0.0
        self._late = 0

    def run(self) -> None:
        """Look in every cycle whether there is news."""
        last_s = time.monotonic()
        try:
            while self.connected and self._receive.isConnected():
                now_s = time.monotonic()
                self._look(min(now_s - last_s, LATE_S))
                last_s = now_s
                time.sleep(self._period_s)  # the exact waitPeriod of ur-rtde burns processor time
        finally:
            self.connected = False

    def _look(self, passed_s: float) -> None:
        stamp = self._receive.getTimestamp()
        if stamp != self._stamp:
            self._stamp, self._time_ns = stamp, time.monotonic_ns()
            self._quiet_s, self.silent = 0.0, False
            self._report()
            return
        before_s, self._quiet_s = self._quiet_s, self._quiet_s + passed_s
        self._late += before_s <= LATE_S < self._quiet_s
        if self._quiet_s > self._silence_s and not self.silent:
            self.silent = True
            self._report()

    def _report(self) -> None:
        receive = self._receive
        report = Report(
            time_ns=self._time_ns,
            position_m=tuple(receive.getActualTCPPose()[:3]),
            velocity_m_s=tuple(receive.getActualTCPSpeed()[:3]),
            force_n=tuple(receive.getActualTCPForce()[:3]),
            safety_mode=receive.getSafetyMode(),
            playing=receive.getRuntimeState() == PROGRAM_PLAYING,
            silent=self.silent,
            late=self._late,
            refused=self.refused,
        )
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
        receive_class = importlib.import_module('rtde_receive').RTDEReceiveInterface
        control_class = importlib.import_module('rtde_control').RTDEControlInterface
        # Whether the arm is under remote control has been asked already.
        flags = control_class.FLAG_UPLOAD_SCRIPT | control_class.FLAG_DISABLE_REMOTE_CONTROL_CHECK
        receive = receive_class(params.ip, params.rate_hz, VARIABLES)
        self._control = control_class(params.ip, params.rate_hz, flags)
        self._observer = Observer(receive, channel, params)
        self._pilot = Pilot(self._control, params)
        self._wish: Wish | None = None
        self._heard_s = 0.0

    def lead(self) -> str:
        """Lead the arm until the parent or the controller is gone; return what to say about it."""
        try:
            self._set_watchdog()
            threading.Thread(target=self._observer.run, name='observer', daemon=True).start()
            while self._listen():
                if not (self._observer.connected and self._control.isConnected()):
                    return LOST
                self._cycle()
            if not self._observer.silent:
                self._pilot.cycle(None)
                self._control.stopScript()
        except RuntimeError as error:
            return f'{LOST} ({error})'
        return ''

    def _cycle(self) -> None:
        begin = self._control.initPeriod()
        set_alarm(HANGING_S)
        # What is sent to a controller that does not answer would be obeyed late, when nobody means it any more.
        if not self._observer.silent:
            self._pilot.cycle(self._wish)
        self._observer.refused = self._pilot.refused
        self._control.waitPeriod(begin)

    def _listen(self) -> bool:
        """Take over what the parent said last; return whether it is still there."""
        try:
            while data := self._channel.recv(LARGEST, socket.MSG_DONTWAIT):
                self._obey(data)
        except BlockingIOError:
            if time.monotonic() - self._heard_s > self._params.command_timeout_s:
                self._wish = None
            return True
        except OSError:
            pass
        return False

    def _obey(self, data: bytes) -> None:
        self._heard_s = time.monotonic()
        kind = data[:1]
        if kind == WISH:
            self._wish = Wish.from_bytes(data)
        elif kind == STOP:
            self._wish = None
        elif kind == RECOVER:
            self._recover()

    def _recover(self) -> None:
        """Start the program on the controller anew."""
        set_alarm(RESTART_S + HANGING_S)
        self._wish = None
        self._control.reuploadScript()
        end_s = time.monotonic() + RESTART_S
        while not self._control.isProgramRunning() and time.monotonic() < end_s:
            time.sleep(0.005)
        self._set_watchdog()
        self._pilot.forget()

    def _set_watchdog(self) -> None:
        if not self._control.setWatchdog(self._params.watchdog_hz):
            raise RuntimeError('the controller did not take the watchdog, without which the arm does not move')


def set_alarm(seconds: float) -> None:
    """Let the kernel end this process unless it sets the alarm anew in time; no lock of Python can stop it."""
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
    except RuntimeError as error:  # so ur-rtde tells what it met
        reason = str(error)
    else:
        reason = worker.lead()
    if reason:
        channel.send(trouble(reason))
    # To end the interfaces of ur-rtde takes seconds of sleep; the end of the process closes their connections too.
    os._exit(0)


if __name__ == '__main__':
    main()
