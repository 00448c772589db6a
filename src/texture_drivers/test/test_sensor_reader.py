# SPDX-License-Identifier: Apache-2.0
import threading
from collections.abc import Mapping, Sequence

import numpy as np

from texture_core.errors import DeviceError
from texture_core.types import TactileSignal
from texture_drivers import sensor as sensor_reader
from texture_drivers.health import SensorHealth
from texture_drivers.sensor import SensorReader

DEADLINE_S = 10.0


class Scripted:
    """A sensor that delivers batches of ten samples, with a fault in the middle."""

    expected_rates_hz: Mapping[str, float] = {'signal': 1000.0}

    def __init__(self, script: str) -> None:
        self.counts = {'samples': 0, 'lost': 0, 'bogus': 0, 'reopened': -1}
        self.script = list(script)
        self.closed = 0

    def open(self) -> None:
        self.counts['reopened'] += 1
        if self.script and self.script[0] == 'X':
            self.script.pop(0)
            raise DeviceError('it is not there')

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        step = self.script.pop(0) if self.script else '.'
        if step == 'x':
            raise DeviceError('it is gone')
        threading.Event().wait(0.001)
        first = self.counts['samples']
        self.counts['samples'] += 10
        return {'signal': [TactileSignal(0, 's', ('a',), (), 1000.0, first, np.zeros((10, 1), np.float32))]}

    def close(self) -> None:
        self.closed += 1


def run(script: str, batches: int) -> tuple[Scripted, SensorReader, list[str]]:
    sensor, told, enough, came = Scripted(script), [], threading.Event(), []

    def deliver(topic: str, batch: TactileSignal) -> None:
        came.append(batch)
        if len(came) >= batches:
            enough.set()

    reader = SensorReader(sensor, deliver, told.append, told.append)
    reader.start()
    assert enough.wait(DEADLINE_S)
    reader.stop()
    return sensor, reader, told


def test_batches_are_handed_on_and_the_sensor_is_closed_in_the_end() -> None:
    sensor, reader, told = run('', 3)
    assert sensor.closed >= 1
    assert reader.published['signal'] == sensor.counts['samples']
    assert told == ['the sensor delivers samples']


def test_a_sensor_that_is_gone_is_opened_again_and_reported_of_once() -> None:
    sensor, reader, told = run('..xXX..', 4)
    assert sensor.counts['reopened'] == 3
    assert [sentence.split('.')[0] for sentence in told] == [
        'the sensor delivers samples',
        'it is gone',
        'it is not there',
        'the sensor delivers samples',
    ]
    assert reader.fault == ''


def test_a_sensor_that_appears_soon_after_the_start_gives_no_warning(monkeypatch) -> None:
    monkeypatch.setattr(sensor_reader, 'RETRY_S', 0.001)
    monkeypatch.setattr(sensor_reader, 'QUIET_ATTEMPTS', 3)
    _, _, told = run('XXX..xX..', 4)
    assert [sentence.split('.')[0] for sentence in told] == [
        'the sensor delivers samples',
        'it is gone',
        'it is not there',
        'the sensor delivers samples',
    ]
    _, reader, told = run('XXXXXX..', 2)
    assert [sentence.split('.')[0] for sentence in told] == ['it is not there', 'the sensor delivers samples']
    assert reader.fault == ''


def health_after(period_s: float, **changes: int) -> tuple[str, str]:
    sensor = Scripted('')
    reader = SensorReader(sensor, lambda *_: None)
    reader.fault = ''
    health = SensorHealth(reader, 100.0)
    reader.published['signal'] += changes.pop('published', 1000)
    for name, change in changes.items():
        sensor.counts[name] += change
    level, message, numbers = health.report(100.0 + period_s)
    assert 'signal rate [Hz]' in numbers
    return level, message


def test_health_is_ok_at_the_expected_rate() -> None:
    assert health_after(1.0) == ('OK', 'streaming')


def test_losses_a_wrong_rate_bad_packets_and_a_reopening_are_warnings() -> None:
    assert health_after(1.0, lost=3) == ('WARN', '3 samples lost since the last report')
    assert health_after(1.0, published=900)[0] == 'WARN'
    assert health_after(1.0, bogus=6)[0] == 'WARN'
    assert health_after(1.0, bogus=4)[0] == 'OK'
    assert health_after(1.0, reopened=1)[0] == 'WARN'


def test_silence_is_an_error() -> None:
    assert health_after(1.5, published=0)[0] == 'ERROR'


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


def test_what_the_sensor_reports_of_itself_is_reported() -> None:
    sensor = Scripted('')
    sensor.details = {'serial number': 'A7'}
    reader = SensorReader(sensor, lambda *_: None)
    assert SensorHealth(reader, 0.0).report(1.0)[2]['serial number'] == 'A7'


class TwoFingers(Scripted):
    """A sensor with two fingers on one line."""

    @property
    def expected_rates_hz(self):
        return {'finger0/signal': 1000.0, 'finger0/imu': 1000.0, 'finger1/signal': 1000.0}


def two_fingers_after(*seconds: tuple[str, ...]) -> tuple[str, str]:
    """Return the last of the reports, one for each second, in which so many topics streamed."""
    reader = SensorReader(TwoFingers(''), lambda *_: None)
    reader.fault = ''
    health = SensorHealth(reader, 0.0)
    for number, streaming in enumerate(seconds, 1):
        for topic in streaming:
            reader.published[topic] += 1000
        level, message, _ = health.report(float(number))
    return level, message


BOTH = ('finger0/signal', 'finger0/imu', 'finger1/signal')


def test_a_finger_that_drops_out_is_an_error_with_its_name() -> None:
    assert two_fingers_after(BOTH, BOTH) == ('OK', 'streaming')
    dropped = two_fingers_after(BOTH, BOTH[:2], BOTH[:2])
    assert dropped == ('ERROR', 'no sample comes any more of finger1; check its plug')
    assert two_fingers_after(BOTH, BOTH[:2], BOTH[:2], BOTH) == ('OK', 'streaming')


def test_a_finger_that_never_came_and_a_silent_inertial_unit_are_warnings_of_a_rate() -> None:
    for streaming in (BOTH[:2], ('finger0/signal', 'finger1/signal')):
        level, message = two_fingers_after(streaming, streaming, streaming)
        assert level == 'WARN'
        assert 'is off by more than' in message
