"""The searches for each pair over several seeds: means, intervals and counts of all choices."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from texture_benchmarks.papers.seeds import mean_over_seeds

Case = Mapping[str, Any]


def counts(chosen: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return how often each option was chosen, and of numbers the lowest, the median and the highest.

    Parameters
    ----------
    chosen
        Variables of each pair.

    Returns
    -------
    dict
        By variable: counts by option, or [lowest, median, highest].

    Examples
    --------
    >>> counts([{'force': 'yes', 'peaks': 3}, {'force': 'no', 'peaks': 9}, {'force': 'yes', 'peaks': 4}])
    {'force': {'no': 1, 'yes': 2}, 'peaks': [3.0, 4.0, 9.0]}
    """
    summary: dict[str, Any] = {}
    for name in chosen[0]:
        values = [choice[name] for choice in chosen]
        if isinstance(values[0], str):
            summary[name] = dict(sorted(Counter(values).items()))
        else:
            summary[name] = [float(np.min(values)), float(np.median(values)), float(np.max(values))]
    return summary


def over_seeds(cases: Mapping[int, Case]) -> dict[str, Any]:
    """Return the case of the first seed with means, intervals and counts over all seeds.

    Parameters
    ----------
    cases
        What `run_case` returns, by seed: at least two.

    Returns
    -------
    dict
        That of the first seed, and under 'seeds' the numbers of the seeds, under 'by_seed' choices and shares of each,
        under 'over_seeds' means with intervals of 95 % (Student's t), and under 'counts_of_all' the choices of all.
    """
    shares = {name: [case['tested'][name]['recognised'][0] for case in cases.values()]
              for name in next(iter(cases.values()))['tested']}  # fmt: skip
    shares['gain'] = [after - before for before, after in zip(*shares.values(), strict=True)]
    return {
        **next(iter(cases.values())),
        'seeds': list(cases),
        'by_seed': [{'counts': case['counts'], 'tested': case['tested']} for case in cases.values()],
        'over_seeds': {name: mean_over_seeds(values).as_json() for name, values in shares.items()},
        'counts_of_all': counts([choice for case in cases.values() for choice in case['chosen'].values()]),
    }
