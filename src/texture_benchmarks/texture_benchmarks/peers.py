# SPDX-License-Identifier: Apache-2.0
"""General classifiers of time series, from packages of their own, on the vibration of later recorded slides."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.recipes import DATA, LATER, LENGTH_S, SPLITS, VIBRATION, biotac20_settings
from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult
from texture_core.config import find
from texture_core.errors import InvalidData
from texture_core.types import AnyArray, Array
from texture_estimation.search import single_blas_thread
from texture_evaluation.cross_validation import Split, split_slides
from texture_features.windows import CutWindow, WindowParams, cut_recording
from texture_recordings.dataset import SlideDataset

AT_S = (0.5, 1.0, 2.5, 5.0)
FIRST_COUNTS = 1e-6  # of a vote: of equal counts, the label that was voted for first wins
TIMED = 200
WARM_UP = 10


def windows_of(dataset: SlideDataset) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Return windows that begin LENGTH_S apart (n, n_channels, n_samples), with surface and slide of each, (n,)."""
    params = WindowParams(length_s=LENGTH_S, hop_s=LENGTH_S)
    topic = next(iter(dataset[0].signals))
    samples, labels, slides = zip(
        *(
            (event.windows[topic].samples.T, item.surface, item.name)
            for item in dataset
            for event in cut_recording({topic: item.signals[topic]}, item.states, params)
            if isinstance(event, CutWindow)
        ),
        strict=True,
    )
    return np.stack(samples).astype(np.float32), np.array(labels), np.array(slides)


def try_estimator(dataset: SlideDataset, split: Split, name: str, seed: int) -> dict[str, Any]:
    """Return the figures of a classifier of windows, such as those of aeon, as those of a recipe."""
    samples, labels, slides = windows_of(dataset)
    right, decided, taken = [], [], []
    for training, tested in split_slides(dataset, split.splitter, split.groups):
        start = time.process_time()
        rows, held = (np.isin(slides, dataset.names[own]) for own in (training, tested))
        cls: Any = find({}, name, 'estimator')
        trained = cls(random_state=seed).fit(samples[rows], labels[rows])
        known = np.unique(labels[rows])
        taken.append(time.process_time() - start)

        def vote(windows: AnyArray, trained: Any = trained, known: AnyArray = known) -> AnyArray:
            """Return votes for the sorted labels of the training; 1 for the predicted one of what gives no shares."""
            shares = hasattr(trained, 'predict_proba')
            votes: AnyArray = trained.predict_proba(windows) if shares else trained.predict(windows)[:, None] == known
            return votes

        votes = np.asarray(vote(samples[held]), dtype=np.float64)
        codes = np.searchsorted(known, labels[held])
        right.append(votes.argmax(axis=1) == codes)
        decided += decisions(votes, codes, slides[held])
    shares = [float(np.mean(own)) for own in zip(*decided, strict=False)]
    at_s = {round(LENGTH_S * number, 3): share for number, share in enumerate(shares, 1)}
    taken_us = []
    for window in samples[:TIMED]:
        start = time.process_time()
        vote(window[None])
        taken_us.append(1e6 * (time.process_time() - start))
    median, p99 = np.percentile(taken_us[min(WARM_UP, len(taken_us) - 1) :], (50, 99))
    return {
        'window_accuracy': float(np.mean(np.concatenate(right))),
        'accuracy_at_s': {str(seconds): at_s.get(seconds) for seconds in AT_S},
        'decisions': {'s': [*at_s], 'share': shares},
        'unclassified_windows': 0.0,
        'unclassified_at_s': dict.fromkeys(map(str, AT_S), 0.0),
        'train_s': round(float(np.mean(taken)), 2),
        'latency_us': {'median': float(median), 'p99': float(p99)},
    }


def decisions(votes: Array, codes: AnyArray, slides: AnyArray) -> list[list[bool]]:
    """Return for each slide whether the sum of the votes is right after its first window, its second, and so on."""
    found = []
    for slide in np.unique(slides):
        own = votes[slides == slide]
        weights = 1.0 - FIRST_COUNTS * np.arange(len(own))
        sums = np.cumsum(own * weights[:, None], axis=0)
        found.append((sums.argmax(axis=1) == codes[slides == slide]).tolist())
    return found


PACKAGES = 'TEXTURE_PEERS'  # environment variable: the folder of the packages of the peers
PEERS: Mapping[str, str] = {
    'MiniRocket': 'aeon.classification.convolution_based:MiniRocketClassifier',  # Dempster et al. 2021
    'MultiRocketHydra': 'aeon.classification.convolution_based:MultiRocketHydraClassifier',  # Dempster et al. 2023
    'QUANT': 'aeon.classification.interval_based:QUANTClassifier',  # Dempster et al. 2024
}
NEEDED = ('aeon', 'torch')


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train the peers on slides 1-30 of each surface, and test them on the later ones.

    Share of single windows recognised; share of slides recognised over the sliding time, by the highest mean
    probability, or by the votes of methods that give none; computing time of a training (s); time from window to
    label (µs), by the clock of the processor. Windows of 0.5 s that do not overlap.
    """
    with _packages(), single_blas_thread():
        missing = [name for name in NEEDED if find_spec(name) is None]
        if missing:
            raise InvalidData(f'{" and ".join(missing)} cannot be imported; `make peers` installs and runs all')
        setting = biotac20_settings(options)[VIBRATION]
        [split] = [each for each in setting.splits if each.name == LATER]
        names = ('MiniRocket',) if options.quick else PEERS
        numbers = {name: try_estimator(setting.dataset, split, PEERS[name], options.seed) for name in names}
    return BenchmarkResult(
        name='peers',
        measured=run.__doc__,
        data=f'{DATA["biotac20"]}; PAC at 1 kHz',
        split=f'{LATER}: {SPLITS[LATER]}',
        numbers=numbers,
    )


@contextmanager
def _packages() -> Iterator[None]:
    """Let the packages of the peers be found, behind those of the suite, which stay as they are."""
    before, folder = list(sys.path), os.environ.get(PACKAGES)
    if folder:
        sys.path.append(str(Path(folder)))
    try:
        yield
    finally:
        sys.path[:] = before
