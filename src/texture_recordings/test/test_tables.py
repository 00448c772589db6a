# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math
from pathlib import Path

import numpy as np
import pytest
from foreign_tables import MAPPING, RATE_HZ, STROKE_ROWS, recordings, write_csv
from rosbags.rosbag2 import StoragePlugin, Writer

from texture_core.errors import InvalidData, InvalidParameter, TextureError
from texture_core.types import NANOSECONDS
from texture_recordings.bags import message_types
from texture_recordings.dataset import SlideDataset
from texture_recordings.mapping import TableMapping, load_mapping, mapping_from
from texture_recordings.public_sets import IMPORTS
from texture_recordings.readers import MAPPED
from texture_recordings.tables import ImportReport, import_tables

TIMED = {'streams': {'signal': {'columns': ['x'], 'time': {'column': 't'}}}, 'label': {'value': 'cork'}}
FIRST_STROKE = 40  # row of the first stroke, after rest


@pytest.fixture
def mapping(tmp_path: Path) -> TableMapping:
    return mapping_of(tmp_path)


def mapping_of(folder: Path, *changes: tuple[str, str]) -> TableMapping:
    text = MAPPING
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / 'mapping.yaml').write_text(text)
    return load_mapping(folder / 'mapping.yaml')


def run(folder: Path, mapping: TableMapping, broken: dict[int, str] | None = None) -> ImportReport:
    return import_tables(mapping, write_csv(folder / 'in', recordings(), broken), folder / 'out')


def total(report: ImportReport) -> tuple[int, int]:
    """Return the samples and the losses of the vibration."""
    counts = [one for (_, stream), one in report.streams.items() if stream == 'signal']
    return sum(one['samples'] for one in counts), sum(one['lost'] for one in counts)


def test_a_csv_of_others_becomes_labelled_slides_with_their_conditions(tmp_path: Path, mapping: TableMapping) -> None:
    report = run(tmp_path, mapping)
    dataset = SlideDataset.from_bags([tmp_path / 'out'])
    assert report.slides == {'linen': 6, 'oak board': 6, 'cork_thick': 6}
    assert sorted(path.name for path in report.bags) == ['2031-05-01', '2031-05-02']
    assert len(dataset) == 18
    assert set(dataset.condition('session')) == {'2031-05-01', '2031-05-02'}
    np.testing.assert_allclose([slide.speed_m_s for slide in dataset], 0.02)
    first_day = dataset.select(where=lambda slide: slide.session == '2031-05-01')
    np.testing.assert_allclose([slide.force_n for slide in first_day], 150 * 9.80665e-3, rtol=0.01)


def test_samples_are_those_of_the_file_scaled_and_in_their_order(tmp_path: Path, mapping: TableMapping) -> None:
    run(tmp_path, mapping)
    dataset = SlideDataset.from_bags([tmp_path / 'out']).select(labels=['linen'])
    given = [
        one.stroke(number)[:, :3] * 1e-3 for one in recordings() if one.material == 'linen' for number in (1, 2, 3)
    ]
    read, _ = dataset.to_numpy()
    assert [samples.shape for samples in read] == [(STROKE_ROWS, 3)] * 6
    for one, other in zip(given, read, strict=True):
        np.testing.assert_allclose(other, one, atol=1e-6)
    batch = dataset[0].signals['signal'][0]
    assert (batch.channels, batch.units, batch.sensor) == (('x', 'y', 'z'), ('g',) * 3, 'accelerometer')
    assert batch.sampling_rate_hz == pytest.approx(RATE_HZ, rel=0.005)


@pytest.mark.parametrize(('line', 'sensor'), [('', 'lab_a'), ('sensor: skin/left\n', 'skin/left')])
def test_a_sensor_that_a_mapping_does_not_name_is_that_of_this_mapping_alone(tmp_path, line, sensor) -> None:
    (tmp_path / 'lab_a.yaml').write_text(
        f'streams: {{signal: {{columns: [x], rate_hz: 9}}}}\nlabel: {{value: a}}\n{line}'
    )
    assert load_mapping(tmp_path / 'lab_a.yaml').sensor == sensor


