# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Inputs that somebody could have, one table for each kind: the true samples, or a refusal that says what is wrong."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg

from texture_core.errors import InvalidData
from texture_recordings.bags import message_types
from texture_recordings.dataset import SlideDataset
from texture_recordings.mapping import mapping_from
from texture_recordings.readers import MAPPED
from texture_recordings.tables import import_tables

N = 600
T = np.arange(N) / 100.0
X = (np.sin(0.3 * np.arange(N)) + 0.001 * np.arange(N)).round(4)
Y = np.cos(0.17 * np.arange(N)).round(4)
RATE = {'streams': {'signal': {'columns': ['x'], 'rate_hz': 100.0}}}

Write = Callable[[Path], object]
Truth = str | list[tuple[str, Any]]  # what the refusal says, or label and samples of each slide


def check(folder: Path, write: Write, content: dict, truth: Truth, kind: str = 'table') -> None:
    """Import what is written into a folder, as `texture import` does."""
    (folder / 'in').mkdir()
    write(folder / 'in')
    mapping = mapping_from({
        'files': '{material}_{run}.csv', 'streams': {'signal': {'columns': ['x'], 'time': {'column': 't'}}},
        'label': {'column': 'material'}, **content,
    })  # fmt: skip
    if isinstance(truth, str):
        with pytest.raises(InvalidData, match=truth):
            import_tables(mapping, folder / 'in', folder / 'bags', MAPPED[kind])
        return
    dataset = SlideDataset.from_bags(import_tables(mapping, folder / 'in', folder / 'bags', MAPPED[kind]).bags)
    assert sorted(dataset.labels) == [label for label, _ in truth]
    for slide, (_, samples) in zip(sorted(dataset, key=lambda slide: slide.surface), truth, strict=True):
        batches = slide.signals['signal']
        read = np.concatenate([batch.samples for batch in batches])
        assert batches[-1].next_sample - batches[0].first_sample == len(read)
        np.testing.assert_allclose(read, np.reshape(samples, (len(read), -1)), atol=2e-4)


def csv(*columns: Any, names: str = 't,x', name: str = 'cork_1.csv') -> Write:
    rows = [','.join(map(str, row)) for row in zip(*columns, strict=True)]
    return text('\n'.join([names, *rows, '']), name)


def text(content: str, name: str = 'cork_1.csv') -> Write:
    return lambda folder: (folder / name).write_text(content)


def npz(**arrays: Any) -> Write:
    return lambda folder: np.savez(folder / 'cork_1.npz', **arrays)


def both(*writes: Write) -> Write:
    return lambda folder: [write(folder) for write in writes]


