# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages of other drivers become signals by a mapping; each shipped one is tried with the fields of its vendor."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace as Message
from typing import Any

import numpy as np
import pytest

from texture_core.config import shipped
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import NANOSECONDS, TactileSignal
from texture_drivers.adaptor import PeriodMeter, SignalAdaptor, SignalMapping, compile_path, load_mapping

START_NS = 1_700_000_000 * NANOSECONDS
MS = 1_000_000
Make = Callable[[int, int], Any]  # number of the message and its time, ns


def header(stamp_ns: int) -> Message:
    sec, nanosec = divmod(stamp_ns, NANOSECONDS)
    return Message(stamp=Message(sec=sec, nanosec=nanosec), frame_id='')


def vector(x: float, y: float, z: float) -> Message:
    return Message(x=x, y=y, z=z)


def biotac_hand(n: int, ns: int, **changes: Any) -> Message:
    """A BioTacHand with BioTacs at positions 1 and 3."""
    fields = [
        {
            'bt_serial': f'BT-{place}', 'bt_position': place, 'tdc_data': 1000 * place, 'tac_data': 2000,
            'pdc_data': 2200, 'pac_data': list(range(100 * place, 100 * place + 22)),
            'electrode_data': list(range(1, 20)),
        }
        for place in (1, 3)
    ]  # fmt: skip
    return Message(header=header(ns), hand_id='left', bt_data=[Message(**{**field, **changes}) for field in fields])


def biotac_all(n: int, ns: int) -> Message:
    finger = Message(pac0=1, pac1=2, pac=[3] * 20, pdc=2200, tac=2000, tdc=1000, electrodes=list(range(1, 20)))
    return Message(header=header(ns), tactiles=[finger] * 5)


def papillarray(n: int, ns: int) -> Message:
    pillars = [
        Message(id=i, dx=i, dy=i + 10, dz=i + 20, fx=i + 30, fy=i + 40, fz=i + 50, in_contact=True, slip_state=0)
        for i in range(9)
    ]
    wrench = {'gfx': 1.0, 'gfy': 2.0, 'gfz': 3.0, 'gtx': 4.0, 'gty': 5.0, 'gtz': 6.0}
    return Message(header=header(ns), tus=n * 2000, pillars=pillars, **wrench)


def xela(n: int, ns: int) -> Message:
    taxels = [Message(x=16_000 + i, y=17_000 + i, z=18_000 + i) for i in range(16)]
    sensor = Message(message=n, time=ns / 1e9, model='uSPa44', sensor_pos=0, taxels=taxels, forces=[], temperatures=[])
    return Message(sensors=[sensor])


