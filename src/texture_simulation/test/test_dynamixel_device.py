# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The emulated Dynamixel bus, by the bytes of protocol 2.0."""

import struct
import time
from contextlib import closing
from pathlib import Path

import pytest

from texture_core.types import FingerReceiver, FingerState
from texture_simulation.devices.dynamixel import (
    LEAP_FINGERS,
    OVERLOAD,
    DynamixelMotors,
    EmulatedDynamixelBus,
    PressingMotor,
    crc16,
    leap_hand,
)

pytestmark = pytest.mark.realtime

DEADLINE_S = 20.0
PING_1 = bytes.fromhex('fffffd00010300 01 194e'.replace(' ', ''))


@pytest.fixture
def bus():
    return EmulatedDynamixelBus(Path('/nowhere'), DynamixelMotors([1, 2], {1: PressingMotor(0.1, 0.01)}))


def packet(motor, instruction, params=b''):
    body = bytes([instruction]) + params.replace(b'\xff\xff\xfd', b'\xff\xff\xfd\xfd')
    content = b'\xff\xff\xfd\x00' + bytes([motor]) + struct.pack('<H', len(body) + 2) + body
    return content + struct.pack('<H', crc16(content))


def write(motor, address, value, size):
    return packet(motor, 3, struct.pack('<H', address) + (value % (1 << 8 * size)).to_bytes(size, 'little'))


def read(bus, motor, address, form):
    answer = bus.receive(packet(motor, 2, struct.pack('<HH', address, struct.calcsize(form))))
    return struct.unpack(form, answer[9:-2])[0]


def test_the_checksum_is_that_of_the_protocol():
    assert crc16(b'123456789') == 0xFEE8
    assert packet(1, 1) == PING_1


def test_a_ping_in_pieces_is_answered_with_the_model_and_noise_with_nothing(bus):
    assert bus.receive(b'\x00\xff' + PING_1[:-1] + b'\x00') == b''
    assert bus.receive(PING_1[:4]) == b''
    answer = bus.receive(PING_1[4:])
    assert answer[4] == 1
    assert struct.unpack('<H', answer[9:11])[0] == 1240


def test_a_sync_read_ends_at_the_first_that_is_silent(bus):
    bus.motors.absent = {1}
    ask = packet(0xFE, 0x82, struct.pack('<HH', 132, 4) + bytes([1, 2]))
    assert bus.receive(ask) == b''
    bus.motors.absent = set()
    assert bus.receive(ask).count(b'\xff\xff\xfd\x00') == 2


@pytest.mark.parametrize('stiffness_n_m', [2000.0, 1e5])
def test_the_goal_current_bounds_the_force_however_stiff_the_object(bus, stiffness_n_m):
    bus.motors.stiffness_n_m = stiffness_n_m
    for address, value, size in ((84, 600, 2), (102, 200, 2), (116, 2048 + 400, 4), (64, 1, 1)):
        bus.receive(write(1, address, value, size))
    bus.motors.advance(4000)
    for _ in range(20):
        bus.motors.advance(1)
        # current · torque constant / lever
        assert bus.motors.forces_n[1] == pytest.approx(0.2 * 0.517 / 0.1, rel=0.01)
    assert read(bus, 1, 126, '<h') == 200


ALERT, RANGE, LENGTH, LIMIT, ACCESS = 0x80, 4, 5, 6, 7
S = 2000  # steps of the mechanics in a second


def error_of(bus, request):
    return bus.receive(request)[8]


