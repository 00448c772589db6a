"""Fit novelty detection on slides held out of the training, and follow these slides window by window."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_estimation.classification.evidence_rules import EvidenceRule, running_means
from texture_estimation.learners.folds import assign_folds
from texture_estimation.learners.learner import Codes, Fitted, Learner, Predictor, hidden_layer
from texture_estimation.open_set.class_distance import ClassDistance
from texture_estimation.open_set.novelty import (
    EFFECTIVE_WINDOWS,
    HIDDEN,
    SCORES,
    NoveltyDetector,
    SlideNovelty,
    space_means,
)
from texture_features.augmentation.augmented_features import NOISE
from texture_features.augmentation.feature_copies import FeatureCopies
from texture_features.features import slide_onset
from texture_features.labelled_features import LabelledFeatures

MIN_SLIDES = 3  # of a class: with one held out, two tell how much slides differ
MIN_ALL_SLIDES = 20
FOLDS = 5
# Of the copies of each slide, so many are among the slides to which the distance is measured, at random gains, if they
# have no noise: what is tolerated as noise would let strong noise pass. Chosen on slides 21-30, trained on 1-20.
REFERENCE_COPIES = 6


@dataclass(frozen=True, eq=False)
class SlideTrace:
    """One held-out slide, or a disturbed copy of it, as a classifier that has not seen it follows it.

    Parameters
    ----------
    truth
        Number of its label.
    means : (n_windows, n_labels)
        Mean evidence after each window.
    effective_windows : (n_windows,)
        Length of the evidence.
    scores : (n_windows, n_scores)
        Of its novelty; (n_windows, 0) where none were computed.
    disturbance
        Kind of the disturbance; '' for none.

    Examples
    --------
    >>> trace = SlideTrace(0, np.log([[0.7, 0.3], [0.8, 0.2]]), np.array([1.0, 1.2]), np.zeros((2, 0)))
    >>> bool((trace.means.argmax(axis=1) == trace.truth).all())
    True
    """

    truth: int
    means: Array
    effective_windows: Array
    scores: Array
    disturbance: str = ''


@dataclass(frozen=True, eq=False)
class _Slide:
    """A slide or a copy of one, whose windows are rows of examples; only as numbers of double precision when asked for.

    Parameters
    ----------
    group, truth
        Number of the slide, and of its label.
    examples : (n, n_features)
        Of all slides.
    rows
        Those of this slide.
    shift : (n_features,) or a number
        Added to the features.
    disturbance
        Kind of the disturbance; '' for none.
    """

    group: int
    truth: int
    examples: AnyArray
    rows: slice | Codes
    shift: Array | float = 0.0
    disturbance: str = ''

    @property
    def values(self) -> Array:
        """Features of the windows, (n_windows, n_features)."""
        values: Array = self.examples[self.rows].astype(np.float64)
        values += self.shift
        return values


def fit_novelty(
    learner: Learner,
    fitted: Fitted,
    examples: LabelledFeatures,
    rule: EvidenceRule,
    false_rejection_rate: float,
    *,
    gain_range: float = 1.0,
    scores: Collection[str] = SCORES,
) -> tuple[NoveltyDetector, Sequence[SlideTrace]] | None:
    """Return the detector, and the held-out slides and disturbed copies by which it was fitted.

    Returns None if there are too few slides: MIN_SLIDES of each class are needed, and in all MIN_ALL_SLIDES or one over
    the rate of false rejections.

    Parameters
    ----------
    learner
        Learner of the recipe.
    fitted
        What was fitted to the examples.
    examples
        Windows of known surfaces.
    rule
        Combines the windows of a slide.
    false_rejection_rate
        Fraction of slides over known surfaces that may be rejected, above 0.
    gain_range
        Largest factor by which copies of the slides are amplified or attenuated.
    scores
        Names of the scores that count, of SCORES.

    Returns
    -------
    (NoveltyDetector, sequence of SlideTrace), or None
    """
    classes = np.unique(examples.labels, return_inverse=True)[1]
    names, first, groups = np.unique(examples.groups, return_index=True, return_inverse=True)
    counts = np.bincount(classes[first])
    enough = len(names) >= MIN_ALL_SLIDES or (len(names) + 1) * false_rejection_rate >= 1.0
    if fitted.held_out is None or len(counts) < 2 or counts.min() < MIN_SLIDES or not enough:
        return None
    overlap = min(examples.hop_s / examples.window_s, 1.0)
    slides = [
        _Slide(number, int(classes[first[number]]), examples.values, np.flatnonzero(groups == number))
        for number in range(len(names))
    ]
    disturbed = _disturbed_slides(examples, names, classes[first])
    copies = _reference_copies(examples, names, classes[first], gain_range)
    compared = np.array([name.rsplit('/', 1)[-1] != slide_onset.NAME for name in examples.names], dtype=np.float64)
    traces: list[SlideTrace] = []
    for held_out, predictor in _folds(learner, fitted, classes, groups):
        distances = _fit_distances(
            [slide for slide in slides if slide.group not in held_out],
            [copy for copy in copies if copy.group not in held_out],
            predictor,
            overlap,
            compared=compared,
            scores=scores,
        )
        for slide in (slide for slide in (*slides, *disturbed) if slide.group in held_out):
            values = slide.values
            if predictor is not None:
                log_probabilities = predictor(values)
            elif not slide.disturbance:
                log_probabilities = fitted.held_out[groups == slide.group]
            else:
                continue
            evidence = rule.window_evidence(log_probabilities)
            effective_windows = 1.0 + np.arange(len(evidence), dtype=np.float64) * overlap
            means = running_means(rule, evidence, effective_windows)
            followed = SlideTrace(slide.truth, means, effective_windows, np.zeros((0, 0)), slide.disturbance)
            traces.append(_with_scores(followed, values, evidence, predictor, distances))
    final = learner.predictor(fitted.parameters)
    layered = final if hidden_layer(final) else None
    distances = _fit_distances(slides, copies, layered, overlap, compared=compared, scores=scores)
    held_out_scores = [_scores_at(traces, level) for level in EFFECTIVE_WINDOWS]
    if min(map(len, held_out_scores)) < MIN_SLIDES:
        return None
    return NoveltyDetector.fit(distances, held_out_scores, false_rejection_rate, scores), traces


def _folds(
    learner: Learner, fitted: Fitted, classes: Codes, groups: Codes
) -> Iterator[tuple[frozenset[int], Predictor | None]]:
    """Yield the slides that are held out together, and what was fitted without them, if the learner keeps it."""
    if fitted.folds:
        for fold in fitted.folds:
            yield frozenset(fold.held_out.tolist()), learner.predictor(fold.parameters)
        return
    split = assign_folds(classes, groups, FOLDS)
    parts = split[0] if split else np.zeros(len(groups), np.intp)
    for part in np.unique(parts):
        yield frozenset(groups[parts == part].tolist()), None


def _disturbed_slides(examples: LabelledFeatures, names: Any, classes: Codes) -> list[_Slide]:
    return list(_copied_slides(examples.augmented.disturbed, names, classes)) if examples.augmented else []


def _reference_copies(examples: LabelledFeatures, names: Any, classes: Codes, gain_range: float) -> list[_Slide]:
    """Return copies of the slides at other speeds and random gains, to which slides may be as near as to the slides."""
    if examples.augmented is None:
        return []
    rng = np.random.default_rng(0)
    widest, copies = math.log(gain_range), examples.augmented.copies
    quiet = (copies.copies < REFERENCE_COPIES) & (copies.kinds != NOISE)
    return [
        replace(copy, shift=rng.uniform(-widest, widest) * examples.augmented.gain_response)
        for copy in _copied_slides(copies.select(quiet), names, classes)
    ]


def _copied_slides(copies: FeatureCopies, names: Any, classes: Codes) -> Iterator[_Slide]:
    number = {name: place for place, name in enumerate(names.tolist())}
    changes = (copies.groups[1:] != copies.groups[:-1]) | (copies.copies[1:] != copies.copies[:-1])
    starts = np.concatenate([[0], np.flatnonzero(changes) + 1, [len(copies.groups)]])
    for start, stop in pairwise(starts.tolist()):
        group = number.get(str(copies.groups[start])) if stop > start else None
        if group is not None:
            kind = str(copies.kinds[start])
            yield _Slide(group, int(classes[group]), copies.values, slice(start, stop), disturbance=kind)


def _fit_distances(
    slides: Sequence[_Slide],
    copies: Sequence[_Slide],
    predictor: Predictor | None,
    overlap: float,
    *,
    compared: Array,
    scores: Collection[str],
) -> Mapping[str, ClassDistance]:
    """Return the distances that count, with the metric of undisturbed slides and references among the copies, too.

    `compared` is 0 for features that only say when a window was, which slides cut in another way have otherwise.
    """
    hidden = hidden_layer(predictor) if predictor is not None and HIDDEN in scores else None
    means, more = (
        [_space_means(slide.values, hidden, overlap, compared) for slide in those] for those in (slides, copies)
    )
    classes, more_classes = (np.array([slide.truth for slide in those]) for those in (slides, copies))
    spaces = [space for space in means[0] if space in scores]
    found = {space: ClassDistance.fit(np.stack([own[space] for own in means]), classes) for space in spaces}
    if not more:
        return found
    return {
        space: distance.with_slides(np.stack([own[space] for own in more]), more_classes)
        for space, distance in found.items()
    }


def _space_means(
    values: Array, hidden: Callable[[Array], Array] | None, overlap: float, compared: Array
) -> dict[str, Array]:
    return space_means(compared * values, hidden(values) if hidden else None, overlap)


def _with_scores(
    trace: SlideTrace,
    values: Array,
    evidence: Array,
    predictor: Predictor | None,
    distances: Mapping[str, ClassDistance],
) -> SlideTrace:
    """Return the trace of a slide, whose windows have these features and gave this evidence, with its scores."""
    hidden = hidden_layer(predictor) if predictor is not None else None
    activations = hidden(values) if hidden else [None] * len(values)
    highest = np.sort(trace.means, axis=1)[:, -2:]
    novelty = SlideNovelty(distances, evidence.shape[1])
    scores = []
    for number, label in enumerate(trace.means.argmax(axis=1).tolist()):
        effective_windows = float(trace.effective_windows[number])
        novelty.add(values[number], activations[number], int(evidence[number].argmax()), effective_windows)
        scores.append(novelty.scores(label, float(highest[number, 1] - highest[number, 0])))
    return replace(trace, scores=np.array(scores))


def _scores_at(traces: Sequence[SlideTrace], effective_windows: float) -> Array:
    """Return the scores of undisturbed slides with the right label after so many windows, (n_slides, n_scores)."""
    found = []
    for trace in traces:
        place = int(np.abs(trace.effective_windows - effective_windows).argmin())
        if not trace.disturbance and int(trace.means[place].argmax()) == trace.truth:
            found.append(trace.scores[place])
    return np.array(found)
