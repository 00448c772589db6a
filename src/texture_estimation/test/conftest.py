# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from texture_core.types import FeatureVector
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train
from texture_features.examples import LabelledFeatures

FINGERPRINT = 'abcd1234 signal=1000Hz*1'


def gaussian_examples(*, seed=0, labels=('cork', 'felt', 'wood', 'slate'), slides=4, windows=8, spread=1.0, features=6):
    """Return windows around a centre for each label, with something in common within each slide."""
    rng = np.random.default_rng(seed)
    centres = 2.0 * np.random.default_rng(99).normal(size=(len(labels), features))
    values, names, groups = [], [], []
    for centre, label in zip(centres, labels, strict=True):
        for slide in range(slides):
            common = centre + 0.3 * spread * rng.normal(size=features)
            values.append(common + spread * rng.normal(size=(windows, features)))
            names += [label] * windows
            groups += [f'{label}/{slide}'] * windows
    return LabelledFeatures(
        values=np.concatenate(values),
        labels=np.array(names),
        groups=np.array(groups),
        names=tuple(f'signal/f{number}' for number in range(features)),
        feature_set=FINGERPRINT,
        window_s=0.5,
        hop_s=0.25,
    )


@pytest.fixture(scope='session')
def make_examples():
    return gaussian_examples


@pytest.fixture(scope='session')
def slide_of():
    """Return a function that gives the vectors of a slide of these windows over whatever a model was trained on."""

    def vectors(model, values, identity='e1', hop_s=0.1, **more):
        known = {'feature_set': model.feature_set, **more}
        windows = [
            FeatureVector(round(number * hop_s * 1e9), identity, 0.5, hop_s, model.names, row, **known)
            for number, row in enumerate(values)
        ]
        return [*windows, FeatureVector(10**10, identity, 0.0, hop_s, last=True)]

    return vectors


@pytest.fixture(scope='session')
def estimates_of(slide_of):
    """Return a function that gives what a model says after each window of a slide, and at its end."""
    return lambda model, values, **more: list(map(EvidenceAccumulator(model).update, slide_of(model, values, **more)))


@pytest.fixture(scope='session')
def examples():
    return gaussian_examples()


@pytest.fixture(scope='session')
def model(examples):
    return train(load_recipe('default'), examples)
