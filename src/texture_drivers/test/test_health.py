# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The level without load: measured, subtracted, and watched."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pytest

from texture_core.errors import DeviceError, InvalidData
from texture_core.types import TactileSignal
from texture_drivers import sensor as sensor_reader
from texture_drivers.health import Baseline, ChannelWatch, SensorHealth, Tare, TareParams, saturated
from texture_drivers.sensor import SensorReader

DEADLINE_S = 10.0


class Scripted:
    """A sensor that delivers batches of ten samples, with a fault in the middle."""

    expected_rates_hz: Mapping[str, float] = {'signal': 1000.0}

    def __init__(self, script: str) -> None:
        self.counts = {'samples': 0, 'lost': 0, 'bogus': 0, 'reopened': -1}
        self.script = list(script)

    def open(self) -> None:
        self.counts['reopened'] += 1
        if self.script and self.script[0] == 'X':
            self.script.pop(0)
            raise DeviceError('it is not there')

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        step = self.script.pop(0) if self.script else '.'
        if step == 'x':
            raise DeviceError('it is gone')
        if step == 'v':
            raise ValueError('4 bytes came')
        if step == '?':
            raise DeviceError('is the finger on?')
        threading.Event().wait(0.001)
        first = self.counts['samples']
        self.counts['samples'] += 10
        return {'signal': [TactileSignal(0, 's', ('a',), (), 1000.0, first, np.zeros((10, 1), np.float32))]}

    def close(self) -> None: ...


def run(script: str, batches: int) -> tuple[Scripted, SensorReader, list[str]]:
    sensor, logged, enough, came = Scripted(script), [], threading.Event(), []

    def deliver(topic: str, batch: TactileSignal) -> None:
        came.append(batch)
        if len(came) >= batches:
            enough.set()

    reader = SensorReader(sensor, deliver, logged.append, logged.append)
    reader.start()
    assert enough.wait(DEADLINE_S)
    reader.stop()
    return sensor, reader, logged


def test_a_sensor_that_is_gone_is_opened_again_and_reported_of_once() -> None:
    sensor, reader, logged = run('..xXX..', 4)
    assert sensor.counts['reopened'] == 3
    assert [sentence.split('.')[0] for sentence in logged] == [
        'the sensor delivers samples',
        'it is gone',
        'it is not there',
        'the sensor delivers samples',
    ]
    assert reader.fault == ''


def test_a_sensor_that_opens_and_delivers_nothing_is_not_called_unopened(monkeypatch) -> None:
    read = threading.Event()
    monkeypatch.setattr(Scripted, 'read', lambda sensor: read.set() or {})
    reader = SensorReader(Scripted(''), lambda *_: None)
    assert reader.fault == 'not opened yet'
    reader.start()
    assert read.wait(DEADLINE_S)
    assert reader.fault == 'no sample has come since it was opened; check the sensor'
    reader.stop()


def test_a_sensor_that_raises_anything_else_is_reported_with_its_line_and_opened_again() -> None:
    sensor, reader, logged = run('..v..', 4)
    assert sensor.counts['reopened'] == 1
    assert logged[1].startswith('the sensor raised ValueError in test_health.py, line ')
    assert logged[1].endswith(': 4 bytes came. Trying again every 0.2 s')
    assert reader.fault == ''
    assert run('..?..', 4)[2][1] == 'is the finger on? Trying again every 0.2 s'


def test_a_sensor_that_appears_soon_after_the_start_gives_no_warning(monkeypatch) -> None:
    monkeypatch.setattr(sensor_reader, 'RETRY_S', 0.001)
    monkeypatch.setattr(sensor_reader, 'QUIET_ATTEMPTS', 3)
    _, _, logged = run('XXX..xX..', 4)
    assert [sentence.split('.')[0] for sentence in logged] == [
        'the sensor delivers samples',
        'it is gone',
        'it is not there',
        'the sensor delivers samples',
    ]
    _, reader, logged = run('XXXXXX..', 2)
    assert [sentence.split('.')[0] for sentence in logged] == ['it is not there', 'the sensor delivers samples']
    assert reader.fault == ''


