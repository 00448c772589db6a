# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import pytest

from texture_core.types import FeatureVector
from texture_estimation.evidence import EvidenceAccumulator


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
    """Return a function that gives the estimates of a model after each window of a slide, and at its end."""
    return lambda model, values, **more: list(map(EvidenceAccumulator(model).update, slide_of(model, values, **more)))
