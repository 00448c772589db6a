# SPDX-License-Identifier: Apache-2.0
from texture_drivers.timing import SampleCounter


def test_consecutive_stamps_give_consecutive_indices() -> None:
    counter = SampleCounter()
    assert counter.place([700, 701, 702]) == ([0, 1, 2], False)
    assert counter.place([703]) == ([3], False)
    assert counter.lost == 0


def test_a_gap_in_the_stamps_is_a_gap_in_the_indices() -> None:
    counter = SampleCounter()
    assert counter.place([10, 11, 15, 16])[0] == [0, 1, 5, 6]
    assert counter.lost == 3


def test_an_odd_stamp_waits_for_the_next_one_to_explain_it() -> None:
    counter = SampleCounter()
    assert counter.place([10, 13])[0] == [0]
    assert counter.place([13, 14])[0] == [3, 4]


def test_a_damaged_stamp_moves_no_index() -> None:
    counter = SampleCounter()
    assert counter.place([10, 11, 12 + 2**40, 13, 14 - 8, 15, 16 + 256, 17])[0] == list(range(8))
    assert (counter.lost, counter.damaged_stamps) == (0, 3)


def test_stamps_of_16_bits_wrap() -> None:
    counter = SampleCounter()
    assert counter.place([65534, 65535, 0, 1, 4, 5])[0] == [0, 1, 2, 3, 6, 7]
    assert counter.lost == 2


def test_a_device_that_counts_from_zero_again_is_noticed() -> None:
    counter = SampleCounter()
    assert counter.place([1_000_000, 1_000_001, 0, 1]) == ([0, 1], True)
    counter.interrupt()
    counter.skip(498)
    assert counter.place([0, 1])[0] == [500, 501]
    assert counter.lost == 498


def test_a_device_that_samples_a_trifle_too_fast_loses_nothing() -> None:
    counter = SampleCounter()
    stamps = [round(i * 0.999) for i in range(10_000)]
    assert counter.place(stamps)[0] == list(range(10_000))
    assert counter.lost == 0
