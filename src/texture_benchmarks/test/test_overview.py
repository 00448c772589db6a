import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import BENCHMARKS
from texture_benchmarks.overview import LINE, PEERS, SHOWN, SOURCES, methods_of, spread_heights
from texture_benchmarks.recipes import decisions, one_vote
from texture_benchmarks.study import BenchmarkOptions
from texture_core.errors import InvalidData

pytestmark = pytest.mark.ros

CHARTS = Path(__file__).resolve().parents[3] / 'docs' / 'charts'


def stored() -> dict:
    return {name: json.loads((CHARTS / f'{name}.json').read_text())['numbers'] for name in ('recipes_later', 'trust')}


def test_computing_is_added_to_the_sliding_time() -> None:
    peer = {'decisions': {'s': [0.5, 1.0], 'share': [0.6, 0.8]}, 'latency_us': {'median': 20_000.0}}
    methods = {method.name: method for method in methods_of({**stored(), 'peers': {'slow': peer}})}
    assert methods['slow'].seconds == pytest.approx([0.52, 1.02])
    assert methods['slow'].kind == PEERS
    assert {title for title, _ in SHOWN.values()} < set(methods)


def test_names_keep_their_order_and_do_not_meet() -> None:
    heights = spread_heights([30.0, 29.0, 28.5, 90.0])
    assert sorted(heights) == [heights[number] for number in (2, 1, 0, 3)]
    assert all(other - one >= LINE - 1e-9 for one, other in pairwise(sorted(heights)))
    assert heights[3] == 90.0


def test_a_figure_that_is_not_stored_is_asked_for(tmp_path: Path) -> None:
    assert any(SOURCES.values())
    with pytest.raises(InvalidData, match='run `texture benchmark recipes_later` first'):
        BENCHMARKS['overview'](BenchmarkOptions(tmp_path))


def test_of_equal_votes_the_first_one_wins() -> None:
    labels = np.array(['cork', 'felt'])
    vote = one_vote(lambda windows: windows[:, 0, 0], labels)
    votes = vote(np.array(['felt', 'cork', 'cork'])[:, None, None])
    assert votes.tolist() == [[0, 1], [1, 0], [1, 0]]
    assert decisions(votes, np.zeros(3, int), np.array(['a', 'a', 'a'])) == [[False, False, True]]
