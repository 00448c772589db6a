# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The domain of a model: under which conditions it was trained, and whether an exploration lies within them."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from texture_core.errors import InvalidData
from texture_features.feature_set import RunningConditions, SlideConditions
from texture_features.windows import Interval

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
# Intervals of conditions and arcs of directions that slides cover.

# Of the slides, at either end of a range: with a hundred slides or more, one odd slide does not widen it.
ODD_FRACTION = 0.01
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
    known = [values for slide in means for values in [[mean for mean in slide if math.isfinite(mean)]] if values]
    if not known:
        return None
    low = np.quantile([min(values) for values in known], ODD_FRACTION, method='lower')
    high = np.quantile([max(values) for values in known], 1.0 - ODD_FRACTION, method='higher')
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
OUTSIDE = 'outside the training'
ONE_PLACE = 'trained at one place of each surface: elsewhere it may be rejected'
REACH = {'sessions': 'session', 'places': 'place', 'fingers': 'sensor'}  # and what of a slide is counted


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
        """Where slides may be rejected for lack of training, in one sentence; '' if unknown."""
        if not self.reach or any(counts['places'] > 1 or counts['sessions'] > 1 for counts in self.reach.values()):
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
            levels={name: joint_interval(level, new.levels.get(name)) or level for name, level in self.levels.items()},
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
        compared = () if conditions.motion in TURNING_MOTIONS or not self.directions_rad else conditions.directions_rad
        if untrained := [direction for direction in compared if not self._covers(direction)]:
            yield f'direction {untrained[0]:.3g} rad, trained {" and ".join(map(_range, self.directions_rad))} rad'
        for channel, rms, *_ in conditions.levels:
            trained = self.levels.get(channel)
            if is_beyond(rms, trained, self.margins.level):
                yield f'signal level {rms:.3g} of {channel}, trained {_range(trained)}'

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
    """Return how many sessions, places and fingers each label has; one session per slide counts as none."""
    found = {}
    for label in dict.fromkeys(labels):
        of_label = [slide for slide, of in zip(slides, labels, strict=True) if of == label]
        names = {kind: {getattr(slide, name) for slide in of_label} for kind, name in REACH.items()}
        counts = {kind: len(each) for kind, each in names.items()}
        found[label] = {**counts, 'sessions': counts['sessions'] if counts['sessions'] < len(of_label) else 1}
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