ONE = Message(value=7)
# Mapping, signal: message, rate of messages, finger, what the last row is.
CASES: dict[tuple[str, str], tuple[Make, float, int, list[float]]] = {
    ('robotiq_tsf', 'signal'): (lambda n, ns: Message(data=[Message(value=0), ONE]), 1000, 1, [7]),
    ('robotiq_tsf', 'signal_static'): (
        lambda n, ns: Message(taxels=[Message(values=list(range(28))), Message(values=[0] * 28)]), 60, 0, [*range(28)],
    ),
    ('tactilesensors4', 'signal'): (lambda n, ns: ONE, 1000, 0, [7]),
    ('tactilesensors4', 'signal_static'): (lambda n, ns: Message(value=[3] * 28), 60, 0, [3] * 28),
    ('biotac_sensors', 'signal'): (biotac_hand, 100, 2, [321]),
    ('biotac_sensors', 'signal_static'): (biotac_hand, 100, 2, [3000, 2000, 2200, *range(1, 20)]),
    ('sr_robot_msgs', 'signal'): (biotac_all, 100, 4, [3]),
    ('sr_robot_msgs', 'signal_static'): (biotac_all, 100, 4, [1000, 2000, 2200, *range(1, 20)]),
    ('papillarray', 'signal'): (papillarray, 500, 0, [*range(30, 39), *range(40, 49), *range(50, 59), *range(9),
                                                      *range(10, 19), *range(20, 29)]),
    ('papillarray', 'signal_wrench'): (papillarray, 500, 0, [1, 2, 3, 4, 5, 6]),
    ('xela', 'signal'): (xela, 100, 0, [*range(16_000, 16_016), *range(17_000, 17_016), *range(18_000, 18_016)]),
    ('anyskin', 'signal'): (lambda n, ns: Message(layout=None, data=[0.5] * 15), 50, 0, [0.5] * 15),
    ('tactile_msgs', 'signal'): (
        lambda n, ns: Message(
            header=header(ns), sensors=[Message(name='a', values=[0]), Message(name='b', values=[1, 2])]
        ),
        200, 1, [1, 2],
    ),
    ('imu', 'signal'): (
        lambda n, ns: Message(header=header(ns), linear_acceleration=vector(1, 2, 3), angular_velocity=vector(4, 5, 6)),
        400, 0, [1, 2, 3, 4, 5, 6],
    ),
    ('wrench', 'signal'): (
        lambda n, ns: Message(header=header(ns), wrench=Message(force=vector(1, 2, 3), torque=vector(4, 5, 6))),
        500, 0, [1, 2, 3, 4, 5, 6],
    ),
    ('float32_multi_array', 'signal'): (lambda n, ns: Message(layout=None, data=[1.5, 2.5]), 250, 0, [1.5, 2.5]),
    ('audio', 'signal'): (
        lambda n, ns: Message(header=header(ns), audio=Message(data=np.full(160, -16384, '<i2').tobytes())),
        100, 0, [-0.5],
    ),
}  # fmt: skip


HEADER = {'stamp': 'time', 'frame_id': 'string'}
VECTOR = dict.fromkeys('xyz', 'float64')
# Fields of the messages as their packages define them: robotiq/ros @73cb1b5, etienne-roberge/tactilesensors4,
# kth-ros-pkg/biotac_driver, shadow-robot/sr_common, akashsharma02/xela_server_ros2, ubi-agni/tactile_toolbox,
# ros-drivers/audio_common, and the manual of the PapillArray (its older messages have no header).
DEFINED: dict[str, dict[str, Any]] = {
    'robotiq_tsf/msg/Dynamic': {'data[2]': {'value': 'int16'}},
    'robotiq_tsf/msg/StaticData': {'taxels[2]': {'values': 'uint16[28]'}},
    'robotiq_tsf/msg/Timestamp': {'values': 'uint64[2]'},
    'tactilesensors4/msg/Dynamic': {'value': 'int16'},
    'tactilesensors4/msg/StaticData': {'value': 'uint16[28]'},
    'biotac_sensors/msg/BioTacHand': {
        'header': HEADER, 'hand_id': 'string',
        'bt_data[]': {
            'bt_serial': 'string', 'bt_position': 'uint16', 'tdc_data': 'uint16', 'tac_data': 'uint16',
            'pdc_data': 'uint16', 'pac_data': 'uint16[22]', 'electrode_data': 'uint16[19]',
        },
    },
    'sr_robot_msgs/msg/BiotacAll': {
        'header': HEADER,
        'tactiles[5]': {
            **dict.fromkeys(('pac0', 'pac1', 'pdc', 'tac', 'tdc'), 'int16'), 'pac': 'int16[]', 'electrodes': 'int16[]',
        },
    },
    'sensor_interfaces/msg/SensorState': {
        'header': HEADER, 'tus': 'int64',
        'pillars[]': {'id': 'int64', **dict.fromkeys(('dx', 'dy', 'dz', 'fx', 'fy', 'fz'), 'float32')},
        **dict.fromkeys(('gfx', 'gfy', 'gfz', 'gtx', 'gty', 'gtz'), 'float32'),
    },
    'xela_server_ros2/msg/SensStream': {
        'header': HEADER,
        'sensors[]': {
            'message': 'uint32', 'time': 'float64', 'model': 'string', 'sensor_pos': 'uint8',
            'taxels[]': dict.fromkeys('xyz', 'uint16'), 'forces[]': dict.fromkeys('xyz', 'float32'),
        },
    },
    'tactile_msgs/msg/TactileState': {'header': HEADER, 'sensors[]': {'name': 'string', 'values': 'float32[]'}},
    'audio_common_msgs/msg/AudioDataStamped': {'header': HEADER, 'audio': {'data': 'uint8[]'}},
    'std_msgs/msg/Float32MultiArray': {'layout': {'data_offset': 'uint32'}, 'data': 'float32[]'},
    'sensor_msgs/msg/Imu': {'header': HEADER, 'linear_acceleration': VECTOR, 'angular_velocity': VECTOR},
    'geometry_msgs/msg/WrenchStamped': {'header': HEADER, 'wrench': {'force': VECTOR, 'torque': VECTOR}},
}  # fmt: skip


