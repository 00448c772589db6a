# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a collection asks of the explorer, and which bag it leaves, without a robot."""

import os
import shutil
import signal
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest.mock import MagicMock, Mock

import pytest

from texture_bringup.command import main
from texture_bringup.commands import explore
from texture_bringup.operator import ExplorationResult, Interrupted
from texture_core.errors import (
    CollectionError,
    ExplorationError,
    InvalidData,
    InvalidParameter,
    LaunchFailed,
    ModelMismatch,
    MotionAborted,
    TextureError,
)
from texture_core.types import RoughnessEstimate, TextureEstimate
from texture_evaluation import collection
from texture_evaluation.collection import CollectionEnd, CollectionParams, PlaceAccuracy
from texture_recordings.bags import BagWriter, read_bag

pytestmark = pytest.mark.ros
EXPLORER = {
    'patch_x_low_m': -0.05, 'patch_x_high_m': 0.05, 'patch_y_low_m': -0.05, 'patch_y_high_m': 0.05,
    'min_force_n': 3.0, 'max_force_n': 8.0, 'max_speed_m_s': 0.03,
}  # fmt: skip
REFUSED = ExplorationError.INVALID_REQUEST, ''
ABORTED, PRESSING = ((ExplorationError.FORCE_LIMIT, 'id', lifted) for lifted in (True, False))


class Explorer:
    """Ends each touch as declared."""

    def __init__(self, *ends):
        self._ends, self.requests = list(ends), []

    def parameters(self, node, names):
        assert node == 'explorer'
        return [EXPLORER[name] for name in names]

    def watch_stops(self):
        return lambda: False

    def explore(self, request, stopped):
        assert not stopped()
        self.requests.append(request)
        end = self._ends.pop(0)
        if isinstance(end, BaseException):
            raise end
        error, name, *lifted = end
        return ExplorationResult(
            error, 'it failed', name, TextureEstimate(0, ''), RoughnessEstimate(0, ''), (), *lifted
        )


@pytest.fixture
def collected(monkeypatch, tmp_path):
    """Collect with an explorer, by a recorder that makes a bag, and may not start, end or lose samples."""

    def collected(
        explorer, *, recorder_ends=False, start=None, losses='', ends_late='', wait_for=None, record=None, **params
    ):
        recording = Mock(end=ends_late)
        recording.check.side_effect = InvalidData('the recorder died with exit code 1') if recorder_ends else None
        recording.wait_for.side_effect = wait_for or (losses if isinstance(losses, list) else lambda _name: losses)

        @contextmanager
        def recorder(_operator, bag, _namespace):
            if record:
                record(bag)
            else:
                bag.mkdir()
                (bag / 'cork.mcap').touch()
            if start:
                raise start
            yield recording

        monkeypatch.setattr(explore, 'recorder', recorder)
        return explore.collect_surface(explorer, 'cork', tmp_path, CollectionParams(**params))

    return collected


def test_forces_and_speeds_are_those_that_the_explorer_allows(collected, tmp_path):
    explorer = Explorer(REFUSED, REFUSED, REFUSED)
    collected(explorer)
    assert all(3.0 <= one.force_n <= 6.0 and 0.012 <= one.speed_m_s <= 0.03 for one in explorer.requests)
    with pytest.raises(InvalidParameter, match="'force_low_n' is 1 N; the explorer allows 3 to 8 N"):
        collected(Explorer(), force_low_n=1.0)
    assert not tmp_path.exists()


@pytest.mark.parametrize(
    ('ends', 'error', 'kept'),
    [
        ((REFUSED, REFUSED, REFUSED), CollectionError.MOTION_FAILED, False),
        ((REFUSED, ABORTED, REFUSED), CollectionError.MOTION_FAILED, False),
        ((REFUSED, PRESSING), CollectionError.MOTION_FAILED, False),  # no third touch
        ((MotionAborted('it was restarted'),), CollectionError.MOTION_FAILED, False),
        ((REFUSED, KeyboardInterrupt('lifted')), CollectionError.CANCELLED, False),  # in the middle of a touch
        (None, CollectionError.NOT_RECORDED, True),  # the recorder has ended, and the bag may be another's
    ],
)
def test_a_bag_without_any_slide_is_removed_and_the_sentence_says_so(collected, tmp_path, ends, error, kept):
    (tmp_path / 'cork').mkdir()  # of yesterday
    end, bag = collected(Explorer(*(ends or ())), recorder_ends=ends is None)
    assert (end.error, end.slides) == (error, 0)
    assert bag == (tmp_path / 'cork-2' if kept else None)
    assert sorted(one.name for one in tmp_path.iterdir()) == (['cork', 'cork-2'] if kept else ['cork'])
    assert end.message.endswith('; no slide was made, so no bag is kept') != kept


