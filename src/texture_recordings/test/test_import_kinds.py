# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What was imported wrongly in silence: clocks, labels, rows and containers, each as six files of its kind or more."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg

from texture_core.errors import InvalidData, InvalidParameter
from texture_recordings.bags import message_types
from texture_recordings.dataset import SlideDataset
from texture_recordings.mapping import mapping_from, template_fields
from texture_recordings.tables import import_tables

N = 600
X = np.sin(0.3 * np.arange(N)) + 0.001 * np.arange(N)
T = np.arange(N) / 100.0


def csv(folder: Path, *columns: Any, names: str = 't,x', name: str = 'cork_1.csv') -> None:
    rows = [','.join(map(str, row)) for row in zip(*columns, strict=True)]
    (folder / name).write_text('\n'.join([names, *rows, '']))


def run(folder: Path, kinds: tuple[str, ...] = ('.csv', '.mat', '.h5', '.npz'), **content: Any) -> Any:
    """Import what lies in a folder, by time in column t unless given otherwise."""
    unit, source = content.pop('unit', 's'), content.pop('source', folder)
    mapping = mapping_from({
        'files': '{material}_{run}.*',
        'streams': {'signal': {'columns': ['x'], 'time': {'column': 't', 'unit': unit}}},
        'label': {'column': 'material'}, **content,
    })  # fmt: skip
    return import_tables(mapping, source, folder / 'bags', kinds)


