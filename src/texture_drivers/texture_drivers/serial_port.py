"""A serial port that fails in one way: DeviceError, whatever pyserial, the kernel or termios raise."""

from __future__ import annotations

import contextlib
import os
import termios
import time
from collections.abc import Iterator

import serial

from texture_core.errors import DeviceError

# An unplugged port raises termios.error from tcflush, which is no OSError.
PORT_ERRORS = (serial.SerialException, OSError, termios.error)
MAX_BYTES = 65536  # at once
MODEM_SETTLE_S = 0.2  # the vendor's pause between raising DTR and the first command


class SerialPort:
    """An exclusively opened serial device in raw mode.

    Raises
    ------
    DeviceError
        From every method but `close`, once the device is gone.
    """

    def __init__(self, device: str, baud: int = 115200) -> None:
        self._device = device
        with self._faults():
            self._serial = serial.Serial(baudrate=baud, exclusive=True, timeout=0, write_timeout=0.5)
            self._serial.port = device
            self._serial.rts = False  # as the vendor does; pyserial raises DTR and passes over ports without the lines
            self._serial.open()
            if self._has_modem_lines():
                time.sleep(MODEM_SETTLE_S)
            self._serial.reset_input_buffer()

    def _has_modem_lines(self) -> bool:
        try:
            return self._serial.cts or True
        except OSError:  # a pseudo-terminal: ENOTTY
            return False

    def read(self) -> bytes:
        """Return what has arrived, without waiting."""
        data = b''
        with self._faults():
            # The kernel hands over 4 kB at once and holds more behind them; what comes meanwhile is for the next time.
            while (waiting := self._serial.in_waiting) and len(data) < MAX_BYTES:
                data += self._serial.read(waiting)
        return data

    def write(self, data: bytes) -> None:
        """Send."""
        with self._faults():
            self._serial.write(data)

    def close(self) -> None:
        """Close; never raises."""
        with contextlib.suppress(*PORT_ERRORS):
            self._serial.close()

    @contextlib.contextmanager
    def _faults(self) -> Iterator[None]:
        try:
            yield
        except PORT_ERRORS as error:
            raise DeviceError(
                f"device '{self._device}' cannot be used ({reason_of(error)}); check that it is plugged in, "
                'that you may open it, and that no other program has it open'
            ) from error


def reason_of(error: Exception) -> str:
    """Return what the operating system says of a fault, without the path that pyserial repeats in its own text."""
    code = error.args[0] if len(error.args) > 1 else None  # termios.error has no errno
    return os.strerror(code) if isinstance(code, int) else str(error)
