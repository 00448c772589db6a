# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Train a texture model from labelled features: the learner, its calibration, its decisions."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from texture_core.errors import InvalidData
from texture_core.types import AnyArray, Array
from texture_estimation.acceptance import Acceptance, HeldOutSlide
from texture_estimation.domain import Domain
from texture_estimation.evidence_rules import EvidenceRule, followed
from texture_estimation.gaussians import ClassDistance, compared_start
from texture_estimation.learners.learner import (
    NOT_COMPARED,
    Codes,
    Fitted,
    Predictor,
    assign_folds,
    check_finite,
    extras_of,
    group_means,
    hidden_layer,
    is_tied,
    log_loss,
    log_softmax,
    of_examples,
    trust,
)
from texture_estimation.learners.mlp import AugmentedExamples
from texture_estimation.model import TextureModel, TrainingExamples
from texture_estimation.next_motion import NextTouchModel
from texture_estimation.recipe import Recipe
from texture_features.augmentation import NOISE
from texture_features.feature_set import LEAST_AT_REST, LOAD, FeatureCopies, LabelledFeatures, SlideConditions

# --------------------
# Fit the learner of a recipe to labelled windows, with what else the recipe trains it on.

MIN_CALIBRATION_SLIDES = 2


def fit_learner(
    recipe: Recipe, examples: LabelledFeatures, codes: Codes, groups: Codes, parts: Codes | None = None
) -> Fitted:
    """Fit the learner; windows that begin within the length of the first one of their slide count more often.

    Slides of one of these parts, (n_slides,), are held out together; slides are held out by themselves without parts.

    Where a label has a single slide, its windows are held out one by one and must not be there twice: then every window
    counts once, and nothing else is drawn.
    """
    of_load = np.array([name.endswith(LOAD) for name in examples.names])
    if of_load.any():  # constant features carry no information and get no weight
        examples = replace(examples, values=np.where(of_load, 0.0, examples.values))
    if min(len(np.unique(groups[codes == code])) for code in np.unique(codes)) < MIN_CALIBRATION_SLIDES:
        return recipe.learner.fit(examples.values, codes, groups)
    times = _times(groups, examples, recipe.training.start_weight)
    rows = np.repeat(np.arange(len(codes)), times)
    declared, extras = extras_of(recipe.learner), dict[str, Any]()
    if 'augmented' in declared:
        extras['augmented'] = _augmented_examples(recipe, examples, codes, groups)
    if 'parts' in declared:
        extras['parts'] = parts
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
    members = np.isin(examples.resized.groups, names)
    slides = np.searchsorted(names, examples.resized.groups[members])
    further = examples.resized.values[members], codes[first][slides], slides
    both: Any = map(np.concatenate, zip(taken, further, strict=True))
    values, labels, slides = both
    return values, labels, slides


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
    """Return what the learner draws in addition to the examples; None without augmentation or copies of the slides."""
    if examples.augmented is None or not recipe.augmentation.copies:
        return None
    copies = examples.augmented.copies
    names, first = np.unique(examples.groups, return_index=True)
    members = np.isin(copies.groups, names)
    copied = np.searchsorted(names, copies.groups[members])
    runs = copied * (int(copies.copies.max(initial=0)) + 1) + copies.copies[members]
    means = group_means(examples.values, groups)
    classes = codes[first]
    centres = np.stack([means[classes == code].mean(axis=0) for code in range(int(codes.max()) + 1)])
    return AugmentedExamples(
        values=copies.values if members.all() else copies.values[members],  # a copy of all takes as much memory again
        codes=classes[copied],
        groups=copied,
        rows=np.repeat(np.arange(len(copied)), _times(runs, examples, recipe.training.start_weight)),
        gain_response=examples.augmented.gain_response(names),
        slide_deviations=means - centres[classes],
        slides=np.arange(len(names)),
        augmentation=recipe.augmentation,
    )