def bursts(size: int, step_s: float) -> np.ndarray:
    """Return times of rows that are stamped `size` at a time."""
    return T[(np.arange(N) // size) * size] + step_s * (np.arange(N) % size)


@pytest.mark.parametrize('size', [2, 3, 5, 10, 20, 30])
@pytest.mark.parametrize('step_s', [0.0, 50e-6])
def test_rows_of_a_buffer_have_the_rate_of_rows_and_duration(tmp_path: Path, size: int, step_s: float) -> None:
    csv(tmp_path, bursts(size, step_s).round(6), X)
    report = run(tmp_path)
    assert report.rates_hz['signal'] == pytest.approx(100.0, rel=0.01)
    assert report.streams['cork', 'signal'] == {'samples': N, 'lost': 0}


LOST = np.isin(np.arange(N), [100, 101, 260, 433])
UNEVEN = np.floor(T * 41.7) / 41.7  # of a buffer that is read 41.7 times a second, with two or three rows


@pytest.mark.parametrize(('times', 'rate_hz', 'sentence', 'lost'), [
    (bursts(3, 50e-6)[~LOST], 0.0, 'in bursts of 1 to 3, so lost rows cannot be told; .* the rate is 99', None),
    (UNEVEN, 0.0, 'in bursts of 2 to 3, so lost rows cannot be told', None),
    ((T[~LOST] / 10).round(3), 1000.0, 'counts in steps of 0.001 s at 1000 Hz, so lost samples cannot be told', 4),
    (UNEVEN[~LOST], 0.0, 'in bursts of 1 to 3, so lost rows cannot be told', None),
    (bursts(3, 50e-6)[np.r_[0:100, 101, 100, 102:N]], 0.0, '2 of 600 rows, which come in bursts, are out of', None),
])  # fmt: skip
def test_losses_that_the_times_leave_undecided_are_refused_until_the_rate_is_stated(
    tmp_path: Path, times: np.ndarray, rate_hz: float, sentence: str, lost: int | None
) -> None:
    csv(tmp_path, times, X[: len(times)])
    with pytest.raises(InvalidData, match=sentence):
        run(tmp_path)
    if lost is not None:
        stream = {'columns': ['x'], 'time': {'column': 't'}, 'rate_hz': rate_hz}
        assert run(tmp_path, streams={'signal': stream}).streams['cork', 'signal']['lost'] == lost


@pytest.mark.parametrize(('times', 'unit'), [
    ((1000 * T * 60).astype(int) % 2**16, 'ms'), ((1e6 * T).astype(int) % 2**16, 'us'),
    (((1e6 * T).astype(int) + 2**32 - 10**6) % 2**32, 'us'), (((1e3 * T).astype(int) + 2**31 - 5000) % 2**31, 'ms'),
    (((1e9 * T).astype(int) + 2**32 - 10**8) % 2**32, 'ns'), ((T * 1e6 + 3e6) % 2**24, 'us'),
])  # fmt: skip
def test_a_counter_that_rolls_over_goes_on_or_is_refused(tmp_path: Path, times: np.ndarray, unit: str) -> None:
    csv(tmp_path, times, X)
    try:
        report = run(tmp_path, unit=unit)
    except InvalidData as error:
        assert 'time goes back' in str(error) or 'rate of' in str(error) or 'expected' in str(error)
        return
    assert report.streams['cork', 'signal'] == {'samples': N, 'lost': 0}


@pytest.mark.parametrize('lengths', [(300, 300), (200, 200, 200), (100, 500), (500, 100), (570, 30), (590, 10)])
def test_runs_that_were_appended_are_refused_or_separate_slides(tmp_path: Path, lengths: tuple[int, ...]) -> None:
    csv(tmp_path, np.concatenate([T[:count] for count in lengths]), X)
    with pytest.raises(InvalidData, match=r"row \d+, column 't': time goes back .*by: pause"):
        run(tmp_path)
    report = run(tmp_path, slides={'by': 'pause', 'min_s': 0.05})
    assert report.streams['cork', 'signal'] == {'samples': N, 'lost': 0}
    assert report.slides == {'cork': len(lengths)}


@pytest.mark.parametrize(('factor', 'unit', 'content', 'sentence'), [
    (1e3, 's', {}, r'0\.1 Hz by its times; with unit: ms it were 100 Hz'),
    (1e6, 'ms', {}, 'rate of .* with unit: us'),
    (1.0, 's', {'conditions': {'speed': {'value': '20'}}}, 'speed of a slide is 20 m/s.* may be cm/s or mm/s'),
    (1.0, 's', {'conditions': {'speed': {'value': '0.03', 'unit': 'mm/s'}}}, r'0\.03 mm/s.* may be m/s or cm/s'),
    (1.0, 's', {'conditions': {'force': {'value': '150'}}}, 'force of a slide is 150 N.* may be mN or gf'),
    (1.0, 's', {'conditions': {'direction': {'value': '90'}}}, 'direction of a slide is 90 rad.* may be deg'),
    (10.0, 's', {'slides': {'by': 'file'}, 'streams': {'signal': {'columns': ['x'], 'rate_hz': 0.05}}}, 'lasts 1.2e'),
])  # fmt: skip
def test_a_unit_that_was_forgotten_is_refused_with_the_likely_one(
    tmp_path: Path, factor: float, unit: str, content: dict, sentence: str
) -> None:
    csv(tmp_path, T * factor, X)
    with pytest.raises(InvalidData, match=sentence):
        run(tmp_path, unit=unit, **content)


@pytest.mark.parametrize(('template', 'name', 'fits'), [
    ('{m}_{code}_{run}.csv', 'kitchen_towel_120_01.csv', None), ('{m}_{run}.csv', 'oak_board_1.csv', None),
    ('{m}-{v}.csv', 'a-b-1.csv', None), ('{m} {n}.csv', 'oak board 3.csv', None), ('{m}.{n}.csv', 'a.b.1.csv', None),
    ('{m}_{n}/{r}.csv', 'oak_board_1/2.csv', None),
    ('{m}_{code:d}_{run:d}.csv', 'kitchen_towel_120_01.csv', {'m': 'kitchen_towel', 'code': '120', 'run': '01'}),
    ('{m}_{run:d}.csv', 'oak_board_1.csv', {'m': 'oak_board', 'run': '1'}),
])  # fmt: skip
def test_a_name_that_fits_in_two_ways_is_refused_and_shows_both(template: str, name: str, fits: dict | None) -> None:
    if fits:
        assert template_fields(template, name) == fits
    else:
        with pytest.raises(InvalidData, match=r'in two ways: .*; or .*'):
            template_fields(template, name)


LABELS = {
    'first row': ['cork', *[''] * (N - 1)], 'first two': ['cork', 'cork', *[''] * (N - 2)],
    'now and then': ['cork' if row % 50 == 0 else '' for row in range(N)], 'all': ['cork'] * N,
    'twice': ['cork' if row in {0, 300} else '' for row in range(N)],
    'one in ten': [('cork', '')[row % 10 > 0] for row in range(N)],
}  # fmt: skip


@pytest.mark.parametrize('written', LABELS)
def test_the_last_label_holds(tmp_path: Path, written: str) -> None:
    csv(tmp_path, T, X, LABELS[written], names='t,x,label')
    assert run(tmp_path, label={'column': 'label'}).slides == {'cork': 1}


ORDERS = [('S1', 'S2'), ('S2', 'S1'), ('a', 'b', 'c'), (1, 2), (0, 1, 2, 3), ('left', 'right')]


@pytest.mark.parametrize('order', ORDERS)
def test_a_row_for_each_sensor_is_refused_until_one_is_chosen(tmp_path: Path, order: tuple) -> None:
    count = len(order)
    rows = (np.repeat(T, count), np.repeat(X, count) * np.tile(1 + np.arange(count), N), list(order) * N)
    csv(tmp_path, *rows, names='t,x,sensor')
    with pytest.raises(InvalidData, match=r"one value of 'sensor' after the other .*rows: \{sensor: "):
        run(tmp_path)
    report = run(tmp_path, rows={'sensor': str(order[0])})
    assert report.streams['cork', 'signal'] == {'samples': N, 'lost': 0}
    [[samples], _] = SlideDataset.from_bags(report.bags).to_numpy()
    np.testing.assert_allclose(samples[:, 0], X, atol=1e-6)


@pytest.mark.parametrize('columns', [40, 101, 150, 200, 500, 1000])
def test_a_row_that_is_a_window_is_refused_until_the_mapping_tells(tmp_path: Path, columns: int) -> None:
    windows = np.random.default_rng(0).normal(size=(30, columns)).round(3)
    csv(tmp_path, *windows.T, names=','.join(f'x_{number}' for number in range(1, columns + 1)))
    stream = {'columns': ['x_*'], 'rate_hz': 100.0}
    with pytest.raises(InvalidData, match=rf'{columns} columns, x_1 … x_{columns}, and 30 rows; write samples_per_row'):
        run(tmp_path, streams={'signal': stream})
    by_row = {'slides': {'by': 'row'}, 'streams': {'signal': {**stream, 'samples_per_row': columns}}}
    samples, _ = SlideDataset.from_bags(run(tmp_path, **by_row).bags).to_numpy()
    np.testing.assert_allclose(np.stack(samples)[..., 0], windows, atol=1e-6)


@pytest.mark.parametrize('every', [2, 4, 5, 10, 20, 25])
def test_blanks_belong_to_the_slower_stream(tmp_path: Path, every: int) -> None:
    slow = [f'{x:.4f}' if row % every == 0 else '' for row, x in enumerate(X)]
    csv(tmp_path, np.arange(N), X, slow, names='t,x,y')
    time = {'column': 't', 'unit': 'ms'}
    streams = {'signal': {'columns': ['x'], 'time': time}, 'signal_static': {'columns': ['y'], 'time': time}}
    report = run(tmp_path, streams=streams)
    assert (report.rates_hz['signal'], report.rates_hz['signal_static']) == pytest.approx(
        (1000, 1000 / every), rel=0.01
    )
    [slow_read], _ = SlideDataset.from_bags(report.bags).to_numpy('signal_static')
    np.testing.assert_allclose(slow_read[:, 0], X[::every], atol=1e-3)


@pytest.mark.parametrize('per_row', [2, 5, 10, 22, 50, 100])
def test_consecutive_samples_of_a_row_are_one_channel(tmp_path: Path, per_row: int) -> None:
    pac, slow = np.random.default_rng(0).normal(size=(per_row, 120)), np.arange(120.0)
    scipy.io.savemat(tmp_path / 'cork_1.mat', {'pac': pac, 'pdc': slow[None]})
    signal = {'columns': ['pac.*'], 'rate_hz': 100.0 * per_row, 'samples_per_row': per_row}
    static = {'columns': ['pdc'], 'rate_hz': 100.0}
    report = run(tmp_path, streams={'signal': signal, 'signal_static': static}, format={'transpose': True})
    [samples], _ = SlideDataset.from_bags(report.bags).to_numpy()
    np.testing.assert_allclose(samples[:, 0], pac.T.ravel(), atol=1e-6)


ACC = np.stack([X, 2 * X], axis=1)


def struct_array(path: Path) -> None:
    kind = [('acc', object), ('material', object)]
    data = np.array([(ACC, 'cork'), (3 * ACC, 'felt')], dtype=kind)
    scipy.io.savemat(path / 'a_1.mat', {'data': data})


def nested_structs(path: Path) -> None:
    inner = {'acc': ACC, 'material': 'cork'}
    scipy.io.savemat(path / 'a_1.mat', {'data': {'run1': inner, 'run2': {**inner, 'material': 'felt'}}})


def cell_of_structs(path: Path) -> None:
    cells = np.empty(2, object)
    cells[:] = [{'acc': ACC, 'material': 'cork'}, {'acc': ACC, 'material': 'felt'}]
    scipy.io.savemat(path / 'a_1.mat', {'data': cells})


def hdf5_groups(path: Path) -> None:
    with h5py.File(path / 'a_1.h5', 'w') as file:
        for number, material in enumerate(('cork', 'felt'), 1):
            file[f'data/{number}/acc'], file[f'data/{number}/material'] = ACC, material


def matlab73_struct_array(path: Path) -> None:
    with h5py.File(path / 'a_1.mat', 'w', userblock_size=512) as file:
        reference = h5py.special_dtype(ref=h5py.Reference)
        for name in ('acc', 'material'):
            file.create_dataset(f'data/{name}', (1, 2), dtype=reference)
        for number, material in enumerate(('cork', 'felt')):
            file[f'#refs#/a{number}'] = ACC.T
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
        assert bool(report.left_out['bags were cut off, and end with their last whole part']) is (name == 'cut')


def test_a_bag_of_ros_1_is_refused_with_the_tool_that_helps(tmp_path: Path) -> None:
    (tmp_path / 'cork_1.bag').write_bytes(b'#ROSBAG V2.0\n')
    with pytest.raises(InvalidData, match='is a bag of ROS 1; convert it: rosbags-convert'):
        run(tmp_path, ('bag', '.bag'))


def test_a_small_file_that_declares_much_is_refused_before_it_is_read(tmp_path: Path) -> None:
    with h5py.File(tmp_path / 'cork_1.h5', 'w') as file:
        file.create_dataset('x', shape=(10**10,), chunks=(10**6,), compression='gzip')
    np.savez_compressed(tmp_path / 'cork_2.npz', x=np.zeros(9_000_000, np.uint8))
    scipy.io.savemat(tmp_path / 'cork_3.mat', {'x': np.zeros(70_000_000, np.uint8)}, do_compression=True)
    for number, ending in ((1, 'h5'), (2, 'npz'), (3, 'mat')):
        with pytest.raises(InvalidData, match=rf"'cork_{number}.{ending}' declares more than 8 million values"):
            run(
                tmp_path,
                files=f'{{material}}_{number}.{ending}',
                streams={'signal': {'columns': ['x'], 'rate_hz': 1e4}},
            )


def test_a_mapping_with_a_field_twice_is_refused() -> None:
    with pytest.raises(InvalidParameter, match='has a field twice'):
        mapping_from({'files': '{a}_{a}.csv', 'streams': {'signal': {'columns': ['x']}}, 'label': {'value': 'cork'}})
