"""Collect the estimates of one exploration."""

from __future__ import annotations

import threading
from collections.abc import Collection
from dataclasses import dataclass

from texture_core.estimates import RoughnessEstimate, TextureEstimate
from texture_core.parameters import param


@dataclass(frozen=True)
class EarlyStoppingParams:
    """When a slide may end early, and how long to wait for the final estimates."""

    min_confidence: float = param(
        0.0,
        'Sets the lowest confidence that ends a slide early, besides the stopping rule of the model; a '
        'higher value slides longer.',
        low=0.0,
        high=1.0,
    )
    estimate_timeout_s: float = param(
        1.0, 'Sets how long to wait for the final estimates after the finger was lifted.', unit='s', low=0.0, high=60.0
    )

    def may_stop(self, estimate: TextureEstimate) -> bool:
        """Return whether the texture estimate may end the slide."""
        return estimate.known and estimate.decided and estimate.confidence >= self.min_confidence


class ExplorationEstimates:
    """The newest texture and roughness estimate of one exploration; safe for threads."""

    def __init__(self, exploration_id: str) -> None:
        self.texture = TextureEstimate(0, exploration_id)
        self.roughness = RoughnessEstimate(0, exploration_id)
        self._changed = threading.Condition()
        self._cancelled = False

    def update(self, estimate: TextureEstimate | RoughnessEstimate) -> None:
        """Take over a newer estimate."""
        with self._changed:
            if isinstance(estimate, TextureEstimate):
                self.texture = estimate
            else:
                self.roughness = estimate
            self._changed.notify_all()

    def wait_until_final(self, kinds: Collection[str], timeout_s: float) -> bool:
        """Wait until the estimates of these kinds ('texture', 'roughness') are final; return whether they are."""
        with self._changed:
            self._changed.wait_for(lambda: self._cancelled or self._final(kinds), timeout_s)
            return self._final(kinds)

    def cancel(self) -> None:
        """End the waiting: no further estimate will arrive."""
        with self._changed:
            self._cancelled = True
            self._changed.notify_all()

    def _final(self, kinds: Collection[str]) -> bool:
        return all(getattr(self, kind).final for kind in kinds)
