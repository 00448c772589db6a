# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the recipes of the papers recognise on recordings: on the same track, and at another place of it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_benchmarks.generalisation import Answer, Trial, answers_of, figures, names_of
from texture_benchmarks.study import (
    DATA,
    QUICK_MATERIALS,
    BenchmarkOptions,
    BenchmarkResult,
    fraction_interval,
    map_forked,
    recorded,
)
from texture_core.types import Array
from texture_estimation.learners.learner import of_examples
from texture_estimation.recipe import Recipe, load_recipe
from texture_features.feature_set import LabelledFeatures
from texture_recordings.dataset import SlideDataset

# By the name in the table: a released recipe, with other windows and with another learner; half of a slide is shorter
# than the 3 s of Hu et al.
RECIPES: Mapping[str, tuple[str, Mapping[str, float], Mapping[str, Any]]] = {
    'ets-linear-svm': ('ets-linear-svm', {}, {}),
    'ets-linear-svm-vote': ('ets-linear-svm-vote', {}, {}),
    'jamali-naive-bayes-5': ('jamali-naive-bayes-5', {}, {}),
    'hu-pca-svm, windows of 2 s': ('hu-pca-svm', {'length_s': 2.0}, {}),
    'kaboli-svm': ('kaboli-svm', {}, {}),
    'kaboli-pa': ('kaboli-pa', {}, {}),
    'kaboli-pa, 200 passes': ('kaboli-pa', {}, {'passes': 200}),
    'kaboli-em': ('kaboli-em', {}, {}),
    'default, ours': ('default', {}, {}),
}
# One finger gives 8 numbers; two slides over one material represent the two fingers of the paper.
OF_TWO = ('kaboli-svm', 'kaboli-pa', 'kaboli-pa, 200 passes', 'kaboli-em')
QUICK = ('ets-linear-svm-vote', 'kaboli-pa')
PLACES = ('1/2', '2/2')
EARLIER, LATER = '21-30', '31-40'
SAME, PLACE = 'same track', 'other place'


def recipe_of(name: str) -> Recipe:
    """Return a recipe of the table."""
    released, windows, changed = RECIPES[name]
    recipe = load_recipe(released)
    learner: Any = recipe.learner
    features = recipe.feature_set
    features = replace(features, windows=replace(features.windows, **windows))
    return replace(recipe, feature_set=features, learner=replace(learner, **changed))


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train recipes of the papers on slides over one half of a track, and test other slides over both halves.

    Fraction of the slides that are right at their end, of one finger; of two, where two slides represent two fingers.
    Intervals of 95 % by bootstrap over material × half.
    """
    # Read the slides, and train and test every recipe at the halves of the track.
    whole = recorded(options, 'biotac20', ('1-12', QUICK_MATERIALS))
    slides = whole.select('1-12' if options.quick else '21-40').in_parts(2)
    earlier, later = ('1-8', '9-12') if options.quick else (EARLIER, LATER)
    numbers: dict[str, dict[str, Any]] = {SAME: {}, PLACE: {}}
    names = QUICK if options.quick else tuple(RECIPES)
    trials = []
    for place, other in (PLACES, PLACES[::-1]):
        tested = {('', shift): names_of(slides, later, where) for shift, where in ((SAME, place), (PLACE, other))}
        trials.append(Trial(place, names_of(slides, earlier, place), tested))

    def tried(name: str) -> dict[str, list[Answer]]:
        found: defaultdict[str, list[Answer]] = defaultdict(list)
        for (_, shift, _), answers in answers_of('halves of biotac20', (slides, trials), recipe_of, name):
            found[shift] += answers
        return found

    for name, found in zip(names, map_forked(tried, names), strict=True):
        for shift, answers in found.items():
            ends = figures(answers)
            numbers[shift][name] = {
                'slides': len(answers),
                'right': ends['accuracy'],
                'interval': ends['interval']['accuracy'],
            }
    for name in (one for one in OF_TWO if one in names):
        for shift, right in _of_two(slides, earlier, later, recipe_of(name)).items():
            numbers[shift][f'{name}, two fingers'] = right
    return BenchmarkResult(
        data=f'{DATA["biotac20"]}; PAC at 2.2 kHz and 19 electrodes',
        split=f'one half of the track of slides {earlier} trained, slides {later} tested, and the other way round',
        numbers=numbers,
    )


def _of_two(slides: SlideDataset, earlier: str, later: str, recipe: Recipe) -> Mapping[str, dict[str, Any]]:
    """Return the fraction of right pairs of slides, each pair joined to one vector."""
    right: defaultdict[str, list[tuple[str, bool]]] = defaultdict(list)
    for place, other in (PLACES, PLACES[::-1]):
        trained = slides.take(np.isin(slides.names, names_of(slides, earlier, place)))
        X, labels = _joined(trained.features(recipe.feature_set))
        names, codes = np.unique(labels, return_inverse=True)
        learner = of_examples(recipe.learner, [f'{n}' for n in range(X.shape[1])], names.tolist())
        predictor = learner.predictor(learner.fit(X, codes, np.arange(len(codes))).parameters)
        for shift, half in ((SAME, place), (PLACE, other)):
            others = slides.take(np.isin(slides.names, names_of(slides, later, half)))
            requested, true = _joined(others.features(recipe.feature_set))
            named = names[predictor(requested).argmax(axis=1)]
            right[shift] += [(f'{label} {half}', bool(label == one)) for label, one in zip(true, named, strict=True)]
    return {
        shift: {
            'slides': len(pairs),
            'right': float(np.mean([one for _, one in pairs])),
            'interval': fraction_interval([one for _, one in pairs], [cluster for cluster, _ in pairs]),
        }
        for shift, pairs in right.items()
    }


def _joined(features: LabelledFeatures) -> tuple[Array, NDArray[np.str_]]:
    """Return the first windows of each two following slides over one material side by side."""
    first = np.unique(features.groups, return_index=True)[1]
    rows, labels = [], []
    for label in np.unique(features.labels):
        of_label = [row for row in first if features.labels[row] == label]
        pairs = list(pairwise(of_label))
        rows += [np.concatenate((features.values[one], features.values[other])) for one, other in pairs]
        labels += [label] * len(pairs)
    return np.stack(rows), np.array(labels)
