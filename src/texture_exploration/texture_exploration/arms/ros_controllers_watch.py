"""Whether the controllers of an arm still work: pose and force are fresh, somebody listens, the arm follows."""

from __future__ import annotations

import numpy as np

from texture_core.arrays import Array
from texture_exploration.arms.protocol import Vector
from texture_exploration.arms.ros_controllers_params import RosControllersParams

FOLLOW_NS = 300_000_000  # an arm with lag needs time to set off
LONGEST_NS = 3_000_000_000  # what is slower than `follow_m` in this time is no motion: a force being held
FOLLOWED_SHARE = 0.1  # a controller may limit speed and acceleration to its own


class FollowWatch:
    """Compare the way that was commanded with the way that the finger has gone.

    The comparison begins again when the commanded velocity turns back: a late arm still goes the old way for its lag,
    which is no sign of a lost controller.

    Parameters
    ----------
    follow_m
        Commanded distance after which it counts, m.
    """

    def __init__(self, follow_m: float) -> None:
        self._follow_m = follow_m
        self._begin: tuple[int, Array] | None = None
        self._asked_m: Array = np.zeros(3)

    def restart(self) -> None:
        """Begin again: nothing was commanded, or nobody looked."""
        self._begin = None

    def update(self, now_ns: int, position: Vector, velocity_m_s: Vector, held_s: float) -> str:
        """Return in a sentence that the arm does not follow, '' if it does.

        Parameters
        ----------
        now_ns
            The time.
        position : (3,)
            Of the finger, m.
        velocity_m_s : (3,)
            That was commanded until now.
        held_s
            For how long, s.

        Returns
        -------
        str
            A sentence without a full stop, or ''.
        """
        place, velocity = np.array(position), np.array(velocity_m_s)
        if self._begin is None or velocity @ self._asked_m < 0.0:
            self._begin, self._asked_m = (now_ns, place), np.zeros(3)
        self._asked_m = self._asked_m + velocity * held_s
        begin_ns, start = self._begin
        asked_m = float(np.linalg.norm(self._asked_m))
        if asked_m < self._follow_m or now_ns - begin_ns < FOLLOW_NS:
            if now_ns - begin_ns > LONGEST_NS:
                self.restart()
            return ''
        gone_m = float((place - start) @ self._asked_m) / asked_m
        took_s = (now_ns - begin_ns) * 1e-9
        self.restart()
        if gone_m >= FOLLOWED_SHARE * asked_m:
            return ''
        return f'the arm went {1e3 * gone_m:.1f} mm of the {1e3 * asked_m:.1f} mm commanded in {took_s:.1f} s'


def stale(params: RosControllersParams, now_ns: int, pose_ns: int, force_ns: int) -> str:
    """Return in a sentence that pose or force are older than the parameters allow, '' if they are not.

    Parameters
    ----------
    params
        Names of the topics and the longest allowed age.
    now_ns
        The time, ns.
    pose_ns, force_ns
        When pose and force came last, ns.

    Returns
    -------
    str
        A sentence without a full stop, or ''.
    """
    for what, topic, time_ns in (('pose', params.pose_topic, pose_ns), ('force', params.wrench_topic, force_ns)):
        age_s = (now_ns - time_ns) * 1e-9
        if age_s > params.deadman_s:
            return (
                f"no {what} has come on '{topic}' for {1e3 * age_s:.0f} ms, so zero velocity was commanded; check that "
                'its broadcaster is active'
            )
    return ''
