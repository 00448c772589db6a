# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sensor on a pseudo-terminal fed with packets made by hand."""

from __future__ import annotations

import fcntl
import os
import struct
import termios
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from texture_core.types import NANOSECONDS, TactileSignal
from texture_drivers.sensor import SensorParams
from texture_drivers.tsf85 import AUTOSEND, DYNAMIC, STATIC, TIMESTAMP, Item, Packet, Tsf85, Tsf85Parser

DEADLINE_S = 10.0


class Wire:
    """The device's end of a pseudo-terminal behind a link."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self.plug()

    def plug(self) -> None:
        self.device, self.host = os.openpty()
        tty.setraw(self.host)
        os.set_blocking(self.device, False)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(self.host))

    def unplug(self) -> None:
        os.close(self.device)
        os.close(self.host)

    def heard(self) -> bytes:
        try:
            return os.read(self.device, 100)
        except BlockingIOError:
            return b''

    def say(self, stamp_ms: int, dynamic: int, image: list[int] | None = None, more: bytes = b'') -> int:
        """Send a packet, and return how many bytes it has."""
        items = b'\x70' + struct.pack('>Q', stamp_ms) + b'\x20' + struct.pack('>h', dynamic) + more
        if image:
            items += b'\x10' + struct.pack(f'>{len(image)}H', *image)
        return os.write(self.device, bytes([0x9A, 0, 0x58, len(items)]) + items)

    def wait_until_there(self, count: int) -> None:
        """Wait until this many bytes can be read: the kernel transfers them asynchronously."""
        deadline_s = time.monotonic() + DEADLINE_S
        while struct.unpack('i', fcntl.ioctl(self.host, termios.FIONREAD, bytes(4)))[0] < count:
            assert time.monotonic() < deadline_s
            time.sleep(0.001)


class Clock:
    """The host's clock, advanced by the test."""

    def __init__(self) -> None:
        self.now_ns = 1_700_000_000 * NANOSECONDS

    def __call__(self) -> int:
        return self.now_ns


@pytest.fixture
def wire(tmp_path: Path) -> Iterator[Wire]:
    made = Wire(tmp_path / 'tsf85')
    yield made
    made.unplug()


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def sensor(wire: Wire, clock: Clock) -> Iterator[Tsf85]:
    made = Tsf85(SensorParams(device=str(wire.link), batch_s=0.001), clock)
    yield made
    made.close()


class Feeder:
    """Send milliseconds at the pace of the clock and collect what the sensor delivers."""

    def __init__(self, wire: Wire, sensor: Tsf85, clock: Clock) -> None:
        self.wire, self.sensor, self.clock = wire, sensor, clock
        self.signal: list[TactileSignal] = []
        self.static: list[TactileSignal] = []
        self.others: dict[str, list[TactileSignal]] = {}
        self.stamp_ms = 5000

    def run(
        self, milliseconds: int, missing: tuple[int, ...] = (), image: list[int] | None = None, more: bytes = b''
    ) -> None:
        for first in range(0, milliseconds, 10):
            sent = 0
            for ms in range(first, min(first + 10, milliseconds)):
                if ms not in missing:
                    sent += self.wire.say(self.stamp_ms, ms % 1000, image, more)
                self.stamp_ms += 1
                self.clock.now_ns += NANOSECONDS // 1000
            self.wire.wait_until_there(sent)
            self.read()

    def read(self) -> None:
        batches = self.sensor.read()
        self.signal += batches.get('signal', [])
        self.static += batches.get('signal_static', [])
        for topic, found in batches.items():
            self.others.setdefault(topic, []).extend(found)


@pytest.fixture
def feeder(wire: Wire, sensor: Tsf85, clock: Clock) -> Feeder:
    sensor.open()
    return Feeder(wire, sensor, clock)


def indices(batches: list[TactileSignal]) -> list[int]:
    return [batch.first_sample + i for batch in batches for i in range(len(batch.samples))]


def test_it_starts_the_stream_on_opening_and_stops_it_on_closing(wire: Wire, sensor: Tsf85) -> None:
    sensor.open()
    assert wire.heard() == bytes.fromhex('9A 00 58 01 01')
    sensor.close()
    sensor.close()
    assert wire.heard() == bytes.fromhex('9A 00 58 01 00')


