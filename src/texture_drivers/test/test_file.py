# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.io import wavfile

from texture_core.errors import DeviceError, InvalidData, InvalidParameter, UnknownName
from texture_core.types import lost_samples
from texture_drivers.file import FilePlayer, load_recording
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
    """Advances by `step_s` at each call."""

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
        ('{speed: ', InvalidParameter, 'are not YAML'),
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


TABLE = np.array([[0.0, 1.0], [2.5, -3.0], [4.0, 5.0]])


def write(path, text):
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ('text', 'channels'),
    [
        ('0,1\n2.5,-3\n4,5\n', ()),
        ('# a comment\nleft,right\n0,1\n2.5,-3\n\n4,5\n', ('left', 'right')),
        ('left;right\n0;1\n2.5;-3\n4;5\n', ('left', 'right')),
        ('0 1\n2.5 -3\n4 5', ()),
        ('\ufeff"left", "right"\n0, 1\n2.5, -3\n4, 5\n', ('left', 'right')),
    ],
)
def test_tables_of_all_dialects_are_read(tmp_path, text, channels):
    recording = load_recording(write(tmp_path / 'slide.csv', text))
    np.testing.assert_array_equal(recording.samples, TABLE)
    assert (recording.channels, recording.rate_hz) == (channels, None)


def test_a_column_of_times_gives_the_rate_and_is_no_channel(tmp_path):
    lines = [f'{i / 800:.6f},{i}' for i in range(100)]
    recording = load_recording(write(tmp_path / 'slide.csv', 'time_s,film\n' + '\n'.join(lines)))
    assert recording.rate_hz == pytest.approx(800.0, rel=1e-4)
    assert recording.channels == ('film',)
    np.testing.assert_array_equal(recording.samples[:, 0], np.arange(100))


@pytest.mark.parametrize(
    ('kind', 'values'),
    [
        ('uint8', [0, 128, 192]),
        ('int16', [-(2**15), 0, 2**14]),
        ('int32', [-(2**31), 0, 2**30]),
        ('float32', [-1.0, 0.0, 0.5]),
    ],
)
def test_every_format_of_a_wave_file_has_full_scale_one(tmp_path, kind, values):
    wavfile.write(tmp_path / 'slide.wav', 4096, np.array(values, dtype=kind))
    recording = load_recording(tmp_path / 'slide.wav')
    assert recording.rate_hz == 4096.0
    np.testing.assert_array_equal(recording.samples[:, 0], [-1.0, 0.0, 0.5])


def test_arrays_are_read_alone_and_with_their_rate_and_channels(tmp_path):
    np.save(tmp_path / 'a.npy', TABLE.astype(np.int16))
    np.save(tmp_path / 'b.npy', np.arange(5.0))
    np.savez(tmp_path / 'c.npz', samples=TABLE, rate_hz=2200, channels=['pac', 'pdc'])
    assert load_recording(tmp_path / 'a.npy').samples.shape == (3, 2)
    assert load_recording(tmp_path / 'b.npy').samples.shape == (5, 1)
    recording = load_recording(tmp_path / 'c.npz')
    assert (recording.rate_hz, recording.channels) == (2200.0, ('pac', 'pdc'))


@pytest.mark.parametrize(
    ('name', 'content', 'sentence'),
    [
        ('slide.mp3', 'x', "ends in '.mp3'; allowed are .csv, .wav"),
        ('slide.csv', '', r'shape \(0'),
        ('slide.csv', 'a,b\n1,2\n3\n', 'not usable'),
        ('slide.csv', 'a,b\n1,x\n', 'not usable'),
        ('slide.csv', 'a,b\n1,2,3\n', 'first line has 2 names and the others 3 numbers'),
        ('slide.csv', 'time_s,a\n0,1\n1,2\n5,3\n', 'uneven'),
        ('slide.csv', 'time_s,a\n5,1\n1,2\n', 'do not rise'),
        ('slide.wav', 'no wave', 'not usable'),
        ('slide.npy', 'no array', 'not usable'),
        ('slide.npz', 'no arrays', 'not usable'),
    ],
)
def test_a_bad_file_is_refused_in_one_sentence(tmp_path, name, content, sentence):
    with pytest.raises(InvalidData, match=sentence):
        load_recording(write(tmp_path / name, content))


@pytest.mark.parametrize(
    ('arrays', 'sentence'),
    [
        ({'other': TABLE}, "holds other; an array called 'samples' is needed"),
        ({'samples': TABLE, 'channels': ['one']}, 'names 1 channels and has 2'),
        ({'samples': TABLE, 'rate_hz': -1.0}, 'rate of -1.0 Hz'),
        ({'samples': np.zeros((2, 2, 2))}, r'shape \(2, 2, 2\)'),
        ({'samples': np.array(['a'])}, 'real numbers are needed'),
        ({'samples': np.array([1 + 2j])}, 'real numbers are needed'),
    ],
)
def test_arrays_that_are_no_recording_are_refused(tmp_path, arrays, sentence):
    np.savez(tmp_path / 'slide.npz', **arrays)
    with pytest.raises(InvalidData, match=sentence):
        load_recording(tmp_path / 'slide.npz')
