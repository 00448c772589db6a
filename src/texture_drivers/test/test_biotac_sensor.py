# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from texture_core.errors import DeviceError
from texture_core.framing import Frame
from texture_core.types import TactileSignal, lost_samples
from texture_drivers.biotac import LAYOUTS, REPLY, BioTac, BioTacLayout, FrameTracker, SpiFrame
from texture_drivers.sensor import SensorParams

BIOTAC = LAYOUTS['biotac']
FRAME_NS = 10_000_000
START_NS = 1_700_000_000_000_000_000
ABSENT = None


def odd(byte: int) -> int:
    return byte | (byte.bit_count() + 1) % 2


def word(value: int | None) -> bytes:
    return bytes(2) if value is ABSENT else bytes([odd(value >> 5 << 1), odd((value & 31) << 3)])


def reply(layout: BioTacLayout = BIOTAC, *, fingers: Sequence[int | None] = (0,), step: int = 0) -> bytes:
    """Each slot holds its number times `step`, plus a number that tells the finger."""
    values = [
        [ABSENT if base is ABSENT else base + step * slot for base in fingers] for slot in range(len(layout.slots))
    ]
    return b''.join(b'\x80\x00' + b''.join(map(word, row)) for row in values)


class FakeLink:
    """Frames that come one a read, 10 ms apart; None is a frame that never comes."""

    max_drift = 5e-3
    serials = ('BT-1', '')

    def __init__(self, frames: Sequence[SpiFrame | None]) -> None:
        self._coming: Iterator[SpiFrame | None] = iter(frames)
        self.now_ns = START_NS
        self.counts = {'bogus': 3}

    def open(self) -> None:
        pass

    def read(self) -> list[SpiFrame]:
        frame = next(self._coming, None)
        self.now_ns += FRAME_NS
        return [] if frame is None else [frame]

    def close(self) -> None:
        pass


def numbered(numbers: range, content: bytes, *, epoch: int = 1, fingers: int = 1) -> list[SpiFrame]:
    return [SpiFrame(epoch, number, 10_000 * number, fingers, content) for number in numbers]


def opened(link: FakeLink, *, finger: int = 0, **options: object) -> BioTac:
    params = SensorParams(finger=finger, frame_id='tip')
    sensor = BioTac(params, lambda: link.now_ns, link=link, **options)
    sensor.open()
    return sensor


def run(sensor: BioTac, reads: int) -> dict[str, list[TactileSignal]]:
    topics: dict[str, list[TactileSignal]] = {}
    for _ in range(reads):
        for topic, batches in sensor.read().items():
            topics.setdefault(topic, []).extend(batches)
    return topics


def test_each_sample_has_the_time_of_its_slot() -> None:
    link = FakeLink(numbered(range(50), reply(step=1)))
    start_ns = link.now_ns  # of the first frame: it comes when it is complete, at the first reading
    topics = run(opened(link), 50)
    signal, static = topics['signal'][-1], topics['signal_static'][-1]
    assert abs(static.stamp_ns - (start_ns + 49 * FRAME_NS)) < 1000
    assert signal.stamp_ns - static.stamp_ns == 227_273
    # Slot numbers are the values: PAC comes from slots 1, 3 … 43, so sample k was taken at (2k + 1) slots.
    assert signal.samples[:, 0].tolist() == list(range(1, 44, 2))
    times_s = 227.273e-6 + np.arange(22) / signal.sampling_rate_hz
    assert times_s == pytest.approx(signal.samples[:, 0] / 4400, abs=1e-6)
    assert static.samples[0].tolist() == [42, 40, 38, *range(0, 38, 2)]  # TDC, TAC, PDC, electrodes
    assert static.channels == ('tdc', 'tac', 'pdc', *(f'electrode{number}' for number in range(1, 20)))
    assert (signal.sensor, signal.channels, signal.frame_id) == ('biotac/pac', ('pac',), 'tip')
    assert signal.units == ('count',)
    assert (signal.sampling_rate_hz, static.sampling_rate_hz) == (2200.0, 100.0)
    assert signal.first_sample == 22 * static.first_sample


