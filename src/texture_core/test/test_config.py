# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import io
import os
import re
import socket
import sys
import tracemalloc
import zipfile
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from texture_core.config import (
    MAX_CHARACTERS,
    MAX_FILE_BYTES,
    Archive,
    FileRefused,
    check_middleware,
    find,
    find_file,
    folder,
    from_mapping,
    load_card,
    load_yaml,
    open_regular,
    param,
    parameters_of,
    parse_yaml,
    read_array,
    read_bounded,
    read_text,
    yaml_text,
)
from texture_core.errors import InvalidParameter, MissingLibrary, UnknownName


def test_an_unknown_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(UnknownName, match="no feature 'hjort'; did you mean 'hjorth'"):
        find({'hjorth': 1, 'level': 2}, 'hjort', 'feature')


def test_of_many_names_the_first_are_listed() -> None:
    with pytest.raises(UnknownName, match=r"no column 'trial'. Known: X0000, X0001, .*, X0099, … \(1500\)$"):
        find({f'X{number:04d}': 1 for number in range(1500)}, 'trial', 'column')


def test_a_users_class_is_imported() -> None:
    assert find({}, 'numpy:sqrt', 'feature') is np.sqrt


@pytest.mark.parametrize('name', ['no_such_module:Thing', 'numpy:no_such_thing', '.:x', ':x', 'a..b:x'])
def test_what_cannot_be_imported_is_said(name: str) -> None:
    with pytest.raises(UnknownName, match='module:Class'):
        find({}, name, 'feature')


@pytest.mark.parametrize(
    ('line', 'error'),
    [
        ('1 / 0', 'ZeroDivisionError: division by zero'),
        ('undefined', "NameError: name 'undefined' is not defined"),
        ('int("x")', "ValueError: invalid literal for int() with base 10: 'x'"),
        ('len(3)', "TypeError: object of type 'int' has no len()"),
        ('import no_such_library', "ModuleNotFoundError: No module named 'no_such_library'"),
        ('x = = 1', 'SyntaxError: invalid syntax'),
    ],
)
def test_an_error_in_a_users_module_is_told_with_its_file_and_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str, error: str
) -> None:
    file = tmp_path / 'users_module_with_a_fault.py'
    file.write_text(f'first = 1\n{line}\n')
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(UnknownName, match=re.escape(f'fails with {error} ({file}:2); correct it there')):
        find({}, 'users_module_with_a_fault:Thing', 'feature')


def test_what_a_missing_library_is_needed_for_is_known_when_another_process_misses_it() -> None:
    error = MissingLibrary('rosbags', 'bags', 'bags')
    assert str(copy(error)) == str(error)  # as it goes between processes


def test_an_empty_choice_is_not_listed() -> None:
    @dataclass(frozen=True)
    class Chosen:
        sensor: str = param('', "Sensor; '' takes that of the scene.", choices=('', 'tsf85'))

    [item] = parameters_of(Chosen)
    with pytest.raises(InvalidParameter, match=r'allowed is one of tsf85$'):
        item.check('x')


@pytest.mark.parametrize('name', ['antigravity:fly', 'unittest.__main__:main', 'numpy.__main__:x'])
def test_programs_and_parts_of_python_are_not_imported_for_a_name(name: str) -> None:
    with pytest.raises(UnknownName, match='is a module of Python itself'):
        find({}, name, 'feature')
    assert name.partition(':')[0] not in sys.modules


def test_a_shipped_file_is_found_by_name_in_an_installation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shipped = tmp_path / 'share' / 'some_package' / 'config'
    shipped.mkdir(parents=True)
    (shipped / 'good.yaml').write_text('')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path}')
    assert folder('some_package', 'config') == shipped
    assert find_file('good', 'some_package', 'config', 'recipe') == shipped / 'good.yaml'
    with pytest.raises(UnknownName, match="no recipe 'goood'; did you mean 'good'"):
        find_file('goood', 'some_package', 'config', 'recipe')


@pytest.mark.parametrize(
    ('name', 'setting', 'place'),
    [('', 'AMENT_PREFIX_PATH', ''), ('one', 'AMENT_PREFIX_PATH', 'lib'), ('one', 'LD_LIBRARY_PATH', '')],
)
def test_a_middleware_that_is_there_is_not_refused(
    name: str, setting: str, place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / place).mkdir(exist_ok=True)
    (tmp_path / place / 'libone.so').touch()
    monkeypatch.setenv('RMW_IMPLEMENTATION', name)
    monkeypatch.setenv(setting, f'/nowhere:{tmp_path}')
    check_middleware()


