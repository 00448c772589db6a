"""One labelled slide in a bag."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from texture_core.exploration import ExplorationState, Phase
from texture_core.signal import TactileSignal
from texture_core.slide_motion import SlideMotion


@dataclass(frozen=True)
class LabelledSlide:
    """One exploration with a slide: its label, its conditions, and its signals if they were read.

    Parameters
    ----------
    bag
        Bag in which it lies, or the name of the recording of arrays.
    exploration_id
        As recorded.
    surface
        The label.
    number
        Counts the slides of this surface from 1 in the order recorded.
    start_ns, stop_ns
        What belongs to the slide was logged from `start_ns` to before `stop_ns` (None: the end of the bag).
    namespace
        Namespace of the finger; None if the bag has but one.
    motion
        How the slide was made; None if that is unknown or it was not straight.
    signals
        Batches of each topic in the order of time; empty if only the places of the slides were read.
    states
        Exploration states, in the order of time.

    Examples
    --------
    >>> slide = LabelledSlide(Path('monday.mcap'), 'id', 'cork', number=3, start_ns=0, stop_ns=None)
    >>> slide.name, slide.session
    ('cork/3', 'monday')
    """

    bag: Path
    exploration_id: str
    surface: str
    number: int
    start_ns: int
    stop_ns: int | None
    namespace: str | None = None
    motion: SlideMotion | None = None
    signals: Mapping[str, Sequence[TactileSignal]] = field(default_factory=dict, compare=False, repr=False)
    states: Sequence[ExplorationState] = field(default=(), compare=False, repr=False)

    @property
    def name(self) -> str:
        """Surface and number, such as 'cork/3': unlike exploration ids, unique over all bags."""
        return f'{self.surface}/{self.number}'

    @property
    def session(self) -> str:
        """Name of the bag without its ending: slides of one bag were recorded in one session."""
        return self.bag.name.removesuffix('.mcap')

    @property
    def sliding(self) -> Sequence[ExplorationState]:
        """States while sliding."""
        return [state for state in self.states if state.phase is Phase.SLIDE]

    @property
    def speed_m_s(self) -> float:
        """Mean speed over the states while sliding; NaN if unknown."""
        return _mean(state.speed_m_s for state in self.sliding)

    @property
    def force_n(self) -> float:
        """Mean normal force over the states while sliding; NaN if unknown."""
        return _mean(state.force_n for state in self.sliding)

    @property
    def direction_rad(self) -> float:
        """Direction at the start of the slide; NaN if unknown."""
        return next((state.direction_rad for state in self.sliding), math.nan)

    @property
    def motion_name(self) -> str:
        """Name of the motion in the catalogue of motions; '' if unknown."""
        return next((state.motion for state in self.sliding), '')

    @property
    def sensor(self) -> str:
        """Name of the sensor of the first topic; '' if no signal was read."""
        return next((batches[0].sensor for batches in self.signals.values() if batches), '')


def _mean(values: Iterable[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return float(np.mean(known)) if known else math.nan
