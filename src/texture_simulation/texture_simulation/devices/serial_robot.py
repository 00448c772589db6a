"""What emulated robots on a serial line share: a real-time thread, a plug, and finger states for the emulator."""

from __future__ import annotations

import signal
import threading
from pathlib import Path
from typing import TypeVar

from texture_core.finger_state import FingerSender
from texture_simulation.devices.pty_port import PtyPort

LineT = TypeVar('LineT', bound='EmulatedSerialRobot')


class EmulatedSerialRobot:
    """A robot in real time behind a device path, in a thread of its own; usable as a context.

    Parameters
    ----------
    link
        Symbolic link that leads to the device; this is the path for the arm.
    finger_port
        UDP port on loopback at which the emulator receives finger states; 0: none.
    """

    def __init__(self, link: Path, finger_port: int) -> None:
        self.port = PtyPort(link)
        self.emulator = FingerSender(finger_port)
        self.port_lock = threading.Lock()  # the port: it is unplugged by others
        self.closing = threading.Event()
        self._thread = threading.Thread(target=self.run, name=type(self).__name__, daemon=True)

    def run(self) -> None:
        """Let time go by until `closing`.

        Raises
        ------
        NotImplementedError
            Always: each robot has its own.
        """
        raise NotImplementedError

    def __enter__(self: LineT) -> LineT:
        self.port.plug()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.closing.set()
        self._thread.join()
        self.port.unplug()
        self.emulator.close()

    @property
    def running(self) -> bool:
        """Whether time goes by."""
        return self._thread.is_alive()

    def plug(self) -> None:
        """Plug it in again; it gets another device name."""
        with self.port_lock:
            self.port.plug()

    def unplug(self) -> None:
        """Pull its plug."""
        with self.port_lock:
            self.port.unplug()

    def serve_forever(self) -> None:
        """Live until SIGINT or SIGTERM."""
        stopped = threading.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda _number, _frame: stopped.set())
        with self:
            print(f'it is at {self.port.link}', flush=True)
            stopped.wait()
