"""Learn a model from labelled windows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from texture_core.errors import InvalidData
from texture_estimation.classification.decision_fitting import (
    fit_open_set,
    fit_prediction_sets,
    fit_tempering_exponent,
    held_out_slides,
)
from texture_estimation.classification.learner_fitting import fit_learner
from texture_estimation.group_means import group_means
from texture_estimation.incremental.training_examples import TrainingExamples
from texture_estimation.learners.learner import Codes, Fitted, of_examples
from texture_estimation.log_probabilities import is_tied
from texture_estimation.model import TextureModel
from texture_estimation.next_motion.next_touch_model import NextTouchModel
from texture_estimation.open_set.domain import Domain
from texture_estimation.open_set.error_bound import ErrorBound
from texture_estimation.recipe import DecisionParams, Recipe
from texture_features.labelled_features import LabelledFeatures
from texture_features.slide_conditions import SlideConditions


def train(recipe: Recipe, examples: LabelledFeatures, name: str = '') -> TextureModel:
    """Return a model that knows the labels of the examples.

    Probabilities, how fast evidence grows within a slide, when a slide may end and which textures are candidates are
    trained on slides held out of the training in turn. With a single slide of a label, windows of that slide are held
    out instead, and the confidence comes out too high; with a single window nothing is calibrated. The model's card
    says which.

    Parameters
    ----------
    recipe
        Names learner and evidence rule.
    examples
        Cut with `recipe.training_windows`.
    name
        Of the model; that of the recipe if ''.

    Returns
    -------
    TextureModel
        Ready to classify and to be stored.

    Raises
    ------
    InvalidData
        If there are no examples, only one label, or a value that is not finite.
    """
    _check(examples)
    labels, codes = np.unique(examples.labels, return_inverse=True)
    slides, groups = np.unique(examples.groups, return_inverse=True)
    trained = replace(recipe, learner=of_examples(recipe.learner, examples.names, labels.tolist()))
    fitted = fit_learner(trained, examples, codes, groups)
    overlap = min(examples.hop_s / examples.window_s, 1.0)
    slides_held_out = held_out_slides(fitted, codes, groups, recipe.evidence, overlap)
    tempering_exponent = fit_tempering_exponent(slides_held_out, recipe.evidence)
    decisions = recipe.training
    rule, novelty_detector, floor = fit_open_set(trained, fitted, examples, slides_held_out, tempering_exponent)
    return TextureModel(
        name=name or recipe.name,
        labels=tuple(labels.tolist()),
        names=examples.names,
        feature_set=examples.feature_set,
        recipe=recipe,
        parameters=fitted.parameters,
        tempering_exponent=tempering_exponent,
        stopping_rule=rule,
        prediction_sets=fit_prediction_sets(slides_held_out, recipe.evidence, tempering_exponent, decisions.coverage),
        novelty_detector=novelty_detector,
        confidence_floor=floor,
        next_touch_model=_fit_next_touch_model(examples),
        training={
            'windows': len(codes),
            'slides': len(slides),
            'window_s': examples.window_s,
            'hop_s': examples.hop_s,
            'calibration': fitted.note,
            'held_out_window_accuracy': _held_out_accuracy(fitted, codes),
        },
        examples=TrainingExamples.of(examples.values, codes, groups),
        domain=_domain(examples, recipe.training),
        error_bound=ErrorBound(len(slides_held_out), decisions.max_error_rate),
    )


def _check(examples: LabelledFeatures) -> None:
    if not len(examples.labels):
        raise InvalidData('there are no windows for training; record slides of at least two surfaces')
    labels = np.unique(examples.labels)
    if len(labels) < 2:
        raise InvalidData(f"all windows are of '{labels[0]}'; at least two surfaces are needed to distinguish them")
    bad = ~np.isfinite(examples.values).all(axis=0)
    if bad.any():
        name = examples.names[int(bad.argmax())]
        windows = int((~np.isfinite(examples.values)).any(axis=1).sum())
        raise InvalidData(
            f"feature '{name}' and {int(bad.sum()) - 1} others are not finite in {windows} of {len(examples.labels)} "
            'windows; leave these features out of the recipe, or these windows out of the examples'
        )


def _fit_next_touch_model(examples: LabelledFeatures) -> NextTouchModel | None:
    """Return what textures look like under each motion, from the mean features of slides."""
    slides, first, groups = np.unique(examples.groups, return_index=True, return_inverse=True)
    means = group_means(examples.values, groups)
    made = [examples.motions.get(slide) for slide in slides.tolist()]
    return NextTouchModel.of_slides(means, examples.labels[first].tolist(), made)


def _domain(examples: LabelledFeatures, params: DecisionParams) -> Domain:
    """Return the conditions under which the slides were made."""
    slides, first = np.unique(examples.groups, return_index=True)
    conditions = [examples.conditions.get(slide, SlideConditions()) for slide in slides.tolist()]
    return Domain.of_slides(conditions, examples.labels[first].tolist(), params.domain_margins)


def _held_out_accuracy(fitted: Fitted, codes: Codes) -> float | None:
    if fitted.held_out is None:
        return None
    right = (fitted.held_out.argmax(axis=1) == codes) & ~is_tied(fitted.held_out)
    return round(float(right.mean()), 4)