def held_out_parts(examples: LabelledFeatures, *, by_speed: bool = False) -> Codes | None:
    """Return the part in which each slide is held out, (n_slides,), by session, place and finger; None to go by slides.

    `by_speed` also slides at other speeds are in other parts.

    Slides of one session share the conditions of that day: with one of them in training, another is no test of the next
    day. A label with one session is held out slide by slide, as if its slides were sessions.
    """
    slides, rows = np.unique(examples.groups, return_index=True)
    made = [examples.conditions.get(slide, SlideConditions()) for slide in slides.tolist()]
    alone = len({(one.session, one.place) for one in made}) == len(made)  # a bag for each slide defines no session
    speeds = [f'{one.speed_m_s:.2g}' if by_speed else '' for one in made]
    sessions = np.array(
        [f'{"" if alone else one.session}\n{one.place}\n{one.sensor}\n{v}' for one, v in zip(made, speeds, strict=True)]
    )
    labels = examples.labels[rows]
    of_labels = [np.flatnonzero(labels == label) for label in np.unique(labels)]
    order = _ranks(sessions, rows)
    count = min(FOLDS, int(order.max()) + 1)
    if max(len(set(sessions[of])) for of in of_labels) < 2 or min(map(len, of_labels)) < 2:
        return None
    parts: Codes = order * count // (order.max() + 1)
    for of in of_labels:
        if len(set(parts[of].tolist())) < 2:
            rank = _ranks(sessions[of] if len(set(sessions[of])) > 1 else slides[of], rows[of])
            parts[of] = rank * count // (rank.max() + 1)
    return parts


GAP = 0.2  # of a part of the track, left out before the next one: neighbours are too alike


