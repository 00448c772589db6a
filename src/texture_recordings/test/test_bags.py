# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.metadata import parse_qos

from texture_core.config import MB
from texture_core.errors import InvalidData
from texture_core.types import (
    ExplorationState,
    FeatureVector,
    ModelInfo,
    Phase,
    Rejection,
    RoughnessEstimate,
    TactileSignal,
    TextureEstimate,
)
from texture_recordings.bags import (
    TYPES,
    BagWriter,
    RawMessage,
    decode,
    encode,
    find_bags,
    read_bag,
    read_named,
    topics_in,
    typestore,
)

STAMP_NS = 1_700_000_000_123_456_789


def signal(first_sample: int = 7, channels: tuple[str, ...] = ('a', 'b')) -> TactileSignal:
    samples = np.arange(5 * len(channels), dtype=np.float32).reshape(5, -1) + first_sample
    return TactileSignal(
        STAMP_NS + first_sample,
        'x/y',
        channels,
        ('count',) * len(channels),
        1000.0,
        first_sample,
        samples,
        'tip',
        tared=True,
    )


VALUES = [
    ('signal', signal()),
    ('exploration', ExplorationState(STAMP_NS, 'e1', 'linear_slide', Phase.SLIDE, 0.5, 0.1, 2.0, surface='cork')),
    ('features', FeatureVector(STAMP_NS, 'e1', 0.5, 0.1, ('f', 'g'), np.array([1.5, math.nan]), feature_set='abc')),
    ('texture', TextureEstimate(STAMP_NS, 'e1', 'cork', Rejection.NOVEL, 0.9, (0.9, 0.1), True, ('cork',), 3, 0.7)),
    ('roughness', RoughnessEstimate(STAMP_NS, 'e1', True, 3.5, 0.4)),
    ('model_info', ModelInfo(STAMP_NS, 'm', 3, ('cork', 'felt'), 'abc')),
]


def write(path: Path, count: int = 200) -> Path:
    with BagWriter(path) as bag:
        for index in range(count):
            bag.write('signal', signal(5 * index), STAMP_NS + index)
    return path


