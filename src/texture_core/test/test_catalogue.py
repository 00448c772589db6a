from __future__ import annotations

import sys

import numpy as np
import pytest

from texture_core.config import find
from texture_core.errors import UnknownName


def test_a_name_is_looked_up() -> None:
    assert find({'hjorth': 1}, 'hjorth', 'feature') == 1


def test_an_unknown_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(UnknownName, match="no feature 'hjort'; did you mean 'hjorth'"):
        find({'hjorth': 1, 'level': 2}, 'hjort', 'feature')


def test_a_users_class_is_imported() -> None:
    assert find({}, 'numpy:sqrt', 'feature') is np.sqrt


@pytest.mark.parametrize('name', ['no_such_module:Thing', 'numpy:no_such_thing', '.:x', ':x', 'a..b:x'])
def test_what_cannot_be_imported_is_said(name: str) -> None:
    with pytest.raises(UnknownName, match='module:Class'):
        find({}, name, 'feature')


@pytest.mark.parametrize('name', ['antigravity:fly', 'unittest.__main__:main', 'numpy.__main__:x'])
def test_programs_and_parts_of_python_are_not_imported_for_a_name(name: str) -> None:
    with pytest.raises(UnknownName, match='part or a program of Python'):
        find({}, name, 'feature')
    assert name.partition(':')[0] not in sys.modules
