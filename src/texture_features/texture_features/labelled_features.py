"""Windows of known surfaces, described: what is used for training and evaluated by."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.errors import InvalidData, ModelMismatch
from texture_core.features import FeatureVector
from texture_core.slide_motion import SlideMotion


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

    Raises
    ------
    InvalidData
        If the shapes contradict each other.
    """

    values: Array
    labels: NDArray[np.str_]
    groups: NDArray[np.str_]
    names: tuple[str, ...]
    feature_set: str
    window_s: float
    hop_s: float
    motions: Mapping[str, SlideMotion] = field(default_factory=dict)

    def __post_init__(self) -> None:
        shape = (len(self.labels), len(self.names))
        if self.values.shape != shape or self.groups.shape != self.labels.shape:
            raise InvalidData(
                f'labelled features have values of shape {self.values.shape}, {len(self.labels)} labels, '
                f'{len(self.groups)} groups and {len(self.names)} names; shape {shape} and as many groups are needed'
            )

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
        )
