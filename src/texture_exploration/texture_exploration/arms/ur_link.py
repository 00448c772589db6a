"""The worker process as its parent sees it: start it, exchange messages with it, end it."""

from __future__ import annotations

import dataclasses
import json
import signal
import socket
import subprocess
import sys
import threading

from texture_core.errors import DeviceError
from texture_exploration.arms.ur_messages import FAILURE, LARGEST, REPORT, UrReport
from texture_exploration.arms.ur_params import UrArmParams

MODULE = 'texture_exploration.arms.ur_worker'
STOPPING_S = 1.5  # time to brake, beside what the controller takes to acknowledge it
ACKNOWLEDGEMENTS = 2  # of a stop and of the end of force control
FINAL_MESSAGE_S = 0.05


class WorkerLink:
    """One worker process, from its start to its end."""

    def __init__(self, params: UrArmParams) -> None:
        self.report: UrReport | None = None
        self._failure = ''
        self._timeout_s = params.connect_timeout_s
        self._stopping_s = STOPPING_S + ACKNOWLEDGEMENTS * params.acknowledge_s
        self._state_received = threading.Event()
        self._channel, end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        command = [sys.executable, '-m', MODULE, str(end.fileno()), json.dumps(dataclasses.asdict(params))]
        with end:
            self._process = subprocess.Popen(
                command, pass_fds=[end.fileno()], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
            )
        self._reader = threading.Thread(target=self._read, name='ur_link', daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def wait_for_report(self) -> None:
        """Return when the first report has come.

        Raises
        ------
        DeviceError
            If the worker ends before, or none comes in time.
        """
        if not self._state_received.wait(self._timeout_s):
            raise DeviceError(
                f'the controller did not let the arm be ready within {self._timeout_s:g} s; '
                'look at its pendant, and restart it if it hangs'
            )
        self.check()

    def check(self) -> None:
        """Return if the worker is there.

        Raises
        ------
        DeviceError
            With the reason why it is not.
        """
        if not self._reader.is_alive() or self.report is None:
            raise DeviceError(self._why_ended())

    def send(self, data: bytes) -> None:
        """Send a message to the worker, without waiting.

        Raises
        ------
        DeviceError
            If it is gone or does not read.
        """
        try:
            self._channel.send(data, socket.MSG_DONTWAIT)
        except BlockingIOError as error:
            raise DeviceError('the process that talks to the controller hangs; connect again') from error
        except OSError as error:
            raise DeviceError(self._why_ended()) from error

    def end(self) -> None:
        """Let the arm come to rest and the worker end; kill it if it does not: then the watchdog stops the arm."""
        self._channel.shutdown(socket.SHUT_RDWR)
        try:
            self._process.wait(self._stopping_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()
        self._channel.close()

    def _read(self) -> None:
        while data := self._receive():
            kind = data[:1]
            if kind == REPORT:
                self.report = UrReport.from_bytes(data)
                self._state_received.set()
            elif kind == FAILURE:
                self._failure = data[1:].decode()
        self._state_received.set()

    def _receive(self) -> bytes:
        try:
            return self._channel.recv(LARGEST)
        except OSError:
            return b''

    def _why_ended(self) -> str:
        self._reader.join(FINAL_MESSAGE_S)  # what the worker said before it ended may still be on its way
        if self._failure:
            return self._failure
        if self._process.poll() == -signal.SIGALRM:
            return 'the controller stopped answering in the middle of a command; look at its pendant, and connect again'
        return 'the process that talks to the controller ended; connect again'