def test_the_level_rises_and_falls_back_with_what_happens() -> None:
    sensor = Scripted('')
    reader = SensorReader(sensor, lambda *_: None)
    reader.fault = ''
    health, now_s, levels = SensorHealth(reader, 0.0), 0.0, []
    story = [
        {'published': 1000},
        {'published': 951},  # 5 % off is still good
        {'published': 949},
        {'published': 1000, 'lost': 1},
        {'published': 1000, 'bogus': 5},
        {'published': 1000, 'bogus': 6},
        {'published': 0},  # for 1 s: not longer
        {'published': 0},
        {'published': 1000, 'reopened': 1},
        {'published': 1000},
        {'published': 1000, 'fault': 1},
        {'published': 1000},
    ]
    for step in story:
        now_s += 1.0
        reader.fault = 'it is gone' if step.pop('fault', 0) else ''
        reader.published['signal'] += step.pop('published')
        for name, change in step.items():
            sensor.counts[name] += change
        levels.append(health.report(now_s)[0])
    assert levels == ['OK', 'OK', 'WARN', 'WARN', 'OK', 'WARN', 'WARN', 'ERROR', 'WARN', 'OK', 'ERROR', 'OK']


class TwoFingers(Scripted):
    """A sensor with two fingers on one line."""

    @property
    def expected_rates_hz(self):
        return {'finger0/signal': 1000.0, 'finger0/signal_imu': 1000.0, 'finger1/signal': 1000.0}


def two_fingers_after(*seconds: tuple[str, ...]) -> tuple[str, str]:
    """Return the last of the reports, one for each second, in which this many topics streamed."""
    reader = SensorReader(TwoFingers(''), lambda *_: None)
    reader.fault = ''
    health = SensorHealth(reader, 0.0)
    for number, streaming in enumerate(seconds, 1):
        for topic in streaming:
            reader.published[topic] += 1000
        level, message, _ = health.report(float(number))
    return level, message


BOTH = ('finger0/signal', 'finger0/signal_imu', 'finger1/signal')


def test_a_finger_that_drops_out_is_an_error_with_its_name() -> None:
    assert two_fingers_after(BOTH, BOTH) == ('OK', 'streaming')
    dropped = two_fingers_after(BOTH, BOTH[:2], BOTH[:2])
    assert dropped == ('ERROR', 'no more samples from finger1; check its plug')
    assert two_fingers_after(BOTH, BOTH[:2], BOTH[:2], BOTH) == ('OK', 'streaming')


def test_a_finger_that_never_came_and_a_silent_inertial_unit_are_warnings_of_a_rate() -> None:
    for streaming in (BOTH[:2], ('finger0/signal', 'finger1/signal')):
        level, message = two_fingers_after(streaming, streaming, streaming)
        assert level == 'WARN'
        assert 'is off by more than' in message


RATE_HZ, CHANNELS = 100.0, ('a', 'b', 'c', 'd')
NOISE = np.array([1.0, 2.0, 1.0, 4.0])
LEVEL = np.array([100.0, -50.0, 0.0, 9000.0])


class Stream:
    """Batches of ten samples: a level, noise, and what is added to them."""

    def __init__(self, noise: np.ndarray = NOISE) -> None:
        self.rng = np.random.default_rng(0)
        self.sent = 0
        self.noise = noise

    def batch(self, added: np.ndarray | float = 0.0, slope_s: float = 0.0) -> TactileSignal:
        times_s = (self.sent + np.arange(10)) / RATE_HZ
        samples = LEVEL + added + slope_s * times_s[:, None] + self.noise * self.rng.standard_normal((10, 4))
        first, self.sent = self.sent, self.sent + 10
        stamp_ns = 10**18 + round(first / RATE_HZ * 1e9)
        return TactileSignal(stamp_ns, 'x/slow', CHANNELS, ('N',) * 4, RATE_HZ, first, samples.astype(np.float32))

    def seconds(self, seconds: float, **added: float) -> Iterator[TactileSignal]:
        return (self.batch(**added) for _ in range(round(seconds * RATE_HZ / 10)))


def test_a_tare_gives_level_and_noise_of_each_channel() -> None:
    tare, stream = Tare(20.0), Stream()
    found = next(found for batch in stream.seconds(21.0) if (found := tare.add(batch)))
    assert stream.sent / RATE_HZ == pytest.approx(20.0, abs=0.11)
    np.testing.assert_allclose(found.level, LEVEL, atol=0.5)
    np.testing.assert_allclose(found.noise, NOISE, rtol=0.1)


def test_drift_counts_in_noise_at_least_the_median_of_the_channels_and_a_ten_thousandth_of_the_level() -> None:
    noise, level = np.array([1.0, 2.0, 1.0, 0.0, 0.0]), np.array([100.0, 100.0, 0.0, 100.0, 200_000.0])
    drift = Baseline(level, noise, 0, Stream().batch()).drift(level + np.array([6.0, -6.0, 6.0, 6.0, 6.0]))
    np.testing.assert_allclose(drift, [6.0, 3.0, 6.0, 6.0, 0.3])