def test_malformed_rows_are_counted_and_named_by_file_row_and_column(tmp_path: Path, mapping: TableMapping) -> None:
    broken = {
        FIRST_STROKE + 10: '5000500.00;stroke 1;oops;1.0;2.0;150.0',
        FIRST_STROKE + 20: 'a line from the logger',
        FIRST_STROKE + 30: '5000700.00;stroke 1;1.0;1.0;2.0;nan',
    }
    report = run(tmp_path, mapping, broken)
    assert report.left_out == {'malformed rows, NaN where they are in a slide': 2 * 6}
    # Two lines stand above the first row, and lines count from 1.
    assert report.examples['malformed rows, NaN where they are in a slide'] == [
        "'2031-05-01, cork_thick, v20.csv', row 53, column 'acc_x': 'oops' is not a finite number",
        "'2031-05-01, cork_thick, v20.csv', row 63, column 'all': 1 cells, 6 are needed",
        "'2031-05-01, linen, v20.csv', row 53, column 'acc_x': 'oops' is not a finite number",
    ]
    assert sum(report.slides.values()) == 18  # a malformed row does not end a slide
    samples, _ = SlideDataset.from_bags([tmp_path / 'out']).to_numpy()
    assert np.isnan(samples[0]).any(axis=1).nonzero()[0].tolist() == [10, 20]
    header, row = report.lines()[:2]
    assert row[header.index('NaN') :].split()[0] == '4'
    assert report.lines()[4].endswith('; 6 slides have NaN samples, and windows with one are unusable')


def test_a_cell_of_a_condition_that_is_no_number_leaves_out_that_cell_only(tmp_path: Path) -> None:
    broken = {FIRST_STROKE + row: f'5000{400 + 10 * row}.00;stroke 1;1.0;1.0;2.0;{cell}'
              for row, cell in enumerate(('', 'nan', '-', '#N/A', 'inf', 'oops'))}  # fmt: skip
    report = run(tmp_path, mapping_of(tmp_path), broken)
    assert report.left_out == {'rows with a condition that is no number': 4 * 6}
    assert report.examples['rows with a condition that is no number'][0].endswith(
        "row 45, column 'grip': '-' is not a finite number"
    )
    samples, _ = SlideDataset.from_bags([tmp_path / 'out']).to_numpy()
    assert all(np.isfinite(one).all() for one in samples)
    assert report.conditions['linen', 'force'][0] == pytest.approx(150 * 9.80665e-3, rel=0.01)


def test_a_condition_of_which_over_a_tenth_are_no_numbers_is_refused(tmp_path: Path) -> None:
    broken = {row: f'{5000000 + 10 * row}.00;stroke 1;1.0;1.0;2.0;150,0' for row in range(100)}
    with pytest.raises(InvalidData, match=r"100 rows with a condition .* of 910, first row 3.*decimal: ','"):
        run(tmp_path, mapping_of(tmp_path), broken)


def test_of_too_many_rows_without_a_number_the_first_one_is_named(tmp_path: Path, mapping: TableMapping) -> None:
    broken = {row: f'{5000000 + 10 * row}.00;stroke 1;1.0;nan;2.0;150.0' for row in range(4, 100)} | {50: 'cut'}
    fault = r"96 malformed rows of 910, first row 7, column 'acc_y': no finite number \(NaN, infinity, blank or beyond"
    with pytest.raises(InvalidData, match=fault):
        run(tmp_path, mapping, broken)


def test_a_row_of_units_within_a_slide_is_malformed_and_ends_none(tmp_path: Path) -> None:
    broken = {FIRST_STROKE + 101: 'ms;;mg;mg;mg;gf'}
    any_phase = mapping_of(tmp_path, ('values: [stroke 1, stroke 2, stroke 3]', "values: ['[!r]*', '']"))
    report = run(tmp_path, any_phase, broken)
    assert report.slides == {'linen': 6, 'oak board': 6, 'cork_thick': 6}
    assert report.left_out == {'malformed rows, NaN where they are in a slide': 6}


