"""Fit when a slide may end, which textures stay candidates and how fast evidence grows, on held-out slides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from texture_core.arrays import Array
from texture_estimation.classification.evidence_rules import EvidenceRule, deciding_rows, running_means
from texture_estimation.classification.novelty_training import SlideTrace, fit_novelty
from texture_estimation.learners.learner import Codes, Fitted
from texture_estimation.log_probabilities import is_tied, log_loss
from texture_estimation.open_set import prediction_sets, stopping_rule
from texture_estimation.open_set.confidence_floor import ConfidenceFloor, fit_confidence_floor
from texture_estimation.open_set.novelty import NoveltyDetector
from texture_estimation.recipe import Recipe
from texture_features.labelled_features import LabelledFeatures

# Of windows that share a slide when nothing could be held out: between "all the same" (0) and independent (1).
DEFAULT_TEMPERING_EXPONENT = 0.5


@dataclass(frozen=True, eq=False)
class HeldOutSlide:
    """A held-out slide: mean log-evidence and effective window count after each window.

    Examples
    --------
    >>> means = np.log([[0.6, 0.4], [0.8, 0.2]])
    >>> slide = HeldOutSlide(truth=0, means=means, effective_window_counts=np.array([1.0, 1.5]))
    >>> slide.means.argmax(axis=1).tolist()
    [0, 0]
    """

    truth: int
    means: Array
    effective_window_counts: Array

    def posterior(self, rule: EvidenceRule, tempering_exponent: float) -> Array:
        """Return the log-probabilities after each window.

        Returns
        -------
        (n_windows, n_labels)
        """
        return rule.log_posterior(self.means, self.effective_window_counts[:, None], tempering_exponent)


def held_out_slides(
    fitted: Fitted, codes: Codes, groups: Codes, rule: EvidenceRule, overlap: float
) -> Sequence[HeldOutSlide]:
    """Return the slides, as evaluated when they were held out; none if nothing was.

    Parameters
    ----------
    fitted
        What was fitted, with the held-out log-probabilities of the windows.
    codes, groups : (n,)
        Numbers of the labels and of the slides.
    rule
        Combines the windows of a slide.
    overlap
        Time between the starts of two windows over their length, at most 1.

    Returns
    -------
    sequence of HeldOutSlide
    """
    if fitted.held_out is None:
        return []
    window_evidence_rows = rule.window_evidence(fitted.held_out)
    slides = []
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        follow = _follow_group if rule.group else _follow
        slides.append(HeldOutSlide(int(codes[rows[0]]), *follow(rule, window_evidence_rows[rows], overlap)))
    return slides


def _follow(rule: EvidenceRule, evidence: Array, overlap: float) -> tuple[Array, Array]:
    """Return mean log-evidence and effective window count after each window of a slide."""
    effective_window_counts = 1.0 + np.arange(len(evidence), dtype=np.float64) * overlap
    return running_means(rule, evidence, effective_window_counts), effective_window_counts


def _follow_group(rule: EvidenceRule, evidence: Array, overlap: float) -> tuple[Array, Array]:
    """Return the same for a rule by which only some of the windows decide."""
    parts = [deciding_rows(number, rule.group) for number in range(1, len(evidence) + 1)]
    deciding = np.array([len(evidence[part]) for part in parts], dtype=np.float64)
    return np.stack([evidence[part].mean(axis=0) for part in parts]), 1.0 + (deciding - 1.0) * overlap


def fit_tempering_exponent(slides: Sequence[HeldOutSlide], rule: EvidenceRule) -> float:
    """Return the exponent with which evidence grows that makes held-out slides most probable, whenever one looks."""
    if not slides:
        return DEFAULT_TEMPERING_EXPONENT
    mean = np.concatenate([slide.means for slide in slides])
    effective_window_counts = np.concatenate([slide.effective_window_counts for slide in slides])[:, None]
    truth = np.concatenate([np.full(len(slide.effective_window_counts), slide.truth) for slide in slides])

    def loss(tempering_exponent: float) -> float:
        return log_loss(rule.log_posterior(mean, effective_window_counts, tempering_exponent), truth)

    return float(minimize_scalar(loss, bounds=(0.0, 1.0), method='bounded').x)


def fit_open_set(
    recipe: Recipe,
    fitted: Fitted,
    examples: LabelledFeatures,
    slides: Sequence[HeldOutSlide],
    tempering_exponent: float,
) -> tuple[stopping_rule.StoppingRule, NoveltyDetector | None, ConfidenceFloor]:
    """Return when a slide may end, the novelty detector, and the smallest confidence of known surfaces.

    Without a novelty detector, as none is asked for or there are too few slides, there is no smallest confidence.

    Parameters
    ----------
    recipe
        Names the learner, the evidence rule and the rates of error that are allowed.
    fitted
        What was fitted to the examples.
    examples
        Windows of known surfaces.
    slides
        Held-out slides of the same windows.
    tempering_exponent
        How fast evidence grows.

    Returns
    -------
    (StoppingRule, NoveltyDetector or None, ConfidenceFloor)
    """
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
            scores=decisions.novelty_scores,
        )
    if found is None:
        rule = _fit_stopping(slides, recipe.evidence, tempering_exponent, decisions.max_error_rate)
        return rule, None, ConfidenceFloor()
    detector, traces = found
    courses = [_course(trace, detector, recipe.evidence, tempering_exponent) for trace in traces]
    floor = _fit_floor(courses, decisions.low_confidence_rejection_rate)
    courses = [_with_floor(course, floor) for course in courses]
    rule = stopping_rule.fit_open_set_rule(
        courses, decisions.max_error_rate, decisions.max_disturbed_error_rate, decisions.early_novelty_score
    )
    return rule, detector, floor


def _course(
    trace: SlideTrace, detector: NoveltyDetector, rule: EvidenceRule, tempering_exponent: float
) -> stopping_rule.SlideCourse:
    posterior = rule.log_posterior(trace.means, trace.effective_windows[:, None], tempering_exponent)
    steps = list(zip(trace.scores.tolist(), trace.effective_windows.tolist(), strict=True))
    novelty_scores, thresholds = np.array([detector.score_and_threshold(*step) for step in steps]).T
    return stopping_rule.SlideCourse(
        confidences=np.exp(posterior.max(axis=1)),
        right=(posterior.argmax(axis=1) == trace.truth) & ~is_tied(posterior),
        effective_windows=trace.effective_windows,
        known=novelty_scores <= thresholds,
        novelty_scores=novelty_scores,
        disturbance=trace.disturbance,
    )


def _fit_floor(courses: Sequence[stopping_rule.SlideCourse], rate: float) -> ConfidenceFloor:
    """Return the smallest confidence of undisturbed slides that end with the right label, but for this fraction."""
    right = [course for course in courses if course.right[-1] and not course.disturbance]
    return fit_confidence_floor(
        [course.confidences for course in right], [course.effective_windows for course in right], rate
    )


def _with_floor(course: stopping_rule.SlideCourse, floor: ConfidenceFloor) -> stopping_rule.SlideCourse:
    """Return a course that is known only where its confidence reaches the floor, too."""
    steps = zip(course.confidences.tolist(), course.effective_windows.tolist(), strict=True)
    return replace(course, known=course.known & np.array([floor.reached(*step) for step in steps]))


def _fit_stopping(
    slides: Sequence[HeldOutSlide], rule: EvidenceRule, tempering_exponent: float, wrong: float
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


def fit_prediction_sets(
    slides: Sequence[HeldOutSlide], rule: EvidenceRule, tempering_exponent: float, coverage: float
) -> prediction_sets.PredictionSets:
    """Return which textures are candidates.

    Parameters
    ----------
    slides
        Held-out slides.
    rule
        Combines the windows of a slide.
    tempering_exponent
        How fast evidence grows.
    coverage
        Share of slides whose texture is among the candidates.

    Returns
    -------
    PredictionSets
    """
    if not slides:
        return prediction_sets.PredictionSets(coverage)
    posteriors = [slide.posterior(rule, tempering_exponent) for slide in slides]
    return prediction_sets.fit_prediction_sets(
        posteriors, [slide.truth for slide in slides], [slide.effective_window_counts for slide in slides], coverage
    )
