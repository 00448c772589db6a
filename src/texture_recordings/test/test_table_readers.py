# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every reader of the catalogue passes the same checks by being listed."""

import os
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from scipy.io import wavfile

from texture_core.errors import InvalidData, MissingLibrary, UnknownName
from texture_recordings.mapping import TableMapping, mapping_from, template_fields
from texture_recordings.readers import MAPPED, TableFrame, chosen, frames
from texture_recordings.tables import import_tables

pa = pytest.importorskip('pyarrow')
parquet = pytest.importorskip('pyarrow.parquet')

X = np.round(np.sin(np.arange(60.0)) * 0.5, 4)
Y = np.round(np.cos(np.arange(60.0)) * 0.5, 4)
ARRAYS = {'x': X, 'y': Y}


def mapping(**content: object) -> TableMapping:
    return mapping_from({'streams': {'signal': {'columns': ['x']}}, 'label': {'value': 'cork'}, **content})


EVERYTHING = mapping(streams={'signal': {'columns': ['*'], 'rate_hz': 100.0}})


def write_csv(path: Path) -> None:
    rows = '\n'.join(f'{x}\t{y}' for x, y in zip(X, Y, strict=True))
    path.write_text(f'x\ty\n{rows}\n')


def write_hdf5(path: Path) -> None:
    with h5py.File(path, 'w') as file:
        for name, array in ARRAYS.items():
            file.create_dataset(name, data=array, compression='gzip')


# How a file of each kind is made that holds x and y as its first two columns.
WRITERS: dict[str, Callable[[Path], object]] = {
    '.csv': write_csv,
    '.tsv': write_csv,
    '.txt': write_csv,
    '.npz': lambda path: np.savez_compressed(path, **ARRAYS),
    '.npy': lambda path: np.save(path, np.stack([X, Y], axis=1)),
    '.mat': lambda path: scipy.io.savemat(path, ARRAYS, do_compression=True),
    '.wav': lambda path: wavfile.write(path, 1000, np.stack([X, Y], axis=1)),
    '.h5': write_hdf5,
    '.hdf5': write_hdf5,
    '.parquet': lambda path: parquet.write_table(pa.table(ARRAYS), path),
}


def tables(path: Path, chosen: TableMapping | None = None) -> list[TableFrame]:
    return list(frames(path, path.name, chosen or mapping()))


def made(folder: Path, suffix: str) -> Path:
    path = folder / f'recording{suffix}'
    WRITERS[suffix](path)
    return path


each = pytest.mark.parametrize('suffix', MAPPED['table'])


@each
def test_columns_are_read_as_they_were_written(tmp_path: Path, suffix: str) -> None:
    [table] = tables(made(tmp_path, suffix), EVERYTHING)
    x, y = list(table.columns)[:2]
    np.testing.assert_allclose(table.numbers(x), X, atol=1e-6)
    np.testing.assert_allclose(table.numbers(y), Y, atol=1e-6)
    assert table.texts(x).shape == X.shape
    assert not table.reasons


@each
def test_a_file_that_is_something_else_is_refused_with_a_sentence_that_names_it(tmp_path: Path, suffix: str) -> None:
    (tmp_path / f'other{suffix}').write_bytes(b'')
    (tmp_path / f'folder{suffix}').mkdir()
    os.mkfifo(tmp_path / f'pipe{suffix}')
    for name in ('other', 'folder', 'pipe'):
        with pytest.raises(InvalidData, match=f"'{name}{suffix}'"):
            tables(tmp_path / f'{name}{suffix}', EVERYTHING)


@each
def test_a_damaged_file_is_read_or_refused(tmp_path: Path, suffix: str) -> None:
    content = made(tmp_path, suffix).read_bytes()
    rng = np.random.default_rng(0)
    path = tmp_path / f'damaged{suffix}'
    for _ in range(60):
        data = bytearray(content[: int(rng.integers(1, len(content)))] if rng.random() < 0.3 else content)
        for place in rng.integers(0, len(data), rng.integers(1, 6)).tolist():
            data[place] = int(rng.integers(256))
        path.write_bytes(data)
        try:
            import_tables(EVERYTHING, path, None)
        except InvalidData as error:
            assert path.name in str(error)


@each
def test_a_column_that_is_missing_is_refused_with_the_nearest(tmp_path: Path, suffix: str) -> None:
    names = list(tables(made(tmp_path, suffix), EVERYTHING)[0].columns)
    with pytest.raises(UnknownName, match="no column 'wrong'"):
        chosen(['wrong'], names, {})
    assert chosen(['*'], names, {}) == names


def test_texts_that_all_refer_to_one_long_text_take_bounded_memory(tmp_path):
    path, long = tmp_path / 'cork.h5', 'c' * 4_000_000
    with h5py.File(path, 'w') as file:
        file['x'] = X
        texts = file.create_dataset('m', (len(X),), h5py.string_dtype(), fillvalue='')
        texts[0] = long
        begin = texts.id.get_offset()
    content = bytearray(path.read_bytes())
    content[begin : begin + 16 * len(X)] = content[begin : begin + 16] * len(X)  # length and address of the first
    path.write_bytes(content)
    tracemalloc.start()
    try:
        [frame] = frames(
            path, 'cork.h5', mapping(label={'column': 'm'}, streams={'signal': {'columns': ['x'], 'rate_hz': 100.0}})
        )
        assert tracemalloc.get_traced_memory()[1] < 200_000_000
    finally:
        tracemalloc.stop()
    assert set(frame['m']) == {'c' * 200}


