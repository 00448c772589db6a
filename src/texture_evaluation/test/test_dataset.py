from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import InvalidData, ModelMismatch
from texture_evaluation.evaluate import evaluate
from texture_evaluation.train import train_from_bags
from texture_features.feature_set import FeatureSet
from texture_features.windows import cut_recording
from texture_recordings.bags import BagWriter, read_bag
from texture_recordings.dataset import SlideDataset
from texture_simulation.offline import SlidePlan, write_simulated

FEATURES = FeatureSet.load('vibration-and-taxels')


def test_a_bag_gives_the_features_of_the_recording_itself(simulated: Path) -> None:
    recording = {
        topic: [value for _, _, value in read_bag(simulated / 'glass', (topic,))]
        for topic in ('exploration', *FEATURES.topics)
    }
    states = recording.pop('exploration')
    direct = [FEATURES.extract(event) for event in cut_recording(recording, states, FEATURES.windows)]
    from_bag = SlideDataset.from_bags([simulated / 'glass']).features(FEATURES)
    np.testing.assert_array_equal(from_bag.values, [vector.values for vector in direct if not vector.last])
    assert from_bag.names == direct[0].names
    # Windows of 0.5 s every 0.1 s in 1.2 s: the first starts at 0, the last at 0.7 s.
    assert len(from_bag.labels) == 6 * 8


def test_slides_are_chosen_for_each_surface(simulated: Path) -> None:
    examples = SlideDataset.from_bags([simulated], '2,5-6').features(FEATURES)
    assert set(examples.groups) == {f'{surface}/{k}' for surface in set(examples.labels) for k in (2, 5, 6)}


def test_a_missing_input_is_named(simulated: Path, tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag') as bag:
        for topic, log_ns, value in read_bag(simulated / 'glass', ('signal', 'exploration')):
            bag.write(topic, value, log_ns)
    with pytest.raises(ModelMismatch, match="has no 'signal_static', only signal; the windows need"):
        SlideDataset.from_bags([tmp_path / 'bag']).features(FEATURES)


def test_slides_without_a_whole_window_are_refused_with_a_sentence(tmp_path: Path) -> None:
    bags = write_simulated(tmp_path, SlidePlan(slides=1, slide_s=0.3), np.random.default_rng(0), surfaces=('glass',))
    with pytest.raises(InvalidData, match='none of the 1 slides has a whole window'):
        SlideDataset.from_bags(bags).features(FEATURES)


def test_lost_samples_leave_windows_out_and_no_more(simulated: Path, tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag') as bag:
        for count, (topic, log_ns, value) in enumerate(read_bag(simulated / 'glass')):
            if not (topic == 'signal' and 30 <= count < 40):
                bag.write(topic, value, log_ns)
    whole, broken = (
        SlideDataset.from_bags([path]).features(FEATURES) for path in (simulated / 'glass', tmp_path / 'bag')
    )
    assert 0 < len(broken.labels) < len(whole.labels)
    kept = {row.tobytes() for row in whole.values}
    assert all(row.tobytes() in kept for row in broken.values)


def test_a_joined_recipe_is_trained_from_bags_of_two_fingers(
    tmp_path: Path,
) -> None:
    plan = SlidePlan(slides=6, slide_s=1.2, fingers=2)
    bags = write_simulated(tmp_path, plan, np.random.default_rng(3), surfaces=('glass', 'ridge_2mm_deep'))
    model = train_from_bags('two-fingers', bags, '1-4')
    topics = ('finger0/signal', 'finger1/signal')
    assert model.recipe.feature_set.topics == topics
    slides = SlideDataset.from_bags(bags, topics=topics).slides
    for slide in slides:  # each finger has traits of its own, at the same time
        first, second = (slide.signals[topic] for topic in topics)
        assert first[0].stamp_ns == second[0].stamp_ns
        assert not np.array_equal(first[0].samples, second[0].samples)
    figures = evaluate(model, bags, '5-6').as_json()
    assert figures['window_accuracy'] > 0.9
