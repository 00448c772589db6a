"""Only regular files are read, and no more of them than is allowed."""

from __future__ import annotations

import io
import os
import socket
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from texture_core.config import (
    Archive,
    Arrays,
    Budget,
    FileRefused,
    open_regular,
    read_array,
    read_bounded,
    read_text,
    unpacked_limit,
)


def make_device(path: Path) -> None:
    path.symlink_to('/dev/zero')


def make_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(path))


ODD: dict[str, Callable[[Path], None]] = {'device': make_device, 'named pipe': os.mkfifo, 'socket': make_socket}


@pytest.mark.parametrize('kind', ODD)
def test_what_is_no_regular_file_is_refused_at_once(kind: str, tmp_path: Path) -> None:
    ODD[kind](tmp_path / 'odd')
    for path in (tmp_path / 'odd', tmp_path / 'link'):
        if path.name == 'link':
            path.symlink_to(tmp_path / 'odd')
        with pytest.raises(FileRefused, match=f'it is a {kind}; a regular file is needed'):
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


def test_a_file_that_states_no_size_is_read_no_further_than_its_limit() -> None:
    with pytest.raises(FileRefused, match='more than 1e-05 MB'):
        read_bounded('/proc/self/status', 10)


@pytest.mark.parametrize('array', [np.arange(6.0).reshape(2, 3), np.asfortranarray(np.eye(3)), np.array(['a', 'bc'])])
def test_an_array_is_what_numpy_wrote(array: np.ndarray, tmp_path: Path) -> None:
    np.save(tmp_path / 'a.npy', array)
    with open_regular(tmp_path / 'a.npy') as file:
        read = read_array(file, Budget(1000))
    assert read.dtype == array.dtype
    np.testing.assert_array_equal(read, array)


def test_texts_of_no_characters_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / 'a.npy', np.full(3, 0x110000, np.uint32).view('<U3'))
    with open_regular(tmp_path / 'a.npy') as file, pytest.raises(FileRefused, match='no characters'):
        read_array(file, Budget(1000))


HEADERS = {
    'huge': "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000, 30)}",
    'cut off': "{'descr': '<f8', 'fortran_order': False, 'shape': (10, 30)}",
    'of empty texts': "{'descr': '<U0', 'fortran_order': False, 'shape': (1000000000000,)}",
    'negative': "{'descr': '<f8', 'fortran_order': False, 'shape': (-1,)}",
    'objects': "{'descr': '|O', 'fortran_order': False, 'shape': (1,)}",
    'unfinished': "{'descr': '<f8', 'shape': (",
    'deep': '(' * 9000,
    'a call': "__import__('os').abort()",
    'long': "{'descr': '<f8', 'fortran_order': False, 'shape': ()}" + ' ' * 20_000,
}


@pytest.mark.parametrize('what', HEADERS)
def test_an_array_header_that_guarantees_or_means_harm_is_refused(what: str) -> None:
    header = HEADERS[what].encode() + b'\n'
    with pytest.raises(FileRefused, match=r'^it '):
        read_array(io.BytesIO(b'\x93NUMPY\x01\x00' + len(header).to_bytes(2, 'little') + header), Budget(10**6))


def packed(content: bytes, method: int = zipfile.ZIP_DEFLATED, names: tuple[str, ...] = ('a',)) -> io.BytesIO:
    file = io.BytesIO()
    with zipfile.ZipFile(file, 'w', method) as archive:
        for name in names:
            archive.writestr(name, content)
    return file


def test_an_archive_unpacks_in_proportion_to_its_size() -> None:
    small = bytes(1_000_000)
    assert Archive(packed(small)).read('a') == small
    bomb = packed(bytes(100_000_000))
    assert unpacked_limit(len(bomb.getvalue())) < 20_000_000
    with pytest.raises(FileRefused, match='more than'):
        Archive(bomb).read('a')


def test_all_members_of_an_archive_share_one_limit_and_each_reading_counts() -> None:
    archive = Archive(packed(bytes(10_000_000)))
    archive.read('a')
    with pytest.raises(FileRefused, match='more than'):
        archive.read('a')


def test_the_size_in_the_directory_is_not_believed() -> None:
    content = packed(bytes(100)).getvalue()
    place = content.index(b'PK\x01\x02') + 24
    for stated in (1, 99, 101, 2**32 - 2):
        lying = content[:place] + stated.to_bytes(4, 'little') + content[place + 4 :]
        with pytest.raises(FileRefused, match=r'directory states|damaged'):
            Archive(io.BytesIO(lying)).read('a')


@pytest.mark.parametrize('method', [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_methods_that_take_much_memory_for_few_bytes_are_refused(method: int) -> None:
    with pytest.raises(FileRefused, match="use 'deflate'"):
        Archive(packed(b'x', method)).read('a')


def test_arrays_of_an_archive_are_those_that_numpy_wrote_and_a_bomb_is_refused() -> None:
    file = io.BytesIO()
    np.savez_compressed(file, a=np.arange(3), zeros=np.zeros(20_000_000, np.uint8))
    arrays = Arrays(file)
    assert arrays.names == ('a', 'zeros')
    assert 'a' in arrays
    np.testing.assert_array_equal(arrays['a'], np.arange(3))
    with pytest.raises(KeyError):
        arrays['b']
    with pytest.raises(FileRefused, match='unpacks to more than'):
        arrays['zeros']
