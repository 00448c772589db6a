"""The domain of a model: under which conditions it was trained, and whether an exploration lies within them."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from texture_core.errors import InvalidData
from texture_estimation.open_set.domain_margins import DomainMargins
from texture_estimation.open_set.intervals import FULL_CIRCLE, covered_arcs, interval_of, is_beyond, joint_interval
from texture_features.slide_conditions import Interval, SlideConditions

# Motions whose direction turns within a window: they cover all directions, and theirs is not compared.
TURNING_MOTIONS = ('circular',)
REPLAYS = 'file/'  # a sensor that replays a file is named after the file, not after what measured
OUTSIDE = 'outside what was trained'


@dataclass(frozen=True)
class Domain:
    """The conditions under which a model was trained; what was unknown in the training is not compared.

    A range goes from the lowest to the highest mean over the first windows of the slides, however many: speed and force
    settle at the start of a slide, and an exploration is compared by the mean over its windows so far. Between two
    trained speeds or forces a model is within its domain.

    Parameters
    ----------
    motions, sensors
        Names of the exploratory motions and of the sensors; empty if unknown.
    speed_m_s, force_n
        Lowest and highest mean; None if unknown.
    directions_rad
        Arcs (from, to) that the directions of travel cover, from +x towards +y; `to` may exceed π. Empty if unknown.
    levels
        Lowest and highest signal level of each channel, root mean square in the unit of the signal; empty if unknown.
    slides
        Number of slides of each label.
    margins
        How far an exploration may lie outside.

    Examples
    --------
    >>> domain = Domain(motions=('linear_slide',), speed_m_s=(0.045, 0.055))
    >>> domain.deviation(SlideConditions('linear_slide', speed_m_s=0.02))
    'outside what was trained: speed 0.02 m/s, trained 0.045 to 0.055 m/s'
    >>> domain.deviation(SlideConditions('linear_slide', speed_m_s=0.05))
    ''
    """

    motions: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    speed_m_s: Interval | None = None
    force_n: Interval | None = None
    directions_rad: tuple[Interval, ...] = ()
    levels: Mapping[str, Interval] = field(default_factory=dict)
    slides: Mapping[str, int] = field(default_factory=dict)
    margins: DomainMargins = field(default_factory=DomainMargins)

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
        """Return the domain of a model that is trained on slides.

        Parameters
        ----------
        conditions
            Of each slide, as far as they are known.
        labels
            Of each slide.
        margins
            How far an exploration may lie outside; the defaults if None.

        Returns
        -------
        Domain
            Ranges of speed and force, motions, directions and sensors of the slides.
        """
        slides = tuple(conditions)
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
        )

    def widened(self, conditions: Sequence[SlideConditions], labels: Iterable[str]) -> Domain:
        """Return the domain with slides that were added after the training.

        They widen what is known of the training; what was unknown there is still not compared.

        Parameters
        ----------
        conditions
            Of each added slide, as far as they are known.
        labels
            Of each added slide.
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

    def deviation(self, conditions: SlideConditions) -> str:
        """Return how an exploration lies outside this domain, in one sentence; '' if it lies within."""
        found = '; '.join(self._deviations(conditions))
        return f'{OUTSIDE}: {found}' if found else ''

    def as_card(self) -> dict[str, Any]:
        """Return what a model's card holds, in the form of JSON."""
        return asdict(self)

    @classmethod
    def from_card(cls, card: Mapping[str, Any] | None) -> Domain:
        """Return what `as_card` gave.

        Raises
        ------
        InvalidData
            If there is none, or a range is none. A model without a domain would be certain under any conditions.
        """
        if not isinstance(card, Mapping):
            raise InvalidData("the model card has no entry 'domain', the conditions of the training")
        intervals = {name: _pair(card[name]) for name in ('speed_m_s', 'force_n') if card.get(name) is not None}
        return cls(
            motions=tuple(map(str, card.get('motions', ()))),
            sensors=tuple(map(str, card.get('sensors', ()))),
            directions_rad=tuple(_pair(arc) for arc in card.get('directions_rad', ())),
            levels={str(name): _pair(interval) for name, interval in card.get('levels', {}).items()},
            slides={str(label): int(count) for label, count in card.get('slides', {}).items()},
            margins=DomainMargins(**{name: float(value) for name, value in card.get('margins', {}).items()}),
            **intervals,
        )

    def _deviations(self, conditions: SlideConditions) -> Iterator[str]:
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
        for level in conditions.levels:
            trained = self.levels.get(level.channel)
            if is_beyond(level.rms, trained, self.margins.level):
                yield f'signal level {level.rms:.3g} of {level.channel}, trained {_range(trained)}'

    def _untrained_directions(self, conditions: SlideConditions) -> list[float]:
        """Return the directions of a slide outside the arcs; none where directions are not compared."""
        if not self.directions_rad or conditions.motion in TURNING_MOTIONS:
            return []
        return [direction for direction in conditions.directions_rad if not self._covers(direction)]

    def _covers(self, direction_rad: float) -> bool:
        margin = self.margins.direction_rad
        return any(
            (direction_rad - start + margin) % math.tau <= end - start + 2.0 * margin
            for start, end in self.directions_rad
        )


def _directions(slides: Sequence[SlideConditions], margin_rad: float) -> tuple[Interval, ...]:
    if any(slide.motion in TURNING_MOTIONS for slide in slides):
        return (FULL_CIRCLE,)
    return covered_arcs((angle for slide in slides for angle in slide.directions_rad), 2.0 * margin_rad)


def _levels(slides: Sequence[SlideConditions]) -> dict[str, Interval]:
    """Return the range of the signal level of each channel."""
    by_channel: defaultdict[str, list[tuple[float, ...]]] = defaultdict(list)
    for slide in slides:
        for level in slide.levels:
            by_channel[level.channel].append((level.rms, level.lowest, level.highest))
    found = {channel: interval_of(means) for channel, means in by_channel.items()}
    return {channel: interval for channel, interval in found.items() if interval is not None}


def _names(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted({name for name in names if name}))


def _pair(values: Sequence[Any]) -> Interval:
    low, high = values
    return float(low), float(high)


def _range(interval: Interval | None) -> str:
    low, high = (f'{value:.3g}' for value in interval or ())
    return low if low == high else f'{low} to {high}'


def _listed(names: Sequence[str]) -> str:
    return ', '.join(f"'{name}'" for name in names)
