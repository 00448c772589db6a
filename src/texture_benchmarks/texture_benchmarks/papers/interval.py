"""How sure a figure is, given how many slides it rests on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array

NORMAL_95 = 1.959964


@dataclass(frozen=True)
class Interval:
    """A figure and the interval that holds it with 95 %: other slides over the same surfaces would give another one."""

    value: float
    low: float
    high: float

    def above(self, border: float = 0.0) -> bool | None:
        """Tell whether the figure is above a border; None if the interval does not tell."""
        if self.low > border:
            return True
        return False if self.high < border else None

    def times(self, factor: float) -> Interval:
        """Return the figure in another unit."""
        return Interval(self.value * factor, self.low * factor, self.high * factor)

    def as_json(self) -> list[float]:
        """Return value, low and high, rounded."""
        return [round(self.value, 4), round(self.low, 4), round(self.high, 4)]


def share(right: Array) -> Interval:
    """Return the share of slides that are right (Wilson's interval).

    Parameters
    ----------
    right : (n_slides,)
        1 or 0, or between if a slide was evaluated several times.
    """
    n, p, z2 = len(right), float(np.mean(right)), NORMAL_95**2
    middle = (p + z2 / (2 * n)) / (1 + z2 / n)
    reach = NORMAL_95 * np.sqrt(p * (1 - p) / n + z2 / (4 * n * n)) / (1 + z2 / n)
    # Where all or none are right, rounding may leave the share just outside.
    return Interval(p, min(p, float(middle - reach)), max(p, float(middle + reach)))


def mean(values: Array) -> Interval:
    """Return the mean over slides, such as that of differences between two methods on the same slides.

    Parameters
    ----------
    values : (n,)
        One number a slide.
    """
    centre = float(np.mean(values))
    reach = NORMAL_95 * math.sqrt(_uncertainty(values))
    return Interval(centre, centre - reach, centre + reach)


def mean_share(values: Array) -> Interval:
    """Return the mean of shares, such as those of several draws; its interval is cut where no share can lie.

    Parameters
    ----------
    values : (n,)
        Shares, 0 to 1.
    """
    found = mean(values)
    return Interval(found.value, max(found.low, 0.0), min(found.high, 1.0))


def apart(first: Array, second: Array) -> Interval:
    """Return how much higher the mean of the first is, of slides that are not the same; (n,) and (m,).

    Parameters
    ----------
    first : (n,)
        One number a slide.
    second : (m,)
        One number a slide.
    """
    centre = float(np.mean(first) - np.mean(second))
    reach = NORMAL_95 * math.sqrt(_uncertainty(first) + _uncertainty(second))
    return Interval(centre, centre - reach, centre + reach)


def _uncertainty(values: Array) -> float:
    """Return the variance of a mean; one value says nothing of it."""
    return float(np.var(values, ddof=1)) / len(values) if len(values) > 1 else math.inf
