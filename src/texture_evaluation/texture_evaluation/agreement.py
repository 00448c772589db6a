"""How far people agree who graded the same things."""

from __future__ import annotations

import math

import numpy as np

from texture_core.arrays import Array


def krippendorff_alpha(grades: Array) -> float:
    """Return Krippendorff's alpha for intervals of grades (n_raters, n_textures); NaN if all are the same.

    Source: Krippendorff 1980, chapter 12; as `nltk` computes it.

    Parameters
    ----------
    grades : (n_raters, n_textures)
        On an interval scale; NaN where a rater gave none.
    """
    from nltk.metrics import interval_distance  # type: ignore[import-untyped]  # noqa: PLC0415  # slow to import
    from nltk.metrics.agreement import AnnotationTask  # type: ignore[import-untyped]  # noqa: PLC0415

    given = np.argwhere(~np.isnan(grades))
    triples = [(int(rater), int(texture), float(grades[rater, texture])) for rater, texture in given]
    if len({grade for _, _, grade in triples}) < 2:
        return math.nan
    return float(AnnotationTask(triples, distance=interval_distance).alpha())


def intraclass_correlation(table: Array) -> tuple[float, float]:
    """Return ICC(2,1) and ICC(2,k): how far one rater, and the mean of k, agrees with others of their kind.

    Parameters
    ----------
    table : (n_targets, n_raters)
        Targets with a NaN are left out; both are NaN if fewer than two are left, or for a single rater.

    Source: Shrout & Fleiss 1979, two-way random effects.
    """
    table = table[~np.isnan(table).any(axis=1)]
    targets, raters = table.shape
    if min(targets, raters) < 2:
        return math.nan, math.nan
    mean = table.mean()
    between_targets = raters * ((table.mean(axis=1) - mean) ** 2).sum() / (targets - 1)
    between_raters = targets * ((table.mean(axis=0) - mean) ** 2).sum() / (raters - 1)
    total = ((table - mean) ** 2).sum()
    degrees = (targets - 1) * (raters - 1)
    rest = (total - between_targets * (targets - 1) - between_raters * (raters - 1)) / degrees
    signal, bias = between_targets - rest, (between_raters - rest) / targets
    single = between_targets + (raters - 1) * rest + raters * bias
    joint = between_targets + bias
    if not single > 0 or not joint > 0:
        return math.nan, math.nan
    return float(signal / single), float(signal / joint)


def one_against_rest(grades: Array) -> tuple[float, float]:
    """Return mean absolute difference and mean correlation of each person with the mean of the others.

    Parameters
    ----------
    grades : (n_raters, n_textures)
        NaN where missing. Both are NaN for a single rater.
    """
    errors, correlations = [], []
    for index, own in enumerate(grades):
        others = np.delete(grades, index, axis=0)
        shared = ~np.isnan(own) & ~np.isnan(others).all(axis=0)
        if not shared.any():
            continue
        rest = np.nanmean(others[:, shared], axis=0)
        errors.append(float(np.abs(own[shared] - rest).mean()))
        if own[shared].std() > 0 and rest.std() > 0:
            correlations.append(float(np.corrcoef(own[shared], rest)[0, 1]))
    return _mean(errors), _mean(correlations)


def _mean(values: list[float]) -> float:
    return float(np.mean(values)) if values else math.nan
