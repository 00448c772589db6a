# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import InvalidData, ModelMismatch
from texture_core.types import NANOSECONDS, ExplorationState, Phase, SlideMotion, TactileSignal
from texture_estimation.recipe import load_recipe
from texture_evaluation.evaluate import evaluate
from texture_evaluation.train import train_from_bags
from texture_features.feature_set import FeatureSet
from texture_features.windows import CutWindow, WindowParams, cut_recording
from texture_recordings.bags import BagWriter, read_bag
from texture_recordings.dataset import SlideDataset
from texture_recordings.slides import motion_made
from texture_simulation.offline import SlidePlan, write_simulated

RATE_HZ = 1000.0
FEATURES = FeatureSet.from_mapping(
    {'windows': {'length_s': 0.5, 'hop_s': 0.25}, 'inputs': {'signal': {'features': ['mean']}}}
)
LABELS = ['cork', 'felt', 'cork', 'felt', 'cork', 'felt']
SPEEDS = [0.02, 0.02, 0.04, 0.0401, 0.04, 0.02]


def arrays(seconds: float = 1.0, channels: int = 2) -> list[np.ndarray]:
    rng = np.random.default_rng(3)
    return [rng.normal(size=(int(seconds * RATE_HZ), channels)).astype(np.float32) for _ in LABELS]


def from_arrays(**conditions: object) -> SlideDataset:
    return SlideDataset.from_arrays(
        {'signal': arrays()}, LABELS, {'signal': RATE_HZ}, **{'speed_m_s': SPEEDS, 'force_n': 1.0, **conditions}
    )


def write(path: Path, dataset: SlideDataset) -> Path:
    with BagWriter(path) as bag:
        for slide in dataset:
            for state in slide.states:
                bag.write('exploration', state, state.stamp_ns)
            for batch in slide.signals['signal']:
                bag.write('signal', batch, batch.stamp_ns + 1)
    return path


def test_a_bag_gives_the_same_data_set_as_the_arrays_that_it_holds(tmp_path: Path) -> None:
    given = from_arrays()
    read = SlideDataset.from_bags(write(tmp_path / 'bag', given))
    assert read.names.tolist() == given.names.tolist()
    assert len(SlideDataset.from_bags(str(tmp_path), '1-2')) == 4
    assert read.condition('speed').tolist() == given.condition('speed').tolist()
    one, other = given.features(FEATURES), read.features(FEATURES)
    np.testing.assert_array_equal(one.X, other.X)
    assert one.y.tolist() == other.y.tolist()
    assert one.groups.tolist() == other.groups.tolist()
    np.testing.assert_array_equal(one.start_ns, other.start_ns)


