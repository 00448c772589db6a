# SPDX-License-Identifier: Apache-2.0
import wave

import numpy as np
import pytest
from scipy.io import wavfile

from texture_core.errors import InvalidData
from texture_drivers.file import load_recording

SAMPLES = np.array([[0.0, 1.0], [2.5, -3.0], [4.0, 5.0]])


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
    np.testing.assert_array_equal(recording.samples, SAMPLES)
    assert (recording.channels, recording.rate_hz) == (channels, None)


def test_a_column_of_times_gives_the_rate_and_is_no_channel(tmp_path):
    lines = [f'{i / 800:.6f},{i}' for i in range(100)]
    recording = load_recording(write(tmp_path / 'slide.csv', 'time_s,film\n' + '\n'.join(lines)))
    assert recording.rate_hz == pytest.approx(800.0, rel=1e-4)
    assert recording.channels == ('film',)
    np.testing.assert_array_equal(recording.samples[:, 0], np.arange(100))


def test_a_wave_file_of_the_standard_library_is_read_with_full_scale_one(tmp_path):
    path = tmp_path / 'slide.wav'
    with wave.open(str(path), 'wb') as file:
        file.setnchannels(2)
        file.setsampwidth(2)
        file.setframerate(4096)
        file.writeframes(np.array([[-32768, 16384], [0, 8192]], dtype='<i2').tobytes())
    recording = load_recording(path)
    assert recording.rate_hz == 4096.0
    np.testing.assert_array_equal(recording.samples, [[-1.0, 0.5], [0.0, 0.25]])


@pytest.mark.parametrize('kind', ['uint8', 'int16', 'int32', 'float32'])
def test_every_sample_format_means_the_same(tmp_path, kind):
    values = {'uint8': [0, 128], 'int16': [-(2**15), 0], 'int32': [-(2**31), 0], 'float32': [-1.0, 0.0]}[kind]
    wavfile.write(tmp_path / 'slide.wav', 1000, np.array(values, dtype=kind))
    np.testing.assert_array_equal(load_recording(tmp_path / 'slide.wav').samples[:, 0], [-1.0, 0.0])


def test_arrays_are_read_alone_and_with_their_rate_and_channels(tmp_path):
    np.save(tmp_path / 'a.npy', SAMPLES.astype(np.int16))
    np.save(tmp_path / 'b.npy', np.arange(5.0))
    np.savez(tmp_path / 'c.npz', samples=SAMPLES, rate_hz=2200, channels=['pac', 'pdc'])
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
        ({'other': SAMPLES}, "holds other; an array called 'samples' is needed"),
        ({'samples': SAMPLES, 'channels': ['one']}, 'names 1 channels and has 2'),
        ({'samples': SAMPLES, 'rate_hz': -1.0}, 'rate of -1.0 Hz'),
        ({'samples': np.zeros((2, 2, 2))}, r'shape \(2, 2, 2\)'),
        ({'samples': np.array(['a'])}, 'real numbers are needed'),
        ({'samples': np.array([1 + 2j])}, 'real numbers are needed'),
    ],
)
def test_arrays_that_are_no_recording_are_refused(tmp_path, arrays, sentence):
    np.savez(tmp_path / 'slide.npz', **arrays)
    with pytest.raises(InvalidData, match=sentence):
        load_recording(tmp_path / 'slide.npz')
