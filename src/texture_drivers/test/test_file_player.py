# SPDX-License-Identifier: Apache-2.0
import dataclasses

import numpy as np
import pytest

from texture_core.errors import DeviceError, InvalidParameter, UnknownName
from texture_core.types import lost_samples
from texture_drivers.file import FilePlayer
from texture_drivers.sensor import SensorParams

SECOND = 1_000_000_000
SAMPLES = np.arange(250.0).reshape(125, 2)


@pytest.fixture
def params(tmp_path):
    np.savez(tmp_path / 'slide.npz', samples=SAMPLES, rate_hz=1000.0, channels=['a', 'b'])
    return SensorParams(device=str(tmp_path / 'slide.npz'), frame_id='tip', batch_s=0.01)


def settle(params, config):
    return dataclasses.replace(params, config=config)


class Clock:
    """Goes on by `step_s` at each look."""

    def __init__(self, step_s):
        self.ns = 50 * SECOND
        self._step_ns = round(step_s * SECOND)

    def __call__(self):
        self.ns += self._step_ns
        return self.ns


def play(player, reads):
    return [batch for _ in range(reads) for batch in player.read().get('signal', [])]


def test_the_whole_recording_comes_once_in_order_as_fast_as_it_is_read(params):
    player = FilePlayer(settle(params, '{speed: 0}'), lambda: 7 * SECOND)
    player.open()
    batches = play(player, 20)
    np.testing.assert_array_equal(np.concatenate([batch.samples for batch in batches]), SAMPLES)
    assert lost_samples(batches) == 0
    assert [batch.stamp_ns for batch in batches[:2]] == [7 * SECOND, 7 * SECOND + 10_000_000]
    assert (batches[0].channels, batches[0].sensor, batches[0].frame_id) == (('a', 'b'), 'file/slide', 'tip')
    assert player.counts['samples'] == 125
    assert player.counts['times played'] == 1


def test_in_real_time_a_batch_comes_when_its_samples_would_have_been_taken(params):
    player = FilePlayer(params, Clock(0.005))
    player.open()
    assert [len(player.read()['signal']) for _ in range(6)] == [0, 1, 0, 1, 0, 1]


def test_after_a_stall_of_the_machine_nothing_is_lost(params):
    player = FilePlayer(params, Clock(0.06))
    player.open()
    batches = play(player, 4)
    np.testing.assert_array_equal(np.concatenate([batch.samples for batch in batches]), SAMPLES)


def test_a_loop_goes_on_with_index_and_stamps(params):
    player = FilePlayer(settle(params, '{speed: 0, loop: true}'), lambda: 0)
    player.open()
    batches = play(player, 26)
    np.testing.assert_array_equal(np.concatenate([batch.samples for batch in batches]), np.tile(SAMPLES, (2, 1)))
    assert lost_samples(batches) == 0
    assert batches[-1].end_ns == 250_000_000


def test_after_opening_again_it_begins_again_and_the_index_reports_the_pause(params):
    clock = Clock(0.0)
    player = FilePlayer(params, clock)
    player.open()
    clock.ns += SECOND // 10
    before = play(player, 1)
    player.close()
    clock.ns += SECOND
    player.open()
    clock.ns += SECOND // 10
    after = play(player, 1)
    np.testing.assert_array_equal(after[0].samples, before[0].samples)
    assert after[0].first_sample == 1100
    assert player.counts['reopened'] == 1


def test_rate_topic_and_unit_can_be_set(params):
    player = FilePlayer(settle(params, '{rate_hz: 100, speed: 2, topic: signal_static, unit: Pa}'), Clock(0.01))
    player.open()
    assert player.expected_rates_hz == {'signal_static': 200.0}
    assert player.read()['signal_static'][0].units == ('Pa', 'Pa')


@pytest.mark.parametrize(
    ('config', 'error', 'sentence'),
    [
        ('{sped: 2}', InvalidParameter, "did you mean 'speed'"),
        ('{speed: -1}', InvalidParameter, 'allowed is 0.0 to 1000.0'),
        ('{speed: ', InvalidParameter, 'no YAML'),
        ('[1, 2]', UnknownName, 'no settings'),
        ('nothing', UnknownName, 'Known: daq'),
    ],
)
def test_wrong_settings_are_refused_in_one_sentence(params, config, error, sentence):
    with pytest.raises(error, match=sentence):
        FilePlayer(settle(params, config))


def test_a_recording_without_a_rate_asks_for_one(params, tmp_path):
    np.save(tmp_path / 'bare.npy', SAMPLES)
    with pytest.raises(DeviceError, match='set `rate_hz`'):
        FilePlayer(dataclasses.replace(params, device=str(tmp_path / 'bare.npy'))).open()
