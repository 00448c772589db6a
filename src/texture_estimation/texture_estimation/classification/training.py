"""Learn a model from labelled windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from texture_core.arrays import Array
from texture_core.errors import InvalidData
from texture_estimation.classification.evidence_rules import EvidenceRule, deciding_rows, running_means
from texture_estimation.classification.learner_fitting import fit_learner
from texture_estimation.classification.novelty_training import SlideTrace, fit_novelty
from texture_estimation.group_means import group_means
from texture_estimation.incremental.training_examples import TrainingExamples
from texture_estimation.learners.learner import Codes, Fitted, of_examples
from texture_estimation.log_probabilities import is_tied, log_loss
from texture_estimation.model import TextureModel
from texture_estimation.next_motion.next_touch_model import NextTouchModel
from texture_estimation.open_set import prediction_sets, stopping_rule
from texture_estimation.open_set.domain import Domain
from texture_estimation.open_set.novelty import NoveltyDetector
from texture_estimation.recipe import DecisionParams, Recipe
from texture_features.labelled_features import LabelledFeatures
from texture_features.slide_conditions import SlideConditions

# Of windows that share a slide when nothing could be held out: between "all the same" (0) and independent (1).
DEFAULT_TEMPERING_EXPONENT = 0.5


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
    slides_held_out = _held_out_slides(fitted, codes, groups, recipe.evidence, overlap)
    tempering_exponent = _fit_tempering_exponent(slides_held_out, recipe.evidence)
    decisions = recipe.training
    rule, novelty_detector = _fit_open_set(trained, fitted, examples, slides_held_out, tempering_exponent)
    return TextureModel(
        name=name or recipe.name,
        labels=tuple(labels.tolist()),
        names=examples.names,
        feature_set=examples.feature_set,
        recipe=recipe,
        parameters=fitted.parameters,
        tempering_exponent=tempering_exponent,
        stopping_rule=rule,
        prediction_sets=_fit_prediction_sets(slides_held_out, recipe.evidence, tempering_exponent, decisions.coverage),
        novelty_detector=novelty_detector,
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


@dataclass(frozen=True, eq=False)
class _HeldOut:
    """A held-out slide: mean log-evidence and effective window count after each window."""

    truth: int
    means: Array
    effective_window_counts: Array

    def posterior(self, rule: EvidenceRule, tempering_exponent: float) -> Array:
        """Return the log-probabilities after each window, (n_windows, n_labels)."""
        return rule.log_posterior(self.means, self.effective_window_counts[:, None], tempering_exponent)


def _held_out_slides(
    fitted: Fitted, codes: Codes, groups: Codes, rule: EvidenceRule, overlap: float
) -> Sequence[_HeldOut]:
    """Return the slides, as evaluated when they were held out; none if nothing was."""
    if fitted.held_out is None:
        return []
    window_evidence_rows = rule.window_evidence(fitted.held_out)
    slides = []
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        count = np.arange(1, len(rows) + 1)
        if rule.group:
            parts = [rows[deciding_rows(int(number), rule.group)] for number in count]
            means = np.stack([window_evidence_rows[part].mean(axis=0) for part in parts])
            deciding = np.array([len(part) for part in parts], dtype=np.float64)
            effective_window_counts = 1.0 + (deciding - 1.0) * overlap
        else:
            effective_window_counts = 1.0 + (count.astype(np.float64) - 1.0) * overlap
            means = running_means(rule, window_evidence_rows[rows], effective_window_counts)
        slides.append(_HeldOut(int(codes[rows[0]]), means, effective_window_counts))
    return slides


def _fit_tempering_exponent(slides: Sequence[_HeldOut], rule: EvidenceRule) -> float:
    """Return the exponent with which evidence grows that makes held-out slides most probable, whenever one looks."""
    if not slides:
        return DEFAULT_TEMPERING_EXPONENT
    mean = np.concatenate([slide.means for slide in slides])
    effective_window_counts = np.concatenate([slide.effective_window_counts for slide in slides])[:, None]
    truth = np.concatenate([np.full(len(slide.effective_window_counts), slide.truth) for slide in slides])

    def loss(tempering_exponent: float) -> float:
        return log_loss(rule.log_posterior(mean, effective_window_counts, tempering_exponent), truth)

    return float(minimize_scalar(loss, bounds=(0.0, 1.0), method='bounded').x)


def _fit_open_set(
    recipe: Recipe,
    fitted: Fitted,
    examples: LabelledFeatures,
    slides: Sequence[_HeldOut],
    tempering_exponent: float,
) -> tuple[stopping_rule.StoppingRule, NoveltyDetector | None]:
    """Return when a slide may end, and the novelty detector; None if none is asked for or there are too few slides."""
    decisions = recipe.training
    found = None
    if decisions.false_rejection_rate:
        found = fit_novelty(
            recipe.learner,
            fitted,
            examples,
            recipe.evidence,
            decisions.false_rejection_rate,
            gain_range=recipe.augmentation.gain_range,
        )
    if found is None:
        return _fit_stopping(slides, recipe.evidence, tempering_exponent, decisions.max_error_rate), None
    detector, traces = found
    courses = [_course(trace, detector, recipe.evidence, tempering_exponent) for trace in traces]
    rule = stopping_rule.fit_open_set_rule(
        courses, decisions.max_error_rate, decisions.max_disturbed_error_rate, decisions.early_novelty_score
    )
    return rule, detector


def _course(
    trace: SlideTrace, detector: NoveltyDetector, rule: EvidenceRule, tempering_exponent: float
) -> stopping_rule.SlideCourse:
    posterior = rule.log_posterior(trace.means, trace.effective_windows[:, None], tempering_exponent)
    steps = list(zip(trace.scores.tolist(), trace.effective_windows.tolist(), strict=True))
    novelty_scores = np.array([detector.novelty_score(scores, windows) for scores, windows in steps])
    thresholds = np.array([detector.threshold(windows) for _, windows in steps])
    return stopping_rule.SlideCourse(
        confidences=np.exp(posterior.max(axis=1)),
        right=(posterior.argmax(axis=1) == trace.truth) & ~is_tied(posterior),
        effective_windows=trace.effective_windows,
        known=novelty_scores <= thresholds,
        novelty_scores=novelty_scores,
        disturbance=trace.disturbance,
    )


def _fit_stopping(
    slides: Sequence[_HeldOut], rule: EvidenceRule, tempering_exponent: float, wrong: float
) -> stopping_rule.StoppingRule:
    """Return when a slide may end."""
    if not slides:
        return stopping_rule.StoppingRule()
    posteriors = [slide.posterior(rule, tempering_exponent) for slide in slides]
    right: list[NDArray[np.bool_]] = [
        (posterior.argmax(axis=1) == slide.truth) & ~is_tied(posterior)
        for slide, posterior in zip(slides, posteriors, strict=True)
    ]
    confidences = [np.exp(posterior.max(axis=1)) for posterior in posteriors]
    return stopping_rule.fit_stopping_rule(
        confidences, right, [slide.effective_window_counts for slide in slides], wrong
    )


def _fit_prediction_sets(
    slides: Sequence[_HeldOut], rule: EvidenceRule, tempering_exponent: float, coverage: float
) -> prediction_sets.PredictionSets:
    """Return which textures are candidates."""
    if not slides:
        return prediction_sets.PredictionSets(coverage)
    posteriors = [slide.posterior(rule, tempering_exponent) for slide in slides]
    return prediction_sets.fit_prediction_sets(
        posteriors, [slide.truth for slide in slides], [slide.effective_window_counts for slide in slides], coverage
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