@pytest.mark.parametrize(('suffix', 'name'), [('.h5', 'h5py'), ('.parquet', 'pyarrow.parquet')])
def test_a_missing_library_is_told_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, name: str
) -> None:
    path = made(tmp_path, suffix)
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingLibrary, match=f"need the library '{name.split('.', maxsplit=1)[0]}"):
        tables(path)


def test_objects_in_arrays_are_refused_and_nothing_is_run(tmp_path: Path) -> None:
    np.save(tmp_path / 'a.npy', np.array([{'a': 1}], dtype=object), allow_pickle=True)
    np.savez(tmp_path / 'a.npz', x=np.array([{'a': 1}], dtype=object))
    for suffix in ('.npy', '.npz'):
        with pytest.raises(InvalidData, match='Object arrays cannot be loaded'):
            tables(tmp_path / f'a{suffix}')


def test_structs_of_matlab_are_folders_and_row_vectors_are_columns(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / 'a.mat', {'run': {'acc': np.stack([X, Y], axis=1), 't': X[None], 'speed': 20.0}})
    [table] = tables(tmp_path / 'a.mat', mapping(tables='run'))
    assert list(table.columns) == ['acc.0', 'acc.1', 't', 'speed']
    assert table.columns['speed'][()] == 20.0


def test_arrays_of_a_form_are_a_table_each_with_what_their_names_hold(tmp_path: Path) -> None:
    arrays = {f'{name}/speed{speed}': np.stack([X, Y], axis=1) for name in ('cork', 'felt') for speed in (20, 40)}
    np.savez(tmp_path / 'a.npz', **arrays, notes=np.zeros(3))
    found = tables(tmp_path / 'a.npz', mapping(tables='{material}/speed{speed}'))
    assert [str(found[1].columns[name]) for name in ('material', 'speed')] == ['cork', '40']
    assert len(found) == 4
    with pytest.raises(InvalidData, match=r"no array of the form 'run\{n\}'; it has cork"):
        tables(tmp_path / 'a.npz', mapping(tables='run{n}'))


def test_links_out_of_an_hdf5_file_are_not_followed(tmp_path: Path) -> None:
    with h5py.File(tmp_path / 'secret.h5', 'w') as other:
        other['x'] = X
    with h5py.File(tmp_path / 'a.h5', 'w') as file:
        file['y'] = Y
        file['x'] = h5py.ExternalLink('secret.h5', '/x')
    [table] = tables(tmp_path / 'a.h5')
    assert list(table.columns) == ['y']


@pytest.mark.parametrize(
    ('text', 'form'),
    [
        ('a;b\n1,5;2\n3,25;4\n', {'decimal': ','}),
        ('# note\n1.5 2\n3.25 4\n', {'header': False}),
        ('units\na|b\n"1.5"|2\n3.25|4\n', {'skip_rows': 1}),
        ('\ufeffa,b\r\n1.5,2\r\n\r\n3.25,4\r\n', {}),
    ],
)
def test_text_files_of_several_kinds_are_read(tmp_path: Path, text: str, form: dict[str, object]) -> None:
    (tmp_path / 'a.csv').write_text(text, newline='')
    every = {'signal': {'columns': ['*'], 'rate_hz': 100.0}}
    [table] = tables(tmp_path / 'a.csv', mapping(format=form, streams=every))
    assert list(table.columns) == (['0', '1'] if form.get('header') is False else ['a', 'b'])
    assert next(iter(table.columns.values())).tolist() == [1.5, 3.25]


def test_a_quote_that_is_never_closed_spoils_its_own_row_alone(tmp_path: Path) -> None:
    (tmp_path / 'a.csv').write_text('a,b\n1,2\n"3,4\n5,6\n')
    [table] = tables(tmp_path / 'a.csv', EVERYTHING)
    assert np.flatnonzero(table.junk).tolist() == [1]
    assert table.columns['b'][[0, 2]].tolist() == [2, 6]


@pytest.mark.parametrize(
    ('template', 'name', 'fields'),
    [
        ('{m}_run{n}.csv', 'wood_oak_run03.csv', {'m': 'wood_oak', 'n': '03'}),
        ('{m}/*.csv', 'felt/a b.csv', {'m': 'felt'}),
        ('{m}/*.csv', 'felt.csv', None),
        ('data.csv', 'data.csv', {}),
        ('{m}.csv', '.csv', None),
        ('{m}_{}.csv', 'felt_.csv', {'m': 'felt'}),
        ('*', 'a.csv', {}),
        ('{m}_{code:d}_{run:d}.csv', 'kitchen_towel_120_01.csv', {'m': 'kitchen_towel', 'code': '120', 'run': '01'}),
        ('{m}_{run:d}.csv', 'oak_board_1.csv', {'m': 'oak_board', 'run': '1'}),
    ],
)
def test_a_template_takes_names_apart(template: str, name: str, fields: dict[str, str] | None) -> None:
    assert template_fields(template, name) == fields


@pytest.mark.parametrize(('template', 'name'), [
    ('{m}_{code}_{run}.csv', 'kitchen_towel_120_01.csv'), ('{m}-{v}.csv', 'a-b-1.csv'),
    ('{m}.{n}.csv', 'a.b.1.csv'), ('{m}_{n}/{r}.csv', 'oak_board_1/2.csv'), ('*_{m}_*.csv', '1_1_2_1_1.csv'),
])  # fmt: skip
def test_a_name_that_fits_in_two_ways_is_refused_and_shows_both(template: str, name: str) -> None:
    with pytest.raises(InvalidData, match=r'in two ways: .*; or .*'):
        template_fields(template, name)
