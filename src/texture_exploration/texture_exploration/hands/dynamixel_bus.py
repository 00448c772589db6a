"""Motors on a Dynamixel bus, in physical units, through the unmodified dynamixel-sdk.

Its calls leave `is_using` set when they fail: one thread alone may use a bus, and after an error the port is made
again. Its reception is a busy loop; a port that waits a little for bytes makes it sleep, and leaves Python's lock to
others.
"""

from __future__ import annotations

import contextlib
import fcntl
import importlib
import os
import termios
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import serial

from texture_core.errors import DeviceError
from texture_exploration.hands.models import describe, goes_on
from texture_exploration.hands.profile import Profile

# An unplugged port raises termios.error from tcflush, which is no OSError.
LINE_FAULTS = (serial.SerialException, OSError, termios.error, TypeError, AttributeError)
PROTOCOL = 2.0
SUCCESS = 0
TRIES = 3
WAIT_S = 0.001
# A status packet: `FF FF FD 00 | id | length | 55 | error | parameters | CRC`; its length counts from the 55 on.
PACKET_ID, PACKET_LENGTH, PACKET_PARAMETERS = 4, 5, 9
NO_PARAMETERS = 4  # length of a status packet without parameters
FIRMWARE = 6  # address of its version, of one byte, in all control tables of protocol 2.0
TRIPPED = 0xFF  # the register of the Bus Watchdog after it has stopped the motor
RESTART_S = 3.0  # a motor has rebooted within
SILENT = 'does not answer'
GARBLED = 'answers with what cannot be read: is its id given to two motors, or the cable damaged?'
RESET = 'has lost its torque: it was reset, as by a dip of its supply'
REMEDY = "; when it has cooled and nothing blocks it, reboot it (service 'reboot') or switch its power off and on"
HARDWARE_ERRORS = {0: 'input voltage', 2: 'overheating', 3: 'encoder', 4: 'electrical shock', 5: 'overload'}


@dataclass(frozen=True)
class MotorState:
    """What a motor measures."""

    current_a: float
    velocity_rad_s: float
    position_rad: float


class NoAnswer(DeviceError):
    """A motor that fell silent while it was told something."""


class _Lock:
    """A lock on a serial device, held by a descriptor of its own, from its making until it is closed.

    Two programs on one bus would take each other's answers, and let each other's motors go. The SDK empties the input
    buffer as it opens the port, answers to another program included; so the lock is taken before.

    Parameters
    ----------
    device
        Path of the device.

    Raises
    ------
    OSError
        If the device cannot be opened, or another program has the lock.
    """

    def __init__(self, device: str) -> None:
        self._descriptor: int | None = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self.close()
            raise

    def __enter__(self) -> _Lock:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the lock; again without effect."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            os.close(descriptor)


