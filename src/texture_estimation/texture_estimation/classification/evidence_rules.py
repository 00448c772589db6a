"""How the judgements of the windows of one slide are joined."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.log_probabilities import log_softmax, softmax

# A label without a single vote keeps so much, so that its logarithm is finite.
MIN_SHARE = 1e-6
ROUNDING = 1e-9


class EvidenceRule(Protocol):
    """Frozen parameters of a rule.

    Where several labels share the highest log-probability nothing is decided: the surface is unclassified.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def voice(self, log_probabilities: Array) -> Array:
        """Return what a window says, (..., n_labels), of its log-probabilities; the rule is given the mean of it."""

    def log_posterior(self, mean_voice: Array, independent_windows: float | Array, growth: float) -> Array:
        """Return the log-probability of each texture given all windows so far, (..., n_labels).

        Parameters
        ----------
        mean_voice : (..., n_labels)
        independent_windows : (..., 1) or a number
            Sliding time over the length of a window: as many windows would not overlap.
        growth
            Exponent with which the evidence of one slide grows, learnt from slides held out of the training.
        """

    def posterior(self, mean_voice: Array, independent_windows: float, growth: float) -> Array:
        """Return the probabilities of which `log_posterior` gives the logarithms; it costs half of that."""


@dataclass(frozen=True)
class SoftVote:
    """Mean log-probability of the windows, times the number of windows that they are worth.

    Windows that did not overlap and had nothing else in common would be worth their number n; those of one slide share
    force, place and contact, and are worth n^growth, with `growth` learnt from slides held out of the training.
    """

    def voice(self, log_probabilities: Array) -> Array:
        """Return the log-probabilities as they are."""
        return log_probabilities

    def log_posterior(self, mean_voice: Array, independent_windows: float | Array, growth: float) -> Array:
        """Return log softmax(n^growth · mean log p), the last axis being the textures."""
        return log_softmax(mean_voice * independent_windows**growth)

    def posterior(self, mean_voice: Array, independent_windows: float, growth: float) -> Array:
        """Return softmax(n^growth · mean log p)."""
        return softmax(mean_voice * independent_windows**growth)


@dataclass(frozen=True)
class MajorityVote:
    """Each window votes for its best label; one that is undecided for none. Too few equal votes: unclassified.

    Source: Roberge et al., "Textures recognition through tactile exploration", section IV.B: a scan is cut into five
    parts, and the answer that at least three of them give is the answer.
    """

    share: float = param(0.6, 'Share of the votes that the answer needs; 0 for the most votes.', low=0.0, high=1.0)
    parts: int = param(5, 'The share is that of so many windows at least, even when there are fewer yet.', low=1)

    def voice(self, log_probabilities: Array) -> Array:
        """Return 1 for the best label and 0 for the others; 0 for all if several are best."""
        best = log_probabilities == np.maximum.reduce(log_probabilities, axis=-1, keepdims=True)
        alone = np.count_nonzero(best, axis=-1, keepdims=True) == 1
        votes: Array = (best & alone).astype(np.float64)
        return votes

    def log_posterior(self, mean_voice: Array, independent_windows: float | Array, growth: float) -> Array:
        """Return the logarithm of the shares of the votes; equal ones for all labels where the majority is lacking.

        What did not vote is shared out equally. `growth` does not matter: votes are counted.
        """
        n_labels = mean_voice.shape[-1]
        most = np.maximum.reduce(mean_voice, axis=-1, keepdims=True) * independent_windows
        won = most >= self.share * np.maximum(independent_windows, self.parts) - ROUNDING
        abstained = 1.0 - np.add.reduce(mean_voice, axis=-1, keepdims=True)
        shares = np.maximum(mean_voice + abstained / n_labels, MIN_SHARE)
        return log_softmax(np.where(won, np.log(shares), 0.0))

    def posterior(self, mean_voice: Array, independent_windows: float, growth: float) -> Array:
        """Return the shares of the votes; equal ones for all labels where the majority is lacking."""
        probabilities: Array = np.exp(self.log_posterior(mean_voice, independent_windows, growth))
        return probabilities


EVIDENCE_RULES: Mapping[str, type[EvidenceRule]] = {
    'soft_vote': SoftVote,
    'majority_vote': MajorityVote,  # Roberge et al.
}
