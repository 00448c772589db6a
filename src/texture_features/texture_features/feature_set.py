# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A feature set, from the recipe that names it to feature vectors; labelled vectors and the conditions of slides."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, combinations, groupby
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from texture_core.config import find, find_file, from_mapping, load_card, load_yaml, param, safe_repr, shipped
from texture_core.errors import InvalidData, InvalidParameter, ModelMismatch, UnknownName
from texture_core.types import NANOSECONDS, AnyArray, Array, FeatureVector, SlideMotion, Window
from texture_features.correction import CORRECTED, Correction, read_correction
from texture_features.features import spectral, taxels, temporal
from texture_features.features.temporal import Stretched
from texture_features.windows import (
    UNKNOWN,
    CutWindow,
    Feature,
    Interval,
    RunningMean,
    SlideEnd,
    WindowBatch,
    WindowEvent,
    WindowParams,
    check_axes,
    topic_of,
)

# --------------------
# The features that a recipe can name.

FEATURES: Mapping[str, type[Feature]] = {
    'mean_log_bands': spectral.MeanLogBands,  # Welch 1967
    'low_fft_bins': spectral.LowFftBins,
    'hjorth': temporal.Hjorth,  # Hjorth 1970; Kaboli et al. 2015
    'moments': temporal.Moments,
    'power_autocorrelation': spectral.PowerAutocorrelation,
    'mean': temporal.ChannelMean,
    'log_variance': temporal.LogVariance,
    'log_difference_variance': temporal.LogDifferenceVariance,
    'pacinian_power': spectral.PacinianPower,  # Bensmaia & Hollins 2005
    'spectral_exponent': spectral.SpectralExponent,  # Toscani & Metzger 2022
    'temporal_variation': temporal.TemporalVariation,  # Lieber & Bensmaia 2019
    'spatial_variation': taxels.SpatialVariation,  # Lieber & Bensmaia 2019
    'spatial_band_power': taxels.SpatialBandPower,
    'peak_to_median_power': spectral.PeakToMedianPower,
    'mean_spatial_bands': taxels.MeanSpatialBands,
    'mean_statistics': taxels.ChannelMeanStatistics,
    'difference_correlation': taxels.DifferenceCorrelation,
    'load_level': taxels.LoadLevel,
    'speed': temporal.Speed,
    'force': temporal.Force,
    'friction': temporal.Friction,  # Roberge et al., future work
}


# --------------------
# Build what a recipe chooses: 'name', or {name: {parameter: value}}, from a catalogue of parameter dataclasses.

T = TypeVar('T')


def choose(catalogue: Mapping[str, type[T]], entry: Any, kind: str, where: str) -> tuple[str, T]:
    """Return name and object of one entry of a recipe; `kind` is the noun for the error sentence."""
    entry = {entry: {}} if isinstance(entry, str) else entry
    if not isinstance(entry, Mapping) or len(entry) != 1:
        raise InvalidParameter(
            f"{where}: came {safe_repr(entry)}; a {kind} is written 'name' or 'name: {{parameter: value}}'"
        )
    [(name, values)] = entry.items()
    try:
        cls = find(catalogue, str(name), kind)
    except UnknownName as error:
        raise UnknownName(f'{where}: {error}') from error
    place = f"{where}, {kind} '{name}'"
    build = getattr(cls, 'from_recipe', None)  # of an entry whose parameters are not known beforehand
    return str(name), build(values or {}, place) if build else from_mapping(cls, values or {}, place)


def entry_of(chosen: Any) -> dict[str, Any]:
    """Return the parameters of what was chosen, as a recipe writes them."""
    write = getattr(chosen, 'as_recipe', None)
    return write() if write else dataclasses.asdict(chosen)


# --------------------
# Read the mapping in a recipe, or in the card of a model that was trained with one.


def card_of(name_or_path: str, subfolder: str = 'config/recipes') -> Path | None:
    """Return the card of a model, by NAME.npz, NAME.json or NAME; None for a recipe."""
    stem = name_or_path.removesuffix('.npz').removesuffix('.json')
    card = Path(f'{stem}.json').expanduser()
    unknown = stem not in shipped('texture_estimation', subfolder, '.yaml')
    return card if stem != name_or_path or (unknown and card.is_file()) else None


