# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""General classifiers on the same slides: a support vector machine on log bands, and some in separate packages."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
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
MINIROCKET, QUANT = 'MiniRocket', 'QUANT'
CLASSIFIERS: Mapping[str, str] = {
    MINIROCKET: 'aeon.classification.convolution_based:MiniRocketClassifier',  # Dempster et al. 2021
    QUANT: 'aeon.classification.interval_based:QUANTClassifier',  # Dempster et al. 2024
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


def available() -> bool:
    """Return whether the package of the peers is there, and make it importable."""
    folder = os.environ.get(PACKAGES)
    if folder and folder not in sys.path:
        sys.path.append(folder)  # behind those of the suite, which stay as they are
    return find_spec('aeon') is not None


def classifier(name: str, seed: int) -> Any:
    """Return a peer, to be fitted to windows (n, n_channels, n_samples)."""
    return find({}, CLASSIFIERS[name], 'estimator')(random_state=seed)


def windows_of(slide: LabelledSlide, topics: Sequence[str]) -> AnyArray:
    """Return the windows of a slide, (n, n_channels, n_samples); slow channels keep each value until the next."""
    signals = {topic: slide.signals[topic] for topic in topics}
    found = []
    for event in cut_recording(signals, slide.states, WINDOWS):
        if isinstance(event, CutWindow):
            count = len(event.windows[topics[0]].samples)
            parts = [event.windows[topic].samples for topic in topics]
            found.append(np.concatenate([one[np.arange(count) * len(one) // count] for one in parts], axis=1).T)
    return np.stack(found).astype(np.float32)


def right_over_time(votes: Array, code: int) -> list[bool]:
    """Return whether the sum of the votes (n_windows, n_labels) is right after the first window, the second, and on."""
    weights = 1.0 - FIRST_COUNTS * np.arange(len(votes))
    return (np.cumsum(votes * weights[:, None], axis=0).argmax(axis=1) == code).tolist()
