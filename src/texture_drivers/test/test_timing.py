# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Numbers and times of samples that carry neither."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pytest

from texture_drivers.timing import HALF_WIDTH, ArrivalNumbering, Decimator, RateMeter, SampleCounter, StreamClock
from texture_drivers.tsf85 import SIGNAL, FingerStream, SampleFrame

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


READ_S = 0.01
RATE_HZ = 150.0


class Line:
    """A device at 150 Hz that is read each 10 ms, a little late by chance; simulated time."""

    def __init__(self, numbering: ArrivalNumbering) -> None:
        self.numbering = numbering
        self.rng = np.random.default_rng(0)
        self.now_s = 0.0
        self.sent = 0
        self.errors_s: list[float] = []

    def run(self, seconds: float, lost: int = 0, reported: int = 0) -> list[int]:
        """Return the difference between index and true number of each block; before it this many samples are lost."""
        self.sent += lost
        self.now_s = max(self.now_s, self.sent / RATE_HZ)
        offsets, until_s = [], self.now_s + seconds
        while self.now_s < until_s:
            self.now_s += READ_S + self.rng.exponential(0.001)
            first, self.sent = self.sent, int(self.now_s * RATE_HZ)
            if self.sent == first:
                continue
            arrival_ns = START + round(self.now_s * SECOND)
            indices = self.numbering.place([(reported, self.sent - first)], arrival_ns)
            reported = 0
            offsets += [index - first for index in indices]
            if indices:
                time_s = (self.numbering.clock.time_ns(indices[0]) - START) / SECOND
                self.errors_s.append(time_s - (first + 1) / RATE_HZ)
        return offsets


@pytest.fixture
def line() -> Line:
    return Line(ArrivalNumbering(RATE_HZ, block_s=READ_S))


def test_without_a_loss_the_index_is_the_number_of_the_sample_and_the_time_is_right(line: Line) -> None:
    assert set(line.run(20.0)) == {0}
    assert np.abs(line.errors_s[500:]).max() < 0.002


def test_what_the_protocol_tells_to_be_missing_is_left_out_at_once(line: Line) -> None:
    line.run(3.0)
    assert set(line.run(3.0, lost=4, reported=4)) == {0}


def test_a_gap_that_nobody_tells_is_known_half_a_second_later(line: Line) -> None:
    line.run(3.0)
    offsets = line.run(3.0, lost=30)
    assert offsets[0] == -30
    late = offsets.index(offsets[-1])
    assert offsets[-1] == pytest.approx(0, abs=1)
    assert 30 < late < 70  # blocks of 10 ms


def test_over_an_interruption_the_host_s_clock_tells_what_is_missing(line: Line) -> None:
    line.run(3.0)
    line.numbering.interrupt()
    assert set(line.run(3.0, lost=150)) <= {-1, 0, 1}


@pytest.mark.parametrize('rate_hz', [93.0, 150.0, 400.0])
def test_the_rate_is_measured_to_a_third_of_a_percent_in_two_seconds(rate_hz: float) -> None:
    meter, rng = RateMeter(), np.random.default_rng(1)
    now_s, sent, found_hz = 0.0, 0, 0.0
    while not found_hz:
        now_s += READ_S + rng.exponential(0.003)
        arrived, sent = int(now_s * rate_hz) - sent, int(now_s * rate_hz)
        if arrived:
            found_hz = meter.update(arrived, START + round(now_s * SECOND))
    assert 2.0 <= now_s < 2.2
    assert found_hz == pytest.approx(rate_hz, rel=0.003)


@pytest.mark.parametrize(
    ('period_ns', 'rate_hz'),
    [(2_000_024, 500.0), (1_999_960, 500.0), (16_000_000, 62.5), (16_001_000, 62.5), (83_000_000, 12.0)],
)
def test_a_rate_measured_twice_is_the_same_and_within_half_a_percent(period_ns: int, rate_hz: float) -> None:
    meter, found_hz, samples = RateMeter(), 0.0, 0
    while not found_hz:
        samples += 1
        found_hz = meter.update(1, START + samples * period_ns)
    assert found_hz == rate_hz


