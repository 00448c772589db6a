"""A bus of Dynamixel motors (protocol 2.0) on a pseudo-terminal: written from the protocol.

`FF FF FD 00 | id | length | instruction | parameters | CRC`.
"""

from __future__ import annotations

import argparse
import struct
import time
from pathlib import Path

from texture_simulation.devices.dynamixel_motors import (
    ALERT,
    ERROR,
    PHYSICS_S,
    DynamixelMotors,
    FingerMotors,
    leap_hand,
)
from texture_simulation.devices.serial_robot import EmulatedSerialRobot

HEADER = b'\xff\xff\xfd\x00'
PING, READ, WRITE, REBOOT, STATUS, SYNC_READ, SYNC_WRITE = 1, 2, 3, 8, 0x55, 0x82, 0x83
UNDEFINED, CUT_SHORT = 2, 5  # errors of a status packet: instruction, length
TURN_S = 0.002
IDLE_S = 0.0005
MAX_STEPS = 100


def crc16(data: bytes) -> int:
    """Return the checksum of protocol 2.0: polynomial 8005, start 0, not reflected; of "123456789" FEE8."""
    value = 0
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = ((value << 1) ^ 0x8005 if value & 0x8000 else value << 1) & 0xFFFF
    return value


class EmulatedDynamixelBus(EmulatedSerialRobot):
    """The motors on their bus.

    Parameters
    ----------
    link, finger_port
        See `EmulatedSerialRobot`.
    motors
        On the bus.
    finger
        Which one is reported to the emulator.
    latency_s
        What comes from the motors is kept back for so long, as by a USB adapter: 16 ms are the default of FTDI.
    """

    def __init__(
        self,
        link: Path,
        motors: DynamixelMotors,
        finger: FingerMotors | None = None,
        finger_port: int = 0,
        latency_s: float = 0.0,
    ) -> None:
        super().__init__(link, finger_port)
        self.motors = motors
        self.latency_s = latency_s
        self._finger = finger
        self._received = b''

    def run(self) -> None:
        """Answer what comes, and let the motors move."""
        due_s = time.monotonic()
        while not self.closing.is_set():
            with self.port_lock:
                data = self.port.read()
                answers = self.receive(data)
                if answers:
                    self.closing.wait(self.latency_s)
                self.port.write(answers)
            if not data:
                self.closing.wait(IDLE_S)
            steps = int((time.monotonic() - due_s) / PHYSICS_S)
            if steps * PHYSICS_S >= TURN_S:
                due_s += steps * PHYSICS_S
                self.motors.advance(min(steps, MAX_STEPS))
                if self._finger is not None:
                    self.emulator.send(self.motors.finger_state(self._finger, time.monotonic_ns()))

    def receive(self, data: bytes) -> bytes:
        """Return the answers to what came over the line."""
        self._received += data
        answers = b''
        while (at := self._received.find(HEADER)) >= 0 and len(self._received) >= at + 7:
            length = int.from_bytes(self._received[at + 5 : at + 7], 'little')
            packet = self._received[at : at + 7 + length]
            if len(packet) < 7 + length:
                break
            self._received = self._received[at + 7 + length :]
            if crc16(packet[:-2]) == int.from_bytes(packet[-2:], 'little'):
                self.motors.receive()
                unstuffed = packet[8:-2].replace(b'\xff\xff\xfd\xfd', b'\xff\xff\xfd')
                answers += self._execute(packet[4], packet[7], unstuffed)
        return answers

    def _execute(self, motor: int, instruction: int, params: bytes) -> bytes:
        if instruction == SYNC_READ:
            address, size = struct.unpack_from('<HH', params)
            return self._sync_read(address, size, params[4:])
        if instruction == SYNC_WRITE:
            address, size = struct.unpack_from('<HH', params)
            for at in range(4, len(params), size + 1):
                if self.motors.answers(params[at]):
                    self.motors.write(params[at], address, params[at + 1 : at + 1 + size])
            return b''
        if not self.motors.answers(motor):
            return b''
        return self._one(motor, instruction, params)

    def _one(self, motor: int, instruction: int, params: bytes) -> bytes:
        table = self.motors.tables[motor]
        if instruction == PING:
            return self._status(motor, bytes(table[0:2]) + bytes([table[6]]))
        if instruction == READ:
            address, size = struct.unpack('<HH', params)
            return self._status(motor, bytes(table[address : address + size]))
        if instruction == WRITE:
            if len(params) < 3:
                return self._status(motor, b'', CUT_SHORT)
            error = self.motors.write(motor, int.from_bytes(params[:2], 'little'), params[2:])
            return self._status(motor, b'', error)
        if instruction == REBOOT:
            answer = self._status(motor, b'')
            self.motors.reboot(motor)
            return answer
        return self._status(motor, b'', UNDEFINED)

    def _sync_read(self, address: int, size: int, ids: bytes) -> bytes:
        answers = b''
        for motor in ids:
            if not self.motors.answers(motor):
                break  # each waits for the one before it
            answers += self._status(motor, bytes(self.motors.tables[motor][address : address + size]))
        return answers

    def _status(self, motor: int, params: bytes, error: int = 0) -> bytes:
        error |= ALERT if self.motors.tables[motor][ERROR] else 0
        body = (bytes([STATUS, error]) + params).replace(b'\xff\xff\xfd', b'\xff\xff\xfd\xfd')
        packet = HEADER + bytes([motor]) + struct.pack('<H', len(body) + 2) + body
        packet += struct.pack('<H', crc16(packet))
        # Two motors with one id answer at once, and what they send is neither's.
        return packet[:-2] + bytes(2) if motor in self.motors.twice else packet


def main() -> None:
    """Run an emulated LEAP hand until Ctrl-C, as in `python -m texture_simulation.devices.dynamixel`."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument(
        'link', type=Path, nargs='?', default=Path('/tmp/texture/dynamixel'), help='device path to make'
    )
    options = parser.parse_args()
    EmulatedDynamixelBus(options.link, leap_hand()).serve_forever()


if __name__ == '__main__':
    main()