def leaf(message_type: str, path: str) -> str:
    """Return the type to which a path leads by the definition: an element's where its last step takes one."""
    found: Any = DEFINED[message_type]
    for step in path.split('.'):
        name, _, index = step.rstrip(']').partition('[')
        key = next(key for key in found if key.partition('[')[0] == name)
        kind, _, size = (key if isinstance(found[key], dict) else found[key]).rstrip(']').partition('[')
        assert not (index.isdigit() and size) or int(index) < int(size), path
        found = found[key] if isinstance(found[key], dict) or not index else kind
        assert '=' not in index or index.partition('=')[0] in found, path
    return str(found)


@pytest.mark.parametrize('mapping', shipped('texture_drivers', 'config/adaptors'))
def test_each_path_leads_to_a_field_of_the_vendors_definition_of_the_right_type(mapping: str) -> None:
    for signal in load_mapping(mapping, 1).signals.values():
        leaves = [leaf(signal.type, path) for path in signal.values]
        assert all(kind.startswith(('int', 'uint', 'float')) for kind in leaves)
        sizes = [kind.rstrip(']').partition('[')[2] if '[' in kind else '1' for kind in leaves]
        if all(sizes) and not any('*' in path for path in signal.values) and not signal.consecutive:
            assert sum(map(int, sizes)) == len(signal.channels)
        assert not signal.stamp or leaf(signal.type, signal.stamp) in ('time', 'float64')
        assert not signal.number_topic or 'int' in leaf(signal.number_type, signal.number)


def fed(adaptor: SignalAdaptor, make: Make, numbers: Any, period_ns: float) -> list[TactileSignal]:
    """Return the batches of some messages; a number follows each where the mapping has one."""
    batches = []
    for n in numbers:
        at_ns = START_NS + round(n * period_ns)
        adaptor.take(make(n, at_ns), at_ns)
        if adaptor.mapping.number_topic:
            adaptor.take_number(Message(values=[n % 2**16] * 2), at_ns + 5000)
        batches += adaptor.batches()
    return batches


def jumps(batches: list[TactileSignal]) -> int:
    return sum(b.first_sample - a.next_sample for a, b in itertools.pairwise(batches))


def test_every_shipped_mapping_is_tried_with_the_fields_of_its_vendor() -> None:
    made = {
        (name, signal)
        for name in shipped('texture_drivers', 'config/adaptors')
        for signal in load_mapping(name).signals
    }
    assert made == set(CASES)


@pytest.mark.parametrize(('mapping', 'signal'), CASES)
def test_a_shipped_mapping_gives_the_vendors_numbers_at_their_rate_and_times(mapping: str, signal: str) -> None:
    make, message_hz, finger, row = CASES[mapping, signal]
    adaptor = SignalAdaptor(signal, load_mapping(mapping, finger).signals[signal], 'tip')
    batches = fed(adaptor, make, range(round(3 * message_hz)), NANOSECONDS / message_hz)
    last = batches[-1]
    assert last.samples[-1] == pytest.approx(row)
    assert len(last.channels) == len(row)
    assert len(last.units) in (0, len(row))
    # The sample after the last of a message comes a period later: both ends of the stream fit the rate.
    assert last.sampling_rate_hz == pytest.approx(
        message_hz * (len(last.samples) if adaptor.mapping.consecutive else 1), rel=0.01
    )
    end_s = (last.stamp_ns - START_NS) / 1e9 + (len(last.samples) - 1) / last.sampling_rate_hz
    assert end_s == pytest.approx(3, abs=0.03)
    assert (jumps(batches), adaptor.lost, adaptor.refused, last.frame_id) == (0, 0, 0, 'tip')


