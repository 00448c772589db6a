# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_core.types import NANOSECONDS, Phase, TactileSignal, lost_samples
from texture_recordings.bags import read_bag
from texture_recordings.dataset import SlideDataset
from texture_recordings.public_sets import frame_indices, import_biotac20, restore_sign
from texture_recordings.slides import find_slides

N_FRAMES = 610


def make_source(folder: Path, frame_time: np.ndarray | None = None) -> Path:
    """Write two slides in the data set's format: PAC counts its frames, slow columns hold their number."""
    frame_time = np.arange(N_FRAMES) * 0.01 if frame_time is None else frame_time
    n_frames = len(frame_time)
    frames = np.tile(np.arange(44), (n_frames, 1)).astype(np.int16)
    frames[:, 3:25] = np.arange(n_frames)[:, None] + 100
    motion = np.stack([frame_time, np.full(n_frames, 0.012), np.full(n_frames, 0.016), np.zeros(n_frames)], axis=1)
    wrench = np.zeros((n_frames, 7))
    wrench[:, 0], wrench[:, 2] = frame_time, 10.0
    content = {}
    for number in (1, 2):
        slide = {'frames': frames, 'frame_time': frame_time, 'velocity': motion, 'wrench': wrench}
        content |= {f'slide{number:02d}/{name}': value for name, value in slide.items()}
    folder.mkdir()
    np.savez(folder / 'material07.npz', **content)
    return folder


def signals(bag: Path, topic: str) -> list[TactileSignal]:
    return [value for _, _, value in read_bag(bag, (topic,))]


def test_each_material_becomes_a_labelled_bag(tmp_path: Path) -> None:
    (bag,) = import_biotac20(make_source(tmp_path / 'in'), tmp_path / 'out')
    assert bag.name == 'material07'
    assert [(s.surface, s.number, s.exploration_id) for s in find_slides([bag])] == [
        ('material07', 1, 'material07/slide01'),
        ('material07', 2, 'material07/slide02'),
    ]


def test_both_streams_cover_the_common_length_without_a_loss(tmp_path: Path) -> None:
    (bag,) = import_biotac20(make_source(tmp_path / 'in'), tmp_path / 'out')
    fast, slow = signals(bag, 'signal'), signals(bag, 'signal_static')
    assert lost_samples(fast) == lost_samples(slow) == 0
    assert sum(len(batch.samples) for batch in fast) == 2 * 600 * 22
    assert sum(len(batch.samples) for batch in slow) == 2 * 600
    assert (fast[0].sampling_rate_hz, slow[0].sampling_rate_hz) == (2200.0, 100.0)
    assert len(fast[0].samples) == 220
    np.testing.assert_array_equal(slow[0].samples[0], [0, 1, 2, *range(25, 44)])


def test_stamps_lie_on_the_ten_millisecond_grid(tmp_path: Path) -> None:
    source = make_source(tmp_path / 'in', frame_time=np.arange(N_FRAMES) * 0.01 + 0.004 * (np.arange(N_FRAMES) % 2))
    (bag,) = import_biotac20(source, tmp_path / 'out', slides='1')
    fast = signals(bag, 'signal')
    assert fast[0].stamp_ns == 1_000_000_000 * NANOSECONDS
    assert {after.stamp_ns - before.stamp_ns for before, after in pairwise(fast)} == {100_000_000}


def test_a_state_arrives_before_the_batch_it_covers_and_guarantees_its_length(tmp_path: Path) -> None:
    (bag,) = import_biotac20(make_source(tmp_path / 'in'), tmp_path / 'out', slides='1')
    covered_ns = 0
    for topic, log_ns, value in read_bag(bag):
        if topic == 'exploration' and value.phase is Phase.SLIDE:
            covered_ns = value.stamp_ns + round(value.steady_s * NANOSECONDS)
            assert (value.speed_m_s, value.force_n) == (pytest.approx(0.02), pytest.approx(10.0))
            assert value.direction_rad == pytest.approx(np.arctan2(4, 3))
        elif topic != 'exploration':
            assert value.end_ns <= covered_ns
            assert log_ns >= value.end_ns
    assert value.phase is Phase.DONE


