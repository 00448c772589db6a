# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import errno
import termios
from types import SimpleNamespace

import numpy as np
import pytest
import serial

from texture_core.errors import DeviceError
from texture_core.framing import Frame, pack
from texture_core.types import lost_samples
from texture_drivers.sensor import SensorParams
from texture_drivers.serial_line import (
    FramedSensor,
    FramedStream,
    SerialPort,
    StreamTracker,
    reason_of,
    resolve,
    serial_number,
)
from texture_drivers.tsf85 import USB_IDS

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND


def stream(kind=1, rate_hz=2500.0, channels=('a', 'b'), topic='signal'):
    ones = np.ones(len(channels))
    return FramedStream(
        topic, kind, f'test/{topic}', rate_hz, channels, ('V',) * len(channels), 0.5 * ones, -1.0 * ones
    )


def line_of(*streams):
    return FramedSensor(SensorParams(frame_id='tip'), lambda: 0, streams)


def frame(number, *, kind=1, rows=10, rate_hz=2500.0, first_us=0, columns=2):
    """A frame whose samples count: row r of the stream holds r in the first channel and −r in the second."""
    counts = (np.arange(rows) + number * rows) % 30_000
    body = np.column_stack([counts, -counts][:columns]).astype('<i2').tobytes()
    return Frame(
        kind, 1, number % 65536, (first_us + round(number * rows / rate_hz * 1e6)) % 2**32, rows, columns, body
    )


def run(line, numbers, offset_ns=START, **how):
    """Feed frames one by one, each as its last sample is taken; return what comes, by topic."""
    batches = {}
    for number in numbers:
        sent = frame(number, **how)
        arrival_ns = offset_ns + round((number + 1) * sent.rows / how.get('rate_hz', 2500.0) * SECOND)
        for topic, found in line.feed(pack(sent), arrival_ns).items():
            batches.setdefault(topic, []).extend(found)
    return batches


def test_frames_read_at_once_are_one_batch_and_are_split_where_samples_are_missing():
    line = line_of(stream())
    run(line, range(100))
    data = b''.join(pack(frame(n)) for n in (100, 101, 103, 104))
    batches = line.feed(data, START + round(1050 / 2500 * SECOND))['signal']
    assert [len(batch.samples) for batch in batches] == [20, 20]
    assert batches[1].first_sample - batches[0].first_sample == 30
    counts = (batches[1].samples + 1.0) / 0.5  # as frames hold them
    np.testing.assert_array_equal(counts, np.column_stack([np.arange(1030, 1050), -np.arange(1030, 1050)]))


def test_sequence_and_time_wrap_without_a_trace():
    line = line_of(stream())
    numbers = range(65536 - 100, 65536 + 100)
    first_us = 2**32 - round(65536 * 10 / 2500 * 1e6)  # both wrap at frame 65536
    batches = run(line, numbers, first_us=first_us)['signal']
    assert lost_samples(batches) == 0
    assert line.restarts == 0
    steps_ns = np.diff([batch.stamp_ns for batch in batches])
    np.testing.assert_allclose(steps_ns, 4e6, rtol=0.02)


def test_what_is_less_than_a_sample_adds_up_over_many_interruptions():
    line, at_s = line_of(stream(rate_hz=100.0, channels=('a',))), 0.0
    for _ in range(101):
        line.restart()
        for number in range(20):
            sent = pack(frame(number, rows=1, rate_hz=100.0, columns=1))
            line.feed(sent, START + round((at_s + number / 100) * SECOND))
        at_s += 0.303  # the clock settles for 0.1 s, in which samples are not numbered; 0.3 of one are lost in addition
    lost = line.trackers[1].lost + line.trackers[1].samples
    assert lost == pytest.approx((at_s - 0.303 + 0.1) * 100, abs=1.5)


