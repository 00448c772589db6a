# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Inputs that somebody could have, one table for each kind: the true samples, or a refusal that says what is wrong."""

import gzip
import io
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg
from scipy.io import wavfile

from texture_core.errors import InvalidData
from texture_recordings.bags import CheckedPath, message_types
from texture_recordings.dataset import SlideDataset
from texture_recordings.mapping import mapping_from
from texture_recordings.readers import MAPPED, frames
from texture_recordings.tables import import_tables

N = 600
T = np.arange(N) / 100.0
X = (np.sin(0.3 * np.arange(N)) + 0.001 * np.arange(N)).round(4)
Y = np.cos(0.17 * np.arange(N)).round(4)
U, V = np.random.default_rng(1).normal(size=(2, N)).round(4)
PLAIN = {
    'files': '{material}_{run}.csv', 'streams': {'signal': {'columns': ['x'], 'time': {'column': 't'}}},
    'label': {'column': 'material'},
}  # fmt: skip
RATE = {'streams': {'signal': {'columns': ['x'], 'rate_hz': 100.0}}}

Write = Callable[[Path], object]
Truth = str | list[tuple[str, Any]]  # what the refusal says, or label and samples of each slide


def check(folder: Path, write: Write, content: dict, truth: Truth, kind: str = 'table') -> None:
    """Import what is written into a folder, as `texture import` does."""
    (folder / 'in').mkdir()
    write(folder / 'in')
    mapping = mapping_from({**PLAIN, **content})
    if isinstance(truth, str):
        with pytest.raises(InvalidData, match=truth):
            import_tables(mapping, folder / 'in', folder / 'bags', MAPPED[kind])
        assert not (folder / 'bags').exists()
        return
    dataset = SlideDataset.from_bags(import_tables(mapping, folder / 'in', folder / 'bags', MAPPED[kind]).bags)
    assert sorted(dataset.labels) == [label for label, _ in truth]
    for slide, (_, samples) in zip(sorted(dataset, key=lambda slide: slide.surface), truth, strict=True):
        batches = slide.signals['signal']
        first, stop = batches[0].first_sample, batches[-1].next_sample
        read = np.full((stop - first, len(batches[0].channels)), np.nan)  # also of samples that were lost
        for batch in batches:
            read[batch.first_sample - first : batch.next_sample - first] = batch.samples
        np.testing.assert_allclose(read, np.reshape(samples, (len(read), -1)), atol=2e-4)


def csv(*columns: Any, names: str = 't,x', name: str = 'cork_1.csv') -> Write:
    rows = [','.join(map(str, row)) for row in zip(*columns, strict=True)]
    return text('\n'.join([names, *rows, '']), name)


def text(content: str, name: str = 'cork_1.csv') -> Write:
    return lambda folder: (folder / name).write_text(content)


def binary(content: bytes) -> Write:
    return lambda folder: (folder / 'cork_1.csv').write_bytes(content)


def npz(**arrays: Any) -> Write:
    return lambda folder: np.savez(folder / 'cork_1.npz', **arrays)


def both(*writes: Write) -> Write:
    return lambda folder: [write(folder) for write in writes]