def read_recipe(
    name_or_path: str, subfolder: str = 'config/recipes', kind: str = 'recipe'
) -> tuple[str, Mapping[str, Any]]:
    """Return name and content of a recipe (YAML) that texture_estimation ships, or of any file.

    A model's card (JSON) holds its recipe under `recipe`; a model, NAME.npz or NAME, has the card NAME.json next to it.
    """
    card = card_of(name_or_path, subfolder)
    path = card or find_file(name_or_path, 'texture_estimation', subfolder, kind)
    content = load_card(path) if path.suffix == '.json' else load_yaml(path, kind)
    if not isinstance(content, Mapping):
        raise InvalidParameter(f"{kind} '{path}' holds {safe_repr(content)}; a mapping with the key 'inputs' is needed")
    return path.stem, content


# Windows described in one go: enough for speed, few enough for the memory cache.
CHUNK = 64
InputLayout = tuple[tuple[float, tuple[str, ...]], ...]  # rate and channels of each input


MOTION = ('speed_m_s', 'force_n', 'tangential_force_n')  # of a window, whatever its input
MOTION_FEATURES = (temporal.Speed, temporal.Force, temporal.Friction)
JOINT = '+'  # between the topics of a joint input
AGAIN = '#'  # between a topic and the name of a further description of it
RAW, SUBTRACTED = 'raw', 'tared'


@dataclass(frozen=True)
class InputFeatures:
    """The features of one input, or of several joined ('signal+signal_static'): (name, feature) in their order.

    One input may be described several times, with other features or parameters: what follows a '#' in its name
    distinguishes the descriptions ('signal', 'signal#2').
    An input with an axis, 'signal@x', is a topic while the finger slides along that axis.
    """

    topic: str
    features: tuple[tuple[str, Feature], ...]
    tare: str = ''

    @cached_property
    def window_names(self) -> tuple[str, ...]:
        """Names of the windows that are described: topics, with their axis where there is one."""
        return tuple(self.topic.partition(AGAIN)[0].split(JOINT))

    @cached_property
    def topics(self) -> tuple[str, ...]:
        """What is subscribed to."""
        return tuple(dict.fromkeys(map(topic_of, self.window_names)))

    def as_mapping(self) -> dict[str, Any]:
        """Return the section of a recipe."""
        stretches = [feature.to_m_s for _, feature in self.features if isinstance(feature, Stretched)]
        options: dict[str, Any] = {'stretch_to_m_s': stretches[0]} if stretches else {}
        if self.tare:
            options['tare'] = self.tare
        plain = [(name, one.feature if isinstance(one, Stretched) else one) for name, one in self.features]
        return {**options, 'features': [{name: dataclasses.asdict(one)} for name, one in plain]}  # type: ignore[call-overload]


@dataclass(frozen=True)
class InputOptions:
    """What an input of a recipe may define in addition to its features."""

    stretch_to_m_s: float = param(
        0.0, 'Speed to which windows are resampled before feature extraction; 0: no resampling.', unit='m/s', low=0.0
    )
    tare: str = param(
        '',
        "States what the features of levels expect: 'raw' samples, or 'tared' ones, of which the sensor node has "
        "subtracted the baseline; '' is for features that do not see the level.",
        choices=('', RAW, SUBTRACTED),
    )


