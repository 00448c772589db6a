# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is measured on the growing evidence of slides."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from texture_core.types import AnyArray, Array, TextureEstimate

TIMES_S = (0.5, 1.0, 2.5, 5.0)
CALIBRATION_BINS = 15
TOLERANCE_S = 1e-6  # sums of hops are not exact


@dataclass(frozen=True, eq=False)
class SlideResult:
    """Estimates of a model during one slide."""

    surface: str
    window_labels: Sequence[str]
    estimates: Sequence[TextureEstimate]
    final: TextureEstimate | None = None
    voters: int = 0

    @property
    def decisions(self) -> Sequence[TextureEstimate]:
        """The estimates with which a decision is made: all, or those of complete votes; of none is one, the last."""
        found = self.estimates[self.voters - 1 :: self.voters] if self.voters else self.estimates
        return found or self.estimates[-1:]

    @property
    def end(self) -> TextureEstimate:
        """The estimate at the end of the slide."""
        return self.final or self.estimates[-1]

    def after(self, seconds: float) -> TextureEstimate | None:
        """Return the estimate after so much sliding; None if the slide has less or the first window is longer."""
        if not self.estimates or self.estimates[-1].evidence_s < seconds - TOLERANCE_S:
            return None
        # Windows may be longer than the requested time.
        received = [estimate for estimate in self.estimates if estimate.evidence_s <= seconds + TOLERANCE_S]
        return received[-1] if received else None

    def early(self) -> TextureEstimate:
        """Return the first estimate that is decided and known, else the last one."""
        return next((e for e in self.estimates if e.decided and e.accepted), self.estimates[-1])


def window_accuracy(results: Sequence[SlideResult]) -> float:
    """Return the accuracy of single windows."""
    right = [label == result.surface for result in results for label in result.window_labels]
    return float(np.mean(right))


def accuracy_at(results: Sequence[SlideResult], seconds: float) -> float | None:
    """Return the accuracy of slides after a time of sliding; None if no slide is long enough."""
    decided = [(result.surface, result.after(seconds)) for result in results]
    return _fraction([estimate.label == surface for surface, estimate in decided if estimate is not None])


def unclassified_windows(results: Sequence[SlideResult]) -> float:
    """Return the fraction of single windows that are unclassified."""
    return float(np.mean([not label for result in results for label in result.window_labels]))


def early_decision(results: Sequence[SlideResult]) -> Mapping[str, float]:
    """Return accuracy and mean time of decisions taken as soon as the estimate is decided."""
    decisions = [(result.surface, result.early()) for result in results]
    return {
        'accuracy': float(np.mean([estimate.label == surface for surface, estimate in decisions])),
        'mean_s': float(np.mean([estimate.evidence_s for _, estimate in decisions])),
    }


def calibration_error(results: Sequence[SlideResult]) -> float:
    """Return the expected calibration error of the confidence over all estimates, in bins of equal width.

    Source: Guo et al. 2017, equation 3.
    """
    reported = [(e.confidence, e.label == result.surface) for result in results for e in result.estimates if e.label]
    if not reported:
        return 0.0
    confidence, right = np.array(reported, dtype=np.float64).T
    # A confidence of 1 belongs to the last bin.
    bins = np.minimum((confidence * CALIBRATION_BINS).astype(int), CALIBRATION_BINS - 1)
    gaps = np.bincount(bins, confidence - right)  # sums: the weights of the bins are in them
    return float(np.abs(gaps).sum() / len(right))


def ended_early(results: Sequence[SlideResult]) -> float | None:
    """Return the fraction of slides that end early, accepted, where early stopping is on; None without slides."""
    return _fraction([early.decided and early.accepted for early in map(SlideResult.early, results)])


def accepted_wrong(results: Sequence[SlideResult]) -> Mapping[str, float | None]:
    """Return the fraction of slides that were accepted but wrong, over any surfaces; None without slides."""
    early = [e.accepted and e.decided and e.label != surface for surface, e in _early_ends(results)]
    final = [result.end.accepted and result.end.label != result.surface for result in results]
    return {'early': _fraction(early), 'final': _fraction(final)}


def rejected(results: Sequence[SlideResult]) -> Mapping[str, float | None]:
    """Return the fraction of slides that were rejected, early ('early') or at their end ('final'); None without slides.

    A slide that is never decided continues to its end: there its last estimate also counts as early.
    """
    early = [not estimate.accepted for _, estimate in _early_ends(results)]
    return {'early': _fraction(early), 'final': _fraction([not result.end.accepted for result in results])}


def rejections(results: Sequence[SlideResult]) -> Mapping[str, int]:
    """Return how many slides were rejected at their end for each reason, such as 'novel', the most frequent first."""
    ends = [result.end for result in results if result.estimates]
    return dict(Counter(end.rejection.name.lower() for end in ends if not end.accepted).most_common())


def _early_ends(results: Sequence[SlideResult]) -> list[tuple[str, TextureEstimate]]:
    """Return surface and estimate at the end of each slide that ends as soon as it is decided and known."""
    return [
        (result.surface, early if early.accepted and early.decided else result.end)
        for result in results
        for early in [result.early()]
    ]


def _fraction(which: Sequence[bool]) -> float | None:
    return float(np.mean(which)) if which else None


def confusion(results: Sequence[SlideResult], labels: Sequence[str]) -> AnyArray:
    """Return how many windows of each surface (row) got each label (column), (n_labels, n_labels).

    Unclassified windows are in no column.
    """
    place = {label: index for index, label in enumerate(labels)}
    table = np.zeros((len(labels), len(labels)), dtype=int)
    for result in results:
        for label in filter(None, result.window_labels):
            table[place[result.surface], place[label]] += 1
    return table


def curve(results: Sequence[SlideResult]) -> tuple[Array, Array]:
    """Return seconds of sliding and the accuracy of slides after them, as far as every slide reaches.

    The times are those at which decisions are made: windows that vote together decide when their vote is complete.
    """
    shortest = min((result.estimates[-1].evidence_s for result in results), default=0.0)
    # Sums of hops differ in the last digits from slide to slide.
    times = sorted({round(e.evidence_s, 6) for result in results for e in result.decisions})
    times = [seconds for seconds in times if seconds <= shortest + TOLERANCE_S]
    points = [(seconds, accuracy) for seconds in times if (accuracy := accuracy_at(results, seconds)) is not None]
    return np.array([seconds for seconds, _ in points]), np.array([accuracy for _, accuracy in points])
