# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Known or not, decided or not: novelty, stopping rule, prediction sets, confidence floor, error bound, domain."""

from __future__ import annotations

import math
import sys
from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import InvalidData
from texture_core.types import Array
from texture_estimation.learners.learner import Codes, shrunk_covariance
from texture_features.feature_set import RunningConditions, SlideConditions
from texture_features.windows import Interval

Mask = NDArray[np.bool_]

# --------------------
# Distance of the mean features of a slide to the training slides of one class.

# Chosen on slides 1-24 against 25-30 of recorded materials, five of twenty left out of the training.
NEAREST = 3  # slides to which the distance counts: one alone may be an odd one
SHRINKAGE = 0.6  # of the covariances towards their diagonals: there are hardly more slides than features
FLOOR = 0.18  # of the mean variance within classes, added to each
MAX_DIRECTIONS = 128  # in which slides are compared: those in which classes differ most; more cost time
SMALLEST = 1e-9  # variance within classes, in that of all: slides that are the same to the last bit


@dataclass(frozen=True, eq=False)
class ClassDistance:
    """Squared distance to the nearest slides of a class, less that to the centre of all classes.

    The metric is that of the covariance within classes, as in probabilistic linear discriminant analysis.

    Source: Ioffe 2006, "Probabilistic linear discriminant analysis", with slides in place of the mean of a class.
    """

    projection: Array
    references: Array
    classes: Codes
    centre: Array
    weights: Array

    @classmethod
    def fit(cls, means: Array, classes: Codes) -> ClassDistance:
        """Fit to the means of slides (n_slides, n_features) and the numbers of their classes (n_slides,)."""
        from scipy.linalg import eigh  # noqa: PLC0415  # takes 0.3 s, and only training needs it

        names, codes = np.unique(classes, return_inverse=True)
        scale = means.std(axis=0)
        scale[scale <= 1e-12 * np.abs(means).max(axis=0)] = np.inf  # what is constant tells nothing
        scaled = means / scale
        own = np.stack([scaled[codes == code].mean(axis=0) for code in range(len(names))])
        centre = own.mean(axis=0)
        apart, between_classes = scaled - own[codes], own - centre
        within = shrunk_covariance(apart.T @ apart / max(len(means) - len(names), 1), SHRINKAGE)
        floor = FLOOR * max(float(np.diag(within).mean()), SMALLEST)
        between = shrunk_covariance(between_classes.T @ between_classes / max(len(names) - 1, 1), SHRINKAGE)
        spread, directions = eigh(between, within + floor * np.eye(len(within)))
        spread, directions = spread[-MAX_DIRECTIONS:], directions[:, -MAX_DIRECTIONS:]
        order = np.argsort(classes, kind='stable')
        return cls(
            projection=directions / scale[:, None],
            references=(scaled @ directions)[order],
            classes=classes[order],
            centre=centre @ directions,
            weights=1.0 / (1.0 + np.maximum(spread, 0.0)),
        )

    @cached_property
    def _own(self) -> dict[int, tuple[Array, Array]]:
        """Slides of each class relative to the centre, (n_directions, n_own), and half their squares, (n_own,)."""
        found = {}
        for code in np.unique(self.classes).tolist():
            own = self.references[self.classes == code] - self.centre
            found[code] = (own.T, 0.5 * np.einsum('ij,ij->i', own, own))
        return found

    @cached_property
    def _directions(self) -> Array:
        """Projection by columns: so a product with one slide is faster."""
        return np.asfortranarray(self.projection)

    @cached_property
    def _nearer(self) -> Array:
        """What the square along each direction counts less about the centre than about a slide, (n_directions,)."""
        return 1.0 - self.weights

    def score(self, mean: Array, code: int) -> Array:
        """Return the score, (...), of mean features (..., n_features) for a class; infinite without its slides."""
        found = self._own.get(code)
        if found is None:
            return np.full(mean.shape[:-1], np.inf)
        own, half_squares = found
        away = mean @ self._directions
        away -= self.centre
        # Half the squared distances, less half the square of what is away from the centre.
        halves = half_squares - away @ own
        if halves.shape[-1] > NEAREST:
            halves.partition(NEAREST - 1)
            halves = halves[..., :NEAREST]
        nearest: Array = np.add.reduce(halves, axis=-1) * (2.0 / halves.shape[-1])
        nearest += (away * away) @ self._nearer
        return nearest

    def with_slides(self, means: Array, classes: Codes) -> ClassDistance:
        """Return the distance with more reference slides, (n_slides, n_features) and (n_slides,)."""
        references = np.concatenate([self.references, means @ self.projection])
        every = np.concatenate([self.classes, classes])
        order = np.argsort(every, kind='stable')
        return ClassDistance(self.projection, references[order], every[order], self.centre, self.weights)


# --------------------
# The smallest confidence that a slide over a known surface has, by the length of its evidence.

# Lengths of evidence at which it is fitted, in windows that do not overlap. Up to the last one the confidence of known
# slides grows, which tells them from disturbed slides that resemble two textures.
FLOOR_WINDOWS = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0)
LARGEST = 1.0 - sys.float_info.epsilon  # confidence whose log-odds are finite