@dataclass(frozen=True)
class FeatureSet:
    """What makes a feature vector of a window, in the order of the recipe.

    Examples
    --------
    >>> features = FeatureSet.from_mapping({'inputs': {'signal': {'features': ['mean', 'speed']}}})
    >>> window = Window(np.array([[1.0], [3.0]]), rate_hz=1000.0, channels=('pac',))
    >>> vector = features.extract(CutWindow(0, 'slide', 0.002, 0.001, {'signal': window}, speed_m_s=0.05))
    >>> dict(zip(vector.names, vector.values.tolist()))
    {'signal/mean/pac': 2.0, 'signal/speed': 0.05}
    """

    windows: WindowParams
    inputs: tuple[InputFeatures, ...]
    correction: Correction | None = None  # of another finger than that of the training
    _layouts: dict[InputLayout, tuple[tuple[str, ...], str]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @classmethod
    def load(cls, name_or_path: str) -> FeatureSet:
        """Read the feature set of a recipe (YAML), or of a model with the correction next to it; '' is 'default'.

        Raises
        ------
        UnknownName, InvalidParameter
            If there is no such file or it does not hold a feature set.
        """
        _, recipe = read_recipe(name_or_path or 'default')
        feature_set = cls.from_mapping(recipe, f"recipe '{name_or_path}'")
        if card_of(name_or_path or 'default') is None:
            return feature_set
        return dataclasses.replace(feature_set, correction=read_correction(name_or_path))

    @classmethod
    def from_mapping(cls, recipe: Mapping[str, Any], where: str = 'recipe') -> FeatureSet:
        """Build from the keys `windows` and `inputs` of a recipe; other keys are left alone.

        Parameters
        ----------
        recipe
            Content of a recipe.
        where
            What the mapping is, for the sentence of an error.

        Raises
        ------
        InvalidParameter, UnknownName
            If no input is named, or a feature or parameter is unknown or out of range.
        """
        windows = from_mapping(WindowParams, recipe.get('windows') or {}, f'{where}, windows')
        inputs = recipe.get('inputs')
        if not isinstance(inputs, Mapping) or not inputs:
            raise InvalidParameter(
                f'{where}: inputs is {safe_repr(inputs)}; name one or more, '
                "such as 'inputs: {signal: {features: [hjorth]}}'"
            )
        feature_set = cls(windows, tuple(_input(str(topic), section, where) for topic, section in inputs.items()))
        check_axes(feature_set.window_names)
        return feature_set

    def as_mapping(self) -> dict[str, Any]:
        """Return the feature set as a recipe writes it, every parameter spelt out."""
        return {
            'windows': dataclasses.asdict(self.windows),
            'inputs': {item.topic: item.as_mapping() for item in self.inputs},
        }

    @cached_property
    def window_names(self) -> tuple[str, ...]:
        """Names of the windows that the inputs describe, in order, each once: 'signal', or 'signal@x' of one axis."""
        return tuple(dict.fromkeys(chain.from_iterable(item.window_names for item in self.inputs)))

    @cached_property
    def topics(self) -> tuple[str, ...]:
        """What is subscribed to, in order, each once."""
        return tuple(dict.fromkeys(map(topic_of, self.window_names)))

    @property
    def unknown_levels(self) -> list[str]:
        """Topics of which no feature is the log power: whether they show a touch is unknown."""
        known = {
            item.topics[0]
            for item in self.inputs
            for name, feature in item.features
            if any(POWER.search(f'/{name}/{value}') for value in feature.names)
        }
        return [topic for topic in self.topics if topic not in known]

    def rest_levels(self, rest: Mapping[str, tuple[Array, float, tuple[str, ...]]]) -> dict[str, float]:
        """Return the level at rest by the name of each feature of a power.

        It is the median of stretches as long as a window: over more of it a level that settles would count as noise.

        Parameters
        ----------
        rest
            By topic the samples before the touch, (n_samples, n_channels), their rate in Hz and the channels.

        Returns
        -------
        dict
            Nothing where a topic has too few samples, or no feature of a power.
        """
        found: dict[str, float] = {}
        for item in () if self.unknown_levels else self.inputs:
            samples, rate_hz, channels = rest[item.topics[0]]
            if len(samples) < LEAST_AT_REST:
                return {}
            length = min(len(samples), max(1, round(self.windows.length_s * rate_hz)))
            cut = samples[: len(samples) // length * length].reshape(-1, length, len(channels))
            stretches: Array = cut[np.isfinite(cut).all(axis=(1, 2))]
            if not len(stretches):
                return {}
            windows = WindowBatch(stretches, rate_hz, channels=channels)
            for one in item.features:
                if powers := _log_powers(list(_names(replace(item, features=(one,)), channels))):
                    typical = np.median(one[1](windows).reshape(len(stretches), -1), axis=0)
                    found |= {name: _rms(typical[place]) for name, place in powers}
        return found

    def tare_faults(self, tared: Mapping[str, bool]) -> list[str]:
        """Return sentences on streams that are tared and should not be, or the other way round.

        Parameters
        ----------
        tared
            Whether the level without load is subtracted, by topic, as the messages hold it.
        """
        faults = []
        for item in self.inputs:
            for topic in item.topics if item.tare else ():
                if topic in tared and tared[topic] != (item.tare == SUBTRACTED):
                    what = 'subtracted' if tared[topic] else 'not subtracted'
                    faults.append(
                        f"the recipe expects '{topic}' {item.tare}, and its baseline is {what}; tare the sensor, or "
                        'change its parameter subtract_baseline'
                    )
        return faults

    def extract(self, event: WindowEvent) -> FeatureVector:
        """Return the features of a window; for the end of a slide, the empty vector that is `last`."""
        if isinstance(event, SlideEnd):
            return FeatureVector(
                start_ns=event.end_ns,
                exploration_id=event.exploration_id,
                window_s=0.0,
                hop_s=event.hop_s,
                last=True,
                skipped=event.skipped,
            )
        inputs = [event.windows[name] for name in self.window_names]
        motion: dict[str, Any] = {name: np.array(getattr(event, name)) for name in MOTION}
        values = self.values(
            [WindowBatch(item.samples, item.rate_hz, channels=item.channels, **motion) for item in inputs]
        )
        return self._vector(event, _layout(inputs), values)

    def extract_many(self, events: Iterable[WindowEvent]) -> list[FeatureVector]:
        """Return what `extract` returns for each event, to the last bit, but faster."""
        vectors: list[FeatureVector] = []
        for kind, group in groupby(events, self._kind):
            alike = list(group)
            if not kind:
                vectors += [self.extract(event) for event in alike]
                continue
            for start in range(0, len(alike), CHUNK):
                vectors += self._extract_alike(alike[start : start + CHUNK])  # type: ignore[arg-type]
        return vectors

    def names(self, layout: InputLayout) -> tuple[str, ...]:
        """Return the name of each value, given (rate, channels) of each input: 'signal/mean_log_bands/12/dynamic'."""
        return self._names_and_fingerprint(layout)[0]

    def fingerprint(self, layout: InputLayout) -> str:
        """Return what identifies the values, such as '3f9c12ab signal=2200Hz*1 signal_static=100Hz*22'.

        The hash covers inputs, features and window length; hop and skip do not change what a value means.
        """
        return self._names_and_fingerprint(layout)[1]

    def _kind(self, event: WindowEvent) -> tuple[Any, ...]:
        """Return the layout that events described together have in common; () for the end of a slide."""
        if isinstance(event, SlideEnd):
            return ()
        return tuple(
            (item.rate_hz, item.channels, item.samples.shape)
            for item in map(event.windows.__getitem__, self.window_names)
        )

    def _extract_alike(self, events: Sequence[CutWindow]) -> list[FeatureVector]:
        motion: dict[str, Any] = {name: np.array([getattr(event, name) for event in events]) for name in MOTION}
        inputs = [events[0].windows[name] for name in self.window_names]
        stacked = [
            WindowBatch(
                np.stack([event.windows[name].samples for event in events]),
                item.rate_hz,
                channels=item.channels,
                **motion,
            )
            for name, item in zip(self.window_names, inputs, strict=True)
        ]
        values = self.values(stacked)
        layout = _layout(inputs)
        return [self._vector(event, layout, row) for event, row in zip(events, values, strict=True)]

    def values(self, inputs: Sequence[WindowBatch]) -> Array:
        """Return the values of windows, (..., n_values)."""
        flat = (*inputs[0].samples.shape[:-2], -1)
        by_name = dict(zip(self.window_names, inputs, strict=True))
        if self.correction is not None:
            by_name = {name: self.correction.apply(topic_of(name), window) for name, window in by_name.items()}
        blocks = []
        for item in self.inputs:
            windows, *others = (by_name[name] for name in item.window_names)
            if others:
                windows = dataclasses.replace(windows, joined=tuple(others))
            blocks += [feature(windows).reshape(flat) for _, feature in item.features]
        return np.concatenate(blocks, axis=-1)

    def _vector(self, event: CutWindow, layout: InputLayout, values: Array) -> FeatureVector:
        names, fingerprint = self._names_and_fingerprint(layout)
        return FeatureVector(
            start_ns=event.start_ns,
            exploration_id=event.exploration_id,
            window_s=event.length_s,
            hop_s=event.hop_s,
            names=names,
            values=values,
            speed_m_s=event.speed_m_s,
            force_n=event.force_n,
            feature_set=fingerprint,
            skipped=event.skipped,
            motion=event.motion,
            direction_rad=event.direction_rad,
            sensor=event.windows[self.window_names[0]].sensor,
        )

    def _names_and_fingerprint(self, layout: InputLayout) -> tuple[tuple[str, ...], str]:
        if layout not in self._layouts:
            channels = dict(zip(self.window_names, (channels for _, channels in layout), strict=True))
            names = chain.from_iterable(_names(item, channels[item.window_names[0]]) for item in self.inputs)
            self._layouts[layout] = (tuple(names), self._fingerprint(layout))
        return self._layouts[layout]

    def _fingerprint(self, layout: InputLayout) -> str:
        inputs = {item.topic: dataclasses.replace(item, tare='').as_mapping() for item in self.inputs}
        meaning = {'inputs': inputs, 'windows': self.windows.length_s}
        digest = hashlib.sha256(json.dumps(meaning, sort_keys=True).encode()).hexdigest()[:8]
        met = [
            f'{name}={rate:.6g}Hz*{len(channels)}'
            for name, (rate, channels) in zip(self.window_names, layout, strict=True)
        ]
        corrected = f'{CORRECTED}{self.correction.fingerprint}' if self.correction else ''
        return ' '.join([digest, *met]) + corrected


def _input(topic: str, section: Any, where: str) -> InputFeatures:
    place = f"{where}, input '{topic}'"
    if not isinstance(section, Mapping) or not isinstance(section.get('features'), list) or not section['features']:
        raise InvalidParameter(
            f"{place}: came {safe_repr(section)}; a list under 'features' is needed, such as [hjorth]"
        )
    topics = topic.partition(AGAIN)[0].split(JOINT)
    if AGAIN in topic and not topic.partition(AGAIN)[2]:
        raise InvalidParameter(f"{place}: a further description of an input has a name after '#', as in 'signal#2'")
    if not all(topics) or len(set(topics)) < len(topics):
        raise InvalidParameter(f"{place}: inputs are joined by their names, as in 'signal+signal_static', each once")
    chosen = [choose(FEATURES, entry, 'feature', place) for entry in section['features']]
    names = [name for name, _ in chosen]
    for name, feature in chosen:
        if names.count(name) > 1:
            raise InvalidParameter(f"{place}: feature '{name}' is named twice; name it once")
        if len(topics) > 1 and not getattr(feature, 'joins', False):
            raise InvalidParameter(f"{place}: feature '{name}' describes one input; list it under '{topics[0]}'")
    options = from_mapping(InputOptions, {key: value for key, value in section.items() if key != 'features'}, place)
    if options.stretch_to_m_s and len(topics) > 1:
        raise InvalidParameter(f'{place}: joined inputs cannot be stretched; leave stretch_to_m_s out')
    if options.stretch_to_m_s:  # features of the motion itself stay as they are
        chosen = [
            (name, one if isinstance(one, MOTION_FEATURES) else Stretched(one, options.stretch_to_m_s))
            for name, one in chosen
        ]
    return InputFeatures(topic, tuple(chosen), options.tare)


def _names(item: InputFeatures, channels: tuple[str, ...]) -> Iterable[str]:
    for name, feature in item.features:
        columns = channels if feature.per_channel else ('',)
        if getattr(feature, 'per_pair', False):
            columns = tuple(f'{one}*{other}' for one, other in combinations(channels, 2))
        for channel in columns:
            for value in feature.names:
                yield '/'.join(part for part in (item.topic, name, value, channel) if part)


def _layout(inputs: Sequence[Window]) -> InputLayout:
    return tuple((item.rate_hz, item.channels) for item in inputs)


# --------------------
# Report in which part two fingerprints of feature sets differ.

ONE_RATE = "record all at one rate; a driver that measures it has 'rate_hz'"
PART = re.compile(r'(?P<topic>[^=\s]+)=(?P<rate>[^=*\s]+)Hz\*(?P<channels>\d+)')


def fingerprint_difference(came: str, trained: str) -> str:
    """Return what differs, in words; '' if nothing does."""
    if came == trained:
        return ''
    found, wanted = _inputs(came), _inputs(trained)
    if found.keys() != wanted.keys():
        return f'the inputs are {_listed(found)}, the model was trained on {_listed(wanted)}'
    for topic, (rate, channels) in found.items():
        trained_rate, trained_channels = wanted[topic]
        if rate != trained_rate:
            return (
                f"the sampling rate of '{topic}' is {rate} Hz, the model was trained at {trained_rate} Hz; use a model "
                f'trained at this rate, or {ONE_RATE}'
            )
        if channels != trained_channels:
            return (
                f"the number of channels of '{topic}' is {channels}, that of the training {trained_channels}; use a "
                'model of this sensor'
            )
    if came.partition(CORRECTED)[0] == trained.partition(CORRECTED)[0]:
        return (
            'the correction of the finger differs; start the feature_extractor and the classifier again, both with '
            "the model's card"
        )
    return "features or window length differ; start the feature_extractor with the model's card as its recipe"


def recipe_misfit(features: FeatureSet, trained: str) -> str:
    """Return why no signal gives the features of this recipe the fingerprint of a model, '' if one does."""
    wanted = _inputs(trained)
    met = [wanted.get(name, ('0', '0')) for name in features.window_names]
    layout = tuple((float(rate), tuple(map(str, range(int(channels))))) for rate, channels in met)
    return fingerprint_difference(features.fingerprint(layout), trained)


def _inputs(fingerprint: str) -> dict[str, tuple[str, str]]:
    return {match['topic']: (match['rate'], match['channels']) for match in PART.finditer(fingerprint)}


def _listed(inputs: dict[str, tuple[str, str]]) -> str:
    return ', '.join(inputs) or 'none'


# --------------------
# How one exploration was made: motion, sensor, and the speed, force, directions and signal level of its windows.

DIRECTION_DIGITS = 2  # so that a slide has few directions, however long it is
# In the names of the features that are the logarithm of a power, of a channel as in
# 'signal/moments/signal_log_power/dynamic', or of a whole array; a mean of logarithms would hide the touched taxels.
POWER = re.compile(r'(?<!/mean_statistics)/(moments/signal_log_power|log_variance|load_level)(?=/|$)')
LOAD = '/load_level'  # ends the name of the feature that holds the level of a whole array
LEAST_AT_REST = 10  # samples before the touch that show a level


# Of a feature of a power over a slide: geometric mean of the root mean square of its windows, in the unit of the
# signal, and the lowest and highest of the means over the first windows, however many.
SignalLevel = tuple[str, float, float, float]


@dataclass(frozen=True)
class SlideConditions:
    """The conditions of one exploration; unknown names are '', unknown numbers NaN."""

    motion: str = ''
    sensor: str = ''
    speed_m_s: float = math.nan
    force_n: float = math.nan
    directions_rad: tuple[float, ...] = ()
    speed_range_m_s: Interval = UNKNOWN
    force_range_n: Interval = UNKNOWN
    levels: tuple[SignalLevel, ...] = ()
    rest: tuple[tuple[str, float], ...] = ()  # of each feature of a power before the touch
    session: str = ''
    place: str = ''


class RunningConditions:
    """The conditions of an exploration, window by window."""

    def __init__(self) -> None:
        self.motion = self.sensor = ''
        self._speed = RunningMean()
        self._force = RunningMean()
        self.directions_rad: dict[float, None] = {}  # in the order in which they came
        self._powers: list[tuple[str, int, RunningMean]] | None = None  # of each log power its name, place and mean

    def update(self, vector: FeatureVector) -> None:
        """Take the conditions of one more window into account."""
        self.motion = vector.motion or self.motion
        self.sensor = vector.sensor or self.sensor
        self._speed.update(vector.speed_m_s)
        self._force.update(vector.force_n)
        if math.isfinite(vector.direction_rad):
            self.directions_rad[round(vector.direction_rad, DIRECTION_DIGITS)] = None
        if self._powers is None and vector.names:
            self._powers = [(name, place, RunningMean()) for name, place in _log_powers(vector.names)]
        for _, place, log_power in self._powers or ():
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
    def levels(self) -> Sequence[tuple[str, float]]:
        """Features of a power and their levels so far."""
        return [(name, _rms(power.value)) for name, _, power in self._powers or ()]

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
            tuple((name, _rms(power.value), *map(_rms, power.range)) for name, _, power in self._powers or ()),  # type: ignore[misc]
        )


def _rms(log_power: float) -> float:
    return math.exp(0.5 * log_power)


def _log_powers(names: Sequence[str]) -> list[tuple[str, int]]:
    """Return the features that are the logarithm of a power, and their places."""
    return [(name, place) for place, name in enumerate(names) if POWER.search(name)]


# --------------------
# Features of the altered copies of slides.


@dataclass(frozen=True, eq=False)
class FeatureCopies:
    """Features of changed copies of slides, copy by copy and in the order of time."""

    values: NDArray[np.float32]
    groups: NDArray[np.str_]
    copies: NDArray[np.intp]
    kinds: NDArray[np.str_]

    def select(self, rows: NDArray[np.bool_]) -> FeatureCopies:
        """Return these windows, (n,)."""
        return FeatureCopies(self.values[rows], self.groups[rows], self.copies[rows], self.kinds[rows])


@dataclass(frozen=True, eq=False)
class AugmentedFeatures:
    """What augmentation adds to labelled features."""

    copies: FeatureCopies
    disturbed: FeatureCopies
    gain_responses: Mapping[str, Array]  # by slide

    def gain_response(self, slides: NDArray[np.str_]) -> Array:
        """Return the mean change of each feature with the logarithm of the gain, of these slides."""
        used = set(slides.tolist())
        response: Array = np.mean([one for slide, one in self.gain_responses.items() if slide in used], axis=0)
        return response


# --------------------
# Windows of known surfaces, described: what is used for training and evaluated by.


@dataclass(frozen=True, eq=False)
class LabelledFeatures:
    """Feature vectors with their labels, slide by slide and in the order of time."""

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
        """Return the windows of a mask, (n,), or of indices."""
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
        """Gather feature vectors; `surfaces` holds the label of each exploration id, those without one are left out."""
        used = [vector for vector in vectors if not vector.last and surfaces.get(vector.exploration_id)]
        if not used:
            raise InvalidData('there is no window of a labelled surface; record slides with a surface named')
        fingerprints = sorted({vector.feature_set for vector in used})
        if len(fingerprints) > 1:
            raise ModelMismatch(
                f'the windows are described in different ways: {"; ".join(fingerprints)}; use those of one kind; '
                f'if only the rates differ, {ONE_RATE}'
            )
        running: defaultdict[str, RunningConditions] = defaultdict(RunningConditions)
        for vector in used:
            running[vector.exploration_id].update(vector)
        return cls(
            values=np.stack([vector.values for vector in used]),
            labels=np.array([surfaces[vector.exploration_id] for vector in used]),
            groups=np.array([vector.exploration_id for vector in used]),
            names=used[0].names,
            feature_set=used[0].feature_set,
            window_s=used[0].window_s,
            hop_s=used[0].hop_s,
            start_ns=np.array([vector.start_ns for vector in used], dtype=np.int64),
            conditions={exploration_id: conditions.get() for exploration_id, conditions in running.items()},
        )