@pytest.mark.parametrize('name', ['mine.yaml', 'some/folder/mine'])
def test_a_missing_file_of_the_user_is_not_called_an_unknown_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UnknownName, match=f"there is no file '{name}' in '{tmp_path}'"):
        find_file(name, 'texture_core', 'config', 'recipe')


@dataclass(frozen=True)
class Params:
    length_s: float = param(0.5, 'Length of one window.', unit='s', low=0.01, high=10.0)
    count: int = param(3, 'How many.', low=1)
    shape: str = param('sine', 'Shape.', choices=('sine', 'square'))
    loud: bool = param(False, 'Say more.')


def test_what_is_not_named_keeps_its_default_and_a_whole_number_serves_where_a_number_is_needed() -> None:
    assert from_mapping(Params, {'count': 5, 'length_s': 1}) == Params(count=5, length_s=1.0)


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


BAD = {
    'deep nesting': b'[' * 100_000,
    'too much': b'x' * (MAX_CHARACTERS + 1),
    'a Python object': b'!!python/object/apply:os.system [exit 1]',
    'no date': b'a: 2024-99-99',
    'cut off': b'{a: ',
    'two documents': b'a: 1\n---\nb: 2',
    'a list as a key': b'? [1]\n: 2',
    'no text': b'\xff\xd8\xff',
    'an alias': b'a: &a [1]\nb: *a',
    'itself': b'&a [*a]',
    'a key twice': b'a: {value: 1}\nb: 2\na: {value: 1}',
    'a key twice in a line': b'a: {0: cork, 1: felt, 0: glass}',
    'a number and a text as one key': b"{1: cork, '1': felt}",
    'a number twice': b'{8: cork, 010: felt}',
}


@pytest.mark.parametrize('what', BAD)
def test_bad_yaml_is_refused_with_one_line_and_soon(what: str, tmp_path: Path) -> None:
    (tmp_path / 'file.yaml').write_bytes(BAD[what])
    with pytest.raises(InvalidParameter, match=r"scene '.*' is not YAML that can be read: ") as caught:
        load_yaml(tmp_path / 'file.yaml', 'scene')
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('text', 'place'), [("files: '{a}.csv\nlabel: b\n", 'line 1, column 8'), ('a:\n\tb: 3\n', 'line 2, column 1')]
)
def test_text_that_is_no_yaml_is_named_by_its_place_and_what_to_do(tmp_path: Path, text: str, place: str) -> None:
    (tmp_path / 'file.yaml').write_text(text)
    with pytest.raises(InvalidParameter, match=f'read: from {place} on, close quotes and brackets, write .*, not tabs'):
        load_yaml(tmp_path / 'file.yaml', 'mapping')


def test_a_key_that_is_there_twice_is_named_with_its_lines(tmp_path: Path) -> None:
    (tmp_path / 'file.yaml').write_text('label: {value: cork}\nfiles: a\nlabel: {column: b}\n')
    with pytest.raises(InvalidParameter, match="the key 'label' is in line 1 and again in line 3; write it once"):
        load_yaml(tmp_path / 'file.yaml', 'mapping')


@pytest.mark.parametrize(
    'text', ['{1: a, 1.0: b}', '{1: a, true: b}', "{1: a, '1': b}", '{0: a, no: b}', '{~: a, null: b}']
)
def test_two_forms_of_one_key_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match='write it once'):
        parse_yaml(text)


def test_an_empty_key_and_a_text_are_two_keys() -> None:
    assert parse_yaml('{null: a, "None": b}') == {None: 'a', 'None': 'b'}


@pytest.mark.parametrize('text', ['[' * 100_000, '{"recipe"', '[]', '3', '"x"', '\x00'])
def test_a_bad_card_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / 'card.json').write_text(text)
    with pytest.raises(InvalidParameter, match='model card'):
        load_card(tmp_path / 'card.json')


# Only regular files are read, and no more of them than is allowed.


def make_device(path: Path) -> None:
    path.symlink_to('/dev/zero')


def make_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(path))


ODD: dict[str, Callable[[Path], None]] = {'device': make_device, 'named pipe': os.mkfifo, 'socket': make_socket}


@pytest.mark.parametrize('kind', ODD)
def test_what_is_no_regular_file_is_refused_at_once(kind: str, tmp_path: Path) -> None:
    ODD[kind](tmp_path / 'odd')
    (tmp_path / 'link').symlink_to(tmp_path / 'odd')
    for path in (tmp_path / 'odd', tmp_path / 'link'):
        with pytest.raises(FileRefused, match='a regular file is needed'):
            open_regular(path)


