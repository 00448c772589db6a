# SPDX-License-Identifier: Apache-2.0
from types import SimpleNamespace as Message

import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_drivers.tsf85 import Tsf85MessageConverter

MS = 1_000_000
START_NS = 1_700_000_000_000_000_000


class Driver:
    """The vendor's driver: for each packet a message on each topic, a few microseconds apart."""

    def __init__(self, stream):
        self.stream = stream
        self.stamp = 65_500  # wraps soon
        self.now_ns = START_NS
        self.signals = []
        self.others = {}

    def packet(self, value, *, lose=(), step=1, image=None):
        self.stamp += step
        self.now_ns += step * MS or 50_000
        messages = {
            'Dynamic': Message(data=[Message(value=0), Message(value=value)]),
            'StaticData': Message(taxels=[Message(values=[0] * 28), Message(values=image or [value % 100] * 28)]),
            'Accelerometer': Message(data=[Message(values=[0, 0, 0]), Message(values=[0, 0, 16384])]),
            'Gyroscope': Message(data=[Message(values=[0, 0, 0])] * 2),
            'Timestamp': Message(values=[0, self.stamp % 2**16]),
        }
        for number, (topic, message) in enumerate(messages.items()):
            if topic not in lose:
                self.stream.take(topic, message, self.now_ns + number * 5000)

    def collect(self):
        for topic, batches in self.stream.batches().items():
            self.others.setdefault(topic, []).extend(batches)
        self.signals = self.others.get('signal', [])


@pytest.fixture
def driver():
    return Driver(Tsf85MessageConverter(finger=1))


def found(driver):
    return {
        batch.first_sample + i: int(value) for batch in driver.signals for i, value in enumerate(batch.samples[:, 0])
    }


def run(driver, packets, **faults):
    for number in range(packets):
        driver.packet(number, **faults.get(f'at_{number}', {}))
        if number % 10 == 9:
            driver.collect()


def test_messages_become_batches_numbered_by_the_stamps_and_timed_by_when_they_were_sent(driver):
    run(driver, 500)
    values = found(driver)
    assert len({value - index for index, value in values.items()}) == 1
    assert driver.stream.counts['lost'] == 0
    last = driver.signals[-1]
    assert last.stamp_ns == pytest.approx(START_NS + (last.samples[0, 0] + 1) * MS, abs=20_000)
    assert len(driver.others['signal_static']) == pytest.approx(24, abs=2)
    assert driver.others['imu'][-1].samples[-1] == pytest.approx([0, 0, 9.80665, 0, 0, 0])


def test_a_lost_sample_leaves_a_gap_and_a_lost_stamp_none(driver):
    run(driver, 500, at_200={'lose': ('Dynamic',)}, at_300={'lose': ('Timestamp',)})
    values = found(driver)
    assert len({value - index for index, value in values.items()}) == 1
    assert 200 not in values.values()
    assert 300 in values.values()
    counts = driver.stream.counts
    assert (counts['lost'], counts['unpaired'], counts['unstamped']) == (1, 1, 1)


def test_a_packet_with_an_image_alone_is_no_sample(driver):
    run(driver, 500, at_200={'step': 0})
    assert driver.stream.counts['repeated'] == 1
    assert driver.stream.counts['lost'] == 0


def test_without_any_stamp_samples_are_numbered_through(driver):
    for number in range(500):
        driver.packet(number, lose=('Timestamp',))
        driver.collect()
    assert np.diff(list(found(driver))).max() == 1
    assert driver.stream.counts['unstamped'] > 400


def test_after_a_long_silence_the_gap_is_that_of_the_clock(driver):
    run(driver, 500)
    driver.now_ns += 70_000 * MS  # the stamps of 16 bits have wrapped
    driver.stamp += 70_000
    before = driver.signals[-1]
    run(driver, 500)
    after = next(batch for batch in driver.signals if batch.first_sample > before.next_sample)
    gap_s = (after.stamp_ns - before.end_ns) / 1e9
    assert gap_s > 70
    assert (after.first_sample - before.next_sample) / 1000 == pytest.approx(gap_s, abs=0.01)


def test_an_image_of_another_kind_is_refused(driver):
    with pytest.raises(InvalidData, match='12 taxels; a TSF-85 has 28'):
        driver.packet(0, image=[1] * 12)