def pressed(bus):
    """Let motor 1 press with 0.2 A, watched for 0.1 s."""
    for address, value, size in ((84, 600, 2), (98, 5, 1), (102, 200, 2), (116, 2048 + 400, 4), (64, 1, 1)):
        assert error_of(bus, write(1, address, value, size)) == 0
    for _ in range(20):
        bus.motors.advance(S // 20)
        bus.receive(packet(2, 1))  # to another motor


def test_a_motor_that_hears_nothing_stops_and_takes_no_goal_until_its_watchdog_is_cleared(bus):
    pressed(bus)
    assert bus.motors.forces_n[1] == pytest.approx(0.2 * 0.517 / 0.1, rel=0.01)
    assert read(bus, 1, 98, '<b') == 5
    place = read(bus, 1, 132, '<i')
    bus.motors.advance(S // 5)
    assert read(bus, 1, 98, '<b') == -1
    assert read(bus, 1, 116, '<i') == place
    assert read(bus, 1, 64, '<b') == 1  # it stops, and holds
    # What is left of the force: gain 600 · 0.005 A/rad · 0.517 N·m/A against 2000 N/m · (0.1 m)²
    assert bus.motors.forces_n[1] < 0.2 * 0.2 * 0.517 / 0.1
    for address, size in ((100, 2), (102, 2), (104, 4), (116, 4)):
        assert error_of(bus, write(1, address, 100, size)) == RANGE
    assert error_of(bus, write(1, 98, 0, 1)) == 0
    assert error_of(bus, write(1, 102, 100, 2)) == 0


def test_a_watchdog_that_is_not_armed_or_without_torque_does_not_trip(bus):
    bus.receive(write(1, 64, 1, 1))
    bus.receive(write(2, 98, 1, 1))
    bus.motors.advance(S)
    assert (read(bus, 1, 98, '<b'), read(bus, 2, 98, '<b')) == (0, 1)


def test_an_overload_ends_the_torque_until_a_reboot(bus):
    pressed(bus)
    bus.motors.fail(1, OVERLOAD)
    assert read(bus, 1, 64, '<b') == 0
    assert error_of(bus, packet(1, 1)) == ALERT
    assert error_of(bus, write(1, 64, 1, 1)) == ALERT | ACCESS
    assert error_of(bus, write(1, 64, 0, 1)) == ALERT
    assert error_of(bus, packet(1, 8)) == ALERT
    assert bus.receive(packet(1, 1)) == b''  # it starts
    bus.motors.advance(S)
    assert error_of(bus, packet(1, 1)) == 0
    assert error_of(bus, write(1, 64, 1, 1)) == 0
    assert read(bus, 1, 98, '<b') == 0
    assert read(bus, 1, 84, '<h') == 400


def test_what_a_motor_refuses_it_answers_and_does_not_do(bus):
    assert error_of(bus, write(1, 102, 1751, 2)) == LIMIT
    assert error_of(bus, write(1, 102, -1751, 2)) == LIMIT
    assert error_of(bus, write(1, 102, 1, 1)) == LENGTH
    assert error_of(bus, write(1, 126, 1, 2)) == ACCESS  # what is measured
    assert error_of(bus, packet(1, 0x77)) == 2  # no such instruction
    bus.receive(write(1, 64, 1, 1))
    assert error_of(bus, write(1, 11, 5, 1)) == ACCESS  # its mode, under torque
    bus.receive(packet(0xFE, 0x83, struct.pack('<HHBHBH', 102, 2, 1, 1751, 2, 100)))
    assert (read(bus, 1, 102, '<h'), read(bus, 2, 102, '<h')) == (1750, 100)


def test_the_bench_is_reported_where_the_finger_is_and_how_hard_it_presses(tmp_path):
    motors, finger = leap_hand(), LEAP_FINGERS['index']
    # 174 mA · 0.517 N·m/A / 0.09 m = 1 N
    for motor, current_ma, angle_rad in ((finger.press, 174, 0.4), (finger.across, 350, 0.1)):
        motors.write(motor, 84, struct.pack('<H', 600))
        motors.write(motor, 102, struct.pack('<h', current_ma))
        motors.write(motor, 116, struct.pack('<i', 2048 + round(angle_rad / 0.001533981)))
        motors.write(motor, 64, b'\1')
    deadline = time.monotonic() + DEADLINE_S
    path = str(tmp_path / 'finger')
    with closing(FingerReceiver(path)) as emulator:
        state = FingerState(0)
        with EmulatedDynamixelBus(tmp_path / 'bus', motors, finger, path):
            while state.x_m < 0.0085 or state.force_n < 0.95:
                assert time.monotonic() < deadline
                [*_, state] = emulator.states(DEADLINE_S)
    assert state.x_m == pytest.approx(0.009, abs=5e-4)
    assert state.y_m == 0.0
    assert state.force_n == pytest.approx(1.0, rel=0.05)
    assert state.z_m == pytest.approx(-state.force_n / 2000.0)
