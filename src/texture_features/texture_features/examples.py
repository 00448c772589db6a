# SPDX-License-Identifier: Apache-2.0
"""Labelled features: what learners are trained on, with the conditions of their slides."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import InvalidData, ModelMismatch
from texture_core.types import NANOSECONDS, AnyArray, Array, FeatureVector, SlideMotion
from texture_features.windows import UNKNOWN, Interval, RunningMean

if TYPE_CHECKING:
    from texture_features.augmentation import AugmentedFeatures


# --------------------
# How one exploration was made: motion, sensor, and the speed, force, directions and signal level of its windows.

DIRECTION_DIGITS = 2  # so that a slide has few directions, however long it is
# In the name of the feature that tells the level of a channel, 'signal/moments/signal_log_power/dynamic'.
LOG_POWER = '/moments/signal_log_power/'
LOAD = '/load_level'  # ends the name of the feature that tells the level of a whole array


class SignalLevel(NamedTuple):
    """Level of one channel over a slide: geometric mean of the root mean square of its windows.

    Parameters
    ----------
    channel
        Topic and channel, such as 'signal/dynamic'.
    rms
        Mean over all windows, in the unit of the signal.
    lowest, highest
        Of the means over the first windows, however many.

    Examples
    --------
    >>> level = SignalLevel('signal/dynamic', rms=12.0, lowest=11.5, highest=13.0)
    >>> level.lowest <= level.rms <= level.highest
    True
    """

    channel: str
    rms: float
    lowest: float
    highest: float


@dataclass(frozen=True)
class SlideConditions:
    """The conditions of one exploration; unknown names are '', unknown numbers NaN.

    Parameters
    ----------
    motion, sensor
        Name of the exploratory motion, and of the sensor that measured.
    speed_m_s, force_n
        Means over the windows in which they are known.
    directions_rad
        Directions of travel of the windows, to a hundredth of a radian, each once.
    speed_range_m_s, force_range_n
        Lowest and highest mean over the first windows, however many: at the start of a slide speed and force settle.
    levels
        Of the channels whose moments are among the features.
    session, place
        Recording and part of the path of a slide from recordings: what a training may leave out to see how far it
        reaches.

    Examples
    --------
    >>> made = SlideConditions('linear_slide', speed_m_s=0.05)
    >>> made.speed_m_s, math.isnan(made.force_n)
    (0.05, True)
    """

    motion: str = ''
    sensor: str = ''
    speed_m_s: float = math.nan
    force_n: float = math.nan
    directions_rad: tuple[float, ...] = ()
    speed_range_m_s: Interval = UNKNOWN
    force_range_n: Interval = UNKNOWN
    levels: tuple[SignalLevel, ...] = ()
    session: str = ''
    place: str = ''

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> SlideConditions:
        """Return the conditions that `dataclasses.asdict` has written as JSON; what is missing is unknown.

        Raises
        ------
        KeyError, TypeError, ValueError
            If a value cannot be one.
        """
        known = cls()
        return cls(
            motion=str(values.get('motion', '')),
            sensor=str(values.get('sensor', '')),
            speed_m_s=float(values.get('speed_m_s', known.speed_m_s)),
            force_n=float(values.get('force_n', known.force_n)),
            directions_rad=tuple(map(float, values.get('directions_rad', ()))),
            speed_range_m_s=_pair(values.get('speed_range_m_s', UNKNOWN)),
            force_range_n=_pair(values.get('force_range_n', UNKNOWN)),
            levels=tuple(_level(*level) for level in values.get('levels', ())),
            session=str(values.get('session', '')),
            place=str(values.get('place', '')),
        )


class RunningConditions:
    """The conditions of an exploration, window by window.

    Examples
    --------
    >>> running = RunningConditions()
    >>> for speed_m_s in (0.04, 0.06):
    ...     running.update(FeatureVector(0, 'a', 0.5, 0.1, speed_m_s=speed_m_s, motion='linear_slide'))
    >>> round(running.get().speed_m_s, 3), running.get().motion
    (0.05, 'linear_slide')
    """

    def __init__(self) -> None:
        self.motion = self.sensor = ''
        self._speed = RunningMean()
        self._force = RunningMean()
        self.directions_rad: dict[float, None] = {}  # in the order in which they came
        self._levels: list[tuple[str, int, RunningMean]] | None = None  # channel, place among the features, log power

    def update(self, vector: FeatureVector) -> None:
        """Take the conditions of one more window into account."""
        self.motion = vector.motion or self.motion
        self.sensor = vector.sensor or self.sensor
        self._speed.update(vector.speed_m_s)
        self._force.update(vector.force_n)
        if math.isfinite(vector.direction_rad):
            self.directions_rad[round(vector.direction_rad, DIRECTION_DIGITS)] = None
        if self._levels is None and vector.names:
            self._levels = [(channel, place, RunningMean()) for channel, place in _log_powers(vector.names)]
        for _, place, log_power in self._levels or ():
            log_power.update(float(vector.values[place]))

    @property
    def speed_m_s(self) -> float:
        """Mean speed so far; NaN if unknown."""
        return self._speed.value

    @property
    def force_n(self) -> float:
        """Mean force so far; NaN if unknown."""
        return self._force.value

    @property
    def levels(self) -> Sequence[SignalLevel]:
        """Levels of the channels so far."""
        return [_signal_level(channel, log_power) for channel, _, log_power in self._levels or ()]

    def get(self) -> SlideConditions:
        """Return the conditions of the windows so far."""
        return SlideConditions(
            self.motion,
            self.sensor,
            self.speed_m_s,
            self.force_n,
            tuple(self.directions_rad),
            self._speed.range,
            self._force.range,
            tuple(self.levels),
        )


def _level(channel: Any, rms: Any, *interval: Any) -> SignalLevel:
    return SignalLevel(str(channel), float(rms), *_pair(interval))


def _pair(values: Sequence[Any]) -> Interval:
    low, high = values
    return float(low), float(high)


def _log_powers(names: Sequence[str]) -> list[tuple[str, int]]:
    """Return the channels or arrays whose logarithm of the power is a feature, and its place among the features."""
    return [
        (name.replace(LOG_POWER, '/').removesuffix(LOAD), place)
        for place, name in enumerate(names)
        if LOG_POWER in name or name.endswith(LOAD)
    ]


def _signal_level(channel: str, log_power: RunningMean) -> SignalLevel:
    return SignalLevel(channel, *(math.exp(0.5 * value) for value in (log_power.value, *log_power.range)))


# --------------------
# Windows of known surfaces, described: what is used for training and evaluated by.


@dataclass(frozen=True, eq=False)
class LabelledFeatures:
    """Feature vectors with their labels, slide by slide and in the order of time.

    Parameters
    ----------
    values : (n, n_features)
    labels, groups : (n,) of text
        Surface and slide (exploration id) of each window.
    names
        Name of each feature.
    feature_set
        Fingerprint of what made them.
    window_s, hop_s
        Length and distance of the windows.
    motions
        How slides were made, as far as it is known.
    start_ns : (n,) int64 or None
        Start of each window, ns; without it, the windows of a slide are taken to lie `hop_s` apart.
    conditions
        Motion, sensor, speed, force and directions of each slide, as far as its windows tell them.
    augmented
        Changed copies of the slides for training; copies of slides that are not among `groups` are ignored.
    resized
        Windows of other lengths, for training alone; those of slides that are not among `groups` are ignored.
    touches
        Features of the touch before the finger moved, (n_features,), by slide; slides not among `groups` are ignored.

    Raises
    ------
    InvalidData
        If the shapes contradict each other.

    Examples
    --------
    >>> means = {'a': 1.0, 'b': 2.0}
    >>> vectors = [FeatureVector(0, slide, 0.5, 0.1, ('mean',), np.array([mean])) for slide, mean in means.items()]
    >>> features = LabelledFeatures.from_vectors(vectors, {'a': 'oak', 'b': 'felt'})
    >>> features.X.tolist(), features.of_slides(['b']).y.tolist()
    ([[1.0], [2.0]], ['felt'])
    """

    values: Array
    labels: NDArray[np.str_]
    groups: NDArray[np.str_]
    names: tuple[str, ...]
    feature_set: str
    window_s: float
    hop_s: float
    motions: Mapping[str, SlideMotion] = field(default_factory=dict)
    start_ns: NDArray[np.int64] | None = None
    conditions: Mapping[str, SlideConditions] = field(default_factory=dict)
    augmented: AugmentedFeatures | None = None
    resized: LabelledFeatures | None = None
    touches: Mapping[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        shape = (len(self.labels), len(self.names))
        if self.values.shape != shape or self.groups.shape != self.labels.shape:
            raise InvalidData(
                f'labelled features have values of shape {self.values.shape}, {len(self.labels)} labels, '
                f'{len(self.groups)} groups and {len(self.names)} names; shape {shape} and as many groups are needed'
            )

    @property
    def X(self) -> Array:  # scikit-learn's name
        """Features, (n, n_features), as scikit-learn names them."""
        return self.values

    @property
    def y(self) -> NDArray[np.str_]:
        """Labels, (n,), as scikit-learn names them."""
        return self.labels

    def take(self, rows: AnyArray) -> LabelledFeatures:
        """Return the windows of a mask, (n,), or of indices.

        Parameters
        ----------
        rows : (n,) bool, or (n_taken,) int
            Which windows are taken, as a mask or by their indices.
        """
        return replace(
            self,
            values=self.values[rows],
            labels=self.labels[rows],
            groups=self.groups[rows],
            start_ns=None if self.start_ns is None else self.start_ns[rows],
        )

    def of_slides(self, slides: Iterable[str]) -> LabelledFeatures:
        """Return the windows of the slides with these names."""
        return self.take(np.isin(self.groups, list(slides)))

    def vectors(self, slide: str) -> list[FeatureVector]:
        """Return the windows of one slide, (n_windows,), with its mean speed and force, and its end."""
        rows = np.flatnonzero(self.groups == slide)
        made = self.conditions.get(slide, SlideConditions())
        hop_ns = self.hop_s * NANOSECONDS
        starts = (np.arange(len(rows)) * hop_ns).round() if self.start_ns is None else self.start_ns[rows]
        vectors = [
            FeatureVector(
                int(start),
                slide,
                self.window_s,
                self.hop_s,
                self.names,
                values,
                made.speed_m_s,
                made.force_n,
                self.feature_set,
                motion=made.motion,
                sensor=made.sensor,
            )
            for start, values in zip(starts.tolist(), self.values[rows], strict=True)
        ]
        end_ns = vectors[-1].start_ns + round(self.window_s * NANOSECONDS) if vectors else 0
        return [*vectors, FeatureVector(end_ns, slide, 0.0, self.hop_s, last=True)]

    @classmethod
    def from_vectors(cls, vectors: Iterable[FeatureVector], surfaces: Mapping[str, str]) -> LabelledFeatures:
        """Gather feature vectors; `surfaces` holds the label of each exploration id, those without one are left out.

        Raises
        ------
        InvalidData
            If no labelled window is left.
        ModelMismatch
            If the vectors are not all of one fingerprint.
        """
        used = [vector for vector in vectors if not vector.last and surfaces.get(vector.exploration_id)]
        if not used:
            raise InvalidData('there is no window of a labelled surface; record slides with a surface named')
        fingerprints = sorted({vector.feature_set for vector in used})
        if len(fingerprints) > 1:
            raise ModelMismatch(
                f'the windows are described in different ways: {"; ".join(fingerprints)}; use those of one kind'
            )
        return cls(
            values=np.stack([vector.values for vector in used]),
            labels=np.array([surfaces[vector.exploration_id] for vector in used]),
            groups=np.array([vector.exploration_id for vector in used]),
            names=used[0].names,
            feature_set=used[0].feature_set,
            window_s=used[0].window_s,
            hop_s=used[0].hop_s,
            start_ns=np.array([vector.start_ns for vector in used], dtype=np.int64),
            conditions=_conditions(used),
        )


def _conditions(vectors: Iterable[FeatureVector]) -> Mapping[str, SlideConditions]:
    running: defaultdict[str, RunningConditions] = defaultdict(RunningConditions)
    for vector in vectors:
        running[vector.exploration_id].update(vector)
    return {exploration_id: conditions.get() for exploration_id, conditions in running.items()}