@dataclass(frozen=True)
class ConfidenceFloor:
    """Smallest confidence of the best label with which a surface is taken for known.

    A slide that resembles two textures after much evidence is like no slide of the training, even if it is near to the
    slides of both.

    Source: Hendrycks & Gimpel 2017 for the confidence as a novelty score; Vovk, Gammerman & Shafer 2005 for its limit.
    """

    effective_window_counts: tuple[float, ...] = ()
    log_odds: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        counts = self.effective_window_counts
        ascending = all(earlier < later for earlier, later in pairwise(counts))
        if len(counts) != len(self.log_odds) or not ascending or not all(map(math.isfinite, (*counts, *self.log_odds))):
            raise InvalidData(
                f'confidence_floor has {len(counts)} effective_window_counts and {len(self.log_odds)} log_odds; '
                'as many of both are needed, finite, the counts ascending'
            )

    def reached(self, confidence: float, effective_windows: float) -> bool:
        """Return whether a known surface may have so little confidence."""
        return not self.log_odds or confidence >= 1.0 / (1.0 + math.exp(-self._at(effective_windows)))

    def _at(self, effective_windows: float) -> float:
        """Return the log-odds, linear between two lengths of evidence."""
        counts = self.effective_window_counts
        after = bisect_right(counts, effective_windows)
        if after == 0 or after == len(counts):
            return self.log_odds[max(after - 1, 0)]
        low, high = self.log_odds[after - 1 : after + 1]
        return low + (high - low) * (effective_windows - counts[after - 1]) / (counts[after] - counts[after - 1])


def fit_confidence_floor(courses: Sequence[SlideCourse], rate: float, max_error_rate: float = 1.0) -> ConfidenceFloor:
    """Return the limit that a fraction of the slides over known surfaces stays below, and all but few wrong labels."""
    undisturbed = [course for course in courses if not course.disturbance]
    right = [course for course in undisturbed if course.right[-1]]
    rank = int((len(right) + 1) * rate)
    if not rank and max_error_rate >= 1.0:
        return ConfidenceFloor()
    log_odds = []
    for length in FLOOR_WINDOWS:
        limit = 0.0
        if rank:
            limit = np.sort([course.confidences[course.place(length)] for course in right])[rank - 1]
        if max_error_rate < 1.0:
            wrong = np.sort([course.error_at(length) for course in undisturbed])[::-1]
            limit = max(limit, math.nextafter(wrong[min(int(len(wrong) * max_error_rate), len(wrong) - 1)], 1.0))
        limit = min(max(float(limit), 1.0 - LARGEST), LARGEST)
        log_odds.append(math.log(limit / (1.0 - limit)))
    return ConfidenceFloor(FLOOR_WINDOWS, tuple(log_odds))


# --------------------
# How far beyond the trained conditions a slide may be made.


@dataclass(frozen=True)
class DomainMargins:
    """How far an exploration may lie outside the conditions of the training."""

    speed: float = 0.15
    force: float = 0.3
    direction_rad: float = 0.35
    level: float = 1.0

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not 0.0 <= value < math.inf:
                raise InvalidData(f'the margin {name} of a domain is {value}; 0 or a positive number is needed')


# --------------------
# How small an error rate the slides held out of a training can show.

SIGNIFICANCE = 0.05  # the error rate exceeds its upper bound in so many of all trainings
MAX_SLIDES = 1_000_000


@dataclass(frozen=True)
class ErrorBound:
    """Upper 95 % bound of the error rate of decisions when none of the held-out slides was decided wrongly.

    Few slides show little, however confident the classifier is in each: without an error in n slides the error rate may
    still be 1 - 0.05^(1/n), about 3/n. No confidence above the rest is reported, and no slide is ended early where the
    allowed error rate lies below the bound.

    Source: Hanley & Lippman-Hand 1983 for the rule of three; Clopper & Pearson 1934 for the bound.
    """

    slides: int
    max_error_rate: float

    def __post_init__(self) -> None:
        if not (0 <= self.slides <= MAX_SLIDES and 0.0 <= self.max_error_rate <= 1.0):
            raise InvalidData(
                f'error_bound has slides {self.slides} and max_error_rate {self.max_error_rate}; it needs slides, '
                f'0 to {MAX_SLIDES}, and max_error_rate, 0 to 1'
            )

    @cached_property
    def highest_confidence(self) -> float:
        """Largest confidence that the held-out slides can show; 1 if none was held out: nothing is calibrated then."""
        return float(SIGNIFICANCE ** (1.0 / self.slides)) if self.slides else 1.0

    @cached_property
    def slides_needed(self) -> float:
        """Smallest number of held-out slides that can show the allowed error rate; infinite if no error is allowed."""
        if self.max_error_rate >= 1.0:
            return 0
        if self.max_error_rate <= 0.0:
            return math.inf
        return math.ceil(math.log(SIGNIFICANCE) / math.log1p(-self.max_error_rate))

    @cached_property
    def shown(self) -> bool:
        """Whether the held-out slides can show the allowed error rate."""
        return self.slides >= self.slides_needed

    @property
    def reason(self) -> str:
        """Why no slide is ended early, in one sentence; '' if slides are."""
        if self.shown:
            return ''
        rate = f'at most {100.0 * self.max_error_rate:g} % wrong decisions'
        if math.isinf(self.slides_needed):
            return f'no early stopping: {rate} cannot be shown'
        limit = f'; with {self.slides} the confidence is {self.highest_confidence:.2f} at most' if self.slides else ''
        needed = f'{self.slides_needed:g} slides or more to be held out of the training'
        return f'too few slides for early stopping: {rate} need {needed}{limit}'

    def limited(self, probabilities: Sequence[float]) -> Sequence[float]:
        """Return the probabilities, mixed with equal ones just so much that none is above the highest confidence."""
        equal, highest = 1.0 / len(probabilities), max(probabilities)
        limit = max(self.highest_confidence, equal)
        if highest <= limit:
            return probabilities
        kept = (limit - equal) / (highest - equal)
        return [equal + kept * (probability - equal) for probability in probabilities]