def test_an_image_repeated_each_millisecond_is_published_at_60_hz(feeder: Feeder) -> None:
    feeder.run(1100, image=list(range(9000, 9028)))
    numbers = indices(feeder.static)
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    assert len(numbers) == pytest.approx(60, abs=2)
    assert feeder.static[-1].samples.tolist() == [list(range(9000, 9028))]
    ahead_ns = feeder.static[-1].stamp_ns - feeder.signal[0].stamp_ns
    assert ahead_ns / NANOSECONDS == pytest.approx(numbers[-1] / 60 - feeder.signal[0].first_sample / 1000, abs=1e-5)


def test_an_image_that_has_not_come_for_long_is_not_published(feeder: Feeder) -> None:
    feeder.run(200, image=list(range(28)))
    feeder.run(1000)
    assert len(feeder.static) < 25


@pytest.mark.parametrize('kept_ms', [0, 100, 250])
def test_what_a_frozen_device_sends_late_is_not_taken_for_new(feeder: Feeder, kept_ms: int) -> None:
    feeder.run(300)
    for _ in range(4):  # it stands still for 1.5 s, is started again, sends what it kept in two pieces, and goes on
        feeder.sensor.open()
        feeder.clock.now_ns += 1500 * NANOSECONDS // 1000
        feeder.stamp_ms += 1500 - kept_ms
        for ms in range(kept_ms):
            feeder.wire.say(feeder.stamp_ms + ms, ms)
            if ms == 5:
                feeder.read()
        feeder.stamp_ms += kept_ms
        feeder.read()
        feeder.run(300)
    first, last = feeder.signal[0], feeder.signal[-1]
    index_s, time_s = (last.first_sample - first.first_sample) / 1000, (last.stamp_ns - first.stamp_ns) / NANOSECONDS
    assert time_s == pytest.approx(
        7.39, abs=0.005
    )  # of 7.5 s: not the first 0.1 s, and the last batch begins 10 ms before
    assert index_s == pytest.approx(time_s, abs=0.005)
    assert feeder.sensor.counts['samples'] + feeder.sensor.counts['lost'] == last.next_sample - first.first_sample


def test_acceleration_and_rotation_come_in_si_units_with_the_dynamic_values(feeder: Feeder) -> None:
    feeder.run(200, more=bytes.fromhex('30 0000 C000 4000') + b'\x40' + struct.pack('>3h', 0, -13107, 13107))
    imu = feeder.others['signal_imu']
    assert indices(imu) == indices(feeder.signal)
    assert [batch.stamp_ns for batch in imu] == [batch.stamp_ns for batch in feeder.signal]
    assert imu[0].channels[:1] + imu[0].channels[-1:] == ('acceleration_x', 'rotation_z')
    assert imu[0].units == ('m/s²', 'm/s²', 'm/s²', 'rad/s', 'rad/s', 'rad/s')
    turn = np.deg2rad(99.9985)  # 13107 / 131.072 degrees a second
    np.testing.assert_allclose(imu[-1].samples[-1], [0, -9.80665, 9.80665, 0, -turn, turn], rtol=1e-5)


def test_what_the_finger_does_not_measure_is_nan_or_not_published(feeder: Feeder) -> None:
    feeder.run(200)
    assert feeder.others['signal_imu'] == []
    feeder.run(20, more=bytes.fromhex('30 0000 0000 4000'))
    assert np.isnan(feeder.others['signal_imu'][-1].samples[-1]).tolist() == [False] * 3 + [True] * 3


def test_the_inertial_channels_are_published_unless_the_settings_say_no(wire: Wire, clock: Clock) -> None:
    sensor = Tsf85(SensorParams(device=str(wire.link), batch_s=0.001, config='{imu: false}'), clock)
    sensor.open()
    feeder = Feeder(wire, sensor, clock)
    feeder.run(200, more=bytes.fromhex('30 0000 0000 4000 40 0000 0000 0000 50 0001 0000 0000'))
    sensor.close()
    assert feeder.signal
    assert 'signal_imu' not in sensor.expected_rates_hz
    assert not feeder.others['signal_imu']


