# SPDX-License-Identifier: Apache-2.0
"""Lowering a rate: what passes, what is kept out, and where a sample stands."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from texture_drivers.timing import HALF_WIDTH, Decimator

RATE_HZ, FACTOR = 48_000.0, 12  # to 4000 Hz


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
    return np.sin(2 * np.pi * frequency_hz * np.arange(round(seconds * RATE_HZ)) / RATE_HZ)


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
