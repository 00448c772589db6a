"""Fit the learner of a recipe to labelled windows, with what else the recipe trains it on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_estimation.group_means import group_means
from texture_estimation.learners.augmented_examples import AugmentedExamples
from texture_estimation.learners.learner import Codes, Fitted, extras_of
from texture_estimation.recipe import Recipe
from texture_features.labelled_features import LabelledFeatures

MIN_SLIDES = 2


def fit_learner(recipe: Recipe, examples: LabelledFeatures, codes: Codes, groups: Codes) -> Fitted:
    """Fit the learner; windows that begin within the length of the first one of their slide count more often.

    Where a label has a single slide, its windows are held out one by one and must not be there twice: then every window
    counts once, and nothing is drawn besides.

    Parameters
    ----------
    recipe
        Its learner fits the examples.
    examples
        Windows; those of other lengths train the learner, too, and are not held out.
    codes, groups : (n,)
        Numbers of the labels and of the slides.

    Returns
    -------
    Fitted
        With one row of held-out log-probabilities for each window.
    """
    if min(len(np.unique(groups[codes == code])) for code in np.unique(codes)) < MIN_SLIDES:
        return recipe.learner.fit(examples.values, codes, groups)
    times = _times(groups, examples, recipe.training.start_weight)
    rows = np.repeat(np.arange(len(codes)), times)
    extras = {name: EXTRAS[name](recipe, examples, codes, groups) for name in extras_of(recipe.learner)}
    fit: Callable[..., Fitted] = recipe.learner.fit  # which takes the extras that the learner declares
    fitted = fit(*_with_resized(examples, codes, groups, rows), **extras)
    if fitted.held_out is None:
        return fitted
    return replace(fitted, held_out=fitted.held_out[np.cumsum(times) - times])


def _with_resized(examples: LabelledFeatures, codes: Codes, groups: Codes, rows: Codes) -> tuple[Array, Codes, Codes]:
    """Return features, labels and slides of these windows, and behind them those of the windows of other lengths."""
    taken = examples.values[rows], codes[rows], groups[rows]
    if examples.resized is None:
        return taken
    names, first = np.unique(examples.groups, return_index=True)
    own = np.isin(examples.resized.groups, names)
    slides = np.searchsorted(names, examples.resized.groups[own])
    further = examples.resized.values[own], codes[first][slides], slides
    return (
        np.concatenate([taken[0], further[0]]),
        np.concatenate([taken[1], further[1]]),
        np.concatenate([taken[2], further[2]]),
    )


def _touch_differences(_recipe: Recipe, examples: LabelledFeatures, _codes: Codes, groups: Codes) -> Array | None:
    """Return by number of the slide how it differs from its touch before the finger moved; NaN where there is none."""
    if not examples.touches:
        return None
    means = group_means(examples.values, groups)
    unknown = np.full(means.shape[1], np.nan)
    touches = [examples.touches.get(slide, unknown) for slide in np.unique(examples.groups).tolist()]
    differences: Array = means - np.stack(touches)
    return differences


def _times(runs: Codes, examples: LabelledFeatures, start_weight: int) -> Codes:
    """Return how often each window counts, (n,): more often those that begin within the length of the first one.

    `runs` are the numbers of the slides or copies to which the windows belong, (n,).
    """
    starting = max(1, round(examples.window_s / examples.hop_s))
    times = np.ones(len(runs), dtype=np.intp)
    for run in np.unique(runs):
        times[np.flatnonzero(runs == run)[:starting]] = start_weight
    return times


def _augmented_examples(
    recipe: Recipe, examples: LabelledFeatures, codes: Codes, groups: Codes
) -> AugmentedExamples | None:
    """Return what the learner draws besides the examples; None without augmentation or without copies of the slides."""
    if examples.augmented is None or not recipe.augmentation.copies:
        return None
    copies = examples.augmented.copies
    names, first = np.unique(examples.groups, return_index=True)
    own = np.isin(copies.groups, names)
    copied = np.searchsorted(names, copies.groups[own])
    runs = np.unique(np.stack([copied, copies.copies[own]]), axis=1, return_inverse=True)[1].reshape(-1)
    means = group_means(examples.values, groups)
    classes = codes[first]
    centres = np.stack([means[classes == code].mean(axis=0) for code in range(int(codes.max()) + 1)])
    return AugmentedExamples(
        values=copies.values if own.all() else copies.values[own],  # a copy of all takes as much memory again
        codes=classes[copied],
        groups=copied,
        rows=np.repeat(np.arange(len(copied)), _times(runs, examples, recipe.training.start_weight)),
        gain_response=examples.augmented.gain_response,
        slide_deviations=means - centres[classes],
        slides=np.arange(len(names)),
        augmentation=recipe.augmentation,
    )


# What learners may declare as their `extras`: keyword arguments of `fit` besides the examples.
EXTRAS: Mapping[str, Callable[[Recipe, LabelledFeatures, Codes, Codes], Any]] = {
    'augmented': _augmented_examples,
    'differences': _touch_differences,
}
