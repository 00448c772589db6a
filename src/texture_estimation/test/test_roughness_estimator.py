import time

import numpy as np
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from texture_msgs import msg

from texture_core.features import FeatureVector
from texture_core.ros.conversions import from_msg, to_msg
from texture_core.ros.qos import ESTIMATE_QOS, FEATURE_QOS
from texture_estimation.labelled_features import LabelledFeatures
from texture_estimation.nodes.roughness_estimator import RoughnessEstimator
from texture_estimation.roughness.evidence import RoughnessEvidence
from texture_estimation.roughness.grades import Grades
from texture_estimation.roughness.recipe import RoughnessRecipe
from texture_estimation.roughness.training import train_grades

pytestmark = pytest.mark.ros
DEADLINE_S = 20.0
FINGERPRINT = 'abcd1234 signal=1000Hz*1'
NAMES = ('signal/integral/f', 'signal/bursts/f')
RECIPE = {'inputs': {'signal': {'features': ['integral', 'bursts']}}}
NO_CONTACT = {'force_n': 0.01}


@pytest.fixture(scope='module')
def model():
    """Return a model of five textures whose first feature is their grade."""
    rng = np.random.default_rng(0)
    grades = {f't{grade}': float(grade) for grade in range(1, 6)}
    labels = np.repeat(list(grades), 10)
    values = np.stack([[grades[label], 0.5] for label in labels]) + 0.1 * rng.normal(size=(50, 2))
    examples = LabelledFeatures(values, labels, labels, NAMES, FINGERPRINT, window_s=0.5, hop_s=0.5)
    return train_grades(RoughnessRecipe.from_mapping(RECIPE, 'test'), examples, Grades(grades), 'felt')


def slide(identity='e1', windows=2, grade=2.0, **more):
    """Return the vectors of a slide over a texture of this grade."""
    made = {'feature_set': FINGERPRINT, 'force_n': 2.0, **more}
    vectors = [
        FeatureVector(number * 100_000_000, identity, 0.5, 0.1, NAMES, np.array([grade, 0.5]), **made)
        for number in range(windows)
    ]
    return [*vectors, FeatureVector(10**9, identity, 0.0, 0.1, last=True)]


class Bench:
    """The node under test, and a node that plays the extractor and hears the estimates."""

    def __init__(self):
        self.node = RoughnessEstimator()
        self.peer = rclpy.create_node('peer')
        self.executor = SingleThreadedExecutor()
        for node in (self.node, self.peer):
            self.executor.add_node(node)
        self.estimates = []
        self.features = self.peer.create_publisher(msg.FeatureVector, 'features', FEATURE_QOS)
        self.peer.create_subscription(
            msg.RoughnessEstimate, 'roughness', lambda m: self.estimates.append(from_msg(m)), ESTIMATE_QOS
        )
        self.spin_until(lambda: self.features.get_subscription_count() and self.peer.count_publishers('roughness') == 1)

    def spin_until(self, condition):
        deadline = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < deadline, 'the condition did not come true in time'
            self.executor.spin_once(timeout_sec=0.05)

    def ask(self, vectors):
        """Publish vectors and return the estimates up to the final one."""
        self.estimates.clear()
        for vector in vectors:
            self.features.publish(to_msg(vector))
        self.spin_until(lambda: self.estimates and self.estimates[-1].final)
        return list(self.estimates)

    def close(self):
        self.executor.shutdown()
        for node in (self.node, self.peer):
            node.destroy_node()


@pytest.fixture
def ros(monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', '81')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    started = []

    def start(*parameters):
        arguments = [part for parameter in parameters for part in ('-p', parameter)]
        rclpy.init(args=['--ros-args', *arguments] if arguments else None)
        started.append(None)
        started[-1] = Bench()
        return started[-1]

    yield start
    for bench in started:
        if bench:
            bench.close()
        rclpy.shutdown()


def test_the_node_grades_as_the_same_vectors_do_offline(ros, model, tmp_path) -> None:
    heard = ros(f'model:={model.save(tmp_path / "m")}').ask(slide())
    evidence = RoughnessEvidence(model)
    for came, expected in zip(heard, [evidence.update(vector) for vector in slide()], strict=True):
        assert (came.valid, came.windows, came.final) == (True, expected.windows, expected.final)
        np.testing.assert_allclose((came.grade, came.grade_std), (expected.grade, expected.grade_std))
    assert heard[-1].grade == pytest.approx(2.0, abs=0.3)
    assert heard[-1].processing_s > 0.0


def test_without_contact_there_is_no_grade_but_a_reason_and_it_is_counted(ros, model, tmp_path) -> None:
    bench = ros(f'model:={model.save(tmp_path / "m")}')
    last = bench.ask(slide(windows=3, **NO_CONTACT))[-1]
    assert (last.valid, last.final) == (False, True)
    assert np.isnan(last.grade)
    assert 'no contact' in last.message
    numbers = bench.node._report()[2]
    assert (numbers['unusable_windows'], numbers['model']) == (3, 'felt')
    assert bench.ask(slide('e2'))[-1].valid


def test_a_model_may_be_given_later_and_a_bad_one_changes_nothing(ros, model, tmp_path) -> None:
    bench = ros()
    assert 'no model is loaded' in bench.ask(slide())[-1].message
    assert bench.node._report()[0] == 'WARN'
    [refused] = bench.node.set_parameters([Parameter('model', value=str(tmp_path / 'none'))])
    assert not refused.successful
    [taken] = bench.node.set_parameters([Parameter('model', value=str(model.save(tmp_path / 'm')))])
    assert taken.successful
    assert bench.ask(slide('e2'))[-1].valid


def test_broken_messages_are_counted_and_survived(ros, model, tmp_path) -> None:
    bench = ros(f'model:={model.save(tmp_path / "m")}')
    bench.features.publish(msg.FeatureVector(names=['a'], values=[1.0, 2.0]))
    assert bench.ask(slide())[-1].valid
    assert bench.node._report()[2]['broken_messages'] == 1