def bursts(size: int, step_s: float = 50e-6) -> np.ndarray:
    """Return times of rows that are stamped `size` at a time."""
    return (T[(np.arange(N) // size) * size] + step_s * (np.arange(N) % size)).round(6)


def timed(unit: str = 's', rate_hz: float = 0.0, **content: Any) -> dict:
    stream = {'columns': ['x'], 'time': {'column': 't', 'unit': unit}, 'rate_hz': rate_hz}
    return {'streams': {'signal': stream}, **content}


ANY = {'files': '{material}_{run}.*'}
CORK: Truth = [('cork', X)]
LOST = np.isin(np.arange(N), [100, 101, 260, 433])
HOLED = np.where(LOST, np.nan, X)
UNEVEN = np.floor(T * 41.7) / 41.7  # of a buffer that is read 41.7 times a second, with two or three rows
OVERLAP = np.r_[T[:300], 2.7 + T[:300]].round(2)
PAUSE = {'slides': {'by': 'pause', 'min_s': 0.05}}
BACK = r"row \d+, column 't': time goes back .*by: pause"
CLOCKS: dict[str, tuple[Write, dict, Truth]] = {
    'a buffer that is read at any time': (csv(UNEVEN, X), {}, '350 of 600 times come twice: .* a buffer that is'),
    'ms at 1000 Hz': (
        csv((T[~LOST] / 10).round(3), X[~LOST]), {},
        'row 101, .*a gap of 0.003 s follows: samples were lost there, or time, which counts in .* 1000 Hz, was round',
    ),
    'ms at 1000 Hz that are stated': (
        csv((T[~LOST] / 10).round(3), X[~LOST]), timed(rate_hz=1000.0), [('cork', HOLED)],
    ),
    'a gap': (
        csv(np.where(T < 3, T, T + 0.07).round(2), X), timed(rate_hz=100.0),
        [('cork', np.insert(X, 300, [np.nan] * 7))],
    ),
    'a counter of 16 bits in ms': (csv((6e4 * T).astype(int) % 2**16, X), timed('ms'), 'rate of .* is 1.667 Hz'),
    **{
        f'a counter of {bits} bits in {unit}': (
            csv((start + 1e-2 / factor * np.arange(N)).astype(int) % 2**bits, X), timed(unit),
            'time goes back from .* the roll of a counter, or midnight, add its period|of time, where it may go back',
        )
        for bits, unit, factor, start in (
            (16, 'us', 1e-6, 0), (24, 'us', 1e-6, 2**24 - 10**6), (31, 'ms', 1e-3, 2**31 - 5000),
            (32, 'us', 1e-6, 2**32 - 10**6), (32, 'ns', 1e-9, 2**32 - 10**8),
        )
    },
    'seconds of the minute by pause': (
        csv((T + 57).round(2) % 60, X), PAUSE, [('cork', X[:300]), ('cork', X[300:])],
    ),
    'runs': (csv(np.r_[T[:100], T[:500]], X), {}, BACK),
    'a run of few rows': (csv(np.r_[T[:590], T[:10]], X), {}, BACK),
    'runs by pause': (csv(np.r_[T[:100], T[:500]], X), PAUSE, [('cork', X[:100]), ('cork', X[100:])]),
    'a run of few rows by pause': (csv(np.r_[T[:590], T[:10]], X), PAUSE, [('cork', X[:590]), ('cork', X[590:])]),
    'a pause': (csv(np.r_[T[:100], 3 + T[:500]], X), PAUSE, [('cork', X[:100]), ('cork', X[100:])]),
    'ms that are called s': (csv(1e3 * T, X), {}, r'0\.1 Hz by its times; with unit: ms it would be 100 Hz'),
    'us that are called ms': (csv(1e6 * T, X), timed('ms'), 'rate of .* with unit: us'),
    'ms that are called s at 8 kHz': (
        csv((T / 80 * 1e3).round(6), X), {'conditions': {'speed': {'value': '1'}}},
        'row 2: a slide lasts 75 s at 1 m/s, so it has 75 m; at most .* 50 m are .* its unit, which may be ms$',
    ),
    'a turntable for two minutes': (csv(20 * T, X), {'conditions': {'speed': {'value': '0.1'}}}, CORK),
    'a speed of 0': (csv(T, X), {'conditions': {'speed': {'value': '0'}}}, 'speed of a slide is 0 m/s, plausible are'),
    'rows in no order': (
        csv(np.random.default_rng(0).permutation(T), X), {}, 'do not grow .*; if rows are out of order, sort them by t',
    ),
    'a force of 0': (csv(T, X), {'conditions': {'force': {'value': '0'}}}, 'is 0 N, .*; leave out what is unknown'),
    **{
        f'a force of {force} N in a column': (
            csv(T, X, np.tile(force, N // 2), names='t,x,f'), {'conditions': {'force': {'column': 'f'}}}, 'is 0 N, pl',
        )
        for force in ((0.0, 0.0), (1.2, -1.2))
    },
    'a speed in cm/s': (csv(T, X), {'conditions': {'speed': {'value': '20'}}}, 'speed .* 20 m/s.* may be cm/s or mm/s'),
    'a speed in m/s': (
        csv(T, X), {'conditions': {'speed': {'value': '0.03', 'unit': 'mm/s'}}}, r'0\.03 mm/s.* may be m/s or cm/s',
    ),
    'a force in gf': (csv(T, X), {'conditions': {'force': {'value': '150'}}}, 'force .* 150 N.* may be mN or gf'),
    'degrees': (csv(T, X), {'conditions': {'direction': {'value': '90'}}}, 'direction of .* 90 rad.* may be deg'),
    'a slide of hours': (
        csv(np.random.default_rng(3).normal(size=9600).round(4), names='x'),
        {'streams': {'signal': {'columns': ['x'], 'rate_hz': 5}}}, 'lasts 1[.]?92',
    ),
    'numbers that no bag can hold': (
        csv(T, np.where(np.arange(N) % 5, X, 1e300)), {},
        r"120 malformed rows of 600, first row 2, column 'x': no finite number .NaN, infinity, blank or beyond 32 b",
    ),
    'files without a template': (
        csv(T, X), {'files': '*'}, r"no column 'material'. Known: t, x; if .*, write files: '\{material\}_\{run\}.csv'",
    ),
    'an open brace': (csv(T, X), {'files': '{material}_{run.csv'}, "has a '{' that belongs to no field"),
    'a rate below all': (
        csv(X, names='x'), {'streams': {'signal': {'columns': ['x'], 'rate_hz': 2}}}, '2 Hz by the mapping',
    ),
    'rate changes': (
        csv(np.r_[T[:300], 3 + np.arange(300) / 125], X), {},
        'the rate changes within a slide: by 111.1 Hz this row is 17.5 samples off',
    ),
    'rate drifts': (csv(np.cumsum(np.linspace(0.008, 0.012, N)).round(6), X), {}, 'rate changes within a slide'),
    'midnight': (csv(((T + 86_397) % 86_400).round(2), X), {}, 'lasts 8.64e.04 s; .*, where it may go back'),
    'times of 32 bits': (npz(t=(1e5 + T).astype(np.float32), x=X), ANY, 'time, which counts in steps of 0.0078125 s'),
    'too few digits': (csv([f'{1.7e9 + t:.6e}' for t in T], X), {}, 'the times of .signal. do not grow'),
    'newest first': (csv(T[::-1], X[::-1]), {}, 'the times of .signal. do not grow'),
    'logs overlap by few rows': (csv(np.r_[T[:300], T[297:]], np.r_[X[:300], X[297:]]), {}, BACK),
    'logs overlap': (
        csv(np.r_[T[:300], T[200:]], np.r_[X[:300], X[200:]]), {'slides': {'by': 'pause'}},
        'row 302, .*time goes back to 2 s, into the run that began at 0 s; save each row once',
    ),
    'runs overlap': (csv(OVERLAP, X), {}, 'row 302, .*time goes back from 2.99 to 2.7 s, .*by: pause'),
    'runs overlap by pause': (csv(OVERLAP, X), PAUSE, 'row 302, .*time goes back to 2.7 s, into the run that began'),
    'a row twice': (csv(np.insert(T, 9, T[9]), np.insert(X, 9, X[9])), {}, '1 of 601 times come twice.*save each row'),
    'a row ahead': (csv(np.where(np.arange(N) == 300, T + 0.05, T).round(2), X), {}, 'row 303, .*3.05 to 3.01 s, 1 t'),
}  # fmt: skip


@pytest.mark.parametrize('name', CLOCKS)
def test_clocks(tmp_path: Path, name: str) -> None:
    check(tmp_path, *CLOCKS[name])


@pytest.mark.parametrize('size', [2, 3, 5, 10, 20, 30])
@pytest.mark.parametrize('step_s', [0.0, 50e-6])
def test_rows_of_a_buffer_are_refused_and_the_rate_that_they_have_is_enough(
    tmp_path: Path, size: int, step_s: float
) -> None:
    check(tmp_path, csv(bursts(size, step_s), X), {}, 'a buffer .*stamped when it .*give `rate_hz`|is 3.333 Hz')
    (tmp_path / 'again').mkdir()
    check(tmp_path / 'again', csv(bursts(size, step_s), X), RATE, CORK)


SAME = r'.* have the same samples in all or in a part; a copy is no further slide, nor is an overlapping window'
LONG = np.random.default_rng(0).normal(size=180_000).round(4)
COARSE = np.rint(2 * np.random.default_rng(2).normal(size=(3, N))).astype(int)
HUMS = np.rint(5 * np.sin(np.pi * np.arange(20_000) / 10) + np.random.default_rng(0).normal(0, 0.05, (2, 20_000)))
STROKE = 100 * np.sin(0.3 * np.arange(3000)) + 50 * np.sin(1.1 * np.arange(3000))
REPEATS = np.rint(STROKE + np.random.default_rng(0).normal(0, 0.4, (10, 3000)))
HALVES: Truth = [('cork', X[:300]), ('felt', X[300:])]
CODES = {'label': {'column': 'l', 'names': {0: 'cork', 1: 'felt'}}, 'slides': {'by': 'column', 'column': 'l'}}
BOTH = {
    'streams': {'signal': {'columns': ['x'], 'rate_hz': 100.0}, 'signal_static': {'columns': ['y'], 'rate_hz': 100}}
}
SLOW = {'signal': {'columns': ['x'], 'rate_hz': 500.0}, 'signal_static': {'columns': ['y'], 'rate_hz': 10.0}}
PARTS = {**ANY, **RATE, 'files': '{a}_{run}.*', 'tables': 'data/{i}'}


def coded(codes: Any) -> Write:
    return csv(T, X, codes, names='t,x,l')


def tone(number: int) -> np.ndarray:
    return np.sin((0.3 + 0.03 * number) * np.arange(N)).round(4)


def grouped(folder: Path) -> None:
    npz(**{'data/1/x': X, 'data/2/x': Y}, material=np.array(['cork', 'felt']))(folder)


LABELS: dict[str, tuple[Write, dict, Truth]] = {
    'case': (both(csv(T, X, name='Cork_1.csv'), csv(T, Y, name='cork_2.csv')), {}, "labels 'Cork' and 'cork' differ"),
    'blanks': (both(csv(T, X, name='oak b_1.csv'), csv(T, Y, name='oak  b_2.csv')), {}, 'differ only in case, blanks'),
    'composed letters': (
        both(csv(T, X, name='\xfc_1.csv'), csv(T, Y, name='u\u0308_2.csv')), {}, r'"u\\u0308" and "\\u00fc" differ',
    ),
    'codes 0.0 and 1.0': (coded(['0.0'] * 300 + ['1.0'] * 300), CODES, HALVES),
    'codes of savetxt': (coded(['0.000e+00'] * 300 + ['1.000e+00'] * 300), CODES, HALVES),
    'a code without a name': (coded(np.repeat([1, 2], 300)), CODES, 'the label 2 has no name; it is none of 0, 1'),
    'codes without names': (
        coded(np.repeat([0, 1], 300)), {**CODES, 'label': {'column': 'l'}},
        r'the label 0 has no name; it is none of the codes under `names`; write names: \{0: NAME\} under `label`',
    ),
    'a code beside names': (
        coded(['cork'] * 300 + ['1'] * 300), {**CODES, 'label': {'column': 'l', 'names': {'cork': 'oak'}}}, 'label 1 ',
    ),
    'a field that is the number of the run': (csv(T, X), {'label': {'column': 'run'}}, 'the label 1 has no name'),
    'a field with a name': (csv(T, X), {'label': {'column': 'run', 'names': {1: 'cork'}}}, CORK),
    'a number that the mapping itself gives': (csv(T, X), {'label': {'value': 7}}, [('7', X)]),
    'a code with an underscore': (
        coded(['1_0'] * 300 + ['10'] * 300),
        {**CODES, 'label': {'column': 'l', 'names': {10: 'felt'}}}, [('1_0', X[:300]), ('felt', X[300:])],
    ),
    'a label that changes within a slide': (
        csv(T, X, ['cork'] * 300 + ['felt'] * 300, names='t,x,l'), {'label': {'column': 'l'}},
        r"row 302, column 'l': the label changes from 'cork' to 'felt' within a slide",
    ),
    'patterns of values': (
        csv(T, X, np.repeat(['idle', 'pass_1', 'back', 'pass_2', '[x]'], N // 5), names='t,x,l'),
        {'slides': {'by': 'column', 'column': 'l', 'values': ['pass_*', '[x]']}},
        [('cork', X[120:240]), ('cork', X[360:480]), ('cork', X[480:])],
    ),
    'nan outside slides': (coded(['nan'] * 100 + ['0'] * 500), CODES, [('cork', X[100:])]),
    'floats with NaN': (
        npz(t=T, x=X, l=np.r_[np.full(100, np.nan), np.zeros(200), np.ones(300)]), {**CODES, **ANY},
        [('cork', X[100:300]), ('felt', X[300:])],
    ),
    **{
        f'once in {every} rows': (
            csv(T, X, ['' if row % every else 'cork' for row in range(N)], names='t,x,l'), {'label': {'column': 'l'}},
            CORK,
        )
        for every in (1, 10, 300, N)
    },
    'a name that contradicts a column': (
        csv(T, X, ['felt'] * N, names='t,x,material'), {}, "'material' is 'cork' in the name and 'felt' in a column",
    ),
    'a name that equals a column': (csv(T, X, [1] * N, names='t,x,run', name='cork_01.csv'), {}, CORK),
    **{
        f'a copy as {name}': (
            both(csv(T, X), csv(T + 7.0, X, name=f'{name}_2.csv')), {},
            f"slides '{name}_2.csv/1' and 'cork_1.csv/1' {SAME}",
        )
        for name in ('cork', 'felt')
    },
    **{
        f'rows {rows} as felt': (
            both(csv(T, X), csv(T[rows], X[rows], name='felt_7.csv')), {},
            f"'felt_7.csv': the slides 'felt_7.csv/1' and 'cork_1.csv/1' {SAME}",
        )
        for rows in (slice(1, None), slice(None, -1), slice(200, 330))
    },
    **{
        f'rows {first} to {stop} beside a slow stream, as another slide': (
            npz(**{f'{number}/{name}': one for number, streams in enumerate((
                {'x': LONG[:3000], 'y': LONG[3000:3060]}, {'x': LONG[4000:7000], 'y': LONG[7000:7060]},
                {'x': LONG[first:stop], 'y': LONG[3000 + first // 50 : 3000 + stop // 50]},
            )) for name, one in streams.items()}),
            {**ANY, 'streams': SLOW, 'tables': '{i}'}, f"'cork_1.npz, 2/1' and 'cork_1.npz, 0/1' {SAME}",
        )
        for first, stop in ((0, 2950), (50, 3000), (1000, 1500))
    },
    'a slow stream that is the same beside one that is not': (
        npz(**{f'{number}/{name}': one for number, fast in enumerate((LONG[:3000], LONG[4000:7000]))
               for name, one in (('x', fast), ('y', LONG[3000:3060]))}),
        {**ANY, 'streams': SLOW, 'tables': '{i}'}, SAME,
    ),
    **{
        f'a copy {name}': (
            both(csv(T, U, V, names='t,x,y'), csv(T, x, y, names='t,x,y', name='felt_7.csv')),
            {'streams': {'signal': {'columns': ['x', 'y'], 'time': {'column': 't'}}}},
            f"'felt_7.csv/1' and 'cork_1.csv/1' {SAME}",
        )
        for name, x, y in (
            ('with an offset', U + 0.37, V - 5.1), ('with a factor', -2.5 * U, 9.81 * V),
            ('with exchanged channels', V, U), ('of one channel', U, X), ('of the other channel', Y, V),
            ('that runs back', U[::-1], V[::-1]),
            ('of a half with all of these', 3 - X, np.r_[Y[:300], 3 - 2 * U[:300][::-1]]),
        )
    },
    **{
        f'a copy of coarse channels {name}': (
            both(csv(T, *COARSE, names='t,x0,x1,x2'), csv(T, *other, names='t,x0,x1,x2', name='felt_7.csv')),
            {'streams': {'signal': {'columns': ['x0', 'x1', 'x2'], 'time': {'column': 't'}}}}, SAME,
        )
        for name, other in (
            ('as it is', COARSE), ('with an offset', COARSE + 7), ('that runs back', COARSE[:, ::-1]),
            ('in another order', COARSE[[2, 0, 1]]),
        )
    },
    'a copy among others': (
        both(csv(T, X), csv(T, Y, name='felt_2.csv'), csv(T, np.r_[Y[:400], X[:200]], name='felt_3.csv')), {}, SAME,
    ),
    'a long copy': (
        lambda folder: np.savez(folder / 'cork_1.npz', **{'1/x': LONG, '2/x': LONG[60_001:]}),
        {**ANY, **RATE, 'tables': '{i}'}, f"'cork_1.npz/1/1' {SAME}".replace('cork_1.npz/1', 'cork_1.npz, 1'),
    ),
    **{
        f'no copy: {name}': (both(csv(T, one), csv(T, other, name='felt_7.csv')), {}, [('cork', one), ('felt', other)])
        for name, one, other in (
            ('a period', np.tile(X[:50], 12), np.tile(X[:50], 13)[7 : N + 7]),
            ('a period that begins later', np.tile(X[:100], 6), np.r_[Y[:3], np.tile(X[:100], 6)][:N]),
            ('few samples', X, np.r_[Y[:300], X[300:320], Y[320:]]),
        )
    },
    'a robot that repeats itself to 0.4 levels': (
        npz(**{f'{number}/x': run for number, run in enumerate(REPEATS)}), {**ANY, **RATE, 'tables': '{i}'},
        [('cork', run) for run in REPEATS],
    ),
    'a part of a coarse channel': (
        both(csv(T, REPEATS[0][:N]), csv(T[:60], REPEATS[0][200:260], name='felt_7.csv')), {}, SAME,
    ),
    'a hum of few levels, and again': (
        npz(**{f'{number}/x': hum for number, hum in enumerate(HUMS)}), {**ANY, **RATE, 'tables': '{i}'},
        [('cork', hum) for hum in HUMS],
    ),
    'a run twice in a file': (
        csv(np.r_[T[:300], 9 + T[:300]], np.tile(X[:300], 2)), {'slides': {'by': 'pause'}},
        "slides 'cork_1.csv/2' and 'cork_1.csv/1'",
    ),
    'a trial without a label': (
        csv(T, X, np.repeat([1, 2], 300), np.repeat(['cork', ''], 300), names='t,x,trial,l'),
        {'label': {'column': 'l'}, 'slides': {'by': 'column', 'column': 'trial'}},
        "row 302, column 'l': the label is blank in all rows of a slide; fill it in, or name another column$",
    ),
    'a blank label of the whole file': (
        npz(x=X, l=''), {**ANY, **RATE, 'label': {'column': 'l'}},
        'the label is blank in all rows of a slide; fill it in, or name another column$',
    ),
    'a label in the last row of each trial': (
        csv(T, X, np.repeat([1, 2], 300), [*[''] * 299, 'cork', *[''] * 299, 'felt'], names='t,x,trial,l'),
        {'label': {'column': 'l'}, 'slides': {'by': 'column', 'column': 'trial'}}, HALVES,
    ),
    'groups in the order of their numbers': (
        npz(**{f'data/{number}/x': tone(number) for number in (1, 10, 11, 2)}), PARTS | {'label': {'value': 'cork'}},
        [('cork', tone(number)) for number in (1, 2, 10, 11)],
    ),
    'files in the order of their numbers': (
        both(*(csv(T, tone(number), name=f'cork_{number}.csv') for number in (1, 10, 2))), {},
        [('cork', tone(number)) for number in (1, 2, 10)],
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


MISSING = X.copy()
MISSING[[100, 200]] = np.nan
PAC = {'columns': ['pac_*'], 'rate_hz': 1200.0}
THOUSANDS = [f'{value:,}' for value in np.round(2000 * X).astype(int).tolist()]
POINTS = [value.replace(',', '.') for value in THOUSANDS]
GERMAN = {'format': {'delimiter': ';', 'decimal': ','}, **RATE}
TWICE = {'signal': {'columns': ['x'], 'rate_hz': 100.0}, 'signal_static': {'columns': ['y'], 'rate_hz': 10.0}}
WINDOWS = np.random.default_rng(0).normal(size=(30, 40)).round(3)
WINDOW = {'columns': ['x_*'], 'rate_hz': 100.0}


def windows(folder: Path) -> None:
    csv(*WINDOWS.T, names=','.join(f'x_{number}' for number in range(40)))(folder)


BY_ROW = {'columns': ['X.*'], 'rate_hz': 100.0}


def overlapping(size: int, hop: int) -> np.ndarray:
    """Return windows of two recordings, one in each row."""
    return np.array([one[at : at + size] for one in (X, Y) for at in range(0, N - size + 1, hop)])


def alternating(*names: Any) -> Write:
    count = len(names)
    samples = np.repeat(X, count) * np.tile(1 + np.arange(count), N)
    return csv(np.repeat(T, count), samples, list(names) * N, names='t,x,sensor')


def coded_by(name: str, codes: Any) -> Write:
    return csv(X, codes, names=f'x,{name}')


def numbered(columns: str) -> dict:
    return {'streams': {'signal': {'columns': [columns], 'time': {'column': 0}}}}


AXES = {'streams': {'signal': {'columns': ['a*'], 'time': {'column': 't'}}}}


def far(offset: float, kind: str = 'f8', spread: float = 1.0) -> Write:
    return npz(
        x=(np.rint(spread * X) if kind[0] in 'iu' else spread * X).astype('f8').astype(kind) + np.array(offset, kind)
    )


UNUSED: dict[str, Any] = {  # what changes in tables of anybody and is none of sensors, trials or runs
    'a contact': np.repeat([0, 1], 300),
    'a contact as text': np.repeat(['True', 'False'], 300),
    'fractions': np.repeat([0.5, 1.5], 300),
    'remarks': np.where(np.arange(N) == 300, 'bump', np.where(np.arange(N) == 400, 'ok', '')),
    'many texts': [f'{number // 6} %' for number in range(N)],
}
ID = "row {}, column 'id': it changes"
ROWS: dict[str, tuple[Write, dict, Truth]] = {
    **{
        f'sensors {names}': (
            alternating(*names), {}, r"column 'sensor': it changes .* within a slide.*rows: \{sensor: ",
        )
        for names in (('S2', 'S1'), ('a', 'b', 'c'), (0, 1, 2, 3))
    },
    'one of three sensors': (alternating('a', 'b', 'c'), {'rows': {'sensor': 'a'}}, CORK),
    'windows': (windows, {'streams': {'signal': WINDOW}}, '40 columns, x_0 … x_39, and 30 rows; write samples_per_row'),
    'windows that are slides': (
        windows, {'streams': {'signal': {**WINDOW, 'samples_per_row': 40}}, 'slides': {'by': 'row'}},
        [('cork', window) for window in WINDOWS],
    ),
    **{
        f'{len(rows)} windows of {len(rows[0])} samples every {hop} samples, first {rows[0, 0]}': (
            npz(X=rows), {**ANY, 'streams': {'signal': {**BY_ROW, 'samples_per_row': len(rows[0])}},
                          'slides': {'by': 'row'}}, truth,
        )
        for hop, rows, truth in (
            (60, overlapping(300, 60), f"'cork_1.npz/2' and 'cork_1.npz/1' {SAME}"),
            (60, overlapping(300, 60)[np.random.default_rng(0).permutation(12)], f"{SAME}"),
            (25, overlapping(50, 25), f"'cork_1.npz/2' and 'cork_1.npz/1' {SAME}"),
            (50, overlapping(50, 50), [('cork', row) for row in overlapping(50, 50)]),
        )
    },
    'windows in rows that are called trials': (
        npz(X=overlapping(50, 20)),
        {**ANY, 'streams': {'signal': BY_ROW}, 'slides': {'by': 'column', 'column': 'trial'}},
        r"no column 'trial'.* Known: X.0, (X.\d+, ){9}… \(52\); .* write slides: \{by: row\} and `samples_per_row`",
    ),
    'trials that overlap': (
        npz(X=overlapping(50, 20)[..., None]),
        {**ANY, 'streams': {'signal': BY_ROW}, 'slides': {'by': 'column', 'column': 'trial'}}, SAME,
    ),
    'columns in another order': (
        both(csv(T, X, Y, names='t,ax,ay'), csv(U, V, T, names='ay,ax,t', name='felt_1.csv')), AXES,
        [('cork', np.c_[X, Y]), ('felt', np.c_[V, U])],
    ),
    **{
        f'a file with {names}': (
            both(csv(T, X, Y, names='t,ax,ay'), csv(T, X, *more, names=names, name='felt_1.csv')), AXES, sentence,
        )
        for names, more, sentence in (
            ('t,ax', (), "'felt_1.csv': no column 'ay'. Known: ax, t"),
            ('t,ax,Ay', (2 * Y,), r"'felt_1.csv': no column 'ay'. Known: Ay, ax"),
            ('t,ax,ay,audio', (2 * Y, Y), r"'felt_1.csv': 'signal' has the column 'audio', and none in .* \(ax, ay\)"),
        )
    },
    **{
        f'values of {kind} about {offset:g}': (
            far(offset, kind, spread), {**ANY, **RATE},
            r"channel 'x' of 'signal' varies by .* bag, which has 32 bits .*: subtract a constant from its column",
        )
        for offset, kind, spread in (
            (2**33, 'i8', 400.0), (2**31, 'u4', 100.0), (101325.0, 'f8', 0.02), (1.01325e8, 'f8', 1.0),
        )
    },
    'whole numbers that are far from 0 and fit': (
        far(2**23, 'i4', 50.0), {**ANY, **RATE}, [('cork', np.rint(50 * X) + 2**23)],
    ),
    'a constant channel that is rounded': (
        csv(X, [0.1] * N, names='x,y'), {'streams': {'signal': {'columns': ['x', 'y'], 'rate_hz': 100.0}}},
        [('cork', np.c_[X, [0.1] * N])],
    ),
    'numbers that are too large': (csv(['1e39', *X[1:99], '-4e38', *X[100:]], names='x'), RATE, [
        ('cork', np.r_[X[1:99], np.nan, X[100:]]),
    ]),
    'a slide that stands still': (
        both(csv(T, X), csv(T, [1.5] * N, name='felt_1.csv')), {}, CORK,
    ),
    **{
        f'a sensor that is frozen for {count} rows': (
            both(csv(T, V, U, names='t,x,y'),
                 csv(T, *np.where((T > 1) & (1 + count / 100 > T), [[0.5], [0.25]], [X, Y]), names='t,x,y',
                     name='felt_1.csv')),
            {'streams': {'signal': {'columns': ['x', 'y'], 'time': {'column': 't'}}}}, truth,
        )
        for count, truth in (
            (30, [('cork', np.c_[V, U])]),
            (8, [('cork', np.c_[V, U]), ('felt', np.where(((T > 1) & (T < 1.08))[:, None], [0.5, 0.25], np.c_[X, Y]))]),
        )
    },
    **{
        f'{count} rows of each sample': (
            csv(T, X.repeat(count)[:N]), {}, f"'signal' has each sample {count} times, as if a slower sensor were",
        )
        for count in (2, 3, 7)
    },
    **{
        f'a column twice by {columns}': (
            csv(T, X, Y, names='t,x,y'),
            {'streams': {'signal': {'columns': columns, 'channels': channels, 'rate_hz': 100.0}}}, sentence,
        )
        for columns, channels, sentence in (
            (['x', 'x'], [], r"'signal' has 'x' twice under `columns`; name each once"),
            (['y', '[xy]'], [], r"'signal' has 'y' twice under `columns`"),
            (['x', 'y'], ['a', 'a'], r"'signal' has 'a' twice under `channels`"),
        )
    },
    **{
        f'{name} as a channel': (
            csv(times, X, names='t,x'), {'streams': {'signal': {'columns': ['*'], 'rate_hz': 100.0}}},
            r"channel 't' of 'signal' rises \d+ times and falls \d+ times, as time, a counter or a position does; lea",
        )
        for name, times in (
            ('time', T), ('time that jitters', T + 0.004 * (np.arange(N) % 3)), ('a counter', range(N)),
            ('a counter that rolls over at 256', np.arange(N) % 256), ('a counter that falls', range(N, 0, -1)),
            ('a counter with each number twice', np.arange(N) // 2), ('time of a minute', (T + 57).round(2) % 60),
        )
    },
    'a stream that stands still': (csv(X, [1.5] * N, names='x,y'), BOTH, "'signal_static' does not change"),
    'no slide that changes': (
        csv(T, [1.5] * 100 + [''] + [1.5] * 499), {}, 'with samples that change .*: 1 slides in which .signal. does n',
    ),
    'rows that stand still': (
        npz(X=np.r_[WINDOWS, np.ones((2, 40)) * [[1], [2]]]),
        {**ANY, 'streams': {'signal': {**BY_ROW, 'samples_per_row': 40}}, 'slides': {'by': 'row'}},
        [('cork', window) for window in WINDOWS],
    ),
    'a channel that stands still': (
        csv(X, [1.5] * N, names='x,y'), {'streams': {'signal': {'columns': ['x', 'y'], 'rate_hz': 100.0}}},
        [('cork', np.c_[X, [1.5] * N])],
    ),
    'sensors at times of their own': (
        csv(np.ravel(np.c_[T, T + 0.005]).round(4), np.ravel(np.c_[X, Y]), ['a', 'b'] * N, names='t,x,id'), {},
        r"'id': it changes from 'a' to 'b' within a slide.*rows: \{id: 'a'\}",
    ),
    'sensors without times': (csv(np.ravel(np.c_[X, Y]), [1, 2] * N, names='x,id'), RATE, ID.format(3)),
    'sensors in blocks without times': (csv(X, np.repeat([1, 2], 300), names='x,id'), RATE, ID.format(302)),
    'trials that no key uses': (csv(T, X, np.repeat(range(6), 100), names='t,x,trial'), {}, "'trial': it changes"),
    'other columns': (
        csv(T, X, np.arange(N) % 256, (20 * Y).astype(int), T.astype(str), names='t,x,n,adc,wall'), {}, CORK,
    ),
    **{
        f"'{cell}' in every {every} rows of an unused column": (
            csv(T, X, np.where(np.arange(N) % every, '1.5', cell), names='t,x,y'), {}, CORK,
        )
        for cell, every in (('-', 20), ('--', 11), ('inf', 20), ('N/A', 9))
    },
    **{
        f'trials {codes}': (coded_by('trial', np.repeat(codes, N // len(codes))), content, "'trial': it changes")
        for codes in ((1, 2, 4), (10, 20, 30), (0, 1), (1, 2, 1, 2)) for content in (RATE,)
    },
    'times of the day': (
        csv(T, X, [f'12:00:{int(t):02d}' for t in T], names='t,x,wall'), {},
        "'wall': it changes from '12:00:00' to '12:00:01'.*or take all as one signal by rows: ",
    ),
    'conditions of another sensor that are no numbers': (
        csv(np.repeat(T, 2), np.ravel(np.c_[X, Y]), ['a', 'b'] * N, [1.0, '-'] * N, names='t,x,id,f'),
        {'rows': {'id': 'a'}, 'conditions': {'force': {'column': 'f', 'unit': 'N'}}}, CORK,
    ),
    'an empty file': (text(''), {}, "' is empty, or has comments only"),
    **{
        f'a file of {name}': (binary(content), {}, sentence)
        for name, content, sentence in (
            ('gzip', gzip.compress(b't,x'), "'cork_1.csv' is a file of gzip, whatever its name; unpack it"),
            ('Excel', b'PK\x03\x04' + bytes(99), 'is a file of ZIP or Excel, .*, or save it as CSV in UTF-8'),
            ('old Excel', b'\xd0\xcf\x11\xe0' + bytes(99), 'is a file of Excel,'),
            ('UTF-16', 't,x\n1,2\n'.encode('utf-16'), 'is a file of UTF-16, .* in UTF-8'),
            ('CR', b't,x\r1,2\r3,4\r', 'ends lines with CR alone'),
            ('PNG', b'\x89PNG\r\n\x1a\n\0\0\0\rIHDR', "'cork_1.csv' is a file of bytes and not of text, whatever"),
        )
    },
    'another delimiter': (
        csv(T, X), {'format': {'delimiter': ';'}}, r"no column 'x'. Known: t,x; see `delimiter` \(';' here\)",
    ),
    'lines above the names': (
        text('Logger 3000\nt,x\n' + lines(T, X)), {}, "no column 'x'. Known: 3000, Logger; .* and `skip_rows`",
    ),
    'points that are called commas': (
        csv(T, X), {'format': {'decimal': ','}}, "'0.0' is not a finite number; if points are decimal, leave out `de",
    ),
    'no file of the form': (
        both(*(csv(T, X, name=f'cork-{run}.csv') for run in range(5))), {},
        "has the form .*; it has 'cork-0.csv', 'cork-1.csv', 'cork-2.csv'; give",
    ),
    'seconds': (csv(T, X, (T + 1_700_000_000.4).astype(int), names='t,x,sec'), {}, "'sec': it changes from '17"),
    **{f'column of {name}': (csv(T, X, cells, names='t,x,y'), {}, CORK) for name, cells in UNUSED.items()},
    'all codes at once': (
        csv(T, X, np.repeat([21, 22], 300), np.repeat(['a', 'b'], 300), names='t,x,temp [C],state'), {},
        r"'temp \[C\]': it changes from '21' to '22' within a slide \(state too\).*"
        r"rows: \{'temp \[C\]': '\*', state: '\*'\}$",
    ),
    'a malformed row among those of sensors without times': (
        text('x,id\n' + lines(np.ravel(np.c_[X, Y]), ['a', 'b'] * N).replace(f'{X[9]},a\n', '?\n')),
        {**RATE, 'rows': {'id': 'a'}}, 'row 20, .*1 cells, 2 are needed: of a malformed row nobody knows',
    ),
    **{
        f'{columns} with columns of {", ".join(content)}': (
            csv(T, X, [7] * N, [0.5] * N, names='t,x,k,f'),
            {'streams': {'signal': {'columns': columns, 'time': {'column': 't'}}},
             'conditions': {'force': {'column': 'f'}}, 'rows': {'k': '7'}, **content}, truth,
        )
        for columns, content, truth in (
            (['*'], {}, CORK), (['*', 'f'], {}, [('cork', np.c_[X, np.full(N, 0.5)])]),
            (['t', 'x'], {}, "column 't' is a channel under `columns` and is the column under `time`; remove it"),
            (['x', 'k'], {}, 'is the column under `rows`'),
            (['*', 'k'], {'rows': {}, 'label': {'column': 'k', 'names': {7: 'cork'}}}, 'is the column under `label`'),
        )
    },
    'numbered columns with that of time': (
        text(lines(T, X)), {**numbered('0-1'), 'format': {'header': False}}, "'0' is a channel .* under `time`",
    ),
    'an index without a name': (
        csv(range(N), X, names=',x'), {'streams': {'signal': {'columns': ['*'], 'rate_hz': 100.0}}}, CORK,
    ),
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
    'units below the header': (
        text('n,x\nsample,1\n' + lines(range(N), X)), RATE, "row 2, column 'n': a word in a column of numbers that no",
    ),
    'a mean below the rows': (
        text('n,x\n' + lines(range(N), X) + 'Mean,0.3\n'), RATE, r"row 602, .* texts there by rows: \{'n': '\*'\}$",
    ),
    'a delimiter at the end of each row': (text('t,x\n' + lines(T, [f'{x:.6f},' for x in X])), {}, CORK),
    'a last row that was cut': (text(('t,x\n' + lines(T, [f'{x:.6f}' for x in X]))[:-4]), {}, [('cork', X[:-1])]),
    'a last row that was cut and rows': (
        text(('id,x\n' + lines(['a', 'b'] * (N // 2), X))[:-4]), {**RATE, 'rows': {'id': 'a'}}, [('cork', X[::2])],
    ),
    'many texts in two slides': (
        csv(T, X, UNUSED['many texts'], np.repeat(['a', 'b'], N // 2), names='t,x,share,part'),
        {'slides': {'by': 'column', 'column': 'part'}}, [('cork', X[: N // 2]), ('cork', X[N // 2 :])],
    ),
    '#N/A in the first column': (
        csv(['#N/A' if np.isnan(x) else x for x in MISSING], Y, names='x,y'), RATE, [('cork', MISSING)],
    ),
    'an underscore': (csv([*X[:100], '1_000', *X[101:200], '-', *X[201:]], names='x'), RATE, [('cork', MISSING)]),
    **{
        f'a first row of numbers by {form}': (
            text('# logger\n7,8\n' + lines(range(N), X)),
            {'streams': {'signal': {'columns': [1], 'rate_hz': 100.0}}, 'format': form}, truth,
        )
        for form, truth in (
            ({}, r'row is 7, 8, which are numbers .*\{header: false, skip_rows: 2\} if they are names: columns then'),
            ({'header': False}, [('cork', np.r_[8, X])]), ({'header': False, 'skip_rows': 2}, CORK),
        )
    },
    'a first row of one number': (text(lines([5, *X])), RATE, 'the first row is 5, which are numbers'),
    'no header': (text(lines(X, Y)), {'streams': {'signal': {'columns': ['*'], 'rate_hz': 100.0}}}, 'no names; write'),
    'commas decimal and delimiters': (
        text('n,x,y\n' + lines(range(N), [f'{x:.4f}'.replace('.', ',') for x in X])), RATE, "'y' holds digits such as",
    ),
    'a header in the coding of Windows': (
        lambda folder: (folder / 'cork_1.csv').write_bytes(('n,x [m/s²]\n' + lines(range(N), X)).encode('cp1252')),
        {'streams': {'signal': {'columns': ['x [m/s²]'], 'rate_hz': 100.0}}}, CORK,
    ),
    **{
        f'a time as {first}': (
            csv([f'{first}{t:06.3f}' for t in T], X), {}, f"'{first}00.000' is not a finite number; dates are not read",
        )
        for first in ('2026-03-01 10:00:', '1/3/2026 10:00:', '10:00:')
    },
    'decimal commas': (text('n;x\n' + '1;0,5\n' * 200), RATE, "'0,5' is not a finite number; if commas are decimal"),
    'points of thousands': (
        text('n;x\n' + ''.join(f'{n};{x.replace(",", ".")}\n' for n, x in enumerate(THOUSANDS))), GERMAN,
        r"'1\.\d+' is not a finite number",
    ),
    'commas of thousands': (
        text('n;x\n' + ''.join(f'{n};{x}\n' for n, x in enumerate(THOUSANDS))), GERMAN, 'seems to separate thousands',
    ),
    'points of thousands or decimals': (
        text('x\n' + lines(POINTS)), RATE, r"'x': the point of '\S+' may be decimal or .* format: \{decimal: '\.'\}",
    ),
    'points of thousands in ms': (
        csv([f'{n:,}'.replace(',', '.') for n in range(0, 10 * N, 10)], X), timed('ms'), "column 't': the point of '1",
    ),
    'points of thousands behind many rows': (
        text('x\n' + lines([*range(900), *(['7'] * 25_000), '1.234', '1.234', '1.235'])), RATE, "the point of '1.234'",
    ),
    'points that are stated to be decimal': (
        text('x\n' + lines(POINTS)), {**RATE, 'format': {'decimal': '.'}}, [('cork', np.array(POINTS, float))],
    ),
    **{
        f'points, and {cell}': (
            csv([*POINTS[:-1], cell], names='x'), RATE, [('cork', np.array([*POINTS[:-1], cell], float))],
        )
        for cell in ('0.125', '1234.125', '1.25')
    },
}  # fmt: skip


def test_files_at_another_depth_are_named_and_a_pointer_of_git_lfs_is_no_data(tmp_path: Path) -> None:
    mapping = mapping_from(PLAIN)
    (tmp_path / 'deeper').mkdir()
    for folder in (tmp_path, tmp_path / 'deeper'):
        csv(T, X)(folder)
    report = import_tables(mapping, tmp_path, None)
    assert report.left_out == {'files lie in more or fewer folders than `files` names': 1}
    text('version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n', 'felt_1.csv')(tmp_path)
    with pytest.raises(InvalidData, match=r"'felt_1\.csv' is a pointer of Git LFS .* git lfs pull"):
        import_tables(mapping, tmp_path, None)


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


def wav(declared: int, sounds: int = 1, channels: int = 1) -> Write:
    samples = (X * 2**14).astype('<i2').tobytes()
    head = b'WAVEfmt ' + struct.pack('<IHHIIHH', 16, 1, channels, 1000, 2000, 2, 16)
    body = head + (b'data' + struct.pack('<I', declared) + samples) * sounds
    return lambda folder: (folder / 'cork_1.wav').write_bytes(b'RIFF' + struct.pack('<I', len(body)) + body)


def h5_with(add: Callable[[h5py.File], object]) -> Write:
    def write(folder: Path) -> None:
        with h5py.File(folder / 'cork_1.h5', 'w') as file:
            file['x'] = X
            add(file)

    return write


def parquet(folder: Path) -> None:
    count = 9_000_000 // N  # of bytes of each row, in one copy
    bytes_ = pa.DictionaryArray.from_arrays(np.zeros(N, np.int32), pa.array([bytes(count)], pa.binary()))
    flags = pa.array([None if row % 7 == 0 else row > 300 for row in range(N)])
    table = pa.table({'x': X, 'contact': flags, 'list': pa.array([[1.0, 2.0]] * N), 'raw': bytes_})
    pq.write_table(table, folder / 'cork_1.parquet', store_schema=False)


SOUND = {**ANY, 'streams': {'signal': {'columns': ['*']}}}
CONTAINERS: dict[str, tuple[Write, dict, Truth]] = {
    'records of arrays': (
        records, {**ANY, 'streams': {'signal': {'columns': ['d.acc.*'], 'rate_hz': 100.0}}}, [('cork', np.c_[X, Y])],
    ),
    'objects': (npz(x=X.astype(object)), {**ANY, **RATE}, 'Object arrays .*; save .* as numbers, slides of un'),
    'an array on its side': (
        npz(**{'1/a': np.c_[T, 0.06 + 0.01 * X, 0.05 + 0.01 * X, 0.1 + 0.01 * Y].T}),
        {**ANY, **numbered('1-3'), 'tables': '{i}/a'},
        r"'0': time goes back .*: if the array lies on its side, write format: \{transpose: true\}",
    ),
    'an array on its side whose first samples grow': (
        npz(**{'1/a': np.c_[T, 1.4 + 0.01 * X, 2.8 + 0.01 * Y].T}), {**ANY, **numbered('1-2'), 'tables': '{i}/a'},
        r'has 3 rows and 600 columns: if the array lies .*transpose: true\}; the rate of .* by its times; give a col',
    ),
    'sounds of two rates': (
        both(*(lambda folder, hz=hz: wavfile.write(folder / f'cork_{hz}.wav', hz, X) for hz in (8000, 9000))), SOUND,
        r"'cork_9000.wav': 'signal' has 9000 Hz by itself, 8000 Hz are expected; look at `rate_hz`",
    ),
    'durations': (
        lambda folder: pq.write_table(
            pa.table({'x': X, 't': pa.array((1e3 * T).round().astype('m8[ms]'))}), folder / 'cork_1.parquet'
        ), {**ANY, **timed('ns')}, CORK,
    ),
    'parts that were never written': (h5(1000), {**ANY, **RATE}, 'has parts that were never written'),
    'values with a scale': (h5(scale_factor=0.5, add_offset=3.0), {**ANY, **RATE}, 'has the attribute add_offset'),
    'a WAV file that was cut': (wav(2 * N + 2000), SOUND, 'was cut off, .* declares 3200 bytes of sound and has 1200'),
    'a WAV file of a pipe': (wav(2**32 - 1), SOUND, 'or written to a pipe: it declares 4294967295 bytes'),
    'two sounds': (wav(2 * N, 2), SOUND, 'has 2 chunks of sound'),
    'a WAV file of many channels': (wav(2 * N, channels=65535), SOUND, 'declares 65535 channels .* from 1 to 10000'),
    'a WAV file of no channels': (wav(2 * N, channels=0), SOUND, 'declares 0 channels'),
    'an array with the name of the windows': (
        npz(X=np.random.default_rng(0).normal(size=(20, 100, 3)), trial=np.repeat(range(5), 4)),
        {**ANY, 'streams': {'signal': {'columns': ['X.*'], 'rate_hz': 100.0}}}, "'trial' is the number of a window",
    ),
    'trials as one slide': (
        npz(X=np.ones((20, 100, 3))), {**ANY, 'streams': {'signal': {'columns': ['X.*'], 'rate_hz': 100.0}}},
        r'slides: \{by: column, column: trial\}',
    ),
    'many short trials as one slide': (
        npz(X=np.random.default_rng(0).normal(size=(3000, 5, 2))),
        {**ANY, 'streams': {'signal': {'columns': ['X.*'], 'rate_hz': 100.0}}}, "column 'trial': it changes from '0'",
    ),
    **{
        f'unused {name}': (write, {**ANY, **RATE}, CORK)
        for name, write in {
            'array of four dimensions': npz(x=X, img=np.ones((3, 2, 2, 2))),
            'complex numbers': npz(x=X, z=X * 1j),
            'dates': npz(x=X, d=np.full(N, np.datetime64('2026-03-01'))),
            'lists in HDF5': h5_with(lambda file: file.create_dataset('z', (N,), h5py.vlen_dtype('f8'))),
            'nothing in HDF5': h5_with(lambda file: file.create_dataset('z', data=h5py.Empty('f8'))),
            'complex numbers in HDF5': h5_with(lambda file: file.create_dataset('z', data=X * 1j)),
            'columns of Parquet': parquet,
        }.items()
    },
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


def table(folder: Path) -> None:
    kind, types = 'std_msgs/msg/Float32MultiArray', STORE.types
    axes = [types['std_msgs/msg/MultiArrayDimension'](label=name, size=size, stride=size)
            for name, size in (('samples', 10), ('channels', 2))]  # fmt: skip
    layout = types['std_msgs/msg/MultiArrayLayout'](dim=axes, data_offset=0)
    with Writer(folder / 'a_1', version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('/p', kind, typestore=STORE)
        value = types[kind](layout=layout, data=np.zeros(20, np.float32))
        writer.write(connection, START_NS, STORE.serialize_cdr(value, kind))


def foreign(definition: str, content: bytes = bytes(64)) -> Write:
    """Write a bag with one message of a type of others."""

    def write(folder: Path) -> None:
        with Writer(folder / 'a_1', version=8, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection('/p', 'my_msgs/msg/A', msgdef=definition, rihs01='RIHS01_0')
            writer.write(connection, START_NS, b'\x00\x01\x00\x00' + content)

    return write


def database(sql: str) -> Write:
    def write(folder: Path) -> None:
        with closing(sqlite3.connect(folder / 'a_1' / 'a_1.db3')) as opened:
            opened.executescript(sql)

    return both(bag(plugin=StoragePlugin.SQLITE3), write)


B = '=' * 80 + '\nMSG: my_msgs/B\n'
COUNT = 'WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT x FROM c'
BAGS: dict[str, tuple[Write, Truth]] = {
    'SQLite': (bag(plugin=StoragePlugin.SQLITE3), HALVES),
    'SQLite with a view that never ends': (database(f'CREATE VIEW v AS {COUNT}'), "'v' in it is none of the plain"),
    'SQLite with a computed column': (
        database('CREATE TABLE v (y, x BLOB AS (zeroblob(1000000000)))'), "'v' in it is none of the plain tables",
    ),
    'SQLite with a large message': (
        database('UPDATE messages SET data = zeroblob(300000000) WHERE id = 9'), 'a message of 300 MB; at most 200 MB',
    ),
    'SQLite with large messages of another topic': (
        database(
            'INSERT INTO topics SELECT 99, "/image", type, serialization_format, offered_qos_profiles, '
            'type_description_hash FROM topics LIMIT 1; '
            'INSERT INTO messages SELECT 9999, 99, timestamp, zeroblob(5000000) FROM messages LIMIT 1'
        ),
        HALVES,
    ),
    'an array of many messages': (
        foreign(f'my_msgs/B[100000] e\n{B}'), 'A has 100001 values by the lengths of its arrays; at most 2000',
    ),
    'arrays in arrays': (foreign(f'my_msgs/B[1000] e\n{B}string[1000] e'), 'has 1001001 values'),
    'an array without elements': (foreign(f'my_msgs/B[] e\n{B}uint8[0] e'), 'an array of 0 elements'),
    'a type in itself': (foreign('my_msgs/A[] e'), 'my_msgs/msg/A contains itself'),
    'a long definition': (foreign('float64 e\n' + '#\n' * 50_000), 'has 100010 characters; at most 100000'),
    'a large message': (foreign('uint8[] e', bytes(5_000_000)), "a message of 5 MB on '/p'; at most 4 MB"),
    'a stamp that is a number': (
        foreign(f'my_msgs/B header\nfloat64 x\n{B}float64 stamp', bytes(16)), "'/p': header.stamp is 0.0; a built",
    ),
    'a bag of ROS 1': (text('#ROSBAG V2.0', 'a_1.bag'), 'is a bag of ROS 1; convert it: rosbags-convert'),
    'a clock one hour ahead': (bag(3600.0), HALVES),
    'a clock that began at the start': (bag(-1.7e9 + 100.0), HALVES),
    'sensors of two frames': (bag(frames=2), r"frame_id': it changes .*rows: \{/p/header.frame_id: 'a'\}"),
    'sound': (sound, 'is sound whose messages do not tell the format; give a WAV file'),
    'an array of two dimensions': (table, "message 0 of '/p' cannot be read: its array has several dimensions"),
    'a clock that is faster': (bag(3600.0, 0.5), r"topic '/p': the stamps differ .* and that changes by 2\.\d+ s"),
    'empty metadata': (both(bag(), emptied), HALVES),
    'several files without metadata': (
        both(bag(), bag(name='b_1'), without('b_1/b_1.mcap', 'b_1/b_2.mcap'), without('b_1/metadata.yaml')),
        "'b_1' is a folder .* it holds b_1.mcap, b_2.mcap without metadata.yaml",
    ),
    'SQLite without metadata': (
        both(bag(), bag(name='b_1', plugin=StoragePlugin.SQLITE3), without('b_1/metadata.yaml')), "b_1.db3 without",
    ),
    'a file that is not listed': (both(bag(), without('a_1/a_1.mcap', 'a_1/a_2.mcap')), r'a_2\.mcap is not listed'),
}  # fmt: skip


@pytest.mark.parametrize('name', BAGS)
def test_bags(tmp_path: Path, name: str) -> None:
    write, truth = BAGS[name]
    label = {'label': {'column': '/surface/data'}, 'slides': {'by': 'column', 'column': '/surface/data'}}
    streams = {'signal': {'columns': ['/p/point.x']}}
    check(tmp_path, write, {'files': '{a}_{run}', 'streams': streams, **label}, truth, 'bag')


def test_a_pattern_behind_a_topic_without_a_slash_is_no_field_of_it(tmp_path: Path) -> None:
    content = {'streams': {'signal': {'columns': ['/p.*']}}, 'files': '*', 'label': {'value': 'cork'}}
    check(tmp_path, bag(), content, r"'/p\.\*' names no field of the topic '/p'; write columns as topic and", 'bag')


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


def h5_of_holes(folder: Path) -> None:
    with h5py.File(folder / 'cork_1.h5', 'w') as file:
        file.create_dataset('x', shape=(10**10,), chunks=(10**6,), compression='gzip')


SIZES: dict[str, tuple[Write, str]] = {
    'cells': (mat(matlab(1, 400_000_000)), 'declares more than 8 million values'),
    'cells in a cell': (mat(matlab(1, 1, matlab(1, 40_000_000, name=b''))), "'cork_1.mat' cannot be read"),
    'numbers': (mat(matlab(6, 2_000_000_000, element(9, bytes(80)))), 'declares more than 8 million values'),
    'no rows': (h5_without_rows, 'declares more than 8 million values'),
    'a header': (csv(names=','.join(f'x{number}' for number in range(20_000))), 'has 20000 columns; at most 10000'),
    'holes': (h5_of_holes, 'declares more than 8 million values'),
    'zeros': (
        lambda folder: np.savez_compressed(folder / 'cork_1.npz', x=np.zeros(9_000_000, np.uint8)),
        'declares more than 8 million values',
    ),
    'packed zeros': (
        lambda folder: scipy.io.savemat(
            folder / 'cork_1.mat', {'x': np.zeros(70_000_000, np.uint8)}, do_compression=True
        ),
        'declares more than 8 million values',
    ),
    'sound': (wav(2**32 - 100), 'declares 4294967196 bytes of sound and has 1200'),
}  # fmt: skip


@pytest.mark.parametrize('name', SIZES)
def test_sizes(tmp_path: Path, name: str) -> None:
    write, sentence = SIZES[name]
    check(tmp_path, write, {**ANY, **RATE}, sentence)


def run(folder: Path, kinds: tuple[str, ...] = MAPPED['table'], **content: Any) -> Any:
    """Import what lies in a folder, by time in column t unless given otherwise."""
    source = content.pop('source', folder)
    mapping = mapping_from({'files': '{material}_{run}.*', 'label': {'column': 'material'}, **content})
    return import_tables(mapping, source, folder / 'bags', kinds)


def test_the_report_names_channels_that_alone_stand_still_and_slides_without_a_speed(tmp_path: Path) -> None:
    still = {'a': [9.81] * N, 'b': np.r_[U[:300], [U[300]] * 300], 'c': np.repeat(V, 10)[:N], 'd': Y}
    csv(T, X, *still.values(), [''] * N, names='t,x,a,b,c,d,v')(tmp_path)
    signal = {'columns': ['x', 'a', 'b', 'c', 'd'], 'time': {'column': 't'}, 'unit': 'm/s^2'}
    report = run(tmp_path, streams={'signal': signal}, conditions={'speed': {'column': 'v'}})
    assert report.lines()[2:] == [
        '1 slide over 1 surface from 1 file of 600 rows',
        'left out: nothing',
        'kept; check the sensor and the columns:',
        "  1 slides in which 'a' of 'signal' does not change",
        "  1 slides in which 'b' of 'signal' does not change for over 0.1 s, as while a sensor is frozen or the finger "
        'rests (cut rest off)',
        "  1 slides in which 'c' of 'signal' has each sample 10 times, as if a slower sensor were held",
        '  1 slides without speed',
    ]
    [slide] = SlideDataset.from_bags(report.bags)
    assert {*slide.signals['signal'][0].units} == {'m/s²'}


def test_the_report_states_how_malformed_rows_were_treated(tmp_path: Path) -> None:
    cells = [f'{t:.2f},{x}' for t, x in zip(T, X, strict=True)]
    cells[7] = f',{X[7]}'  # without a time
    cells[20] = '0.20,oops'
    text('\n'.join(['t,x', *cells])[:-2])(tmp_path)
    report = run(tmp_path, streams={'signal': {'columns': ['x'], 'time': {'column': 't'}}})
    assert report.left_out == {
        'malformed rows, NaN where they are in a slide': 1,
        'malformed rows, of which the time alone, which is that between the rows around': 1,
        'malformed rows, which were dropped': 1,
    }
    assert [one for [one] in report.examples.values()] == [
        "'cork_1.csv', row 22, column 'x': 'oops' is not a finite number", "'cork_1.csv', row 9, no finite number",
        "'cork_1.csv', row 601, column 'all': the line has no end, so it may have been cut off",
    ]  # fmt: skip
    assert (report.streams['cork', 'signal']['samples'], report.streams['cork', 'signal']['NaN']) == (N - 1, 1)


@pytest.mark.parametrize(('also', 'refused'), [(0, False), (18, False), (19, True)])
def test_a_row_that_is_malformed_in_two_streams_counts_once(tmp_path: Path, also: int, refused: bool) -> None:
    x, y, t = X.copy(), Y.copy(), T.copy()
    x[100:142] = t[100:142] = x[300 : 300 + also] = y[300 : 300 + also] = np.nan
    npz(x=x, y=y, t=t)(tmp_path)
    time = {'column': 't'}
    streams = {name: {'columns': [column], 'time': time, 'rate_hz': 100.0}
               for name, column in (('signal', 'x'), ('signal_static', 'y'))}  # fmt: skip
    if refused:
        with pytest.raises(InvalidData, match='has 61 malformed rows of 600'):
            run(tmp_path, streams=streams)
    else:
        assert run(tmp_path, streams=streams).slides == {'cork': 1}


@pytest.mark.parametrize('every', [2, 10, 25])
def test_blanks_belong_to_the_slower_stream(tmp_path: Path, every: int) -> None:
    slow = [f'{x:.4f}' if row % every == 0 else '' for row, x in enumerate(X)]
    csv(np.arange(N), X, slow, names='t,x,y')(tmp_path)
    time = {'column': 't', 'unit': 'ms'}
    streams = {'signal': {'columns': ['x'], 'time': time}, 'signal_static': {'columns': ['y'], 'time': time}}
    report = run(tmp_path, streams=streams)
    assert (report.rates_hz['signal'], report.rates_hz['signal_static']) == pytest.approx(
        (1000, 1000 / every), rel=0.01
    )
    [slow_read], _ = SlideDataset.from_bags(report.bags).to_numpy('signal_static')
    np.testing.assert_allclose(slow_read[:, 0], X[::every], atol=1e-3)


@pytest.mark.parametrize('per_row', [2, 22, 100])
def test_consecutive_samples_of_a_row_are_one_channel(tmp_path: Path, per_row: int) -> None:
    pac, slow = np.random.default_rng(0).normal(size=(per_row, 120)), np.cos(np.arange(120.0))
    pac[:2, 7] = np.nan
    scipy.io.savemat(tmp_path / 'cork_1.mat', {'pac': pac, 'pdc': slow[None]})
    signal = {'columns': ['pac.*'], 'rate_hz': 100.0 * per_row, 'samples_per_row': per_row}
    static = {'columns': ['pdc'], 'rate_hz': 100.0}
    report = run(tmp_path, streams={'signal': signal, 'signal_static': static}, format={'transpose': True})
    [samples], _ = SlideDataset.from_bags(report.bags).to_numpy()
    np.testing.assert_allclose(samples[:, 0], pac.T.ravel(), atol=1e-6)
    assert report.streams['cork', 'signal']['NaN'] == 2


ACC, OTHER = np.stack([X, 2 * X], axis=1), np.stack([U, V], axis=1)


def struct_array(path: Path) -> None:
    kind = [('acc', object), ('material', object)]
    data = np.array([(ACC, 'cork'), (OTHER, 'felt')], dtype=kind)
    scipy.io.savemat(path / 'a_1.mat', {'data': data})


def nested_structs(path: Path) -> None:
    inner = {'acc': ACC, 'material': 'cork'}
    scipy.io.savemat(path / 'a_1.mat', {'data': {'run1': inner, 'run2': {'acc': OTHER, 'material': 'felt'}}})


def cell_of_structs(path: Path) -> None:
    cells = np.empty(2, object)
    cells[:] = [{'acc': ACC, 'material': 'cork'}, {'acc': OTHER, 'material': 'felt'}]
    scipy.io.savemat(path / 'a_1.mat', {'data': cells})


def hdf5_groups(path: Path) -> None:
    with h5py.File(path / 'a_1.h5', 'w') as file:
        for number, material in enumerate(('cork', 'felt'), 1):
            file[f'data/{number}/acc'], file[f'data/{number}/material'] = (ACC, OTHER)[number - 1], material


def matlab73_struct_array(path: Path) -> None:
    with h5py.File(path / 'a_1.mat', 'w', userblock_size=512) as file:
        reference = h5py.special_dtype(ref=h5py.Reference)
        for name in ('acc', 'material'):
            file.create_dataset(f'data/{name}', (1, 2), dtype=reference)
        for number, material in enumerate(('cork', 'felt')):
            file[f'#refs#/a{number}'] = (ACC, OTHER)[number].T
            text = file.create_dataset(f'#refs#/m{number}', data=np.frombuffer(material.encode(), 'u1').astype('u2'))
            text.attrs['MATLAB_class'] = np.bytes_('char')
            file['data/acc'][0, number] = file[f'#refs#/a{number}'].ref
            file['data/material'][0, number] = text.ref
    with (path / 'a_1.mat').open('r+b') as opened:
        opened.write(b'MATLAB 7.3 MAT-file')


@pytest.mark.parametrize('write', [struct_array, nested_structs, cell_of_structs, hdf5_groups, matlab73_struct_array])
def test_elements_of_structs_cells_and_groups_are_slides(tmp_path: Path, write: Callable[[Path], None]) -> None:
    write(tmp_path)
    stream = {'columns': ['acc.*'], 'rate_hz': 100.0}
    report = run(tmp_path, files='*', tables='data/{i}', streams={'signal': stream}, label={'column': 'material'})
    assert report.slides == {'cork': 1, 'felt': 1}
    [samples, _], _ = SlideDataset.from_bags(report.bags).to_numpy()
    np.testing.assert_allclose(samples, ACC, atol=1e-6)


CUSTOM = 'lab_msgs/msg/Touch'


def write_custom_bag(path: Path) -> Path:
    store = message_types()
    store.register(get_types_from_msg('float32[2] taxels\nfloat64 force\nstring note', CUSTOM))
    with Writer(path, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('/touch', CUSTOM, typestore=store)
        for number in range(400):
            value = store.types[CUSTOM](taxels=np.full(2, X[number], np.float32), force=1.5, note='')
            writer.write(connection, 10**18 + number * 10_000_000, store.serialize_cdr(value, CUSTOM))
    return path


def test_custom_messages_are_read_by_the_definition_in_the_bag_however_it_was_left(tmp_path: Path) -> None:
    whole = write_custom_bag(tmp_path / 'whole' / 'cork_1')
    content = (whole / 'cork_1.mcap').read_bytes()
    metadata = (whole / 'metadata.yaml').read_text()
    for name in ('loose', 'killed', 'cut', 'unnamed'):
        folder = tmp_path / name
        bag = folder if name == 'loose' else folder / 'cork_1'
        bag.mkdir(parents=True)
        (bag / 'cork_1.mcap').write_bytes(content[: -len(content) // 8] if name == 'cut' else content)
        if name == 'unnamed':
            (bag / 'metadata.yaml').write_text(metadata.replace('storage_identifier: mcap', "storage_identifier: ''"))
    stream = {'columns': ['/touch/taxels.*']}
    for name in ('whole', 'loose', 'killed', 'unnamed', 'cut'):
        loose = {'files': '{material}_{run}.mcap', 'source': tmp_path / name / 'cork_1.mcap'}
        where = loose if name == 'loose' else {'files': '{material}_{run}'}
        report = run(tmp_path / name, ('bag',), streams={'signal': stream}, **where)
        assert report.streams['cork', 'signal']['samples'] == 400, name
        assert bool(report.left_out['bags were cut off: what came behind their last whole part is missing']) is (
            name == 'cut'
        )


@pytest.mark.parametrize(
    ('name', 'cells', 'unit', 'mean'),
    [
        ('direction', np.tile([359.9, 0.1, 0.2], 200), 'deg', 0.001),
        ('speed', np.repeat([0.05, -0.05], 300), 'm/s', 0.05),
        ('force', np.repeat([-2.0], N), 'N', 2.0),
    ],
)
def test_means_of_conditions_are_those_of_angles_and_magnitudes(
    tmp_path: Path, name: str, cells: np.ndarray, unit: str, mean: float
) -> None:
    csv(T, X, cells, names='t,x,c')(tmp_path)
    time = {'signal': {'columns': ['x'], 'time': {'column': 't'}}}
    run(tmp_path, streams=time, conditions={name: {'column': 'c', 'unit': unit}})
    [value] = SlideDataset.from_bags([tmp_path / 'bags']).condition(name)
    assert np.sin(value - mean) == pytest.approx(0.0, abs=5e-3)


def test_of_a_message_only_what_the_mapping_means_and_what_may_be_a_code_is_kept(tmp_path: Path) -> None:
    bag()(tmp_path)
    mapping = mapping_from({'streams': {'signal': {'columns': ['/p/point.x']}}, 'label': {'value': 'cork'}})
    [table] = frames(tmp_path / 'a_1', 'a_1', mapping)
    assert list(table.columns) == ['/p/time', '/p/header.frame_id', '/p/point.x']


def test_a_cut_bag_is_not_loaded_whole(tmp_path: Path) -> None:
    bag()(tmp_path)
    path = tmp_path / 'a_1' / 'a_1.mcap'
    path.write_bytes(path.read_bytes()[:-100])
    opened = CheckedPath(path).open()
    assert not isinstance(opened, io.BytesIO)
    assert opened.read(8) == path.read_bytes()[:8]
    opened.close()