def test_halves_are_of_equal_distance_by_the_velocity(tmp_path: Path) -> None:
    source = make_source(tmp_path / 'in')
    with np.load(source / 'material07.npz') as file:
        content = dict(file)
    velocity = content['slide01/velocity']
    velocity[velocity[:, 0] < 3.0, 1:3] *= 0.5  # half the speed in the first 3 s, so 30 of 90 mm
    np.savez(source / 'material07.npz', **{**content, 'slide01/velocity': velocity})
    bags = import_biotac20(source, tmp_path / 'out', slides='1')
    halves = SlideDataset.from_bags(bags).in_parts(2)
    assert halves.condition('place').tolist() == ['1/2', '2/2']
    counts = [sum(len(batch.samples) for batch in half.signals['signal']) for half in halves]
    assert counts[0] / 2200.0 == pytest.approx(3.75, abs=0.05)  # 45 mm
    assert sum(counts) == 600 * 22


def test_missing_frames_become_a_jump_of_the_index(tmp_path: Path) -> None:
    frame_time = np.arange(N_FRAMES) * 0.01
    frame_time[101:] += 0.03
    (bag,) = import_biotac20(make_source(tmp_path / 'in', frame_time), tmp_path / 'out', slides='1')
    assert lost_samples(signals(bag, 'signal')) == 3 * 22
    assert lost_samples(signals(bag, 'signal_static')) == 3
    assert frame_indices(frame_time)[-1] == N_FRAMES - 1 + 3


def test_the_sign_of_a_rectified_tone_is_restored() -> None:
    tone = np.sin(2 * np.pi * 130.0 * np.arange(2200) / 2200.0 + 0.3)
    clear = np.abs(tone) > 0.1  # next to a zero crossing a curved line may have either sign
    np.testing.assert_array_equal(restore_sign(np.abs(tone))[clear], tone[clear])


def test_the_sign_follows_the_rule_sample_by_sample() -> None:
    rectified = np.random.default_rng(0).integers(1, 50, 3000).astype(float)
    expected = rectified.copy()
    for k in range(2, len(expected)):
        line = 2 * expected[k - 1] - expected[k - 2]
        negative = line < 0 or (line == 0 and expected[k - 1] < 0)
        expected[k] = -rectified[k] if negative else rectified[k]
    np.testing.assert_array_equal(restore_sign(rectified), expected)


def test_slides_have_the_number_in_their_name(tmp_path: Path) -> None:
    source = make_source(tmp_path / 'in')
    with np.load(source / 'material07.npz') as file:
        content = {name.replace('slide02', 'slide05'): values for name, values in file.items()}
    np.savez(source / 'material07.npz', **content)
    (bag,) = import_biotac20(source, tmp_path / 'out', slides='5')
    assert [slide.exploration_id for slide in find_slides([bag])] == ['material07/slide05']
    with pytest.raises(InvalidData, match='none of the requested slides; it has 1 to 5'):
        import_biotac20(source, tmp_path / 'none', slides='2')


WRONG_ARRAYS = {
    'time NaN': ('frame_time', np.full(N_FRAMES, np.nan)),
    'time far': ('frame_time', np.linspace(0.0, 1e7, N_FRAMES)),
    'text': ('frames', np.full((N_FRAMES, 44), 'a')),
    'no frames': ('frames', np.empty((0, 44), np.int16)),
    'fewer frames': ('frames', np.zeros((N_FRAMES - 20, 44), np.int16)),
    'text as velocity': ('velocity', np.full((N_FRAMES, 4), 'a')),
}


@pytest.mark.parametrize('name', WRONG_ARRAYS)
def test_arrays_that_are_no_slide_are_refused_with_a_sentence(tmp_path: Path, name: str) -> None:
    source, (array, values) = make_source(tmp_path / 'in'), WRONG_ARRAYS[name]
    with np.load(source / 'material07.npz') as file:
        np.savez(source / 'material07.npz', **{**file, f'slide01/{array}': values})
    with pytest.raises(InvalidData, match=r'not a file of this data set: .*; fetch it again'):
        import_biotac20(source, tmp_path / 'out')


def test_a_file_without_a_slide_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'in').mkdir()
    np.savez(tmp_path / 'in' / 'material07.npz', felt=np.zeros(3))
    with pytest.raises(InvalidData, match='hold no slide; fetch them again'):
        import_biotac20(tmp_path / 'in', tmp_path / 'out')
