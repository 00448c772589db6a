"""When to end a slide: as soon as going on is not worth the time, by a rule learnt from slides held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array

Mask = NDArray[np.bool_]
# Rules tried: end at this confidence, or after so much sliding whatever the confidence. In windows that do not overlap.
CONFIDENCES = 1.0 - np.geomspace(0.5, 1e-4, 50)
PATIENCES = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0)


@dataclass(frozen=True)
class Stopping:
    """A sequential test that is cut short.

    Source: Wald 1945 for a decision at a threshold of the evidence; the end after some time, as with one window in a
    hundred that would go on for ever, is learnt with the threshold.

    Parameters
    ----------
    confidence
        Of the most probable texture, at which a slide may end.
    patience
        Evidence, in windows that do not overlap, after which more of it has not helped.
    """

    confidence: float = 0.95
    patience: float = 1e6

    def certain(self, confidence: float, worth: float) -> bool:
        """Return whether the slide may end."""
        return confidence >= self.confidence or worth >= self.patience


def learnt(confidences: Sequence[Array], right: Sequence[Mask], worths: Sequence[Array], wrong: float) -> Stopping:
    """Return the rule that ends slides soonest, on average, with at most so many decisions wrong.

    Where no rule errs as rarely, the one that errs least; of those alike, the soonest.

    Parameters
    ----------
    confidences, right, worths : of each slide (n_windows,)
        After each window: confidence of the best label, whether it is the true one, length of the evidence.
    wrong
        Share of the slides that may be decided wrongly.
    """
    tried = [Stopping(float(confidence), patience) for confidence in CONFIDENCES for patience in PATIENCES]
    outcomes = [_outcome(rule, confidences, right, worths) for rule in tried]
    least = max(wrong, min(errors for errors, _ in outcomes))
    good = [(mean, number) for number, (errors, mean) in enumerate(outcomes) if errors <= least]
    return tried[min(good)[1]]


def _outcome(
    rule: Stopping, confidences: Sequence[Array], right: Sequence[Mask], worths: Sequence[Array]
) -> tuple[float, float]:
    """Return the share of wrong decisions, and the mean length of the evidence they took."""
    wrong, taken = 0, 0.0
    for confidence, correct, worth in zip(confidences, right, worths, strict=True):
        over = (confidence >= rule.confidence) | (worth >= rule.patience)
        place = int(over.argmax()) if over.any() else len(over) - 1
        wrong += not bool(correct[place])
        taken += float(worth[place])
    return wrong / len(confidences), taken / len(confidences)
