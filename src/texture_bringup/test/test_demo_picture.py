# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from texture_bringup.demo import Recorded
from texture_core.types import FeatureVector, Rejection, TextureEstimate
from texture_estimation.recipe import Recipe
from texture_estimation.training import train
from texture_features.examples import LabelledFeatures

pytestmark = pytest.mark.ros

RECIPE = {
    'inputs': {'signal': {'features': ['mean']}},
    'learner': {'sklearn': {'estimator': 'sklearn.naive_bayes:GaussianNB'}},
}


def test_the_log_odds_of_one_window_are_those_of_the_model_and_further_windows_add_to_them() -> None:
    labels = np.repeat(['cork', 'wool'], 20)
    slides = np.char.add(labels, np.tile(np.repeat(['/1', '/2', '/3', '/4'], 5), 2))
    values = (labels == 'wool')[:, None] + 0.3 * np.random.default_rng(0).standard_normal((40, 1))
    model = train(
        Recipe.from_mapping(RECIPE, 'tiny'), LabelledFeatures(values, labels, slides, ('mean',), 'a1', 0.5, 0.5)
    )
    window = np.array([0.9])
    found = Recorded()
    found.windows['e'] += [
        FeatureVector(start_ns, 'e', 0.5, 0.5, ('mean',), window, feature_set='a1') for start_ns in (0, 500_000_000)
    ]
    found.estimates['e'] = TextureEstimate(0, 'e', 'wool', Rejection.NONE, 0.7, (0.3, 0.7))
    seconds, log_odds = found.log_odds('e', model)
    cork, wool = model.predict_log_proba(window[None])[0]
    assert seconds.tolist() == [0.5, 1.0]
    np.testing.assert_allclose(log_odds[0], [wool - cork, 0.0])
    assert log_odds[1, 0] > log_odds[0, 0] > 0
