# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""General classifiers on the same slides: a support vector machine on log bands, and some in separate packages."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from texture_core.config import find
from texture_core.types import AnyArray, Array
from texture_estimation.recipe import FAST_TOPIC, Recipe, load_recipe
from texture_features.feature_set import read_recipe
from texture_features.windows import CutWindow, WindowParams, cut_recording
from texture_recordings.slides import LabelledSlide

SVC = 'SVC on log bands'  # the typical spectrum of each window; it has no rejection
PACKAGES = 'TEXTURE_PEERS'  # environment variable: the folder of the packages that `make peers` installs
MINIROCKET, QUANT, CNN = 'MiniRocket', 'QUANT', 'convolutional network'
CLASSIFIERS: Mapping[str, str] = {
    MINIROCKET: 'aeon.classification.convolution_based:MiniRocketClassifier',  # Dempster et al. 2021
    QUANT: 'aeon.classification.interval_based:QUANTClassifier',  # Dempster et al. 2024
    CNN: 'texture_benchmarks.peers:SpectrumNetwork',
}
WINDOWS = WindowParams(length_s=0.5, hop_s=0.5)
FIRST_COUNTS = 1e-6  # of a vote: of equal counts, the label that was voted for first wins


def recipe_of(name: str) -> Recipe:
    """Return a released recipe, or the support vector machine."""
    if name != SVC:
        return load_recipe(name)
    _, content = read_recipe('default')
    inputs = {FAST_TOPIC: {'features': [{'mean_log_bands': {'bands': 32}}]}}
    plain = {
        'inputs': inputs,
        'learner': {'sklearn': {'estimator': 'sklearn.svm:SVC', 'C': 10.0}},
        'evidence': 'soft_vote',
    }
    return Recipe.from_mapping({**content, **plain, 'training': {'hop_s': 0.25}}, name)


def available(*names: str) -> bool:
    """Return whether the packages of these peers, of all if none is named, are there, and make them importable."""
    folder = os.environ.get(PACKAGES)
    if folder and folder not in sys.path:
        sys.path.append(folder)  # behind those of the suite, which stay as they are
    return all(find_spec('torch' if name == CNN else 'aeon') for name in names or CLASSIFIERS)


def classifier(name: str, seed: int) -> Any:
    """Return a peer, to be fitted to windows (n, n_channels, n_samples)."""
    return find({}, CLASSIFIERS[name], 'estimator')(random_state=seed)


