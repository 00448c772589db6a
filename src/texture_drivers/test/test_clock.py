# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from texture_drivers.timing import StreamClock

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND


def run(clock, indices, *, delay_ns=0, drift=0.0, offset_ns=START):
    for index in indices:
        clock.observe(index, offset_ns + round(index * 1e6 * (1 + drift)) + delay_ns)


@pytest.mark.parametrize('drift', [-3e-3, 0.0, 200e-6])
def test_an_undisturbed_stream_of_any_drift_is_followed(drift):
    clock = StreamClock(1000.0)
    run(clock, range(9, 120_000, 10), drift=drift)
    assert clock.drift == pytest.approx(drift, abs=1e-7)
    assert clock.time_ns(119_999) - START == pytest.approx(119_999e6 * (1 + drift), abs=2e4)
    assert clock.index_at(clock.time_ns(123_456)) == pytest.approx(123_456, abs=1e-3)


def test_stamps_are_in_order_and_contiguous_from_the_moment_the_clock_is_settled():
    rng = np.random.default_rng(1)
    clock = StreamClock(1000.0)
    stamps = []
    for index in range(9, 60_000, 10):
        clock.observe(index, START + index * 1_000_000 + round(rng.exponential(5e6)))
        if clock.settled:
            stamps.append([clock.time_ns(index - 9), clock.time_ns(index + 1)])
    firsts, ends = np.array(stamps).T
    assert np.abs(np.diff(firsts) / 1e7 - 1).max() < 0.03  # bends by at most 2 %
    assert np.abs(firsts[1:] - ends[:-1]).max() < 0.02 * 1e7


def test_one_late_batch_moves_nothing():
    clock = StreamClock(1000.0)
    run(clock, range(0, 20_000, 10))
    before = clock.time_ns(20_000)
    run(clock, [20_000], delay_ns=2 * SECOND)
    assert clock.time_ns(20_000) == before
    assert clock.steps == 0


@pytest.mark.parametrize('gap_s', [3, 300, 20_000])
def test_after_a_long_gap_the_stamps_are_right_at_once(gap_s):
    rng = np.random.default_rng(2)
    clock = StreamClock(1000.0)
    after = 120_000 + gap_s * 1000
    for index in [*range(0, 120_000, 10), *range(after, after + 300, 10)]:
        clock.observe(index, START + round(index * 1e6 * (1 + 50e-6) + rng.exponential(5e6)))
    error_ns = clock.time_ns(after + 300) - START - (after + 300) * 1e6 * (1 + 50e-6)
    assert abs(error_ns) < 0.5e6 + 1e-6 * gap_s * SECOND  # the drift is known to a part in a million


@pytest.mark.parametrize('step_s', [-3600.0, -1.0, 1.0, 86400.0])
def test_a_step_of_the_hosts_clock_is_followed_within_two_seconds_and_counted(step_s):
    clock = StreamClock(1000.0)
    run(clock, range(0, 20_000, 10))
    moved = START + round(step_s * SECOND)
    run(clock, range(20_000, 22_000, 10), offset_ns=moved)
    assert clock.time_ns(22_000) == pytest.approx(moved + 22 * SECOND, abs=1e5)
    assert clock.steps == 1


def test_a_device_that_counts_from_the_beginning_again_is_another_stream():
    clock = StreamClock(1000.0)
    run(clock, range(0, 20_000, 10))
    run(clock, range(0, 100, 10), offset_ns=START + 25 * SECOND)
    assert clock.time_ns(0) == pytest.approx(START + 25 * SECOND, abs=1e5)
    assert clock.steps == 1


def test_the_times_of_a_stream_far_too_fast_never_run_ahead_of_its_arrivals():
    clock = StreamClock(1000.0)
    ahead_ns = []
    for index in range(0, 100_000, 10):  # ten times the rate: 10 s
        arrival_ns = START + 100_000 * index
        clock.observe(index, arrival_ns)
        ahead_ns.append(clock.time_ns(index) - arrival_ns)
    assert max(ahead_ns) < 0.6e9
    assert clock.steps > 0
