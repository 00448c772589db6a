# SPDX-License-Identifier: Apache-2.0
import pytest

from texture_core.errors import DeviceError
from texture_drivers.timing import BlockCounter

RATE_HZ = 2500.0  # 10 samples take 4000 µs


def test_blocks_that_follow_each_other_are_numbered_through():
    counter = BlockCounter(RATE_HZ, 'daq')
    assert [counter.place(100 + 4000 * i, 10, 0) for i in range(3)] == [0, 10, 20]


def test_a_lost_frame_moves_the_index_by_exactly_its_samples():
    counter = BlockCounter(RATE_HZ, 'daq')
    assert [counter.place(0, 10, 0), counter.place(12_000, 10, 2), counter.place(16_000, 10, 0)] == [0, 30, 40]
    assert counter.overrun == 0


def test_samples_that_the_device_left_out_are_reported_apart_from_lost_frames():
    counter = BlockCounter(RATE_HZ, 'daq')
    assert [counter.place(0, 10, 0), counter.place(4000 + 5 * 400, 10, 0)] == [0, 15]
    assert counter.overrun == 5


def test_the_jitter_of_the_devices_stamps_and_its_rounding_move_nothing():
    counter = BlockCounter(4096.0, 'film')  # 32 samples take 7812.5 µs
    jitter = [0, 100, -100, 3]
    assert [counter.place(int(i * 7812.5) + jitter[i % 4], 32, 0) for i in range(10_000)][-1] == 32 * 9999
    assert counter.overrun == 0


@pytest.mark.parametrize('true_hz', [2000.0, 3000.0])
def test_a_wrong_rate_is_named_after_three_seconds(true_hz):
    counter = BlockCounter(RATE_HZ, 'daq')
    with pytest.raises(DeviceError, match=f'{true_hz:.4g} samples in a second .* 2500 are set'):
        for i in range(2000):
            counter.place(round(i * 10 / true_hz * 1e6), 10, 0)


def test_one_hiccup_of_the_device_is_no_wrong_rate():
    counter = BlockCounter(RATE_HZ, 'daq')
    for i in range(2000):
        counter.place(4000 * i + (200_000 if i > 500 else 0), 10, 0)
    assert counter.overrun == 500


def test_after_an_interruption_the_index_goes_on_where_it_is_reported_to():
    counter = BlockCounter(RATE_HZ, 'daq')
    counter.place(5_000_000, 10, 0)
    counter.resume(missing=90)
    assert counter.place(17, 10, 0) == 100
