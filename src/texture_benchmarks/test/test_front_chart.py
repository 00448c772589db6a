"""Names in a chart of many methods: the front first, and none on another."""

from __future__ import annotations

import math
from itertools import combinations

from texture_benchmarks import charts

# Cost and share; the first three are the front.
VALUES = [(100.0, 0.70), (130.0, 0.72), (450.0, 0.95), (440.0, 0.50), (445.0, 0.49), (2000.0, 0.60)]
FRONT = [0, 1, 2]


def test_every_method_of_the_front_has_its_name() -> None:
    assert set(FRONT) <= set(charts._named(VALUES, FRONT))


def test_no_name_lies_on_another_or_on_a_point() -> None:
    places = charts._named(VALUES, FRONT)
    assert 5 in places  # far from all others
    assert not any(charts._covers(one, other, charts.LABEL_DECADES) for one, other in combinations(places.values(), 2))


def test_no_name_leaves_the_chart_on_the_left() -> None:
    crowded = [(50.0, 0.17), (55.0, 0.18), (72.0, 0.20), (80.0, 0.15)]
    starts = [start for start, _ in charts._named(crowded, [0]).values()]
    assert min(starts) >= math.log10(50.0) - charts.ROOM_DECADES


def test_at_most_ten_methods_are_named() -> None:
    many = [(10.0 ** (2 + 0.5 * column), 0.05 + 0.1 * row) for row in range(9) for column in range(4)]
    assert len(charts._named(many, [])) == charts.DIRECT_LABELS


def test_a_method_of_ones_own_is_named_even_where_its_name_covers_another_point() -> None:
    crowded = [(100.0 + number, 0.70 + 0.002 * number) for number in range(12)]
    assert 5 not in charts._named(crowded, [11])
    assert 5 in charts._named(crowded, [11], always=[5])
