# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

import numpy as np
import pytest

from texture_core.cli import Parser
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import Phase
from texture_features.segmentation import SegmentationParams
from texture_recordings.bags import BagWriter, read_bag
from texture_recordings.commands.convert import segment, segment_bags
from texture_recordings.slides import find_slides
from texture_simulation.offline import SlidePlan, write_simulated

SURFACE = 'ridge_2mm_deep'


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    folder = tmp_path_factory.mktemp('told')
    return write_simulated(folder, SlidePlan(slides=3, slide_s=1.0), np.random.default_rng(2), surfaces=[SURFACE])[0]


def without_states(bag, path, topics=('signal', 'signal_static')):
    with BagWriter(path) as writer:
        for topic, log_ns, value in read_bag(bag, topics):
            writer.write(f'left/{topic}', value, log_ns)
    return path


def slides_of(path):
    states = [value for _, _, value in read_bag(path, ('exploration',))]
    begun = [state for state in states if state.phase is Phase.SLIDE]
    ids = dict.fromkeys(state.exploration_id for state in begun)
    return [next(state for state in begun if state.exploration_id == name) for name in ids]


def test_the_slides_found_are_those_that_the_explorer_reported(bag, tmp_path):
    bare = without_states(bag, tmp_path / 'bare')
    [(path, count)] = segment_bags(bare, tmp_path / 'found', SegmentationParams(), 'oak').items()
    reported, found = slides_of(bag), slides_of(path)
    assert count == len(found) == len(reported) == 3
    for true, measured in zip(reported, found, strict=True):
        assert measured.stamp_ns == pytest.approx(true.stamp_ns, abs=60e6)
        assert measured.steady_s == pytest.approx(0.95, abs=0.1)
    assert [slide.name for slide in find_slides([path])] == ['oak/1', 'oak/2', 'oak/3']


def test_a_bag_without_vibration_gets_one_sentence_and_no_bag_stays(bag, tmp_path):
    bags = [without_states(bag, tmp_path / 'a'), without_states(bag, tmp_path / 'b', ('signal_static',))]
    with pytest.raises(InvalidData, match='record the vibration'):
        segment_bags(bags, tmp_path / 'found', SegmentationParams(), 'oak')
    assert not (tmp_path / 'found').exists()


def test_a_bag_with_labelled_slides_is_refused_and_keeps_them(bag, tmp_path):
    with pytest.raises(InvalidData, match=f"'{bag}' has slides already, the first over '{SURFACE}'; use it as it is"):
        segment_bags([bag], tmp_path / 'found', SegmentationParams(), 'oak')
    assert not (tmp_path / 'found').exists()


def test_slides_without_a_label_get_one_and_keep_all_else(bag, tmp_path):
    with BagWriter(tmp_path / 'unnamed') as writer:
        for topic, log_ns, value in read_bag(bag, ('signal', 'exploration')):
            writer.write(topic, replace(value, surface='') if topic == 'exploration' else value, log_ns)
    [(path, count)] = segment_bags(tmp_path / 'unnamed', tmp_path / 'found', SegmentationParams(), 'oak').items()
    kept = slides_of(bag)
    assert count == len(kept)
    assert list(map(str, slides_of(path))) == [str(replace(slide, surface='oak')) for slide in kept]  # NaN is not NaN
    assert [slide.name for slide in find_slides([path])] == ['oak/1', 'oak/2', 'oak/3']


def test_a_label_of_found_slides_is_not_empty(bag, tmp_path):
    with pytest.raises(InvalidData, match='no surface was named; give its label'):
        segment_bags([bag], tmp_path / 'found', SegmentationParams(), ' ')


def test_bags_without_a_slide_are_refused_and_one_of_several_is_named(bag, tmp_path, capsys):
    bare, quiet = without_states(bag, tmp_path / 'bare'), tmp_path / 'quiet'
    with BagWriter(quiet) as writer:
        for topic, log_ns, value in read_bag(bag, ('signal',)):
            writer.write(topic, replace(value, samples=np.zeros_like(value.samples)), log_ns)
    with pytest.raises(InvalidData, match='no slide was found at a power of 6 times that of rest, longer'):
        segment_bags(quiet, tmp_path / 'found', SegmentationParams(), 'oak')
    assert not (tmp_path / 'found').exists()
    parser = Parser()
    segment.configure(parser)
    options = ['--out', str(tmp_path / 'found'), '--surface', 'oak']
    assert segment.run(parser.parse_args([str(bare), str(quiet), *options])) == 0
    assert 'bare: 3 slides\n' in (printed := capsys.readouterr().out)
    assert 'quiet: 0 slides; lower --on and --off, or --ramp-s' in printed


def test_a_slide_does_not_end_above_the_power_at_which_it_starts():
    with pytest.raises(InvalidParameter, match="'off' is 5 and 'on' is 1; a slide ends below"):
        SegmentationParams(on=1.0, off=5.0)


def test_nothing_stays_on_a_disk_that_is_too_small(bag, tmp_path, fill_disk):
    bare = without_states(bag, tmp_path / 'bare')
    fill_disk()
    with pytest.raises(InvalidParameter, match="found/bare' cannot be written: File too large"):
        segment_bags(bare, tmp_path / 'found', SegmentationParams(), 'oak')
    assert not (tmp_path / 'found').exists()


def test_nothing_is_written_into_a_folder_that_exists(bag, tmp_path):
    (tmp_path / 'found').mkdir()
    with pytest.raises(InvalidParameter, match="found' exists already; nothing is overwritten, name another folder"):
        segment_bags([bag], tmp_path / 'found', SegmentationParams(), 'oak')
