# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What was exported is read back, sample for sample."""

from dataclasses import replace

import numpy as np
import pytest

from texture_core.errors import InvalidData, InvalidParameter
from texture_recordings.dataset import SlideDataset
from texture_recordings.export import export_slides, write_parquet
from texture_recordings.mapping import load_mapping
from texture_recordings.tables import import_tables

parquet = pytest.importorskip('pyarrow.parquet')
SURFACES = ('cork', 'felt', 'cork', 'oak board')


@pytest.fixture(scope='module')
def dataset() -> SlideDataset:
    """Return four slides of 1.197, 1.297, … s: streams whose rates have no common divisor, and unlike lengths."""
    rng = np.random.default_rng(0)
    seconds = 1.197 + 0.1 * np.arange(4)
    return SlideDataset.from_arrays(
        {
            'signal': [rng.normal(size=(round(1000 * s), 2)) for s in seconds],
            'signal_static': [rng.normal(size=(round(59.7 * s), 3)) for s in seconds],
        },
        SURFACES, {'signal': 1000.0, 'signal_static': 59.7}, speed_m_s=[0.02, 0.03, 0.04, 0.05],
        force_n=1.5, direction_rad=0.5, sensor='finger', session='monday',
    )  # fmt: skip


def test_every_stream_is_imported_again_with_the_same_samples_labels_and_conditions(dataset, tmp_path) -> None:
    export_slides(dataset, tmp_path / 'out')
    for topic in ('signal', 'signal_static'):
        report = import_tables(
            load_mapping(tmp_path / 'out' / f'{topic}.yaml'), tmp_path / 'out', tmp_path / f'bags_{topic}'
        )
        again = {slide.name: slide for slide in SlideDataset.from_bags(report.bags)}
        assert set(report.left_out) == {'files have other names or endings'}
        assert [path.name for path in report.bags] == ['monday']
        assert sorted(again) == sorted(dataset.names)
        read = {samples.slide.name: samples for samples in SlideDataset(tuple(again.values())).samples(topic)}
        for given in dataset.samples(topic):
            one = read[given.slide.name]
            whole = np.concatenate([batch.samples for batch in given.slide.signals[topic]])
            np.testing.assert_array_equal(one.samples, given.samples)
            np.testing.assert_array_equal(one.samples, whole)
            assert (one.rate_hz, one.channels) == (given.rate_hz, given.channels)
            assert (one.speed_m_s, one.force_n, one.direction_rad) == pytest.approx(
                (given.speed_m_s, given.force_n, given.direction_rad), rel=1e-6
            )
            assert (one.slide.sensor, one.slide.motion_name) == ('finger', 'linear_slide')


def test_a_condition_that_one_slide_lacks_and_labels_that_are_alike_come_back(tmp_path) -> None:
    forces, labels = [1.5, np.nan, 2.5], ['cork', 'Cork', 'nan']
    signals = {'signal': [np.sin(number * np.arange(300.0))[:, None] for number in (1, 2, 3)]}
    given = SlideDataset.from_arrays(signals, labels, {'signal': 1000.0}, force_n=forces)
    export_slides(given, tmp_path / 'out')
    report = import_tables(load_mapping(tmp_path / 'out' / 'signal.yaml'), tmp_path / 'out', tmp_path / 'bags')
    again = {slide.surface: slide.force_n for slide in SlideDataset.from_bags(report.bags)}
    assert [again[label] for label in labels] == pytest.approx(forces, nan_ok=True)


def test_a_slide_that_lost_samples_is_left_out_of_that_stream_and_counted(dataset, tmp_path) -> None:
    [batch] = dataset[0].signals['signal']
    parts = [replace(batch, samples=batch.samples[a:b], first_sample=a) for a, b in ((0, 500), (600, 1000))]
    holed = replace(dataset[0], signals={**dataset[0].signals, 'signal': parts})
    lines = export_slides(SlideDataset((holed, *dataset[1:])), tmp_path / 'out')
    assert "1 slides lost samples of 'signal' and were left out of it" in lines
    assert parquet.ParquetFile(tmp_path / 'out/signal_static.parquet').num_row_groups == 4


def test_nothing_stays_of_an_export_or_an_import_for_which_the_disk_is_too_small(dataset, tmp_path, fill_disk) -> None:
    export_slides(dataset, tmp_path / 'out')
    mapping = load_mapping(tmp_path / 'out' / 'signal.yaml')
    fill_disk()
    with pytest.raises(InvalidParameter, match=r"'.*bags/monday' cannot be written: File too large; name another fold"):
        import_tables(mapping, tmp_path / 'out', tmp_path / 'bags')
    with pytest.raises(InvalidParameter, match=r"'.*signal.parquet' cannot be written: .*File too large"):
        export_slides(dataset, tmp_path / 'again')
    assert not (tmp_path / 'again').exists()
    assert not (tmp_path / 'bags').exists()


def test_what_cannot_be_exported_is_refused_with_a_sentence(dataset, tmp_path) -> None:
    with pytest.raises(InvalidParameter, match='nothing is overwritten'):
        export_slides(dataset, tmp_path)
    other = replace(dataset.samples('signal')[0], rate_hz=999.0)
    with pytest.raises(InvalidData, match=r'at 999 Hz, .* export slides of one sensor'):
        write_parquet([*dataset.samples('signal'), other], tmp_path / 'a.parquet')
