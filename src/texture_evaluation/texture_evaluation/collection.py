# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Collect slides of a surface at many places: where to touch next, how well left-out places are told, when to end."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import beta

from texture_core.config import param
from texture_core.errors import CollectionError, ExplorationError, InvalidData, InvalidParameter, TextureError
from texture_core.types import Array, ExplorationRequest, checked_label
from texture_estimation.learners.discriminant import linear_discriminant
from texture_features.feature_set import LabelledFeatures, SlideConditions

# --------------------
# What is asked for.


SHORTEST_S = 0.6  # of a slide: one window, and what starts late


@dataclass(frozen=True)
class CollectionParams:
    """How a surface is collected; the places lie on the taught patch."""

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
    bound: float = param(
        0.6, 'Fraction of new places right that must be shown, as a lower 90 % bound.', low=0.0, high=0.99
    )
    seed: int = param(0, 'Seed of places and directions.', low=0)

    def __post_init__(self) -> None:
        for low, high in (
            ('places', 'most_places'),
            ('speed_low_m_s', 'speed_high_m_s'),
            ('force_low_n', 'force_high_n'),
        ):
            if getattr(self, low) > getattr(self, high) > 0:  # 0 is chosen later
                raise InvalidParameter(
                    f"'{low}' is {getattr(self, low):g}; it must not be above '{high}', {getattr(self, high):g}"
                )


@dataclass(frozen=True)
class Patch:
    """A rectangle in the surface frame, m."""

    x_low_m: float
    x_high_m: float
    y_low_m: float
    y_high_m: float


UNLIMITED = (0.0, math.inf)
# By the names of the lowest and the highest: the usual lowest, so many times which is the usual highest, and the unit.
USUAL = {('force_low_n', 'force_high_n'): (1.0, 2.0, 'N'), ('speed_low_m_s', 'speed_high_m_s'): (0.02, 2.5, 'm/s')}


def fitted_range(params: CollectionParams, names: tuple[str, str], allowed: tuple[float, float]) -> tuple[float, float]:
    """Return the lowest and highest force or speed; what was not asked for is fitted into what the explorer allows."""
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
PLASTIC = 0.7548776662466927  # the same for a second sequence beside it (Roberts 2018)


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
        self._surface, self._params, self._patch = checked_label(surface), params, patch
        if not self._surface:
            raise InvalidData('no surface was named; give the label of what is collected')
        forces, speeds = USUAL
        self._forces_n = fitted_range(params, forces, allowed_forces_n)
        self._speeds_m_s = fitted_range(params, speeds, allowed_speeds_m_s)
        highest_m_s = self._speeds_m_s[1]
        if (shortest_s := params.distance_m / highest_m_s) < SHORTEST_S:
            raise InvalidParameter(
                f"a slide of 'distance_m' {params.distance_m:g} m lasts {shortest_s:.2f} s at {highest_m_s:g} m/s; "
                f'{SHORTEST_S:g} s are needed to recognise it'
            )
        self._rng = np.random.default_rng(params.seed)
        self._middles: list[Array] = []
        if not self._candidates(CANDIDATES):
            raise InvalidData(
                f'no slide of {params.distance_m:g} m with its ramps lies on the patch, which is '
                f'{patch.x_high_m - patch.x_low_m:g} m by {patch.y_high_m - patch.y_low_m:g} m; ask for shorter '
                'slides, or teach a larger patch'
            )

    def next(self) -> ExplorationRequest:
        """Return the next touch."""
        number, params = len(self._middles), self._params
        found = self._candidates(CANDIDATES)
        # The constructor has seen that some fit; on a narrow patch few of a draw do.
        while not found:
            found = self._candidates(CANDIDATES)
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

    def _candidates(self, count: int) -> list[tuple[float, float, float, Array]]:
        """Return places, directions and middles of slides that lie on the patch with their ramps."""
        patch, reach_m = self._patch, (1.0 + EDGE) * self._params.distance_m
        low, high = np.array([patch.x_low_m, patch.y_low_m]), np.array([patch.x_high_m, patch.y_high_m])
        starts = self._rng.uniform(low, high, (count, 2))
        angles = self._rng.uniform(-math.pi, math.pi, count)
        ways = reach_m * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        fits = np.all((starts + ways >= low) & (starts + ways <= high), axis=1)
        return [
            (float(start[0]), float(start[1]), float(angle), start + way / 2)
            for start, way, angle in zip(starts[fits], ways[fits], angles[fits], strict=True)
        ]