def test_a_lost_frame_is_a_jump_of_22_samples() -> None:
    frames = numbered(range(60), reply())
    sensor = opened(FakeLink([*frames[:40], None, None, *frames[42:]]))
    topics = run(sensor, 60)
    assert lost_samples(topics['signal']) == 44
    assert lost_samples(topics['signal_static']) == 2
    assert sensor.counts['lost'] == 44
    assert sensor.counts['samples'] == sum(len(batch.samples) for batch in topics['signal'])
    assert sensor.counts['bogus'] == 3


def test_after_an_interruption_the_index_goes_on_with_the_time() -> None:
    gone = [None] * 30
    restarted = numbered(range(40), reply(), epoch=2)
    sensor = opened(FakeLink([*numbered(range(40), reply()), *gone, *restarted]))
    topics = run(sensor, 110)
    stamps = np.array([batch.stamp_ns for batch in topics['signal_static']])
    indices = np.array([batch.first_sample for batch in topics['signal_static']])
    assert indices[-1] - indices[0] == round((stamps[-1] - stamps[0]) / FRAME_NS)
    assert (np.diff(indices) >= 1).all()
    assert lost_samples(topics['signal']) == sensor.counts['lost'] >= 30 * 22


def test_a_damaged_word_is_nan_in_its_own_channel_and_finger() -> None:
    content = bytearray(reply(fingers=(100, 200)))
    content[6 * 38 + 4] ^= 1  # slot 38 is PDC; the second finger
    sensor = opened(FakeLink(numbered(range(40), bytes(content), fingers=2)), fingers=(0, 1))
    topics = run(sensor, 40)
    first, second = topics['finger0/signal_static'][-1].samples[0], topics['finger1/signal_static'][-1].samples[0]
    assert (first == 100).all()
    assert np.flatnonzero(np.isnan(second)).tolist() == [2]
    assert (topics['finger1/signal'][-1].samples == 200).all()
    assert sensor.counts['damaged_words'] == len(topics['finger1/signal_static'])


def test_a_place_without_a_biotac_is_reported_and_sends_nothing() -> None:
    sensor = opened(FakeLink(numbered(range(200), reply(fingers=(7, ABSENT)), fingers=2)), finger=1)
    with pytest.raises(DeviceError, match='no BioTac answers as finger 1'):
        assert not any(run(sensor, 200).values())


def bridge_frame(sequence: int, time_us: int) -> Frame:
    return Frame(REPLY, 1, sequence % 2**16, time_us % 2**32, 44, 1, b'')


def test_numbers_and_time_go_on_over_their_wrapping() -> None:
    run_ = FrameTracker(BIOTAC)
    first_us = 2**32 - 15_000
    frames = [run_.place(bridge_frame(65_534 + n, first_us + 10_000 * n)) for n in range(4)]
    assert [frame.number for frame in frames] == [65_534, 65_535, 65_536, 65_537]
    assert [frame.time_us - first_us for frame in frames] == [0, 10_000, 20_000, 30_000]
    assert run_.restarts == 0


def test_a_device_that_begins_again_or_pauses_begins_another_epoch() -> None:
    run_ = FrameTracker(BIOTAC)
    epochs = [
        run_.place(bridge_frame(number, time_us)).epoch
        for number, time_us in [(100, 10**6), (101, 1_010_000), (0, 0), (1, 10_000), (5, 50_000), (6, 300_000)]
    ]
    assert epochs == [1, 1, 2, 2, 2, 3]
    assert run_.restarts == 2


def test_a_bridge_of_another_pace_is_reported() -> None:
    run_ = FrameTracker(BIOTAC)
    with pytest.raises(DeviceError, match=r'takes 10\.40 ms for a frame, and 10\.00 ms are needed'):
        for number in range(120):
            run_.place(bridge_frame(number, 10_400 * number))
    steady = FrameTracker(BIOTAC)
    jitter_us = (0, 2000, -2000)
    for number in range(500):
        steady.place(bridge_frame(number, 10_050 * number + jitter_us[number % 3]))
    assert steady.restarts == 0
