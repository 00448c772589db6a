# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Both nodes as real processes: what is replayed into the graph and recorded from it is what was in the bag."""

import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosbags.highlevel import AnyReader
from rosbags.rosbag2.metadata import parse_qos
from std_msgs.msg import String
from texture_msgs import msg
from tf2_msgs.msg import TFMessage

from texture_core.errors import InvalidData
from texture_core.ros import SENSOR_QOS, STATE_QOS, to_msg
from texture_core.ros_testing import LocalGraph, NodeProcess
from texture_core.types import ExplorationState, Phase, TactileSignal
from texture_recordings.bags import BagWriter, read_bag, read_foreign
from texture_recordings.ros import TOPICS

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

BEGIN_NS = 10**18  # in 2001
STEP_NS = 10_000_000


def write(path: Path, lost: int = 0) -> Path:
    with BagWriter(path) as bag:
        for count in range(200):
            stamp_ns = BEGIN_NS + count * STEP_NS
            state = ExplorationState(
                stamp_ns, f'slide{count // 100}', 'linear_slide', Phase.SLIDE, 0.01, surface='cork'
            )
            samples = np.full((10, 1), count, dtype=np.float32)
            first = 10 * count + (lost if count > 150 else 0)
            bag.write('exploration', state, stamp_ns)
            bag.write(
                'signal', TactileSignal(stamp_ns, 's', ('a',), (), 1000.0, first, samples), stamp_ns + STEP_NS - 1
            )
    return path


def node(name: str, domain_id: int, **parameters: object) -> NodeProcess:
    return NodeProcess('texture_recordings', name, parameters, namespace='/left', domain_id=domain_id)


def wait_for(path: Path, deadline_s: float = 30.0) -> None:
    end = time.monotonic() + deadline_s
    while not path.exists():
        assert time.monotonic() < end, f'{path} did not appear'
        time.sleep(0.05)


def test_what_is_replayed_is_recorded_whole_and_in_order(tmp_path: Path) -> None:
    source = write(tmp_path / 'source', lost=5)
    with node('record', 50, out=str(tmp_path / 'copy'), use_sim_time=True) as record:
        wait_for(tmp_path / 'copy')
        with node('replay', 50, bag=str(source), rate=5.0, clock=True, listeners='record') as replay:
            assert replay.wait(60.0) == 0, replay.output
        assert record.stop(signal.SIGTERM) == 0, record.output
    assert 'published 200 exploration, 200 signal' in replay.output
    assert '5 samples lost' in record.output
    # The first one is over when the second begins, and nothing tells that the second is.
    assert re.findall(r"exploration '(\w+)' is on the disk: \d+ messages recorded, (.*)", record.output) == [
        ('slide0', 'nothing lost')
    ]
    for topic in ('signal', 'exploration'):
        sent = [value for _, _, value in read_bag(source, (topic,))]
        got = [value for _, _, value in read_bag(tmp_path / 'copy', (topic,))]
        assert [value.stamp_ns for value in got] == [value.stamp_ns for value in sent]
    recorded_ns = [log_ns for _, log_ns, _ in read_bag(tmp_path / 'copy')]
    assert all(BEGIN_NS <= log_ns <= BEGIN_NS + 200 * STEP_NS for log_ns in recorded_ns)
    np.testing.assert_array_equal(
        [value.samples for _, _, value in read_bag(tmp_path / 'copy', ('signal',), '/left')],
        [value.samples for _, _, value in read_bag(source, ('signal',))],
    )


def test_the_rate_and_the_chosen_slides_are_kept(tmp_path: Path) -> None:
    source = write(tmp_path / 'source')
    with node('replay', 51, bag=str(source), rate=2.0, slides='2', listeners='', start_delay_s=0.0) as replay:
        assert replay.wait(60.0) == 0, replay.output
    assert 'published 100 exploration, 100 signal: 1.0 s in 0.5 s' in replay.output


