# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sensor on a sound card: miniaudio's card of zeros, which keeps the pace of a real one, and blocks by hand."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from texture_core.errors import DeviceError, InvalidParameter
from texture_core.types import TactileSignal, lost_samples
from texture_drivers.sensor import SensorParams
from texture_drivers.sound_card import NULL, SoundCard

pytestmark = pytest.mark.realtime

DEADLINE_S = 20.0
RATE_HZ = 48_000


@pytest.fixture
def make() -> Iterator[Callable[..., SoundCard]]:
    made: list[SoundCard] = []

    def make(config: str = '{decimation: 1}') -> SoundCard:
        made.append(SoundCard(SensorParams(device=NULL, config=config)))
        made[-1].open()
        return made[-1]

    yield make
    for sensor in made:
        sensor.close()


def read_s(sensor: SoundCard, seconds: float) -> list[TactileSignal]:
    batches: list[TactileSignal] = []
    deadline_s = time.monotonic() + DEADLINE_S
    while sum(len(batch.samples) for batch in batches) < seconds * sensor.expected_rates_hz['signal']:
        assert time.monotonic() < deadline_s
        batches += sensor.read().get('signal', [])
    return batches


def test_a_card_is_read_at_its_rate_with_as_many_channels_as_requested(make: Callable[..., SoundCard]) -> None:
    began_ns = time.time_ns()
    batches = read_s(make('{decimation: 12, channels: 2, unit: m/s², gain: 50.0}'), 1.0)
    first, last = batches[0], batches[-1]
    assert (first.sampling_rate_hz, first.units, first.channels) == (4000.0, ('m/s²',) * 2, ('channel_1', 'channel_2'))
    assert lost_samples(batches) == 0
    assert not any(batch.samples.any() for batch in batches)
    assert began_ns < first.stamp_ns < last.stamp_ns < time.time_ns()


def test_closed_and_opened_again_it_goes_on_at_the_index_of_the_time(make: Callable[..., SoundCard]) -> None:
    sensor = make()
    last = read_s(sensor, 0.5)[-1]
    sensor.close()
    sensor.open()
    first = read_s(sensor, 0.5)[0]
    gap_s = (first.stamp_ns - last.end_ns) / 1e9
    assert (first.first_sample - last.next_sample) / RATE_HZ == pytest.approx(gap_s, abs=0.03)
    assert sensor.counts['reopened'] == 1


def test_what_is_captured_arrives_once_in_its_order_with_its_channels(make: Callable[..., SoundCard]) -> None:
    sensor = make('{decimation: 1, channels: 2}')
    capture = sensor._capture
    assert capture is not None
    capture._stream.stop()
    capture.take()
    receiver = capture._receive()
    next(receiver)
    for number in range(3):
        ramp = np.arange(480 * number, 480 * (number + 1))
        receiver.send(np.stack([ramp, -ramp], axis=1).astype('<i2').tobytes())
    samples = np.concatenate([block.samples for block in capture.take()]) * 32768
    assert np.array_equal(samples, np.stack([np.arange(1440), -np.arange(1440)], axis=1))


def test_a_card_that_delivers_nothing_more_is_reported(make: Callable[..., SoundCard]) -> None:
    sensor = make()
    read_s(sensor, 0.2)
    sensor._capture._stream.stop()  # type: ignore[union-attr]
    deadline_s = time.monotonic() + DEADLINE_S
    with pytest.raises(DeviceError, match="sound card 'null' is open and delivers nothing"):
        while time.monotonic() < deadline_s:
            sensor.read()


def test_a_card_that_is_not_there_is_named_with_those_that_are() -> None:
    with pytest.raises(DeviceError, match="sound card 'no such card' cannot be opened: the cards are "):
        SoundCard(SensorParams(device='no such card')).open()


def test_a_reader_that_is_too_busy_is_an_overflow_and_the_time_goes_on(make: Callable[..., SoundCard]) -> None:
    sensor = make()
    last = read_s(sensor, 0.3)[-1]
    deadline_s = time.monotonic() + DEADLINE_S
    while not sensor._capture._overflowed:  # type: ignore[union-attr]
        assert time.monotonic() < deadline_s
        time.sleep(0.01)
    batches = read_s(sensor, 1.5)
    assert sensor.counts['overflows'] >= 1
    assert sensor.counts['lost'] > 0
    elapsed_s = (batches[-1].stamp_ns - last.stamp_ns) / 1e9
    assert (batches[-1].first_sample - last.first_sample) / RATE_HZ == pytest.approx(elapsed_s, abs=0.05)


def test_a_decimation_that_does_not_divide_the_rate_is_refused() -> None:
    with pytest.raises(InvalidParameter, match='44100 Hz cannot be divided'):
        SoundCard(SensorParams(config='{rate_hz: 44100, decimation: 16}'))
