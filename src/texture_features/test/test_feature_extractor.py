# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import json
from dataclasses import replace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from texture_msgs import msg

from texture_core.ros import FEATURE_QOS, SENSOR_QOS, STATE_QOS, from_msg, to_msg
from texture_core.ros_testing import LocalGraph
from texture_core.types import NANOSECONDS, ExplorationState, Phase, TactileSignal
from texture_features.feature_set import FeatureSet
from texture_features.nodes.feature_extractor import FeatureExtractor
from texture_features.windows import cut_recording

pytestmark = pytest.mark.ros
RATE_HZ = 1000.0


class Bench:
    """The node under test, and a peer that plays the sensor and the explorer and hears the features."""

    def __init__(self, graph, recipe='default', topics=('signal',)):
        self.graph, peer = graph, graph.peer
        self.node = graph.add(FeatureExtractor, recipe=recipe)
        self._features = graph.listen(msg.FeatureVector, 'features', FEATURE_QOS)
        self.reports = graph.listen(DiagnosticArray, '/diagnostics')
        self.of_topics = {topic: peer.create_publisher(msg.TactileSignal, topic, SENSOR_QOS) for topic in topics}
        self.signals = self.of_topics[topics[0]]
        self.states = peer.create_publisher(msg.ExplorationState, 'exploration', STATE_QOS)
        self.until = graph.until
        self.until(
            lambda: (
                all(publisher.get_subscription_count() for publisher in self.of_topics.values())
                and self.states.get_subscription_count()
                and peer.count_publishers('features') == 1
            )
        )

    @property
    def features(self):
        return [from_msg(message) for message in self._features]

    def play(self, batches):
        """Publish the batches of each topic in the order of time."""
        pairs = [(topic, batch) for topic in batches for batch in batches[topic]]
        for topic, batch in sorted(pairs, key=lambda pair: pair[1].stamp_ns):
            self.of_topics[topic].publish(to_msg(batch))
            self.graph.spin_once(0.02)


def test_a_start_with_the_correction_of_a_finger_says_so(tmp_path, capfd):
    (tmp_path / 'mine.json').write_text(json.dumps({'recipe': FeatureSet.load('default').as_mapping()}))
    (tmp_path / 'mine.correction.json').write_text('{"signal": {"frequencies_hz": [1.0], "response_db": [[6.0]]}}')
    with LocalGraph(69) as graph:
        graph.add(FeatureExtractor, recipe='default')
        assert 'corrected' not in capfd.readouterr().err
        graph.add(FeatureExtractor, recipe=str(tmp_path / 'mine.json'))
    assert f"the finger is corrected by '{tmp_path}/mine.correction.json'" in capfd.readouterr().err


@pytest.fixture
def bench():
    with LocalGraph(69) as graph:
        yield Bench(graph)


def recording(seconds=1.0, rate_hz=RATE_HZ, channels=('c',), begin_s=0.0, seed=0):
    samples = np.random.default_rng(seed).normal(size=(round(seconds * rate_hz), len(channels))).astype(np.float32)
    begin_ns, step = NANOSECONDS + round(begin_s * NANOSECONDS), round(rate_hz / 10)
    parts = [(first, samples[first : first + step]) for first in range(0, len(samples), step)]
    return [
        TactileSignal(begin_ns + round(first / rate_hz * NANOSECONDS), 's', channels, (), rate_hz, first, part, 'tip')
        for first, part in parts
    ]


def slide(steady_s=0.8):
    return ExplorationState(NANOSECONDS, 'e1', 'linear_slide', Phase.SLIDE, steady_s, 0.1, 2.0)


def lift(at_s=0.8):
    return ExplorationState(NANOSECONDS + round(at_s * NANOSECONDS), 'e1', 'linear_slide', Phase.LIFT)


def test_the_node_publishes_what_the_same_recording_gives_offline(bench):
    bench.states.publish(to_msg(slide()))
    bench.until(lambda: bench.node._cutter._slides)
    bench.play({'signal': recording()})
    bench.until(lambda: len(bench.features) == 4)
    bench.states.publish(to_msg(lift()))
    bench.until(lambda: bench.features and bench.features[-1].last)
    assert {received.frame_id for received in bench.features} == {'tip'}
    feature_set = FeatureSet.load('default')
    events = cut_recording({'signal': recording()}, [slide(), lift()], feature_set.windows)
    for received, expected in zip(bench.features, map(feature_set.extract, events), strict=True):
        np.testing.assert_array_equal(received.values, expected.values)
        for name in ('start_ns', 'names', 'feature_set'):
            assert getattr(received, name) == getattr(expected, name)


