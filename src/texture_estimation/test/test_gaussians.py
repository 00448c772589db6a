# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from texture_estimation.gaussians import ClassDistance

CLASSES, SLIDES_OF_ONE, FEATURE_COUNT = 8, 12, 5


def slide_means(centres, rng, slides=SLIDES_OF_ONE):
    """Return means of slides about centres and their classes; the first feature is constant, the second is noise."""
    means = centres[:, None] + 0.3 * rng.normal(size=(len(centres), slides, FEATURE_COUNT))
    means[..., 0] = 7.0
    means[..., 1] = rng.normal(size=means.shape[:-1])
    return means.reshape(-1, FEATURE_COUNT), np.repeat(np.arange(len(centres)), slides)


@pytest.fixture(scope='module')
def distance_of_slides():
    rng = np.random.default_rng(0)
    centres = 3.0 * rng.normal(size=(CLASSES, FEATURE_COUNT))
    means, classes = slide_means(centres, rng)
    return ClassDistance.fit(means, classes), centres, rng


def test_the_distance_is_that_to_the_three_nearest_slides_less_that_to_the_centre(distance_of_slides):
    distance, centres, _ = distance_of_slides
    projected = centres[2] @ distance.projection
    squares = ((distance.references[distance.classes == 2] - projected) ** 2).sum(axis=1)
    squared = (projected - distance.centre) ** 2
    expected = np.sort(squares)[:3].mean() - squared @ distance.weights
    assert distance.score(centres[2], 2) == pytest.approx(expected)


def test_a_class_without_slides_is_infinitely_far_until_slides_are_added(distance_of_slides):
    distance, _, rng = distance_of_slides
    new = np.full((1, FEATURE_COUNT), 15.0)
    assert distance.score(new[0], CLASSES) == np.inf
    means, _ = slide_means(new, rng, 3)
    added = distance.with_slides(means, np.full(3, CLASSES))
    assert added.score(new[0], CLASSES) < min(added.score(new[0], code) for code in range(CLASSES))
