"""Windows of known surfaces, described: what is used for training and evaluated by."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import AnyArray, Array
from texture_core.errors import InvalidData, ModelMismatch
from texture_core.features import FeatureVector
from texture_core.signal import NANOSECONDS
from texture_core.slide_motion import SlideMotion
from texture_features.slide_conditions import RunningConditions, SlideConditions

if TYPE_CHECKING:  # which needs scipy
    from texture_features.augmentation.feature_copies import AugmentedFeatures


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
        group_similar = sorted({vector.feature_set for vector in used})
        if len(group_similar) > 1:
            raise ModelMismatch(
                f'the windows are described in different ways: {"; ".join(group_similar)}; use those of one kind'
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
