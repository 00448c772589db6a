# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Train a texture model from labelled features: the learner, its calibration, its decisions."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from texture_core.errors import InvalidData
from texture_core.types import AnyArray, Array
from texture_estimation.decisions import (
    HIDDEN,
    NOVELTY_WINDOWS,
    SCORES,
    ClassDistance,
    ConfidenceFloor,
    Decisions,
    Domain,
    ErrorBound,
    NoveltyDetector,
    SlideCourse,
    StoppingRule,
    fit_confidence_floor,
    fit_prediction_sets,
    fit_stopping_rule,
    slide_scores,
    space_means,
    window_count,
)
from texture_estimation.evidence_rules import EvidenceRule, followed, running_means
from texture_estimation.learners.discriminant import FORCE, ForceDiscriminant
from texture_estimation.learners.learner import (
    Codes,
    Fitted,
    Learner,
    Predictor,
    assign_folds,
    extras_of,
    group_means,
    hidden_layer,
    is_tied,
    log_loss,
    of_examples,
    trust,
)
from texture_estimation.learners.mlp import AugmentedExamples
from texture_estimation.model import TextureModel, TrainingExamples
from texture_estimation.next_motion import NextTouchModel
from texture_estimation.recipe import DecisionParams, Recipe
from texture_features.augmentation import NOISE
from texture_features.feature_set import LOAD, FeatureCopies, LabelledFeatures, SlideConditions
from texture_features.features import temporal

# --------------------
# Fit the learner of a recipe to labelled windows, with what else the recipe trains it on.

MIN_CALIBRATION_SLIDES = 2


def fit_learner(recipe: Recipe, examples: LabelledFeatures, codes: Codes, groups: Codes) -> Fitted:
    """Fit the learner; windows that begin within the length of the first one of their slide count more often.

    Where a label has a single slide, its windows are held out one by one and must not be there twice: then every window
    counts once, and nothing is drawn besides.
    """
    of_load = np.array([name.endswith(LOAD) for name in examples.names])
    if of_load.any():  # what is constant tells nothing, and weighs nothing
        examples = replace(examples, values=np.where(of_load, 0.0, examples.values))
    if min(len(np.unique(groups[codes == code])) for code in np.unique(codes)) < MIN_CALIBRATION_SLIDES:
        return recipe.learner.fit(examples.values, codes, groups)
    times = _times(groups, examples, recipe.training.start_weight)
    rows = np.repeat(np.arange(len(codes)), times)
    extras = {name: EXTRAS[name](recipe, examples, codes, groups) for name in extras_of(recipe.learner)}
    fit: Callable[..., Fitted] = recipe.learner.fit  # which takes the extras that the learner declares
    fitted = fit(*_with_resized(examples, codes, groups, rows), **extras)
    if fitted.held_out is None:
        return fitted
    first = np.cumsum(times) - times
    trusted = None if fitted.trusted is None else fitted.trusted[first]
    return replace(fitted, held_out=fitted.held_out[first], trusted=trusted)


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
    return means - np.stack(touches)


def _times(runs: Codes, examples: LabelledFeatures, start_weight: int) -> Codes:
    """Return how often each window counts, (n,): more often those that begin within the length of the first one.

    `runs` are the numbers of the slides or copies to which the windows belong, (n,).
    """
    starting = max(1, round(examples.window_s / examples.hop_s))
    order = np.argsort(runs, kind='stable')
    ordered = runs[order]
    times = np.empty(len(runs), dtype=np.intp)
    times[order] = np.where(np.arange(len(runs)) - np.searchsorted(ordered, ordered) < starting, start_weight, 1)
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
    runs = copied * (int(copies.copies.max(initial=0)) + 1) + copies.copies[own]
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


def held_out_parts(examples: LabelledFeatures) -> Codes | None:
    """Return the part in which each slide is held out, (n_slides,), by session, place and finger; None to go by slides.

    Slides of one session share what is of that day: with one of them in the training, another tells nothing of the next
    day. A label with one session is held out slide by slide, as if its slides were sessions.
    """
    slides, rows = np.unique(examples.groups, return_index=True)
    made = [examples.conditions.get(slide, SlideConditions()) for slide in slides.tolist()]
    alone = len({(one.session, one.place) for one in made}) == len(made)  # a bag for each slide tells of no session
    sessions = np.array([f'{"" if alone else one.session}\n{one.place}\n{one.sensor}' for one in made])
    labels = examples.labels[rows]
    own = [np.flatnonzero(labels == label) for label in np.unique(labels)]
    order = _ranks(sessions, rows)
    count = min(FOLDS, int(order.max()) + 1)
    if max(len(set(sessions[of])) for of in own) < 2 or min(map(len, own)) < 2:
        return None
    parts: Codes = order * count // (order.max() + 1)
    for of in own:
        if len(set(parts[of].tolist())) < 2:
            rank = _ranks(sessions[of] if len(set(sessions[of])) > 1 else slides[of], rows[of])
            parts[of] = rank * count // (rank.max() + 1)
    return parts


