# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Collect slides of a surface at many places: where to touch next, how left-out places are recognised, when to end."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count, takewhile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import beta

from texture_core.config import param
from texture_core.errors import (
    CollectionError,
    ExplorationError,
    InvalidData,
    InvalidParameter,
    MotionAborted,
    TextureError,
    counted,
)
from texture_core.types import Array, ExplorationRequest, needed_label
from texture_estimation.acceptance import LEAST_SLIDES_A_LABEL
from texture_estimation.domain import Domain
from texture_estimation.learners.discriminant import Discriminant
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train
from texture_evaluation.cross_validation import predict_slides
from texture_features.feature_set import LabelledFeatures, SlideConditions

# --------------------
# The request.


SHORTEST_S = 0.6  # of a slide: one window, and what starts late


@dataclass(frozen=True)
class CollectionParams:
    """How a surface is collected; the places lie on the surface patch."""

    places: int = param(6, 'Fewest places that are touched.', low=2, high=1000)
    most_places: int = param(18, 'Most places that are touched.', low=2, high=1000)
    distance_m: float = param(0.04, 'Length of each slide.', unit='m', low=0.002, high=1.0)
    speed_low_m_s: float = param(
        0.0, 'Lowest speed of the slides; 0: 0.02 m/s, or the nearest that fits.', unit='m/s', low=0.0, high=1.0
    )
    speed_high_m_s: float = param(
        0.0,
        'Highest speed of the slides; 0: 2.5 times the lowest, or the nearest that the explorer allows.',
        unit='m/s',
        low=0.0,
        high=1.0,
    )
    force_low_n: float = param(
        0.0, 'Lowest normal force of the slides; 0: 1 N, or the nearest that fits.', unit='N', low=0.0, high=50.0
    )
    force_high_n: float = param(
        0.0,
        'Highest normal force of the slides; 0: twice the lowest, or the nearest that the explorer allows.',
        unit='N',
        low=0.0,
        high=50.0,
    )
    bound: float = param(0.6, 'Required accuracy at new places, as a lower 90 % bound.', low=0.0, high=0.99)
    seed: int = param(0, 'Seed of places and directions.', low=0)

    def __post_init__(self) -> None:
        if self.speed_high_m_s:
            self.check_duration(self.speed_high_m_s)
        for low, high in (('places', 'most_places'), *USUAL):
            if getattr(self, low) > getattr(self, high) > 0:  # 0 is chosen later
                raise InvalidParameter(
                    f"'{low}' is {getattr(self, low):g}; it must not be above '{high}', {getattr(self, high):g}"
                )

    def check_duration(self, highest_m_s: float) -> None:
        """Refuse slides that are too short at this speed."""
        if (shortest_s := self.distance_m / highest_m_s) < SHORTEST_S:
            raise InvalidParameter(
                f"a slide of 'distance_m' {self.distance_m:g} m lasts {shortest_s:.2f} s at {highest_m_s:g} m/s; "
                f'{SHORTEST_S:g} s are needed to recognise it'
            )


@dataclass(frozen=True)
class Patch:
    """A rectangle in the surface frame, m."""

    x_low_m: float
    x_high_m: float
    y_low_m: float
    y_high_m: float


UNLIMITED = (0.0, math.inf)
# By the names of the lowest and the highest: default of the lowest, ratio of the default highest to it, and the unit.
USUAL = {('force_low_n', 'force_high_n'): (1.0, 2.0, 'N'), ('speed_low_m_s', 'speed_high_m_s'): (0.02, 2.5, 'm/s')}


def fitted_range(params: CollectionParams, names: tuple[str, str], allowed: tuple[float, float]) -> tuple[float, float]:
    """Return the lowest and highest force or speed; omitted ones are fitted into what the explorer allows."""
    usual_low, span, unit = USUAL[names]
    (least, most), (low, high) = allowed, (getattr(params, name) for name in names)
    for name, asked in zip(names, (low, high), strict=True):
        if asked and not least <= asked <= most:
            raise InvalidParameter(f"'{name}' is {asked:g} {unit}; the explorer allows {least:g} to {most:g} {unit}")
    low = low or max(min(usual_low, (high or most) / span), least)
    return low, high or min(span * low, most)


