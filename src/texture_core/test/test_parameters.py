from __future__ import annotations

from dataclasses import dataclass

import pytest

from texture_core.config import from_mapping, markdown_table, param
from texture_core.errors import InvalidParameter


@dataclass(frozen=True)
class Params:
    length_s: float = param(0.5, 'Length of one window.', unit='s', low=0.01, high=10.0)
    count: int = param(3, 'How many.', low=1)
    shape: str = param('sine', 'Shape.', choices=('sine', 'square'))
    loud: bool = param(False, 'Say more.')


def test_what_is_not_named_keeps_its_default() -> None:
    assert from_mapping(Params, {'count': 5}) == Params(count=5)


def test_a_whole_number_serves_where_a_number_is_needed() -> None:
    assert from_mapping(Params, {'length_s': 1}).length_s == 1.0


@pytest.mark.parametrize(
    ('values', 'sentence'),
    [
        ({'length_s': 20.0}, '0.01 to 10.0 s'),
        ({'length_s': float('nan')}, '0.01 to 10.0 s'),
        ({'length_s': 'long'}, 'a number is needed'),
        ({'count': 0}, 'at least 1'),
        ({'count': 2.5}, 'a whole number is needed'),
        ({'count': True}, 'a whole number is needed'),
        ({'shape': 'round'}, 'one of sine, square'),
        ({'loud': 1}, 'true or false is needed'),
        ({'lenght_s': 1.0}, "did you mean 'length_s'?"),
        ([1, 2], 'a mapping'),
    ],
)
def test_a_bad_value_is_refused_with_what_is_allowed(values: object, sentence: str) -> None:
    with pytest.raises(InvalidParameter) as refusal:
        from_mapping(Params, values, where='recipe x')  # type: ignore[arg-type]
    assert sentence in str(refusal.value)
    assert str(refusal.value).startswith('recipe x: ')


def test_the_table_names_default_unit_and_range() -> None:
    assert '| `length_s` | `0.5` s | 0.01 to 10.0 s | Length of one window. |' in markdown_table(Params)
