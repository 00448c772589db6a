"""The smallest confidence that a slide over a known surface has, by the length of its evidence."""

from __future__ import annotations

import math
import sys
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import InvalidData

ENTRY = 'confidence_floor'  # of a model card
# Lengths of evidence at which it is fitted, in windows that do not overlap. Up to the last one the confidence of known
# slides grows, which tells them from disturbed slides that resemble two textures.
EFFECTIVE_WINDOWS = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0)
LARGEST = 1.0 - sys.float_info.epsilon  # confidence whose log-odds are finite


@dataclass(frozen=True)
class ConfidenceFloor:
    """Smallest confidence of the best label with which a surface is taken for known.

    A slide that resembles two textures after much evidence is like no slide of the training, even if it is near to the
    slides of both.

    Source: Hendrycks & Gimpel 2017 for the confidence as a novelty score; Vovk, Gammerman & Shafer 2005 for its limit.

    Parameters
    ----------
    effective_window_counts
        Lengths of evidence, ascending; none if there is no limit.
    log_odds
        Logarithm of p / (1 - p) at each, where p is the smallest confidence of a known surface.

    Raises
    ------
    InvalidData
        If the two have different lengths, the lengths of evidence do not ascend, or a number is not finite.

    Examples
    --------
    >>> floor = ConfidenceFloor((1.0, 10.0), (-1.0, 4.0))
    >>> floor.reached(0.5, effective_windows=1.0), floor.reached(0.5, effective_windows=10.0)
    (True, False)
    >>> ConfidenceFloor().reached(0.1, effective_windows=10.0)
    True
    """

    effective_window_counts: tuple[float, ...] = ()
    log_odds: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        counts = self.effective_window_counts
        ascending = all(earlier < later for earlier, later in pairwise(counts))
        if len(counts) != len(self.log_odds) or not ascending or not all(map(math.isfinite, (*counts, *self.log_odds))):
            raise InvalidData(
                f'{ENTRY} has {len(counts)} effective_window_counts and {len(self.log_odds)} log_odds; it needs as '
                'many of both, finite, the counts ascending'
            )

    @classmethod
    def from_card(cls, card: Mapping[str, Any]) -> ConfidenceFloor:
        """Return the limit that a model card holds.

        Raises
        ------
        InvalidData
            If the card has no entry of it. A model without a limit has one that is empty.
        """
        if ENTRY not in card:
            raise InvalidData(f"its card has no entry '{ENTRY}', the smallest confidence of known surfaces")
        return cls(**{name: tuple(map(float, values)) for name, values in card[ENTRY].items()})

    def reached(self, confidence: float, effective_windows: float) -> bool:
        """Return whether a known surface may have so little confidence.

        Parameters
        ----------
        confidence
            Probability of the best label, 0 to 1.
        effective_windows
            Effective window count so far.

        Returns
        -------
        bool
        """
        return not self.log_odds or confidence >= 1.0 / (1.0 + math.exp(-self._at(effective_windows)))

    def _at(self, effective_windows: float) -> float:
        """Return the log-odds, linear between two lengths of evidence."""
        counts = self.effective_window_counts
        after = bisect_right(counts, effective_windows)
        if after == 0 or after == len(counts):
            return self.log_odds[max(after - 1, 0)]
        low, high = self.log_odds[after - 1 : after + 1]
        return low + (high - low) * (effective_windows - counts[after - 1]) / (counts[after] - counts[after - 1])


def fit_confidence_floor(
    confidences: Sequence[Array], effective_window_counts: Sequence[Array], rate: float
) -> ConfidenceFloor:
    """Return the limit that a fraction of the slides over known surfaces stays below.

    Parameters
    ----------
    confidences : of each slide (n_windows,)
        Of the best label after each window, of undisturbed slides held out of the training that end with the right one.
    effective_window_counts : of each slide (n_windows,)
        Length of the evidence after each window.
    rate
        Fraction of the slides that may lie below the limit at each length of evidence.

    Returns
    -------
    ConfidenceFloor
        Without a limit if the slides are too few for the fraction.
    """
    rank = int((len(confidences) + 1) * rate)
    if not rank:
        return ConfidenceFloor()
    log_odds = []
    for length in EFFECTIVE_WINDOWS:
        places = [int(np.abs(own - length).argmin()) for own in effective_window_counts]
        found = np.sort([own[place] for own, place in zip(confidences, places, strict=True)])
        limit = min(float(found[rank - 1]), LARGEST)
        log_odds.append(math.log(limit / (1.0 - limit)))
    return ConfidenceFloor(EFFECTIVE_WINDOWS, tuple(log_odds))