def test_touches_begin_when_the_recorder_writes_what_every_node_sends(two_surfaces: Path, tmp_path: Path) -> None:
    [recorded, _] = sorted((two_surfaces / 'bags').iterdir())
    streams = {name: value for name, _, value in read_bag(recorded, ('signal', 'exploration'))}
    bag, wanted = tmp_path / 'cork', {'finger0/signal', 'signal', 'exploration'}
    assert not explore.records(bag, 'left', wanted, lambda: None)
    writer = BagWriter(bag)
    for name in ('finger0/signal', 'finger1/signal', 'exploration', 'signal'):
        writer.write(f'/left/{name}', streams[name.rpartition('/')[2]], 1)
        writer.flush()
        assert explore.records(bag, 'left', wanted, lambda: None) == (name == 'signal')
    writer.close()


@pytest.mark.parametrize(
    ('topics', 'sentence'),
    [
        (('/exploration', '/p/exploration'), 'has the namespaces /, /p'),
        (('/exploration',), "has no 'signal', only states"),
    ],
)
def test_a_bag_in_the_folder_that_cannot_be_used_is_refused_before_the_robot_moves(
    collected, two_surfaces: Path, tmp_path: Path, topics, sentence
) -> None:
    writer, [recorded, _] = BagWriter(tmp_path / 'glass'), sorted((two_surfaces / 'bags').iterdir())
    for _, time_ns, state in read_bag(recorded, ('exploration',)):
        for topic in topics:
            writer.write(topic, state, time_ns)
    writer.close()
    explorer = Explorer(DONE)
    with pytest.raises(TextureError, match=sentence):
        collected(explorer)
    assert not explorer.requests


DONE = ExplorationError.NONE, 'id'


@pytest.mark.parametrize(
    ('change', 'kind'), [({'sensor': 'other'}, r"'other' \("), ({'sampling_rate_hz': 500.0}, '500 Hz, 1 channel')]
)
def test_a_folder_with_bags_of_another_sensor_is_refused_before_the_robot_moves(
    collected, two_surfaces: Path, tmp_path: Path, change, kind
) -> None:
    [recorded, _] = sorted((two_surfaces / 'bags').iterdir())
    shutil.copytree(recorded, tmp_path / 'glass')

    def of_now(bag: Path) -> None:
        writer = BagWriter(bag)
        for name, time_ns, value in read_bag(recorded, ('signal', 'signal_static')):
            writer.write(f'/{name}', replace(value, **change), time_ns)
        writer.close()

    explorer = Explorer(DONE)
    with pytest.raises(
        ModelMismatch, match=f"glass' is of the sensor '.*, this one is .*{kind}.*; name another folder"
    ):
        collected(explorer, record=of_now)
    assert not explorer.requests
    assert sorted(one.name for one in tmp_path.iterdir()) == ['glass']


def test_a_second_collection_into_a_folder_is_refused_until_the_first_has_ended(tmp_path: Path, capsys) -> None:
    with explore.claimed(tmp_path):
        assert main(['collect', 'cork', str(tmp_path)]) == 2
        said = capsys.readouterr().err
        assert f"another `texture collect` records into '{tmp_path}' now; wait for its end, or name another" in said
        assert tmp_path.is_dir()
    with explore.claimed(tmp_path):
        pass


ENDED = 'the exploration has ended: the motion was completed'


@pytest.mark.parametrize('ended', [False, True])
def test_a_slide_that_was_completed_before_ctrl_c_is_kept_once_it_is_on_the_disk(collected, tmp_path, ended):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # as the command does
    written = []

    def write(name):
        if not ended:
            signal.raise_signal(signal.SIGINT)
        written.append(name)
        return ''

    try:
        end, bag = collected(Explorer(Interrupted(ENDED, 'id') if ended else DONE), wait_for=write)
    finally:
        signal.signal(signal.SIGINT, before)
    assert (end.error, end.slides, bag, written) == (CollectionError.CANCELLED, 1, tmp_path / 'cork', ['id'])
    assert end.message == (f'stopped: {ENDED}' if ended else 'stopped')


def test_ctrl_c_while_the_recorder_starts_leaves_no_bag(collected, tmp_path):
    end, bag = collected(Explorer(), start=KeyboardInterrupt())
    assert (end.error, bag, tmp_path.exists()) == (CollectionError.CANCELLED, None, False)
    assert end.message == 'stopped; no slide was made, so no bag is kept'