def in_places(examples: LabelledFeatures, count: int) -> LabelledFeatures:
    """Return slides over one track cut into so many parts of it, each a slide at a place of its own.

    Windows that lie in two parts are left out. Where the slides are of several places, sessions or fingers already, and
    where a slide has too few windows, they stay as they are.
    """
    if count < 2 or held_out_parts(examples) is not None:
        return examples
    spanned = math.ceil(examples.window_s / examples.hop_s) - 1  # windows after one that overlap it
    groups, kept = examples.groups.astype(object), np.ones(len(examples.groups), dtype=bool)
    conditions = dict(examples.conditions)
    for slide in np.unique(examples.groups).tolist():
        rows = np.flatnonzero(examples.groups == slide)
        if len(rows) < count * (spanned + 1):
            return examples
        parts = np.arange(len(rows)) * count // len(rows)
        for number in range(count):
            name = f'{slide} part {number + 1}/{count}'
            own = rows[parts == number]
            groups[own] = name
            kept[own[len(own) - spanned :] if number < count - 1 else []] = False
            made = examples.conditions.get(slide, SlideConditions())
            conditions[name] = replace(made, place=f'{number + 1}/{count}')
    return replace(examples, groups=groups.astype(np.str_), conditions=conditions).take(kept)


def _ranks(names: Any, rows: Codes) -> Codes:
    """Return 0, 1, … for names in the order of their first rows."""
    found, numbers = np.unique(names, return_inverse=True)
    first = np.array([rows[numbers == number].min() for number in range(len(found))])
    return np.argsort(np.argsort(first))[numbers]


# What learners may declare as their `extras`: keyword arguments of `fit` besides the examples.
EXTRAS: Mapping[str, Callable[[Recipe, LabelledFeatures, Codes, Codes], Any]] = {
    'augmented': _augmented_examples,
    'differences': _touch_differences,
    'parts': lambda _recipe, examples, _codes, _groups: held_out_parts(examples),
}


# --------------------
# Fit novelty detection on slides held out of the training, and follow these slides window by window.

MIN_NOVELTY_SLIDES = 3  # of a class: with one held out, two tell how much slides differ
MIN_ALL_SLIDES = 20
FOLDS = 5
# Of the copies of each slide, so many are among the slides to which the distance is measured, at random gains, if they
# have no noise: what is tolerated as noise would let strong noise pass. Chosen on slides 21-30, trained on 1-20.
REFERENCE_COPIES = 6


@dataclass(frozen=True, eq=False)
class HeldOutSlide:
    """A held-out slide, or a disturbed copy of it, as a classifier that has not seen it follows it."""

    truth: int
    means: Array
    effective_windows: Array
    scores: Array | None = None
    disturbance: str = ''

    def posterior(self, rule: EvidenceRule, tempering_exponent: float) -> Array:
        """Return the log-probabilities after each window."""
        return rule.log_posterior(self.means, self.effective_windows[:, None], tempering_exponent)


