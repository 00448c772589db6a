# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What was exported is read back, and by the libraries of others."""

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml

from texture_core.errors import InvalidData, InvalidParameter, UnknownName
from texture_recordings.dataset import SlideDataset
from texture_recordings.export import export_slides, frame_rate_hz, model_card
from texture_recordings.tables import import_tables, load_mapping

parquet = pytest.importorskip('pyarrow.parquet')
FAST_HZ, SLOW_HZ = 1000.0, 60.0
SURFACES = ('cork', 'felt', 'cork', 'oak board')


@pytest.fixture(scope='module')
def dataset() -> SlideDataset:
    """Return four slides of 1.0, 1.1, … s with a vibration of two channels and three slow ones."""
    rng = np.random.default_rng(0)
    seconds = 1.0 + 0.1 * np.arange(4)
    signals = {
        'signal': [rng.normal(size=(round(FAST_HZ * s), 2)) for s in seconds],
        'signal_static': [rng.normal(size=(round(SLOW_HZ * s), 3)) for s in seconds],
    }
    return SlideDataset.from_arrays(
        signals, SURFACES, {'signal': FAST_HZ, 'signal_static': SLOW_HZ}, speed_m_s=[0.02, 0.03, 0.04, 0.05],
        force_n=1.5, direction_rad=0.5, sensor='finger', session='monday',
    )  # fmt: skip


def front(readme: Path) -> dict:
    """Return the facts for machines at the top of a card."""
    _, facts, _ = readme.read_text().split('---\n', 2)
    return yaml.safe_load(facts)


@pytest.mark.parametrize(
    ('kind', 'mapping', 'topics'),
    [
        ('parquet', 'signal.yaml', ['signal']),
        ('parquet', 'signal_static.yaml', ['signal_static']),
        ('hdf5', 'slides.yaml', ['signal', 'signal_static']),
    ],
)
def test_an_export_is_imported_again_with_the_same_samples_labels_and_conditions(
    dataset, tmp_path, kind, mapping, topics
) -> None:
    export_slides(dataset, tmp_path / 'out', kind)
    report = import_tables(load_mapping(tmp_path / 'out' / mapping), tmp_path / 'out', tmp_path / 'bags')
    again = SlideDataset.from_bags(report.bags)
    assert (report.malformed_rows, [path.name for path in report.bags]) == (0, ['monday'])
    assert sorted(again.names) == sorted(dataset.names)
    given = {slide.name: slide for slide in dataset}
    for topic in topics:
        wanted = {samples.slide.name: samples for samples in dataset.samples(topic)}
        for samples in again.samples(topic):
            slide = samples.slide
            np.testing.assert_allclose(samples.samples, wanted[slide.name].samples, rtol=1e-6)
            assert (samples.rate_hz, samples.channels) == (wanted[slide.name].rate_hz, wanted[slide.name].channels)
            assert slide.speed_m_s == pytest.approx(given[slide.name].speed_m_s)
            assert (slide.force_n, slide.direction_rad) == pytest.approx((1.5, 0.5))
            assert (slide.sensor, slide.motion_name) == ('finger', 'linear_slide')


def test_an_hdf5_file_tells_rate_channels_and_conditions_to_whoever_opens_it(dataset, tmp_path) -> None:
    export_slides(dataset, tmp_path / 'out', 'hdf5')
    with h5py.File(tmp_path / 'out/slides.h5') as file:
        slide = file['cork/00002']
        assert slide['signal'].shape == (1200, 2)
        assert (slide['signal'].attrs['rate_hz'], list(slide['signal'].attrs['channels'])) == (1000.0, ['c0', 'c1'])
        assert slide['speed_m_s'][()] == 0.04


def test_a_lerobot_data_set_has_an_episode_for_each_slide_and_every_stream_at_its_own_rate(dataset, tmp_path) -> None:
    export_slides(dataset, tmp_path / 'out', 'lerobot')
    info = json.loads((tmp_path / 'out/meta/info.json').read_text())
    assert (info['codebase_version'], info['fps'], info['total_episodes'], info['total_tasks']) == ('v3.0', 20, 4, 3)
    fast, slow = (info['features'][f'observation.{topic}'] for topic in ('signal', 'signal_static'))
    assert (fast['shape'], fast['info']['rate_hz']) == ([50, 2], 1000.0)
    assert (slow['shape'], slow['info']['rate_hz']) == ([3, 3], 60.0)
    data = parquet.read_table(tmp_path / 'out' / info['data_path'].format(chunk_index=0, file_index=0))
    assert data.num_rows == info['total_frames'] == 20 + 22 + 24 + 26
    assert set(data.column_names) == set(info['features'])
    np.testing.assert_array_equal(data['index'].to_numpy(), np.arange(data.num_rows))
    episodes = parquet.read_table(tmp_path / 'out/meta/episodes/chunk-000/file-000.parquet').to_pylist()
    tasks = parquet.read_table(tmp_path / 'out/meta/tasks.parquet').to_pylist()
    for slide, samples, episode in zip(dataset, dataset.samples('signal'), episodes, strict=True):
        rows = slice(episode['dataset_from_index'], episode['dataset_to_index'])
        frames = np.array(data['observation.signal'].to_pylist()[rows])
        np.testing.assert_allclose(frames.reshape(-1, 2), samples.samples[: 50 * episode['length']], rtol=1e-6)
        assert episode['tasks'] == [f'slide over {slide.surface}']
        task = tasks[data['task_index'].to_numpy()[rows][0]]
        assert task['__index_level_0__'] == episode['tasks'][0]
        np.testing.assert_allclose(data['timestamp'].to_numpy()[rows], np.arange(episode['length']) / 20, rtol=1e-6)
        np.testing.assert_allclose(
            data['observation.state'].to_pylist()[rows][0], [slide.speed_m_s, 1.5, 0.5], rtol=1e-6
        )
    stats = json.loads((tmp_path / 'out/meta/stats.json').read_text())
    assert np.shape(stats['observation.signal']['mean']) == (50, 2)
    assert stats['timestamp']['max'] == pytest.approx([1.25])


