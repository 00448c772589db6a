"""How small an error rate the slides held out of a training can show."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import UnionType
from typing import Any

from texture_core.arrays import Array
from texture_core.errors import InvalidData
from texture_core.plain_data import safe_repr

LEVEL = 0.05  # the error rate exceeds its upper bound in so many of all trainings
PERCENT = 100.0
ENTRY = 'error_bound'  # of a model card
MAX_SLIDES = 1_000_000
ALLOWED = f'slides, a whole number from 0 to {MAX_SLIDES}, and max_error_rate, a number from 0 to 1'


@dataclass(frozen=True)
class ErrorBound:
    """Upper 95 % bound of the error rate of decisions when none of the held-out slides was decided wrongly.

    Few slides show little, however confident the classifier is in each: without an error in n slides the error rate may
    still be 1 - 0.05^(1/n), about 3/n. No confidence above the rest is reported, and no slide is ended early where the
    allowed error rate lies below the bound.

    Source: Hanley & Lippman-Hand 1983 for the rule of three; Clopper & Pearson 1934 for the bound.

    Parameters
    ----------
    slides
        Number of held-out slides, at most MAX_SLIDES; 0 if nothing was held out.
    max_error_rate
        Allowed fraction of wrong decisions when slides are ended early, 0 to 1.

    Raises
    ------
    InvalidData
        If a value has another type or is out of its range.

    Examples
    --------
    >>> few = ErrorBound(slides=12, max_error_rate=0.02)
    >>> round(few.highest_confidence, 3), few.shown, few.slides_needed
    (0.779, False, 149)
    """

    slides: int
    max_error_rate: float

    def __post_init__(self) -> None:
        if not (_is_within(self.slides, int, MAX_SLIDES) and _is_within(self.max_error_rate, int | float, 1.0)):
            slides, rate = safe_repr(self.slides), safe_repr(self.max_error_rate)
            raise InvalidData(f'{ENTRY} has slides {slides:.40} and max_error_rate {rate:.40}; it needs {ALLOWED}')

    @classmethod
    def from_card(cls, card: Mapping[str, Any]) -> ErrorBound:
        """Return the bound that a model card holds.

        Raises
        ------
        InvalidData
            If the card holds none, as cards of earlier versions, or if it has other keys or values.
        """
        if ENTRY not in card:
            raise InvalidData(f"its card is of an earlier version and has no entry '{ENTRY}'; it needs {ALLOWED}")
        values = card[ENTRY]
        if not isinstance(values, Mapping) or set(values) != {'slides', 'max_error_rate'}:
            raise InvalidData(f'{ENTRY} is {safe_repr(values):.80}; it needs {ALLOWED}')
        return cls(**values)

    @property
    def highest_confidence(self) -> float:
        """Largest confidence that the held-out slides can show; 1 if none was held out: nothing is calibrated then."""
        return float(LEVEL ** (1.0 / self.slides)) if self.slides else 1.0

    @property
    def slides_needed(self) -> float:
        """Smallest number of held-out slides that can show the allowed error rate; infinite if no error is allowed."""
        if self.max_error_rate >= 1.0:
            return 0
        if self.max_error_rate <= 0.0:
            return math.inf
        return math.ceil(math.log(LEVEL) / math.log1p(-self.max_error_rate))

    @property
    def shown(self) -> bool:
        """Whether the held-out slides can show the allowed error rate."""
        return self.slides >= self.slides_needed

    @property
    def reason(self) -> str:
        """Why no slide is ended early, in one sentence; '' if slides are."""
        if self.shown:
            return ''
        rate = f'at most {PERCENT * self.max_error_rate:g} % wrong decisions'
        if math.isinf(self.slides_needed):
            return f'no early stopping: {rate} cannot be shown'
        limit = f'; with {self.slides} the confidence is {self.highest_confidence:.2f} at most' if self.slides else ''
        needed = f'{self.slides_needed:g} slides or more to be held out of the training'
        return f'too few slides for early stopping: {rate} need {needed}{limit}'

    def limited(self, probabilities: Array) -> Array:
        """Return the probabilities, mixed with equal ones just so much that none is above the highest confidence.

        Parameters
        ----------
        probabilities : (n_labels,)
            They add up to 1, as the returned ones do; their order stays.

        Returns
        -------
        (n_labels,)
        """
        equal, highest = 1.0 / len(probabilities), float(probabilities.max())
        limit = max(self.highest_confidence, equal)
        if highest <= limit:
            return probabilities
        kept = (limit - equal) / (highest - equal)
        mixed: Array = equal + kept * (probabilities - equal)
        return mixed


def _is_within(value: Any, kind: type | UnionType, largest: float) -> bool:
    """Return whether a value is a number of this type from 0 to the largest one; a truth value is no number."""
    is_number = isinstance(value, kind) and not isinstance(value, bool)
    return is_number and bool(0 <= value <= largest)