def test_a_slide_whose_sensor_died_ends_all_the_same(bench):
    bench.states.publish(to_msg(slide()))
    bench.states.publish(to_msg(lift()))
    bench.until(lambda: bench.features and bench.features[-1].last)
    assert bench.features[-1].skipped == 4
    assert [vector.sequence for vector in bench.features] == list(range(len(bench.features)))
    assert bench.node._report()[2]['listeners'] == bench.graph.peer.get_name()
    bench.until(lambda: any('no message yet on signal' in report.status[0].message for report in bench.reports))


def test_broken_messages_are_counted_and_survived(bench):
    bench.signals.publish(msg.TactileSignal(sensor='s', channels=['a', 'b'], sampling_rate_hz=1000.0, samples=[1.0]))
    bench.states.publish(msg.ExplorationState(phase=99))
    bench.until(lambda: bench.node._invalid == 2)
    bench.states.publish(to_msg(slide()))
    bench.until(lambda: bench.node._cutter._slides)
    bench.play({'signal': recording()})
    bench.until(lambda: len(bench.features) == 4)


def test_known_losses_are_counted_and_those_of_a_restart_named_as_unknown(bench):
    for first_sample in (0, 20, 90, 0):  # 50 samples are missing, then the bridge was started again
        bench.node._on_signal('signal', to_msg(replace(recording(0.02)[0], first_sample=first_sample)))
    level, sentence, numbers = bench.node._report()
    assert level == 'WARN'
    assert sentence.startswith('50 samples lost, and unknown losses in a restart of a driver or bridge')
    assert (numbers['lost_samples'], numbers['restarts']) == (50, 1)
    assert bench.node._report()[:2] == ('OK', 'extracting')


FINGERS = ('finger0/signal', 'finger0/signal_static', 'finger1/signal', 'finger1/signal_static')


def test_two_fingers_are_joined_by_their_stamps_into_the_16_numbers_of_kaboli():
    with LocalGraph(69) as graph:
        bench = Bench(graph, recipe='kaboli-svm-two-fingers', topics=FINGERS)
        # the second finger's numbering begins later: only its stamps show which samples belong together
        kinds = {'signal': (2200.0, ('pac',)), 'signal_static': (100.0, ('tdc', 'tac', 'electrode1'))}
        batches = {}
        for number, topic in enumerate(FINGERS):
            rate_hz, channels = kinds[topic.rpartition('/')[2]]
            late_s = 0.05 * ('1/' in topic)
            batches[topic] = recording(3.0 - late_s, rate_hz, channels, late_s, number)
        bench.states.publish(to_msg(slide(2.5)))
        bench.until(lambda: bench.node._cutter._slides)
        bench.play(batches)
        bench.until(lambda: len(bench.features) >= 5)
        received = bench.features[0]
    assert len(received.values) == 16
    one_finger = FeatureSet.load('kaboli-svm')
    for finger in ('finger0', 'finger1'):
        alone = {topic.rpartition('/')[2]: signals for topic, signals in batches.items() if topic.startswith(finger)}
        events = cut_recording(alone, [slide(2.5), lift(2.5)], one_finger.windows)
        expected = next(one_finger.extract(event) for event in events if event.start_ns == received.start_ns)
        found = [value for name, value in zip(received.names, received.values, strict=True) if name.startswith(finger)]
        np.testing.assert_allclose(found, expected.values)


def test_a_recipe_that_sees_the_level_warns_of_a_sensor_that_is_not_tared_and_stops_when_it_is():
    """Shares of the load are none while the level without contact is in them."""
    with LocalGraph(69) as graph:
        bench = Bench(graph, recipe='taxels-any-day', topics=('signal_static',))
        for tared, expected in ((False, "expects 'signal_static' tared"), (True, 'extracting')):
            samples = np.zeros((10, 4), dtype=np.float32)
            batch = TactileSignal(NANOSECONDS, 'skin', tuple('abcd'), (), 100.0, 0, samples, tared=tared)
            bench.play({'signal_static': [batch]})
            bench.until(lambda: bench.reports and expected in bench.reports[-1].status[0].message)  # noqa: B023