# --------------------
# Which place, direction, speed and force comes next.

CANDIDATES = 200
EDGE = 0.5  # of a slide beyond its end, for the ramps before and after it
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
PLASTIC = 0.7548776662466927  # the same for a second, parallel sequence (Roberts 2018)


class PlacePlan:
    """Choose touches one by one, each far from those before; speeds and forces fill their ranges evenly."""

    def __init__(
        self,
        surface: str,
        params: CollectionParams,
        patch: Patch,
        allowed_forces_n: tuple[float, float] = UNLIMITED,
        allowed_speeds_m_s: tuple[float, float] = UNLIMITED,
    ) -> None:
        self._surface, self._params, self._patch = needed_label(surface), params, patch
        forces, speeds = USUAL
        self._forces_n = fitted_range(params, forces, allowed_forces_n)
        self._speeds_m_s = fitted_range(params, speeds, allowed_speeds_m_s)
        params.check_duration(self._speeds_m_s[1])
        self._rng = np.random.default_rng(params.seed)
        self._middles: list[Array] = []
        if not self._candidates():
            raise InvalidData(
                f'no slide of {params.distance_m:g} m with its ramps lies on the patch, which is '
                f'{patch.x_high_m - patch.x_low_m:g} m by {patch.y_high_m - patch.y_low_m:g} m; ask for shorter '
                'slides, or touch a larger patch'
            )

    def next(self) -> ExplorationRequest:
        """Return the next touch."""
        number, params = len(self._middles), self._params
        # The constructor has seen that some fit; on a narrow patch few of a draw do.
        while not (found := self._candidates()):
            pass
        best = max(found, key=lambda one: min((math.dist(one[3], other) for other in self._middles), default=0.0))
        x_m, y_m, direction_rad, middle = best
        self._middles.append(middle)
        return ExplorationRequest(
            'linear_slide',
            speed_m_s=_between(*self._speeds_m_s, (number * GOLDEN) % 1.0),
            force_n=_between(*self._forces_n, (number * PLASTIC) % 1.0),
            distance_m=params.distance_m,
            direction_rad=direction_rad,
            surface=self._surface,
            use_start=True,
            start_x_m=x_m,
            start_y_m=y_m,
        )

    def _candidates(self) -> list[tuple[float, float, float, Array]]:
        """Return places, directions and middles of slides that lie on the patch with their ramps."""
        patch, reach_m = self._patch, (1.0 + EDGE) * self._params.distance_m
        low, high = np.array([patch.x_low_m, patch.y_low_m]), np.array([patch.x_high_m, patch.y_high_m])
        starts = self._rng.uniform(low, high, (CANDIDATES, 2))
        angles = self._rng.uniform(-math.pi, math.pi, CANDIDATES)
        ways = reach_m * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        fits = np.all((starts + ways >= low) & (starts + ways <= high), axis=1)
        return [
            (float(start[0]), float(start[1]), float(angle), start + way / 2)
            for start, way, angle in zip(starts[fits], ways[fits], angles[fits], strict=True)
        ]


def _between(low: float, high: float, fraction: float) -> float:
    return float(low * (high / low) ** fraction)  # equal ratios, not equal steps


# --------------------
# Accuracy and acceptance at places that were left out of a training on all others, by their distance from these.

RECIPE, SHRINKAGE = 'default', 0.5  # few slides show no correlations
CONFIDENCE = 0.9
# Within which other places of the surface are also left out: neighbours show more than a new place will.
GAPS_M = (0.01, 0.03, 0.06)
BANDS_M = (0.02, 0.04, 0.08)  # largest distance of each band from the nearest trained place
ENOUGH = 0.8  # accuracy of a band up to which tracks are near enough
AT = re.compile(r'at (-?\d+),(-?\d+) mm')


class Band(NamedTuple):
    """Places at most so far from the nearest trained one, and how many of them were correct, and accepted and so."""

    far_m: float
    places: int
    correct: int
    accepted: int