def test_a_level_that_moves_refuses_the_tare_and_names_the_channels() -> None:
    tare, stream = Tare(2.0), Stream()
    with pytest.raises(InvalidData, match=r"tare of 'x/slow': the level of a, b, c, d moved"):
        for batch in stream.seconds(2.5, slope_s=60.0):
            tare.add(batch)


def test_a_channel_without_a_valid_sample_refuses_the_tare() -> None:
    tare, stream = Tare(1.0), Stream()
    with pytest.raises(InvalidData, match='without any valid one'):
        for batch in stream.seconds(2.0, added=np.array([np.nan, 0.0, 0.0, 0.0])):
            tare.add(batch)


def watch(**params: float) -> ChannelWatch:
    return ChannelWatch(TareParams(**params), ['signal'], {'signal': (-200.0, 10_000.0)})


def unloaded() -> ChannelWatch:
    """Return a watch of a sensor that nothing touches, whose tare begins."""
    watched = watch()
    watched.unloaded = True
    watched.start_tare()
    return watched


def feed(watched: ChannelWatch, stream: Stream, seconds: int, **added: float) -> list[str]:
    """Feed this many seconds, with a review at the end of each; return the sentences of the last one."""
    faults: list[str] = []
    for _ in range(seconds):
        for batch in stream.seconds(1.0, **added):
            watched.add('signal', batch)
        faults, _ = watched.review(1.0)
    return faults


def test_a_tare_that_is_ended_leaves_no_baseline_of_a_stream_that_was_not_done() -> None:
    watched, stream = ChannelWatch(TareParams(tare_s=1.0), ['signal', 'slow'], {}), Stream()
    watched.start_tare()
    for batch in stream.seconds(1.5):
        watched.add('signal', batch)
    watched.end_tare('the finger moves')
    for batch in stream.seconds(1.5):
        watched.add('slow', batch)
    assert {topic: baseline is not None for topic, baseline in watched.baselines.items()} == {
        'signal': True,
        'slow': False,
    }
    assert (watched.taring, watched.refusal) == (False, 'the finger moves')


def test_an_unloaded_sensor_that_stays_where_it_was_tared_has_no_fault() -> None:
    watched, stream = unloaded(), Stream()
    assert feed(watched, stream, 60) == []
    assert watched.review(1.0)[1]['signal drift [noise]'] < 1.0


def test_a_slow_drift_is_reported_with_its_channel_and_ends_with_the_next_tare() -> None:
    watched, stream = unloaded(), Stream()
    feed(watched, stream, 3)
    drift = np.array([0.0, 0.0, 40.0, 0.0])
    assert feed(watched, stream, 1, added=drift) == []  # one second may be a touch
    assert feed(watched, stream, 4, added=drift) == ['signal: c has drifted off its baseline; tare again without load']
    watched.start_tare()
    assert feed(watched, stream, 5, added=drift) == []


def test_a_load_is_no_drift() -> None:
    watched, stream = unloaded(), Stream()
    feed(watched, stream, 3)
    watched.unloaded = False
    assert feed(watched, stream, 10, added=40.0) == []


def test_a_saturated_channel_is_named_and_a_single_hard_touch_is_none() -> None:
    watched, stream = watch(), Stream()
    samples = np.zeros((1000, 2), dtype=np.float32)
    samples[:5, 1] = 10.0
    assert not saturated(samples, np.array(-10.0), np.array(10.0)).any()
    assert feed(watched, stream, 1, added=np.array([0.0, 0.0, 0.0, 2000.0])) == [
        'signal: d is saturated: less force, or another gain'
    ]


def test_a_channel_that_never_changes_while_the_others_do_is_dead() -> None:
    stream = Stream(NOISE * [1, 0, 1, 1])
    watched = watch()
    assert feed(watched, stream, 25) == []
    assert feed(watched, stream, 10) == ['signal: b is dead: it does not change; check its wiring']


def test_the_baseline_is_subtracted_only_if_wanted_and_known() -> None:
    for subtract in (False, True):
        watched, stream = watch(subtract_baseline=subtract), Stream()
        assert watched.add('signal', stream.batch())[0].sensor == 'x/slow'
        watched.start_tare()
        feed(watched, stream, 3)
        assert watched.add('signal', stream.batch())[0].tared is subtract


def test_what_the_sensor_reports_is_reported_and_what_was_lost_at_a_restart_is_named_unknown() -> None:
    sensor, reader, _ = run('', 3)
    sensor.details = {'serial number': 'A7'}
    health = SensorHealth(reader, 0.0)
    numbers = health.report(1.0)[2]
    assert 'lost at restarts' not in numbers and numbers['serial number'] == 'A7'
    sensor.counts['device restarts'] = 1
    assert 'unknown' in health.report(2.0)[2]['lost at restarts']