def test_a_bag_is_not_replayed_where_another_node_publishes_the_same(tmp_path: Path) -> None:
    source = write(tmp_path / 'source')
    with LocalGraph(100) as graph:
        graph.peer.create_publisher(msg.TactileSignal, '/left/signal', SENSOR_QOS)
        with node('replay', 100, bag=str(source), listeners='', start_delay_s=30.0) as replay:
            assert replay.wait(60.0) == 2, replay.output
    assert "another node publishes '/left/signal'" in replay.output
    assert f'`texture launch replay bag:={source} namespace:=replay`' in replay.output
    assert 'published' not in replay.output


def test_who_only_listens_does_not_start_a_replay(tmp_path: Path) -> None:
    source = write(tmp_path / 'source')
    with LocalGraph(100) as graph:
        for topic in ('signal', 'exploration', 'features'):
            graph.listen(TOPICS[topic].type, f'/left/{topic}', TOPICS[topic].qos)
        with node('replay', 100, bag=str(source), deadline_s=3.0) as replay:
            assert replay.wait(60.0) == 2, replay.output
        found = graph.peer.get_name()
    assert f"no node 'classifier' gets the samples or their features (waited 3 s; found: {found})" in replay.output
    assert 'published' not in replay.output


def test_the_command_plays_a_bag_to_the_nodes_that_it_names(tmp_path: Path) -> None:
    run = 'replay.configure(parser); sys.exit(replay.run(parser.parse_args()))'
    script = f'import sys; from texture_recordings.commands.play import replay; parser = Parser(); {run}'
    options = ['--slides', '2', '--rate', '2', '--namespace', 'left', '--listeners', 'peer']
    with LocalGraph(100) as graph:
        received, _ = (
            graph.listen(TOPICS[name].type, f'/left/{name}', TOPICS[name].qos) for name in ('signal', 'exploration')
        )
        command = [sys.executable, '-c', f'from texture_core.cli import Parser; {script}', str(write(tmp_path / 'bag'))]
        played = subprocess.run([*command, *options], check=False, capture_output=True, text=True)
        assert played.returncode == 0, played.stderr
        graph.until(lambda: received)
    assert 'published 100 exploration, 100 signal' in played.stdout + played.stderr