def _between(low: float, high: float, fraction: float) -> float:
    return float(low * (high / low) ** fraction)  # equal ratios apart, not equal steps


# --------------------
# How well places are told that were left out of a training on all others.

SHRINKAGE = 0.5  # few slides tell no correlations
CONFIDENCE = 0.9


@dataclass(frozen=True)
class PlaceAccuracy:
    """What a quick classifier says of places that it was not trained at."""

    places: int
    right: int
    confused: str = ''
    others: int = 0

    @property
    def bound(self) -> float:
        """Lower 90 % bound of the fraction of new places right; 0 without other surfaces. Clopper & Pearson 1934."""
        if not self.others or not self.right:
            return 0.0
        return float(beta.ppf(1.0 - CONFIDENCE, self.right, self.places - self.right + 1))

    @property
    def sentence(self) -> str:
        """What is known so far."""
        if not self.others:
            return f'{self.places} places; no other surface is in the folder yet to tell it from'
        taken = f', mostly taken for {self.confused}' if self.confused else ''
        return (
            f'{self.right} of {self.places} left-out places right{taken}; at new places at least '
            f'{100 * self.bound:.0f} % (90 % bound), against {self.others} other surfaces'
        )


def evaluate_places(features: LabelledFeatures, surface: str) -> PlaceAccuracy:
    """Return how a discriminant tells the places of a surface, each left out in turn, from all other surfaces."""
    own = features.labels == surface
    made = {name: features.conditions.get(name, SlideConditions()) for name in np.unique(features.groups).tolist()}
    places = np.array([made[name].place or name for name in features.groups.tolist()])
    names = np.unique(np.append(features.labels, surface))
    codes = np.searchsorted(names, features.labels)
    where = np.unique(places[own])
    if len(names) < 2 or len(where) < 2:
        return PlaceAccuracy(len(where), 0, others=len(names) - 1)
    taken: Counter[str] = Counter()
    for place in where:
        left = own & (places == place)
        weights, offsets = linear_discriminant(features.values[~left], codes[~left], len(names), SHRINKAGE)
        scores = (features.values[left] @ weights + offsets).mean(axis=0)
        taken[str(names[int(scores.argmax())])] += 1
    right = taken.pop(surface, 0)
    return PlaceAccuracy(len(where), right, taken.most_common(1)[0][0] if taken else '', len(names) - 1)


# --------------------
# The collection itself.

EVERY = 3  # places after which it is judged
FAILURES = 3  # in a row end it
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
    evaluate_all: Callable[[int], PlaceAccuracy],
    tell: Callable[[str, int], None],
) -> CollectionEnd:
    """Touch place after place until the bound is met, the places are used up, or it cannot or shall not go on.

    Ctrl-C, a recorder that ends and recordings that cannot be read are such ends, too: the slides so far count.
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
            # Each judgement trains once for each place; the first and the last possible end are always judged.
            if slides % EVERY and slides not in (params.places, params.most_places):
                continue
            accuracy = evaluate_all(slides)
            tell(accuracy.sentence, slides)
            # The first surface of a folder has nothing to be told from.
            met = accuracy.bound >= params.bound if accuracy.others else True
            if slides >= params.places and met:
                return ended(CollectionError.NONE, accuracy.sentence)
    except KeyboardInterrupt as stop:
        return ended(CollectionError.CANCELLED, f'stopped: {stop}' if str(stop) else 'stopped')
    except (TextureError, OSError) as error:
        return ended(CollectionError.NOT_RECORDED, str(error))
    missing = f'; the bound of {100 * params.bound:.0f} % is not met: '
    missing += (
        f'collect {accuracy.confused} at more places, too, or other speeds and forces, or add slow channels'
        if accuracy.confused
        else 'allow more places'
    )
    return ended(CollectionError.BOUND_MISSED, accuracy.sentence + missing)


def next_bag(existing: Sequence[str], surface: str) -> str:
    """Return the name of the next bag of a surface: 'oak', 'oak-2', 'oak-3' and so on."""
    number = 1
    while (name := surface if number == 1 else f'{surface}-{number}') in existing:
        number += 1
    return name
