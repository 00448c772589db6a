from __future__ import annotations

from texture_core.errors import MAX_CHARACTERS, InvalidData


def test_an_error_is_one_line_whatever_others_said() -> None:
    assert str(InvalidData("'file' cannot be read: bad\n  line 3\n    ^")) == "'file' cannot be read: bad line 3 ^"


def test_a_long_error_is_its_beginning() -> None:
    text = str(InvalidData('came ' + 'x' * 10_000))
    assert text.startswith('came xxx') and text.endswith('…') and len(text) == MAX_CHARACTERS