ANY = {'files': '{material}_{run}.*'}
CORK: Truth = [('cork', X)]
CLOCKS: dict[str, tuple[Write, dict, Truth]] = {
    'rate changes': (
        csv(np.r_[T[:300], 3 + np.arange(300) / 125], X), {},
        'the rate changes within a slide: by 111.1 Hz this row is 17.5 samples off',
    ),
    'rate drifts': (csv(np.cumsum(np.linspace(0.008, 0.012, N)).round(6), X), {}, 'rate changes within a slide'),
    'midnight': (csv(((T + 86_397) % 86_400).round(2), X), {}, CORK),
    'times of 32 bits': (npz(t=(1e5 + T).astype(np.float32), x=X), ANY, 'time counts in steps of 0.0078125 s'),
    'too few digits': (csv([f'{1.7e9 + t:.6e}' for t in T], X), {}, 'the times of .signal. do not grow'),
    'newest first': (csv(T[::-1], X[::-1]), {}, 'the times of .signal. do not grow'),
    'logs overlap by few rows': (csv(np.r_[T[:300], T[297:]], np.r_[X[:300], X[297:]]), {}, CORK),
    'logs overlap': (
        csv(np.r_[T[:300], T[200:]], np.r_[X[:300], X[200:]]), {'slides': {'by': 'pause'}},
        'row 302, .*the rows from here on are those from row 202 on',
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', CLOCKS)
def test_clocks(tmp_path: Path, name: str) -> None:
    check(tmp_path, *CLOCKS[name])


HALVES: Truth = [('cork', X[:300]), ('felt', X[300:])]
CODES = {'label': {'column': 'l', 'names': {0: 'cork', 1: 'felt'}}, 'slides': {'by': 'column', 'column': 'l'}}
PARTS = {**ANY, **RATE, 'files': '{a}_{run}.*', 'tables': 'data/{i}'}


def coded(codes: Any) -> Write:
    return csv(T, X, codes, names='t,x,l')


def grouped(folder: Path) -> None:
    npz(**{'data/1/x': X, 'data/2/x': Y}, material=np.array(['cork', 'felt']))(folder)


LABELS: dict[str, tuple[Write, dict, Truth]] = {
    'case': (both(csv(T, X, name='Cork_1.csv'), csv(T, Y, name='cork_2.csv')), {}, "labels 'Cork' and 'cork' differ"),
    'blanks': (both(csv(T, X, name='oak b_1.csv'), csv(T, Y, name='oak  b_2.csv')), {}, 'differ only in case, blanks'),
    'composed letters': (both(csv(T, X, name='\xfc_1.csv'), csv(T, Y, name='u\u0308_2.csv')), {}, 'differ only in'),
    'codes 0.0 and 1.0': (coded(['0.0'] * 300 + ['1.0'] * 300), CODES, HALVES),
    'codes of savetxt': (coded(['0.000e+00'] * 300 + ['1.000e+00'] * 300), CODES, HALVES),
    'a code without a name': (coded(np.repeat([1, 2], 300)), CODES, 'the label 2 has no name; it is none of 0, 1'),
    'a code with an underscore': (
        coded(['1_0'] * 300 + ['10'] * 300),
        {**CODES, 'label': {'column': 'l', 'names': {10: 'felt'}}}, [('1_0', X[:300]), ('felt', X[300:])],
    ),
    'nan outside slides': (coded(['nan'] * 100 + ['0'] * 500), CODES, [('cork', X[100:])]),
    'floats with NaN': (
        npz(t=T, x=X, l=np.r_[np.full(100, np.nan), np.zeros(200), np.ones(300)]), {**CODES, **ANY},
        [('cork', X[100:300]), ('felt', X[300:])],
    ),
    'a list of labels next to the elements': (grouped, PARTS, "no column 'material'"),
}  # fmt: skip


@pytest.mark.parametrize('name', LABELS)
def test_labels(tmp_path: Path, name: str) -> None:
    check(tmp_path, *LABELS[name])


def lines(*columns: Any) -> str:
    return ''.join(','.join(map(str, row)) + '\n' for row in zip(*columns, strict=True))


def wide(columns: int, *order: int, names: str = 'pac_') -> Write:
    samples = np.sin(0.05 * np.arange(columns * N)).reshape(N, columns).round(5)
    numbers = list(order) or list(range(columns))
    return csv(*samples.T[numbers], names=','.join(f'{names}{number}' for number in numbers))


HOLED = X.copy()
HOLED[[100, 200]] = np.nan
PAC = {'columns': ['pac_*'], 'rate_hz': 1200.0}
THOUSANDS = [f'{value:,}' for value in np.round(2000 * X).astype(int).tolist()]
GERMAN = {'format': {'delimiter': ';', 'decimal': ','}, **RATE}
TWICE = {'signal': {'columns': ['x'], 'rate_hz': 100.0}, 'signal_static': {'columns': ['y'], 'rate_hz': 10.0}}
ROWS: dict[str, tuple[Write, dict, Truth]] = {
    'sensors at times of their own': (
        csv(np.ravel(np.c_[T, T + 0.005]).round(4), np.ravel(np.c_[X, Y]), ['a', 'b'] * N, names='t,x,id'), {},
        r"one value of 'id' after the other \(a, b\).*rows: \{id: 'a'\}",
    ),
    'sensors without times': (csv(np.ravel(np.c_[X, Y]), [1, 2] * N, names='x,id'), RATE, "one value of 'id' after"),
    'a row of one signal': (
        csv(np.ravel(np.c_[X, Y]), [1, 2] * N, names='x,id'), {**RATE, 'rows': {'id': '*'}},
        [('cork', np.ravel(np.c_[X, Y]))],
    ),
    'a row goes on in the next': (
        wide(22), {'streams': {'signal': PAC}}, 'pac_0 … pac_21, and 600 rows; write samples_per_row: 22',
    ),
    'columns in the order of texts': (
        wide(12, 0, 1, 10, 11, *range(2, 10)), {'streams': {'signal': {**PAC, 'samples_per_row': 12}}},
        'pac_0, pac_1, pac_10, pac_11 …, whose numbers do not count up',
    ),
    'two rates of the same rows': (
        csv(X, Y, names='x,y'), {'streams': TWICE}, "rows per second are 100 by 'signal', 10 by 'signal_static'",
    ),
    'blanks without times': (
        csv(X, [y if row % 10 == 0 else '' for row, y in enumerate(Y)], names='x,y'), {'streams': TWICE},
        "540 malformed rows of 600, first row 3",
    ),
    'a header again without times': (
        text('x,y\n' + lines(X[:300], Y[:300]) + 'x,y\n' + lines(X[300:], Y[300:])), RATE, 'row 302: the names of the',
    ),
    'a header in another order': (
        text('t,x,y\n' + lines(T[:300], X[:300], Y[:300]) + 't,y,x\n' + lines(T[300:], Y[300:], X[300:])), {},
        'row 302: the names of the columns come again, t, y, x',
    ),
    'units below the header': (text('n,x\nsample,1\n' + lines(range(N), X)), RATE, CORK),
    'a mean below the rows': (text('n,x\n' + lines(range(N), X) + 'Mean,0.3\n'), RATE, CORK),
    'a last row that was cut': (text(('t,x\n' + lines(T, [f'{x:.6f}' for x in X]))[:-4]), {}, [('cork', X[:-1])]),
    '#N/A in the first column': (
        csv(['#N/A' if np.isnan(x) else x for x in HOLED], Y, names='x,y'), RATE, [('cork', HOLED)],
    ),
    'an underscore': (csv([*X[:100], '1_000', *X[101:200], '-', *X[201:]], names='x'), RATE, [('cork', HOLED)]),
    'no header': (text(lines(X, Y)), {'streams': {'signal': {'columns': ['*'], 'rate_hz': 100.0}}}, 'no names; write'),
    'commas decimal and delimiters': (
        text('n,x,y\n' + lines(range(N), [f'{x:.4f}'.replace('.', ',') for x in X])), RATE, "'y' holds digits such as",
    ),
    'points of thousands': (
        text('n;x\n' + ''.join(f'{n};{x.replace(",", ".")}\n' for n, x in enumerate(THOUSANDS))), GERMAN,
        r"'1\.\d+' is not a finite number",
    ),
    'commas of thousands': (
        text('n;x\n' + ''.join(f'{n};{x}\n' for n, x in enumerate(THOUSANDS))), GERMAN, 'seems to separate thousands',
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', ROWS)
def test_rows(tmp_path: Path, name: str) -> None:
    check(tmp_path, *ROWS[name])


def records(folder: Path) -> None:
    array = np.zeros(N, dtype=[('acc', 'f4', (2,))])
    array['acc'] = np.c_[X, Y]
    with h5py.File(folder / 'cork_1.h5', 'w') as file:
        file['d'] = array


def h5(rows: int = N, chunks: int = 100, **attributes: float) -> Write:
    def write(folder: Path) -> None:
        with h5py.File(folder / 'cork_1.h5', 'w') as file:
            data = file.create_dataset('x', (rows,), 'f8', chunks=(chunks,), compression='gzip')
            data[:N] = X
            data.attrs.update(attributes)

    return write


def wav(declared: int, sounds: int = 1) -> Write:
    samples = (X * 2**14).astype('<i2').tobytes()
    head = b'WAVEfmt ' + struct.pack('<IHHIIHH', 16, 1, 1, 1000, 2000, 2, 16)
    body = head + (b'data' + struct.pack('<I', declared) + samples) * sounds
    return lambda folder: (folder / 'cork_1.wav').write_bytes(b'RIFF' + struct.pack('<I', len(body)) + body)


SOUND = {**ANY, 'streams': {'signal': {'columns': ['*']}}}
CONTAINERS: dict[str, tuple[Write, dict, Truth]] = {
    'records of arrays': (
        records, {**ANY, 'streams': {'signal': {'columns': ['d.acc.*'], 'rate_hz': 100.0}}}, [('cork', np.c_[X, Y])],
    ),
    'parts that were never written': (h5(1000), {**ANY, **RATE}, 'has parts that were never written'),
    'values with a scale': (h5(scale_factor=0.5, add_offset=3.0), {**ANY, **RATE}, [('cork', 0.5 * X + 3.0)]),
    'a WAV file that was cut': (wav(2 * N + 2000), SOUND, 'was cut off, .* declares 3200 bytes of sound and has 1200'),
    'a WAV file of a pipe': (wav(2**32 - 1), SOUND, 'or written to a pipe: it declares 4294967295 bytes'),
    'two sounds': (wav(2 * N, 2), SOUND, 'has 2 chunks of sound'),
    'trials as one slide': (
        npz(X=np.ones((20, 100, 3))), {**ANY, 'streams': {'signal': {'columns': ['X.*'], 'rate_hz': 100.0}}},
        r'20 trials; write slides: \{by: column, column: trial\}',
    ),
    'a folder': (both(csv(T, X), lambda folder: (folder / 'felt_1.csv').mkdir()), {}, "'felt_1.csv' is a folder"),
}  # fmt: skip


@pytest.mark.parametrize('name', CONTAINERS)
def test_containers(tmp_path: Path, name: str) -> None:
    check(tmp_path, *CONTAINERS[name])


POINT, WORD, START_NS, STEP_NS = 'geometry_msgs/msg/PointStamped', 'std_msgs/msg/String', 1_700_000_000 * 10**9, 10**7
STORE = message_types()


def bag(
    ahead_s: float = 0.0,
    drift: float = 0.0,
    name: str = 'a_1',
    plugin: StoragePlugin = StoragePlugin.MCAP,
    frames: int = 1,
) -> Write:
    """Write a bag whose device has another clock than the recorder, which names cork and, after 3 s, felt."""
    types = STORE.types
    point, header, time = (types[one] for one in ('geometry_msgs/msg/Point', 'std_msgs/msg/Header',
                                                  'builtin_interfaces/msg/Time'))  # fmt: skip

    def write(folder: Path) -> None:
        with Writer(folder / name, version=8, storage_plugin=plugin) as writer:
            points, words = (writer.add_connection(topic, kind, typestore=STORE)
                             for topic, kind in (('/p', POINT), ('/surface', WORD)))  # fmt: skip
            for row, x in enumerate(X.tolist()):
                log_ns = START_NS + row * STEP_NS
                if row in {0, 300}:
                    word = STORE.serialize_cdr(types[WORD](data='felt' if row else 'cork'), WORD)
                    writer.write(words, log_ns - 10**6, word)
                stamp_ns = log_ns + round(ahead_s * 1e9) + round(drift * row * STEP_NS)
                stamp = header(stamp=time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9), frame_id='ab'[row % frames])
                value = types[POINT](header=stamp, point=point(x=x, y=0.0, z=0.0))
                writer.write(points, log_ns, STORE.serialize_cdr(value, POINT))

    return write


def without(path: str, *copies: str) -> Write:
    def write(folder: Path) -> None:
        for copy in copies:
            (folder / copy).write_bytes((folder / path).read_bytes())
        if not copies:
            (folder / path).unlink()

    return write


def emptied(folder: Path) -> None:
    (folder / 'a_1' / 'metadata.yaml').write_text('')


def sound(folder: Path) -> None:
    kind, store = 'audio_common_msgs/msg/AudioData', message_types()
    store.register(get_types_from_msg('uint8[] data', kind))
    with Writer(folder / 'a_1', version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('/p', kind, typestore=store)
        writer.write(connection, START_NS, store.serialize_cdr(store.types[kind](data=np.zeros(400, np.uint8)), kind))


BAGS: dict[str, tuple[Write, Truth]] = {
    'a clock one hour ahead': (bag(3600.0), HALVES),
    'a clock that began at the start': (bag(-1.7e9 + 100.0), HALVES),
    'sensors of two frames': (bag(frames=2), r"have the frames a, b.*rows: \{'/p/header.frame_id': 'a'\}"),
    'sound': (sound, 'is sound whose messages do not tell the format; give a WAV file'),
    'a clock that is faster': (bag(3600.0, 0.5), r"topic '/p': the stamps differ .* and that changes by 2\.\d+ s"),
    'empty metadata': (both(bag(), emptied), HALVES),
    'several files without metadata': (
        both(bag(), bag(name='b_1'), without('b_1/b_1.mcap', 'b_1/b_2.mcap'), without('b_1/metadata.yaml')),
        "'b_1' holds b_1.mcap, b_2.mcap without metadata.yaml",
    ),
    'SQLite without metadata': (
        both(bag(), bag(name='b_1', plugin=StoragePlugin.SQLITE3), without('b_1/metadata.yaml')), "'b_1' holds b_1.db3",
    ),
    'a file that is not listed': (both(bag(), without('a_1/a_1.mcap', 'a_1/a_2.mcap')), r'a_2\.mcap is not listed'),
}  # fmt: skip


@pytest.mark.parametrize('name', BAGS)
def test_bags(tmp_path: Path, name: str) -> None:
    write, truth = BAGS[name]
    label = {'label': {'column': '/surface/data'}, 'slides': {'by': 'column', 'column': '/surface/data'}}
    streams = {'signal': {'columns': ['/p/point.x']}}
    check(tmp_path, write, {'files': '{a}_{run}', 'streams': streams, **label}, truth, 'bag')


def arrays(folder: Path, first: str, second: str) -> None:
    types, kind = STORE.types, 'std_msgs/msg/Float32MultiArray'
    layout, dimension = types['std_msgs/msg/MultiArrayLayout'], types['std_msgs/msg/MultiArrayDimension']
    with Writer(folder / 'cork_1', version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('/a', kind, typestore=STORE)
        for number, part in enumerate(np.split(np.c_[X, Y].astype(np.float32), 60)):
            data = part.T if first != 'samples' else part
            axes = [
                dimension(label=label, size=size, stride=size)
                for label, size in zip((first, second), data.shape, strict=True)
            ]
            value = types[kind](layout=layout(dim=axes, data_offset=0), data=np.ascontiguousarray(data).ravel())
            writer.write(connection, START_NS + 10 * number * STEP_NS, STORE.serialize_cdr(value, kind))


@pytest.mark.parametrize(('first', 'second'), [('samples', 'channels'), ('channels', 'samples'), ('', '')])
def test_arrays_of_two_dimensions_are_read_as_their_labels_name_them(tmp_path: Path, first: str, second: str) -> None:
    streams = {'signal': {'columns': ['/a/data.*']}}
    truth: Truth = [('cork', np.c_[X, Y])] if first else "named '' and '', which does not tell samples"
    check(
        tmp_path, lambda folder: arrays(folder, first, second), {'files': '{material}_{run}', 'streams': streams},
        truth, 'bag',
    )  # fmt: skip


def test_one_of_several_frames_is_chosen(tmp_path: Path) -> None:
    streams = {'signal': {'columns': ['/p/point.x']}}
    content = {'files': '{material}_{run}', 'streams': streams, 'rows': {'/p/header.frame_id': 'b'}}
    check(tmp_path, bag(frames=2, name='cork_1'), content, [('cork', X[1::2])], 'bag')


def element(kind: int, content: bytes) -> bytes:
    return struct.pack('<II', kind, len(content)) + content + bytes(-len(content) % 8)


def matlab(kind: int, count: int, content: bytes = b'', name: bytes = b'x') -> bytes:
    """Return an array of MATLAB that declares `count` elements."""
    facts = element(6, struct.pack('<II', kind, 0)) + element(5, struct.pack('<2i', 1, count))
    return element(14, facts + element(1, name) + content)


def mat(content: bytes) -> Write:
    head = b'MATLAB 5.0 MAT-file'.ljust(124) + struct.pack('<HH', 0x0100, 0x4D49)
    return lambda folder: (folder / 'cork_1.mat').write_bytes(head + content)


def h5_without_rows(folder: Path) -> None:
    with h5py.File(folder / 'cork_1.h5', 'w') as file:
        file.create_dataset('x', (0, 10**9), 'f8', chunks=(1, 1000), maxshape=(None, 10**9))


SIZES: dict[str, tuple[Write, str]] = {
    'cells': (mat(matlab(1, 400_000_000)), "'cork_1.mat' cannot be read"),
    'cells in a cell': (mat(matlab(1, 1, matlab(1, 400_000_000, name=b''))), "'cork_1.mat' cannot be read"),
    'numbers': (mat(matlab(6, 2_000_000_000, element(9, bytes(80)))), "'cork_1.mat' cannot be read"),
    'no rows': (h5_without_rows, 'declares more than 8 million values'),
    'a header': (csv(names=','.join(f'x{number}' for number in range(20_000))), 'has 20000 columns; at most 10000'),
    'sound': (wav(2**32 - 100), 'declares 4294967196 bytes of sound and has 1200'),
}  # fmt: skip


@pytest.mark.parametrize('name', SIZES)
def test_sizes(tmp_path: Path, name: str) -> None:
    write, sentence = SIZES[name]
    check(tmp_path, write, {**ANY, **RATE}, sentence)


def test_a_matlab_file_of_ordinary_size_is_read(tmp_path: Path) -> None:
    check(tmp_path, lambda folder: scipy.io.savemat(folder / 'cork_1.mat', {'x': X}), {**ANY, **RATE}, CORK)
