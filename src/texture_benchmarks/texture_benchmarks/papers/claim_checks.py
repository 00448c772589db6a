"""Claims of papers, checked: each function measures one kind of claim and says whether it holds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from texture_benchmarks.papers.interval import Interval, apart, mean, share
from texture_benchmarks.papers.method_result import MethodResult
from texture_benchmarks.papers.protocol import Finding
from texture_core.arrays import Array

Pair = tuple[str, str]


def higher(claim: str, first: MethodResult, second: MethodResult) -> Finding:
    """Check that one method recognises more than another, slide by slide.

    Parameters
    ----------
    claim
        Sentence of the paper.
    first, second
        Results on the same slides.

    Returns
    -------
    Finding
        Whether it holds here, with an interval.
    """
    both = first.tested & second.tested
    gain = mean(first.right(both) - second.right(both))
    return Finding(claim, f'{percent(first.test)} against {percent(second.test)}', gain, gain.above())


def higher_elsewhere(claim: str, first: MethodResult, second: MethodResult) -> Finding:
    """Check that more slides of one kind are recognised than of another kind.

    Parameters
    ----------
    claim
        Sentence of the paper.
    first, second
        Results on different slides.

    Returns
    -------
    Finding
        Whether it holds here, with an interval.
    """
    gain = apart(first.right(), second.right())
    return Finding(claim, f'{percent(first.test)} against {percent(second.test)}', gain, gain.above())


def lower_in(claim: str, outcome: MethodResult, condition: str) -> Finding:
    """Check that slides of one condition are recognised less often than all others.

    Parameters
    ----------
    claim
        Sentence of the paper.
    outcome
        Result of the method.
    condition
        Name of the condition.

    Returns
    -------
    Finding
        Whether it holds here, with an interval.
    """
    here = outcome.conditions == condition
    loss = apart(outcome.right(~here), outcome.right(here))
    names = dict.fromkeys(outcome.conditions.tolist())
    shares = {name: outcome.right(outcome.conditions == name).mean() for name in names}
    reported = ', '.join(f'{name} {100 * value:.1f} %' for name, value in shares.items())
    return Finding(claim, reported, loss, loss.above())


def kept_in(claim: str, outcome: MethodResult, changed: str, reference: str, margin: float = 0.05) -> Finding:
    """Check that slides of one condition are recognised at most a margin less often than those of another.

    Parameters
    ----------
    claim
        Sentence of the paper.
    outcome
        Result of the method.
    changed, reference
        Names of the conditions.
    margin
        Largest loss that counts as none, 0 to 1.

    Returns
    -------
    Finding
        Whether it holds here, with an interval.
    """
    here, before = (outcome.right(outcome.conditions == name) for name in (changed, reference))
    gain = apart(here, before)
    kept = Interval(gain.value + margin, gain.low + margin, gain.high + margin)
    reported = f'{percent(share(here))} against {percent(share(before))}, {100 * margin:g} points granted'
    return Finding(claim, reported, kept, kept.above())


def at_least(claim: str, outcome: MethodResult, border: float) -> Finding:
    """Check that the share of test slides recognised is not below a figure: the interval reaches it.

    Parameters
    ----------
    claim
        Sentence of the paper.
    outcome
        Result of the method.
    border
        Share, 0 to 1.

    Returns
    -------
    Finding
        Whether it holds here, with an interval.
    """
    test = outcome.test
    over = Interval(test.value - border, test.low - border, test.high - border)
    return Finding(claim, percent(test), over, over.high >= 0.0, reaches=True)


def most_errors(claim: str, outcome: MethodResult, pairs: Sequence[Pair]) -> Finding:
    """Check that a surface is taken for the other of these pairs more often than for that of the next most confused.

    Parameters
    ----------
    claim
        Sentence of the paper.
    outcome
        Result of the method.
    pairs
        Pairs of surfaces.

    Returns
    -------
    Finding
        Whether it holds here.
    """
    own = sum((outcome.taken_for(*pair) for pair in pairs), start=np.zeros(1))
    others = [pair for pair in outcome.pairs() if frozenset(pair) not in {frozenset(one) for one in pairs}]
    rivals = sum((outcome.taken_for(*pair) for pair in others[: len(pairs)]), start=np.zeros(1))
    lead = mean(own - rivals)
    named = ' and '.join('/'.join(pair) for pair in others[: len(pairs)])
    here = f'{_of_errors(own, outcome)} of all errors; next: {named} with {_of_errors(rivals, outcome)}'
    return Finding(claim, here, lead, lead.above())


def better_on(claim: str, outcome: MethodResult, surface: str) -> Finding:
    """Check that one surface is recognised more often than the others together.

    Parameters
    ----------
    claim
        Sentence of the paper.
    outcome
        Result of the method.
    surface
        Label of the surface.

    Returns
    -------
    Finding
        Whether it holds here, with an interval.
    """
    here = outcome.codes == outcome.surfaces.index(surface)
    gain = apart(outcome.right(here), outcome.right(~here))
    reported = (
        f'{100 * outcome.right(here).mean():.1f} % right, of the others {100 * outcome.right(~here).mean():.1f} %'
    )
    return Finding(claim, reported, gain, gain.above())


def seldom(claim: str, outcome: MethodResult, pair: Pair, border: float) -> Finding:
    """Check that two surfaces are taken for each other in fewer than a share of their slides.

    Parameters
    ----------
    claim
        Sentence of the paper.
    outcome
        Result of the method.
    pair
        Two surfaces.
    border
        Share, 0 to 1.

    Returns
    -------
    Finding
        Whether it holds here, with an interval.
    """
    of_pair = np.isin(outcome.codes, [outcome.surfaces.index(name) for name in pair])
    taken = share(outcome.taken_for(*pair, of=of_pair))
    below = Interval(border - taken.value, border - taken.high, border - taken.low)
    return Finding(
        claim, f'{percent(taken)} of their slides, fewer than {100 * border:g} % needed', below, below.above()
    )


def more_spread(claim: str, first: MethodResult, second: MethodResult, alike: Sequence[Pair]) -> Finding:
    """Check that by the first method more slides are taken for a surface that is not alike than by the second.

    Parameters
    ----------
    claim
        Sentence of the paper.
    first, second
        Results on the same slides.
    alike
        Pairs of surfaces that are alike.

    Returns
    -------
    Finding
        Whether it holds here, with an interval.
    """
    novel = [one.wrong() - sum((one.taken_for(*pair) for pair in alike), start=np.zeros(1)) for one in (first, second)]
    more = mean(novel[0] - novel[1])
    reported = ' against '.join(f'{100 * part.mean():.1f} %' for part in novel)
    return Finding(claim, f'{reported} of the slides', more, more.above())


def percent(part: Interval) -> str:
    """Return a share with its interval."""
    return f'{100 * part.value:.1f} % ({100 * part.low:.1f} to {100 * part.high:.1f})'


def _of_errors(part: Array, outcome: MethodResult) -> str:
    wrong = outcome.wrong().sum()
    return f'{100 * part.sum() / wrong:.0f} %' if wrong else 'none'
