"""The textures of which one is the right one: as few as possible, with a coverage that holds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array

WORTHS = (1.0, 2.0, 4.0, 8.0)  # lengths of evidence at which it is learnt, in windows that do not overlap


@dataclass(frozen=True)
class PredictionSets:
    """Split conformal prediction: textures at least as probable as the true one is in all but a few held-out slides.

    The coverage holds on average over slides like those held out; not for each texture, and not for a later day.

    Source: Vovk, Gammerman & Shafer 2005; Angelopoulos & Bates 2021, section 1.

    Parameters
    ----------
    coverage
        Share of slides whose texture is to be in the set.
    worths, least
        Length of the evidence, and the probability from which a texture is in the set.
    """

    coverage: float = 0.95
    worths: tuple[float, ...] = (1.0,)
    least: tuple[float, ...] = (0.0,)

    def members(self, probabilities: Array, worth: float) -> list[int]:
        """Return the numbers of the textures in the set, the most probable first; never empty."""
        least = min(float(np.interp(worth, self.worths, self.least)), float(probabilities.max()))
        order = np.argsort(-probabilities, kind='stable')
        return [int(number) for number in order if probabilities[number] >= least]


def learnt(
    posteriors: Sequence[Array], truths: Sequence[int], worths: Sequence[Array], coverage: float
) -> PredictionSets:
    """Return the sets for a coverage from slides held out of the training.

    Parameters
    ----------
    posteriors : of each slide (n_windows, n_labels)
        Log-probabilities after each window.
    truths
        Number of the true texture of each slide.
    worths : of each slide (n_windows,)
        Length of the evidence after each window.
    coverage
        Share of slides whose texture is to be in the set.
    """
    least = []
    rank = math.floor((len(truths) + 1) * (1.0 - coverage))  # so many slides may lie below: with this rank it is exact
    for worth in WORTHS:
        places = [int(np.abs(own - worth).argmin()) for own in worths]
        true = np.sort([np.exp(p[place, truth]) for p, place, truth in zip(posteriors, places, truths, strict=True)])
        least.append(float(true[rank - 1]) if rank else 0.0)
    return PredictionSets(coverage, WORTHS, tuple(least))
