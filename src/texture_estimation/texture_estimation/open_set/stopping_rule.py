"""Early stopping of a slide by a rule fitted on held-out slides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array

Mask = NDArray[np.bool_]
# Rules tried: end at this confidence, or after so much sliding whatever the confidence. In windows that do not overlap.
CONFIDENCES = 1.0 - np.geomspace(0.5, 1e-4, 50)
MAX_WINDOWS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0)


@dataclass(frozen=True)
class StoppingRule:
    """Truncated sequential test: stop at a confidence threshold, or after a number of effective windows.

    Source: Wald 1945 for a decision at a threshold of the evidence; the end after some time, as with one window in a
    hundred that would go on for ever, is fitted with the threshold.

    Parameters
    ----------
    confidence
        Decision threshold on the probability of the best label.
    max_windows
        Effective window count at which a slide is stopped whatever the confidence.
    """

    confidence: float = 0.95
    max_windows: float = 1e6

    def certain(self, confidence: float, effective_windows: float) -> bool:
        """Return whether the slide may end."""
        return confidence >= self.confidence or effective_windows >= self.max_windows


def fit_stopping_rule(
    confidences: Sequence[Array], right: Sequence[Mask], effective_window_counts: Sequence[Array], wrong: float
) -> StoppingRule:
    """Return the rule with the shortest mean slide whose error rate is at most `wrong`.

    If no rule reaches the error rate, the one with the lowest error rate is returned.

    Parameters
    ----------
    confidences, right, effective_window_counts : of each slide (n_windows,)
        After each window: confidence of the best label, whether it is the true one, length of the evidence.
    wrong
        Share of the slides that may be decided wrongly.
    """
    tried = [StoppingRule(float(confidence), max_windows) for confidence in CONFIDENCES for max_windows in MAX_WINDOWS]
    outcomes = [_outcome(rule, confidences, right, effective_window_counts) for rule in tried]
    least = max(wrong, min(errors for errors, _ in outcomes))
    good = [(mean, number) for number, (errors, mean) in enumerate(outcomes) if errors <= least]
    return tried[min(good)[1]]


def _outcome(
    rule: StoppingRule, confidences: Sequence[Array], right: Sequence[Mask], effective_window_counts: Sequence[Array]
) -> tuple[float, float]:
    """Return the share of wrong decisions, and the mean length of the evidence they took."""
    wrong, taken = 0, 0.0
    for confidence, correct, effective_windows in zip(confidences, right, effective_window_counts, strict=True):
        over = (confidence >= rule.confidence) | (effective_windows >= rule.max_windows)
        place = int(over.argmax()) if over.any() else len(over) - 1
        wrong += not bool(correct[place])
        taken += float(effective_windows[place])
    return wrong / len(confidences), taken / len(confidences)
