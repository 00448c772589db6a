"""A one-dimensional convolutional network on raw windows, to compare with; needs torch installed.

Source: Wang, Yan & Oates 2017, "Time series classification from scratch with deep neural networks: a strong baseline":
convolutions of 8, 5 and 3 samples with batch normalisation, the mean over time, softmax. Here it has a quarter of the
channels, and every other sample after each convolution, so that it trains in minutes without an accelerator.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from texture_core.arrays import AnyArray, Array

CHANNELS, KERNELS, STRIDE = (32, 64, 64), (9, 5, 3), 2
EPOCHS, BATCH, RATE = 60, 64, 3e-3


class ConvolutionalNetwork:
    """Train and predict as aeon's classifiers do, on windows (n, n_channels, n_samples).

    Parameters
    ----------
    random_state
        Seed of weights and batches.
    """

    def __init__(self, random_state: int = 0) -> None:
        self._seed = random_state

    def fit(self, X: AnyArray, y: AnyArray) -> ConvolutionalNetwork:
        """Train on standardised windows with Adam and one cycle of the rate.

        Parameters
        ----------
        X : (n, n_channels, n_samples)
            Windows.
        y : (n,)
            Their labels.
        """
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
        """Return the probability of each label.

        Parameters
        ----------
        X : (n, n_channels, n_samples)
            Windows.

        Returns
        -------
        (n, n_labels)
            0 to 1, labels in the order of their names.
        """
        with self._torch.inference_mode():
            found: Array = self._network(self._inputs(X)).softmax(dim=1).numpy().astype(np.float64)
        return found

    def predict(self, X: AnyArray) -> AnyArray:
        """Return the most probable label of each window.

        Parameters
        ----------
        X : (n, n_channels, n_samples)
            Windows.

        Returns
        -------
        (n,)
            Labels.
        """
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