def test_losses_are_counted_and_rows_whose_times_contradict_each_other_are_refused(
    tmp_path: Path, mapping: TableMapping
) -> None:
    recorded = recordings(files=1, jitter_ms=0.5)
    recorded[0].time_ms[FIRST_STROKE + 100 :] += 70.0  # seven samples are missing
    report = import_tables(mapping, write_csv(tmp_path / 'in', recorded), tmp_path / 'out')
    assert total(report) == (9 * STROKE_ROWS, 7)
    assert not report.left_out
    recorded[0].time_ms[FIRST_STROKE + 50] -= 55.0  # before five others
    with pytest.raises(InvalidData, match=r'time goes back from .* 1 times in this slide; sort its rows by time'):
        import_tables(mapping, write_csv(tmp_path / 'again', recorded), None)


@pytest.mark.parametrize(
    ('old', 'new', 'sentence'),
    [
        ("['acc_*']", '[acc_x, acc_w]', r"v20.csv': no column 'acc_w'; did you mean 'acc_[xyz]'\?"),
        ('{column: t, unit: ms}', '{column: time, unit: ms}', "no column 'time'"),
        ('{column: t, unit: ms}', '{column: t, unit: s}\n    rate_hz: 100', '0.1 Hz by its times, 100 Hz are'),
        ("['acc_*']\n    channels: [x, y, z]", '[phase]', "'phase' is a channel .* under `slides`"),
        ('[stroke 1, stroke 2, stroke 3]', '[stroke]', "column 'phase' has none of the values stroke; it has rest"),
        ('[stroke 1, stroke 2, stroke 3]', '[stroke 1, stroke 4]', "'phase' has 'stroke 4' in no file; it has rest"),
        ('{column: material}', '{column: materiel}', "no column 'materiel'; did you mean 'material'"),
        ('.csv', '.dat', "has the form '{day}, {material}, v{speed}.dat'"),
        ('speed: {column: speed, unit: mm/s}', 'speed: {column: day}', "the speed is '2031-05-01', by 'day' in"),
    ],
)  # fmt: skip
def test_a_mapping_that_does_not_fit_is_refused_with_the_place(
    tmp_path: Path, old: str, new: str, sentence: str
) -> None:
    with pytest.raises(TextureError, match=sentence):
        run(tmp_path, mapping_of(tmp_path, (old, new)))