@dataclass(frozen=True, eq=False)
class _Slide:
    """A slide or a copy of one, whose windows are rows of examples; in double precision only when asked for."""

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
) -> tuple[NoveltyDetector, Sequence[HeldOutSlide]] | None:
    """Return the detector, and the held-out slides and disturbed copies by which it was fitted.

    Returns None if there are too few slides: MIN_SLIDES of each class are needed, and in all MIN_ALL_SLIDES or one over
    the rate of false rejections.
    """
    classes = np.unique(examples.labels, return_inverse=True)[1]
    names, first, groups = np.unique(examples.groups, return_index=True, return_inverse=True)
    counts = np.bincount(classes[first])
    enough = len(names) >= MIN_ALL_SLIDES or (len(names) + 1) * false_rejection_rate >= 1.0
    if fitted.held_out is None or len(counts) < 2 or counts.min() < MIN_NOVELTY_SLIDES or not enough:
        return None
    hop_share = min(examples.hop_s / examples.window_s, 1.0)
    slides = [
        _Slide(number, int(classes[first[number]]), examples.values, np.flatnonzero(groups == number))
        for number in range(len(names))
    ]
    augmented = examples.augmented
    disturbed = [*_copied_slides(augmented.disturbed, names, classes[first])] if augmented else []
    copies = _reference_copies(examples, names, classes[first], gain_range)
    # what says when and how a window was made, and not what of: not compared
    apart = {temporal.SLIDE_ONSET, FORCE} if isinstance(learner, ForceDiscriminant) else {temporal.SLIDE_ONSET}
    compared = np.array([name.rsplit('/', 1)[-1] not in apart for name in examples.names], dtype=np.float64)
    traces: list[HeldOutSlide] = []
    for held_out, predictor in _folds(learner, fitted, classes, groups, held_out_parts(examples)):
        distances = _fit_distances(
            [slide for slide in slides if slide.group not in held_out],
            [copy for copy in copies if copy.group not in held_out],
            predictor,
            hop_share,
            compared=compared,
            scores=scores,
        )
        hidden = hidden_layer(predictor) if predictor is not None else None
        for slide in (slide for slide in (*slides, *disturbed) if slide.group in held_out):
            values = slide.values
            trusted: Array | float = 1.0
            if predictor is not None:
                log_probabilities, trusted = predictor(values), trust(predictor, values)
            elif not slide.disturbance:
                log_probabilities = fitted.held_out[groups == slide.group]
            else:
                continue
            evidence = rule.window_evidence(log_probabilities)
            effective_windows: Array = 1.0 + np.arange(len(evidence), dtype=np.float64) * hop_share
            means = running_means(rule, evidence, effective_windows, trusted)
            activations = hidden(values) if hidden else None
            found = slide_scores(
                distances, values, activations, evidence, means=means, effective_windows=effective_windows
            )
            traces.append(HeldOutSlide(slide.truth, means, effective_windows, found, slide.disturbance))
    final = learner.predictor(fitted.parameters)
    layered = final if hidden_layer(final) else None
    distances = _fit_distances(slides, copies, layered, hop_share, compared=compared, scores=scores)
    held_out_scores = [_scores_at(traces, level) for level in NOVELTY_WINDOWS]
    if min(map(len, held_out_scores)) < MIN_NOVELTY_SLIDES:
        return None
    return NoveltyDetector.fit(distances, held_out_scores, false_rejection_rate, scores), traces


def _folds(
    learner: Learner, fitted: Fitted, classes: Codes, groups: Codes, parts: Codes | None
) -> Iterator[tuple[frozenset[int], Predictor | None]]:
    """Yield the slides that are held out together, and what was fitted without them, if the learner keeps it."""
    if fitted.folds:
        for held_out, parameters in fitted.folds:
            yield frozenset(held_out.tolist()), learner.predictor(parameters)
        return
    split = assign_folds(classes, groups, FOLDS, parts)
    parts = split[0] if split else np.zeros(len(groups), np.intp)
    for part in np.unique(parts):
        yield frozenset(groups[parts == part].tolist()), None


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
    hop_share: float,
    *,
    compared: Array,
    scores: Collection[str],
) -> Mapping[str, ClassDistance]:
    """Return the distances that count, with the metric of undisturbed slides and references among the copies, too.

    `compared` is 0 for features that only say when a window was, which slides cut in another way have otherwise.
    """
    hidden = hidden_layer(predictor) if predictor is not None and HIDDEN in scores else None
    means, more = (
        [_space_means(slide.values, hidden, hop_share, compared) for slide in those] for those in (slides, copies)
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
    values: Array, hidden: Callable[[Array], Array] | None, hop_share: float, compared: Array
) -> dict[str, Array]:
    start = values[: window_count(NOVELTY_WINDOWS[-1], hop_share)]  # later windows are in no mean
    return space_means(compared * start, hidden(start) if hidden else None, hop_share)


def _scores_at(traces: Sequence[HeldOutSlide], effective_windows: float) -> Array:
    """Return the scores of undisturbed slides with the right label after so many windows, (n_slides, n_scores)."""
    found = []
    for trace in traces:
        place = int(np.abs(trace.effective_windows - effective_windows).argmin())
        if trace.scores is not None and not trace.disturbance and int(trace.means[place].argmax()) == trace.truth:
            found.append(trace.scores[place])
    return np.array(found)


# --------------------
# Fit when a slide may end, which textures stay candidates and how fast evidence grows, on held-out slides.

# Of windows that share a slide when nothing could be held out: between "all the same" (0) and independent (1).
DEFAULT_TEMPERING_EXPONENT = 0.5


def held_out_slides(
    fitted: Fitted, codes: Codes, groups: Codes, rule: EvidenceRule, hop_share: float
) -> Sequence[HeldOutSlide]:
    """Return the slides, as evaluated when they were held out; none if nothing was."""
    if fitted.held_out is None:
        return []
    evidence = rule.window_evidence(fitted.held_out)
    slides = []
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        trusted = 1.0 if fitted.trusted is None else fitted.trusted[rows]
        slides.append(HeldOutSlide(int(codes[rows[0]]), *followed(rule, evidence[rows], hop_share, trusted)))
    return slides


