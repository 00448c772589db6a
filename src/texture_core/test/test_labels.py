from __future__ import annotations

import pytest

from texture_core.errors import InvalidData
from texture_core.types import MAX_CHARACTERS, checked_label


@pytest.mark.parametrize('label', ['', 'cork', 'woven cloth', 'Kork Nr. 3 (fein)', 'höckrig', 'x' * MAX_CHARACTERS])
def test_a_plain_label_is_taken_as_it_is(label: str) -> None:
    assert checked_label(label) == label


def test_white_space_around_a_label_is_removed() -> None:
    assert checked_label(' cork\n') == 'cork'


@pytest.mark.parametrize('label', ['../../etc/x', 'a\\b', 'bell\x07', 'two\nlines'])
def test_a_label_that_names_a_path_or_cannot_be_printed_is_refused(label: str) -> None:
    with pytest.raises(InvalidData, match='slash, a backslash or a character that cannot be printed'):
        checked_label(label)


def test_a_long_label_is_refused_with_its_length_and_the_sentence_stays_short() -> None:
    with pytest.raises(InvalidData, match='has 100000 characters; at most 100') as raised:
        checked_label('x' * 100_000)
    assert len(str(raised.value)) < 200