@pytest.mark.parametrize(
    ('content', 'sentence'),
    [
        ({}, 'the streams are none; name signal or signal_static'),
        ({'streams': {'fast': {'columns': ['a']}}}, 'the streams are fast'),
        ({'streams': {'signal': {'columns': []}}}, "the stream 'signal' has no columns"),
        ({'streams': {'signal': {'columns': ['a']}}}, 'the label has a column or a value, and neither came'),
        (
            {**TIMED, 'conditions': {'force': {'column': 'f', 'value': 5}}},
            'the force has a column or a value, and both came',
        ),
        ({'streams': {'signal': {'colums': ['a']}}}, "no parameter 'colums'; did you mean 'columns'"),
        ({'streams': {'signal': {'columns': 'a'}}}, "'columns' is 'a'; a list is needed"),
        (
            {'streams': {'signal': {'columns': ['a'], 'time': {'unit': 'h'}}}},
            'time: parameter .unit. is .h.; allowed is',
        ),
        ({'slides': {'by': 'label'}}, 'mapping, slides: .* allowed is one of file, column, pause, row'),
        ({'conditions': {'speed': {'unit': 'mph'}}}, "the unit of speed is 'mph'; use one of m/s, cm/s, mm/s"),
        (
            {**TIMED, 'streams': {'signal': {'columns': ['x'], 'unit': 'gg'}}},
            "'unit' is 'gg'; allowed is one of .*, g, m/s², ",
        ),
        ({'files': '{a}_{a}.csv'}, 'has a field twice'),
        (
            {**TIMED, 'conditions': {'force': {'column': 't'}}},
            "column 't' is under `time` and under `conditions`; name",
        ),
        *(
            ({'streams': {'signal': {'columns': ['x'], 'time': time}}}, f'names {unit}, .*; write unit: {unit}, or')
            for unit, time in (
                ('ms', {'column': 't_ms'}),
                ('us', {'column': 'Time [µs]', 'unit': 'ms'}),
                ('s', {'column': 'time_s', 'unit': 'ms'}),
                ('ns', {'column': '/imu/stamp.nsec', 'unit': 'us'}),
                ('ms', {'column': 'clock (ms)', 'unit': 'min'}),
                ('s', {'column': 'T_S', 'unit': 'us'}),
            )
        ),
        ({**TIMED, 'label': {'column': 't'}}, "column 't' is under `time` and under `label`"),
        ([], 'a mapping of parameter names to values is needed'),
        ({'streams': {'signal': {'columns': ['a'], 'scale': 0}}}, "'scale' is 0, by which all samples are 0; write"),
        ({'streams': {'signal': {'columns': ['a'], 'scale': math.inf}}}, "'scale' is inf; allowed is a finite number"),
        ({'streams': {'signal': {'columns': ['a'], 'rate_hz': 10**5000}}}, "'rate_hz' is inf; allowed is 0.0 to"),
    ],
)
def test_a_mapping_that_makes_no_sense_is_refused_with_a_sentence(content: object, sentence: str) -> None:
    with pytest.raises(InvalidParameter, match=sentence):
        mapping_from(content)


def test_a_column_whose_name_is_a_long_number_is_refused_with_a_sentence(tmp_path: Path) -> None:
    save(tmp_path, x=np.cos(np.arange(300.0)))
    mapping = mapping_from({'streams': {'signal': {'columns': [f'1-{"9" * 30_000}']}}, 'label': {'value': 'cork'}})
    with pytest.raises(InvalidData, match=r"no column '1-9+"):
        import_tables(mapping, tmp_path / 'in', tmp_path / 'out')


def test_a_folder_or_nothing_in_place_of_a_mapping_is_refused(tmp_path: Path) -> None:
    for path, fault in ((tmp_path, "' is a folder"), (tmp_path / 'nothing.yaml', "there is no file '.*'")):
        with pytest.raises(InvalidParameter, match=rf'{fault}; give a mapping \(YAML\), and behind it'):
            load_mapping(path)


def test_a_column_in_braces_and_whole_numbers_are_names() -> None:
    mapping = mapping_from({'streams': {'signal': {'columns': [0, 1, '3-5']}}, 'label': {'value': 7}})
    assert mapping.streams['signal'].columns == ['0', '1', '3-5']
    assert mapping.label.value == '7'


@pytest.mark.parametrize('column', ['t', 'times', 'items', '_', 'ms', 't_ms2', 'tMs', 'time (s) UTC'])
def test_a_column_of_time_whose_name_has_no_unit_has_that_of_the_mapping(column: str) -> None:
    time = {'column': column, 'unit': 'us'}
    mapping = mapping_from({'streams': {'signal': {'columns': ['x'], 'time': time}}, 'label': {'value': 'cork'}})
    assert mapping.streams['signal'].time.unit == 'us'


def test_an_import_that_fails_leaves_no_half_of_it(tmp_path: Path, mapping: TableMapping) -> None:
    recorded = recordings()
    folder = write_csv(tmp_path / 'in', recorded)
    (folder / f'{recorded[-1].name}.csv').write_text('t;phase;acc_x\n1;rest;2\n')
    with pytest.raises(InvalidData, match=r"no column 'acc_y'|no column 'grip'"):
        import_tables(mapping, folder, tmp_path / 'out')
    assert not (tmp_path / 'out').exists()


def one_channel(**content: object) -> TableMapping:
    return mapping_from({
        'streams': {'signal': {'columns': ['x'], 'rate_hz': 100.0}}, 'label': {'value': 'cork'}, **content,
    })  # fmt: skip