def test_a_stream_whose_rate_divides_into_no_frames_is_interpolated_and_that_is_told(tmp_path) -> None:
    times = np.arange(998) / 99.8
    slides = SlideDataset.from_arrays({'signal': [np.sin(3 * times)[:, None]]}, ['cork'], {'signal': 99.8})
    assert "'signal' was interpolated from 99.8 to 100 Hz" in export_slides(slides, tmp_path / 'out', 'lerobot')
    data = parquet.read_table(tmp_path / 'out/data/chunk-000/file-000.parquet')
    frames = np.array(data['observation.signal'].to_pylist()).ravel()
    np.testing.assert_allclose(frames[:900], np.sin(3 * np.arange(900) / 100), atol=2e-3)
    assert frame_rate_hz([99.8]) == 50
    assert 'observation.state' not in data.column_names  # speed and force are unknown


@pytest.mark.parametrize('kind', ['parquet', 'hdf5', 'lerobot'])
def test_a_data_card_has_the_facts_that_hubs_read_and_the_border_for_people(dataset, tmp_path, kind) -> None:
    export_slides(dataset, tmp_path / 'out', kind, licence='cc-by-4.0')
    readme = tmp_path / 'out/README.md'
    facts = front(readme)
    assert (facts['license'], facts['size_categories'], facts['task_categories']) == (
        'cc-by-4.0',
        ['n<1K'],
        ['robotics'],
    )
    assert ('LeRobot' in facts['tags']) is (kind == 'lerobot')
    for config in facts.get('configs', []):
        assert list((tmp_path / 'out').glob(config['data_files']))
    text = readme.read_text()
    assert '| `signal` | finger | 1000 | 2 | – |' in text
    assert '| cork | 2 |' in text
    assert 'test on recordings that a model was not trained on' in text


def test_a_slide_that_lost_samples_is_left_out_and_counted(dataset, tmp_path) -> None:
    [batch] = dataset[0].signals['signal']
    parts = [replace(batch, samples=batch.samples[a:b], first_sample=a) for a, b in ((0, 500), (600, 1000))]
    holed = replace(dataset[0], signals={**dataset[0].signals, 'signal': parts})
    told = export_slides(SlideDataset((holed, *dataset[1:])), tmp_path / 'out', 'parquet')
    assert '1 slides with lost samples were left out' in told


def test_what_cannot_be_exported_is_refused_with_a_sentence(dataset, tmp_path) -> None:
    with pytest.raises(UnknownName, match="did you mean 'parquet'"):
        export_slides(dataset, tmp_path / 'out', 'parket')
    (tmp_path / 'out').mkdir()
    with pytest.raises(InvalidParameter, match='nothing is overwritten'):
        export_slides(dataset, tmp_path / 'out', 'hdf5')
    (tmp_path / 'card.json').write_text('{"labels": []}')
    with pytest.raises(InvalidData, match=r'is not the card of a texture model'):
        model_card(tmp_path / 'card.json')


def test_a_model_card_has_the_facts_and_ranges_of_the_training(tmp_path) -> None:
    card = {
        'name': 'm', 'labels': ['cork', 'felt'], 'feature_set': 'ab12 signal=1000Hz*1',
        'recipe': {'description': 'Bands.'},
        'training': {'slides': 8, 'windows': 16, 'held_out_window_accuracy': 0.875},
        'acceptance': {'domain': {
            'sensors': ['tsf85/dynamic'], 'motions': ['linear_slide'], 'speed_m_s': [0.02, 0.1], 'force_n': None,
            'reach': {
                'cork': {'sessions': 2, 'places': 3, 'fingers': 1}, 'felt': {'sessions': 1, 'places': 4, 'fingers': 1},
            },
        }},
    }  # fmt: skip
    (tmp_path / 'm.json').write_text(json.dumps(card))
    (tmp_path / 'README.md').write_text(model_card(tmp_path / 'm.json', 'apache-2.0'))
    assert front(tmp_path / 'README.md')['license'] == 'apache-2.0'
    text = (tmp_path / 'README.md').read_text()
    assert '| speed (m/s) | 0.02 to 0.1 |' in text
    assert '| force (N) | – |' in text  # not measured
    assert '| at least, of each surface | 1 sessions, 3 places, 1 fingers |' in text
    assert '87.5 %' in text
