"""When slides end that end at a confidence, and how many of them are right."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from texture_core.arrays import Array
from texture_evaluation.metrics import SlideResult


def decided_at(results: Sequence[SlideResult], confidences: Sequence[float]) -> tuple[Array, Array]:
    """Return mean time (s) and share right of slides that end at a confidence or go on to their end, (n,) each.

    Parameters
    ----------
    results
        Slides with their estimates.
    confidences : (n,)
        Confidence at which a slide ends, 0 to 1.

    Returns
    -------
    (n,)
        Mean time, s.
    (n,)
        Share of slides that are right, 0 to 1.
    """
    times, shares = [], []
    for confidence in confidences:
        ends = [next((e for e in r.estimates if e.confidence >= confidence), r.estimates[-1]) for r in results]
        times.append(float(np.mean([end.evidence_s for end in ends])))
        shares.append(float(np.mean([end.label == result.surface for end, result in zip(ends, results, strict=True)])))
    return np.array(times), np.array(shares)
