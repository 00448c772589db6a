from __future__ import annotations

from pathlib import Path

import pytest

from texture_core.config import MAX_CHARACTERS, load_card, load_yaml, parse_json, parse_yaml, safe_repr
from texture_core.errors import InvalidParameter

LAUGHS = 'a: &a [x, x, x, x, x, x, x, x, x]\n' + ''.join(
    f'{b}: &{b} [{", ".join([f"*{a}"] * 9)}]\n' for a, b in zip('abcdefghi', 'bcdefghij', strict=True)
)
MERGES = 'a: &a {x: 1}\n' + ''.join(
    f'{b}: &{b} {{<<: [{", ".join([f"*{a}"] * 9)}]}}\n' for a, b in zip('abcdefghi', 'bcdefghij', strict=True)
)
BAD = {
    'aliases that multiply': LAUGHS,
    'merges that multiply': MERGES,
    'a list within itself': '&a [*a]',
    'a mapping within itself': 'a: &a {b: *a}',
    'deep nesting': '[' * 100_000,
    'deep and closed': '[' * 5000 + ']' * 5000,
    'too much': 'x' * (MAX_CHARACTERS + 1),
    'a Python object': '!!python/object/apply:os.system [exit 1]',
    'a Python name': 'a: !!python/name:os.system',
    'no date': 'a: 2024-99-99',
    'no truth': '!!bool perhaps',
    'no number': '!!int ""',
    'no time': '!!timestamp x',
    'cut off': '{a: ',
    'two documents': 'a: 1\n---\nb: 2',
    'a list as a key': '? [1]\n: 2',
    'a control character': 'a: \x07',
}


@pytest.mark.parametrize('what', BAD)
def test_bad_yaml_is_refused_with_one_line_and_soon(what: str, tmp_path: Path) -> None:
    file = tmp_path / 'file.yaml'
    file.write_text(BAD[what])
    with pytest.raises(InvalidParameter, match=r"scene '.*' is no YAML that can be read: ") as caught:
        load_yaml(file, 'scene')
    assert '\n' not in str(caught.value)


def test_yaml_is_read_with_its_aliases() -> None:
    assert parse_yaml('a: &a {x: 1}\nb: {<<: *a, y: 2}\nc: [*a, *a]') == {
        'a': {'x': 1}, 'b': {'x': 1, 'y': 2}, 'c': [{'x': 1}, {'x': 1}],
    }  # fmt: skip
    assert parse_yaml('# nothing') is None


def test_bytes_that_are_no_text_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    (tmp_path / 'image.yaml').write_bytes(b'\xff\xd8\xff')
    for name in ('image.yaml', 'missing.yaml'):
        with pytest.raises(InvalidParameter, match=name):
            load_yaml(tmp_path / name, 'scene')


@pytest.mark.parametrize('text', ['[' * 100_000, '{"recipe"', '[]', '3', '"x"', '\x00'])
def test_a_bad_card_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / 'card.json').write_text(text)
    with pytest.raises(InvalidParameter, match='model card'):
        load_card(tmp_path / 'card.json')


def test_json_is_read() -> None:
    assert parse_json('{"a": [1, null]}') == {'a': [1, None]}


def test_what_is_nested_too_deeply_to_be_shown_is_called_so() -> None:
    deep: list = []
    for _ in range(100_000):
        deep = [deep]
    assert safe_repr(deep) == 'something nested too deeply'
    while deep:  # taken apart step by step: Python itself takes such a thing apart by recursion
        deep = deep.pop()


@pytest.mark.parametrize('text', ['9' * 309, '-' + '9' * 400, '0x' + 'f' * 300, '9' * 5000])
def test_whole_numbers_that_no_float_can_hold_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match='digits'):
        parse_yaml(f'rate_hz: {text}')
    assert parse_yaml(f'rate_hz: {"9" * 308}') == {'rate_hz': int('9' * 308)}


@pytest.mark.parametrize('text', ['9' * 309, '-' + '9' * 400, '9' * 5000])
def test_whole_numbers_of_json_that_no_float_can_hold_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match='digits'):
        parse_json(f'{{"force_n": {text}}}')
