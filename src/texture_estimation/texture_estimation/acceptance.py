# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Accepted or rejected and why, decided, and the prediction set: one object, fitted to slides held out of the training.

A label is accepted if its slide scores above a limit. The score is the log-odds, by logistic regression, that the slide
is one of its label's rather than one of an unknown surface. It has two inputs: the margin by which
the evidence for the label exceeds that for the next one, and the distance of the slide to the training slides of the
label. As unknown surfaces serve the held-out slides themselves, with their label removed.

Sources: Cox 1958 for the regression; Vovk, Gammerman & Shafer 2005 for limits by rank; Clopper & Pearson 1934 and
Hanley & Lippman-Hand 1983 for what a number of slides can show; Ioffe 2006 for the distance;
Wald 1945 for the end of a slide.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import InvalidData
from texture_core.types import Array, Rejection
from texture_estimation.domain import Domain
from texture_estimation.evidence_rules import ROUNDING, EvidenceRule
from texture_estimation.gaussians import DISTANCE_WINDOWS, ClassDistance
from texture_estimation.learners.learner import is_tied

# --------------------
# What a number of held-out slides can show.

SIGNIFICANCE = 0.05  # fraction of all trainings in which the error rate exceeds its upper bound
LEAST_SLIDES_A_LABEL = 5  # with one held out, four show how much slides differ
TRIALS = 2  # of each held-out slide: with its label in the model, and with that removed


def slides_needed(rate: float) -> float:
    """Return from how many held-out slides without an error its rate is at most this one; infinite for none at all.

    Without an error in n slides the rate may still be 1 - 0.05^(1/n), about 3/n.
    """
    if rate >= 1.0:
        return 0
    return math.ceil(math.log(SIGNIFICANCE) / math.log1p(-rate)) if rate > 0.0 else math.inf


# --------------------
# What the score of a slide rests on: the margin of its best label, and its distance to the slides of that label.

# Lengths of evidence at which everything is fitted, in windows that do not overlap: the start of a slide is like no
# other part of it. Between two of them it is linear.
LEVELS = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0)


class SlideDistance:
    """Distance of one slide so far to the training slides of a label, updated window by window."""

    def __init__(self, distance: ClassDistance) -> None:
        self._distance = distance
        self._sum: Any = 0.0
        self._count = 0
        self._found: dict[int, float] = {}  # the sum stops changing after a few windows, and the label rarely changes

    def add(self, values: Array, effective_windows: float) -> None:
        """Add what of a window is compared, (n_compared,)."""
        if self._count and effective_windows > DISTANCE_WINDOWS + ROUNDING:
            return
        self._sum = self._sum + values
        self._count += 1
        self._found.clear()

    def to(self, label: int) -> float:
        """Return the distance of a slide with a window or more to the slides of a label; infinite without any of it."""
        if label not in self._found:
            self._found[label] = float(self._distance.score(self._sum / self._count, label))
        return self._found[label]


def margin_of(best: float, second: float) -> float:
    """Return the margin of a label from the mean log-probabilities of the two best ones."""
    return math.log1p(max(best - second, 0.0))


@dataclass(frozen=True, eq=False)
class HeldOutSlide:
    """A slide, or a disturbed copy of it, as a model that has not seen it follows it window by window.

    `scored` and `unknown` are the margins and distances of the best label, and of the best one of the others, (n, 2).
    """

    truth: int
    means: Array
    effective_windows: Array
    scored: Array
    unknown: Array
    disturbance: str = ''

    @classmethod
    def follow(
        cls, truth: int, means: Array, effective_windows: Array, compared: Array, distance: ClassDistance,
        *, disturbance: str = '',
    ) -> HeldOutSlide:  # fmt: skip
        """Return a slide with this mean evidence (n, n_labels) and these values to compare (n, n_compared)."""
        first = max(1, int(np.searchsorted(effective_windows, DISTANCE_WINDOWS + ROUNDING, side='right')))
        starts = np.cumsum(compared[:first], axis=0) / np.arange(1, first + 1)[:, None]
        others = means.copy()
        others[:, truth] = -np.inf
        scored, unknown = (_scored(rows, starts, distance) for rows in (means, others))
        return cls(truth, means, effective_windows, scored, unknown, disturbance)

    @property
    def right(self) -> NDArray[np.bool_]:
        """Whether the label is right after each window, (n,)."""
        return (self.means.argmax(axis=1) == self.truth) & ~is_tied(self.means)

    def place(self, length: float) -> int:
        """Return the window after which the evidence is nearest to this length."""
        return int(np.abs(self.effective_windows - length).argmin())