def test_two_streams_of_one_line_share_its_clock_and_lose_independently():
    fast, slow = stream(), stream(kind=2, rate_hz=50.0, channels=('f',), topic='signal_static')
    line = line_of(fast, slow)
    static = []
    for number in range(500):
        run_ns = START + round((number + 1) / 250 * SECOND)
        data = pack(frame(number)) if number != 300 else b''
        if number % 5 == 4:
            data += pack(frame(number // 5, kind=2, rows=1, rate_hz=50.0, columns=1))
        static += line.feed(data, run_ns).get('signal_static', [])
    assert (line.trackers[1].lost, line.trackers[2].lost) == (10, 0)
    assert line.clock.steps == 0
    assert np.diff([batch.stamp_ns for batch in static]) == pytest.approx(20e6, rel=0.02)


def test_samples_that_the_device_left_out_are_reported_separately_from_lost_frames():
    tracker = StreamTracker(stream())
    assert [tracker.place(0, 10, 0), tracker.place(4000 + 5 * 400, 10, 0)] == [0, 15]
    assert tracker.overrun == 5


def test_the_jitter_of_the_devices_stamps_and_its_rounding_move_nothing():
    tracker = StreamTracker(stream(rate_hz=4096.0))  # 32 samples take 7812.5 µs
    jitter = [0, 100, -100, 3]
    assert [tracker.place(int(i * 7812.5) + jitter[i % 4], 32, 0) for i in range(10_000)][-1] == 32 * 9999
    assert tracker.overrun == 0


@pytest.mark.parametrize('true_hz', [2000.0, 3000.0])
def test_a_wrong_rate_is_named_after_three_seconds(true_hz):
    tracker = StreamTracker(stream())
    with pytest.raises(DeviceError, match=f'{true_hz:.4g} samples in a second .* 2500 are needed'):
        for i in range(2000):
            tracker.place(round(i * 10 / true_hz * 1e6), 10, 0)


def test_a_stream_of_a_wrong_rate_is_not_published_again_before_its_rate_is_right():
    line = line_of(stream())
    with pytest.raises(DeviceError, match=r'delivers 2425 samples .* correct the timer'):
        run(line, range(1000), rate_hz=2425.0)
    line.restart()
    with pytest.raises(DeviceError, match='delivers 2425 samples'):
        assert run(line, range(240), offset_ns=START + 9 * SECOND, rate_hz=2425.0) == {}
        run(line, range(240, 320), offset_ns=START + 9 * SECOND, rate_hz=2425.0)
    line.restart()
    batches = run(line, range(500), offset_ns=START + 19 * SECOND)['signal']
    assert 200 < len(batches) < 300  # of 500 frames: after one check


def test_the_rate_is_checked_on_a_line_that_loses_a_frame_each_second():
    line, numbers = line_of(stream()), [number for number in range(3000) if number % 225]
    with pytest.raises(DeviceError, match='delivers 2425 samples'):
        run(line, numbers, rate_hz=2425.0)
    line.restart()
    assert len(run(line, numbers[:1000], offset_ns=START + 19 * SECOND)['signal']) > 700


def test_one_hiccup_of_the_device_is_no_wrong_rate():
    tracker = StreamTracker(stream())
    for i in range(2000):
        tracker.place(4000 * i + (200_000 if i > 500 else 0), 10, 0)
    assert tracker.overrun == 500


def test_other_kinds_and_contradicting_frames_are_counted_and_passed_over():
    line = line_of(stream())
    line.feed(pack(Frame(9, 7, 0, 0, 3, 1, b'else')) + pack(Frame(1, 1, 0, 0, 3, 2, b'short')), START)
    assert (line.other_frames, line.malformed) == (1, 1)


def test_a_device_that_speaks_differently_is_reported_in_one_sentence():
    with pytest.raises(DeviceError, match='sends 3 channels, and 2 are named'):
        line_of(stream()).feed(pack(Frame(1, 1, 0, 0, 1, 3, bytes(6))), START)
    with pytest.raises(DeviceError, match='sends frames of version 2, and 1 is known'):
        line_of(stream()).feed(pack(Frame(1, 2, 0, 0, 1, 2, bytes(4))), START)


def test_a_missing_device_is_named_once_with_the_reason_of_the_operating_system(tmp_path):
    path = str(tmp_path / 'missing')
    with pytest.raises(DeviceError) as refusal:
        SerialPort(path)
    assert str(refusal.value).startswith(
        f"device '{path}' cannot be used (No such file or directory); check that it is"
    )
    assert str(refusal.value).count(path) == 1


@pytest.mark.parametrize(
    ('error', 'reason'),
    [
        (PermissionError(errno.EACCES, 'Permission denied', '/dev/x'), 'Permission denied'),
        (termios.error(errno.EIO, 'Input/output error'), 'Input/output error'),
        (serial.SerialException('Write timeout'), 'Write timeout'),
    ],
)
def test_the_reason_of_a_fault_holds_no_path(error, reason):
    assert reason_of(error) == reason


NEW = SimpleNamespace(device='/dev/ttyACM0', vid=0x16D0, pid=0x14CC, serial_number='A7')
OLD = SimpleNamespace(device='/dev/ttyACM3', vid=0x04B4, pid=0xF232, serial_number=None)
OTHER = SimpleNamespace(device='/dev/ttyUSB0', vid=0x0403, pid=0x6001, serial_number='FT')
BOARD = SimpleNamespace(device='/dev/ttyS0', vid=None, pid=None, serial_number=None)


@pytest.mark.parametrize(
    ('device', 'listed', 'found'),
    [
        ('auto', [BOARD, OTHER, NEW], '/dev/ttyACM0'),
        ('auto', [BOARD, OTHER, OLD], '/dev/ttyACM3'),
        ('/dev/mine', [], '/dev/mine'),
    ],
)
def test_a_path_is_taken_and_the_only_one_is_found_by_its_numbers(device, listed, found):
    assert resolve(device, USB_IDS, 'TSF-85', lambda: listed) == found


@pytest.mark.parametrize(
    ('listed', 'sentence'),
    [
        ([], r'no TSF-85 \(16D0:14CC or 04B4:F232\).* none; plug it in'),
        ([OTHER, BOARD], r'are /dev/ttyS0, /dev/ttyUSB0 \(0403:6001\); plug it in'),
        ([OLD, NEW], r'any of 2 TSF-85s: /dev/ttyACM0, /dev/ttyACM3; set the parameter device'),
    ],
)
def test_where_none_or_several_are_there_the_ports_are_listed(listed, sentence):
    with pytest.raises(DeviceError, match=sentence):
        resolve('auto', USB_IDS, 'TSF-85', lambda: listed)


def test_the_serial_number_is_that_of_the_port_behind_a_link(tmp_path):
    port = SimpleNamespace(device=str(tmp_path / 'ttyACM0'), vid=1, pid=1, serial_number='A7')
    (tmp_path / 'ttyACM0').touch()
    (tmp_path / 'link').symlink_to(port.device)
    assert serial_number(str(tmp_path / 'link'), lambda: [BOARD, port]) == 'A7'
    assert serial_number('/dev/nothing', lambda: [BOARD, port]) == ''
