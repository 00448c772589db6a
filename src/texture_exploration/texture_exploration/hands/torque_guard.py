"""A process that switches the torque of the motors off when the process that commanded them is gone.

It waits at a pipe whose other end only the commanding process holds. The kernel closes that end however the process
ends, also by SIGKILL; whoever ends in order says so first.
"""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import time
from collections.abc import Iterable

import serial

DONE = b'.'
SYNC_WRITE, BROADCAST = 0x83, 0xFE
REPEATS = 5  # nobody answers a sync write; one may meet what was still on the line
PAUSE_S = 0.02
LEAVE_S = 2.0


class TorqueGuard:
    """The guard of one hand; start it before the torque is switched on.

    Parameters
    ----------
    device, baud
        Line of the motors.
    packet
        What to write to it, see `torque_off_packet`.
    """

    def __init__(self, device: str, baud: int, packet: bytes) -> None:
        command = [sys.executable, '-m', __name__, device, str(baud), packet.hex()]
        # A session of its own: what ends all processes of a terminal or a launch file must not end the guard first.
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def dismiss(self) -> None:
        """End the guard: the torque has been switched off, or the line is gone."""
        with contextlib.suppress(OSError):  # of a guard that has ended
            self._process.communicate(DONE, timeout=LEAVE_S)
        self._process.kill()
        self._process.wait()


def torque_off_packet(address: int, motors: Iterable[int]) -> bytes:
    """Return the instruction packet (sync write, protocol 2.0) that writes 0 to one byte at `address` of motors."""
    params = address.to_bytes(2, 'little') + b'\x01\x00' + b''.join(bytes([motor, 0]) for motor in motors)
    body = bytes([SYNC_WRITE]) + params
    packet = b'\xff\xff\xfd\x00' + bytes([BROADCAST]) + (len(body) + 2).to_bytes(2, 'little') + body
    return packet + crc16(packet).to_bytes(2, 'little')


def crc16(data: bytes) -> int:
    """Return the checksum of protocol 2.0: polynomial 8005, start 0, not reflected."""
    value = 0
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = ((value << 1) ^ 0x8005 if value & 0x8000 else value << 1) & 0xFFFF
    return value


def main() -> None:
    """Run as `python -m texture_exploration.hands.torque_guard DEVICE BAUD PACKET`; the hand starts it."""
    device, baud, packet = sys.argv[1:]
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    if sys.stdin.buffer.read() == DONE:
        return
    with contextlib.suppress(serial.SerialException, OSError), serial.Serial(device, int(baud), timeout=0) as line:
        for _ in range(REPEATS):
            line.write(bytes.fromhex(packet))
            line.flush()
            time.sleep(PAUSE_S)


if __name__ == '__main__':
    main()