MS = 1_000_000
BATCH = 10
CALM_S = 0.6  # after a loss, times are right again within
BOUND_S = 0.012


def follow(seconds, lost, *, drift=0.0, stamped=False, seed=1, late_ms=0.0):
    """Return the finger, and (true time in s, error of the stamp in s) of each sample that came out.

    `lost` holds for each true millisecond whether it is lost; arrivals jitter by up to some ms, as on USB.
    """
    rng = np.random.default_rng(seed)
    finger, errors = FingerStream(), []
    for first in range(0, round(seconds * 1000), BATCH):
        sets = [
            SampleFrame(ms if stamped else None, ms % 30_000)
            for ms in range(first, first + BATCH)
            if not lost[ms % len(lost)]
        ]
        jitter_ns = round(rng.exponential(2 * MS) + late_ms * MS * (2.0 < first / 1000 < 2.4))
        arrival_ns = START + round((first + BATCH) * MS * (1 + drift)) + jitter_ns
        for batch in finger.place(sets, arrival_ns).get(SIGNAL, []):
            values = batch.samples[:, 0].astype(int)
            true_s = (values + (first // 30_000) * 30_000) / 1e3
            stamps_ns = batch.stamp_ns - START + np.arange(len(values)) * MS
            errors.append(np.column_stack([true_s, stamps_ns / 1e9 - true_s * (1 + drift)]))
    return finger, np.concatenate(errors)


def losing(seconds, *gaps):
    lost = np.zeros(round(seconds * 1000), dtype=bool)
    for at_s, n in gaps:
        lost[round(at_s * 1000) : round(at_s * 1000) + n] = True
    return lost


@pytest.mark.parametrize('drift', [-2e-3, 0.0, 2e-3])
@pytest.mark.parametrize('n', [20, 100, 400])
def test_after_lost_packets_the_times_are_right_again_within_a_second(n, drift):
    finger, errors = follow(20.0, losing(20.0, (8.0, n)), drift=drift)
    calm = (errors[:, 0] > 3.0) & ((errors[:, 0] < 8.0) | (errors[:, 0] > 8.0 + n / 1000 + CALM_S))
    assert np.abs(errors[calm, 1]).max() < BOUND_S
    assert finger.lost == pytest.approx(n, abs=10)


def test_one_packet_in_twenty_lost_at_random_stays_within_the_bound():
    lost = np.random.default_rng(3).random(30_000) < 0.05
    _, errors = follow(30.0, lost)
    assert np.abs(errors[errors[:, 0] > 3.0, 1]).max() < BOUND_S + 0.05 * CALM_S


@pytest.mark.parametrize('late_ms', [0.0, 50.0])
def test_a_busy_host_loses_nothing(late_ms):
    finger, errors = follow(10.0, losing(10.0), late_ms=late_ms)
    assert finger.lost == 0
    assert np.abs(errors[:, 1]).max() < BOUND_S


def test_where_there_are_stamps_they_alone_count():
    finger, errors = follow(10.0, losing(10.0, (5.0, 100)), stamped=True)
    assert finger.lost == 100
    assert np.abs(errors[errors[:, 0] > 1.0, 1]).max() < 2e-3


CARD_HZ, FACTOR = 48_000.0, 12  # to 4000 Hz


def decimated(samples: np.ndarray, cuts: list[int] | None = None) -> tuple[int, np.ndarray]:
    """Return the first index, and all outputs, of blocks cut at places."""
    decimator = Decimator(FACTOR)
    edges = [0, *(cuts or []), len(samples)]
    found = [decimator.feed(a, samples[a:b, None].astype(np.float32)) for a, b in itertools.pairwise(edges)]
    outputs = [(first, values) for first, values in found if len(values)]
    for (first, values), (following, _) in itertools.pairwise(outputs):
        assert first + len(values) == following
    return outputs[0][0], np.concatenate([values for _, values in outputs])[:, 0]


def tone(frequency_hz: float, seconds: float = 0.5) -> np.ndarray:
    return np.sin(2 * np.pi * frequency_hz * np.arange(round(seconds * CARD_HZ)) / CARD_HZ)


@pytest.mark.parametrize('frequency_hz', [10.0, 500.0, 1200.0])
def test_a_tone_in_the_band_passes_unchanged_and_without_a_delay(frequency_hz: float) -> None:
    first, found = decimated(tone(frequency_hz))
    exact = tone(frequency_hz)[FACTOR * first :: FACTOR][: len(found)]
    assert first == HALF_WIDTH
    np.testing.assert_allclose(found, exact, atol=2e-3)


@pytest.mark.parametrize('frequency_hz', [2300.0, 3800.0, 7900.0, 20_000.0])
def test_what_would_be_folded_into_the_band_is_damped_by_60_db(frequency_hz: float) -> None:
    assert np.abs(decimated(tone(frequency_hz))[1]).max() < 1e-3


@pytest.mark.parametrize('block', [1, 7, 480, 5000])
def test_it_does_not_matter_how_the_samples_are_cut(block: int) -> None:
    samples = np.random.default_rng(0).normal(size=6000)
    first, found = decimated(samples, list(range(block, 6000, block)))
    whole_first, whole = decimated(samples)
    assert first == whole_first
    np.testing.assert_allclose(found, whole, atol=1e-5)


def test_after_a_gap_the_index_is_that_of_the_time() -> None:
    samples = tone(300.0, 1.0)[:, None].astype(np.float32)
    decimator = Decimator(FACTOR)
    first, before = decimator.feed(0, samples[:12_000])
    following, after = decimator.feed(15_007, samples[15_007:])
    assert following - (first + len(before)) >= 3007 // FACTOR
    np.testing.assert_allclose(after, samples[FACTOR * following :: FACTOR][: len(after)], atol=2e-3)


@pytest.mark.parametrize(
    ('stamps', 'indices', 'lost', 'damaged'),
    [
        ([10, 11, 15, 16], [0, 1, 5, 6], 3, 0),
        ([10, 11, 12 + 2**40, 13, 14 - 8, 15, 16 + 256, 17], range(8), 0, 3),
        ([65534, 65535, 0, 1, 4, 5], [0, 1, 2, 3, 6, 7], 2, 0),  # of 16 bits
        ([round(i * 0.999) for i in range(10_000)], range(10_000), 0, 0),  # samples a trifle too fast
    ],
    ids=['gap', 'damaged', 'wrapped', 'too fast'],
)
def test_stamps_give_indices_losses_and_damages(
    stamps: list[int | None], indices: Sequence[int], lost: int, damaged: int
) -> None:
    counter = SampleCounter()
    assert counter.place(stamps)[0] == list(indices)
    assert (counter.lost, counter.damaged_stamps) == (lost, damaged)


def test_an_odd_stamp_waits_for_the_next_one_to_explain_it() -> None:
    counter = SampleCounter()
    assert counter.place([10, 13])[0] == [0]
    assert counter.place([13, 14])[0] == [3, 4]


def test_a_device_that_counts_from_zero_again_is_noticed() -> None:
    counter = SampleCounter()
    assert counter.place([1_000_000, 1_000_001, 0, 1]) == ([0, 1], True)
    counter.interrupt()
    counter.skip(498)
    assert counter.place([0, 1])[0] == [500, 501]
    assert counter.lost == 498


@pytest.mark.parametrize(('ticks', 'jitter'), [(1, 0), (1000, 40)])
def test_the_stamps_themselves_show_how_many_ticks_a_sample_takes(ticks: int, jitter: int) -> None:
    noise, counter = np.random.default_rng(0), SampleCounter(ticks=0)
    numbers = [number for number in range(300) if not 100 <= number < 107]
    indices: list[int] = []
    waiting: list[int | None] = []
    for number in numbers:
        waiting.append(70_500 + number * ticks + int(noise.integers(-jitter, jitter + 1)))
        placed, _ = counter.place(waiting)
        indices, waiting = indices + placed, waiting[len(placed) :]
    assert indices == numbers
    assert (counter.lost, counter.damaged_stamps) == (7, 0)