def test_the_times_of_a_biotac_are_those_of_its_slots() -> None:
    signals = load_mapping('biotac_sensors', 2).signals
    pac, slow = (fed(SignalAdaptor(name, signals[name]), biotac_hand, range(300), 10 * MS)[-1] for name in signals)
    frame_ns = START_NS + 298 * 10 * MS  # the stamp of the last message is the end of this frame
    assert abs(slow.stamp_ns - frame_ns) < 1000
    assert abs(pac.stamp_ns - frame_ns - 227_273) < 1000


def test_jitter_of_stamps_makes_no_losses_and_hardly_moves_the_times() -> None:
    late_ns = np.random.default_rng(0).integers(0, 4 * MS, 500)
    adaptor = SignalAdaptor('signal', load_mapping('biotac_sensors').signals['signal'])
    batches = fed(adaptor, lambda n, ns: biotac_hand(n, ns + int(late_ns[n])), range(500), 10 * MS)
    assert jumps(batches) == adaptor.lost == 0
    stamps = np.array([batch.stamp_ns for batch in batches][100:])
    assert np.ptp(stamps - 10 * MS * np.arange(len(stamps))) < MS


def measured(times_ms: Any) -> tuple[float, bool]:
    """Return the rate of messages at these times, Hz, and whether it is certain."""
    meter = PeriodMeter()
    return next(filter(None, (meter.add(1, START_NS + round(ms * MS)) for ms in times_ms)))


def noise(seed: int, count: int = 400) -> Any:
    return np.random.default_rng(seed).random(count)


def test_messages_that_do_not_come_are_counted_by_their_times() -> None:
    meter = PeriodMeter()
    kept = [n for n in range(201) if n % 10 not in (3, 7)]
    assert [meter.add(1, START_NS + 10 * n * MS) for n in kept][-1] == (pytest.approx(100.0), True)
    assert meter.missing == pytest.approx(0.2, abs=0.01)


# Of messages each 10 ms; those that are kept back for 60 ms come at once.
EVEN = np.arange(400) * 10.0
IN_TIME = np.arange(400) % 40 < 6


