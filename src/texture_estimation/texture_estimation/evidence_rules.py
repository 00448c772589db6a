# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rules that combine the window predictions of one slide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.config import param
from texture_core.types import Array
from texture_estimation.gaussians import DISTANCE_WINDOWS
from texture_estimation.learners.learner import log_softmax

# A label without a single vote keeps so much, so that its logarithm is finite.
MIN_FRACTION = 1e-6
ROUNDING = 1e-9


@dataclass(frozen=True)
class EvidenceRule:
    """Frozen parameters of a rule, which weights all windows equally unless stated otherwise.

    Where several labels share the highest log-probability nothing is decided: the surface is unclassified.
    """

    @property
    def group(self) -> int:
        """How many consecutive windows decide together, the newest complete group for the slide; 0: all windows."""
        return 0

    def window_evidence(self, log_probabilities: Array) -> Array:
        """Return the evidence of a window, (..., n_labels), from its log-probabilities; the rule gets its mean."""
        return log_probabilities

    def window_weight(self, effective_windows: float | Array) -> Any:
        """Return the weight of windows in the mean evidence."""
        return 1.0

    def log_posterior(self, mean_evidence: Array, effective_windows: float | Array, tempering_exponent: float) -> Array:
        """Return the log-probability of each texture given all windows so far, (..., n_labels)."""
        raise NotImplementedError

    def posterior(self, mean_evidence: Array, effective_windows: float, tempering_exponent: float) -> Array:
        """Return the probabilities of which `log_posterior` gives the logarithms, (..., n_labels)."""
        return np.exp(self.log_posterior(mean_evidence, effective_windows, tempering_exponent))


@dataclass(frozen=True)
class SoftVote(EvidenceRule):
    """Mean log-probability of the windows, times their tempered effective number.

    Independent windows would count as their number n. Windows of one slide share force, place and contact, and count
    as n^tempering_exponent; the exponent is fitted on held-out slides.

    Examples
    --------
    >>> mean = np.log(np.array([0.8, 0.2]))
    >>> SoftVote().posterior(mean, effective_windows=2.0, tempering_exponent=1.0).round(3).tolist()  # 0.8² : 0.2²
    [0.941, 0.059]
    """

    late_weight: float = param(
        1.0,
        'Weight of windows later than five that do not overlap, relative to those before; with a smaller one, '
        'drift within a long slide changes its label less, and what shows late in a slide counts less.',
        low=0.0,
        high=1.0,
    )

    def window_weight(self, effective_windows: float | Array) -> Any:
        """Return 1 for the first windows, on which the distance rests, and `late_weight` for those after them."""
        return self.late_weight ** (effective_windows > DISTANCE_WINDOWS + ROUNDING)

    def log_posterior(self, mean_evidence: Array, effective_windows: float | Array, tempering_exponent: float) -> Array:
        """Return log softmax(n^tempering_exponent · mean log p), the last axis being the textures."""
        return log_softmax(mean_evidence * effective_windows**tempering_exponent)


