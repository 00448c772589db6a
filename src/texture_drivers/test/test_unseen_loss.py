# SPDX-License-Identifier: Apache-2.0
"""A TSF-85 whose firmware sends no stamps: what was lost is told by the host's clock, and the times stay right."""

import numpy as np
import pytest

from texture_drivers.tsf85 import SIGNAL, FingerStream, SampleFrame

MS = 1_000_000
START = 1_700_000_000_000_000_000
BATCH = 10
CALM_S = 0.6  # after a loss, times are right again within
BOUND_S = 0.012


def follow(seconds, lost, *, drift=0.0, stamped=False, seed=1, late_ms=0.0):
    """Return the finger, and (true time in s, error of the stamp in s) of each sample that came out.

    `lost` tells of each true millisecond whether it is lost; arrivals jitter by up to some ms, as on USB.
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
    assert finger.cutter.lost == pytest.approx(n, abs=10)


def test_one_packet_in_twenty_lost_at_random_stays_within_the_bound():
    lost = np.random.default_rng(3).random(30_000) < 0.05
    _, errors = follow(30.0, lost)
    assert np.abs(errors[errors[:, 0] > 3.0, 1]).max() < BOUND_S + 0.05 * CALM_S


@pytest.mark.parametrize('late_ms', [0.0, 50.0])
def test_a_busy_host_loses_nothing(late_ms):
    finger, errors = follow(10.0, losing(10.0), late_ms=late_ms)
    assert finger.cutter.lost == 0
    assert np.abs(errors[:, 1]).max() < BOUND_S


def test_where_there_are_stamps_they_alone_count():
    finger, errors = follow(10.0, losing(10.0, (5.0, 100)), stamped=True)
    assert finger.cutter.lost == 100
    assert np.abs(errors[errors[:, 0] > 1.0, 1]).max() < 2e-3