def save(folder: Path, **arrays: object) -> Path:
    (folder / 'in').mkdir()
    np.savez(folder / 'in' / 'slides.npz', **arrays)
    return folder


def test_trials_of_arrays_for_machine_learning_are_slides(tmp_path: Path) -> None:
    mapping = mapping_from({
        'streams': {'signal': {'columns': ['X.*'], 'rate_hz': 500.0}},
        'label': {'column': 'y', 'names': {0: 'cork', 1: 'felt'}},
        'slides': {'by': 'column', 'column': 'trial'},
    })  # fmt: skip
    samples = np.random.default_rng(0).normal(size=(4, 250, 3))
    report = import_tables(mapping, save(tmp_path, X=samples, y=np.array([0, 1, 1, 0])) / 'in', tmp_path / 'out')
    dataset = SlideDataset.from_bags(report.bags)
    assert dataset.labels.tolist() == ['cork', 'cork', 'felt', 'felt']
    read, _ = dataset.to_numpy()
    np.testing.assert_allclose(read[1], samples[3], atol=1e-6)


def test_arrays_whose_axes_were_mixed_up_are_put_in_order(tmp_path: Path) -> None:
    taxels = np.random.default_rng(0).normal(size=(75, 60))
    mixed = taxels.reshape(6, 75, 10).transpose(1, 0, 2).reshape(75, 60)  # six patches of ten taxels
    slides = {f'{name}/val_{k % 2}_0{k}': (k + len(name)) * mixed for name in ('oak', 'cork_oak') for k in range(3)}
    IMPORTS['icub20'](save(tmp_path, **slides) / 'in', tmp_path / 'out')
    dataset = SlideDataset.from_bags([tmp_path / 'out'])
    assert dataset.condition('number').tolist() == [1, 2, 3] * 2
    for read in dataset.to_numpy('signal_static')[0]:
        np.testing.assert_allclose(read * (taxels[0, 0] / read[0, 0]), taxels, atol=1e-6)


def test_arrays_of_another_shape_are_not_of_that_set(tmp_path: Path) -> None:
    with pytest.raises(InvalidData, match=r'not a file of this data set: cannot reshape array of size 30'):
        IMPORTS['icub20'](save(tmp_path, **{'oak/val_0_01': np.zeros((5, 6))}) / 'in', tmp_path / 'out')


def test_slides_that_are_too_short_are_counted(tmp_path: Path) -> None:
    by = {'by': 'column', 'column': 'k'}
    mapping = one_channel(slides={**by, 'min_s': 0.5})
    save(tmp_path, x=np.cos(np.arange(150.0)), k=np.repeat([1, 2, 3], [60, 20, 70]))
    report = import_tables(mapping, tmp_path / 'in', tmp_path / 'out')
    assert (sum(report.slides.values()), report.left_out['slides are too short']) == (2, 1)
    with pytest.raises(InvalidData, match='no slide of 5 s or more'):
        import_tables(one_channel(slides={**by, 'min_s': 5.0}), tmp_path / 'in', tmp_path / 'none')


START_NS = 1_700_000_000 * NANOSECONDS
ACC_HZ, WRENCH_HZ = 100.0, 50.0
SECONDS = 4.0
STORE = message_types()
TYPES = STORE.types