# --------------------
# Intervals of conditions and arcs of directions that slides cover.

# Of the slides, at either end of a range: with a hundred slides or more, one odd slide does not widen it.
ODD_SHARE = 0.01
FULL_CIRCLE: Interval = (-math.pi, math.pi)


def covered_arcs(directions_rad: Iterable[float], gap_rad: float) -> tuple[Interval, ...]:
    """Return the arcs that directions cover when gaps of at most `gap_rad` between neighbours count as covered."""
    ordered = sorted({math.remainder(direction, math.tau) for direction in directions_rad})
    if not ordered:
        return ()
    turned = [*ordered[1:], ordered[0] + math.tau]
    ends = [place for place, (one, other) in enumerate(zip(ordered, turned, strict=True)) if other - one > gap_rad]
    if not ends:
        return (FULL_CIRCLE,)
    starts = [ordered[(end + 1) % len(ordered)] for end in (ends[-1], *ends[:-1])]
    return tuple(
        (start, ordered[end] if ordered[end] >= start else ordered[end] + math.tau)
        for start, end in zip(starts, ends, strict=True)
    )


def joint_interval(trained: Interval | None, added: Interval | None) -> Interval | None:
    """Return the range of the training with that of added slides; None if the training knew none."""
    if trained is None or added is None:
        return trained
    return min(trained[0], added[0]), max(trained[1], added[1])


def interval_of(means: Iterable[Iterable[float]]) -> Interval | None:
    """Return the range of the means of slides without the odd slides; None if no slide has a known one."""
    known = [own for slide in means for own in [[mean for mean in slide if math.isfinite(mean)]] if own]
    if not known:
        return None
    low = np.quantile([min(own) for own in known], ODD_SHARE, method='lower')
    high = np.quantile([max(own) for own in known], 1.0 - ODD_SHARE, method='higher')
    return float(low), float(high)


def is_beyond(value: float, interval: Interval | None, margin: float) -> bool:
    """Return whether a value lies outside an interval widened by a relative margin; False for an unknown one."""
    if interval is None or math.isnan(value):
        return False
    low, high = interval
    return not low / (1.0 + margin) <= value <= high * (1.0 + margin)


# --------------------
# The domain of a model: under which conditions it was trained, and whether an exploration lies within them.

# Motions whose direction turns within a window: they cover all directions, and theirs is not compared.
TURNING_MOTIONS = ('circular',)
REPLAYS = 'file/'  # a sensor that replays a file is named after the file, not after what measured
OUTSIDE = 'outside what was trained'
ONE_PLACE = 'trained at one place of each surface: elsewhere it may be rejected'
REACH = {'sessions': 'session', 'places': 'place', 'fingers': 'sensor'}  # and what tells them of a slide


