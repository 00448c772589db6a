"""Conformal prediction sets: the smallest sets of textures with a given coverage."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array

EFFECTIVE_WINDOWS = (1.0, 2.0, 4.0, 8.0)  # lengths of evidence at which it is learnt, in windows that do not overlap


@dataclass(frozen=True)
class PredictionSets:
    """Split conformal prediction: textures at least as probable as the true one is in all but a few held-out slides.

    The coverage holds on average over slides like those held out; not for each texture, and not for a later day.

    Source: Vovk, Gammerman & Shafer 2005; Angelopoulos & Bates 2021, section 1.

    Parameters
    ----------
    coverage
        Share of slides whose texture is to be in the set.
    effective_window_counts, thresholds
        Effective window count, and the smallest probability of a texture in the set.
    """

    coverage: float = 0.95
    effective_window_counts: tuple[float, ...] = (1.0,)
    thresholds: tuple[float, ...] = (0.0,)

    def members(self, probabilities: Array, effective_windows: float) -> list[int]:
        """Return the numbers of the textures in the set, the most probable first; never empty."""
        thresholds = min(
            float(np.interp(effective_windows, self.effective_window_counts, self.thresholds)),
            float(probabilities.max()),
        )
        order = np.argsort(-probabilities, kind='stable')
        return [int(number) for number in order if probabilities[number] >= thresholds]


def fit_prediction_sets(
    posteriors: Sequence[Array], truths: Sequence[int], effective_window_counts: Sequence[Array], coverage: float
) -> PredictionSets:
    """Return the sets for a coverage from slides held out of the training.

    Parameters
    ----------
    posteriors : of each slide (n_windows, n_labels)
        Log-probabilities after each window.
    truths
        Number of the true texture of each slide.
    effective_window_counts : of each slide (n_windows,)
        Length of the evidence after each window.
    coverage
        Share of slides whose texture is to be in the set.
    """
    thresholds = []
    rank = math.floor((len(truths) + 1) * (1.0 - coverage))  # so many slides may lie below: with this rank it is exact
    for effective_windows in EFFECTIVE_WINDOWS:
        places = [int(np.abs(own - effective_windows).argmin()) for own in effective_window_counts]
        true = np.sort([np.exp(p[place, truth]) for p, place, truth in zip(posteriors, places, truths, strict=True)])
        thresholds.append(float(true[rank - 1]) if rank else 0.0)
    return PredictionSets(coverage, EFFECTIVE_WINDOWS, tuple(thresholds))