def header(at_s: float) -> object:
    stamp_ns = START_NS + round(at_s * NANOSECONDS)
    stamp = TYPES['builtin_interfaces/msg/Time'](sec=stamp_ns // NANOSECONDS, nanosec=stamp_ns % NANOSECONDS)
    return TYPES['std_msgs/msg/Header'](stamp=stamp, frame_id='tool')


def vector(x: float, z: float = 0.0) -> object:
    return TYPES['geometry_msgs/msg/Vector3'](x=x, y=0.0, z=z)


def acceleration(at_s: float) -> object:
    return TYPES['geometry_msgs/msg/Vector3Stamped'](header=header(at_s), vector=vector(np.sin(20 * at_s)))


def wrench(at_s: float) -> object:
    inner = TYPES['geometry_msgs/msg/Wrench'](force=vector(0.0, 1.0 + at_s), torque=vector(0.0))
    return TYPES['geometry_msgs/msg/WrenchStamped'](header=header(at_s), wrench=inner)


def joints(at_s: float) -> object:
    return TYPES['sensor_msgs/msg/JointState'](
        header=header(at_s), name=['finger', 'wrist'], position=np.array([np.sin(20 * at_s), 0.5]),
        velocity=np.array([0.04, 0.0]), effort=np.array([1.0, 2.0]),
    )  # fmt: skip


def label(at_s: float) -> object:
    return TYPES['std_msgs/msg/String'](data='cork' if at_s < SECONDS / 2 else 'felt')


KINDS = {
    '/acc': (acceleration, 'geometry_msgs/msg/Vector3Stamped', ACC_HZ),
    '/wrench': (wrench, 'geometry_msgs/msg/WrenchStamped', WRENCH_HZ),
    '/joints': (joints, 'sensor_msgs/msg/JointState', ACC_HZ),
    '/surface': (label, 'std_msgs/msg/String', ACC_HZ),
}


def run_bag(folder: Path, streams: dict[str, str], **content: object) -> ImportReport:
    with Writer(folder / 'foreign', version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, (make, msgtype, rate_hz) in KINDS.items():
            connection = writer.add_connection(topic, msgtype, typestore=STORE)
            for at_s in np.arange(round(SECONDS * rate_hz)) / rate_hz:
                data = STORE.serialize_cdr(make(at_s), msgtype)
                writer.write(connection, START_NS + round(at_s * NANOSECONDS), data)
    wanted = mapping_from({
        'streams': {name: {'columns': [column]} for name, column in streams.items()},
        'label': {'column': '/surface/data'}, 'slides': {'by': 'column', 'column': '/surface/data'}, **content,
    })  # fmt: skip
    return import_tables(wanted, folder / 'foreign', folder / 'out', MAPPED['bag'])


@pytest.mark.parametrize('column', ['/acc/vector.x', '/joints/position.finger'])
def test_the_numbers_of_standard_messages_are_channels(tmp_path: Path, column: str) -> None:
    report = run_bag(tmp_path, {'signal': column})
    assert report.slides == {'cork': 1, 'felt': 1}
    assert report.rates_hz['signal'] == pytest.approx(ACC_HZ, rel=0.002)
    [samples, _], _ = SlideDataset.from_bags(report.bags).to_numpy()
    np.testing.assert_allclose(samples[:, 0], np.sin(20 * np.arange(200) / ACC_HZ), atol=1e-3)


def test_streams_of_two_rates_and_a_force_are_cut_at_the_same_times(tmp_path: Path) -> None:
    conditions = {'force': {'column': '/wrench/wrench.force.z'}, 'speed': {'column': '/joints/velocity.finger'}}
    streams = {'signal': '/acc/vector.*', 'signal_static': '/wrench/wrench.force.z'}
    dataset = SlideDataset.from_bags(run_bag(tmp_path, streams, conditions=conditions).bags)
    fast, _ = dataset.to_numpy('signal')
    slow, _ = dataset.to_numpy('signal_static')
    assert [len(samples) for samples in fast] == [200, 200]
    assert [len(samples) for samples in slow] == [100, 100]
    np.testing.assert_allclose(slow[1][:, 0], 1.0 + 2.0 + np.arange(100) / WRENCH_HZ, atol=1e-4)
    np.testing.assert_allclose([slide.force_n for slide in dataset], [2.0, 4.0], atol=0.02)
    np.testing.assert_allclose([slide.speed_m_s for slide in dataset], 0.04)


def test_a_bag_without_any_of_the_topics_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidData, match=r"'foreign' has no topic that the mapping names \(/nothing/x\)"):
        run_bag(tmp_path, {'signal': '/nothing/x'}, label={'value': 'cork'}, slides={})
