"""How the judgements of the windows of one slide are joined."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from texture_core.arrays import Array
from texture_estimation.log_probabilities import log_softmax


class EvidenceRule(Protocol):
    """Frozen parameters of a rule."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def log_posterior(self, mean_log_probabilities: Array, independent_windows: float | Array, growth: float) -> Array:
        """Return the log-probability of each texture given all windows so far."""


@dataclass(frozen=True)
class SoftVote:
    """Mean log-probability of the windows, times the number of windows that they are worth.

    Windows that did not overlap and had nothing else in common would be worth their number n; those of one slide share
    force, place and contact, and are worth n^growth, with `growth` learnt from slides held out of the training.
    """

    def log_posterior(self, mean_log_probabilities: Array, independent_windows: float | Array, growth: float) -> Array:
        """Return log softmax(n^growth · mean log p), the last axis being the textures."""
        return log_softmax(mean_log_probabilities * independent_windows**growth)


EVIDENCE_RULES: Mapping[str, type[EvidenceRule]] = {
    'soft_vote': SoftVote,
}