@pytest.mark.parametrize('seed', range(8))
@pytest.mark.parametrize(
    ('times_ms', 'off'),
    [
        (lambda seed: EVEN, 0.0),
        (lambda seed: EVEN[noise(seed) > 0.3], 0.0),
        (lambda seed: EVEN + 2.0 * noise(seed), 2e-3),
        (lambda seed: np.sort(EVEN + np.minimum(20.0, -0.8 * np.log(noise(seed)))), 2e-3),
        (lambda seed: (EVEN + 1.5 * noise(seed))[noise(seed + 9) > 0.2], 2e-3),
        (lambda seed: np.where(IN_TIME, EVEN // 400 * 400 + 60, EVEN), 0.0),
    ],
    ids=['even', 'three in ten lost', 'jitter', 'sometimes late', 'jitter and losses', 'stalls'],
)
def test_the_rate_is_that_of_the_sampling_whatever_is_lost_or_late(times_ms: Any, off: float, seed: int) -> None:
    rate_hz, certain = measured(times_ms(seed))
    assert certain
    assert rate_hz == pytest.approx(100.0, rel=off + 1e-9)


@pytest.mark.parametrize(
    'times_ms',
    [
        EVEN // 20 * 20 + 0.1 * (EVEN % 20),
        EVEN // 40 * 40 + 0.01 * (EVEN % 40),
        np.zeros(19).tolist() + [3000.0] * 20,
        np.cumsum(-10 * np.log(noise(1))),
        EVEN[noise(1) > 0.6],
        np.sort(EVEN + 15 * noise(2)),
    ],
    ids=['pairs', 'bursts of four', 'equal stamps', 'random', 'six in ten lost', 'jitter above a period'],
)
def test_a_rate_is_not_certain_if_messages_come_unevenly(times_ms: Any) -> None:
    assert not measured(times_ms)[1]


def wrenches(rate_hz: float = 0.0) -> SignalAdaptor:
    return SignalAdaptor('signal', replace(load_mapping('wrench').signals['signal'], rate_hz=rate_hz))


def test_messages_lost_while_the_rate_is_measured_do_not_change_it_and_another_rate_is_a_fault() -> None:
    adaptor, make = wrenches(), CASES['wrench', 'signal'][0]
    fed(adaptor, make, [n for n in range(300) if n % 10 not in (2, 5, 6)], 10 * MS)
    assert (adaptor.rate_hz, adaptor.fault) == (100.0, '')
    fed(adaptor, make, range(150, 350), 20 * MS)
    assert 'bring 50 samples a second instead of 100, and are not published; correct rate_hz' in adaptor.fault
    fed(adaptor, make, range(700, 1100), 10 * MS)
    assert adaptor.fault == ''


@pytest.mark.parametrize('times', [0.5, 0.97, 2.0])
@pytest.mark.parametrize('mapping', ['wrench', 'anyskin', 'robotiq_tsf'])  # with a stamp, with neither, with a number
def test_samples_at_a_wrong_rate_are_withheld_and_later_ones_have_the_right_times(mapping: str, times: float) -> None:
    signal = load_mapping(mapping).signals['signal']
    rate_hz = signal.rate_hz or 100.0
    adaptor, make = SignalAdaptor('signal', replace(signal, rate_hz=rate_hz)), CASES[mapping, 'signal'][0]
    wrong_hz, period_ns = times * rate_hz, NANOSECONDS / rate_hz
    fed(adaptor, make, range(round(2.5 * wrong_hz)), NANOSECONDS / wrong_hz)
    assert fed(adaptor, make, range(round(2.5 * wrong_hz), round(9 * wrong_hz)), NANOSECONDS / wrong_hz) == []
    batches = fed(adaptor, make, range(round(9 * rate_hz), round(15 * rate_hz)), period_ns)
    assert adaptor.fault == ''
    assert jumps(batches) == 0
    assert sum(len(batch.samples) for batch in batches) > 1.8 * rate_hz  # of 6 s: after two checks at most
    ends_ns = [batch.end_ns - START_NS - 15 * NANOSECONDS for batch in batches]
    assert ends_ns == pytest.approx(period_ns * np.arange(1 - len(batches), 1), abs=1.1 * period_ns)


class Wrenches:
    """A driver of wrenches, stopped and started again at another rate."""

    def __init__(self, rate_hz: float = 0.0) -> None:
        self.adaptor, self.now_s, self.random = wrenches(rate_hz), 0.0, np.random.default_rng(0)

    def run(self, rate_hz: float, seconds: float, jitter: float = 0.0) -> int:
        """Send for a while, each message late by up to `jitter` periods; return how many samples were published."""
        times_s = self.now_s + (np.arange(round(seconds * rate_hz)) + 1) / rate_hz
        late_s = jitter * self.random.random(len(times_s)) / rate_hz
        self.now_s = times_s[-1]
        before = self.adaptor.samples
        for at_s in np.sort(times_s + late_s):
            fed(self.adaptor, CASES['wrench', 'signal'][0], [1], at_s * NANOSECONDS)
        return self.adaptor.samples - before


@pytest.mark.parametrize('jitter', [0.0, 3.0])
def test_after_a_silence_nothing_is_published_until_the_rate_is_measured_again(jitter: float) -> None:
    driver = Wrenches()
    assert driver.run(100, 5) > 250
    driver.now_s += 0.6
    assert driver.run(500, 1.9, jitter) == 0
    late = driver.run(500, 10, jitter)
    if jitter:  # too uneven to be measured
        assert (late, driver.adaptor.measured) == (0, False)
        assert 'come unevenly, about' in driver.adaptor.fault
        driver.now_s += 0.6
        late = driver.run(500, 10)
    assert late > 7 * 500
    assert (driver.adaptor.rate_hz, driver.adaptor.fault) == (500.0, '')


@pytest.mark.parametrize('jitter', [0.0, 3.0])
def test_a_rate_that_rises_ends_publication_within_70_ms_of_samples(jitter: float) -> None:
    driver = Wrenches()
    driver.run(100, 5)
    assert driver.run(500, 5, jitter) <= 0.07 * 500 + 1
    assert 'bring' in driver.adaptor.fault
    assert 'samples a second instead of 100, and are not published' in driver.adaptor.fault


def test_a_rate_of_the_mapping_is_published_only_once_messages_agree_with_it() -> None:
    assert Wrenches(100.0).run(500, 20) == 0
    assert Wrenches(100.0).run(500, 20, jitter=3.0) == 0
    assert Wrenches(100.0).run(100, 1.9) == 0
    assert Wrenches(100.0).run(100, 5) > 250
    assert Wrenches(100.0).run(100, 5, jitter=3.0) > 250


def test_a_driver_that_was_held_up_for_less_than_half_a_second_is_still_published() -> None:
    driver = Wrenches()
    driver.run(100, 5)
    held = driver.now_s + 0.2
    fed(driver.adaptor, CASES['wrench', 'signal'][0], [1] * 20, held * NANOSECONDS)
    driver.now_s = held
    assert driver.run(100, 4) > 390


def test_times_that_stand_still_are_a_fault_and_those_of_a_clock_that_was_set_back_begin_anew() -> None:
    adaptor, make = wrenches(), CASES['wrench', 'signal'][0]
    for _ in range(2000):
        adaptor.take(make(0, START_NS), START_NS)
    assert "times of the messages on 'wrench' do not advance; check the clock of the driver" in adaptor.fault
    fed(adaptor, make, range(-360_000, -359_600), 10 * MS)
    assert (adaptor.rate_hz, adaptor.fault) == (100.0, '')


def test_stamps_in_another_unit_are_reported_as_a_fault() -> None:
    adaptor, make = wrenches(), CASES['wrench', 'signal'][0]
    fed(adaptor, make, range(3), 10_000 * MS)
    assert "times of the messages on 'wrench' are more than 0.5 s apart; correct `stamp`" in adaptor.fault
    fed(adaptor, make, range(6000, 6300), 10 * MS)
    assert (adaptor.rate_hz, adaptor.fault) == (100.0, '')


def test_a_rate_that_is_set_and_wrong_is_a_fault_and_one_that_cannot_be_measured_too() -> None:
    make = CASES['wrench', 'signal'][0]
    adaptor = wrenches(rate_hz=97.0)
    fed(adaptor, make, range(300), 10 * MS)
    assert 'bring 100 samples a second instead of 97' in adaptor.fault
    adaptor = wrenches()
    pairs = [make(0, START_NS + n // 2 * 20 * MS + n % 2 * 1000) for n in range(300)]
    for message in pairs:
        adaptor.take(message, START_NS)
    assert 'come unevenly, about' in adaptor.fault
    assert adaptor.batches() == []


@pytest.mark.parametrize(
    ('sent', 'advice'),
    [
        ([n for n in range(900) if n % 16 < 7], 'messages are lost, as their times show: reduce the load'),
        (np.cumsum(-2 * np.log(noise(1))), 'reduce the load of the computer if messages are lost'),
        ([2 * n for n in range(300)], 'correct rate_hz in the mapping, or start the node again'),
        ([n / 2 for n in range(900)], 'correct rate_hz in the mapping, or start the node again'),
    ],
    ids=['bursts of neighbours', 'random', 'half the rate', 'twice the rate'],
)
def test_lost_messages_are_distinguished_from_a_wrong_rate_by_the_sample_period(sent: Any, advice: str) -> None:
    adaptor = wrenches(rate_hz=200.0)
    fed(adaptor, CASES['wrench', 'signal'][0], sent, 5 * MS)
    assert f'are not published; {advice}' in adaptor.fault


def test_a_gap_in_the_stamps_is_a_loss() -> None:
    adaptor = SignalAdaptor('signal', load_mapping('biotac_sensors').signals['signal'])
    batches = fed(adaptor, biotac_hand, [n for n in range(300) if not 230 <= n < 234], 10 * MS)
    assert jumps(batches) == adaptor.lost == 4 * 22


def test_samples_that_neither_count_nor_stamp_are_missed_by_time_half_a_second_later() -> None:
    adaptor = SignalAdaptor('signal', load_mapping('anyskin').signals['signal'])
    batches = fed(adaptor, CASES['anyskin', 'signal'][0], [n for n in range(400) if not 200 <= n < 210], 20 * MS)
    assert jumps(batches) == adaptor.lost == 10


class Driver:
    """The vendor's TSF-85 driver: a sample, and after it its stamp, in separate messages."""

    def __init__(self, ticks: int = 1) -> None:
        self.ticks = ticks
        self.adaptor = SignalAdaptor('signal', load_mapping('robotiq_tsf', 1).signals['signal'])
        self.batches: list[TactileSignal] = []
        self.stamp, self.now_ns, self.sent = 63_300, START_NS, 0
        self.run(2100)  # its rate is measured
        self.batches.clear()

    def run(self, packets: int, **faults: Any) -> None:
        for value in range(packets):
            lose, step = faults.get(f'at_{value}', ((), 1))
            self.stamp += step
            self.now_ns += step * MS or 50_000
            self.sent += 1
            if 'sample' not in lose:
                self.adaptor.take(Message(data=[Message(value=0), Message(value=self.sent)]), self.now_ns)
            if 'stamp' not in lose:
                stamp = self.stamp % 2**16 if self.ticks == 1 else self.stamp * self.ticks
                self.adaptor.take_number(Message(values=[0, stamp]), self.now_ns + 5000)
            if value % 10 == 9:
                self.batches += self.adaptor.batches()

    def offsets(self) -> set[int]:
        """By how much values and indices of samples differ."""
        return {int(v) - b.first_sample - i for b in self.batches for i, v in enumerate(b.samples[:, 0])}


@pytest.mark.parametrize('ticks', [1, 1000])  # milliseconds of 16 bits, as it was first, and microseconds of 64 bits
def test_a_lost_sample_leaves_a_gap_and_a_lost_number_none(ticks: int) -> None:
    driver = Driver(ticks)
    driver.run(500, at_200=(('sample',), 1), at_300=(('stamp',), 1))
    adaptor = driver.adaptor
    assert len(driver.offsets()) == 1
    assert (adaptor.lost, adaptor.unpaired, adaptor.unnumbered) == (1, 1, 1)
    assert driver.batches[-1].end_ns == pytest.approx(driver.now_ns, abs=2 * MS)


def test_numbers_whose_samples_do_not_come_are_counted_and_not_kept() -> None:
    driver = Driver()
    driver.run(900, **{f'at_{n}': (('sample',), 1) for n in range(500, 900)})
    assert 300 < driver.adaptor.unpaired < 400
    driver.run(100)
    assert (driver.adaptor.unpaired, driver.adaptor.lost, driver.adaptor.unnumbered) == (400, 400, 0)


def test_a_repeated_number_is_no_new_sample() -> None:
    driver = Driver()
    driver.run(500, at_200=((), 0))
    assert driver.adaptor.lost == 0
    assert sum(len(batch.samples) for batch in driver.batches) >= 390


def test_after_a_long_silence_the_gap_is_that_of_the_clock() -> None:
    driver = Driver()
    driver.run(500)
    before = driver.batches[-1]
    driver.now_ns += 70_000 * MS  # the number of 16 bits has wrapped
    driver.stamp += 70_000
    driver.run(2600)  # the rate is measured again
    after = next(batch for batch in driver.batches if batch.first_sample > before.next_sample)
    gap_s = (after.stamp_ns - before.end_ns) / 1e9
    assert gap_s > 70
    assert (after.first_sample - before.next_sample) / 1000 == pytest.approx(gap_s, abs=0.01)


def test_a_value_that_is_no_number_is_published_as_unknown_and_counted() -> None:
    adaptor = SignalAdaptor('signal', load_mapping('float32_multi_array').signals['signal'])
    batches = fed(adaptor, lambda n, ns: Message(data=[1.0, float('inf')]), range(800), 4 * MS)
    assert np.isnan(batches[-1].samples[-1, 1])
    assert adaptor.invalid == 800


@pytest.mark.parametrize(
    ('mapping', 'signal', 'message', 'sentence'),
    [
        ('biotac_sensors', 'signal', biotac_hand(0, START_NS, bt_position=2), 'holds nothing at .*check the finger'),
        ('biotac_sensors', 'signal_static', biotac_hand(0, START_NS, electrode_data=[1] * 24), '27 numbers; 22'),
        ('biotac_sensors', 'signal', biotac_hand(0, 0), 'stamp of the message is 0'),
        ('robotiq_tsf', 'signal_static', Message(taxels=[Message(values=[1] * 12)]), '12 numbers; 28'),
        ('robotiq_tsf', 'signal', Message(value=3), "no field 'data"),
        ('xela', 'signal', Message(sensors=[]), "no field 'sensors"),
        ('float32_multi_array', 'signal', Message(data=['much']), 'not numbers'),
        ('float32_multi_array', 'signal', Message(data=[]), '0 numbers'),
        ('audio', 'signal', Message(header=header(START_NS), audio=Message(data=b'abc')), 'not numbers'),
    ],
)  # fmt: skip
def test_a_message_that_does_not_fit_is_refused_in_one_sentence_and_counted(
    mapping: str, signal: str, message: Any, sentence: str
) -> None:
    adaptor = SignalAdaptor(signal, load_mapping(mapping).signals[signal])
    with pytest.raises(InvalidData, match=sentence):
        adaptor.take(message, START_NS)
    assert adaptor.refused == 1


GOOD = {'topic': 't', 'type': 'p/msg/T', 'values': ['data']}


@pytest.mark.parametrize(
    ('change', 'sentence'),
    [
        ({'topic': ''}, "'topic' is missing"),
        ({'type': 'p/T'}, 'package/msg/Type'),
        ({'number_topic': 'n'}, 'belong together'),
        ({'number': 'n', 'consecutive': True}, 'counts single samples'),
        ({'units': ['N', 'm']}, '2 units came for 0 channels'),
    ],
)
def test_a_mapping_that_cannot_be_is_refused(change: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InvalidParameter, match=sentence):
        SignalMapping(**{**GOOD, **change})


def test_paths_reach_elements_by_index_by_field_and_all() -> None:
    message = Message(a=[Message(id=4, b=[1, 2]), Message(id=9, b=[3, 4])])
    assert compile_path('a[1].b[0]')(message) == [3]
    assert compile_path('a[*].b')(message) == [[1, 2], [3, 4]]
    assert compile_path('a[id=9].b')(message) == [[3, 4]]
    for path in ('a[', 'a..b', '.a', 'a.b()'):
        with pytest.raises(InvalidParameter, match='unreadable from'):
            compile_path(path)


def test_a_mapping_of_a_user_is_read_and_a_wrong_key_gets_the_nearest(tmp_path: Path) -> None:
    path = tmp_path / 'mine.yaml'
    path.write_text('signals: {signal: {topic: t, type: p/msg/T, values: [data], rate: 3}}')
    with pytest.raises(InvalidParameter, match="did you mean 'rate_hz'"):
        load_mapping(str(path))
    path.write_text('about: nothing')
    with pytest.raises(InvalidParameter, match='no signals'):
        load_mapping(str(path))