def test_a_recorder_that_is_not_discovered_leaves_no_bag(collected, tmp_path):
    with pytest.raises(LaunchFailed, match='not discovered'):
        collected(Explorer(), start=LaunchFailed('not discovered'))
    assert not tmp_path.exists()


def test_lost_samples_are_reported_once_and_at_the_end(collected, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(explore, '_features_of', lambda _folder: None)
    monkeypatch.setattr(collection, 'evaluate_places', lambda *_: PlaceAccuracy(2, 0))
    end, bag = collected(Explorer(DONE, DONE), losses='2970 samples lost', places=2)
    assert (end.error, end.slides, bag) == (CollectionError.NONE, 2, tmp_path / 'cork')
    assert '; 2970 samples lost; windows with a gap are left out of features and training; ' in end.message
    assert capsys.readouterr().out.splitlines()[0] == '1 slide: 2970 samples lost'


KILLED = 'the recorder was killed by SIGKILL'


def test_a_slide_that_the_recorder_has_not_written_does_not_count(collected, tmp_path):
    end, bag = collected(Explorer(DONE, DONE), losses=['', InvalidData(KILLED)])
    assert (end.error, end.message, end.slides) == (CollectionError.NOT_RECORDED, KILLED, 1)
    assert bag == tmp_path / 'cork'


def test_a_recorder_that_ends_in_the_last_evaluation_is_reported(collected, monkeypatch):
    monkeypatch.setattr(explore, '_features_of', lambda _folder: None)
    monkeypatch.setattr(collection, 'evaluate_places', lambda *_: PlaceAccuracy(2, 0))
    end, _ = collected(Explorer(DONE, DONE), ends_late=KILLED, places=2)
    assert (end.error, end.slides) == (CollectionError.NOT_RECORDED, 2)
    assert end.message.startswith(f'{KILLED}; 2 places')


@pytest.mark.parametrize(
    ('last', 'cause'),
    [
        ('[INFO] [1.0] [record]: 9 messages recorded', ''),
        ('[ERROR] [1.0] [record]: no space', ': [ERROR] [1.0] [record]: no space'),
    ],
)
def test_a_recorder_that_was_killed_says_so_and_names_no_line_of_its_work_as_the_cause(tmp_path, last, cause):
    before = children()
    with explore.RecorderProcess(tmp_path / 'bag', '', tmp_path / 'log') as recording:
        [started] = children() - before
        os.kill(started, signal.SIGKILL)
        deadline_s = time.monotonic() + 10.0
        while not recording.end:
            assert time.monotonic() < deadline_s
        recording.log.write_text(f'{last}\n')
        with pytest.raises(InvalidData) as ended:
            recording.check()
    assert str(ended.value) == KILLED + cause


def children():
    """Return the processes that this thread has started."""
    return set(map(int, Path('/proc/thread-self/children').read_text().split()))


def test_a_slide_counts_when_the_recorder_has_it_on_the_disk(tmp_path, monkeypatch):
    recording = explore.RecorderProcess(tmp_path / 'bag', '', tmp_path / 'log')
    recording.log.write_text("[record]: exploration 'a' is on the disk: 9 messages recorded, nothing lost\n")
    assert recording.wait_for('a') == ''
    with recording.log.open('a') as log:
        log.write(
            "[record]: exploration 'a-2' is on the disk: 99 messages recorded, 35 samples lost (or replayed) in one\n"
        )
    assert recording.wait_for('a-2') == '35 samples lost in one'  # in brackets is what else it means in a replay
    monkeypatch.setattr(explore, 'WRITTEN_S', 0.0)
    with pytest.raises(InvalidData, match="has not written the slide 'b' within 0 s; check the disk"):
        recording.wait_for('b')


@pytest.mark.parametrize('error', CollectionError)
def test_who_was_stopped_reads_how_to_continue(error, tmp_path, monkeypatch, capsys):
    end = CollectionEnd(error, 'so it ended', 1)
    monkeypatch.setattr(explore, 'Operator', MagicMock())
    (tmp_path / 'cork').mkdir()
    monkeypatch.setattr(explore, 'collect_surface', lambda *_: (end, tmp_path / 'cork'))
    main(['collect', 'cork', str(tmp_path), '--seed', '4'])
    said = ''.join(capsys.readouterr()).splitlines()[0]
    kept = f"so it ended; 1 slide in '{tmp_path / 'cork'}'"
    following = f"; continue at other places with --seed 5, into '{tmp_path / 'cork-2'}'"
    unlike = {
        CollectionError.NONE: '',
        CollectionError.BOUND_MISSED: '',
        CollectionError.NOT_RECORDED: '; then continue at other places with --seed 5',  # the disk may be full
    }
    assert said == kept + unlike.get(error, following)
