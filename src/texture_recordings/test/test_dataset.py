# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import ExplorationError, InvalidData
from texture_core.types import NANOSECONDS, ExplorationState, Phase, TactileSignal
from texture_features.feature_set import FeatureSet
from texture_recordings.bags import BagWriter, Continuity
from texture_recordings.dataset import SlideDataset
from texture_recordings.nodes.replay import Schedule
from texture_recordings.slides import STREAMS, LabelledSlide, find_slides, parse_selection, with_places

pytestmark = pytest.mark.ros


SLID = (Phase.APPROACH, Phase.SLIDE, Phase.DONE)


def write(path: Path, surfaces: list[str], start_s: int, phases: tuple[Phase, ...] = SLID, error: int = 0) -> Path:
    with BagWriter(path) as bag:
        for count, surface in enumerate(surfaces):
            stamp_ns = (start_s + 10 * count) * NANOSECONDS
            name = f'{path.stem}/{count}'
            for step, phase in enumerate(phases):
                state = ExplorationState(stamp_ns + step, name, 'linear_slide', phase, surface=surface)
                if phase is Phase.ABORTED:
                    state = replace(state, error_code=error)
                bag.write('exploration', state, stamp_ns + step)
            samples = np.full((1, 1), count, dtype=np.float32)
            bag.write('signal', TactileSignal(stamp_ns, 's', ('a',), (), 1.0, count, samples), stamp_ns + 5)
    return path


@pytest.mark.parametrize(
    ('text', 'numbers'), [('1-3', {1, 2, 3}), ('1,3,5-7', {1, 3, 5, 6, 7}), (' 4 ', {4}), ('2-2', {2}), ('', None)]
)
def test_a_selection_names_numbers_and_ranges(text: str, numbers: set[int] | None) -> None:
    assert parse_selection(text) == numbers


@pytest.mark.parametrize('text', ['0-3', '3-1', 'all', '1-', '1;2', '-1', '1,,2', '1.5', [1, 2], 3])
def test_a_selection_that_makes_no_sense_is_refused_with_a_sentence(text: object) -> None:
    with pytest.raises(InvalidData, match=r"slides are .*; .* needed, such as '1-30'"):
        parse_selection(text)


def test_slides_are_counted_for_each_surface_in_the_order_recorded_over_all_bags(tmp_path: Path) -> None:
    late = write(tmp_path / 'late', ['cork', 'felt'], start_s=1000)
    early = write(tmp_path / 'early', ['felt', 'cork', 'felt'], start_s=0)
    found = {slide.exploration_id: (slide.surface, slide.number) for slide in find_slides([late, early])}
    assert found == {
        'early/0': ('felt', 1),
        'early/1': ('cork', 1),
        'early/2': ('felt', 2),
        'late/0': ('cork', 2),
        'late/1': ('felt', 3),
    }
    assert {slide.exploration_id for slide in find_slides([late, early], '2')} == {'early/2', 'late/0'}


