"""What a recipe states about the level of its signals."""

from __future__ import annotations

import pytest

from texture_core.errors import InvalidParameter
from texture_features.feature_set import FeatureSet

LAYOUT = ((100.0, ('a', 'b')),)


def feature_set(tare: str = '') -> FeatureSet:
    option = {'tare': tare} if tare else {}
    return FeatureSet.from_mapping({'inputs': {'signal_static': {**option, 'features': ['mean']}}})


def test_a_recipe_that_states_nothing_takes_any_signal() -> None:
    assert feature_set().tare_faults({'signal_static': 'x (tared)'}) == []
    assert 'tare' not in feature_set().as_mapping()['inputs']['signal_static']


@pytest.mark.parametrize(('tare', 'sensor'), [('raw', 'x'), ('tared', 'x (tared)')])
def test_a_signal_as_the_recipe_states_is_no_fault(tare: str, sensor: str) -> None:
    assert feature_set(tare).tare_faults({'signal_static': sensor}) == []
    assert feature_set(tare).tare_faults({}) == []  # nothing has come yet


@pytest.mark.parametrize(
    ('tare', 'sensor', 'is_what'), [('tared', 'x', 'not subtracted'), ('raw', 'x (tared)', 'is sub')]
)
def test_another_signal_is_reported_with_what_to_do(tare: str, sensor: str, is_what: str) -> None:
    (fault,) = feature_set(tare).tare_faults({'signal_static': sensor})
    assert is_what in fault
    assert 'subtract_baseline' in fault


def test_the_statement_is_kept_in_the_recipe_and_does_not_change_the_features() -> None:
    assert feature_set('raw').as_mapping()['inputs']['signal_static']['tare'] == 'raw'
    assert feature_set('raw').fingerprint(LAYOUT) == feature_set().fingerprint(LAYOUT)


def test_an_unknown_statement_is_refused() -> None:
    with pytest.raises(InvalidParameter, match='tare'):
        feature_set('maybe')
