"""The slides of an experiment, simulated, and their features."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from texture_benchmarks.papers.protocol import RecognitionTask, View, Visits
from texture_core.arrays import Array, Samples
from texture_core.catalogue import find
from texture_estimation.learners.learner import Codes
from texture_estimation.search.feature_cache import FeatureCache
from texture_estimation.search.slide_arrays import ArrayStream, SlideArrays
from texture_features.feature_set import FeatureSet
from texture_features.windowing.axes import SEPARATOR, axis_along
from texture_simulation.offline import simulate_slide_streams
from texture_simulation.scene import Scene
from texture_simulation.sensors.catalogue import SENSORS
from texture_simulation.simulated_slide import SimulatedSlide
from texture_simulation.surfaces.curvature import Curved

ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class Slides:
    """Trials over known surfaces, in a random order.

    Parameters
    ----------
    surfaces
        Names.
    codes : (n_slides,)
        Number of the surface of each.
    conditions : (n_slides,) of text
        How it was touched.
    views
        What each consists of.
    axes
        Axis along which the slides of each view go: 'x', 'y', or '' for neither.
    """

    surfaces: tuple[str, ...]
    codes: Codes
    conditions: NDArray[np.str_]
    views: tuple[SlideArrays, ...]
    axes: tuple[str, ...] = ()

    @cached_property
    def _caches(self) -> tuple[FeatureCache, ...]:
        return tuple(FeatureCache(view) for view in self.views)

    @cached_property
    def _along_axes(self) -> FeatureCache:
        """Features of inputs with an axis, 'signal@x': the streams of the view along it."""
        streams = {
            f'{topic}{SEPARATOR}{axis}': stream
            for axis, view in zip(self.axes, self.views, strict=True)
            for topic, stream in view.streams.items()
        }
        return FeatureCache(replace(self.views[0], streams=streams, _known={}))

    def extract(self, feature_set: FeatureSet, views: Sequence[int] = ()) -> tuple[Array, Codes]:
        """Return the features of all windows, of some or all views, (n, n_features), and their slides, (n,).

        A feature set whose inputs have an axis joins the views itself.

        Parameters
        ----------
        feature_set
            Windows and features.
        views
            Numbers of the views; () for all.

        Returns
        -------
        (n, n_features)
            Features of windows.
        (n,)
            Number of the slide of each.
        """
        joins = feature_set.window_names != feature_set.topics
        chosen = [self._along_axes] if joins else [self._caches[n] for n in views or range(len(self.views))]
        values = np.concatenate([cache.values(feature_set) for cache in chosen], axis=1)
        return values, self.views[0](feature_set.windows).slides


def gather(scene: Scene, task: RecognitionTask, seed: int, *, slow: bool) -> Slides:
    """Return the slides of a task.

    A slide is the same in all tasks that hold it: its randomness follows from seed, surface and condition.

    Parameters
    ----------
    scene
        What is touched.
    task
        How.
    seed
        Of everything random.
    slow
        Whether the slow stream is needed.

    Returns
    -------
    Slides
    """
    surfaces = task.surfaces or tuple(scene.surfaces)
    kinds = [(surface, visits) for surface in surfaces for visits in task.visits]
    counts = [visits.count for _, visits in kinds]
    order = np.random.default_rng(seed).permutation(sum(counts))
    codes = np.repeat([surfaces.index(surface) for surface, _ in kinds], counts)[order]
    conditions = np.repeat([visits.condition for _, visits in kinds], counts)[order]
    speed = np.repeat([float(visits.sliding.speed_m_s) for _, visits in kinds], counts)[order]
    force = np.repeat([float(visits.sliding.force_n) for _, visits in kinds], counts)[order]
    kind = find(SENSORS, scene.sensor, 'sensor model')
    measured = {stream.topic: stream for stream in kind.streams}
    views = []
    for number in range(len(task.visits[0].views)):
        parts = [_measured(scene, surface, visits, number, seed, slow=slow) for surface, visits in kinds]
        streams = {
            topic: ArrayStream(
                np.concatenate([part[topic] for part in parts])[order],
                measured[topic].rate_hz,
                measured[topic].channels,
            )
            for topic in parts[0]
        }
        views.append(SlideArrays(streams, np.asarray(surfaces)[codes], speed, force))
    axes = tuple(axis_along(float(task.visits[0].sliding.direction_rad) + v.turned_rad) for v in task.visits[0].views)
    return Slides(surfaces, codes, conditions, tuple(views), axes)


def _measured(
    scene: Scene, surface: str, visits: Visits, number: int, seed: int, *, slow: bool
) -> Mapping[str, Samples]:
    view: View = visits.views[number]
    kind = find(SENSORS, scene.sensor, 'sensor model')
    # A window is cut where every stream has samples: the slowest decides, and a slide ends with one of its samples.
    slowest_hz = min(stream.rate_hz for stream in kind.streams[: None if slow else 1])
    duration_s = math.ceil(visits.sliding.duration_s * slowest_hz - ROUNDING) / slowest_hz
    own = [seed, list(scene.surfaces).index(surface), zlib.crc32(visits.condition.encode())]
    rng = np.random.default_rng([*own, number])
    sliding = replace(_sliding(visits, np.random.default_rng(own)), duration_s=duration_s)
    sliding = replace(sliding, direction_rad=sliding.direction_rad + view.turned_rad)
    touched = _shaped(scene, surface, visits.radius_m)
    return simulate_slide_streams(touched, surface, visits.count, sliding, rng, finger=view.finger, slow=slow)


def _sliding(visits: Visits, rng: np.random.Generator) -> SimulatedSlide:
    """Return how the fingers of each trial go: all views of a trial alike."""
    if not visits.random:
        return visits.sliding
    speed, force = (1.0 + visits.random * rng.uniform(-1.0, 1.0, (2, visits.count))) * np.array(
        [[visits.sliding.speed_m_s], [visits.sliding.force_n]]
    )
    heading = rng.uniform(0.0, 2.0 * math.pi, visits.count)
    return replace(visits.sliding, speed_m_s=speed, force_n=force, direction_rad=heading)


def _shaped(scene: Scene, surface: str, radius_m: float) -> Scene:
    """Return the scene with one object curved in another way; as it is for a radius of 0."""
    if not radius_m:
        return scene
    curved = replace(scene.surface(surface), shape=Curved(radius_m))
    return replace(scene, surfaces={**scene.surfaces, surface: curved})
