# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The domain of a model: under which conditions it was trained, and whether an exploration lies within them."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from texture_core.errors import InvalidData
from texture_features.correction import Correction
from texture_features.feature_set import AGAIN, LOAD, POWER, RunningConditions, SlideConditions
from texture_features.windows import Interval

# --------------------
# Intervals of conditions that slides cover.

# Of the slides, at either end of a range: with a hundred slides or more, one odd slide does not widen it.
ODD_FRACTION = 0.01
MEAN_TOLERANCE = 1e-6  # relative: running means are rounded


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
    within = (1.0 + margin) * (1.0 + MEAN_TOLERANCE)
    return not low / within <= value <= high * within


# --------------------
# The domain of a model: under which conditions it was trained, and whether an exploration lies within them.

# How far outside the training conditions a slide may be made; a recipe may have others for speed and force.
SPEED_MARGIN, FORCE_MARGIN = 0.15, 0.3
DIRECTION_MARGIN_RAD = 0.35
LEVEL_MARGIN = 1.0
COMPARED = ('/moments/signal_log_power/', LOAD)  # features of a power of which slides must lie in the trained range
QUIET = math.sqrt(2.0)  # a slide whose level is less than this many times that at rest adds less power than noise has
# Motions whose direction turns within a window: they cover all directions, and theirs is not compared.
TURNING_MOTIONS = ('circular',)
REPLAYS = 'file/'  # a sensor that replays a file is named after the file, not after what measured
OUTSIDE = 'outside the training'
UNFELT = 'a finger that feels nothing shows the same'
LOUDER = 'slide faster, press harder, or use a finer sensor, and train so'
ONE_PLACE = 'trained at one place of each surface: elsewhere it may be rejected'


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
    directions_rad: tuple[float, ...] = ()
    levels: Mapping[str, Interval] = field(default_factory=dict)
    slides: Mapping[str, int] = field(default_factory=dict)
    speed_margin: float = SPEED_MARGIN
    force_margin: float = FORCE_MARGIN
    rest: Mapping[str, float] = field(default_factory=dict)  # by feature of a power, median level before the touch
    quiet_labels: tuple[str, ...] = ()  # of which each slide is as quiet as the sensor at rest
    places: int = 0  # or sessions, of the label that has most; 0 if unknown

    def __post_init__(self) -> None:
        margins = ((0.0, margin) for margin in (self.speed_margin, self.force_margin))
        for interval in (self.speed_m_s, self.force_n, *self.levels.values(), *margins):
            if interval is not None and not 0.0 <= interval[0] <= interval[1] < math.inf:
                raise InvalidData(f'a range of a domain is {interval}; two rising numbers from 0 on are needed')
        if not np.isfinite(self.directions_rad).all():
            raise InvalidData(f'the directions of a domain are {self.directions_rad}; finite ones are needed')

    @classmethod
    def of_slides(cls, conditions: Iterable[SlideConditions], labels: Iterable[str]) -> Domain:
        """Return the domain of a model that is trained on slides, with the usual margins."""
        slides, labels = tuple(conditions), tuple(labels)
        turning = any(slide.motion in TURNING_MOTIONS for slide in slides)  # such a motion has all directions
        return cls(
            motions=_names(slide.motion for slide in slides),
            sensors=_names(slide.sensor for slide in slides if not slide.sensor.startswith(REPLAYS)),
            speed_m_s=interval_of((slide.speed_m_s, *slide.speed_range_m_s) for slide in slides),
            force_n=interval_of((slide.force_n, *slide.force_range_n) for slide in slides),
            directions_rad=() if turning else tuple(sorted({angle for one in slides for angle in one.directions_rad})),
            levels=_levels(slides),
            rest=_rest(slides),
            slides=dict(Counter(labels)),
            places=_places(slides, labels),
        )

    @property
    def reach_reason(self) -> str:
        """Where slides may be rejected for lack of training, in one sentence; '' if unknown."""
        return ONE_PLACE if self.places == 1 else ''

    def widened(self, conditions: Sequence[SlideConditions], labels: Iterable[str]) -> Domain:
        """Return the domain with slides that were added after the training.

        They widen what is known of the training; what was unknown there is still not compared.
        """
        new = Domain.of_slides(conditions, labels)
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

    def corrected(self, correction: Correction) -> Domain:
        """Return the domain for another finger, whose noise is amplified by its correction; the load is not."""
        gains = {name: correction.noise_gain(POWER.split(name)[0].partition(AGAIN)[0]) for name in self.rest}
        rest = {name: level if name.endswith(LOAD) else level * gains[name] for name, level in self.rest.items()}
        return replace(self, rest=rest)

    def deviation(self, conditions: SlideConditions | RunningConditions) -> str:
        """Return how an exploration lies outside this domain, in one sentence; '' if it lies within."""
        found, speed, force = list[str](), conditions.speed_m_s, conditions.force_n
        if is_beyond(speed, self.speed_m_s, self.speed_margin):
            found.append(f'speed {speed:.3g} m/s, trained {_range(self.speed_m_s)} m/s')
        if is_beyond(force, self.force_n, self.force_margin):
            found.append(f'force {force:.3g} N, trained {_range(self.force_n)} N')
        if self.motions and conditions.motion and conditions.motion not in self.motions:
            found.append(f"motion '{conditions.motion}', trained {_listed(self.motions)}")
        sensor = '' if conditions.sensor.startswith(REPLAYS) else conditions.sensor
        if self.sensors and sensor and sensor not in self.sensors:
            found.append(f"sensor '{sensor}', trained {_listed(self.sensors)}")
        if self.directions_rad and conditions.motion not in TURNING_MOTIONS:
            for direction in conditions.directions_rad:
                away = {abs(math.remainder(direction - trained, math.tau)): trained for trained in self.directions_rad}
                if min(away) > DIRECTION_MARGIN_RAD:
                    nearest = math.degrees(away[min(away)])
                    found.append(f'direction {math.degrees(direction):.0f}°, trained {nearest:.0f}°')
                    break
        for name, rms, *_ in conditions.levels:
            trained = self.levels.get(name)
            if is_beyond(rms, trained, LEVEL_MARGIN):
                found.append(f'signal level {rms:.3g} of {POWER.sub("", name)}, trained {_range(trained)}')
        if quiet := self.quiet(conditions):
            found.append(f'{quiet}: {UNFELT}')
        return f'{OUTSIDE}: {"; ".join(found)}' if found else ''

    def quiet(self, conditions: SlideConditions | RunningConditions) -> str:
        """Return that all channels of an exploration are as quiet as the sensor at rest; '' if not, or if unknown."""
        levels = {name: level for name, level, *_ in conditions.levels}
        if not self.rest or any(levels.get(name, math.inf) >= QUIET * rest for name, rest in self.rest.items()):
            return ''
        name, rest = next(iter(self.rest.items()))
        return f'as quiet as the sensor at rest, {POWER.sub("", name)} {levels[name]:.3g}, at rest {rest:.3g}'

    def with_quiet(self, conditions: Iterable[SlideConditions], labels: Iterable[str]) -> tuple[Domain, dict[str, str]]:
        """Return the domain with its quiet labels, and a sentence on each label with slides as quiet as at rest."""
        quiet = [(label, why) for label, made in zip(labels, conditions, strict=True) if (why := self.quiet(made))]
        counts = Counter(label for label, _ in quiet)
        of, remedy = self.slides, f'{UNFELT}; rejected; {LOUDER}'
        sentences = {one: f"{counts[one]} of {of[one]} slides of '{one}' are {why}: {remedy}" for one, why in quiet}
        return replace(self, quiet_labels=tuple(one for one in counts if counts[one] == of[one])), sentences


