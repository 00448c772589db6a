"""Collect what the estimators say about one exploration."""

from __future__ import annotations

import threading
from collections.abc import Collection
from dataclasses import dataclass

from texture_core.estimates import RoughnessEstimate, TextureEstimate
from texture_core.parameters import param


@dataclass(frozen=True)
class CertaintyParams:
    """When a texture is certain, and how long to wait for the last word on it."""

    certain_confidence: float = param(
        0.0, 'Confidence that a texture needs to be certain, besides what its model asks for.', low=0.0, high=1.0
    )
    estimate_timeout_s: float = param(
        1.0, 'Wait so long after the lift for the final estimates.', unit='s', low=0.0, high=60.0
    )

    def certain(self, estimate: TextureEstimate) -> bool:
        """Return whether the texture is certain enough to end the slide."""
        return estimate.known and estimate.certain and estimate.confidence >= self.certain_confidence


class Estimates:
    """The newest texture and roughness estimate of one exploration; safe for threads."""

    def __init__(self, exploration_id: str) -> None:
        self.texture = TextureEstimate(0, exploration_id)
        self.roughness = RoughnessEstimate(0, exploration_id)
        self._news = threading.Condition()
        self._given_up = False

    def update(self, estimate: TextureEstimate | RoughnessEstimate) -> None:
        """Take over a newer estimate."""
        with self._news:
            if isinstance(estimate, TextureEstimate):
                self.texture = estimate
            else:
                self.roughness = estimate
            self._news.notify_all()

    def wait_until_final(self, kinds: Collection[str], timeout_s: float) -> bool:
        """Wait until the estimates of these kinds ('texture', 'roughness') are final; return whether they are."""
        with self._news:
            self._news.wait_for(lambda: self._given_up or self._final(kinds), timeout_s)
            return self._final(kinds)

    def give_up(self) -> None:
        """End the waiting: nothing will come any more."""
        with self._news:
            self._given_up = True
            self._news.notify_all()

    def _final(self, kinds: Collection[str]) -> bool:
        return all(getattr(self, kind).final for kind in kinds)
