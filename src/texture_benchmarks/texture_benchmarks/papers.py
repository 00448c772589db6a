# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the recipes of the papers recognise on recordings: on the same track, and at another place of it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from texture_benchmarks.generalisation import Answer, Trial, answers_of, figures, names_of
from texture_benchmarks.study import DATA, QUICK_MATERIALS, BenchmarkOptions, BenchmarkResult, map_forked, recorded
from texture_estimation.recipe import Recipe, load_recipe

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
QUICK = ('ets-linear-svm-vote', 'kaboli-pa')
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

    Fraction of the slides that are right at their end. Intervals of 95 % over material × half.
    """
    # Read the slides, and train and test every recipe at the halves of the track.
    whole = recorded(options, 'biotac20', ('1-12', QUICK_MATERIALS))
    slides = whole.select('1-12' if options.quick else '21-40').in_parts(2)
    earlier, later = ('1-8', '9-12') if options.quick else ('21-30', '31-40')
    numbers: dict[str, dict[str, Any]] = {SAME: {}, PLACE: {}}
    names = QUICK if options.quick else tuple(RECIPES)
    trials = []
    for place, other in (('1/2', '2/2'), ('2/2', '1/2')):
        tested = {('', shift): names_of(slides, later, where) for shift, where in ((SAME, place), (PLACE, other))}
        trials.append(Trial(place, names_of(slides, earlier, place), tested))

    def tried(name: str) -> dict[str, list[Answer]]:
        found: defaultdict[str, list[Answer]] = defaultdict(list)
        for (_, shift, _), answers in answers_of('halves of biotac20', (slides, trials), options.seed, recipe_of, name):
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
    return BenchmarkResult(
        data=f'{DATA["biotac20"]}; PAC at 2.2 kHz and 19 electrodes',
        split=f'one half of the track of slides {earlier} trained, slides {later} tested, and the other way round',
        numbers=numbers,
    )
