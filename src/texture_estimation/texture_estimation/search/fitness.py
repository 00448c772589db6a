"""How well an individual does: shares of right decisions on what was trained and on what was not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from texture_core.arrays import Array
from texture_estimation.classification.evidence_rules import EvidenceRule, deciding_rows
from texture_estimation.learners.learner import Codes
from texture_estimation.log_probabilities import log_softmax
from texture_estimation.search.halves import Mask

UNDECIDED = -1


def fitness(learning: Sequence[float] | Array, test: Sequence[float] | Array) -> float:
    """Return the mean of learning and test accuracy over all halves.

    Source: Roberge et al., "Textures recognition through tactile exploration", section IV.

    Parameters
    ----------
    learning, test : (n_halves,)
        Accuracy on the examples that were trained on, and on the others, 0 to 1.
    """
    return float((np.mean(learning) + np.mean(test)) / 2.0)


def decisions(scores: Array) -> Codes:
    """Return the label with the highest score, (n,) of (n, n_labels); UNDECIDED where several share it.

    Parameters
    ----------
    scores : (n, n_labels)
    """
    best = scores.max(axis=1, keepdims=True)
    chosen: Codes = scores.argmax(axis=1)
    chosen[(scores == best).sum(axis=1) > 1] = UNDECIDED
    return chosen


def shares_right(decided: Codes, codes: Codes, training: Mask) -> tuple[float, float]:
    """Return the shares of right decisions among the training and among the other examples; undecided is not right.

    Parameters
    ----------
    decided, codes : (n,)
        Number of the label that was decided, and of the true one.
    training : (n,) bool
        Which examples were trained on.

    Returns
    -------
    (float, float)
        0 to 1 each.
    """
    right = decided == codes
    return float(right[training].mean()), float(right[~training].mean())


def decided_by_slide(scores: Array, slides: Codes, rule: EvidenceRule, hop_share: float) -> tuple[Codes, Codes]:
    """Return what each slide is taken for by all its windows, (n_slides,), and the row of its first window.

    Parameters
    ----------
    scores : (n, n_labels)
        Of each window; equal highest ones are a tie.
    slides : (n,)
        Number of each window's slide.
    rule
        Joins the windows; of a slide with several groups that decide by themselves, the newest complete one counts.
    hop_share
        Distance of the windows over their length: of what overlaps, only the new part counts.

    Returns
    -------
    (n_slides,)
        Number of the label, or UNDECIDED.
    (n_slides,)
        Row of the first window of each slide.
    """
    _, first, member = np.unique(slides, return_index=True, return_inverse=True)
    member = member.reshape(-1)
    if rule.group:
        kept = np.zeros(len(member), dtype=bool)
        for number in range(len(first)):
            rows = np.flatnonzero(member == number)
            kept[rows[deciding_rows(len(rows), rule.group)]] = True
        member, scores = member[kept], scores[kept]
    counts = np.bincount(member)
    overlap = min(hop_share, 1.0)
    order = np.argsort(member, kind='stable')
    place = np.empty(len(member))
    place[order] = np.arange(len(member)) - np.repeat(np.cumsum(counts) - counts, counts)
    weights = rule.window_weights(1.0 + overlap * place)
    window_evidence_rows = weights[:, None] * rule.window_evidence(log_softmax(scores))
    sums = np.stack([np.bincount(member, weights=column) for column in window_evidence_rows.T], axis=1)
    means = sums / np.bincount(member, weights=weights)[:, None]
    effective_windows = 1.0 + overlap * (counts[:, None].astype(np.float64) - 1.0)
    return decisions(rule.log_posterior(means, effective_windows, 1.0)), first
