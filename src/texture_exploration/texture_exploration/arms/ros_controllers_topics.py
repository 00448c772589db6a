"""What an arm driven by ROS controllers exchanges with them, without ROS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from texture_exploration.arms.protocol import Vector


@dataclass(frozen=True)
class PoseSample:
    """A measured pose: `position_m` in the frame `frame_id`, `rotation` as the quaternion x, y, z, w.

    `stamp_ns` is the time of its header, on the clock of the sender; 0 if there is none. `age_ns` is its age by that
    stamp and the clock of this machine, which may not agree; 0 if there is no stamp.
    """

    stamp_ns: int
    frame_id: str
    position_m: Vector
    rotation: tuple[float, float, float, float]
    age_ns: int = 0


@dataclass(frozen=True)
class ForceSample:
    """A measured force, N, in the frame `frame_id`; `stamp_ns` and `age_ns` as of a pose."""

    stamp_ns: int
    frame_id: str
    force_n: Vector
    age_ns: int = 0


class ControllerTopics(Protocol):
    """The topics of the controllers; `texture_exploration.ros.controller_topics` makes them."""

    def newest_pose(self) -> PoseSample | None:
        """Return the newest pose that came since the last call, None if none did."""

    def newest_force(self) -> ForceSample | None:
        """Return the newest force that came since the last call, None if none did."""

    def listeners(self) -> int:
        """Return how many nodes listen to the commanded velocities."""

    def unsafe(self) -> str:
        """Return why the arm must not go on although it obeys: another commands it, or no guard would stop it."""

    def beat(self, *, moving: bool) -> None:
        """Tell the guard that the commanding process lives, in each period, and whether the arm would go on alone."""

    def send_velocity(self, velocity_m_s: Vector) -> None:
        """Command a velocity in the frame `twist_frame_id`."""

    def send_force(self, force_n: Vector) -> None:
        """Command the force of the tool on its surroundings in the base frame; no effect without such a topic."""

    def switch_controllers(self, activate: Sequence[str], deactivate: Sequence[str]) -> None:
        """Let the controller manager switch both sets or nothing; DeviceError, with the reason, if it does not."""

    def close(self) -> None:
        """Wait until what was sent has arrived, at most for a fraction of a second, and leave."""
