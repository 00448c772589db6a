"""Learn a model from labelled windows."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from texture_core.errors import InvalidData
from texture_estimation.evidence_rules import EvidenceRule
from texture_estimation.examples import Examples
from texture_estimation.labelled_features import LabelledFeatures
from texture_estimation.learners.learner import Codes, Fitted
from texture_estimation.log_probabilities import log_loss, undecided
from texture_estimation.model import Model
from texture_estimation.recipe import Recipe

# Of windows that share a slide when nothing could be held out: between "all the same" (0) and independent (1).
DEFAULT_GROWTH = 0.5


def train(recipe: Recipe, examples: LabelledFeatures, name: str = '') -> Model:
    """Return a model that knows the labels of the examples.

    Probabilities, and how fast evidence grows within a slide, are calibrated on slides held out of the training in
    turn. With a single slide of a label, windows of that slide are held out instead, and the confidence comes out too
    high; with a single window nothing is calibrated. The model's card says which.

    Parameters
    ----------
    recipe
        Names learner and evidence rule.
    examples
        Cut with `recipe.training_windows`.
    name
        Of the model; that of the recipe if ''.

    Raises
    ------
    InvalidData
        If there are no examples, only one label, or a value that is not finite.
    """
    _check(examples)
    labels, codes = np.unique(examples.labels, return_inverse=True)
    slides, groups = np.unique(examples.groups, return_inverse=True)
    fitted = recipe.learner.fit(examples.values, codes, groups)
    growth = _fit_growth(fitted, codes, groups, recipe.evidence, examples.hop_s / examples.window_s)
    return Model(
        name=name or recipe.name,
        labels=tuple(labels.tolist()),
        names=examples.names,
        feature_set=examples.feature_set,
        recipe=recipe,
        parts=fitted.parts,
        growth=growth,
        training={
            'windows': len(codes),
            'slides': len(slides),
            'window_s': examples.window_s,
            'hop_s': examples.hop_s,
            'calibration': fitted.note,
            'held_out_window_accuracy': _held_out_accuracy(fitted, codes),
        },
        examples=Examples.of(examples.values, codes, groups),
    )


def _check(examples: LabelledFeatures) -> None:
    if not len(examples.labels):
        raise InvalidData('there are no windows to learn from; record slides of at least two surfaces')
    labels = np.unique(examples.labels)
    if len(labels) < 2:
        raise InvalidData(f"all windows are of '{labels[0]}'; at least two surfaces are needed to tell them apart")
    bad = ~np.isfinite(examples.values).all(axis=0)
    if bad.any():
        name = examples.names[int(bad.argmax())]
        windows = int((~np.isfinite(examples.values)).any(axis=1).sum())
        raise InvalidData(
            f"feature '{name}' and {int(bad.sum()) - 1} others are not finite in {windows} of {len(examples.labels)} "
            'windows; leave these features out of the recipe, or these windows out of the examples'
        )


def _fit_growth(fitted: Fitted, codes: Codes, groups: Codes, rule: EvidenceRule, overlap: float) -> float:
    """Return the exponent with which evidence grows that makes held-out slides most probable, whenever one looks."""
    if fitted.held_out is None:
        return DEFAULT_GROWTH
    voices = rule.voice(fitted.held_out)
    means, worth, truth = [], [], []
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        count = np.arange(1, len(rows) + 1)
        means.append(np.cumsum(voices[rows], axis=0) / count[:, None])
        worth.append(1.0 + (count - 1) * min(overlap, 1.0))
        truth.append(codes[rows])
    mean, windows, true = np.concatenate(means), np.concatenate(worth)[:, None], np.concatenate(truth)

    def loss(growth: float) -> float:
        return log_loss(rule.log_posterior(mean, windows, growth), true)

    return float(minimize_scalar(loss, bounds=(0.0, 1.0), method='bounded').x)


def _held_out_accuracy(fitted: Fitted, codes: Codes) -> float | None:
    if fitted.held_out is None:
        return None
    right = (fitted.held_out.argmax(axis=1) == codes) & ~undecided(fitted.held_out)
    return round(float(right.mean()), 4)
