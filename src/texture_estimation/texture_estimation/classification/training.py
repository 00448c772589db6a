"""Learn a model from labelled windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from texture_core.arrays import Array
from texture_core.errors import InvalidData
from texture_estimation.classification.evidence_rules import EvidenceRule
from texture_estimation.incremental.examples import Examples
from texture_estimation.learners.learner import Codes, Fitted
from texture_estimation.log_probabilities import log_loss, undecided
from texture_estimation.model import Model
from texture_estimation.next_motion.choice import Explorations
from texture_estimation.open_set import prediction_sets, stopping
from texture_estimation.open_set.novelty import Familiarity
from texture_estimation.recipe import Recipe
from texture_features.labelled_features import LabelledFeatures

# Of windows that share a slide when nothing could be held out: between "all the same" (0) and independent (1).
DEFAULT_GROWTH = 0.5
MIN_SLIDES = 2


def train(recipe: Recipe, examples: LabelledFeatures, name: str = '') -> Model:
    """Return a model that knows the labels of the examples.

    Probabilities, how fast evidence grows within a slide, when a slide may end and which textures are candidates are
    learnt from slides held out of the training in turn. With a single slide of a label, windows of that slide are held
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

    Raises
    ------
    InvalidData
        If there are no examples, only one label, or a value that is not finite.
    """
    _check(examples)
    labels, codes = np.unique(examples.labels, return_inverse=True)
    slides, groups = np.unique(examples.groups, return_inverse=True)
    fitted = _fit(recipe, examples, codes, groups)
    overlap = min(examples.hop_s / examples.window_s, 1.0)
    slides_held_out = _held_out_slides(fitted, codes, groups, recipe.evidence, overlap)
    growth = _fit_growth(slides_held_out, recipe.evidence)
    strictness = recipe.training
    return Model(
        name=name or recipe.name,
        labels=tuple(labels.tolist()),
        names=examples.names,
        feature_set=examples.feature_set,
        recipe=recipe,
        parts=fitted.parts,
        growth=growth,
        stopping=_fit_stopping(slides_held_out, recipe.evidence, growth, strictness.wrong_stops),
        sets=_fit_sets(slides_held_out, recipe.evidence, growth, strictness.coverage),
        familiarity=Familiarity.learnt(examples.values, codes, groups, overlap, strictness.false_rejections)
        if strictness.false_rejections
        else None,
        explorations=_fit_explorations(examples),
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


def _fit(recipe: Recipe, examples: LabelledFeatures, codes: Codes, groups: Codes) -> Fitted:
    """Let the learner learn, the windows that begin within the length of one counting more often.

    Not where a label has a single slide: its windows are held out one by one, and must not be there twice.
    """
    if min(len(np.unique(groups[codes == code])) for code in np.unique(codes)) < MIN_SLIDES:
        return recipe.learner.fit(examples.values, codes, groups)
    starting = max(1, round(examples.window_s / examples.hop_s))
    times = np.ones(len(codes), dtype=np.intp)
    for group in np.unique(groups):
        times[np.flatnonzero(groups == group)[:starting]] = recipe.training.start_weight
    rows = np.repeat(np.arange(len(codes)), times)
    fitted = recipe.learner.fit(examples.values[rows], codes[rows], groups[rows])
    if fitted.held_out is None:
        return fitted
    return replace(fitted, held_out=fitted.held_out[np.cumsum(times) - times])


@dataclass(frozen=True, eq=False)
class _HeldOut:
    """One slide as a learner that has not seen it judges it: mean voice and worth after each window."""

    truth: int
    means: Array
    worths: Array

    def posterior(self, rule: EvidenceRule, growth: float) -> Array:
        """Return the log-probabilities after each window, (n_windows, n_labels)."""
        return rule.log_posterior(self.means, self.worths[:, None], growth)


def _held_out_slides(
    fitted: Fitted, codes: Codes, groups: Codes, rule: EvidenceRule, overlap: float
) -> Sequence[_HeldOut]:
    """Return the slides, as judged when they were held out; none if nothing was."""
    if fitted.held_out is None:
        return []
    voices = rule.voice(fitted.held_out)
    slides = []
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        count = np.arange(1, len(rows) + 1)
        means = np.cumsum(voices[rows], axis=0) / count[:, None]
        worths = np.asarray(1.0 + (count - 1) * overlap, dtype=np.float64)
        slides.append(_HeldOut(int(codes[rows[0]]), means, worths))
    return slides


def _fit_growth(slides: Sequence[_HeldOut], rule: EvidenceRule) -> float:
    """Return the exponent with which evidence grows that makes held-out slides most probable, whenever one looks."""
    if not slides:
        return DEFAULT_GROWTH
    mean = np.concatenate([slide.means for slide in slides])
    worths = np.concatenate([slide.worths for slide in slides])[:, None]
    truth = np.concatenate([np.full(len(slide.worths), slide.truth) for slide in slides])

    def loss(growth: float) -> float:
        return log_loss(rule.log_posterior(mean, worths, growth), truth)

    return float(minimize_scalar(loss, bounds=(0.0, 1.0), method='bounded').x)


def _fit_stopping(slides: Sequence[_HeldOut], rule: EvidenceRule, growth: float, wrong: float) -> stopping.Stopping:
    """Return when a slide may end."""
    if not slides:
        return stopping.Stopping()
    posteriors = [slide.posterior(rule, growth) for slide in slides]
    right: list[NDArray[np.bool_]] = [
        (posterior.argmax(axis=1) == slide.truth) & ~undecided(posterior)
        for slide, posterior in zip(slides, posteriors, strict=True)
    ]
    confidences = [np.exp(posterior.max(axis=1)) for posterior in posteriors]
    return stopping.learnt(confidences, right, [slide.worths for slide in slides], wrong)


def _fit_sets(
    slides: Sequence[_HeldOut], rule: EvidenceRule, growth: float, coverage: float
) -> prediction_sets.PredictionSets:
    """Return which textures are candidates."""
    if not slides:
        return prediction_sets.PredictionSets(coverage)
    posteriors = [slide.posterior(rule, growth) for slide in slides]
    return prediction_sets.learnt(
        posteriors, [slide.truth for slide in slides], [slide.worths for slide in slides], coverage
    )


def _fit_explorations(examples: LabelledFeatures) -> Explorations | None:
    """Return what textures feel like under each motion, from the mean features of slides."""
    slides, first, groups = np.unique(examples.groups, return_index=True, return_inverse=True)
    means = np.zeros((len(slides), examples.values.shape[1]))
    np.add.at(means, groups, examples.values)
    means /= np.bincount(groups)[:, None]
    made = [examples.motions.get(slide) for slide in slides.tolist()]
    return Explorations.of_slides(means, examples.labels[first].tolist(), made)


def _held_out_accuracy(fitted: Fitted, codes: Codes) -> float | None:
    if fitted.held_out is None:
        return None
    right = (fitted.held_out.argmax(axis=1) == codes) & ~undecided(fitted.held_out)
    return round(float(right.mean()), 4)
