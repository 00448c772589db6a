"""A TCP connection to a controller, with a time limit on every answer."""

from __future__ import annotations

import socket
import time

from texture_core.errors import DeviceError


class TcpConnection:
    """A TCP connection on which every wait ends in time, and every failure is a sentence."""

    def __init__(self, ip: str, port: int, timeout_s: float) -> None:
        self._where = f'{ip}:{port}'
        self._timeout_s = timeout_s
        self._end_s = time.monotonic() + timeout_s
        try:
            self._socket = socket.create_connection((ip, port), timeout_s)
        except ConnectionRefusedError as error:
            raise DeviceError(
                f"nothing listens on {self._where}; is the controller on, and is parameter 'ip' its address?"
            ) from error
        except TimeoutError as error:
            raise DeviceError(
                f'{self._where} cannot be reached within {timeout_s:g} s; check the cable, the network and parameter '
                "'ip'"
            ) from error
        except OSError as error:
            raise DeviceError(f"{self._where} cannot be reached: {error}; check parameter 'ip'") from error

    def close(self) -> None:
        """End the conversation."""
        self._socket.close()

    def send(self, data: bytes) -> None:
        """Send all of it."""
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise self._silent() from error

    def read(self, size: int) -> bytes:
        """Return exactly so many bytes.

        Raises
        ------
        DeviceError
            If the other side is silent for too long or ends the connection.
        """
        data = b''
        while len(data) < size:
            try:
                self._socket.settimeout(max(0.001, self._end_s - time.monotonic()))
                chunk = self._socket.recv(size - len(data))
            except OSError as error:
                raise self._silent() from error
            if not chunk:
                raise DeviceError(f'{self._where} ended the conversation; is it a UR controller, and has it started?')
            data += chunk
        return data

    def read_line(self) -> str:
        """Return the next line."""
        line = b''
        while not line.endswith(b'\n'):
            line += self.read(1)
        return line.decode('utf-8', 'replace').strip()

    def _silent(self) -> DeviceError:
        return DeviceError(
            f'{self._where} takes connections but does not answer as a UR controller within {self._timeout_s:g} s; '
            "wait until it has started, restart it, or correct parameter 'ip'"
        )