def test_streams_of_other_names_transforms_and_logs_are_recorded_and_with_all_everything(tmp_path) -> None:
    wanted = {'/imu', '/signal_baseline', '/words', '/tf_static', '/rosout'}
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    batch = to_msg(TactileSignal(5, 's', ('a',), (), 1000.0, 0, np.zeros((10, 1), dtype=np.float32)))
    out, began_ns = tmp_path / 'bag', time.time_ns()

    def is_written() -> bool:
        imu.publish(batch)
        words.publish(String(data='cork'))
        graph.peer.get_logger().info('still here')
        try:
            return wanted <= {message.topic for message in read_foreign(out, lambda _: True)}
        except InvalidData:
            return False  # nothing has come to the disk yet

    with LocalGraph(100, deadline_s=60.0) as graph:
        graph.peer.create_publisher(msg.TactileSignal, 'signal_baseline', STATE_QOS).publish(batch)
        graph.peer.create_publisher(TFMessage, '/tf_static', latched).publish(TFMessage())
        imu = graph.peer.create_publisher(msg.TactileSignal, 'imu', SENSOR_QOS)
        words = graph.peer.create_publisher(String, 'words', 10)
        with NodeProcess('texture_recordings', 'record', {'out': str(out), 'all': True}, domain_id=100) as record:
            graph.until(is_written)
            assert record.stop(signal.SIGINT) == 0, record.output
    with AnyReader([out]) as reader:  # rosbags alone decodes every message, by the definitions in the bag
        assert all(reader.deserialize(data, c.msgtype) for c, _, data in reader.messages())
    facts = yaml.safe_load((out / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    topics = [topic['topic_metadata'] for topic in facts['topics_with_message_count']]
    offered = {one['name']: parse_qos(one['offered_qos_profiles'])[0].durability.name for one in topics}
    assert {offered[name] for name in ('/signal_baseline', '/tf_static', '/rosout')} == {'TRANSIENT_LOCAL'}
    assert {offered[name] for name in ('/imu', '/words')} == {'VOLATILE'}
    assert {topic for topic, _, _ in read_bag(out)} >= {'imu', 'signal_baseline'}
    assert all(log_ns > began_ns for _, log_ns, _ in read_bag(out))  # the time of this machine


def test_topics_in_the_namespace_of_another_explorer_are_not_recorded(tmp_path) -> None:
    batch = to_msg(TactileSignal(5, 's', ('a',), (), 1000.0, 0, np.zeros((10, 1), dtype=np.float32)))
    given = {'out': str(tmp_path / 'bag'), 'signal_topics': 'signal finger1/signal'}

    def topics() -> set[str]:
        try:
            return {message.topic for message in read_foreign(tmp_path / 'bag', lambda _: True)}
        except InvalidData:
            return set()  # nothing has come to the disk yet

    with LocalGraph(100, deadline_s=60.0) as graph:
        names = ('p/signal', 'p/finger1/signal', 'signal', 'finger1/signal')
        publishers = [graph.peer.create_publisher(msg.TactileSignal, name, SENSOR_QOS) for name in names]

        def is_written() -> bool:
            for publisher in publishers:
                publisher.publish(batch)
            return {'/signal', '/finger1/signal'} <= topics()

        with NodeProcess('texture_recordings', 'record', given, domain_id=100) as record:
            graph.until(is_written)
            assert record.stop(signal.SIGINT) == 0, record.output
    assert {name for name in topics() if name.endswith('signal')} == {'/signal', '/finger1/signal'}


def test_a_recording_without_a_sample_is_reported_and_ends_with_code_2(tmp_path: Path) -> None:
    script = 'from texture_core.cli import Parser, run_program; from texture_recordings.commands.play import record; '
    script += 'parser = Parser(); record.configure(parser); options = parser.parse_args(); '
    script += 'raise SystemExit(run_program(lambda: record.run(options)))'
    with LocalGraph(100, deadline_s=60.0) as graph:
        graph.peer.create_publisher(msg.TactileSignal, '/left/signal', SENSOR_QOS)
        reports = graph.listen(DiagnosticArray, '/diagnostics')
        command = [sys.executable, '-c', script, str(tmp_path / 'bag'), '--namespace', 'letf']
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as record:
            try:
                graph.until(lambda: any(one.level == DiagnosticStatus.WARN for all_ in reports for one in all_.status))
            finally:
                record.send_signal(signal.SIGINT)
            output = record.communicate(timeout=60.0)[1]
    assert record.returncode == 2, output
    sentence = "no sample came in the namespace '/letf', and sensors publish /left/signal; start the sensor"
    assert output.count(sentence) == 3  # as it is recorded, in the last line of the log, and as the error


@pytest.mark.parametrize(
    ('name', 'parameters', 'sentence'),
    [
        ('replay', {}, "parameter 'bag' is ''"),
        ('replay', {'bag': 'nowhere'}, "there is no bag 'nowhere'"),
        (
            'replay',
            {'bag': 'source', 'deadline_s': 0.2},
            "no node 'classifier' gets the samples or their features (waited 0.2 s; found: none)",
        ),
        ('record', {}, "parameter 'out' is ''"),
        ('record', {'out': 'source'}, 'exists already'),
    ],
)
def test_a_mistake_ends_the_node_with_code_2_and_a_sentence(
    name: str, parameters: dict[str, object], sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / 'source')
    monkeypatch.chdir(tmp_path)
    with node(name, 52, **parameters) as process:
        assert process.wait(60.0) == 2, process.output
    assert sentence in process.output
    assert 'Traceback' not in process.output
    assert 'FATAL' not in process.output