def test_features_are_those_of_each_window_and_of_its_time() -> None:
    features = from_arrays().features(FEATURES)
    # 1 s holds windows of 0.5 s at 0, 0.25 and 0.5 s.
    assert features.X.shape == (3 * len(LABELS), 2)
    assert features.groups[:6].tolist() == ['cork/1'] * 3 + ['felt/1'] * 3
    window = arrays()[1][250:750].astype(np.float64)
    np.testing.assert_allclose(features.X[4], window.mean(axis=0), atol=1e-9)
    assert np.diff(features.start_ns[3:6]).tolist() == [NANOSECONDS // 4] * 2


@pytest.mark.parametrize('feature_set', ['default', None, load_recipe('default')])
def test_what_is_no_feature_set_is_refused_with_where_there_is_one(feature_set: object) -> None:
    for windows in (from_arrays().windows, from_arrays().vectors, from_arrays().features):
        with pytest.raises(InvalidData, match=r'the feature set is a .*; give that of a model'):
            list(windows(feature_set))


def test_slides_are_selected_by_number_label_and_condition() -> None:
    dataset = from_arrays()
    assert dataset.select('2-3').names.tolist() == ['cork/2', 'felt/2', 'cork/3', 'felt/3']
    assert dataset.select(labels=['felt']).names.tolist() == ['felt/1', 'felt/2', 'felt/3']
    assert dataset.select(where=lambda slide: slide.speed_m_s > 0.03).names.tolist() == ['cork/2', 'felt/2', 'cork/3']
    assert dataset.take(np.array([5, 0])).names.tolist() == ['felt/3', 'cork/1']
    with pytest.raises(InvalidData, match='the data set has no slide'):
        dataset.select('9')


def test_an_unknown_condition_or_one_that_slides_do_not_tell_is_refused() -> None:
    with pytest.raises(InvalidData, match="no condition 'colour'; use one of speed, force"):
        from_arrays().condition('colour')
    with pytest.raises(InvalidData, match="6 of 6 slides have no force, first 'cork/1'"):
        from_arrays(force_n=math.nan).condition('force')


@pytest.mark.parametrize(
    ('condition', 'expected'),
    [
        ('motion', ['linear_slide'] * 6),
        ('sensor', ['finger'] * 6),
        ('session', ['monday'] * 6),
        ('number', [1, 1, 2, 2, 3, 3]),
        ('speed', [0.02, 0.02, 0.04, 0.04, 0.04, 0.02]),  # within five per cent they are one
    ],
)
def test_each_slide_has_its_conditions(condition: str, expected: list) -> None:
    assert from_arrays(sensor='finger', session='monday').condition(condition).tolist() == expected


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        (({'signal': arrays()[:5]}, LABELS, {'signal': RATE_HZ}), "'signal' has 5 slides"),
        (({'signal': arrays()}, LABELS, {}), 'the rates are {}; give one array'),
        (({'signal': arrays()}, LABELS, {'signal': '1000'}), "the rates are {'signal': '1000'}; give one array"),
        (({'signal': arrays()}, LABELS, 1000.0), 'signals and rates_hz are by topic'),
        (({'signal': arrays()}, 'corkfe', {'signal': RATE_HZ}), 'has 6 slides for 1 labels'),
        (({'signal': arrays()}, [*LABELS[:5], ' '], {'signal': RATE_HZ}), 'slide 6 has an empty label'),
        *(
            (({'signal': arrays()}, [*LABELS[:5], none], {'signal': RATE_HZ}), 'slide 6 has an empty label')
            for none in (None, math.nan, np.float32('nan'))
        ),
        (({'signal': arrays()}, ['a/b', *LABELS[1:]], {'signal': RATE_HZ}), "the label 'a/b' has a slash"),
        *(
            (({'signal': [bad, *arrays()[1:]]}, LABELS, {'signal': RATE_HZ}), f"'signal' of slide 1 has .*{sentence}")
            for bad, sentence in (
                (np.ones((1, 2000)), r'\(1, 2000\) of float64 with 1 finite .* transpose an array'),
                (np.ones((3, 2000)), r'\(3, 2000\) .* transpose an array'),
                (np.full((2000, 2), np.nan), 'with 0 finite samples'),
                (np.ones(2000) * 1j, 'of complex128'),
            )
        ),
        (({}, LABELS, {}), 'no signal was given'),
        (({'signal': []}, [], {'signal': RATE_HZ}), 'the data set has no slide'),
    ],
)
def test_arrays_that_contradict_each_other_are_refused(arguments: tuple, sentence: str) -> None:
    with pytest.raises(InvalidData, match=sentence):
        SlideDataset.from_arrays(*arguments)


@pytest.mark.parametrize(
    ('conditions', 'sentence'),
    [
        ({'speed_m_s': 'fast'}, "speed_m_s is 'fast'; give one number, or one for each slide"),
        ({'speed_m_s': [*SPEEDS[:5], 50.0]}, 'the speed of a slide is 50 m/s, plausible are .* may be cm/s or mm/s'),
        ({'force_n': math.inf}, 'the force of a slide is inf N, plausible are 1 mN to 100 N'),
        ({'direction_rad': 90}, 'the direction of a slide is 90 rad, .* its unit, which may be deg'),
        ({'force_n': [1.0]}, r'force_n has the shape \(1,\)'),
    ],
)
def test_conditions_that_no_finger_reaches_are_refused(conditions: dict, sentence: str) -> None:
    with pytest.raises(InvalidData, match=sentence):
        from_arrays(**conditions)