class DynamixelBus:
    """All motors of a profile.

    Attributes
    ----------
    missing : set of int
        Motors that do not answer, or not as they should; they are left out until `look_for` finds them.
    limits_a : dict of int to float
        Highest current that each motor takes.
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
        self.limits_a: dict[int, float] = {}
        self.deaf: set[int] = set()  # motors whose watchdog may not stop them
        self._reasons: dict[int, str] = {}  # why a motor is missing, where that is not silence
        self._energised: set[int] = set()
        self._goal_currents: dict[int, int] = {}  # as sent last
        self._device = device
        self._profile = profile
        self._port: Any = self._sdk.PortHandler(device)
        self._packets: Any = self._sdk.PacketHandler(PROTOCOL)
        with self._line(), contextlib.ExitStack() as on_error:
            self._lock = on_error.enter_context(_Lock(device))
            on_error.callback(self.close)
            opened = self._port.openPort() and self._port.setBaudRate(profile.baud)
            if opened:
                on_error.pop_all()
        if not opened:
            raise DeviceError(f"device '{device}' refuses {profile.baud} baud; correct the profile '{profile.name}'")
        self._port.ser.timeout = WAIT_S
        first, last = profile.table['present_current'], profile.table['present_position']
        self._block = (first[0], last[0] + last[1] - first[0])
        first, last = profile.table['torque_enable'], profile.table['goal_current']
        self._health = (first[0], last[0] + last[1] - first[0])
        self._turn = 0
        self._garbled = False  # the last answer

    def close(self) -> None:
        """Close the port; never raises."""
        with contextlib.suppress(*LINE_FAULTS):
            self._port.closePort()
        self._lock.close()

    def start(self) -> None:
        """Find and check the motors, set mode and gains; only when all is well, let them hold where they are.

        Raises
        ------
        DeviceError
            If none answers, one is of another model, reports a hardware error, or does not take what it is told.
        """
        self.torque_off(self._profile.ids)  # a program before may have left it on
        self.missing = set(self._profile.ids)
        found = [motor for motor in self._profile.ids if any(self._prepare(motor) for _ in range(TRIES))]
        if not found:
            raise DeviceError(
                f"no motor answers on '{self._device}' at {self._profile.baud} baud; check power, baud rate and the "
                f"ids of the profile '{self._profile.name}'"
            )
        if errors := [error for motor in found if (error := self.hardware_error(motor))]:
            raise DeviceError('; '.join(errors))
        for motor in found:
            self._energise(motor)

    def look_for(self, motor: int) -> bool:
        """Take a motor in if it answers and is well; return whether that is so."""
        try:
            if not self._prepare(motor):
                return False
            if error := self.hardware_error(motor):
                self._reasons[motor] = error
                return False
            self._energise(motor)
        except NoAnswer:  # a loose contact: no reason to let the others go
            return False
        return True

    def why_missing(self, motor: int) -> str:
        """Return in words why a motor is missing."""
        return self._reasons.get(motor) or f'{self._profile.owner(motor)} {SILENT}'

    def _prepare(self, motor: int) -> bool:
        """Set mode, limits and goals of a motor without torque; return whether it answers."""
        profile = self._profile
        self._reasons.pop(motor, None)
        with self._line():
            model, result, _ = self._packets.ping(self._port, motor)
        self._garbled = result == self._sdk.COMM_RX_CORRUPT
        position = self.read_register(motor, 'present_position') if result == SUCCESS else None
        if position is None:
            if self._garbled:
                self._reasons[motor] = f'{profile.owner(motor)} {GARBLED}'
            return False
        if model not in profile.models:
            raise DeviceError(
                f"{profile.owner(motor)} is of model {describe(model)}; the profile '{profile.name}' is for "
                f'{", ".join(map(describe, profile.models))}, and with another its forces would be wrong; use a '
                'profile for this model'
            )
        self.write(motor, 'torque_enable', 0)  # or the mode cannot be set
        if self.read_register(motor, 'bus_watchdog'):  # old firmware has none and refuses to write it
            self.write(motor, 'bus_watchdog', 0)  # or no goal is taken after it has stopped the motor
        self._arm(motor, 'operating_mode', profile.operating_mode)
        for register, value in profile.gains.items():
            self.write(motor, register, value)
        with self._line():
            firmware, result, _ = self._packets.read1ByteTxRx(self._port, motor, FIRMWARE)
        if result == SUCCESS and goes_on(model, firmware):
            self.deaf.add(motor)
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

    def _energise(self, motor: int) -> None:
        """Arm the motor's watchdog, then switch its torque on: it holds where it is."""
        if self._profile.watchdog:
            self._arm(motor, 'bus_watchdog', self._profile.watchdog)
        self.write(motor, 'torque_enable', 1)
        self._energised.add(motor)
        self.missing.discard(motor)

    def _arm(self, motor: int, register: str, value: int) -> None:
        """Write a register that bounds the force, and read it back: a motor may confirm what it does not keep."""
        self.write(motor, register, value)
        kept = self.read_register(motor, register)
        if kept is None:
            raise NoAnswer(f"{self._profile.owner(motor)} did not tell '{register}': it {SILENT}")
        if kept != value:
            raise DeviceError(
                f"{self._profile.owner(motor)} was told {value} for '{register}' and holds {kept}: what bounds its "
                f"force is not armed; update its firmware, or correct the table of the profile '{self._profile.name}'"
            )

    def reboot(self) -> list[int]:
        """Reboot the motors that report a hardware error, all without torque; return which.

        Raises
        ------
        DeviceError
            If one does not come back, or still reports an error.
        """
        self.torque_off(self._profile.ids)
        latched = [motor for motor in self._profile.ids if self.read_register(motor, 'hardware_error')]
        for motor in latched:
            with self._line():
                self._packets.reboot(self._port, motor)
        for motor in latched:
            self._wait_for_restart(motor)
        return latched

    def _wait_for_restart(self, motor: int) -> None:
        end_s = time.monotonic() + RESTART_S
        while (bits := self.read_register(motor, 'hardware_error')) != 0:
            if time.monotonic() > end_s:
                found = f'still reports {_reasons(bits)}' if bits else SILENT
                raise DeviceError(
                    f'{self._profile.owner(motor)} {found} after a reboot; let it cool, look for what blocks it, and '
                    'switch its power off and on'
                )

    def read(self) -> dict[int, MotorState]:
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
        """Send highest current (A; no more than the motor's limit) and position (rad) of motors."""
        present = {motor: goal for motor, goal in goals.items() if motor not in self.missing}
        profile = self._profile
        currents = {motor: self._counts(motor, current_a) for motor, (current_a, _) in present.items()}
        self._goal_currents.update(currents)
        self._sync_write('goal_current', currents)
        self._sync_write(
            'goal_position', {m: round(p / profile.position_rad) + profile.zero for m, (_, p) in present.items()}
        )

    def torque_off(self, motors: Iterable[int]) -> None:
        """Let motors go, also those that do not answer: they may hear."""
        self._energised.difference_update(motors)
        self._sync_write('torque_enable', dict.fromkeys(motors, 0))

    def let_go(self) -> None:
        """Let all motors go and see that they did, as far as they can be reached; raises nothing that a line does."""
        self._port.is_using = False  # whatever was interrupted
        with contextlib.suppress(DeviceError):
            for _ in range(TRIES):
                self.torque_off(self._profile.ids)
                here = [motor for motor in self._profile.ids if motor not in self.missing]
                if not any(self.read_register(motor, 'torque_enable') for motor in here):
                    return

    def check_next(self) -> str:
        """Look after one motor, another one with each call; return in words what it reports, '' if nothing.

        Raises
        ------
        DeviceError
            If its watchdog has stopped it, or it refuses what it is told.
        """
        present = [motor for motor in self._profile.ids if motor not in self.missing]
        if not present:
            return ''
        motor = present[self._turn % len(present)]
        self._turn += 1
        data, result = self._read_block(motor, *self._health)
        if result != SUCCESS:
            return ''  # that it is silent is noticed elsewhere

        def value(register: str) -> int:
            address, size = self._profile.table[register]
            at = address - self._health[0]
            return int.from_bytes(data[at : at + size], 'little')

        owner, watchdog = self._profile.owner(motor), self._profile.watchdog
        if bits := value('hardware_error'):
            return f'{owner} reports {_reasons(bits)}{REMEDY}'
        if motor not in self._energised:
            return ''
        if value('bus_watchdog') == TRIPPED:
            raise DeviceError(
                f'{owner} heard nothing for {self._profile.watchdog_s:g} s, and its watchdog stopped it: the computer '
                'or the bus was held up; all motors were let go'
            )
        if not value('torque_enable') or (watchdog and value('bus_watchdog') != watchdog):
            self._reasons[motor] = f'{owner} {RESET}'
            self._energised.discard(motor)
            self.missing.add(motor)
        elif signed(value('goal_current'), 2) != self._goal_currents[motor]:
            # Nobody answers to what is sent to all motors at once. Lost on the way, or refused: then this tells why.
            self.write(motor, 'goal_current', self._goal_currents[motor])
        return ''

    def hardware_error(self, motor: int) -> str:
        """Return in words which hardware error a motor reports and what to do, '' if none."""
        bits = self.read_register(motor, 'hardware_error')
        return f'{self._profile.owner(motor)} reports {_reasons(bits)}{REMEDY}' if bits else ''

    def _counts(self, motor: int, current_a: float) -> int:
        """Return a current in counts, no more than the motor takes: it would refuse the whole command."""
        limit_a = self.limits_a[motor]
        return round(min(limit_a, max(-limit_a, current_a)) / self._profile.current_a)

    def write(self, motor: int, register: str, value: int) -> None:
        """Write one register, and see that it was taken.

        Parameters
        ----------
        motor
            Id of the motor on the bus.
        register
            Name of the register in the table of the profile.
        value
            Signed number in the unit of the register.

        Raises
        ------
        NoAnswer
            If the motor does not answer after some tries.
        DeviceError
            If the motor refuses the value.
        """
        address, size = self._profile.table[register]
        send = {1: 'write1ByteTxRx', 2: 'write2ByteTxRx', 4: 'write4ByteTxRx'}[size]
        for _ in range(TRIES):
            with self._line():
                result, error = getattr(self._packets, send)(self._port, motor, address, value % (1 << 8 * size))
            if result == SUCCESS:
                break
        if result != SUCCESS:
            why = self._packets.getTxRxResult(result)
            raise NoAnswer(f"{self._profile.owner(motor)} did not take '{register}': {why}")
        # The highest bit only tells that there is a hardware error, which is asked for by itself.
        if error & 0x7F:
            why = self._packets.getRxPacketError(error & 0x7F)
            raise DeviceError(f"{self._profile.owner(motor)} did not take '{register}': {why}")

    def read_register(self, motor: int, register: str) -> int | None:
        """Return one register, signed if it is longer than a byte; None if the motor does not answer."""
        address, size = self._profile.table[register]
        for _ in range(TRIES):
            data, result = self._read_block(motor, address, size)
            self._garbled = result == self._sdk.COMM_RX_CORRUPT
            if result == SUCCESS:
                value = int.from_bytes(data, 'little')
                return signed(value, size) if size > 1 else value
        return None

    def _read_block(self, motor: int, address: int, size: int) -> tuple[bytes, int]:
        """Return `size` bytes of a motor's table, and the result of the SDK.

        The SDK cuts its data out of any packet of the motor, and out of the checksum if the packet is too short. The
        late answer to an earlier question, such as a ping, would be taken for a position or a current limit.
        """
        with self._line():
            result = self._packets.readTx(self._port, motor, address, size)
            while result == SUCCESS:
                packet, result = self._packets.rxPacket(self._port, False)
                if result == SUCCESS and packet[PACKET_ID] == motor:
                    length = packet[PACKET_LENGTH] + (packet[PACKET_LENGTH + 1] << 8)
                    if length == size + NO_PARAMETERS:
                        return bytes(packet[PACKET_PARAMETERS : PACKET_PARAMETERS + size]), result
        return b'', result

    def _answers(self, motor: int) -> bool:
        with self._line():
            # That all were asked at once was the first try.
            return any(self._packets.ping(self._port, motor)[1] == SUCCESS for _ in range(TRIES - 1))

    def _measured(self, group: Any, motor: int) -> MotorState:
        profile = self._profile

        def value(register: str) -> int:
            address, size = profile.table[register]
            return signed(group.getData(motor, address, size), size)

        return MotorState(
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


def _reasons(bits: int) -> str:
    """Return the bits of the register Hardware Error Status in words."""
    known = [text for bit, text in HARDWARE_ERRORS.items() if bits >> bit & 1]
    return ' and '.join(known) or f'hardware error {bits:#04x}'


def signed(value: int, size: int) -> int:
    """Return a register of `size` bytes as a signed number: the SDK gives all as unsigned."""
    return value - (1 << 8 * size) if value >> (8 * size - 1) & 1 else value