def _scored(means: Array, starts: Array, distance: ClassDistance) -> Array:
    """Return margin and distance of the best label after each window, (n, 2)."""
    best = means.argmax(axis=1)
    second, first = np.sort(means, axis=1)[:, -2:].T
    margins = np.log1p(np.where(np.isfinite(second), first - second, 0.0))
    distances = np.empty(len(means))
    for label in np.unique(best).tolist():
        taken = np.flatnonzero(best == label)
        distances[taken] = distance.score(starts, label)[np.minimum(taken, len(starts) - 1)]
    return np.stack([margins, distances], axis=1)


# --------------------
# The limits at one length of evidence.


class Limits(NamedTuple):
    """What is fitted at one length of evidence, or lies between two."""

    offset: float  # of the score
    margin: float  # its factor
    distance: float  # its factor
    accepted: float  # least score
    reach: float  # distance to which that holds, as slides of left-out places show
    accepted_far: float  # least score beyond
    novel: float  # distance beyond which a surface that is rejected is novel, else it is ambiguous
    probable: float  # least probability of a label in the prediction set

    def score(self, margin: Any, distance: Any) -> Any:
        """Return the log-odds that a slide, or each slide of arrays (n,), is one of its label's."""
        return self.offset + self.margin * margin + self.distance * distance

    def accepts(self, margin: float, distance: float) -> bool:
        """Return whether a slide is accepted."""
        return self.score(margin, distance) >= (self.accepted if distance <= self.reach else self.accepted_far)


NEVER = 1e9  # as a limit of scores
RIDGE = 1e-3  # on the factors of standardised inputs, relative to the number of slides: separable ones stay finite


def _regression(positive: Array, negative: Array) -> tuple[float, float, float]:
    """Return offset and factors of the log-odds between two equally likely sets of margins and distances, (n, 2)."""
    from sklearn.linear_model import LogisticRegression  # noqa: PLC0415  # takes seconds, and only training needs it

    both = np.concatenate([positive, negative])
    centre, scale = both.mean(axis=0), both.std(axis=0) + 1e-9
    inputs = np.column_stack([np.ones(len(both)), (both - centre) / scale])
    truth = np.repeat([1, 0], [len(positive), len(negative)])
    weights = np.repeat([0.5 / len(positive), 0.5 / len(negative)], [len(positive), len(negative)])
    learner = LogisticRegression(C=1.0 / RIDGE, fit_intercept=False, solver='newton-cholesky', tol=1e-8)
    offset, margin, distance = learner.fit(inputs, truth, weights).coef_[0].tolist()
    # More margin or less distance never speaks against a label.
    margin, distance = max(margin, 0.0) / scale[0], min(distance, 0.0) / scale[1]
    return float(offset - margin * centre[0] - distance * centre[1]), float(margin), float(distance)


def _rank(slides: int, rate: float) -> int:
    """Return how many of the slides held out may lie beyond a limit for the rate to hold."""
    return math.floor((slides + 1) * rate + ROUNDING)


def _least_score(limits: Limits, wrong: Array, unknown: Array, rate: float) -> float:
    """Return the score above which few labels are wrong: this fraction of all trials, and half of it as they are.

    `unknown` are the slides without their label, one for each, and `wrong` those that are wrong with it.
    """
    least, every = -NEVER, np.concatenate([wrong, unknown])
    for rows, most in ((wrong, rate * len(unknown) / TRIALS), (every, rate * TRIALS * len(unknown))):
        kept = int(most + ROUNDING)
        if kept < len(rows):
            least = max(least, math.nextafter(np.sort(limits.score(*rows.T))[::-1][kept], math.inf))
    return least