def _places(slides: Sequence[SlideConditions], labels: Sequence[str]) -> int:
    """Return the number of places or sessions of the label that has most; one session per slide counts as one."""
    most = 0
    for label in set(labels):
        of_label = [slide for slide, of in zip(slides, labels, strict=True) if of == label]
        sessions = len({slide.session for slide in of_label})
        most = max(most, len({slide.place for slide in of_label}), sessions if sessions < len(of_label) else 1)
    return most


def _levels(slides: Sequence[SlideConditions]) -> dict[str, Interval]:
    """Return the range of each level that is compared."""
    means: defaultdict[str, list[list[float]]] = defaultdict(list)
    for name, *of_slide in (level for slide in slides for level in slide.levels):
        if any(compared in name for compared in COMPARED):
            means[name].append(of_slide)
    return {name: interval for name, each in means.items() if (interval := interval_of(each))}


def _rest(slides: Sequence[SlideConditions]) -> dict[str, float]:
    """Return the median level of each feature of a power before the touch, of the slides that show it."""
    levels: defaultdict[str, list[float]] = defaultdict(list)
    for name, level in (level for slide in slides for level in slide.rest):
        levels[name].append(level)
    return {name: float(np.median(each)) for name, each in levels.items()}


def _names(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted({name for name in names if name}))


def _range(interval: Interval | None) -> str:
    low, high = (f'{value:.3g}' for value in interval or ())
    return low if low == high else f'{low} to {high}'


def _listed(names: Sequence[str]) -> str:
    return ', '.join(f"'{name}'" for name in names)