def fit_tempering_exponent(slides: Sequence[HeldOutSlide], rule: EvidenceRule) -> float:
    """Return the exponent with which evidence grows that makes held-out slides most probable, whenever one looks."""
    if not slides:
        return DEFAULT_TEMPERING_EXPONENT
    mean = np.concatenate([slide.means for slide in slides])
    effective_window_counts = np.concatenate([slide.effective_windows for slide in slides])[:, None]
    truth = np.concatenate([np.full(len(slide.effective_windows), slide.truth) for slide in slides])

    def loss(tempering_exponent: float) -> float:
        return log_loss(rule.log_posterior(mean, effective_window_counts, tempering_exponent), truth)

    return float(minimize_scalar(loss, bounds=(0.0, 1.0), method='bounded').x)


def fit_open_set(
    recipe: Recipe,
    fitted: Fitted,
    examples: LabelledFeatures,
    slides: Sequence[HeldOutSlide],
    tempering_exponent: float,
) -> tuple[StoppingRule, NoveltyDetector | None, ConfidenceFloor]:
    """Return when a slide may end, the novelty detector, and the smallest confidence of known surfaces.

    Without a novelty detector, as none is asked for or there are too few slides, there is no smallest confidence.
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
    detector, traces = found or (None, slides)
    courses = [_course(trace, detector, recipe.evidence, tempering_exponent) for trace in traces]
    if not courses:
        return StoppingRule(), None, ConfidenceFloor()
    if detector is None:
        return fit_stopping_rule(courses, decisions.max_error_rate, by_novelty=False), None, ConfidenceFloor()
    one_track = held_out_parts(examples) is None
    most = decisions.max_known_error_rate_on_track if one_track else decisions.max_known_error_rate
    floor = fit_confidence_floor(courses, decisions.low_confidence_rejection_rate, most)
    courses = [
        replace(
            course,
            known=course.known & [*map(floor.reached, course.confidences.tolist(), course.effective_windows.tolist())],
        )
        for course in courses
    ]
    rule = fit_stopping_rule(
        courses, decisions.max_error_rate, decisions.max_disturbed_error_rate, decisions.early_novelty_score
    )
    return rule, detector, floor


def _course(
    trace: HeldOutSlide, detector: NoveltyDetector | None, rule: EvidenceRule, tempering_exponent: float
) -> SlideCourse:
    posterior = trace.posterior(rule, tempering_exponent)
    novelty_scores: Array = np.zeros(len(posterior))
    thresholds: Array = novelty_scores
    if detector is not None and trace.scores is not None:
        novelty_scores, thresholds = detector.scores_and_thresholds(trace.scores, trace.effective_windows)
    return SlideCourse(
        confidences=np.exp(posterior.max(axis=1)),
        right=(posterior.argmax(axis=1) == trace.truth) & ~is_tied(posterior),
        effective_windows=trace.effective_windows,
        known=novelty_scores <= thresholds,
        novelty_scores=novelty_scores,
        disturbance=trace.disturbance,
    )


# --------------------
# Learn a model from labelled windows.


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
    made, examples = examples, in_places(examples, recipe.training.held_out_places)
    labels, codes = np.unique(examples.labels, return_inverse=True)
    groups = np.unique(examples.groups, return_inverse=True)[1]
    trained = replace(recipe, learner=of_examples(recipe.learner, examples.names, labels.tolist()))
    fitted = fit_learner(trained, examples, codes, groups)
    hop_share = min(examples.hop_s / examples.window_s, 1.0)
    slides_held_out = held_out_slides(fitted, codes, groups, recipe.evidence, hop_share)
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
        decisions=Decisions(
            ErrorBound(min(len(slides_held_out), len(np.unique(made.groups))), decisions.max_error_rate),
            rule,
            fit_prediction_sets(
                [slide.posterior(recipe.evidence, tempering_exponent) for slide in slides_held_out],
                [slide.truth for slide in slides_held_out],
                [slide.effective_windows for slide in slides_held_out],
                decisions.coverage,
            ),
            floor,
            _domain(made, recipe.training),
            novelty_detector,
        ),
        next_touch_model=_fit_next_touch_model(made),
        training={
            'windows': len(codes),
            'slides': len(np.unique(made.groups)),
            'window_s': examples.window_s,
            'hop_s': examples.hop_s,
            'calibration': fitted.note,
            'held_out_window_accuracy': _held_out_accuracy(fitted, codes),
        },
        examples=TrainingExamples.of(examples.values, codes, groups),
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
