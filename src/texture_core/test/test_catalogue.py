from __future__ import annotations

import math

import pytest

from texture_core.catalogue import find
from texture_core.errors import UnknownName


def test_a_name_is_looked_up() -> None:
    assert find({'hjorth': 1}, 'hjorth', 'feature') == 1


def test_an_unknown_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(UnknownName, match="no feature 'hjort'; did you mean 'hjorth'"):
        find({'hjorth': 1, 'level': 2}, 'hjort', 'feature')


def test_a_users_class_is_imported() -> None:
    assert find({}, 'math:sqrt', 'feature') is math.sqrt


@pytest.mark.parametrize('name', ['no_such_module:Thing', 'math:no_such_thing'])
def test_what_cannot_be_imported_is_said(name: str) -> None:
    with pytest.raises(UnknownName, match='module:Class'):
        find({}, name, 'feature')
