"""Motors on a Dynamixel bus, in physical units, through the unmodified dynamixel-sdk.

Its calls leave `is_using` set when they fail: one thread alone may use a bus, and after an error the port is made anew.
Its reception is a busy loop; a port that waits a little for bytes makes it sleep, and leaves Python's lock to others.
"""

from __future__ import annotations

import contextlib
import importlib
import termios
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import serial

from texture_core.errors import DeviceError
from texture_exploration.hands.profile import Profile

# An unplugged port raises termios.error from tcflush, which is no OSError.
LINE_FAULTS = (serial.SerialException, OSError, termios.error, TypeError, AttributeError)
PROTOCOL = 2.0
SUCCESS = 0
TRIES = 3
WAIT_S = 0.001
HARDWARE_ERRORS = {0: 'input voltage', 2: 'overheating', 3: 'encoder', 4: 'electrical shock', 5: 'overload'}


@dataclass(frozen=True)
class Motor:
    """What a motor measures."""

    current_a: float
    velocity_rad_s: float
    position_rad: float


class DynamixelBus:
    """All motors of a profile.

    Attributes
    ----------
    missing : set of int
        Motors that do not answer; they are left out until `look_for` finds them.
    """

    def __init__(self, device: str, profile: Profile) -> None:
        try:
            self._sdk: Any = importlib.import_module('dynamixel_sdk')
        except ImportError as error:
            raise DeviceError(
                "a Dynamixel hand needs the package dynamixel-sdk, which is not installed here: 'pip install "
                "dynamixel-sdk==4.1.0'"
            ) from error
        self.missing: set[int] = set()
        self._device = device
        self._profile = profile
        self._port: Any = self._sdk.PortHandler(device)
        self._packets: Any = self._sdk.PacketHandler(PROTOCOL)
        with self._line():
            opened = self._port.openPort() and self._port.setBaudRate(profile.baud)
        if not opened:
            raise DeviceError(f"device '{device}' refuses {profile.baud} baud; correct the profile '{profile.name}'")
        self._port.ser.timeout = WAIT_S
        first, last = profile.table['present_current'], profile.table['present_position']
        self._block = (first[0], last[0] + last[1] - first[0])
        self._turn = 0

    def close(self) -> None:
        """Close the port; never raises."""
        with contextlib.suppress(*LINE_FAULTS):
            self._port.closePort()

    def start(self) -> None:
        """Find the motors, set mode and gains, let them hold where they are.

        Raises
        ------
        DeviceError
            If none answers, or one is of another model.
        """
        self.missing = set(self._profile.ids)
        for motor in self._profile.ids:
            any(self.look_for(motor) for _ in range(TRIES))
        if len(self.missing) == len(self._profile.ids):
            raise DeviceError(
                f"no motor answers on '{self._device}' at {self._profile.baud} baud; check power, baud rate and the "
                f"ids of the profile '{self._profile.name}'"
            )

    def look_for(self, motor: int) -> bool:
        """Take a motor in if it answers; return whether it does."""
        with self._line():
            model, result, _ = self._packets.ping(self._port, motor)
        position = self.read_register(motor, 'present_position') if result == SUCCESS else None
        if position is None:
            return False
        if model not in self._profile.models:
            raise DeviceError(
                f"{self._profile.owner(motor)} is of model {model}; the profile '{self._profile.name}' is for "
                f'{", ".join(map(str, self._profile.models))}'
            )
        self.write(motor, 'torque_enable', 0)  # or the mode cannot be set
        self.write(motor, 'operating_mode', self._profile.operating_mode)
        for register, value in self._profile.gains.items():
            self.write(motor, register, value)
        self.write(motor, 'goal_current', round(self._profile.move_a / self._profile.current_a))
        self.write(motor, 'goal_position', position)
        self.write(motor, 'torque_enable', 1)
        self.missing.discard(motor)
        return True

    def read(self) -> dict[int, Motor]:
        """Return what all motors measure, {} if a cycle is lost; who does not answer is moved to `missing`."""
        asked = [motor for motor in self._profile.ids if motor not in self.missing]
        group = self._sdk.GroupSyncRead(self._port, self._packets, *self._block)
        for motor in asked:
            group.addParam(motor)
        with self._line():
            result = group.txRxPacket() if asked else SUCCESS
        if result != SUCCESS:
            # They answer in turn: the first that is silent hides all that come after it.
            silent = next(motor for motor in asked if not group.data_dict[motor])
            if not self._answers(silent):
                self.missing.add(silent)
            return {}
        # An answer that came too late for an earlier question is taken for one to this: it is shorter.
        if any(len(group.data_dict[motor]) != group.data_length for motor in asked):
            return {}
        return {motor: self._measured(group, motor) for motor in asked}

    def write_goals(self, goals: Mapping[int, tuple[float, float]]) -> None:
        """Send highest current (A) and position (rad) of motors."""
        present = {motor: goal for motor, goal in goals.items() if motor not in self.missing}
        profile = self._profile
        self._sync_write('goal_current', {m: round(a / profile.current_a) for m, (a, _) in present.items()})
        self._sync_write(
            'goal_position', {m: round(p / profile.position_rad) + profile.zero for m, (_, p) in present.items()}
        )

    def torque_off(self, motors: Iterable[int]) -> None:
        """Let motors go, also those that do not answer: they may hear."""
        self._sync_write('torque_enable', dict.fromkeys(motors, 0))

    def next_hardware_error(self) -> str:
        """Ask one motor after the other, one with each call; return in words what it reports, '' if nothing."""
        present = [motor for motor in self._profile.ids if motor not in self.missing]
        if not present:
            return ''
        motor = present[self._turn % len(present)]
        self._turn += 1
        bits = self.read_register(motor, 'hardware_error') or 0
        reasons = [text for bit, text in HARDWARE_ERRORS.items() if bits >> bit & 1]
        return f'{self._profile.owner(motor)} reports {" and ".join(reasons)}' if reasons else ''

    def write(self, motor: int, register: str, value: int) -> None:
        """Write one register, and see that it was taken."""
        address, size = self._profile.table[register]
        send = {1: 'write1ByteTxRx', 2: 'write2ByteTxRx', 4: 'write4ByteTxRx'}[size]
        for _ in range(TRIES):
            with self._line():
                result, error = getattr(self._packets, send)(self._port, motor, address, value % (1 << 8 * size))
            if result == SUCCESS:
                break
        # The highest bit only tells that there is a hardware error, which is asked for by itself.
        if result != SUCCESS or error & 0x7F:
            why = self._packets.getTxRxResult(result) if result else self._packets.getRxPacketError(error & 0x7F)
            raise DeviceError(f"{self._profile.owner(motor)} did not take '{register}': {why}")

    def read_register(self, motor: int, register: str) -> int | None:
        """Return one register, signed if it is longer than a byte; None if the motor does not answer."""
        address, size = self._profile.table[register]
        ask = {1: 'read1ByteTxRx', 2: 'read2ByteTxRx', 4: 'read4ByteTxRx'}[size]
        for _ in range(TRIES):
            with self._line():
                value, result, _error = getattr(self._packets, ask)(self._port, motor, address)
            if result == SUCCESS:
                return signed(value, size) if size > 1 else int(value)
        return None

    def _answers(self, motor: int) -> bool:
        with self._line():
            # That all were asked at once was the first try.
            return any(self._packets.ping(self._port, motor)[1] == SUCCESS for _ in range(TRIES - 1))

    def _measured(self, group: Any, motor: int) -> Motor:
        profile = self._profile

        def value(register: str) -> int:
            address, size = profile.table[register]
            return signed(group.getData(motor, address, size), size)

        return Motor(
            current_a=value('present_current') * profile.current_a,
            velocity_rad_s=value('present_velocity') * profile.velocity_rad_s,
            position_rad=(value('present_position') - profile.zero) * profile.position_rad,
        )

    def _sync_write(self, register: str, values: Mapping[int, int]) -> None:
        address, size = self._profile.table[register]
        group = self._sdk.GroupSyncWrite(self._port, self._packets, address, size)
        for motor, value in values.items():
            group.addParam(motor, list((value % (1 << 8 * size)).to_bytes(size, 'little')))
        with self._line():
            if values and group.txPacket() != SUCCESS:
                raise DeviceError(f"device '{self._device}' did not take an order; no other program may use it")

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


def signed(value: int, size: int) -> int:
    """Return a register of `size` bytes as a signed number: the SDK gives all as unsigned."""
    return value - (1 << 8 * size) if value >> (8 * size - 1) & 1 else value
