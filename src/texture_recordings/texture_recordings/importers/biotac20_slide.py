"""A slide of the BioTac data set, and how the finger moved in it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from texture_core.arrays import AnyArray
from texture_core.exploration import ExplorationState, Phase
from texture_core.signal import NANOSECONDS

FRAME_NS = 10_000_000  # a frame every 10 ms; its recorded times jitter by the host's scheduling
# Every slide is cut to the length of the shortest material, or its length would tell the label. The finger runs at
# speed from the first frame on.
SLIDE_FRAMES = 600
LONGEST_S = 1000.0  # of one slide; frames that are missing are counted, however many


LAST_EPOCH_S = 2.0**31 - 1e6  # a stamp of ROS has 31 bits for seconds, and all slides follow each other
NORMAL_FORCE = 2  # column of `wrench`: y of the tool, the one component that presses whatever the direction of travel


@dataclass(frozen=True, eq=False)
class BiotacSlide:
    """One slide as recorded; the fields of the arrays are named as in the files.

    Examples
    --------
    >>> frames, velocity, wrench = np.zeros((3, 44)), np.zeros((5, 4)), np.zeros((5, 7))
    >>> slide = BiotacSlide('material01', '1', frames, np.array([0.0, 0.01, 0.05]), velocity, wrench, epoch=0.0)
    >>> slide.frames.shape
    (3, 44)
    """

    surface: str
    slide: str
    frames: AnyArray  # (n_frames, 44) counts
    frame_time: AnyArray  # (n_frames,) s
    velocity: AnyArray  # (m, 4): time s, x, y, z m/s
    wrench: AnyArray  # (k, 7): time s, fx, fy, fz N, tx, ty, tz N m
    epoch: float  # Unix time of the first frame, s

    def __post_init__(self) -> None:
        columns = {'frames': 44, 'velocity': 4, 'wrench': 7}
        wrong = [name for name, count in columns.items() if np.shape(getattr(self, name))[1:] != (count,)]
        if wrong or self.frame_time.shape != (len(self.frames),) or not len(self.frames):
            raise ValueError(f"the arrays of '{self.slide}' have the shapes of no slide")
        if not np.isfinite(self.frame_time).all() or np.ptp(self.frame_time) > LONGEST_S:
            raise ValueError(f"the frames of '{self.slide}' are not within {LONGEST_S:g} s")
        if not 0 <= self.epoch < LAST_EPOCH_S:
            raise ValueError(f"'{self.slide}' began at {self.epoch:g} s; Unix time from 0 is needed")


@dataclass(frozen=True, eq=False)
class BiotacSlideMotion:
    """Speed, direction and normal force over the time of one slide.

    Examples
    --------
    >>> velocity, wrench = np.array([[0.0, 0.0, 0.02, 0.0]]), np.zeros((1, 7))
    >>> slide = BiotacSlide('cork', '1', np.zeros((1, 44)), np.zeros(1), velocity, wrench, epoch=0.0)
    >>> BiotacSlideMotion.of(slide).state(0, 0, 10).speed_m_s
    0.02
    """

    named: ExplorationState
    velocity: AnyArray
    wrench: AnyArray

    @classmethod
    def of(cls, recording: BiotacSlide) -> BiotacSlideMotion:
        """Return the motion of a slide, without what was not measured."""
        velocity = recording.velocity[np.isfinite(recording.velocity).all(axis=1)]
        wrench = recording.wrench[np.isfinite(recording.wrench).all(axis=1)]
        x, y = velocity[:, 1:3].mean(axis=0) if len(velocity) else (math.nan, math.nan)
        name = f'{recording.surface}/{recording.slide}'
        named = ExplorationState(
            0, name, 'linear_slide', Phase.SLIDE, direction_rad=math.atan2(y, x), surface=recording.surface
        )
        return cls(named, velocity, wrench)

    def state(self, start_ns: int, stamp_ns: int, end_ns: int) -> ExplorationState:
        """Return the state that holds from `stamp_ns` to `end_ns` of a slide that began at `start_ns`.

        Parameters
        ----------
        start_ns, stamp_ns, end_ns
            Times on one clock.

        Returns
        -------
        ExplorationState
        """
        time_s = (stamp_ns - start_ns) / NANOSECONDS
        speed = np.hypot(self.velocity[:, 1], self.velocity[:, 2])
        return replace(
            self.named,
            stamp_ns=stamp_ns,
            steady_s=(end_ns - stamp_ns) / NANOSECONDS,
            speed_m_s=_at(time_s, self.velocity[:, 0], speed),
            force_n=_at(time_s, self.wrench[:, 0], self.wrench[:, NORMAL_FORCE]),
            progress=(stamp_ns - start_ns) / (SLIDE_FRAMES * FRAME_NS),
        )


def _at(time_s: float, times: AnyArray, values: AnyArray) -> float:
    return float(np.interp(time_s, times, values)) if len(times) else math.nan
