# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import InvalidData, UnknownName
from texture_core.types import NANOSECONDS, Phase, lost_samples
from texture_features.features.taxels import MeanSpatialBands
from texture_features.windows import WindowBatch
from texture_recordings.bags import read_bag
from texture_recordings.dataset import SlideDataset
from texture_recordings.public_sets import IMPORTS, evenly
from texture_recordings.slides import find_slides

import_ntp21, import_fabricslide, import_fingersense, import_lmt29 = (
    IMPORTS[name] for name in ('ntp21', 'fabricslide', 'fingersense', 'lmt29')
)
PITCH_M = 10e-3


def make_ntp21(folder: Path, speeds: tuple[int, ...] = (100, 20), forces: tuple[float, ...] = (1.5, 0.0)) -> Path:
    """Write two textures in the format of the data set: a grating of 10 mm under every taxel, jittering stamps."""
    rng, content = np.random.default_rng(0), {}
    for texture in ('texture07', 'texture03'):
        for speed in speeds:
            for force in forces:
                count = round(60.0 / speed * 322.0)
                time_s = np.arange(count) / 322.0
                wave = np.sin(2 * np.pi * time_s * speed / 1000.0 / PITCH_M)
                stamps = time_s + np.r_[0.0, rng.uniform(-0.001, 0.001, count - 2), 0.0]
                columns = [*[wave + taxel for taxel in range(9)], np.zeros(count), stamps]
                content[f'{texture}/speed{speed:03d}/force{force}'] = np.stack(columns, axis=1).astype(np.float32)
    folder.mkdir()
    np.savez(folder / 'slides.npz', **content)
    return folder


def make_fabricslide(folder: Path) -> Path:
    """Write one fabric of two forces, two directions, two speeds and two repeats, and two runs over a grating."""
    content = {}
    for force in (120, 150):
        for speed in (-10, -50, 10, 50):
            for repeat in (0, 1):
                content[f'Canvas/F{force}/V{speed}/{repeat}'] = run(round(594 / abs(speed) / 0.028), speed, force)
    for speed in (5, 30):
        content[f'grating/Board10mm_F120_V-{speed}mmps_0'] = run(round(151 / speed / 0.028), speed, 120)
    folder.mkdir()
    np.savez(folder / 'runs.npz', **content)
    return folder


def run(rows: int, speed: int, force: int) -> np.ndarray:
    time_s = 0.028 * np.arange(rows)
    values = np.zeros((rows, 19), dtype=np.int32)
    values[:, 0] = 1000 * time_s
    wave = 40 * np.sin(2 * np.pi * time_s * abs(speed) / 1000.0 / PITCH_M)
    values[:, 3:] = force + np.arange(16) + wave[:, None]
    return values


def make_fingersense(folder: Path) -> Path:
    """Write two fabrics on two dates in two files: ten rows in free air, then a load, then three rows in free air."""
    rows = np.vstack([np.full((10, 16), 2), 300 + np.arange(16) + np.zeros((200, 1)), np.full((3, 16), 1)])
    folder.mkdir()
    for file, date in (('2021-05_06.npz', '2021-05-31'), ('2021-02_03.npz', '2021-02-12')):
        keys = [
            f'{date}/{name}' for name in ('Wool/2.5N/10mms', 'Wool/2N/-20mms/1', 'Wool/2N/-20mms', 'Denim/2N/10mms')
        ]
        np.savez(folder / file, **dict.fromkeys(keys, rows.astype(np.int16)))
    return folder


def make_lmt29(folder: Path) -> Path:
    folder.mkdir()
    sound = {f'{name}/{k:02d}': np.full(22_050, k, np.int16) for name in ('G4Bamboo', 'G9Jeans') for k in (2, 1)}
    np.savez(folder / 'recordings.npz', **sound)
    return folder


def conditions(bag: Path, topic: str) -> list[tuple[float, float]]:
    return [(round(1000 * slide.speed_m_s), slide.force_n) for slide in SlideDataset.from_bags([bag]).samples(topic)]


def test_slides_of_a_texture_are_numbered_by_speed_then_force(tmp_path: Path) -> None:
    bags = import_ntp21(make_ntp21(tmp_path / 'in'), tmp_path / 'out')
    assert [bag.name for bag in bags] == ['texture03', 'texture07']
    assert conditions(bags[0], 'signal') == [(20, 0.0), (20, 1.5), (100, 0.0), (100, 1.5)]
    assert [slide.number for slide in find_slides(bags, '1-2')] == [1, 2, 1, 2]


