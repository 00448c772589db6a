# SPDX-License-Identifier: Apache-2.0
"""Numbers and times of samples that carry neither."""

from __future__ import annotations

import numpy as np
import pytest

from texture_drivers.timing import ArrivalNumbering, RateMeter

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
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

    def run(self, seconds: float, lost: int = 0, told: int = 0) -> list[int]:
        """Return the difference between index and true number of each block; first so many samples are lost."""
        self.sent += lost
        self.now_s = max(self.now_s, self.sent / RATE_HZ)
        offsets, until_s = [], self.now_s + seconds
        while self.now_s < until_s:
            self.now_s += READ_S + self.rng.exponential(0.001)
            first, self.sent = self.sent, int(self.now_s * RATE_HZ)
            if self.sent == first:
                continue
            arrival_ns = START + round(self.now_s * SECOND)
            indices = self.numbering.place([(told, self.sent - first)], arrival_ns)
            told = 0
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
    assert set(line.run(3.0, lost=4, told=4)) == {0}


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
