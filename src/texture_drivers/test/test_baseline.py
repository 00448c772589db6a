# SPDX-License-Identifier: Apache-2.0
"""The level without load: measured, subtracted, and watched."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_core.types import TactileSignal
from texture_drivers.health import Baseline, ChannelWatch, Tare, TareParams, saturated

RATE_HZ, CHANNELS = 100.0, ('a', 'b', 'c', 'd')
NOISE = np.array([1.0, 2.0, 1.0, 4.0])
LEVEL = np.array([100.0, -50.0, 0.0, 9000.0])


class Stream:
    """Batches of ten samples: a level, noise, and what is added to them."""

    def __init__(self, noise: np.ndarray = NOISE) -> None:
        self.rng = np.random.default_rng(0)
        self.sent = 0
        self.noise = noise

    def batch(self, added: np.ndarray | float = 0.0, slope_s: float = 0.0) -> TactileSignal:
        times_s = (self.sent + np.arange(10)) / RATE_HZ
        samples = LEVEL + added + slope_s * times_s[:, None] + self.noise * self.rng.standard_normal((10, 4))
        first, self.sent = self.sent, self.sent + 10
        stamp_ns = 10**18 + round(first / RATE_HZ * 1e9)
        return TactileSignal(stamp_ns, 'x/slow', CHANNELS, ('N',) * 4, RATE_HZ, first, samples.astype(np.float32))

    def seconds(self, seconds: float, **added: float) -> Iterator[TactileSignal]:
        return (self.batch(**added) for _ in range(round(seconds * RATE_HZ / 10)))


def tared(stream: Stream, duration_s: float = 2.0, skip_s: float = 0.0, **added: float) -> Baseline:
    tare = Tare(duration_s, skip_s)
    found = next(found for batch in stream.seconds(duration_s + skip_s + 1.0, **added) if (found := tare.add(batch)))
    assert stream.sent / RATE_HZ == pytest.approx(duration_s + skip_s, abs=0.11)
    return found


def test_a_tare_gives_level_and_noise_of_each_channel() -> None:
    found = tared(Stream(), 20.0)
    np.testing.assert_allclose(found.level, LEVEL, atol=0.5)
    np.testing.assert_allclose(found.noise, NOISE, rtol=0.1)


def test_a_level_that_moves_refuses_the_tare_and_names_the_channels() -> None:
    tare, stream = Tare(2.0), Stream()
    with pytest.raises(InvalidData, match=r"tare of 'x/slow': the level of a, b, c, d moved"):
        for batch in stream.seconds(2.5, slope_s=60.0):
            tare.add(batch)


def test_a_channel_without_a_valid_sample_refuses_the_tare() -> None:
    tare, stream = Tare(1.0), Stream()
    with pytest.raises(InvalidData, match='without any valid one'):
        for batch in stream.seconds(2.0, added=np.array([np.nan, 0.0, 0.0, 0.0])):
            tare.add(batch)


def test_without_its_baseline_a_signal_is_around_0_and_says_so() -> None:
    stream = Stream()
    batch = tared(stream, 10.0).subtract_from(stream.batch())
    assert np.abs(batch.samples / NOISE).max() < 6.0
    assert batch.sensor == 'x/slow (tared)'


def watch(**params: float) -> ChannelWatch:
    return ChannelWatch(TareParams(**params), ['signal'], {'signal': (-200.0, 10_000.0)})


def feed(watched: ChannelWatch, stream: Stream, seconds: int, **added: float) -> list[str]:
    """Feed so many seconds, with a review at the end of each; return the sentences of the last one."""
    faults: list[str] = []
    for _ in range(seconds):
        for batch in stream.seconds(1.0, **added):
            watched.add('signal', batch)
        faults, _ = watched.review(1.0)
    return faults


def test_an_unloaded_sensor_that_stays_where_it_was_tared_has_no_fault() -> None:
    watched, stream = watch(), Stream()
    watched.set_unloaded(True)
    watched.start_tare()
    assert feed(watched, stream, 60) == []
    assert watched.review(1.0)[1]['signal drift [noise]'] < 1.0


def test_a_slow_drift_is_reported_with_its_channel_and_ends_with_the_next_tare() -> None:
    watched, stream = watch(), Stream()
    watched.set_unloaded(True)
    watched.start_tare()
    feed(watched, stream, 3)
    drift = np.array([0.0, 0.0, 40.0, 0.0])
    assert feed(watched, stream, 1, added=drift) == []  # one second may be a touch
    assert feed(watched, stream, 4, added=drift) == ['signal: c has drifted off its baseline; tare again without load']
    watched.start_tare()
    assert feed(watched, stream, 5, added=drift) == []


def test_a_load_is_no_drift() -> None:
    watched, stream = watch(), Stream()
    watched.set_unloaded(True)
    watched.start_tare()
    feed(watched, stream, 3)
    watched.set_unloaded(False)
    assert feed(watched, stream, 10, added=40.0) == []


def test_a_saturated_channel_is_named_and_a_single_hard_touch_is_none() -> None:
    watched, stream = watch(), Stream()
    samples = np.zeros((1000, 2), dtype=np.float32)
    samples[:5, 1] = 10.0
    assert not saturated(samples, np.array(-10.0), np.array(10.0)).any()
    assert feed(watched, stream, 1, added=np.array([0.0, 0.0, 0.0, 2000.0])) == [
        'signal: d is saturated: less force, or another gain'
    ]


def test_a_channel_that_never_changes_while_the_others_do_is_dead() -> None:
    stream = Stream(NOISE * [1, 0, 1, 1])
    watched = watch()
    assert feed(watched, stream, 25) == []
    assert feed(watched, stream, 10) == ['signal: b is dead: it does not change; check its wiring']


def test_an_automatic_tare_is_due_without_load_and_again_after_a_drift() -> None:
    watched, stream = watch(auto_tare=True), Stream()
    assert not watched.needs_tare
    watched.set_unloaded(True)
    assert watched.needs_tare
    watched.start_tare()
    assert not watched.needs_tare
    watched.set_unloaded(False)  # a touch gives it up
    feed(watched, stream, 2)
    watched.set_unloaded(True)
    assert watched.needs_tare
    watched.start_tare()
    feed(watched, stream, 3)
    assert not watched.needs_tare
    feed(watched, stream, 5, added=60.0)
    assert watched.needs_tare


def test_the_baseline_is_subtracted_only_if_wanted_and_known() -> None:
    for subtract in (False, True):
        watched, stream = watch(subtract_baseline=subtract), Stream()
        assert watched.add('signal', stream.batch())[0].sensor == 'x/slow'
        watched.start_tare()
        feed(watched, stream, 3)
        assert watched.add('signal', stream.batch())[0].sensor == ('x/slow (tared)' if subtract else 'x/slow')