def test_a_slide_is_even_at_its_rate_and_covers_all_of_its_time(tmp_path: Path) -> None:
    (bag,) = import_ntp21(make_ntp21(tmp_path / 'in'), tmp_path / 'out', slides='1', materials=['texture07'])
    (slide,) = SlideDataset.from_bags([bag]).samples('signal')
    batches = [value for _, _, value in read_bag(bag, ('signal',))]
    assert lost_samples(batches) == 0
    assert (slide.rate_hz, len(slide.channels)) == (320.0, 9)
    assert len(slide.samples) / slide.rate_hz * slide.speed_m_s == pytest.approx(0.06, abs=2e-4)
    assert slide.slide.exploration_id == 'texture07/speed020/force0.0'


def test_a_slow_wave_passes_the_change_of_rate_unharmed() -> None:
    def wave(rate_hz: float, count: int) -> np.ndarray:
        return np.sin(2 * np.pi * 20.0 * np.arange(count) / rate_hz)[:, None]

    np.testing.assert_allclose(evenly(wave(310.0, 311), 1.0), wave(320.0, 321), atol=1e-3)


def test_runs_of_a_fabric_are_numbered_by_direction_force_speed_and_repeat(tmp_path: Path) -> None:
    board, canvas = import_fabricslide(make_fabricslide(tmp_path / 'in'), tmp_path / 'out')
    slides = SlideDataset.from_bags([canvas]).samples('signal_static')
    assert [slide.slide.exploration_id for slide in slides][:5] == [
        'Canvas/F120/V-10/0', 'Canvas/F120/V-10/1', 'Canvas/F120/V-50/0', 'Canvas/F120/V-50/1', 'Canvas/F150/V-10/0',
    ]  # fmt: skip
    assert [round(math.sin(slide.direction_rad)) for slide in slides] == [-1] * 8 + [1] * 8
    assert {slide.force_n for slide in slides} == {1.2, 1.5}
    assert conditions(board, 'signal_static') == [(5, 1.2), (30, 1.2)]


def test_speeding_up_is_contact_and_no_slide(tmp_path: Path) -> None:
    (canvas,) = import_fabricslide(make_fabricslide(tmp_path / 'in'), tmp_path / 'out', materials=['Canvas'])
    for slide in SlideDataset.from_bags([canvas]).samples('signal_static'):
        assert len(slide.samples) / slide.rate_hz * slide.speed_m_s == pytest.approx(0.5, abs=2e-3)


def test_a_date_is_a_session_and_slides_are_numbered_over_the_dates(tmp_path: Path) -> None:
    bags = import_fingersense(make_fingersense(tmp_path / 'in'), tmp_path / 'out')
    assert [bag.name for bag in bags] == ['2021-02-12', '2021-05-31']
    dataset = SlideDataset.from_bags(bags).select(labels=['Wool'])
    assert [(slide.number, slide.session, slide.exploration_id[16:]) for slide in dataset] == [
        (1, '2021-02-12', '2N/-20mms'), (2, '2021-02-12', '2N/-20mms/1'), (3, '2021-02-12', '2.5N/10mms'),
        (4, '2021-05-31', '2N/-20mms'), (5, '2021-05-31', '2N/-20mms/1'), (6, '2021-05-31', '2.5N/10mms'),
    ]  # fmt: skip
    assert [(slide.speed_m_s, slide.force_n) for slide in dataset][:3] == [(0.02, 2.0), (0.02, 2.0), (0.01, 2.5)]
    assert [round(math.sin(slide.direction_rad)) for slide in dataset][:3] == [-1, -1, 1]
    only = import_fingersense(tmp_path / 'in', tmp_path / 'denim', materials=['Denim'], slides='2')
    assert [slide.name for slide in find_slides(only)] == ['Denim/1']
    assert only[0].name == '2021-05-31'


def test_free_air_before_and_after_is_no_slide(tmp_path: Path) -> None:
    bags = import_fingersense(make_fingersense(tmp_path / 'in'), tmp_path / 'out', materials=['Denim'])
    for slide in SlideDataset.from_bags(bags).samples('signal_static'):
        assert (slide.rate_hz, len(slide.samples)) == (50.0, 200)
        np.testing.assert_array_equal(slide.samples[0], 300 + np.arange(16))


def test_a_stroke_by_hand_is_one_channel_of_sound_without_conditions(tmp_path: Path) -> None:
    bags = import_lmt29(make_lmt29(tmp_path / 'in'), tmp_path / 'out')
    assert [bag.name for bag in bags] == ['G4Bamboo', 'G9Jeans']
    first, second = SlideDataset.from_bags(bags[:1]).samples('signal')
    assert (first.rate_hz, first.samples.shape, second.samples[0, 0]) == (22_050.0, (22_050, 1), 2.0)
    assert math.isnan(first.speed_m_s)
    assert (first.slide.motion, first.slide.motion_name) == (None, '')


