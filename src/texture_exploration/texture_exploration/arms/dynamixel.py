# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The bus of a hand with Dynamixel motors, and the process that switches their torque off when its parent dies."""

from __future__ import annotations

import contextlib
import functools
import importlib
import os
import sys
import termios
import time
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import serial

from texture_core.errors import DeviceError
from texture_exploration.arms.arm import DONE, GuardProcess, guard_socket, lock_within
from texture_exploration.arms.hand import POSITION_RAD, VELOCITY_RAD_S, X_SERIES, ZERO, Profile, describe, goes_on

# --------------------
# Motors on a Dynamixel bus, in physical units, through the unmodified dynamixel-sdk.
#
# Its calls leave `is_using` set when they fail: only one thread may use a bus, and after an error the port is opened
# again. Its reception is a busy loop; a port that waits a little for bytes makes it sleep and releases Python's lock
# for other threads.

# An unplugged port raises termios.error from tcflush, which is no OSError.
LINE_FAULTS = (serial.SerialException, OSError, termios.error, TypeError, AttributeError)
PROTOCOL = 2.0
SUCCESS = 0
TRIES, REGISTER_TRIES = 3, 6  # of a motor in the loop, of one register: a busy machine hears some answers too late
WAIT_S = 0.001
# A status packet: `FF FF FD 00 | id | length | 55 | error | parameters | CRC`; its length counts from the 55 on.
PACKET_ID, PACKET_LENGTH, PACKET_PARAMETERS = 4, 5, 9
NO_PARAMETERS = 4  # length of a status packet without parameters
SYNC_WRITE, BROADCAST = 0x83, 0xFE  # instruction, and the id of all motors
OPERATING_MODE = 5  # current-based position: in any other the current does not bound the force
TRIPPED = 0xFF  # the register of the Bus Watchdog after it has stopped the motor
RESTART_S = 3.0  # a motor has rebooted within
LOCKED_S = 1.0  # the guard of a killed process has released the motors within
SILENT = 'does not answer'
GARBLED = 'answers with data that cannot be read: do two motors have this id, or is the cable damaged?'
RESET = 'has lost its torque: it was reset, for example by a voltage drop'
REMEDY = '; when it has cooled and nothing blocks it, call `texture recover`, or switch its power off and on'
AFTER_REBOOT = ' after a reboot; when it has cooled and nothing blocks it, switch its power off and on'
HARDWARE_ERRORS = {0: 'input voltage', 2: 'overheating', 3: 'encoder', 4: 'electrical shock', 5: 'overload'}


class MotorState(NamedTuple):
    """What a motor measures."""

    current_a: float
    velocity_rad_s: float
    position_rad: float


