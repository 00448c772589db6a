# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Simulated slides of an experiment: how surfaces are touched, what is measured, and the features of its windows."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.config import find
from texture_core.errors import InvalidData
from texture_core.types import Array, Samples
from texture_estimation.learners.learner import Codes
from texture_features.feature_set import FeatureSet
from texture_features.windows import SEPARATOR, WindowBatch, WindowParams, axis_along
from texture_simulation.offline import APPROACH_S, CONTACT_S, LIFT_S, simulate_exploration, simulate_slide_streams
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import Scene
from texture_simulation.sensor_models import SENSORS
from texture_simulation.surfaces import Curved

Mask = NDArray[np.bool_]
ROUNDING = 1e-6  # of a sample: lengths in seconds are seldom exact
CHUNK = 64  # windows described in one go: what they and their spectra take should fit the processor's cache


@dataclass(frozen=True)
class View:
    """One of the views in which a trial measures a surface; the features of all views of a trial are joined."""

    finger: int = 0
    turned_rad: float = 0.0


@dataclass(frozen=True)
class Visits:
    """Trials that are alike, over each surface."""

    condition: str
    count: int
    sliding: SimulatedSlide
    views: tuple[View, ...] = (View(),)
    radius_m: float = 0.0
    random: float = 0.0


class EntireContacts(Visits):
    """Trials of which press and lift are part: together they last as long as the slide of others."""