@pytest.mark.parametrize(('topic', 'value'), VALUES)
def test_what_is_written_is_read(topic: str, value: object, tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag') as bag:
        bag.write(topic, value, 42)
    ((topic_read, log_ns, read),) = read_bag(tmp_path / 'bag')
    assert (topic_read, log_ns) == (topic, 42)
    for field in dataclasses.fields(value):
        np.testing.assert_array_equal(getattr(read, field.name), getattr(value, field.name))


def test_messages_come_in_the_order_of_their_log_times_whatever_the_order_of_writing(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag') as bag:
        for log_ns in (3, 1, 2):
            bag.write('signal', signal(log_ns), log_ns)
    assert [value.first_sample for _, _, value in read_bag(tmp_path / 'bag')] == [1, 2, 3]


def test_a_bag_played_by_ros_offers_every_topic_as_the_nodes_do(tmp_path: Path) -> None:
    baseline = dataclasses.replace(signal(), stamp_ns=1)
    with BagWriter(tmp_path / 'bag') as bag:
        for topic, value in (*VALUES, ('signal_baseline', baseline)):
            bag.write(f'left/{topic}', value, 1)
    facts = yaml.safe_load((tmp_path / 'bag' / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    topics = [topic['topic_metadata'] for topic in facts['topics_with_message_count']]
    offered = {one['name'].rpartition('/')[2]: parse_qos(one['offered_qos_profiles'])[0] for one in topics}
    latched = {'texture', 'roughness', 'exploration', 'model_info', 'signal_baseline'}
    assert {name for name, qos in offered.items() if qos.durability.name == 'TRANSIENT_LOCAL'} == latched
    assert {name for name, qos in offered.items() if qos.reliability.name == 'BEST_EFFORT'} == {'signal'}


def test_topics_are_chosen_by_the_last_part_of_their_name(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag') as bag:
        bag.write('left/signal', signal(), 1)
        bag.write('left/features', VALUES[2][1], 2)
    assert [topic for topic, _, _ in read_bag(tmp_path / 'bag', ('features',))] == ['features']
    assert [message.topic for _, message in read_named(tmp_path / 'bag')] == ['/left/signal', '/left/features']


def test_of_several_namespaces_one_must_be_named(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag') as bag:
        bag.write('/left/signal', signal(1), 1)
        bag.write('/right/signal', signal(2), 2)
    with pytest.raises(InvalidData, match='/left, /right; name one'):
        list(read_bag(tmp_path / 'bag'))
    with pytest.raises(InvalidData, match="no namespace '/middle'"):
        list(read_bag(tmp_path / 'bag', namespace='middle'))
    ((_, _, value),) = read_bag(tmp_path / 'bag', namespace='/right')
    assert value.first_sample == 2


def test_the_fingers_of_an_explorer_are_of_its_namespace_and_keep_their_names(tmp_path: Path) -> None:
    state = VALUES[1][1]
    with BagWriter(tmp_path / 'bag') as bag:
        for arm in ('left', 'right'):
            bag.write(f'{arm}/exploration', state, STAMP_NS)
        for topic in ('left/finger0/signal', 'left/finger1/signal', 'right/signal'):
            bag.write(topic, signal(), STAMP_NS)
    assert topics_in(tmp_path / 'bag', 'left') == ['exploration', 'finger0/signal', 'finger1/signal']
    assert [topic for topic, _, _ in read_bag(tmp_path / 'bag', ('finger1/signal', 'signal'), 'left')] == [
        'finger1/signal'
    ]
    assert {topic for topic, _, _ in read_bag(tmp_path / 'bag', None, 'right')} == {'exploration', 'signal'}
    with pytest.raises(InvalidData, match=r'the namespaces /left, /right; name one of them \(--namespace\)'):
        topics_in(tmp_path / 'bag')


def test_without_an_explorer_each_folder_of_signals_is_a_namespace(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag') as bag:
        for topic in ('finger0/signal', 'finger1/signal'):
            bag.write(topic, signal(), STAMP_NS)
    assert [topic for topic, _, _ in read_bag(tmp_path / 'bag', namespace='finger1')] == ['signal']


def test_only_the_requested_stretch_is_read(tmp_path: Path) -> None:
    bag = write(tmp_path / 'bag', count=10)
    read = read_named(bag, start_ns=STAMP_NS + 3, stop_ns=STAMP_NS + 5)
    assert [message.log_ns - STAMP_NS for _, message in read] == [3, 4]


def test_a_bag_is_never_overwritten(tmp_path: Path) -> None:
    write(tmp_path / 'bag')
    with pytest.raises(InvalidData, match='exists already'):
        BagWriter(tmp_path / 'bag')


def test_a_bag_is_complete_even_if_writing_ended_with_an_error(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), BagWriter(tmp_path / 'bag') as bag:
        bag.write('signal', signal(), 1)
        raise RuntimeError
    assert len(list(read_bag(tmp_path / 'bag'))) == 1


def test_a_missing_bag_a_foreign_folder_and_a_foreign_file_are_refused_with_a_sentence(tmp_path: Path) -> None:
    (tmp_path / 'notes.txt').write_text('no bag')
    with pytest.raises(InvalidData, match='there is no bag'):
        list(read_bag(tmp_path / 'nothing'))
    for foreign in (tmp_path, tmp_path / 'notes.txt'):
        with pytest.raises(InvalidData, match='is not a bag; a folder'):
            list(read_bag(foreign))
    (tmp_path / 'notes.txt').rename(tmp_path / 'notes.mcap')
    with pytest.raises(InvalidData, match='it is no MCAP file, whatever its name'):
        list(read_bag(tmp_path / 'notes.mcap'))


def test_a_batch_of_many_channels_at_a_high_rate_is_read_as_it_was_written(tmp_path: Path) -> None:
    samples = np.zeros((20_000, 64), dtype=np.float32)
    signal = TactileSignal(1, 'daq', ('x',) * 64, ('V',) * 64, 200_000.0, 0, samples)
    with BagWriter(tmp_path / 'bag') as bag:
        bag.write('signal', signal, 1)
    [(_, _, read)] = read_bag(tmp_path / 'bag')
    assert read.samples.shape == samples.shape


def test_a_bag_with_other_messages_is_refused_and_an_empty_one_yields_nothing(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'empty'):
        pass
    assert list(read_bag(tmp_path / 'empty')) == []
    with BagWriter(tmp_path / 'bag') as bag:
        bag.write_raw(RawMessage('/said', 'std_msgs/msg/String', 1, b'\0\1\0\0\1\0\0\0\0'))
    with pytest.raises(InvalidData, match='holds std_msgs/msg/String; messages of texture_msgs are needed'):
        list(read_bag(tmp_path / 'bag'))


# Writes batches, brings all but the last five to the disk, and ends as requested.
WRITER = """
import os, resource, signal, sys
import numpy as np
from texture_core.errors import InvalidParameter
from texture_core.types import TactileSignal
from texture_recordings.bags import BagWriter

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
rng = np.random.default_rng(0)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), -1))
bag = BagWriter(sys.argv[1])
try:
    for number in range(105):
        samples = rng.normal(size=(100, 2)).astype(np.float32)
        bag.write('signal', TactileSignal(number, 'x', ('a', 'b'), (), 1000.0, 100 * number, samples), number)
        if number % 10 == 9:
            bag.flush()
            print(number + 1, flush=True)
except InvalidParameter:
    pass
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize('most_bytes', [10**9, 40_000], ids=['killed', 'disk full'])
def test_a_recording_that_was_cut_off_is_read_up_to_its_last_chunk(tmp_path: Path, most_bytes: int) -> None:
    command = [sys.executable, '-c', WRITER, str(tmp_path / 'bag'), str(most_bytes)]
    printed = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False).stdout.split()
    read = [value.first_sample for _, _, value in read_bag(tmp_path / 'bag')]
    assert read == [100 * number for number in range(int(printed[-1]))]
    assert (len(read) == 100) == (most_bytes > 40_000)
    assert find_bags([tmp_path]) == [tmp_path / 'bag']


@pytest.mark.parametrize('size', [0, 10, 500])
@pytest.mark.parametrize('metadata', [True, False])
def test_a_bag_that_was_cut_off_before_its_first_chunk_ended_is_refused(
    tmp_path: Path, size: int, *, metadata: bool
) -> None:
    bag = write(tmp_path / 'bag')
    os.truncate(bag / 'bag.mcap', size)
    if not metadata:
        (bag / 'metadata.yaml').unlink()
    with pytest.raises(InvalidData, match='was cut off before its first part was complete'):
        list(read_bag(bag))


def test_a_bag_with_fewer_messages_than_it_declares_is_refused_until_its_metadata_is_removed(tmp_path: Path) -> None:
    bag, file = tmp_path / 'bag', tmp_path / 'bag' / 'bag.mcap'
    with BagWriter(bag) as writer:
        for number in range(20):
            writer.write('signal', signal(5 * number), STAMP_NS + number)
            if number == 9:
                writer.flush()
                size = file.stat().st_size
    os.truncate(file, size + 20)
    with pytest.raises(InvalidData, match='10 of its messages are missing'):
        list(read_bag(bag))
    (bag / 'metadata.yaml').unlink()
    assert len(list(read_bag(bag))) == 10


def test_with_metadata_that_were_cut_off_or_garbled_the_file_is_read_alone(tmp_path: Path) -> None:
    bag = write(tmp_path / 'bag')
    metadata = bag / 'metadata.yaml'
    whole = metadata.read_bytes()
    for content in [whole[:size] for size in range(0, whole.index(b'relative_file_paths'), 20)] + [b'\x89', b'- 1']:
        metadata.write_bytes(content)
        assert len(list(read_bag(bag))) == 200
    (bag / 'bag.mcap').rename(bag / 'other.mcap')
    (bag / 'more.mcap').write_bytes(b'')
    with pytest.raises(InvalidData, match=r'its metadata\.yaml is damaged; make it again: ros2 bag reindex'):
        list(read_bag(bag))
    metadata.write_bytes(whole)
    with pytest.raises(InvalidData, match=r"its file 'bag\.mcap' is missing; copy it there, or use the rest: ros2"):
        list(read_bag(bag))


def test_a_last_chunk_whose_content_never_reached_the_disk_is_left_out(tmp_path: Path) -> None:
    writer, file = BagWriter(tmp_path / 'bag'), tmp_path / 'bag' / 'bag.mcap'
    sizes = []
    for number in range(20):
        writer.write('signal', signal(5 * number), STAMP_NS + number)
        if number in (9, 19):
            writer.flush()
            sizes.append(file.stat().st_size)
    good, (first, both) = file.read_bytes(), sizes
    for length in (0, 20, 60, 200):  # a file system may keep the length of a file, and zeros
        file.write_bytes(good[: first + length] + bytes(both - first - length))
        assert len(list(read_bag(tmp_path / 'bag'))) == 10


def test_a_bag_that_was_cut_or_has_a_flipped_bit_is_refused_or_read_as_it_was_written(tmp_path: Path) -> None:
    bag = write(tmp_path / 'bag')
    file = bag / 'bag.mcap'
    good, written = file.read_bytes(), list(read_named(bag))
    random = np.random.default_rng(3)
    damaged = [good[:size] for size in random.integers(0, len(good), 20)]
    for place, bit in zip(random.integers(0, len(good), 150), random.integers(0, 8, 150), strict=True):
        damaged.append(good[:place] + bytes([good[place] ^ 1 << bit]) + good[place + 1 :])
    refused = 0
    for content in damaged:
        file.write_bytes(content)
        try:
            assert list(read_named(bag)) == written
        except InvalidData:
            refused += 1
    assert refused > len(damaged) // 2


@pytest.mark.parametrize(
    ('mode', 'sentence'),
    [
        (CompressionMode.FILE, 'it is compressed by file, .* unpack it by ros2 bag convert'),
        (CompressionMode.MESSAGE, 'it is compressed by message, .* unpack it by ros2 bag convert'),
        (CompressionMode.STORAGE, r'unpacks from 0\.\d+ MB to more than the 200 MB that are allowed'),
    ],
)
def test_a_bag_that_is_packed_as_a_whole_or_unpacks_to_more_than_the_limit_is_refused(
    tmp_path: Path, mode: CompressionMode, sentence: str
) -> None:
    writer = Writer(tmp_path / 'bag', version=8, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection('/signal', TYPES[TactileSignal], typestore=typestore())
        for number in range(3):
            writer.write(connection, number, bytes(70 * MB))
    with pytest.raises(InvalidData, match=sentence):
        list(read_bag(tmp_path / 'bag'))


def test_a_folder_of_bags_stands_for_its_bags(tmp_path: Path) -> None:
    bags = [write(tmp_path / 'all' / name) for name in ('b', 'a')]
    assert find_bags([tmp_path / 'all']) == sorted(bags)
    with pytest.raises(InvalidData, match='no bag was given'):
        find_bags([])


@pytest.mark.parametrize('missing', [1, 8, 16])  # bytes; 8 are the whole last field
def test_a_message_that_is_cut_off_is_refused_even_where_a_field_ends(missing: int) -> None:
    state = ExplorationState(1, 'e', 'circular', Phase.SLIDE, 0.5, 0.1, 2.0, z_m=2e-3, tangential_force_n=0.6)
    with pytest.raises(InvalidData, match='bytes came as a texture_msgs/msg/ExplorationState, which they are not'):
        decode(encode(state)[:-missing], TYPES[ExplorationState])
