"""How small an error rate the slides held out of a training can show."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texture_core.arrays import Array

LEVEL = 0.05  # the error rate exceeds its upper bound in so many of all trainings
PERCENT = 100.0


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
        Number of held-out slides; 0 if nothing was held out.
    max_error_rate
        Allowed fraction of wrong decisions when slides are ended early.

    Examples
    --------
    >>> few = ErrorBound(slides=12, max_error_rate=0.02)
    >>> round(few.highest_confidence, 3), few.shown, few.slides_needed
    (0.779, False, 149)
    """

    slides: int
    max_error_rate: float

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
            return f'never certain: {rate} cannot be shown'
        limit = f'; with {self.slides} the confidence is {self.highest_confidence:.2f} at most' if self.slides else ''
        return f'never certain: {rate} need {self.slides_needed:g} slides or more to be held out of the training{limit}'

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


ANY_ERROR_RATE = ErrorBound(slides=0, max_error_rate=1.0)  # claims nothing, so nothing has to be shown