def test_both_fingers_are_read_through_one_opening(wire: Wire, clock: Clock) -> None:
    sensor = Tsf85(SensorParams(device=str(wire.link), batch_s=0.001), clock, fingers=(0, 1))
    sensor.open()
    feeder = Feeder(wire, sensor, clock)
    feeder.run(300, missing=(200,), more=bytes.fromhex('24 0007') + b'\x14' + struct.pack('>28H', *range(28)))
    sensor.close()
    assert set(sensor.expected_rates_hz) == {
        f'finger{finger}/{topic}' for finger in (0, 1) for topic in ('signal', 'signal_static', 'signal_imu')
    }
    first, second = feeder.others['finger0/signal'], feeder.others['finger1/signal']
    assert indices(first) == indices(second)
    assert np.unique(np.concatenate([batch.samples for batch in second])).tolist() == [7.0]
    assert feeder.others['finger1/signal_static'][0].samples.tolist() == [list(range(28))]
    assert feeder.others['finger0/signal_static'] == []
    assert (sensor.counts['samples'], sensor.counts['lost']) == (2 * len(indices(first)), 2)


# Written by hand from the protocol: autosend, 8 bytes of payload: stamp 0x6C1E ms, finger 0: 258, ...
SHORT_STAMP = bytes.fromhex('9A 00 58 06 70 6C1E 20 0102')
LONG_STAMP = bytes.fromhex('9A 00 58 0F 70 0000000000006C1E 20 FFFE 24 8000')
IMAGE = bytes.fromhex('9A 00 58 39 14') + bytes(range(56))
INERTIAL = bytes.fromhex('9A 7F 61 07 30 0001 FFFF 4000')


@pytest.mark.parametrize(
    ('packet', 'items'),
    [
        (SHORT_STAMP, [(TIMESTAMP, 0, (0x6C1E,)), (DYNAMIC, 0, (258,))]),
        (LONG_STAMP, [(TIMESTAMP, 0, (0x6C1E,)), (DYNAMIC, 0, (-2,)), (DYNAMIC, 1, (-32768,))]),
        (IMAGE, [(STATIC, 1, tuple(range(0x0001, 0x3800, 0x0202)))]),  # 28 taxels, big-endian
    ],
)
def test_the_items_of_a_packet_are_read(packet: bytes, items: list[tuple[int, int, tuple[int, ...]]]) -> None:
    assert Tsf85Parser().feed(packet) == [Packet(AUTOSEND, tuple(Item(*item) for item in items))]


def test_a_packet_comes_out_with_its_last_byte_wherever_the_stream_is_cut() -> None:
    stream = SHORT_STAMP + LONG_STAMP + IMAGE + INERTIAL
    parser = Tsf85Parser()
    came = [len(parser.feed(stream[i : i + 1])) for i in range(len(stream))]
    assert sum(came) == 4
    assert came[len(SHORT_STAMP) - 1] == 1
    assert parser.refused_bytes == 0


@pytest.mark.parametrize(
    ('reason', 'packet'),
    [
        ("one finger's dynamic value twice, the other's with a flipped bit", '9A 00 58 06 20 0102 20 0304'),
        ('no data command', '9A 00 E3 03 20 0102'),
        ('unknown type 0x80', '9A 00 58 03 80 0102'),
        ('index bits', '9A 00 58 03 21 0102'),
        ('third finger', '9A 00 58 03 28 0102'),
        ('items too short for the payload', '9A 00 58 04 20 0102 00'),
        ('items too long for the payload', '9A 00 58 02 20 01'),
        ('no item', '9A 00 58 00'),
    ],
)
def test_a_packet_is_refused_for(reason: str, packet: str) -> None:
    parser = Tsf85Parser()
    assert parser.feed(bytes.fromhex(packet) + SHORT_STAMP) == Tsf85Parser().feed(SHORT_STAMP), reason
    assert parser.refused >= 1
    assert parser.refused_bytes == len(bytes.fromhex(packet))


def test_a_packet_that_lost_a_byte_is_refused_even_if_the_stream_pauses_there() -> None:
    parser = Tsf85Parser()
    assert parser.feed(SHORT_STAMP[:-1] + b'\x9a') == []
    assert len(parser.feed(SHORT_STAMP[1:])) == 1


@given(st.binary(max_size=600))
def test_the_stream_is_found_again_after_any_noise(noise: bytes) -> None:
    packets = Tsf85Parser().feed(noise + SHORT_STAMP * 60)
    assert packets[-20:] == Tsf85Parser().feed(SHORT_STAMP) * 20
