"""What each feature costs: one window at a time, as on the robot, and many at once, as in training."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_evaluation.charts import COLOURS, chart
from texture_features.catalogue import FEATURES
from texture_features.feature import Feature, WindowBatch

RATE_HZ, SAMPLES = 1000.0, 500
SLOW_HZ, SLOW_SAMPLES, TAXELS = 60.0, 30, 28
BATCH, QUICK_BATCH = 500, 20
ROUNDS, QUICK_ROUNDS = 11, 2  # the fastest round counts, as other work on the machine only adds
ALONE, QUICK_ALONE = 200, 5  # calls a round
SHORT_S = 1e-6  # a time below this is that of the clock itself


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Time every feature of the catalogue with its default parameters."""
    rng = np.random.default_rng(options.seed)
    batch, alone, rounds = (QUICK_BATCH, QUICK_ALONE, QUICK_ROUNDS) if options.quick else (BATCH, ALONE, ROUNDS)
    costs = {name: _cost(kind(), rng, batch, alone, rounds) for name, kind in FEATURES.items()}
    return BenchmarkResult(
        name='features',
        measured=f'µs per window, fastest of {rounds} rounds: one window a call, and {batch} windows a call',
        data=f'noise: windows of {SAMPLES} samples of one channel at {RATE_HZ:g} Hz; for `correlation` joined with '
        f'{SLOW_SAMPLES} samples of {TAXELS} taxels',
        split='none: nothing is trained',
        numbers={name: {'alone_us': alone_us, 'batch_us': batch_us} for name, (alone_us, batch_us) in costs.items()},
        charts=(_chart(costs, options.out / 'features.png'),),
    )


def _cost(feature: Feature, rng: np.random.Generator, batch: int, alone: int, rounds: int) -> tuple[float, float]:
    """Return the µs per window alone and in a batch."""
    fast, slow = rng.normal(size=(batch, SAMPLES, 1)), rng.normal(size=(batch, SLOW_SAMPLES, TAXELS))

    def windows(which: int | slice) -> WindowBatch:
        some = fast[which]
        motion = np.full(some.shape[:-2], 0.1), np.full(some.shape[:-2], 2.0)
        return WindowBatch(some, RATE_HZ, *motion, joined=(WindowBatch(slow[which], SLOW_HZ),))

    feature(windows(0))  # tables that are made once
    one = _fastest_s(lambda: [feature(windows(k % batch)) for k in range(alone)], rounds) / alone
    bare = _fastest_s(lambda: [windows(k % batch) for k in range(alone)], rounds) / alone
    many = _fastest_s(lambda: feature(windows(slice(None))), rounds) / batch
    return round(1e6 * max(one - bare, SHORT_S / 10), 2), round(1e6 * max(many, SHORT_S / 100), 3)


def _fastest_s(act: Callable[[], object], rounds: int) -> float:
    times = []
    for _ in range(rounds):
        began = time.perf_counter()
        act()
        times.append(time.perf_counter() - began)
    return min(times)


def _chart(costs: Mapping[str, tuple[float, float]], path: Path) -> Path:
    names = sorted(costs, key=lambda name: costs[name][0])
    rows = np.arange(len(names))
    with chart(path, (7.0, 0.8 + 0.22 * len(names))) as figure:
        axes = figure.subplots()
        axes.plot([costs[name][0] for name in names], rows, 'o', color=COLOURS[0], label='one window a call')
        axes.plot([costs[name][1] for name in names], rows, 's', color=COLOURS[1], label='many windows a call')
        axes.set(xscale='log', xlabel='time per window (µs, one core)', yticks=rows, yticklabels=names)
        axes.set_title(f'Computing time of each feature: windows of {SAMPLES} samples, one channel')
        axes.legend(loc='lower right')
    return path
