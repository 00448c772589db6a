import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from texture_msgs import msg

from texture_core.exploration import ExplorationState, Phase
from texture_core.ros.conversions import from_msg, to_msg
from texture_core.ros.local_graph import LocalGraph
from texture_core.ros.qos import FEATURE_QOS, SENSOR_QOS, STATE_QOS
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_features.feature_set import FeatureSet
from texture_features.nodes.feature_extractor import FeatureExtractor
from texture_features.windowing.windows import cut_recording

pytestmark = pytest.mark.ros
RATE_HZ = 1000.0


class Bench:
    """The node under test, and a peer that plays the sensor and the explorer and hears the features."""

    def __init__(self, graph):
        self.graph, peer = graph, graph.peer
        self.node = graph.add(FeatureExtractor, recipe='default')
        self._features = graph.listen(msg.FeatureVector, 'features', FEATURE_QOS)
        self.reports = graph.listen(DiagnosticArray, '/diagnostics')
        self.signals = peer.create_publisher(msg.TactileSignal, 'signal', SENSOR_QOS)
        self.states = peer.create_publisher(msg.ExplorationState, 'exploration', STATE_QOS)
        self.until = graph.until
        self.until(lambda: self.signals.get_subscription_count() and peer.count_publishers('features') == 1)

    @property
    def features(self):
        return [from_msg(message) for message in self._features]

    def play(self, batches):
        for batch in batches:
            self.signals.publish(to_msg(batch))
            self.graph.spin_once(0.02)


@pytest.fixture
def bench():
    with LocalGraph(69) as graph:
        yield Bench(graph)


def recording(seconds=1.0):
    samples = np.random.default_rng(0).normal(size=(round(seconds * RATE_HZ), 1)).astype(np.float32)
    return [
        TactileSignal(
            NANOSECONDS + round(first / RATE_HZ * NANOSECONDS),
            's',
            ('c',),
            (),
            RATE_HZ,
            first,
            samples[first : first + 20],
            'tip',
        )
        for first in range(0, len(samples), 20)
    ]


def slide(steady_s=0.8):
    return ExplorationState(NANOSECONDS, 'e1', 'linear_slide', Phase.SLIDE, steady_s, 0.1, 2.0)


def lift(at_s=0.8):
    return ExplorationState(NANOSECONDS + round(at_s * NANOSECONDS), 'e1', 'linear_slide', Phase.LIFT)


def test_the_node_publishes_what_the_same_recording_gives_offline(bench):
    bench.states.publish(to_msg(slide()))
    bench.until(lambda: bench.node._cutter._slides)
    bench.play(recording())
    bench.until(lambda: len(bench.features) == 4)
    bench.states.publish(to_msg(lift()))
    bench.until(lambda: bench.features and bench.features[-1].last)
    assert {received.frame_id for received in bench.features} == {'tip'}
    feature_set = FeatureSet.load('default')
    events = cut_recording({'signal': recording()}, [slide(), lift()], feature_set.windows)
    for received, expected in zip(bench.features, map(feature_set.extract, events), strict=True):
        np.testing.assert_array_equal(received.values, expected.values)
        assert (received.start_ns, received.names, received.feature_set) == (
            expected.start_ns,
            expected.names,
            expected.feature_set,
        )


def test_a_slide_whose_sensor_died_ends_all_the_same(bench):
    bench.states.publish(to_msg(slide()))
    bench.states.publish(to_msg(lift()))
    bench.until(lambda: bench.features and bench.features[-1].last)
    assert bench.features[-1].skipped == 4
    assert [vector.sequence for vector in bench.features] == list(range(len(bench.features)))
    bench.until(lambda: any('nothing has come yet on signal' in report.status[0].message for report in bench.reports))


def test_broken_messages_are_counted_and_survived(bench):
    bench.signals.publish(msg.TactileSignal(sensor='s', channels=['a', 'b'], sampling_rate_hz=1000.0, samples=[1.0]))
    bench.states.publish(msg.ExplorationState(phase=99))
    bench.until(lambda: bench.node._invalid == 2)
    bench.states.publish(to_msg(slide()))
    bench.until(lambda: bench.node._cutter._slides)
    bench.play(recording())
    bench.until(lambda: len(bench.features) == 4)