@dataclass(frozen=True)
class Domain:
    """The conditions under which a model was trained; what was unknown in the training is not compared.

    A range goes from the lowest to the highest mean over the first windows of the slides, however many: speed and force
    settle at the start of a slide, and an exploration is compared by the mean over its windows so far. Between two
    trained speeds or forces a model is within its domain.
    """

    motions: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    speed_m_s: Interval | None = None
    force_n: Interval | None = None
    directions_rad: tuple[Interval, ...] = ()
    levels: Mapping[str, Interval] = field(default_factory=dict)
    slides: Mapping[str, int] = field(default_factory=dict)
    margins: DomainMargins = field(default_factory=DomainMargins)
    reach: Mapping[str, Mapping[str, int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        ranges = {'speed_m_s': self.speed_m_s, 'force_n': self.force_n, **self.levels}
        for name, interval in ranges.items():
            if interval is not None and not 0.0 <= interval[0] <= interval[1] < math.inf:
                raise InvalidData(f'{name} of a domain is {interval}; two numbers from 0 on in rising order are needed')
        for start, end in self.directions_rad:
            if not (math.isfinite(start) and 0.0 <= end - start <= math.tau):
                raise InvalidData(f'an arc of a domain goes from {start} to {end} rad; at most one turn is needed')

    @classmethod
    def of_slides(
        cls, conditions: Iterable[SlideConditions], labels: Iterable[str], margins: DomainMargins | None = None
    ) -> Domain:
        """Return the domain of a model that is trained on slides."""
        slides, labels = tuple(conditions), tuple(labels)
        margins = margins or DomainMargins()
        return cls(
            motions=_names(slide.motion for slide in slides),
            sensors=_names(slide.sensor for slide in slides if not slide.sensor.startswith(REPLAYS)),
            speed_m_s=interval_of((slide.speed_m_s, *slide.speed_range_m_s) for slide in slides),
            force_n=interval_of((slide.force_n, *slide.force_range_n) for slide in slides),
            directions_rad=_directions(slides, margins.direction_rad),
            levels=_levels(slides),
            slides=dict(Counter(labels)),
            margins=margins,
            reach=_reach(slides, labels),
        )

    @property
    def reach_reason(self) -> str:
        """Where slides may be rejected as the training knew nothing else, in one sentence; '' if it is not known."""
        if not self.reach or any(own['places'] > 1 or own['sessions'] > 1 for own in self.reach.values()):
            return ''
        return ONE_PLACE

    def widened(self, conditions: Sequence[SlideConditions], labels: Iterable[str]) -> Domain:
        """Return the domain with slides that were added after the training.

        They widen what is known of the training; what was unknown there is still not compared.
        """
        new = Domain.of_slides(conditions, labels, self.margins)
        return replace(
            self,
            motions=_names((*self.motions, *new.motions)) if self.motions else (),
            sensors=_names((*self.sensors, *new.sensors)) if self.sensors else (),
            speed_m_s=joint_interval(self.speed_m_s, new.speed_m_s),
            force_n=joint_interval(self.force_n, new.force_n),
            directions_rad=(*self.directions_rad, *new.directions_rad) if self.directions_rad else (),
            levels={name: joint_interval(own, new.levels.get(name)) or own for name, own in self.levels.items()},
            slides=dict(Counter(self.slides) + Counter(new.slides)),
        )

    def deviation(self, conditions: SlideConditions | RunningConditions) -> str:
        """Return how an exploration lies outside this domain, in one sentence; '' if it lies within."""
        found = '; '.join(self._deviations(conditions))
        return f'{OUTSIDE}: {found}' if found else ''

    def _deviations(self, conditions: SlideConditions | RunningConditions) -> Iterator[str]:
        speed, force = conditions.speed_m_s, conditions.force_n
        if is_beyond(speed, self.speed_m_s, self.margins.speed):
            yield f'speed {speed:.3g} m/s, trained {_range(self.speed_m_s)} m/s'
        if is_beyond(force, self.force_n, self.margins.force):
            yield f'force {force:.3g} N, trained {_range(self.force_n)} N'
        if self.motions and conditions.motion and conditions.motion not in self.motions:
            yield f"motion '{conditions.motion}', trained {_listed(self.motions)}"
        sensor = '' if conditions.sensor.startswith(REPLAYS) else conditions.sensor
        if self.sensors and sensor and sensor not in self.sensors:
            yield f"sensor '{sensor}', trained {_listed(self.sensors)}"
        for direction in self._untrained_directions(conditions)[:1]:
            yield f'direction {direction:.3g} rad, trained {" and ".join(map(_range, self.directions_rad))} rad'
        for channel, rms, *_ in conditions.levels:
            trained = self.levels.get(channel)
            if is_beyond(rms, trained, self.margins.level):
                yield f'signal level {rms:.3g} of {channel}, trained {_range(trained)}'

    def _untrained_directions(self, conditions: SlideConditions | RunningConditions) -> list[float]:
        """Return the directions of a slide outside the arcs; none where directions are not compared."""
        if not self.directions_rad or conditions.motion in TURNING_MOTIONS:
            return []
        return [direction for direction in conditions.directions_rad if not self._covers(direction)]

    def _covers(self, direction_rad: float) -> bool:
        margin = self.margins.direction_rad
        for start, end in self.directions_rad:
            if (direction_rad - start + margin) % math.tau <= end - start + 2.0 * margin:
                return True
        return False


def _directions(slides: Sequence[SlideConditions], margin_rad: float) -> tuple[Interval, ...]:
    if any(slide.motion in TURNING_MOTIONS for slide in slides):
        return (FULL_CIRCLE,)
    return covered_arcs((angle for slide in slides for angle in slide.directions_rad), 2.0 * margin_rad)


def _reach(slides: Sequence[SlideConditions], labels: Sequence[str]) -> dict[str, dict[str, int]]:
    """Return how many sessions, places and fingers each label has; slides with a session each tell of none."""
    found = {}
    for label in dict.fromkeys(labels):
        own = [slide for slide, of in zip(slides, labels, strict=True) if of == label]
        names = {kind: {getattr(slide, name) for slide in own} for kind, name in REACH.items()}
        counts = {kind: len(each) for kind, each in names.items()}
        found[label] = {**counts, 'sessions': counts['sessions'] if counts['sessions'] < len(own) else 1}
    return found


def _levels(slides: Sequence[SlideConditions]) -> dict[str, Interval]:
    """Return the range of the signal level of each channel."""
    by_channel: defaultdict[str, list[list[float]]] = defaultdict(list)
    for slide in slides:
        for channel, *means in slide.levels:
            by_channel[channel].append(means)
    found = {channel: interval_of(means) for channel, means in by_channel.items()}
    return {channel: interval for channel, interval in found.items() if interval is not None}


def _names(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted({name for name in names if name}))


def _range(interval: Interval | None) -> str:
    low, high = (f'{value:.3g}' for value in interval or ())
    return low if low == high else f'{low} to {high}'


def _listed(names: Sequence[str]) -> str:
    return ', '.join(f"'{name}'" for name in names)


# --------------------
# Novelty detection: how rare a slide is among those of the class for which it is taken.

# Lengths of evidence at which tails and thresholds are fitted, in windows that do not overlap. The start of a slide is
# like no other part, so slides are compared by the same stretch: by all that was measured, up to the last of these.
NOVELTY_WINDOWS = (1.0, 1.5, 2.0, 3.0, 5.0)
# Spaces in which a slide is compared with the slides of its class, and the length of its start that is compared. The
# first windows of slides are compared by themselves, as this shows soonest that something differs.
FEATURES, HIDDEN, ONSET = 'features', 'hidden', 'onset'
SPACES: Mapping[str, float] = {FEATURES: NOVELTY_WINDOWS[-1], HIDDEN: NOVELTY_WINDOWS[-1], ONSET: 1.5}
# Negative log-odds of the best to the second label, and the negative fraction of the windows that agree with the best.
LOG_ODDS, AGREEMENT = 'log_odds', 'agreement'
OTHER_SCORES = (LOG_ODDS, AGREEMENT)
SCORES = (*SPACES, *OTHER_SCORES)
TAIL_QUANTILE = 0.9
MIN_SPREAD = 1e-6  # of a score, relative to its median: slides that are all the same
LEAST_AGREEMENT_SPREAD = 0.1  # in most slides all windows may agree, which makes one that does not no novelty
UNCOUNTED_SPREAD = 1e30  # of a score that is left out: its tail is zero


@dataclass(frozen=True, eq=False)
class NoveltyDetector:
    """Sum of the one-sided tails of several scores, and the threshold above which the surface is unknown.

    Each score is compared with those of training slides when they were held out and labelled rightly: what exceeds the
    median counts in units of the distance from the median to the 90 % quantile, which is the negative logarithm of an
    exponential tail but for a factor; what lies below counts nothing, so no score makes up for another. The thresholds
    are those of split conformal prediction.

    Source: Fisher 1932 for the sum of logarithms of tail probabilities; Vovk, Gammerman & Shafer 2005 for thresholds.
    """

    distances: Mapping[str, ClassDistance]
    medians: Array
    spreads: Array
    thresholds: Array
    distance_thresholds: Array
    distances_only: bool = False

    @classmethod
    def fit(
        cls,
        distances: Mapping[str, ClassDistance],
        held_out: Sequence[Array],
        false_rejection_rate: float,
        counted: Collection[str] = SCORES,
    ) -> NoveltyDetector:
        """Fit tails and thresholds."""
        medians = np.stack([np.median(scores, axis=0) for scores in held_out])
        spreads = np.stack([np.quantile(scores, TAIL_QUANTILE, axis=0) for scores in held_out]) - medians
        spreads = np.maximum(spreads, MIN_SPREAD * (1.0 + np.abs(medians)))
        if spreads.shape[1] == len(distances) + len(OTHER_SCORES):
            spreads[:, -1] = np.maximum(spreads[:, -1], LEAST_AGREEMENT_SPREAD)
            spreads[:, len(distances) :][:, [name not in counted for name in OTHER_SCORES]] = UNCOUNTED_SPREAD
        tails = [
            np.maximum(scores - median, 0.0) / spread
            for scores, median, spread in zip(held_out, medians, spreads, strict=True)
        ]
        thresholds, distance_thresholds = (
            np.array([_conformal(tail[:, :count].sum(axis=1), false_rejection_rate) for tail in tails])
            for count in (None, len(distances))
        )
        return cls(distances, medians, spreads, thresholds, distance_thresholds)

    @cached_property
    def _levels(self) -> list[tuple[float, ...]]:
        """By level, one number after the other: threshold, then medians, then spreads of the scores that count."""
        count = len(self.distances) if self.distances_only else self.medians.shape[1]
        thresholds = self.distance_thresholds if self.distances_only else self.thresholds
        table = np.column_stack([thresholds, self.medians[:, :count], self.spreads[:, :count]])
        return [tuple(row) for row in table.tolist()]

    def novelty_score(self, scores: Sequence[float], effective_windows: float) -> float:
        """Return the novelty score from the scores of a slide after this effective window count."""
        return self.score_and_threshold(scores, effective_windows)[0]

    def threshold(self, effective_windows: float) -> float:
        """Return the largest novelty score of a known surface after this effective window count."""
        return self._row(effective_windows)[0]

    def score_and_threshold(self, scores: Sequence[float], effective_windows: float) -> tuple[float, float]:
        """Return the novelty score, and the largest one of a known surface."""
        row = self._row(effective_windows)
        count = len(row) // 2
        tails = zip(scores, row[1 : 1 + count], row[1 + count :], strict=False)
        return sum((score - median) / spread for score, median, spread in tails if score > median), row[0]

    def scores_and_thresholds(self, scores: Array, effective_windows: Array) -> tuple[Array, Array]:
        """Return what `score_and_threshold` does for each window of a slide, (n_windows,) each."""
        levels = np.array(self._levels)
        places = np.interp(effective_windows, NOVELTY_WINDOWS, np.arange(len(levels)))
        rows = np.minimum(places.astype(np.intp), len(levels) - 2)
        table = levels[rows] + (places - rows)[:, None] * (levels[rows + 1] - levels[rows])
        count = table.shape[1] // 2
        tails = np.maximum(scores[:, :count] - table[:, 1 : 1 + count], 0.0) / table[:, 1 + count :]
        return tails.sum(axis=1), table[:, 0]

    def _row(self, effective_windows: float) -> list[float]:
        """Return the row of `_levels`, linear between two levels."""
        after = bisect_right(NOVELTY_WINDOWS, effective_windows)
        if after == 0 or after == len(NOVELTY_WINDOWS):
            return list(self._levels[max(after - 1, 0)])
        low, high = NOVELTY_WINDOWS[after - 1], NOVELTY_WINDOWS[after]
        share = (effective_windows - low) / (high - low)
        pairs = zip(self._levels[after - 1], self._levels[after], strict=True)
        return [first + share * (second - first) for first, second in pairs]

    def with_slides(self, slides: Sequence[Mapping[str, Array]], classes: Codes) -> NoveltyDetector:
        """Return the detector of an incremental classifier, with added slides."""
        distances = {
            space: distance.with_slides(np.stack([means[space] for means in slides]), classes)
            for space, distance in self.distances.items()
        }
        return replace(self, distances=distances, distances_only=True)


class SlideNovelty:
    """Accumulate what the scores of one slide depend on, window by window."""

    def __init__(self, distances: Mapping[str, ClassDistance], n_labels: int) -> None:
        self._distances = distances
        self._sums: dict[str, Array] = {}
        self._counts = dict.fromkeys(distances, 0)
        self._votes = [0] * n_labels
        self._windows = 0
        # Sums stop changing after a few windows, that of the onset first, and the label rarely changes.
        self._found: dict[str, dict[int, float]] = {space: {} for space in distances}

    def add(self, values: Array, hidden: Array | None, label: int, effective_windows: float) -> None:
        """Add a window."""
        self._windows += 1
        self._votes[label] += 1
        if effective_windows > NOVELTY_WINDOWS[-1] + 1e-9 and self._sums:
            return
        for space in self._distances:
            if effective_windows > SPACES[space] + 1e-9 and self._counts[space]:
                continue
            own = hidden if space == HIDDEN and hidden is not None else values
            self._sums[space] = self._sums[space] + own if self._counts[space] else own
            self._counts[space] += 1
            self._found[space].clear()

    def scores(self, label: int, log_odds: float) -> list[float]:
        """Return the scores for a label: distances, then `OTHER_SCORES`; larger ones are rarer."""
        distances = [self._distance(space, label) for space in self._distances]
        return [*distances, -log_odds, -self._votes[label] / self._windows]

    def _distance(self, space: str, label: int) -> float:
        found = self._found[space]
        if label not in found:
            found[label] = float(self._distances[space].score(self._sums[space] / self._counts[space], label))
        return found[label]


def slide_scores(
    distances: Mapping[str, ClassDistance],
    values: Array,
    hidden: Array | None,
    evidence: Array,
    *,
    means: Array,
    effective_windows: Array,
) -> Array:
    """Return what `SlideNovelty` gives window by window for a whole slide at once, (n_windows, n_scores)."""
    counts = np.arange(1, len(values) + 1)
    labels = means.argmax(axis=1)
    highest = np.sort(means, axis=1)[:, -2:]
    votes = np.cumsum(evidence.argmax(axis=1)[:, None] == np.arange(means.shape[1]), axis=0)
    scores = np.empty((len(values), len(distances) + len(OTHER_SCORES)))
    scores[:, -2] = highest[:, 0] - highest[:, 1]
    scores[:, -1] = -votes[counts - 1, labels] / counts
    for column, (space, distance) in enumerate(distances.items()):
        own = hidden if space == HIDDEN and hidden is not None else values
        summed = max(1, int(np.searchsorted(effective_windows, SPACES[space] + 1e-9, side='right')))
        starts = np.cumsum(own[:summed], axis=0) / counts[:summed, None]
        for label in set(labels.tolist()):
            taken = labels == label
            scores[taken, column] = distance.score(starts, label)[np.minimum(counts[taken], summed) - 1]
    return scores


def space_means(values: Array, hidden: Array | None, hop_share: float) -> dict[str, Array]:
    """Return the mean of the windows of a slide in each space."""
    by_space = {FEATURES: values, HIDDEN: hidden, ONSET: values}
    return {
        space: own[: window_count(SPACES[space], hop_share)].mean(axis=0)
        for space, own in by_space.items()
        if own is not None
    }


def window_count(effective_windows: float, hop_share: float) -> int:
    """Return how many windows count as so many that do not overlap."""
    return 1 + round((effective_windows - 1.0) / hop_share)


def _conformal(novelty_scores: Array, false_rejection_rate: float) -> float:
    rank = max(1, int((len(novelty_scores) + 1) * false_rejection_rate))
    return float(np.sort(novelty_scores)[-rank])


# --------------------
# Conformal prediction sets: the smallest sets of textures with a given coverage.

ROUNDING = 1e-9
SETS_WINDOWS = (1.0, 2.0, 4.0, 8.0)  # lengths of evidence at which it is fitted, in windows that do not overlap


@dataclass(frozen=True)
class PredictionSets:
    """Split conformal prediction: textures at least as probable as the true one is in all but a few held-out slides.

    The coverage holds on average over slides like those held out; not for each texture, and not for a later day.

    Source: Vovk, Gammerman & Shafer 2005; Angelopoulos & Bates 2021, section 1.
    """

    coverage: float = 0.95
    effective_window_counts: tuple[float, ...] = ()
    thresholds: tuple[float, ...] = ()

    @property
    def reason(self) -> str:
        """Why there are no sets, in one sentence; '' if there are."""
        if self.thresholds:
            return ''
        return (
            f'too few slides for a prediction set: a coverage of {100 * self.coverage:g} % needs '
            f'{slides_for_coverage(self.coverage)} slides or more to be held out of the training'
        )

    def members(self, probabilities: Array, effective_windows: float) -> list[int]:
        """Return the numbers of the textures in the set, the most probable first; none only for a `reason`."""
        if not self.thresholds:
            return []
        threshold = min(
            float(np.interp(effective_windows, self.effective_window_counts, self.thresholds)),
            float(probabilities.max()),
        )
        order = np.argsort(-probabilities, kind='stable')
        return [int(number) for number in order if probabilities[number] >= threshold]


def fit_prediction_sets(
    posteriors: Sequence[Array], truths: Sequence[int], effective_window_counts: Sequence[Array], coverage: float
) -> PredictionSets:
    """Return the sets for a coverage from slides held out of the training.

    With too few slides for the coverage every texture would be in each set: there are none then.
    """
    thresholds = []
    rank = _rank(len(truths), coverage)
    if not rank:
        return PredictionSets(coverage)
    for effective_windows in SETS_WINDOWS:
        places = [int(np.abs(own - effective_windows).argmin()) for own in effective_window_counts]
        true = np.sort([np.exp(p[place, truth]) for p, place, truth in zip(posteriors, places, truths, strict=True)])
        thresholds.append(float(true[rank - 1]))
    return PredictionSets(coverage, SETS_WINDOWS, tuple(thresholds))


def slides_for_coverage(coverage: float) -> int:
    """Return the smallest number of held-out slides from which sets of this coverage can be fitted."""
    number = max(1, round(1.0 / (1.0 - coverage)) - 1)
    return number if _rank(number, coverage) else number + 1


def _rank(slides: int, coverage: float) -> int:
    """Return how many of the slides held out may lie below the threshold for the coverage to be exact."""
    return math.floor((slides + 1) * (1.0 - coverage) + ROUNDING)


# --------------------
# Early stopping of a slide by a rule fitted on held-out slides.

# Rules tried: end at this confidence and novelty score, or after so much sliding whatever they are. Without a novelty
# detector the novelty score is 0. In windows that do not overlap.
CONFIDENCES = 1.0 - np.geomspace(0.5, 1e-4, 50)
MAX_WINDOWS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0)
NEVER = 1e6
# Smaller ones make later slides of a session, which drift, wait for long (trained on slides 1-20, tested on 21-30).
NOVELTY_SCORES = (NEVER, 9.0, 6.0)
# The limit for the start of a slide grows by this factor with each effective window: a limit that ends at one moment
# lets many slides end right after it. Chosen among 3, 4, 5, 6 and 8 on slides 21-30, trained on 1-20.
EARLY_GROWTH = 6.0
MAX_EARLY_WINDOWS = 20.0  # beyond, the limit grows no more, so that it stays a number


@dataclass(frozen=True)
class StoppingRule:
    """Truncated sequential test: stop at a confidence threshold, or after a number of effective windows.

    Source: Wald 1945 for a decision at a threshold of the evidence; the end after some time, as with one window in a
    hundred that would go on for ever, is fitted with the threshold.
    """

    confidence: float = 0.95
    max_windows: float = NEVER
    novelty_score: float = NEVER
    early_novelty_score: float = NEVER

    def decided(self, confidence: float, effective_windows: float, novelty_score: float = 0.0) -> bool:
        """Return whether the slide may end."""
        growing = EARLY_GROWTH ** (min(effective_windows, MAX_EARLY_WINDOWS) - 1.0)
        limit = min(self.novelty_score, self.early_novelty_score * growing)
        confident = confidence >= self.confidence and novelty_score <= limit
        return confident or effective_windows >= self.max_windows


@dataclass(frozen=True, eq=False)
class SlideCourse:
    """What was said of one held-out slide after each window."""

    confidences: Array
    right: Mask
    effective_windows: Array
    known: Mask
    novelty_scores: Array
    disturbance: str = ''

    def place(self, length: float) -> int:
        """Return the window after which the evidence is nearest to this length."""
        return int(np.abs(self.effective_windows - length).argmin())

    def error_at(self, length: float) -> float:
        """Return the confidence at this length of evidence if the surface is known and the label wrong, else 0."""
        place = self.place(length)
        return float(self.confidences[place]) if self.known[place] and not self.right[place] else 0.0


def fit_stopping_rule(
    courses: Sequence[SlideCourse],
    wrong: float,
    wrong_disturbed: float = 1.0,
    early_novelty_score: float = NEVER,
    *,
    by_novelty: bool = True,
) -> StoppingRule:
    """Return the rule with the shortest mean undisturbed slide that rarely stops a slide with a wrong label.

    A slide is stopped only while its surface is taken for known. Errors under disturbances are counted over all kinds
    together: of each kind alone there are so few that the worst one would decide by chance. If no rule reaches the
    error rates, the one that exceeds them least is returned.
    """
    # (n_slides, n_windows), the shorter ones filled with what never stops a slide.
    novelty = _filled([course.novelty_scores for course in courses], np.inf)
    lengths = _filled([course.effective_windows for course in courses], np.nan)
    known = _filled([course.known for course in courses], 0.0) > 0.0
    known &= novelty <= early_novelty_score * EARLY_GROWTH ** (np.fmin(lengths, MAX_EARLY_WINDOWS) - 1.0)
    confidences = np.where(known, _filled([course.confidences for course in courses], -1.0), -1.0)
    wrong_then = _filled([~course.right for course in courses], 0.0) > 0.0
    whole = np.array([course.effective_windows[-1] for course in courses])
    undisturbed = np.array([not course.disturbance for course in courses])
    rows = np.arange(len(courses))
    best, rule = (np.inf, np.inf), StoppingRule()
    ends = product(NOVELTY_SCORES, (NEVER,)) if by_novelty else product((NEVER,), MAX_WINDOWS)
    for confidence, (novelty_score, longest) in product(CONFIDENCES.tolist(), ends):
        stops = (confidences >= confidence) & (novelty <= novelty_score) | (lengths >= longest)
        if not by_novelty:  # what is said at the end of a slide counts, too
            stops |= lengths == whole[:, None]
        places, stopped = stops.argmax(axis=1), stops.any(axis=1)
        errors = stopped & wrong_then[rows, places]
        taken = np.where(stopped, lengths[rows, places], whole)
        excess = max(0.0, float(errors[undisturbed].mean()) - wrong)
        if not undisturbed.all():
            excess += max(0.0, float(errors[~undisturbed].mean()) - wrong_disturbed)
        mean_windows = float(taken[undisturbed].mean())
        if (excess, mean_windows) < best:
            best = excess, mean_windows
            rule = StoppingRule(confidence, longest, novelty_score, early_novelty_score)
    return rule


def _filled(rows: Sequence[Array | Mask], value: float) -> Array:
    """Return the rows as an array (n_rows, longest), the shorter ones filled with a value."""
    table = np.full((len(rows), max(len(row) for row in rows)), value)
    for number, row in enumerate(rows):
        table[number, : len(row)] = row
    return table


# --------------------
# All of these together.


@dataclass(frozen=True, eq=False)
class Decisions:
    """What a model decides of a slide, by what was fitted to the slides held out of its training."""

    error_bound: ErrorBound
    stopping_rule: StoppingRule = field(default_factory=StoppingRule)
    prediction_sets: PredictionSets = field(default_factory=PredictionSets)
    confidence_floor: ConfidenceFloor = field(default_factory=ConfidenceFloor)
    domain: Domain = field(default_factory=Domain)
    novelty_detector: NoveltyDetector | None = None

    def decided(self, confidence: float, effective_windows: float, novelty_score: float) -> bool:
        """Return whether a slide may end: by the stopping rule, if enough held-out slides show its error rate."""
        return self.error_bound.shown and self.stopping_rule.decided(confidence, effective_windows, novelty_score)

    def with_slides(
        self,
        means: Sequence[Mapping[str, Array]],
        codes: Codes,
        conditions: Sequence[SlideConditions],
        labels: Iterable[str],
    ) -> Decisions:
        """Return the decisions of a model to which slides were added.

        There is no smallest confidence then: new labels make all others less probable.
        """
        detector = self.novelty_detector
        return replace(
            self,
            confidence_floor=ConfidenceFloor(),
            domain=self.domain.widened(conditions, labels),
            novelty_detector=detector.with_slides(means, codes) if detector else None,
        )