def _at(slides: Sequence[HeldOutSlide], length: float) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return margins and distances of the best label, (n, 2), without the true one, (n, 2), and what is right, (n,)."""
    places = [slide.place(length) for slide in slides]
    scored, unknown, right = (
        np.array([getattr(slide, name)[place] for slide, place in zip(slides, places, strict=True)])
        for name in ('scored', 'unknown', 'right')
    )
    return scored, unknown, right


def _limits_at(
    length: float, near: Sequence[HeldOutSlide], far: Sequence[HeldOutSlide], rates: Rates, probable: float
) -> Limits:
    """Return the limits at a length of evidence.

    `near` slides were held out one by one, `far` ones with all of their place, session or finger.
    """
    # Slides like those of the training: few right ones are rejected, few wrong ones and few unknown ones accepted.
    scored, unknown, right = _at(near, length)
    none = Limits(0.0, 0.0, 0.0, NEVER, math.inf, NEVER, 0.0, probable)
    if not right.any():
        return none
    offset, margin, distance = _regression(scored[right], unknown)
    limits = none._replace(offset=offset, margin=margin, distance=distance)
    known = np.sort(limits.score(*scored[right].T))
    rank = max(_rank(len(known), rates.false_rejection_rate), 1)
    accepted = max(float(known[rank - 1]), _least_score(limits, scored[~right], unknown, rates.max_accepted_wrong))
    limits = limits._replace(accepted=accepted, novel=float(np.sort(scored[right, 1])[-rank]))
    if not far:
        return limits

    # This holds so far that few slides of left-out places are accepted and wrong; beyond, more is needed.
    scored, _, right = _at(far, length)
    wrong = scored[~right]
    allowed = int(len(far) * rates.max_accepted_wrong / TRIALS)
    scores, distances = limits.score(*wrong.T), wrong[:, 1]
    passed = np.sort(distances[scores >= accepted])
    reach = max(limits.novel, float(passed[allowed])) if len(passed) > allowed else math.inf
    left = max(0, allowed - int((scores[distances <= reach] >= accepted).sum()))
    beyond = np.sort(scores[distances > reach])[::-1]
    accepted_far = math.nextafter(beyond[left], math.inf) if left < len(beyond) else accepted
    return limits._replace(reach=reach, accepted_far=max(accepted, accepted_far))


# --------------------
# All of it.


@dataclass(frozen=True)
class Rates:
    """Error rates that the recipe allows."""

    max_accepted_wrong: float = 0.033
    false_rejection_rate: float = 0.04
    max_error_rate: float = 0.02
    coverage: float = 0.95


@dataclass(frozen=True, eq=False)
class Acceptance:
    """Whether the label of a slide is accepted, and why not; whether the slide may end; which labels it may have.

    Parameters
    ----------
    slides
        Number of slides that were held out of the training.
    rates
        How often what may go wrong.
    domain
        Under which conditions the slides were made.
    levels : (len(LEVELS), len(Limits._fields))
        Limits at each length of evidence; no rows if too few slides were held out.
    decided_score
        Least score at which a slide may end.
    distance
        To the training slides of each label.
    added
        The label that it is for, of slides that were added after the training; '' for those of the training.
    """

    slides: int
    rates: Rates = field(default_factory=Rates)
    domain: Domain = field(default_factory=Domain)
    levels: Array = field(default_factory=lambda: np.empty((0, len(Limits._fields))))
    decided_score: float = NEVER
    distance: ClassDistance | None = None
    added: str = ''

    def __post_init__(self) -> None:
        if self.slides < 0:
            raise InvalidData(f'acceptance has {self.slides} slides; 0 or more are possible')
        shape, reach = (len(LEVELS) if self.distance else 0, len(Limits._fields)), Limits._fields.index('reach')
        if (
            self.levels.shape != shape
            or np.isnan(self.levels[:, reach]).any()  # infinite where no place was left out
            or not np.isfinite([*np.delete(self.levels, reach, axis=1).flat, self.decided_score]).all()
        ):
            raise InvalidData(f'acceptance has limits of shape {self.levels.shape}; finite ones of {shape} are needed')

    def fitted(
        self, near: Sequence[HeldOutSlide], far: Sequence[HeldOutSlide], rule: EvidenceRule, tempering_exponent: float,
        distance: ClassDistance,
    ) -> Acceptance:  # fmt: skip
        """Return what fits slides held out one by one, and with all of their place, session or finger."""
        usual, beyond = ([slide for slide in those if not slide.disturbance] for those in (near, far))
        rank = _rank(len(beyond or usual), 1.0 - self.rates.coverage)
        levels = []
        for length in LEVELS:
            # Of the true labels at this length of evidence, few are less probable than those of the prediction set.
            probable = []
            for slide in beyond or usual:
                place = slide.place(length)
                posterior = rule.posterior(slide.means[place], slide.effective_windows[place], tempering_exponent)
                probable.append(float(posterior[slide.truth]))
            least = sorted(probable)[rank - 1] if rank else 0.0
            levels.append(_limits_at(length, usual, beyond, self.rates, least))
        # A slide is assessed many times: early limits are as strict as late ones.
        fitted, strict = np.array(levels), [Limits._fields.index(name) for name in ('accepted', 'accepted_far')]
        fitted[:, strict] = np.maximum.accumulate(fitted[::-1, strict])[::-1]
        found = replace(self, levels=fitted, distance=distance)
        return replace(found, decided_score=found._fit_decided([*near, *far]))

    # ---- too little training

    @cached_property
    def reason(self) -> str:
        """Why every label is rejected, in one sentence: how many slides there are and how many are needed; else ''."""
        if self.added:
            needs = f"to accept '{self.added}' {LEAST_SLIDES_A_LABEL} are needed"
            return '' if self.slides >= LEAST_SLIDES_A_LABEL else f'too little training: {self.slides} added; {needs}'
        short = {label: count for label, count in self.domain.slides.items() if count < LEAST_SLIDES_A_LABEL}
        needed = math.ceil(slides_needed(self.rates.max_accepted_wrong) / TRIALS)
        if not short and self.slides >= needed:
            return ''
        fewest = f", and {min(short.values())} of '{min(short, key=lambda label: short[label])}'" if short else ''
        none = '' if self.slides else ' (none in an adaptation to today, and by recipes that are not calibrated)'
        return (
            f'too little training: {self.slides} slides could be held out{none}{fewest}; to accept a label '
            f'{needed:g} are needed, and {LEAST_SLIDES_A_LABEL} of each surface'
        )

    @cached_property
    def decided_reason(self) -> str:
        """Why no slide is ended early, in one sentence; '' if slides are."""
        rate, needed = self.rates.max_error_rate, slides_needed(self.rates.max_error_rate)
        if self.slides >= needed:
            return ''
        if math.isinf(needed):
            return 'no early stopping: the recipe allows no wrong early decision (max_error_rate: 0)'
        allowed = f'at most {100.0 * rate:g} % wrong decisions'
        return f'too few slides for early stopping: {allowed} need {needed:g} slides held out of the training'

    @cached_property
    def highest_confidence(self) -> float:
        """Largest confidence that the held-out slides can show; 1 if none was held out: nothing is calibrated then."""
        return float(SIGNIFICANCE ** (1.0 / self.slides)) if self.slides else 1.0

    def limited(self, probabilities: Sequence[float]) -> Sequence[float]:
        """Return the probabilities, mixed with equal ones just so much that none is above the highest confidence."""
        equal, highest = 1.0 / len(probabilities), max(probabilities)
        limit = max(self.highest_confidence, equal)
        if highest <= limit:
            return probabilities
        kept = (limit - equal) / (highest - equal)
        return [equal + kept * (probability - equal) for probability in probabilities]

    # ---- decisions about a slide

    @cached_property
    def _rows(self) -> list[Limits]:
        return [Limits(*row) for row in self.levels.tolist()]

    def limits(self, effective_windows: float) -> Limits:
        """Return the limits after this many windows, linear between two lengths of evidence."""
        after = bisect_right(LEVELS, effective_windows)
        if after == 0 or after == len(LEVELS):
            return self._rows[max(after - 1, 0)]
        low, high = LEVELS[after - 1], LEVELS[after]
        weight = (effective_windows - low) / (high - low)
        pairs = zip(self._rows[after - 1], self._rows[after], strict=True)
        return Limits._make([one if one == other else one + weight * (other - one) for one, other in pairs])

    def assess(self, margin: float, distance: float, effective_windows: float) -> tuple[Rejection, bool]:
        """Return the rejection of a slide and whether it is decided, from its margin and distance to its label."""
        if self.distance is None or (self.added and self.reason):
            return Rejection.TOO_LITTLE_TRAINING, False
        limits = self.limits(effective_windows)
        if not limits.accepts(margin, distance):
            return Rejection.NOVEL if distance > limits.novel else Rejection.AMBIGUOUS, False
        return Rejection.NONE, not self.decided_reason and limits.score(margin, distance) >= self.decided_score

    def members(self, probabilities: Array, effective_windows: float) -> list[int]:
        """Return the numbers of the labels in the prediction set, the most probable first; none if too few slides."""
        if self.distance is None:
            return []
        least = min(self.limits(effective_windows).probable, float(probabilities.max()))
        order = np.argsort(-probabilities, kind='stable')
        return [int(number) for number in order if probabilities[number] >= least]

    def _fit_decided(self, slides: Sequence[HeldOutSlide]) -> float:
        """Return the least score at which slides end early and rarely with a wrong label, disturbed or not."""
        if self.decided_reason:
            return NEVER
        # Each test after each window: its highest score so far while it was accepted, and whether its label is right.
        tests: defaultdict[tuple[bool, bool], list[tuple[Array, NDArray[np.bool_]]]] = defaultdict(list)
        for slide in slides:
            limits = [self.limits(length) for length in slide.effective_windows.tolist()]
            for known, rows in ((True, slide.scored), (False, slide.unknown)):
                pairs = zip(limits, rows.tolist(), strict=True)
                scores = np.array([one.score(*row) if one.accepts(*row) else -math.inf for one, row in pairs])
                if known or not slide.disturbance:
                    tests[known, bool(slide.disturbance)].append((np.maximum.accumulate(scores), slide.right & known))
        highest = [scores[-1] for each in tests.values() for scores, _ in each if math.isfinite(scores[-1])]
        for least in np.quantile(highest or [NEVER], np.linspace(0, 1, 50)).tolist():
            if all(
                sum(scores[-1] >= least and not right[scores.searchsorted(least)] for scores, right in each)
                <= int(self.rates.max_error_rate * len(each) * (1 if known else TRIALS))
                for (known, _), each in tests.items()
            ):
                return float(least)
        return NEVER
