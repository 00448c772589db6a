"""Conformal prediction sets: the smallest sets of textures with a given coverage."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array

ROUNDING = 1e-9
EFFECTIVE_WINDOWS = (1.0, 2.0, 4.0, 8.0)  # lengths of evidence at which it is fitted, in windows that do not overlap


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
        Effective window count, and the smallest probability of a texture in the set; empty if the held-out slides were
        too few for the coverage.

    Examples
    --------
    >>> sets = PredictionSets(0.9, effective_window_counts=(1.0,), thresholds=(0.15,))
    >>> sets.members(np.array([0.2, 0.7, 0.1]), effective_windows=1.0)
    [1, 0]
    """

    coverage: float = 0.95
    effective_window_counts: tuple[float, ...] = ()
    thresholds: tuple[float, ...] = ()

    @property
    def reason(self) -> str:
        """Why there are no sets, in one sentence; '' if there are."""
        if self.thresholds:
            return ''
        return (
            f'too few slides for a prediction set: a coverage of {100 * self.coverage:g} % needs '
            f'{slides_needed(self.coverage)} slides or more to be held out of the training'
        )

    def members(self, probabilities: Array, effective_windows: float) -> list[int]:
        """Return the numbers of the textures in the set, the most probable first; none only for a `reason`.

        Parameters
        ----------
        probabilities : (n_labels,)
            Of each texture after the slide.
        effective_windows
            Effective window count of the slide.
        """
        if not self.thresholds:
            return []
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

    With too few slides for the coverage every texture would be in each set: there are none then.

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

    Returns
    -------
    PredictionSets
        With a threshold, or with the reason why there is none.
    """
    thresholds = []
    rank = _rank(len(truths), coverage)
    if not rank:
        return PredictionSets(coverage)
    for effective_windows in EFFECTIVE_WINDOWS:
        places = [int(np.abs(own - effective_windows).argmin()) for own in effective_window_counts]
        true = np.sort([np.exp(p[place, truth]) for p, place, truth in zip(posteriors, places, truths, strict=True)])
        thresholds.append(float(true[rank - 1]))
    return PredictionSets(coverage, EFFECTIVE_WINDOWS, tuple(thresholds))


def slides_needed(coverage: float) -> int:
    """Return the smallest number of held-out slides from which sets of this coverage can be fitted."""
    number = max(1, round(1.0 / (1.0 - coverage)) - 1)
    return number if _rank(number, coverage) else number + 1


def _rank(slides: int, coverage: float) -> int:
    """Return how many of the slides held out may lie below the threshold for the coverage to be exact."""
    return math.floor((slides + 1) * (1.0 - coverage) + ROUNDING)