@dataclass(frozen=True)
class MajorityVote(EvidenceRule):
    """Each window votes for its best label; one that is undecided for none. Too few equal votes: unclassified.

    Windows vote in groups: with five windows of 0.1 s a decision rests on 0.5 s, however long the slide is. The newest
    complete group decides, the first one while it grows.

    Source: Roberge et al., "Textures recognition through tactile exploration", section IV.B: a scan of 500 ms is cut
    into five parts, and the answer that at least three of them give is the answer.

    Examples
    --------
    >>> rule = MajorityVote(share=0.6, windows=5)
    >>> votes = rule.window_evidence(np.log(np.array([[0.9, 0.1], [0.8, 0.2], [0.7, 0.3], [0.2, 0.8]])))
    >>> rule.posterior(votes.mean(axis=0), effective_windows=4.0, tempering_exponent=1.0).round(2).tolist()
    [0.75, 0.25]
    """

    share: float = param(
        0.6,
        'Fraction of the votes that a label needs; a larger fraction leaves more slides undecided,'
        ' 0 takes the label with the most votes.',
        low=0.0,
        high=1.0,
    )
    windows: int = param(
        5,
        'How many consecutive windows vote together; more decide later and more safely, 0 lets all windows of the '
        'slide vote.',
        low=0,
        high=10_000,
    )

    @property
    def group(self) -> int:
        """How many consecutive windows vote together."""
        return self.windows

    def window_evidence(self, log_probabilities: Array) -> Array:
        """Return 1 for the best label and 0 for the others; 0 for all if several are best."""
        best = log_probabilities == np.maximum.reduce(log_probabilities, axis=-1, keepdims=True)
        alone = np.count_nonzero(best, axis=-1, keepdims=True) == 1
        return (best & alone).astype(np.float64)

    def log_posterior(self, mean_evidence: Array, effective_windows: float | Array, tempering_exponent: float) -> Array:
        """Return the logarithm of the fractions of the votes; equal ones for all labels where the majority is lacking.

        What did not vote is shared out equally. `tempering_exponent` does not matter: votes are counted.
        """
        n_labels = mean_evidence.shape[-1]
        most = np.maximum.reduce(mean_evidence, axis=-1, keepdims=True) * effective_windows
        won = most >= self.share * np.maximum(effective_windows, self.windows) - ROUNDING
        abstained = 1.0 - np.add.reduce(mean_evidence, axis=-1, keepdims=True)
        fractions = np.maximum(mean_evidence + abstained / n_labels, MIN_FRACTION)
        return log_softmax(np.where(won, np.log(fractions), 0.0))


class GroupedEvidence:
    """Mean evidence of the windows of a slide, live and offline: of all so far, or of the newest complete group.

    While the first group grows, it counts as it is. As long as the windows add up to less than one that is trusted, the
    mean counts less.
    """

    def __init__(self, rule: EvidenceRule, n_labels: int) -> None:
        self._rule = rule
        self._sum, self._count, self._weight, self._begin = np.zeros(n_labels), 0, 0.0, 0.0  # of the newest group
        self._all = self._trusted = 0.0  # effective windows
        self._complete = False
        self.mean: Array = self._sum
        self.windows = 0.0  # that the mean rests on

    def add(self, evidence: Array, effective_windows: float, trusted: float = 1.0) -> None:
        """Add the evidence of a window, (n_labels,), with which the slide has this many effective windows."""
        group = self._rule.group
        if self._count == group and self._complete:
            self._sum, self._count, self._weight, self._begin = np.zeros(len(evidence)), 0, 0.0, self._all
        weight = self._rule.window_weight(effective_windows) * trusted
        self._sum += weight * evidence
        self._weight += weight
        self._count += 1
        self._trusted += trusted * (effective_windows - self._all)
        self._all = effective_windows
        self._complete |= self._count == group
        if not self._complete or self._count == group:
            self.mean = self._sum / self._weight * min(self._trusted, 1.0)
            self.windows = effective_windows - self._begin


def followed(
    rule: EvidenceRule, evidence: Array, hop_ratio: float, trusted: Array | float = 1.0
) -> tuple[Array, Array]:
    """Return the mean evidence of a slide after each window, and the effective window count that it rests on."""
    so_far, means, windows = GroupedEvidence(rule, evidence.shape[1]), np.empty_like(evidence), np.empty(len(evidence))
    for place, trust in enumerate(np.broadcast_to(trusted, len(evidence)).tolist()):
        so_far.add(evidence[place], 1.0 + place * hop_ratio, trust)
        means[place], windows[place] = so_far.mean, so_far.windows
    return means, windows


EVIDENCE_RULES: Mapping[str, type[EvidenceRule]] = {
    'soft_vote': SoftVote,
    'majority_vote': MajorityVote,  # Roberge et al.
}