def in_places(examples: LabelledFeatures, count: int) -> LabelledFeatures:
    """Return slides over one track cut into this many parts of it, each a slide at a separate place.

    Windows that lie in two parts are left out, and more, so that a gap lies between the parts. Where the slides are of
    several places, sessions or fingers already, and where a slide has too few windows, they stay as they are.
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
            members = rows[parts == number]
            groups[members] = name
            gap = max(spanned, round(GAP * len(members)))
            kept[members[len(members) - gap :] if number < count - 1 else []] = False
            made = examples.conditions.get(slide, SlideConditions())
            conditions[name] = replace(made, place=f'{number + 1}/{count}')
    return replace(examples, groups=groups.astype(np.str_), conditions=conditions).take(kept)


def _ranks(names: Any, rows: Codes) -> Codes:
    """Return 0, 1, … for names in the order of their first rows."""
    found, numbers = np.unique(names, return_inverse=True)
    first = np.array([rows[numbers == number].min() for number in range(len(found))])
    return np.argsort(np.argsort(first))[numbers]


# --------------------
# Follow slides and disturbed copies window by window, as models do that have not seen them.

FOLDS = 5
# Of the copies of each slide, this many lie among those to which the distance is measured, at random gains, if they
# have no noise: what is tolerated as noise would let strong noise pass. Chosen on slides 21-30, trained on 1-20.
REFERENCE_COPIES = 6


@dataclass(frozen=True, eq=False)
class _Slide:
    """A slide or a copy of one, whose windows are rows of examples; in double precision only on request."""

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


class Followed:
    """The slides of examples, the distance to them, and how those that were held out are followed."""

    def __init__(self, recipe: Recipe, examples: LabelledFeatures) -> None:
        self._recipe = recipe
        self._hop_ratio = min(examples.hop_s / examples.window_s, 1.0)
        self._classes = np.unique(examples.labels, return_inverse=True)[1]
        names, first, self._groups = np.unique(examples.groups, return_index=True, return_inverse=True)
        truths = self._classes[first]
        self._compared = np.array([name.rsplit('/', 1)[-1] not in NOT_COMPARED for name in examples.names], dtype=float)
        self._slides = [
            _Slide(number, int(truths[number]), examples.values, np.flatnonzero(self._groups == number))
            for number in range(len(names))
        ]
        augmented = examples.augmented
        self._disturbed = [*_copied_slides(augmented.disturbed, names, truths)] if augmented else []
        self._copies = _reference_copies(examples, names, truths, recipe.augmentation.gain_range)

    def held_out(self, fitted: Fitted, temperature: float, parts: Codes | None) -> Iterator[HeldOutSlide]:
        """Yield each held-out slide; its evidence is that of a model of this temperature."""
        rule, scale = self._recipe.evidence, fitted.temperature / temperature
        for held_out, predictor in self._folds(fitted, parts):
            distance = self.distance(predictor, held_out)
            for slide in (one for one in (*self._slides, *self._disturbed) if one.group in held_out):
                values = slide.values
                if predictor is not None:
                    scores, trusted = predictor(values), trust(predictor, values)
                elif not slide.disturbance and fitted.held_out is not None:
                    scores, trusted = fitted.held_out[self._groups == slide.group], 1.0
                else:
                    continue
                evidence = rule.window_evidence(log_softmax(scores) * scale)
                counts: Array = 1.0 + np.arange(len(evidence), dtype=np.float64) * self._hop_ratio
                means, _ = followed(rule, evidence, self._hop_ratio, trusted)
                yield HeldOutSlide.follow(
                    slide.truth, means, counts, self._values(values, predictor), distance, disturbance=slide.disturbance
                )

    def distance(self, predictor: Predictor | None, held_out: Collection[int] = ()) -> ClassDistance:
        """Return the distance to slides that are not held out: their metric, with copies among the references."""
        means, codes = [], []
        for those in (self._slides, self._copies):
            kept = [slide for slide in those if slide.group not in held_out]
            codes.append(np.array([slide.truth for slide in kept], dtype=np.intp))
            means.append([compared_start(self._values(one.values, predictor), self._hop_ratio) for one in kept])
        found = ClassDistance.fit(np.stack(means[0]), codes[0])
        return found.with_slides(np.stack(means[1]), codes[1]) if means[1] else found

    def _values(self, values: Array, predictor: Predictor | None) -> Array:
        """Return what is compared of windows: the hidden layer of the predictor, without one the features."""
        hidden = hidden_layer(predictor) if predictor is not None else None
        return hidden(values) if hidden else values * self._compared

    def _folds(self, fitted: Fitted, parts: Codes | None) -> Iterator[tuple[frozenset[int], Predictor | None]]:
        """Yield the slides that are held out together, and what was fitted without them, if the learner keeps it."""
        for held_out, parameters in fitted.folds:
            yield frozenset(held_out.tolist()), self._recipe.learner.predictor(parameters)
        split = None if fitted.folds else assign_folds(self._classes, self._groups, FOLDS, parts)
        for part in np.unique(split[0]) if split else ():
            yield frozenset(self._groups[split[0] == part].tolist()), None  # type: ignore[index]


def _reference_copies(examples: LabelledFeatures, names: Any, classes: Codes, gain_range: float) -> list[_Slide]:
    """Return copies of the slides at other speeds and random gains, to which slides may be as near as to the slides."""
    if examples.augmented is None:
        return []
    rng = np.random.default_rng(0)
    widest, copies = math.log(gain_range), examples.augmented.copies
    response = examples.augmented.gain_response(names)
    quiet = (copies.copies < REFERENCE_COPIES) & (copies.kinds != NOISE)
    return [
        replace(copy, shift=rng.uniform(-widest, widest) * response)
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


# Of windows that share a slide when nothing could be held out: between "all the same" (0) and independent (1).
DEFAULT_TEMPERING_EXPONENT = 0.5


def fit_tempering_exponent(
    fitted: Fitted, codes: Codes, groups: Codes, rule: EvidenceRule, hop_ratio: float, *, temperature: float
) -> float:
    """Return the exponent with which evidence grows that makes held-out slides most probable, whenever one looks."""
    if fitted.held_out is None:
        return DEFAULT_TEMPERING_EXPONENT
    evidence = rule.window_evidence(log_softmax(fitted.held_out * fitted.temperature / temperature))
    slides = []
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        means, counts = followed(
            rule, evidence[rows], hop_ratio, 1.0 if fitted.trusted is None else fitted.trusted[rows]
        )
        slides.append((means, counts, codes[rows]))
    means, counts, truth = (np.concatenate(parts) for parts in zip(*slides, strict=True))

    def loss(tempering_exponent: float) -> float:
        return log_loss(rule.log_posterior(means, counts[:, None], tempering_exponent), truth)

    return float(minimize_scalar(loss, bounds=(0.0, 1.0), method='bounded').x)


# --------------------
# Learn a model from labelled windows.


def train(recipe: Recipe, examples: LabelledFeatures, name: str = '') -> TextureModel:
    """Return a model of the labels of the examples.

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
    slides, first, groups = np.unique(examples.groups, return_index=True, return_inverse=True)
    of_slides = examples.labels[first].tolist()
    conditions = [examples.conditions.get(slide, SlideConditions()) for slide in slides.tolist()]
    motions = [examples.motions.get(slide) for slide in slides.tolist()]
    hop_ratio = min(examples.hop_s / examples.window_s, 1.0)
    # Fit to all slides, and without some of them in turn.
    bound = replace(recipe, learner=of_examples(recipe.learner, examples.names, labels.tolist()))
    fitted = fit_learner(bound, examples, codes, groups)
    tempering_exponent = fit_tempering_exponent(
        fitted, codes, groups, recipe.evidence, hop_ratio, temperature=fitted.temperature
    )
    calibrated, truth = fitted, codes
    domain = replace(
        Domain.of_slides(conditions, of_slides),
        speed_margin=recipe.training.speed_margin,
        force_margin=recipe.training.force_margin,
    )
    domain, quiet = domain.with_quiet(conditions, of_slides)
    silent = ', '.join(recipe.feature_set.unknown_levels)
    unknown = (
        f'no feature is the power of {silent}' if silent else f'no approach of {LEAST_AT_REST} samples was recorded'
    )
    acceptance = Acceptance(0 if fitted.held_out is None else len(slides), recipe.training.rates, domain)
    if not acceptance.reason:
        followed_slides = Followed(bound, examples)
        near = [*followed_slides.held_out(fitted, fitted.temperature, None)]
        far: list[HeldOutSlide] = []
        # Where slides are of several places, sessions or fingers, also fit without each of these in turn.
        placed = in_places(examples, recipe.training.held_out_places)
        parts = held_out_parts(placed, by_speed=bool(recipe.training.slowest_m_s))
        if parts is not None:
            kinds, parts_of = (np.unique(names, return_inverse=True)[1] for names in (placed.labels, placed.groups))
            without = fit_learner(bound, placed, kinds, parts_of, parts)
            calibrated, truth = without, kinds
            far = [*Followed(bound, placed).held_out(without, fitted.temperature, parts)]
            tempering_exponent = fit_tempering_exponent(
                without, kinds, parts_of, recipe.evidence, hop_ratio, temperature=fitted.temperature
            )
        distance = followed_slides.distance(bound.learner.predictor(fitted.parameters))
        acceptance = acceptance.fitted(near, far, recipe.evidence, tempering_exponent, distance)
    accuracy = None
    if calibrated.held_out is not None:
        right = (calibrated.held_out.argmax(axis=1) == truth) & ~is_tied(calibrated.held_out)
        accuracy = round(float(right.mean()), 4)
    return TextureModel(
        name=name or recipe.name,
        labels=tuple(labels.tolist()),
        names=examples.names,
        feature_set=examples.feature_set,
        recipe=recipe,
        parameters=fitted.parameters,
        tempering_exponent=tempering_exponent,
        acceptance=acceptance,
        next_touch_model=NextTouchModel.of_slides(group_means(examples.values, groups), of_slides, motions),
        training={
            'windows': len(codes),
            'slides': len(slides),
            'window_s': examples.window_s,
            'hop_s': examples.hop_s,
            'calibration': calibrated.note,
            'held_out_window_accuracy': accuracy,
            'quiet': list(quiet.values())
            if domain.rest
            else [f'{unknown}: a finger that feels nothing cannot be told from a quiet surface'],
        },
        examples=TrainingExamples.of(examples.values, codes),
    )