def test_an_aborted_slide_is_left_out_and_named_but_not_one_that_the_user_ended(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    aborted = (Phase.SLIDE, Phase.LIFT, Phase.ABORTED)
    stopped = write(tmp_path / 'stopped', ['cork'], 0, aborted, ExplorationError.STOPPED)
    drifted = write(tmp_path / 'drifted', ['cork'], 100, aborted, ExplorationError.FORCE_SENSOR)
    good = write(tmp_path / 'good', ['cork'], 200)
    slow = write(tmp_path / 'slow', ['felt'], 300, aborted, ExplorationError.MOTION_FAILED)
    assert [slide.name for slide in find_slides([stopped, drifted, good])] == ['cork/1', 'cork/3']
    assert 'aborted slides that were left out, 1: cork/2' in caplog.text
    assert [slide.name for slide in find_slides([drifted, good, slow])] == ['cork/2']
    assert 'aborted slides that were left out, 2: cork/1, felt/1' in caplog.text
    with pytest.raises(InvalidData, match=r"all slides of '.*slow' were aborted; record again"):
        find_slides([slow])


def test_a_slide_yields_its_messages_only(tmp_path: Path) -> None:
    bags = [write(tmp_path / name, ['cork', 'felt', 'cork'], start_s=0) for name in 'ab']
    read = find_slides(bags, '1,3', topics=STREAMS)
    assert len(read) == 3
    for slide in read:
        assert list(slide.signals) == ['signal']
        (signal,) = slide.signals['signal']
        assert slide.exploration_id.endswith(f'/{signal.samples[0, 0]:.0f}')
        assert len(slide.states) == 3


def test_unlabelled_slides_are_left_out_and_a_bag_without_labels_is_refused(tmp_path: Path) -> None:
    assert len(find_slides([write(tmp_path / 'some', ['', 'cork'], start_s=0)])) == 1
    with pytest.raises(InvalidData, match='is labelled; label them by `texture segment --surface NAME`'):
        find_slides([write(tmp_path / 'none', ['', ''], start_s=0)])


def test_an_empty_bag_among_others_is_named_and_skipped(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write(tmp_path / 'cork', ['cork'], start_s=0)
    with BagWriter(tmp_path / 'cork-2'):
        pass
    assert [slide.bag.name for slide in find_slides([tmp_path])] == ['cork']
    assert f"the bag '{tmp_path / 'cork-2'}' has no labelled slide" in caplog.text
    with BagWriter(tmp_path / 'idle') as idle:
        idle.write('exploration', ExplorationState(1, '', '', Phase.IDLE), 1)
    for name in ('cork-2', 'idle'):
        with pytest.raises(InvalidData, match=r'nothing was explored in .* or have `texture segment` find its slides'):
            find_slides([tmp_path / name])


@pytest.mark.parametrize('surfaces', [['cork'], ['cork', 'felt']])
def test_bags_of_explorations_that_were_refused_or_aborted_before_their_slide_are_named_so(
    tmp_path: Path, surfaces: list[str]
) -> None:
    bag = write(tmp_path / 'aborted', surfaces, start_s=0, phases=(Phase.APPROACH, Phase.ABORTED))
    with BagWriter(bag.with_name('idle')) as idle:
        idle.write('exploration', ExplorationState(1, '', '', Phase.IDLE), 1)
    with pytest.raises(InvalidData, match=r"came to its slide: .* ends with 'the motion was completed'"):
        find_slides([bag.with_name('idle'), bag])


def test_slides_that_no_surface_has_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidData, match='there are 1 to 2'):
        find_slides([write(tmp_path / 'bag', ['cork', 'cork'], start_s=0)], '30-40')


def test_messages_are_due_at_their_distances_divided_by_the_rate() -> None:
    schedule = Schedule(rate=5.0)
    assert [schedule.due_s(NANOSECONDS * t // 10) for t in (100, 105, 110)] == pytest.approx([0.0, 0.1, 0.2])
    assert schedule.played_s == pytest.approx(1.0)


def test_long_pauses_are_shortened() -> None:
    schedule = Schedule(rate=1.0)
    assert [schedule.due_s(NANOSECONDS * t) for t in (0, 60, 60)] == pytest.approx([0.0, 1.0, 1.0])


def test_a_second_tare_is_no_restart_of_a_driver() -> None:
    continuity = Continuity()
    for stream in ('/signal_static_baseline',) * 2:
        continuity.update(stream, TactileSignal(0, 's', ('c',), (), 1.0, 0, np.zeros((1, 1), dtype=np.float32)))
    assert (continuity.losses, continuity.restarts.total()) == ('', 0)


def test_losses_and_restarts_of_each_stream_are_counted() -> None:
    continuity = Continuity()
    for stream, first in (('a', 100), ('b', 0), ('a', 104), ('a', 110), ('a', 0), ('b', 4)):
        continuity.update(stream, TactileSignal(0, 's', ('c',), (), 1.0, first, np.zeros((4, 1), dtype=np.float32)))
    assert (continuity.lost['a'], continuity.restarts['a'], continuity.samples['a']) == (2, 1, 16)
    assert (continuity.lost['b'], continuity.restarts['b'], continuity.samples['b']) == (0, 0, 8)
    assert continuity.losses.startswith('2 samples lost (or slides that a replay left out), and unknown losses in 1 ')


def test_slides_that_touched_at_several_places_of_a_surface_know_theirs():
    def slide(surface, number, x_m):
        states = [ExplorationState(0, 'one', 'linear_slide', Phase.CONTACT, surface=surface, x_m=x_m, y_m=0.001)]
        return LabelledSlide(Path('bag'), 'one', surface, number, 0, None, states=states)

    touched = [('oak', 0.01), ('oak', 0.012), ('oak', -0.03), ('felt', 0.01), ('felt', 0.011), ('cork', math.nan)]
    found = with_places([slide(name, number, x_m) for number, (name, x_m) in enumerate(touched)])
    assert [one.place for one in found] == ['at 10,1 mm', 'at 10,1 mm', 'at -30,1 mm', '', '', '']
    assert (found[0].name, found[0].is_part) == ('oak/0', False)


@pytest.mark.parametrize('bad', [False, True])
def test_the_level_at_rest_is_that_of_windows_without_samples_that_are_not_finite(bad: bool) -> None:
    # Noise of 10 on a level that settles by 100 in 2 s, whose deviation over all 2 s is 28.
    rng = np.random.default_rng(0)
    rest = rng.normal(scale=10.0, size=(2000, 1)) + 100.0 * np.exp(-np.arange(2000) / 500.0)[:, None]
    rest[5] = np.nan if bad else rest[5]
    recipe = FeatureSet.load('default')
    [slid] = SlideDataset.from_arrays({'signal': [rng.normal(scale=50.0, size=(1500, 1))]}, ['oak'], {'signal': 1000.0})
    [first, *more] = slid.signals['signal']
    assert not more
    before = replace(first, stamp_ns=first.stamp_ns - 2 * NANOSECONDS, first_sample=0, samples=rest)
    approach = ExplorationState(before.stamp_ns, slid.exploration_id, 'linear_slide', Phase.APPROACH)
    signals = {'signal': [before, replace(first, first_sample=2000)]}
    whole = SlideDataset((replace(slid, signals=signals, states=(approach, *slid.states)),))
    [(_, level)] = whole.features(recipe).conditions[slid.name].rest
    assert level == pytest.approx(11.0, abs=1.5)
