import numpy as np
import pytest

from texture_core.types import NANOSECONDS, TactileSignal
from texture_recordings.dataset import Continuity
from texture_recordings.nodes.replay import Schedule


def test_messages_are_due_at_their_distances_divided_by_the_rate() -> None:
    schedule = Schedule(rate=5.0, longest_pause_s=1.0)
    assert [schedule.due_s(NANOSECONDS * t // 10) for t in (100, 105, 110)] == pytest.approx([0.0, 0.1, 0.2])
    assert schedule.played_s == pytest.approx(1.0)


def test_long_pauses_are_shortened() -> None:
    schedule = Schedule(rate=1.0, longest_pause_s=0.5)
    assert [schedule.due_s(NANOSECONDS * t) for t in (0, 60, 60)] == pytest.approx([0.0, 0.5, 0.5])


def test_losses_and_restarts_of_each_stream_are_counted() -> None:
    continuity = Continuity()
    for stream, first in (('a', 100), ('b', 0), ('a', 104), ('a', 110), ('a', 0), ('b', 4)):
        continuity.update(stream, TactileSignal(0, 's', ('c',), (), 1.0, first, np.zeros((4, 1), dtype=np.float32)))
    assert (continuity.lost['a'], continuity.restarts['a'], continuity.samples['a']) == (2, 1, 16)
    assert (continuity.lost['b'], continuity.restarts['b'], continuity.samples['b']) == (0, 0, 8)
