# SPDX-License-Identifier: Apache-2.0
import numpy as np

from texture_core.types import NANOSECONDS, FingerState
from texture_simulation.path import FingerTrack

MS = NANOSECONDS // 1000


def advance(track: FingerTrack, ms: int):
    return track.advance(ms * MS, 10, 2000.0)


def touching(ms: int, x_m: float = 0.0, vx_m_s: float = 0.0, force_n: float = 2.0) -> FingerState:
    return FingerState(ms * MS, x_m=x_m, vx_m_s=vx_m_s, force_n=force_n)


def test_nothing_is_touched_before_anything_is_reported() -> None:
    track = FingerTrack()
    assert not advance(track, 5).force_n.any()
    assert not track.touching


def test_an_arm_silent_for_long_has_stopped_and_still_presses() -> None:
    track = FingerTrack()
    track.update(touching(0, 0.0, 0.1))
    advance(track, 150)
    moved = advance(track, 250)
    later = advance(track, 300)
    assert np.ptp(later.x_m) == 0.0
    assert later.x_m[0] == moved.x_m[-1]
    assert later.force_n.tolist() == [2.0] * 10


def test_being_put_elsewhere_is_no_slide() -> None:
    track = FingerTrack()
    track.update(touching(0))
    advance(track, 5)
    track.update(touching(5, x_m=0.2))
    assert advance(track, 10).x_m.tolist() == [0.2] * 10