DAY_SUFFIX = '-today'


def adapted(model: TextureModel, training: LabelledFeatures, today: LabelledFeatures) -> TextureModel:
    """Return the model trained again with each surface shifted, in the mean of its features, to its slides of today.

    A surface without a slide of today is shifted as the others are on average. Nothing shows which slides of today
    would be unknown, so none is accepted.
    """
    labels = model.trained_labels
    if strange := sorted(set(today.labels.tolist()) - set(labels)):
        raise InvalidData(
            f"'{strange[0]}' is not a trained surface; label the slides of today with {', '.join(labels)}"
        )
    if missing := sorted(set(labels) - set(training.labels.tolist())):
        raise InvalidData(
            f"the model was also trained on '{missing[0]}', of which the bags of the training hold no slide; give all"
        )
    shifts: dict[str, Array] = {
        label: today.values[today.labels == label].mean(axis=0) - training.values[training.labels == label].mean(axis=0)
        for label in np.unique(today.labels).tolist()
    }
    usual: Array = np.mean(list(shifts.values()), axis=0)
    values = training.values + np.stack([shifts.get(label, usual) for label in training.labels.tolist()])
    shifted = replace(training, values=values, augmented=None, resized=None)
    found = train(model.recipe, shifted, f'{model.name}{DAY_SUFFIX}')
    return replace(found, acceptance=Acceptance(0, found.acceptance.rates, found.acceptance.domain))


def _check(examples: LabelledFeatures) -> None:
    if not len(examples.labels):
        raise InvalidData('there are no windows for training; record slides of at least two surfaces')
    labels = np.unique(examples.labels)
    if len(labels) < 2:
        raise InvalidData(f"all windows are of '{labels[0]}'; at least two surfaces are needed to distinguish them")
    check_finite(examples)