def windows_of(slide: LabelledSlide, topics: Sequence[str], windows: WindowParams = WINDOWS) -> AnyArray:
    """Return the windows of a slide, (n, n_channels, n_samples), none of a short one; slow channels keep each value."""
    signals = {topic: slide.signals[topic] for topic in topics}
    found = []
    for event in cut_recording(signals, slide.states, windows):
        if isinstance(event, CutWindow):
            count = len(event.windows[topics[0]].samples)
            parts = [event.windows[topic].samples for topic in topics]
            found.append(np.concatenate([one[np.arange(count) * len(one) // count] for one in parts], axis=1).T)
    return np.array(found, dtype=np.float32)


def right_over_time(votes: Array, code: int) -> list[bool]:
    """Return whether the sum of the votes (n_windows, n_labels) is right after the first window, the second, and on."""
    weights = 1.0 - FIRST_COUNTS * np.arange(len(votes))
    right: list[bool] = (np.cumsum(votes * weights[:, None], axis=0).argmax(axis=1) == code).tolist()
    return right


SEGMENT, FRAMES = 128, 16  # samples of a spectrum, and steps in time of a window
EPOCHS, BATCH, WIDTH = 60, 64, 96
GAIN, NOISE, MASKED = 0.7, 0.3, 12  # of an augmented copy: e-foldings of power, standard deviations, bands left out


class SpectrumNetwork:
    """A small convolutional network over the time of a window: log spectra of the vibration, next to slow channels.

    Each epoch sees other copies: another gain, noise, and a band of the spectrum left out (as Park et al. 2019).
    """

    def __init__(self, random_state: int = 0) -> None:
        self.random_state = random_state

    def fit(self, windows: AnyArray, labels: AnyArray) -> SpectrumNetwork:
        """Learn from windows (n, n_channels, n_samples); the first channel is the vibration."""
        torch: Any = import_module('torch')  # a package of the peers
        nn = torch.nn
        torch.manual_seed(self.random_state)
        self.classes_, codes = np.unique(labels, return_inverse=True)
        spectra = self._spectra(windows)
        self._mean, self._scale = spectra.mean(axis=(0, 2), keepdims=True), spectra.std(axis=(0, 2), keepdims=True)
        self._device = 'cuda' if torch.cuda.is_available() else 'cpu'
        X = torch.from_numpy((spectra - self._mean) / (self._scale + 1e-6)).float().to(self._device)
        y = torch.from_numpy(codes).to(self._device)
        bands, channels = SEGMENT // 2 + 1, X.shape[1]
        self._net = nn.Sequential(
            nn.Conv1d(channels, WIDTH, 3, padding=1), nn.BatchNorm1d(WIDTH), nn.ReLU(),
            nn.Conv1d(WIDTH, WIDTH, 3, padding=1), nn.BatchNorm1d(WIDTH), nn.ReLU(),
            nn.AdaptiveAvgPool1d(1), nn.Flatten(), nn.Dropout(0.3), nn.Linear(WIDTH, len(self.classes_)),
        ).to(self._device)  # fmt: skip
        steps = -(-len(X) // BATCH) * EPOCHS
        optimiser = torch.optim.AdamW(self._net.parameters(), 2e-3, weight_decay=0.01)
        schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 4e-3, total_steps=steps)
        self._net.train()
        gain_of = torch.from_numpy((GAIN / (self._scale + 1e-6)).astype(np.float32)).to(self._device)
        gain_of[:, bands:] = 0.0
        for _ in range(EPOCHS):
            for rows in torch.randperm(len(X), device=self._device).split(BATCH):
                gains = torch.randn(len(rows), 1, 1, device=self._device)
                copies = X[rows] + gain_of * gains + NOISE * torch.randn_like(X[rows])
                first = torch.randint(bands - MASKED, (len(rows), 1, 1), device=self._device)
                number = torch.arange(channels, device=self._device)[None, :, None]
                copies = copies.masked_fill((number >= first) & (number < first + MASKED), 0.0)
                loss = nn.functional.cross_entropy(self._net(copies), y[rows], label_smoothing=0.05)
                optimiser.zero_grad()
                loss.backward()
                optimiser.step()
                schedule.step()
        self._net.eval()
        return self

    def predict_proba(self, windows: AnyArray) -> Array:
        """Return the probability of each label, (n, n_labels)."""
        torch: Any = import_module('torch')
        with torch.no_grad():
            X = torch.from_numpy((self._spectra(windows) - self._mean) / (self._scale + 1e-6)).float()
            found: Array = torch.softmax(self._net(X.to(self._device)), dim=1).cpu().numpy().astype(np.float64)
        return found

    @staticmethod
    def _spectra(windows: AnyArray) -> AnyArray:
        """Return log powers of the first channel and changes of the others, (n, n_bands + n_others, FRAMES)."""
        n, n_channels, n_samples = windows.shape
        starts = np.linspace(0, n_samples - SEGMENT, FRAMES).astype(int)
        cut = windows[:, 0, starts[:, None] + np.arange(SEGMENT)] * np.hanning(SEGMENT)
        power = np.log(np.abs(np.fft.rfft(cut, axis=-1)) ** 2 + 1e-3).transpose(0, 2, 1)
        length = n_samples // FRAMES
        slow = windows[:, 1:, : length * FRAMES].reshape(n, n_channels - 1, FRAMES, length).mean(axis=-1)
        # Levels depend on the mounting: only their changes are kept.
        changes = np.log(np.abs(np.diff(slow, axis=-1, append=slow[..., -1:])) + 0.1)
        return np.concatenate([power, changes], axis=1).astype(np.float32)
