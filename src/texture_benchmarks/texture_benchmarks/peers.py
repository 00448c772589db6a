"""General classifiers of time series, from packages of their own, on the vibration of later recorded slides."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.recipes import DATA, LATER, SPLITS, VIBRATION, biotac20_settings, try_estimator
from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult
from texture_core.errors import InvalidData
from texture_core.types import AnyArray, Array
from texture_estimation.search import single_blas_thread

CHANNELS, KERNELS, STRIDE = (32, 64, 64), (9, 5, 3), 2
EPOCHS, BATCH, RATE = 60, 64, 3e-3


class ConvolutionalNetwork:
    """Train and predict as aeon's classifiers do, on windows (n, n_channels, n_samples)."""

    def __init__(self, random_state: int = 0) -> None:
        self._seed = random_state

    def fit(self, X: AnyArray, y: AnyArray) -> ConvolutionalNetwork:
        """Train on standardised windows with Adam and one cycle of the rate."""
        torch = import_module('torch')
        torch.set_num_threads(1)
        torch.manual_seed(self._seed)
        self._torch = torch
        self._mean, self._scale = float(X.mean()), float(X.std())
        self.classes_, codes = np.unique(y, return_inverse=True)
        inputs, truth = self._inputs(X), torch.from_numpy(codes)
        self._network = _layers(torch, X.shape[1], len(self.classes_))
        adam = torch.optim.Adam(self._network.parameters(), RATE)
        steps = -(-len(X) // BATCH)
        schedule = torch.optim.lr_scheduler.OneCycleLR(adam, RATE, total_steps=EPOCHS * steps)
        for _ in range(EPOCHS):
            for rows in torch.randperm(len(X)).split(BATCH):
                adam.zero_grad()
                torch.nn.functional.cross_entropy(self._network(inputs[rows]), truth[rows]).backward()
                adam.step()
                schedule.step()
        self._network.eval()
        return self

    def predict_proba(self, X: AnyArray) -> Array:
        """Return the probability of each label."""
        with self._torch.inference_mode():
            found: Array = self._network(self._inputs(X)).softmax(dim=1).numpy().astype(np.float64)
        return found

    def predict(self, X: AnyArray) -> AnyArray:
        """Return the most probable label of each window."""
        answers: AnyArray = self.classes_[self.predict_proba(X).argmax(axis=1)]
        return answers

    def _inputs(self, X: AnyArray) -> Any:
        return self._torch.from_numpy(((X - self._mean) / self._scale).astype(np.float32))


def _layers(torch: Any, n_channels: int, n_labels: int) -> Any:
    nn, blocks, before = torch.nn, [], n_channels
    for channels, kernel in zip(CHANNELS, KERNELS, strict=True):
        blocks += [
            nn.Conv1d(before, channels, kernel, stride=STRIDE, padding=kernel // 2),
            nn.BatchNorm1d(channels),
            nn.ReLU(),
        ]
        before = channels
    return nn.Sequential(*blocks, nn.AdaptiveAvgPool1d(1), nn.Flatten(), nn.Linear(before, n_labels))


PACKAGES = 'TEXTURE_PEERS'  # environment variable: the folder of the packages of the peers
PEERS: Mapping[str, str] = {
    'MiniRocket': 'aeon.classification.convolution_based:MiniRocketClassifier',  # Dempster et al. 2021
    'MultiRocketHydra': 'aeon.classification.convolution_based:MultiRocketHydraClassifier',  # Dempster et al. 2023
    'QUANT': 'aeon.classification.interval_based:QUANTClassifier',  # Dempster et al. 2024
    'CNN': 'texture_benchmarks.peers:ConvolutionalNetwork',  # Wang et al. 2017, smaller
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