def test_a_folder_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(IsADirectoryError):
        open_regular(tmp_path)
    with pytest.raises(FileNotFoundError):
        open_regular(tmp_path / 'missing')


def test_a_file_is_read_up_to_its_limit(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('äöü')
    assert read_bounded(tmp_path / 'file', 6) == 'äöü'.encode()
    assert read_text(tmp_path / 'file', 6) == 'äöü'
    with pytest.raises(FileRefused, match=r'it has more than 5e-06 MB'):
        read_bounded(tmp_path / 'file', 5)


HEADERS = {
    'huge': "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000, 30)}",
    'cut off': "{'descr': '<f8', 'fortran_order': False, 'shape': (10, 30)}",
    'objects': "{'descr': '|O', 'fortran_order': False, 'shape': (1,)}",
    'unfinished': "{'descr': '<f8', 'shape': (",
    'a call': "__import__('os').abort()",
}


@pytest.mark.parametrize('what', HEADERS)
def test_an_array_of_python_objects_or_without_its_values_is_refused(what: str) -> None:
    header = HEADERS[what].encode() + b'\n'
    with pytest.raises(FileRefused, match=r'^it '):
        read_array(io.BytesIO(b'\x93NUMPY\x01\x00' + len(header).to_bytes(2, 'little') + header))


def test_an_archive_that_unpacks_to_more_than_a_gigabyte_is_refused() -> None:
    file = io.BytesIO()
    with zipfile.ZipFile(file, 'w', zipfile.ZIP_DEFLATED) as archive:
        archive.writestr('a', b'some')
    content, directory = file.getvalue(), file.getvalue().index(b'PK\x01\x02') + 24
    lying = content[:directory] + (MAX_FILE_BYTES + 1).to_bytes(4, 'little') + content[directory + 4 :]
    assert Archive(file).read('a') == b'some'
    with pytest.raises(FileRefused, match='unpacks to more than 1000 MB'):
        Archive(io.BytesIO(lying))


def test_an_archive_of_a_million_empty_members_is_refused_before_they_are_listed() -> None:
    file = io.BytesIO()
    with zipfile.ZipFile(file, 'w') as archive:
        archive.writestr('a', b'')
    content = file.getvalue()
    begin, end = content.index(b'PK\x01\x02'), content.index(b'PK\x05\x06')
    entry, record = content[begin:end], content[end:]
    directory = entry * 1_000_000
    lying = content[:begin] + directory + record[:12] + len(directory).to_bytes(4, 'little') + record[16:]
    hidden = lying[:-6] + b'PK\x05\x06' + lying[-2:]  # the mark of a record within the last one
    locator = b'PK\x06\x07' + bytes(16)  # of the larger form of the record
    tracemalloc.start()
    try:
        for made in (lying, hidden, content[:end] + locator + record):
            with pytest.raises(FileRefused, match='its list of members has more than 10 MB'):
                Archive(io.BytesIO(made))
        assert tracemalloc.get_traced_memory()[1] < 100_000_000
    finally:
        tracemalloc.stop()


def test_no_more_of_a_member_is_unpacked_than_the_directory_states() -> None:
    file = io.BytesIO()
    with zipfile.ZipFile(file, 'w', zipfile.ZIP_DEFLATED) as archive:
        archive.writestr('a', bytes(50_000_000))
    content, directory = file.getvalue(), file.getvalue().index(b'PK\x01\x02') + 24
    lying = Archive(io.BytesIO(content[:directory] + (1000).to_bytes(4, 'little') + content[directory + 4 :]))
    tracemalloc.start()
    try:
        with pytest.raises(FileRefused, match="'a' is damaged: Bad CRC-32"):
            lying.read('a')
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


def test_values_that_are_one_object_are_written_as_they_are_read() -> None:
    shared = ['ä', 1.5]
    content = {'b': shared, 'a': shared, 'c': {'d': shared}}
    assert parse_yaml(yaml_text(content)) == content
    assert list(parse_yaml(yaml_text(content))) == ['b', 'a', 'c']


@pytest.mark.parametrize('method', [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_method_that_zipfile_unpacks_without_a_limit_is_refused(method: int) -> None:
    file = io.BytesIO()
    with zipfile.ZipFile(file, 'w', method) as archive:
        archive.writestr('a', b'some')
    with pytest.raises(FileRefused, match='another method than deflate; save it by'):
        Archive(file)