@dataclass(frozen=True, eq=False)
class ArrayStream:
    """Scans of one input: samples (n_scans, n_samples, n_channels) at a rate, and names of the channels."""

    samples: Samples
    rate_hz: float
    channels: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class SlideArrays:
    """Equally long scans of known surfaces."""

    streams: Mapping[str, ArrayStream]
    labels: NDArray[np.str_]
    speed_m_s: Array
    force_n: Array
    _cut: dict[WindowParams, list[Mapping[str, WindowBatch]]] = field(default_factory=dict, repr=False)

    def of(self, chosen: Mask) -> SlideArrays:
        """Return some of the scans; `chosen` is (n_scans,)."""
        streams = {topic: replace(stream, samples=stream.samples[chosen]) for topic, stream in self.streams.items()}
        return SlideArrays(streams, self.labels[chosen], self.speed_m_s[chosen], self.force_n[chosen])

    def values(self, recipe: Any) -> Array:
        """Return the features with which a recipe is trained, (n_windows, n_features)."""
        return self.features(replace(recipe.feature_set, windows=recipe.training_windows))

    def features(self, feature_set: FeatureSet) -> Array:
        """Return the features of all windows, scan by scan, as many of each, (n_windows, n_features)."""
        if feature_set.windows not in self._cut:
            self._cut[feature_set.windows] = list(self._chunks(feature_set.windows))
        values = np.concatenate([
            feature_set.values([chunk[name] for name in feature_set.window_names])
            for chunk in self._cut[feature_set.windows]
        ])  # fmt: skip
        if not np.isfinite(values).all():
            raise InvalidData('a feature is not finite in some windows')
        return values

    def _chunks(self, windows: WindowParams) -> list[Mapping[str, WindowBatch]]:
        """Return the windows of all scans in parts, by input."""
        duration_s = min(stream.samples.shape[1] / stream.rate_hz for stream in self.streams.values())
        if duration_s - windows.skip_s < windows.length_s - ROUNDING:
            raise InvalidData(
                f'scans of {duration_s:g} s have no window of {windows.length_s:g} s after {windows.skip_s:g} s; '
                'use shorter windows or longer scans'
            )
        count = int((duration_s - windows.skip_s - windows.length_s) / windows.hop_s + ROUNDING) + 1
        chunks: list[Mapping[str, WindowBatch]] = []
        for first in range(0, len(self.labels), max(1, CHUNK // count)):
            part = slice(first, first + max(1, CHUNK // count))
            speed, force = (np.repeat(values[part], count) for values in (self.speed_m_s, self.force_n))
            inputs = {}
            for topic, stream in self.streams.items():
                length = round(windows.length_s * stream.rate_hz)
                starts = [round((windows.skip_s + n * windows.hop_s) * stream.rate_hz) for n in range(count)]
                samples = np.stack([stream.samples[part, start : start + length] for start in starts], axis=1)
                samples = samples.reshape(-1, *samples.shape[2:])
                inputs[topic] = WindowBatch(samples, stream.rate_hz, speed, force, channels=stream.channels)
            chunks.append(inputs)
        return chunks


@dataclass(frozen=True, eq=False)
class Slides:
    """Trials over known surfaces, in a random order: surface and condition of each, (n_slides,), and its views."""

    surfaces: tuple[str, ...]
    codes: Codes
    conditions: NDArray[np.str_]
    views: tuple[SlideArrays, ...]
    axes: tuple[str, ...] = ()  # along which the slides of each view go: 'x', 'y', or '' for neither

    @cached_property
    def _along_axes(self) -> SlideArrays:
        """Inputs with an axis, 'signal@x': the streams of the view along it."""
        streams = {
            f'{topic}{SEPARATOR}{axis}': stream
            for axis, view in zip(self.axes, self.views, strict=True)
            for topic, stream in view.streams.items()
        }
        return replace(self.views[0], streams=streams, _cut={})

    def _chosen(self, feature_set: FeatureSet, views: Sequence[int]) -> list[SlideArrays]:
        if feature_set.window_names != feature_set.topics:  # a feature set whose inputs have an axis joins the views
            return [self._along_axes]
        return [self.views[number] for number in views or range(len(self.views))]

    def extract(self, feature_set: FeatureSet, views: Sequence[int] = ()) -> tuple[Array, Codes]:
        """Return the features of all windows of some or all views, (n, n_features), and their slides, (n,)."""
        values = np.concatenate([view.features(feature_set) for view in self._chosen(feature_set, views)], axis=1)
        return values, np.repeat(np.arange(len(self.codes)), len(values) // len(self.codes))

    def names(self, feature_set: FeatureSet, views: Sequence[int] = ()) -> tuple[str, ...]:
        """Return the names of what `extract` returns, (n_features,)."""
        chosen = self._chosen(feature_set, views)
        streams = [chosen[0].streams[name] for name in feature_set.window_names]
        return feature_set.names(tuple((one.rate_hz, one.channels) for one in streams)) * len(chosen)


Touches = Sequence[tuple[str, Visits]]  # each surface with each kind of visits


def order_of(surfaces: Sequence[str], visits: Sequence[Visits], seed: int) -> tuple[Touches, NDArray[np.intp]]:
    """Return what is done, and the random order of all slides."""
    kinds = [(surface, one) for surface in surfaces for one in visits]
    return kinds, np.random.default_rng(seed).permutation(sum(one.count for _, one in kinds))


def kinds_of(surfaces: Sequence[str], visits: Sequence[Visits], seed: int) -> tuple[Codes, NDArray[np.str_]]:
    """Return surface and condition of each slide in that order, (n_slides,) each."""
    kinds, order = order_of(surfaces, visits, seed)
    counts = [one.count for _, one in kinds]
    codes = np.repeat([list(surfaces).index(surface) for surface, _ in kinds], counts)[order]
    return codes, np.repeat([one.condition for _, one in kinds], counts)[order]


def gather(scene: Scene, surfaces: Sequence[str], visits: Sequence[Visits], seed: int, *, slow: bool) -> Slides:
    """Return slides over surfaces of a scene, all of them for (); the randomness of each follows from its condition."""
    surfaces = tuple(surfaces or scene.surfaces)
    kinds, order = order_of(surfaces, visits, seed)
    codes, conditions = kinds_of(surfaces, visits, seed)
    counts = [one.count for _, one in kinds]
    speed = np.repeat([float(one.sliding.speed_m_s) for _, one in kinds], counts)[order]
    force = np.repeat([float(one.sliding.force_n) for _, one in kinds], counts)[order]
    measured = {stream.topic: stream for stream in find(SENSORS, scene.sensor, 'sensor model').streams}
    views = []
    for number in range(len(visits[0].views)):
        parts = [_measured(scene, surface, one, number, seed, slow=slow) for surface, one in kinds]
        streams = {
            topic: ArrayStream(
                np.concatenate([part[topic] for part in parts])[order],
                measured[topic].rate_hz,
                measured[topic].channels,
            )
            for topic in parts[0]
        }
        views.append(SlideArrays(streams, np.asarray(surfaces)[codes], speed, force))
    axes = tuple(axis_along(float(visits[0].sliding.direction_rad) + view.turned_rad) for view in visits[0].views)
    return Slides(surfaces, codes, conditions, tuple(views), axes)


def _measured(
    scene: Scene, surface: str, visits: Visits, number: int, seed: int, *, slow: bool
) -> Mapping[str, Samples]:
    view: View = visits.views[number]
    kind = find(SENSORS, scene.sensor, 'sensor model')
    # A window is cut where every stream has samples: the slowest decides, and a slide ends with one of its samples.
    slowest_hz = min(stream.rate_hz for stream in kind.streams[: None if slow else 1])
    duration_s = math.ceil(visits.sliding.duration_s * slowest_hz - ROUNDING) / slowest_hz
    seeds = [seed, list(scene.surfaces).index(surface), zlib.crc32(visits.condition.encode())]
    rng = np.random.default_rng([*seeds, number])
    sliding = replace(_sliding(visits, np.random.default_rng(seeds)), duration_s=duration_s)
    sliding = replace(sliding, direction_rad=sliding.direction_rad + view.turned_rad)
    if isinstance(visits, EntireContacts):
        contacts = [_contact(scene, surface, sliding, kind.fast.rate_hz, rng) for _ in range(visits.count)]
        return {kind.fast.topic: np.stack(contacts)}
    touched = scene
    if visits.radius_m:  # one object with another curvature
        curved = replace(scene.surface(surface), shape=Curved(visits.radius_m))
        touched = replace(scene, surfaces={**scene.surfaces, surface: curved})
    return simulate_slide_streams(touched, surface, visits.count, sliding, rng, finger=view.finger, slow=slow)


def _contact(scene: Scene, surface: str, sliding: SimulatedSlide, rate_hz: float, rng: np.random.Generator) -> Samples:
    """Return what the fast stream measures from the first touch to the end of the lift."""
    slide_s = sliding.duration_s - CONTACT_S - LIFT_S
    speed_m_s, force_n = float(sliding.speed_m_s), float(sliding.force_n)
    _, recording = simulate_exploration(
        scene, surface, speed_m_s, force_n, slide_s, start_ns=0, exploration_id='', rng=rng
    )
    samples = np.concatenate([batch.samples for batch in recording['signal']])
    return samples[round(APPROACH_S * rate_hz) :][: round(sliding.duration_s * rate_hz)]


def _sliding(visits: Visits, rng: np.random.Generator) -> SimulatedSlide:
    """Return how the fingers of each trial go: all views of a trial alike."""
    if not visits.random:
        return visits.sliding
    speed, force = (1.0 + visits.random * rng.uniform(-1.0, 1.0, (2, visits.count))) * np.array(
        [[visits.sliding.speed_m_s], [visits.sliding.force_n]]
    )
    heading = rng.uniform(0.0, 2.0 * math.pi, visits.count)
    return replace(visits.sliding, speed_m_s=speed, force_n=force, direction_rad=heading)
