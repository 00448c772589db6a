"""Features computed once, however many individuals ask for them."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import InvalidData
from texture_estimation.search.labelled_windows import Cut
from texture_estimation.search.parallel import ParallelMap, serial_map
from texture_features.feature import Feature, WindowBatch
from texture_features.feature_set import JOINT, FeatureSet, InputFeatures
from texture_features.windowing.time_stretch import Stretched
from texture_features.windowing.windows import WindowParams

# Windows described in one go: what they and their spectra take should fit the processor's cache.
CHUNK = 64
Key = tuple[WindowParams, str, Hashable]


class FeatureCache:
    """Values of feature sets on the same slides.

    A feature is computed once for all feature sets that hold it. One whose values are among those of a wider one, as
    the n highest peaks are among more, says so by its methods `widest` and `of_widest`: the wider one is computed.

    Parameters
    ----------
    cut
        Gives the windows.
    most_peaks
        Largest number of spectral peaks that will be asked for.

    Examples
    --------
    >>> from texture_estimation.search.slide_arrays import ArrayStream, SlideArrays
    >>> samples = np.random.default_rng(0).standard_normal((8, 50, 1)) * np.repeat([1.0, 9.0], 4)[:, None, None]
    >>> labels = np.repeat(['cork', 'felt'], 4)
    >>> slides = SlideArrays({'signal': ArrayStream(samples, 100.0)}, labels, np.full(8, 0.05), np.ones(8))
    >>> inputs = {'signal': {'features': ['log_variance']}}
    >>> features = FeatureSet.from_mapping({'windows': {'length_s': 0.5}, 'inputs': inputs})
    >>> FeatureCache(slides).values(features).shape
    (8, 1)
    """

    def __init__(self, cut: Cut, most_peaks: int = 15) -> None:
        self._cut = cut
        self._most_peaks = most_peaks
        self._chunks: dict[Key, list[WindowBatch]] = {}
        self._blocks: dict[Key, Array] = {}
        self.hits = 0
        self.misses = 0

    def values(self, feature_set: FeatureSet, parallel_map: ParallelMap = serial_map) -> Array:
        """Return the values of each window, (n, n_values).

        Parameters
        ----------
        feature_set
            Windows, inputs and features.
        parallel_map
            Over what missing features are computed.

        Returns
        -------
        (n, n_values)
            In the order of the features of the set.
        """
        return self.many([feature_set], parallel_map)[0]

    def many(self, feature_sets: Sequence[FeatureSet], parallel_map: ParallelMap = serial_map) -> list[Array]:
        """Return the values of each feature set, (n, n_values) each; missing ones are computed in parallel.

        Parameters
        ----------
        feature_sets
            All of the same windows.
        parallel_map
            Over what missing features are computed.

        Returns
        -------
        list of (n, n_values)
            In the order of the sets.

        Raises
        ------
        InvalidData
            If a value is not finite.
        """
        wanted = {
            self._key(feature_set.windows, item, feature): (feature_set.windows, item, self._source(feature))
            for feature_set in feature_sets
            for item in feature_set.inputs
            for _, feature in item.features
        }
        missing = [key for key in wanted if key not in self._blocks]
        self.hits += len(wanted) - len(missing)
        self.misses += len(missing)
        jobs = [(self._windows(windows, item), feature) for windows, item, feature in map(wanted.__getitem__, missing)]
        for key, block in zip(missing, parallel_map(_describe, jobs), strict=True):
            if not np.isfinite(block).all():
                raise InvalidData(
                    f"feature {key[2]!r} of '{key[1]}' is not finite in some windows; leave it out of the search"
                )
            self._blocks[key] = block
        return [self._joined(feature_set) for feature_set in feature_sets]

    def _joined(self, feature_set: FeatureSet) -> Array:
        blocks = []
        for item in feature_set.inputs:
            for _, feature in item.features:
                block = self._blocks[self._key(feature_set.windows, item, feature)]
                blocks.append(_derived(block, feature).reshape(len(block), -1))
        return np.concatenate(blocks, axis=1)

    def _windows(self, params: WindowParams, item: InputFeatures) -> list[WindowBatch]:
        key = (params, JOINT.join(item.window_names), None)
        if key not in self._chunks:
            inputs = self._cut(params).inputs
            first, *others = (inputs[topic] for topic in item.window_names)
            self._chunks[key] = [
                replace(_some(first, rows), joined=tuple(_some(other, rows) for other in others))
                for rows in (slice(start, start + CHUNK) for start in range(0, len(first.samples), CHUNK))
            ]
        return self._chunks[key]

    def _key(self, params: WindowParams, item: InputFeatures, feature: Feature) -> Key:
        return params, JOINT.join(item.window_names), self._source(feature)

    def _source(self, feature: Feature) -> Any:
        """Return the feature from whose values those of `feature` are taken."""
        if isinstance(feature, Stretched):
            return replace(feature, feature=self._source(feature.feature))
        widest = getattr(feature, 'widest', None)
        return widest(self._most_peaks) if widest else feature


def _some(windows: WindowBatch, rows: slice) -> WindowBatch:
    speed, force = windows.speed_m_s[rows], windows.force_n[rows]
    return WindowBatch(windows.samples[rows], windows.rate_hz, speed, force, channels=windows.channels)


def _derived(block: Array, feature: Feature) -> Array:
    """Return the values of `feature` of those of its source, (n, n_channels, n_names)."""
    if isinstance(feature, Stretched):
        return _derived(block, feature.feature)
    of_widest = getattr(feature, 'of_widest', None)
    return np.asarray(of_widest(block)) if of_widest else block


def _describe(job: tuple[list[WindowBatch], Feature]) -> Array:
    chunks, feature = job
    return np.concatenate([feature(windows) for windows in chunks])