def test_the_line_of_a_printed_grating_stands_at_one_over_its_pitch_at_every_speed(tmp_path: Path) -> None:
    (board,) = import_fabricslide(make_fabricslide(tmp_path / 'in'), tmp_path / 'out', materials=['Board10mm'])
    bands = MeanSpatialBands(bands=40, longest_m=0.05, shortest_m=2.5e-3, floor=1e-3)
    for slide in SlideDataset.from_bags([board]).samples('signal_static'):
        highest = bands(
            WindowBatch(slide.samples, slide.rate_hz, np.array(slide.speed_m_s), np.array(slide.force_n))
        ).argmax(axis=-1)
        assert bands.edges_per_m[highest] == pytest.approx(1 / PITCH_M, rel=0.1)


@pytest.mark.parametrize(
    ('make', 'topic'),
    [
        (make_ntp21, 'signal'),
        (make_fabricslide, 'signal_static'),
        (make_fingersense, 'signal_static'),
        (make_lmt29, 'signal'),
    ],
)
def test_states_come_before_the_samples_they_cover_and_a_slide_ends(tmp_path: Path, make, topic) -> None:
    importer = IMPORTS[make.__name__.removeprefix('make_')]
    bag = importer(make(tmp_path / 'in'), tmp_path / 'out', slides='1')[-1]
    covered_ns = 0
    for name, log_ns, value in read_bag(bag):
        if name == 'exploration':
            covered_ns = value.stamp_ns + round(value.steady_s * NANOSECONDS)
        else:
            assert name == topic
            assert value.end_ns <= min(covered_ns + 1, log_ns)
    assert value.phase is Phase.DONE


def test_wrong_sources_names_and_numbers_are_refused_with_a_sentence(tmp_path: Path) -> None:
    source = make_ntp21(tmp_path / 'in')
    with pytest.raises(UnknownName, match="did you mean 'texture07'"):
        import_ntp21(source, tmp_path / 'out', materials=['texture30'])
    with pytest.raises(InvalidData, match='none of the requested slides'):
        import_ntp21(source, tmp_path / 'out', slides='500')
    with pytest.raises(InvalidData, match=r'no file slides\.npz .* give the folder'):
        import_ntp21(tmp_path, tmp_path / 'out')
    (source / 'slides.npz').write_bytes(b'nothing')
    with pytest.raises(InvalidData, match='not a file of this data set'):
        import_ntp21(source, tmp_path / 'out')


def changed(folder: Path, file: str, **arrays: np.ndarray) -> Path:
    """Replace arrays of a file."""
    with np.load(folder / file) as content:
        np.savez(folder / file, **{**content, **arrays})
    return folder


WRONG_SOUND = {
    'text': np.full(100, 'a'), 'complex': np.full(100, 1j), 'NaN': np.full(100, np.nan), 'none': np.empty(0),
}  # fmt: skip


@pytest.mark.parametrize('name', WRONG_SOUND)
def test_arrays_that_are_no_finite_samples_are_refused_with_a_sentence(tmp_path: Path, name: str) -> None:
    source = changed(make_lmt29(tmp_path / 'in'), 'recordings.npz', **{'G4Bamboo/01': WRONG_SOUND[name]})
    with pytest.raises(InvalidData, match=r'not a file of this data set: .*; fetch it again'):
        import_lmt29(source, tmp_path / 'out')


def test_sound_in_one_column_is_read_and_other_keys_and_wrong_times_are_refused(tmp_path: Path) -> None:
    sound = changed(make_lmt29(tmp_path / 'sound'), 'recordings.npz', **{'G4Bamboo/01': np.full((100, 1), 7.0)})
    (bag,) = import_lmt29(sound, tmp_path / 'out', slides='1', materials=['G4Bamboo'])
    assert SlideDataset.from_bags([bag]).samples('signal')[0].samples.shape == (100, 1)
    late = np.arange(300.0)[:, None] / 320.0 * np.ones(11)
    late[-1, 10] = 1e11
    for key, values, sentence in (
        ('felt/v20/f1', late, "holds 'felt/v20/f1', which is not of this data set"),
        ('texture07/speed020/force0.0', late, r'300 samples lasted 1e\+11 s'),
    ):
        source = changed(make_ntp21(tmp_path / key.replace('/', '_')), 'slides.npz', **{key: values})
        with pytest.raises(InvalidData, match=sentence):
            import_ntp21(source, tmp_path / 'none')