@dataclass(frozen=True)
class PlaceAccuracy:
    """How a quick classifier recognises places that it was not trained at, each with its neighbours left out."""

    places: int
    correct: int
    confused: str = ''
    others: int = 0
    bands: tuple[Band, ...] = ()
    quiet: str = ''  # if each slide is as quiet as the sensor at rest: a training rejects the surface

    @property
    def bound(self) -> float:
        """Lower 90 % bound of the accuracy at new places; 0 without other surfaces. Clopper & Pearson 1934."""
        if not self.others or not self.correct:
            return 0.0
        return float(beta.ppf(1.0 - CONFIDENCE, self.correct, self.places - self.correct + 1))

    @property
    def spacing_m(self) -> float:
        """Largest spacing of tracks: the farthest point between two is half of it from either; 0 if unknown."""
        near = takewhile(lambda band: band.correct >= ENOUGH * band.places, self.bands)
        return max((2.0 * band.far_m for band in near if band.accepted >= LEAST_SLIDES_A_LABEL), default=0.0)

    @property
    def sentence(self) -> str:
        """Results so far."""
        if not self.others:
            return f'{counted(self.places, "place")}; the folder holds no other surface yet'
        mistaken = f', mostly misidentified as {self.confused}' if self.confused else ''
        found = (
            f'{self.correct} of {self.places} left-out places correct{mistaken}; at new places at least '
            f'{100 * self.bound:.0f} % (90 % bound), against {counted(self.others, "other surface")}'
        )
        if not self.bands:
            return found
        by_distance = ', '.join(
            f'{100 * band.far_m:.0f} cm {band.correct} of {band.places} ({band.accepted} accepted)'
            for band in self.bands
        )
        unknown = (
            f'unknown: at one distance {LEAST_SLIDES_A_LABEL} accepted places are needed, and up to it '
            f'{100 * ENOUGH:.0f} % correct ones'
        )
        spacing = f'up to {100 * self.spacing_m:.0f} cm' if self.spacing_m else unknown
        return f'{found}; by distance to the nearest trained place: {by_distance}; spacing of tracks: {spacing}'


def evaluate_places(features: LabelledFeatures, surface: str) -> PlaceAccuracy:
    """Return accuracy and acceptance at the places of a surface, each left out in turn with those near to it."""
    made = {name: features.conditions.get(name, SlideConditions()) for name in np.unique(features.groups).tolist()}
    surfaces = dict(zip(features.groups.tolist(), features.labels.tolist(), strict=True))
    slides = made.values(), [surfaces[name] for name in made]
    domain, quiet = Domain.of_slides(*slides).with_quiet(*slides)
    if surface in domain.quiet_labels:
        return PlaceAccuracy(0, 0, quiet=quiet[surface])
    at: dict[str, list[str]] = {}
    for name in (name for name in made if surfaces[name] == surface):
        at.setdefault(made[name].place or name, []).append(name)
    others = {name for name in made if surfaces[name] != surface}
    n_others = len({surfaces[name] for name in others})
    if not n_others or len(at) < 2:
        return PlaceAccuracy(len(at), 0, others=n_others)
    recipe = load_recipe(RECIPE)
    plain = replace(recipe.augmentation, copies=0)
    recipe = replace(recipe, learner=Discriminant(shrinkage=SHRINKAGE), augmentation=plain)
    labels: Counter[str] = Counter()
    bands: dict[float, list[tuple[bool, bool]]] = {far_m: [] for far_m in BANDS_M}
    for place, names in at.items():
        before: frozenset[str] = frozenset()
        for gap_m in GAPS_M:
            distances_m = {other: _distance_m(place, other) for other in at if other != place}
            kept = frozenset(other for other, distance_m in distances_m.items() if not distance_m < gap_m)
            if not kept or kept == before:
                continue
            # Train without the place and its neighbours, and recognise the slides there.
            trained = others | {name for other in kept for name in at[other]}
            model = train(recipe, features.of_slides(trained))
            ends = [one.end for one in predict_slides(model, features.of_slides(names)).values()]
            label = Counter(end.label for end in ends).most_common(1)[0][0]
            if not before:
                labels[label] += 1
            correct, nearest_m = label == surface, min(distances_m[other] for other in kept)
            far_m = next((far_m for far_m in BANDS_M if nearest_m <= far_m), None)
            if far_m:
                bands[far_m].append((correct, correct and all(end.accepted for end in ends)))
            before = kept
    right = labels.pop(surface, 0)
    counted = tuple(Band(far_m, len(x), *np.sum(x, axis=0).tolist()) for far_m, x in bands.items() if x)
    tested = right + labels.total()
    return PlaceAccuracy(tested, right, labels.most_common(1)[0][0] if labels else '', n_others, counted)