def test_lost_samples_leave_windows_out_but_are_refused_where_all_are_needed(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag') as bag:
        bag.write('exploration', ExplorationState(0, 'e', 'linear_slide', Phase.SLIDE, 2.0, surface='cork'), 0)
        for first in (0, 1000, 1500):  # 500 to 999 are lost
            samples = np.ones((500, 1), dtype=np.float32)
            stamp_ns = first * NANOSECONDS // 1000
            bag.write('signal', TactileSignal(stamp_ns, 's', ('a',), (), RATE_HZ, first, samples), stamp_ns + 1)
    dataset = SlideDataset.from_bags([tmp_path / 'bag'])
    windows = WindowParams(length_s=0.5, hop_s=0.5)
    [(_, events)] = dataset.windows(FeatureSet(windows, FEATURES.inputs))
    starts = [event.start_ns for event in events if isinstance(event, CutWindow)]
    assert starts == [0, NANOSECONDS, 3 * NANOSECONDS // 2]
    with pytest.raises(InvalidData, match='has lost samples'):
        dataset.to_numpy()


def test_windows_over_distances_show_as_much_of_a_surface_at_every_speed() -> None:
    way_m = [np.linspace(0.0, 0.06, count)[:, None] for count in (301, 61)]  # at 20 and at 100 mm/s
    dataset = SlideDataset.from_arrays({'signal': way_m}, ['cork', 'felt'], {'signal': 100.0}, speed_m_s=[0.02, 0.1])
    features = FeatureSet.from_mapping({'inputs': {'signal': {'features': ['mean']}}})
    found = dataset.features(features, distances_m=[0.02, 0.5]).resized
    assert found is not None
    slow, fast = (found.X[found.labels == label][:, 0] for label in ('cork', 'felt'))
    starts = np.arange(0.0, 0.041, 0.02 / 4)
    np.testing.assert_allclose(slow, [*(starts + 0.01), 0.03], atol=1e-3)  # the last shows the whole slide
    np.testing.assert_allclose(fast, slow, atol=2e-3)
    unknown = SlideDataset.from_arrays({'signal': way_m}, ['cork', 'felt'], {'signal': 100.0})
    assert unknown.features(features, distances_m=[0.02]).resized is None


BAG_FEATURES = FeatureSet.load('vibration-and-taxels')


def test_a_bag_gives_the_features_of_the_recording_itself(simulated: Path) -> None:
    recording = {
        topic: [value for _, _, value in read_bag(simulated / 'glass', (topic,))]
        for topic in ('exploration', *BAG_FEATURES.topics)
    }
    states = recording.pop('exploration')
    direct = [BAG_FEATURES.extract(event) for event in cut_recording(recording, states, BAG_FEATURES.windows)]
    from_bag = SlideDataset.from_bags([simulated / 'glass']).features(BAG_FEATURES)
    np.testing.assert_array_equal(from_bag.values, [vector.values for vector in direct if not vector.last])
    assert from_bag.names == direct[0].names
    # Windows of 0.5 s every 0.1 s in 1.2 s: the first starts at 0, the last at 0.7 s.
    assert len(from_bag.labels) == 6 * 8


def test_slides_without_a_whole_window_are_refused_with_a_sentence(tmp_path: Path) -> None:
    bags = write_simulated(tmp_path, SlidePlan(slides=1, slide_s=0.3), np.random.default_rng(0), surfaces=('glass',))
    with pytest.raises(InvalidData, match='none of the 1 slides has a whole window'):
        SlideDataset.from_bags(bags).features(BAG_FEATURES)
    samples = np.where(np.arange(4000)[:, None] % 4, 0.5, np.nan)
    with pytest.raises(
        InvalidData, match=r'none of the 1 slides has .* \(25 % of the samples have NaN or infinity\); record'
    ):
        SlideDataset.from_arrays({'signal': [samples]}, ['oak'], {'signal': 1000.0}).features(
            FeatureSet.load('default')
        )


def test_a_joined_recipe_is_trained_from_bags_of_two_fingers(tmp_path: Path) -> None:
    plan = SlidePlan(slides=6, slide_s=1.2, fingers=2)
    bags = write_simulated(tmp_path, plan, np.random.default_rng(3), surfaces=('glass', 'ridge_2mm_deep'))
    model = train_from_bags('two-fingers', bags, '1-4')
    topics = ('finger0/signal', 'finger1/signal')
    assert model.recipe.feature_set.topics == topics
    slides = SlideDataset.from_bags(bags, topics=topics).slides
    for slide in slides:  # each finger has individual traits, at the same time
        first, second = (slide.signals[topic] for topic in topics)
        assert first[0].stamp_ns == second[0].stamp_ns
        assert not np.array_equal(first[0].samples, second[0].samples)
    assert evaluate(model, bags, '5-6').as_json()['window_accuracy'] > 0.9


def ramps(count: int = 2, speed_m_s: object = math.nan, **more: object) -> SlideDataset:
    """Return slides of 4 s whose one channel is the time, in s."""
    time_s = np.arange(4000)[:, None] / RATE_HZ
    labels = ['cork', 'felt'] * (count // 2)
    return SlideDataset.from_arrays(
        {'signal': [time_s] * count}, labels, {'signal': RATE_HZ}, speed_m_s=speed_m_s, **more
    )


def spans(dataset: SlideDataset) -> dict[str, tuple[float, float]]:
    """Return the first and last time in the samples of each part."""
    return {one.slide.name: (one.samples[0, 0], one.samples[-1, 0]) for one in dataset.samples('signal')}


def test_parts_of_equal_time_hold_every_sample_once_and_windows_never_span_two() -> None:
    cut = ramps().in_parts(4)
    assert cut.names[:5].tolist() == [f'cork/1 part {k}/4' for k in (1, 2, 3, 4)] + ['felt/1 part 1/4']
    np.testing.assert_allclose(spans(cut)['cork/1 part 2/4'], (1.0, 1.999), atol=2e-3)
    np.testing.assert_array_equal(
        np.concatenate(cut.to_numpy()[0][:4])[:, 0], (np.arange(4000) / RATE_HZ).astype(np.float32)
    )
    for slide, events in cut.windows(FEATURES):
        first, windows = int(slide.place[0]) - 1, [event for event in events if isinstance(event, CutWindow)]
        assert [window.start_ns // NANOSECONDS % 5 for window in windows[:2]] == [first] * 2
        for times in (window.windows['signal'].samples[:, 0] for window in windows):
            assert first - 1e-3 <= times[0] < times[-1] < first + 1.0


def test_parts_are_of_equal_distance_where_slides_tell_their_speed() -> None:
    [slide, _] = ramps(speed_m_s=[0.02, 0.02]).slides
    slow = replace(slide.states[0], steady_s=2.0, speed_m_s=0.01)
    states = (slow, replace(slow, speed_m_s=0.03, stamp_ns=2 * NANOSECONDS))
    # 20 mm in the first 2 s on a line between the two speeds, then 60 mm
    first, second = spans(SlideDataset((replace(slide, states=states),)).in_parts(2)).values()
    # 10 mm/s rising to 30 within 2 s are 40 mm, half of the whole 100 mm is reached a third of a second later
    assert first[1] == pytest.approx(2.333, abs=5e-3)
    assert second[0] == pytest.approx(first[1] + 1e-3, abs=1e-6)


def test_slides_the_other_way_are_counted_from_the_other_end() -> None:
    cut = ramps(4, speed_m_s=0.02, direction_rad=[0.0, 0.0, math.pi, math.pi]).in_parts(2)
    assert cut.names.tolist()[-2:] == ['felt/2 part 2/2', 'felt/2 part 1/2']
    assert spans(cut)['felt/2 part 2/2'][0] == 0.0


def test_positions_make_the_place_whatever_the_time() -> None:
    def at(slide: object, *x_m: float) -> object:
        state = replace(slide.states[0], steady_s=1.0, y_m=0.0)
        stamps_ns = range(state.stamp_ns, state.stamp_ns + 4 * NANOSECONDS, NANOSECONDS)
        states = [replace(state, stamp_ns=stamp, x_m=x) for stamp, x in zip(stamps_ns, x_m, strict=True)]
        return replace(slide, states=tuple(states))

    one, other = (slide for slide in ramps(4) if slide.surface == 'cork')
    cut = SlideDataset((at(one, 0.0, 0.01, 0.02, 0.03), at(other, 0.03, 0.032, 0.036, 0.04))).in_parts(2)
    assert sorted(cut.condition('place')) in (['1/2', '1/2', '2/2'], ['1/2', '2/2', '2/2'])
    assert len({slide.place for slide in cut if slide.number == 2}) == 1  # all of it lies in one half


def test_whole_slides_are_one_place_and_parts_are_cut_once() -> None:
    with pytest.raises(InvalidData, match='all are of one place'):
        ramps().condition('place')
    with pytest.raises(InvalidData, match='is a part already'):
        ramps().in_parts(2).in_parts(2)
    with pytest.raises(InvalidData, match='2 or more are needed'):
        ramps().in_parts(1)


def test_features_tell_session_and_place_of_each_slide() -> None:
    features = ramps(session='monday').in_parts(2).features(FEATURES)
    made = features.conditions['cork/1 part 2/2']
    assert (made.session, made.place) == ('monday', '2/2')


def test_the_touch_before_a_slide_belongs_to_its_first_part() -> None:
    [slide, _] = ramps().slides
    touch = replace(slide.states[0], phase=Phase.CONTACT, steady_s=1.0)
    sliding = replace(slide.states[0], stamp_ns=NANOSECONDS, steady_s=3.0)
    first, second = SlideDataset((replace(slide, states=(touch, sliding)),)).in_parts(2).samples('signal')
    assert (first.samples[0, 0], second.samples[0, 0]) == (1.0, pytest.approx(2.5, abs=2e-3))


TOUCH = ExplorationState(0, 'id', 'linear_slide', Phase.CONTACT)
SLIDE = ExplorationState(NANOSECONDS, 'id', 'linear_slide', Phase.SLIDE, 0.5, 0.1, 2.0, 0.7)
LATER = replace(SLIDE, stamp_ns=2 * NANOSECONDS)
LIFT = ExplorationState(3 * NANOSECONDS, 'id', 'linear_slide', Phase.LIFT)


def test_a_slide_lasts_from_its_first_state_to_the_lift_or_as_long_as_was_guaranteed() -> None:
    assert motion_made([TOUCH, SLIDE, LATER, LIFT]) == SlideMotion('linear_slide', 0.7, 0.1, 2.0, 2.0)
    assert motion_made([TOUCH, SLIDE, LATER]) == SlideMotion('linear_slide', 0.7, 0.1, 2.0, 1.5)


@pytest.mark.parametrize(
    'states',
    [
        [TOUCH, LIFT],
        [replace(SLIDE, motion='circular'), LIFT],
        [replace(SLIDE, speed_m_s=math.nan), LIFT],
        [replace(SLIDE, force_n=0.0), LIFT],
        [replace(SLIDE, direction_rad=math.nan), LIFT],
        [SLIDE, replace(LATER, direction_rad=1.5), LIFT],
        [replace(SLIDE, steady_s=0.0)],
    ],
)
def test_a_slide_of_which_too_little_is_known_or_that_turns_is_no_motion(states: list[ExplorationState]) -> None:
    assert motion_made(states) is None


def test_slides_in_bags_report_how_they_were_made(tmp_path) -> None:
    plan = SlidePlan(slides=2, slide_s=0.6, speed_m_s=0.05, force_n=1.5, direction_rad=0.5)
    bags = write_simulated(tmp_path, plan, np.random.default_rng(0), surfaces=['glass'])
    examples = SlideDataset.from_bags(bags).features(load_recipe('default').feature_set)
    made = SlideMotion('linear_slide', 0.5, 0.05, 1.5, pytest.approx(0.6))
    assert examples.motions == {'glass/1': made, 'glass/2': made}


def test_slides_of_two_kinds_are_refused_with_both_sensors_before_features_are_computed(monkeypatch) -> None:
    pair = [
        SlideDataset.from_arrays({'signal': arrays(channels=count)}, LABELS, {'signal': RATE_HZ}, sensor=name)
        for count, name in ((2, 'finger/a'), (3, 'finger/b'))
    ]
    mixed = SlideDataset((pair[0][0], pair[1][1]))
    monkeypatch.setattr(SlideDataset, 'windows', None)
    with pytest.raises(ModelMismatch, match=r"has .* of the sensor 'finger/b', and those before it .* of 'finger/a'"):
        mixed.features(FEATURES)