class DynamixelBus:
    """All motors of a profile."""

    def __init__(self, device: str, profile: Profile) -> None:
        try:
            self._sdk: Any = importlib.import_module('dynamixel_sdk')
        except ImportError as error:
            raise DeviceError(
                "a Dynamixel hand needs the package dynamixel-sdk, which is not installed here: 'pip install "
                "dynamixel-sdk==4.1.0'"
            ) from error
        self.missing: set[int] = set()
        self.limits_a: dict[int, float] = {}
        self._reasons: dict[int, str] = {}  # why a motor is missing, unless it is silent
        self._energised: set[int] = set()
        self._goal_currents: dict[int, int] = {}  # as sent last
        self._device = device
        self._lock = -1  # on the device
        self._profile = profile
        self._port: Any = self._sdk.PortHandler(device)
        self._packets: Any = self._sdk.PacketHandler(PROTOCOL)
        with self._line(), contextlib.ExitStack() as on_error:
            # Two programs on one bus would read each other's answers and release each other's motors. The SDK empties
            # the input buffer when it opens the port, with answers to another program; so the lock is taken before.
            lock = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            lock_within(lock, LOCKED_S)
            self._lock = lock
            on_error.callback(self.close)
            opened = self._port.openPort() and self._port.setBaudRate(profile.baud)
            if opened:
                on_error.pop_all()
        if not opened:
            raise DeviceError(f"device '{device}' refuses {profile.baud} baud; correct the profile '{profile.name}'")
        self._port.ser.timeout = WAIT_S
        first, last = X_SERIES['present_current'], X_SERIES['present_position']
        self._block = (first[0], last[0] + last[1] - first[0])
        first, last = X_SERIES['torque_enable'], X_SERIES['goal_current']
        self._health = (first[0], last[0] + last[1] - first[0])
        self._turn = 0

    def close(self) -> None:
        """Close the port; never raises."""
        with contextlib.suppress(*LINE_FAULTS):
            self._port.closePort()
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def start(self, *, rebooted: bool = False) -> None:
        """Find and check the motors, set mode and gains; only without an error let them hold their position.

        `rebooted` says that a reboot has not cleared an error that they report.
        """
        self.torque_off(self._profile.ids)  # an earlier program may have left it on
        self.missing = set(self._profile.ids)
        found = [motor for motor in self._profile.ids if any(self._prepare(motor) for _ in range(TRIES))]
        if not found:
            raise DeviceError(
                f"no motor answers on '{self._device}' at {self._profile.baud} baud; check power, baud rate and the "
                f"ids of the profile '{self._profile.name}'"
            )
        errors = {motor: bits for motor in found if (bits := self.read_register(motor, 'hardware_error'))}
        if errors:
            raise DeviceError(
                '; '.join(self._reported(motor, bits, rebooted=rebooted) for motor, bits in errors.items())
            )
        for motor in found:
            # Its watchdog first: once its torque is on, it holds its position.
            if self._profile.watchdog:
                self._arm(motor, 'bus_watchdog', self._profile.watchdog)
            self.write(motor, 'torque_enable', 1)
            self._energised.add(motor)
            self.missing.discard(motor)
            self._reasons.pop(motor, None)

    def why_missing(self, motor: int) -> str:
        """Return why a motor is missing, as text."""
        return f'{self._profile.owner(motor)} {self._reasons.get(motor, SILENT)}'

    def _prepare(self, motor: int) -> bool:
        """Set mode, limits and goals of a motor without torque; return whether it answers."""
        profile = self._profile
        model, result = self._ping(motor)
        position = self.read_register(motor, 'present_position') if result == SUCCESS else None
        if position is None:
            if result == self._sdk.COMM_RX_CORRUPT:
                self._reasons[motor] = GARBLED
            return False
        if model != profile.model:  # or it is a late answer to an earlier request
            model, result = self._ping(motor)
            if result != SUCCESS:
                return False
        if model != profile.model:
            raise DeviceError(
                f"{profile.owner(motor)} is of model {describe(model)}; the profile '{profile.name}' is for "
                f'{describe(profile.model)}, and with another its forces would be wrong; use a '
                'profile for this model'
            )
        self.write(motor, 'torque_enable', 0)  # or the mode cannot be set
        if self.read_register(motor, 'bus_watchdog'):  # old firmware has none and refuses to write it
            self.write(motor, 'bus_watchdog', 0)  # or no goal is taken after it has stopped the motor
        self._arm(motor, 'operating_mode', OPERATING_MODE)
        for register, value in profile.gains.items():
            self.write(motor, register, value)
        firmware = self.read_register(motor, 'firmware')
        if profile.watchdog and firmware is not None and goes_on(model, firmware):
            raise DeviceError(
                f'{profile.owner(motor)} has the firmware {firmware}, whose watchdog is known not to stop the motor '
                'when the cable is out or the computer hangs; update it with DYNAMIXEL Wizard'
            )
        limit = self.read_register(motor, 'current_limit')
        if limit is None:
            return False
        if limit <= 0:
            raise DeviceError(
                f'{profile.owner(motor)} has a Current Limit of {limit}; above 0 is needed, set it with DYNAMIXEL '
                f"Wizard, or correct the table of the profile '{profile.name}'"
            )
        self.limits_a[motor] = limit * profile.current_a
        self._goal_currents[motor] = self._counts(motor, profile.move_a)
        self._arm(motor, 'goal_current', self._goal_currents[motor])
        self.write(motor, 'goal_position', position)
        return True

    def _arm(self, motor: int, register: str, value: int) -> None:
        """Write a register that bounds the force, and read it back: a motor may confirm a value without storing it."""
        self.write(motor, register, value)
        kept = self.read_register(motor, register)
        if kept is None:
            raise DeviceError(f"{self._profile.owner(motor)} did not report '{register}': it {SILENT}")
        if kept != value:
            raise DeviceError(
                f"{self._profile.owner(motor)} was given {value} for '{register}' and holds {kept}: what bounds its "
                f"force is not armed; update its firmware, or correct the table of the profile '{self._profile.name}'"
            )

    def reboot(self) -> None:
        """Reboot the motors that report a hardware error, all without torque, and wait until they have restarted."""
        self.torque_off(self._profile.ids)
        latched = [motor for motor in self._profile.ids if self.read_register(motor, 'hardware_error')]
        for motor in latched:
            with self._line():
                self._packets.reboot(self._port, motor)
        end_s = time.monotonic() + RESTART_S  # an error that stays is named by the next connection
        while time.monotonic() < end_s and any(self.read_register(motor, 'hardware_error') != 0 for motor in latched):
            pass

    def read(self) -> dict[int, MotorState]:
        """Return the measurements of all motors, {} if a cycle is lost; a silent motor is moved to `missing`."""
        asked = [motor for motor in self._profile.ids if motor not in self.missing]
        measured: dict[int, MotorState] = {}
        with self._line():
            result = self._packets.syncReadTx(self._port, *self._block, asked, len(asked), False) if asked else SUCCESS
            for motor in asked if result == SUCCESS else ():
                data, result = self._receive(motor, self._block[1])
                if result != SUCCESS:
                    break
                measured[motor] = self._measured(data)
        if result == SUCCESS:
            return measured
        # They answer in turn: a silent motor hides all after it.
        silent = next(motor for motor in asked if motor not in measured)
        if not any(self._ping(silent)[1] == SUCCESS for _ in range(TRIES - 1)):  # the read of all was the first try
            self.missing.add(silent)
        return {}

    def write_goals(self, goals: Mapping[int, tuple[float, float]]) -> None:
        """Send highest current (A; no more than the motor's limit) and position (rad) of motors."""
        # A silent motor may still hear: it is not to keep an older goal.
        present = {m: goal for m, goal in goals.items() if m not in self.missing or m in self._energised}
        currents = {motor: self._counts(motor, current_a) for motor, (current_a, _) in present.items()}
        self._goal_currents.update(currents)
        self._sync_write('goal_current', currents)
        self._sync_write('goal_position', {m: round(p / POSITION_RAD) + ZERO for m, (_, p) in present.items()})

    def torque_off(self, motors: Iterable[int]) -> None:
        """Release motors, also those that do not answer: they may still receive."""
        self._energised.difference_update(motors)
        self._sync_write('torque_enable', dict.fromkeys(motors, 0))

    def torque_off_packet(self) -> bytes:
        """Return the instruction packet (sync write, protocol 2.0) that releases all motors without the SDK."""
        address, _ = X_SERIES['torque_enable']
        params = address.to_bytes(2, 'little') + b'\x01\x00' + b''.join(bytes([m, 0]) for m in self._profile.ids)
        body = bytes([SYNC_WRITE]) + params
        packet = b'\xff\xff\xfd\x00' + bytes([BROADCAST]) + (len(body) + 2).to_bytes(2, 'little') + body
        return packet + self._packets.updateCRC(0, packet, len(packet)).to_bytes(2, 'little')

    def guard(self) -> GuardProcess:
        """Start the process that holds the lock on the device, and switches the torque off once this one is gone."""
        line = self._device, str(self._profile.baud), self.torque_off_packet().hex()
        return GuardProcess(__name__, *line, holds=(self._lock,))

    def let_go(self) -> None:
        """Release all motors and verify it, as far as they can be reached; raises no error of the line."""
        self._port.is_using = False  # a call may have been interrupted
        with contextlib.suppress(DeviceError):
            for _ in range(TRIES):
                self.torque_off(self._profile.ids)
                here = [motor for motor in self._profile.ids if motor not in self.missing]
                if not any(self.read_register(motor, 'torque_enable') for motor in here):
                    return

    def check_next(self) -> str:
        """Check one motor, another one with each call; return its error as text, '' if there is none."""
        present = [motor for motor in self._profile.ids if motor not in self.missing]
        if not present:
            return ''
        motor = present[self._turn % len(present)]
        self._turn += 1
        data, result = self._read_block(motor, *self._health)
        if result != SUCCESS:
            return ''  # silence is detected elsewhere
        value = functools.partial(register_in, data, self._health[0])
        owner, watchdog = self._profile.owner(motor), self._profile.watchdog
        if bits := value('hardware_error'):
            return self._reported(motor, bits)
        if motor not in self._energised:
            return ''
        if value('bus_watchdog') == TRIPPED:
            raise DeviceError(
                f'{owner} got no message for {self._profile.watchdog_s:g} s, and its watchdog stopped it: the '
                'computer or the bus was delayed; all motors were released'
            )
        if not value('torque_enable') or (watchdog and value('bus_watchdog') != watchdog):
            self._reasons[motor] = RESET
            self._energised.discard(motor)
            self.missing.add(motor)
        elif value('goal_current') != self._goal_currents[motor]:
            # A sync write is not answered. Lost or refused: this finds the reason.
            self.write(motor, 'goal_current', self._goal_currents[motor])
        return ''

    def _reported(self, motor: int, bits: int, *, rebooted: bool = False) -> str:
        """Return the hardware error of a motor and the remedy as text."""
        known = ' and '.join(text for bit, text in HARDWARE_ERRORS.items() if bits >> bit & 1)
        reasons, owner = known or f'hardware error {bits:#04x}', self._profile.owner(motor)
        return f'{owner} still reports {reasons}{AFTER_REBOOT}' if rebooted else f'{owner} reports {reasons}{REMEDY}'

    def _counts(self, motor: int, current_a: float) -> int:
        """Return a current in counts, limited to the range of the motor, which would refuse the whole command."""
        limit_a = self.limits_a[motor]
        return round(min(limit_a, max(-limit_a, current_a)) / self._profile.current_a)

    def write(self, motor: int, register: str, value: int) -> None:
        """Write one register, and check that it was accepted."""
        address, size = X_SERIES[register]
        send = {1: 'write1ByteTxRx', 2: 'write2ByteTxRx', 4: 'write4ByteTxRx'}[size]
        for _ in range(REGISTER_TRIES):
            with self._line():
                result, error = getattr(self._packets, send)(self._port, motor, address, value % (1 << 8 * size))
            if result == SUCCESS:
                break
        if result != SUCCESS:
            why = self._packets.getTxRxResult(result)
            raise DeviceError(f"{self._profile.owner(motor)} did not accept '{register}': {why}")
        # The highest bit only reports that there is a hardware error, which is read separately.
        if error & 0x7F:
            why = self._packets.getRxPacketError(error & 0x7F)
            raise DeviceError(f"{self._profile.owner(motor)} did not accept '{register}': {why}")

    def read_register(self, motor: int, register: str) -> int | None:
        """Return one register, signed if it is longer than a byte; None if the motor does not answer."""
        address, size = X_SERIES[register]
        for _ in range(REGISTER_TRIES):
            data, result = self._read_block(motor, address, size)
            if result == SUCCESS:
                return register_in(data, address, register)
        return None

    def _read_block(self, motor: int, address: int, size: int) -> tuple[bytes, int]:
        """Return `size` bytes of a motor's table, and the result of the SDK."""
        with self._line():
            result = self._packets.readTx(self._port, motor, address, size)
            return self._receive(motor, size) if result == SUCCESS else (b'', result)

    def _receive(self, motor: int, size: int) -> tuple[bytes, int]:
        """Return the `size` bytes that a motor answers next, and the result of the SDK; other packets are skipped.

        The SDK cuts its data out of any packet of the motor, whether it is too long or too short. The late answer to an
        earlier request, such as a ping or a status, would be read as a position or a current limit.
        """
        result = SUCCESS
        while result == SUCCESS:
            packet, result = self._packets.rxPacket(self._port, False)
            if result == SUCCESS and packet[PACKET_ID] == motor:
                length = packet[PACKET_LENGTH] + (packet[PACKET_LENGTH + 1] << 8)
                if length == size + NO_PARAMETERS:
                    return bytes(packet[PACKET_PARAMETERS : PACKET_PARAMETERS + size]), result
        return b'', result

    def _ping(self, motor: int) -> tuple[int, int]:
        """Return the model number of a motor, and the result of the SDK."""
        with self._line():
            model, result, _ = self._packets.ping(self._port, motor)
        return model, result

    def _measured(self, data: bytes) -> MotorState:
        value = functools.partial(register_in, data, self._block[0])
        return MotorState(
            current_a=value('present_current') * self._profile.current_a,
            velocity_rad_s=value('present_velocity') * VELOCITY_RAD_S,
            position_rad=(value('present_position') - ZERO) * POSITION_RAD,
        )

    def _sync_write(self, register: str, values: Mapping[int, int]) -> None:
        address, size = X_SERIES[register]
        group = self._sdk.GroupSyncWrite(self._port, self._packets, address, size)
        for motor, value in values.items():
            group.addParam(motor, list((value % (1 << 8 * size)).to_bytes(size, 'little')))
        with self._line():
            if values and group.txPacket() != SUCCESS:
                raise DeviceError(f"device '{self._device}' did not accept a command; no other program may use it")

    @contextlib.contextmanager
    def _line(self) -> Iterator[None]:
        try:
            yield
        except LINE_FAULTS as error:
            self._port.is_using = False
            raise DeviceError(
                f"the hand on '{self._device}' cannot be reached ({error}); check that it is plugged in, that you may "
                'open the device, and that no other program has it open'
            ) from error


def register_in(data: bytes, first: int, register: str) -> int:
    """Return a register, signed if it is longer than a byte, of a part of the table from the address `first` on."""
    address, size = X_SERIES[register]
    return int.from_bytes(data[address - first : address - first + size], 'little', signed=size > 1)


# --------------------
# A process that switches the torque of the motors off when the process that commanded them is gone.

REPEATS = 5  # a sync write is not answered; one may collide with earlier bytes on the line
PAUSE_S = 0.02


def main() -> None:
    """Run as `python -m texture_exploration.arms.dynamixel SOCKET DEVICE BAUD PACKET`; the hand starts it."""
    _, _, device, baud, packet = sys.argv
    if guard_socket().recv(len(DONE)) == DONE:
        return
    with contextlib.suppress(serial.SerialException, OSError), serial.Serial(device, int(baud), timeout=0) as line:
        for _ in range(REPEATS):
            line.write(bytes.fromhex(packet))
            line.flush()
            time.sleep(PAUSE_S)


if __name__ == '__main__':
    main()