def _distance_m(place: str, other: str) -> float:
    """Return how far two places are from each other, as their names show; NaN where they show none."""
    found = AT.match(place), AT.match(other)
    if None in found:
        return math.nan
    one, two = ([float(number) for number in match.groups()] for match in found if match)
    return 1e-3 * math.dist(one, two)


# --------------------
# The collection itself.

EVERY = 3  # places after which it is evaluated
FAILURES = 3  # in a row end it
UNCOUNTED = (
    'fewer than slides, as a slide near another, or without a whole window (short, or samples lost), adds no place'
)
ASKED_TO_END = {ExplorationError.STOPPED, ExplorationError.CANCELLED, ExplorationError.NOT_ACTIVE}


@dataclass(frozen=True)
class CollectionEnd:
    """How it ended: why it is no success, in a sentence, the number of slides, and the last accuracy."""

    error: CollectionError
    message: str
    slides: int
    accuracy: PlaceAccuracy = PlaceAccuracy(0, 0)


def collect(
    plan: PlacePlan,
    params: CollectionParams,
    explore: Callable[[ExplorationRequest], tuple[ExplorationError, str]],
    evaluate_all: Callable[[], PlaceAccuracy],
    tell: Callable[[str, int], None],
) -> CollectionEnd:
    """Touch place after place until the bound is met, the places are used up, or it cannot or must not continue.

    Ctrl-C, a recorder that ends and recordings that cannot be read are also such ends: the slides so far count. So is
    a MotionAborted of `explore`: after it the finger may still press, and must not be moved.
    """
    slides, failures, accuracy = 0, 0, PlaceAccuracy(0, 0)

    def ended(error: CollectionError, message: str) -> CollectionEnd:
        return CollectionEnd(error, message, slides, accuracy)

    try:
        while slides < params.most_places:
            error, fault = explore(plan.next())
            if error in ASKED_TO_END:
                return ended(CollectionError.STOPPED, fault)
            if error:
                failures += 1
                tell(f'a touch failed: {fault}', slides)
                if failures == FAILURES:
                    last = f'{FAILURES} touches in a row failed, the last: {fault}'
                    return ended(CollectionError.MOTION_FAILED, last)
                continue
            slides, failures = slides + 1, 0
            # Each evaluation trains once for each place; the first and the last possible end are always evaluated.
            if slides % EVERY and slides not in (params.places, params.most_places):
                continue
            accuracy = evaluate_all()
            if accuracy.quiet:
                break
            fewer = max(0, slides - accuracy.places)
            tell(f'{accuracy.sentence}{f"; {fewer} {UNCOUNTED}" * bool(fewer)}', slides)
            # The first surface of a folder has nothing to be distinguished from.
            met = accuracy.bound >= params.bound if accuracy.others else True
            if slides >= params.places and met:
                return ended(CollectionError.NONE, accuracy.sentence)
    except KeyboardInterrupt as stop:
        return ended(CollectionError.CANCELLED, f'stopped: {stop}' if str(stop) else 'stopped')
    except (TextureError, OSError) as error:
        moved = isinstance(error, MotionAborted)
        return ended(CollectionError.MOTION_FAILED if moved else CollectionError.NOT_RECORDED, str(error))
    missing = f'; the bound of {100 * params.bound:.0f} % is not met: '
    missing += (
        f'also collect {accuracy.confused} at more places, use other speeds and forces, or add slow channels'
        if accuracy.confused
        else 'allow more places'
    )
    return ended(CollectionError.BOUND_MISSED, accuracy.quiet or accuracy.sentence + missing)


def next_bag(folder: Path, surface: str) -> Path:
    """Return the next bag of a surface in a folder: 'oak', 'oak-2', 'oak-3' and so on."""
    names = (surface if number == 1 else f'{surface}-{number}' for number in count(1))
    return next(bag for name in names if not (bag := folder / name).exists())
