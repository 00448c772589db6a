# SPDX-License-Identifier: Apache-2.0
import csv

import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_drivers.tsf85 import load_vendor_csv

HEADER = (
    ['Time(ms)', 'D0_0', 'D0_1']
    + [f'S{taxel}_{finger}' for finger in (0, 1) for taxel in range(28)]
    + [f'{kind}{axis}{finger}' for kind in 'AG' for finger in (0, 1) for axis in 'xyz']
)


def write(path, rows):
    with path.open('w', newline='') as file:
        csv.writer(file, delimiter=';').writerows([HEADER, *rows])
    return path


def row(ms, static=5):
    return [1_700_000_000_000 + ms, ms, -ms, *[static] * 28, *[2 * static] * 28, 0, 0, 16384, 0, 0, -16384, *[0] * 6]


@pytest.fixture
def recording(tmp_path):
    baseline = [1_699_999_999_000, 0, 0, *[9000] * 28, *[9100] * 28, *[0] * 12]
    return load_vendor_csv(write(tmp_path / 'slide.csv', [baseline, *(row(ms) for ms in range(600))]))


def test_each_finger_becomes_signals_in_the_units_of_the_driver(recording):
    signals = recording.signals(finger=1)
    (dynamic,), (static,), (imu,) = signals['signal'], signals['signal_static'], signals['imu']
    assert dynamic.samples[:3, 0].tolist() == [0, -1, -2]
    assert (dynamic.stamp_ns, dynamic.sampling_rate_hz) == (1_700_000_000_000_000_000, 1000.0)
    assert static.samples.shape == (36, 28)
    assert imu.samples[0] == pytest.approx([0, 0, -9.80665, 0, 0, 0])
    assert recording.rate_hz == pytest.approx(1000.0)


def test_the_first_line_is_the_baseline_and_no_sample(recording):
    assert recording.baseline[:, 0].tolist() == [9000, 9100]
    assert len(recording.time_ms) == 600


def test_a_line_in_which_the_image_alone_changed_is_no_sample(tmp_path):
    rows = [row(0), *(line for ms in range(100) for line in (row(ms), row(ms, static=6 + ms)))]
    recording = load_vendor_csv(write(tmp_path / 'slide.csv', rows))
    assert np.array_equal(recording.signals()['signal'][0].samples[:, 0], np.arange(100))


@pytest.mark.parametrize('text', ['', 'a;b\n1;2\n', 'Time(ms);D0_0\n1;2\n3;4\n5;6\n', ';'.join(HEADER) + '\nx;y\n'])
def test_another_file_is_refused_with_a_sentence(tmp_path, text):
    (tmp_path / 'other.csv').write_text(text)
    with pytest.raises(InvalidData, match=r'other\.csv'):
        load_vendor_csv(tmp_path / 'other.csv')
