# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a collection asks of the explorer, and which bag it leaves, without a robot."""

import shutil
from contextlib import contextmanager
from pathlib import Path

import pytest

from texture_bringup.commands import explore
from texture_bringup.operator import ExplorationResult
from texture_core.errors import CollectionError, ExplorationError, InvalidData, InvalidParameter
from texture_core.types import RoughnessEstimate, TextureEstimate
from texture_evaluation.collection import CollectionParams
from texture_recordings.bags import BagWriter, read_bag

pytestmark = pytest.mark.ros
EXPLORER = {
    'patch_x_low_m': -0.05, 'patch_x_high_m': 0.05, 'patch_y_low_m': -0.05, 'patch_y_high_m': 0.05,
    'min_force_n': 3.0, 'max_force_n': 8.0, 'max_speed_m_s': 0.03,
}  # fmt: skip
REFUSED, ABORTED = (ExplorationError.INVALID_REQUEST, ''), (ExplorationError.FORCE_LIMIT, 'id')


class Explorer:
    """Ends each touch as declared."""

    def __init__(self, *ends):
        self._ends, self.requests = list(ends), []

    def parameters(self, node, names):
        assert node == 'explorer'
        return [EXPLORER[name] for name in names]

    def explore(self, request):
        self.requests.append(request)
        end = self._ends.pop(0)
        if isinstance(end, BaseException):
            raise end
        return ExplorationResult(end[0], 'it failed', end[1], TextureEstimate(0, ''), RoughnessEstimate(0, ''))


@pytest.fixture
def collected(monkeypatch, tmp_path):
    """Collect with an explorer, by a recorder that makes a bag, and may end."""

    def collected(explorer, recorder_ends=False, **params):
        @contextmanager
        def recorder(_operator, bag, _namespace):
            def check():
                if recorder_ends:
                    raise InvalidData('the recorder ended: no space')

            bag.mkdir()
            (bag / 'cork.mcap').touch()
            yield check

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


def test_touches_begin_when_the_recorder_writes_what_the_nodes_send(two_surfaces: Path, tmp_path: Path) -> None:
    [recorded, _] = sorted((two_surfaces / 'bags').iterdir())
    streams = {name: value for name, _, value in read_bag(recorded, explore.RECORDED)}
    bag = tmp_path / 'cork'
    assert not explore.records(bag, lambda: None)
    writer = BagWriter(bag)
    for name, complete in (('signal', False), ('exploration', True)):
        writer.write(f'/left/{name}', streams[name], 1)
        writer.flush()
        assert explore.records(bag, lambda: None) == complete
    writer.close()


def test_slides_that_reach_the_disk_late_are_waited_for(two_surfaces: Path, tmp_path: Path, monkeypatch) -> None:
    [recorded, _] = sorted((two_surfaces / 'bags').iterdir())
    bag, waits = tmp_path / recorded.name, []

    def sleep(seconds: float) -> None:
        waits.append(seconds)
        if len(waits) == 3:
            shutil.copytree(recorded, bag)

    monkeypatch.setattr(explore.time, 'sleep', sleep)
    assert explore._evaluate_bag(bag, recorded.name, 4).places == 4
    assert len(waits) == 3
