"""What every arm that carries the finger can do, whatever it is made of."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

Vector = tuple[float, float, float]  # x, y in the surface, z away from it


@dataclass(frozen=True)
class ArmState:
    """Position, velocity and normal force of the fingertip in the frame of the surface.

    `time_ns` is when the arm measured it, of CLOCK_MONOTONIC; `position` in m, `velocity` in m/s; `force_n` is the
    force normal to the surface, positive when pressing; `along_n` that of the surroundings on the finger along x and y
    of the surface, NaN if the arm measures the normal force only; `tangential_force_n` the force of the surface against
    the direction of travel, NaN if the arm does not measure it or the finger does not slide. `fault` says why the arm
    cannot move; '' if it can. For `watchdog_s` at most the arm goes on with its last velocity when it hears nothing
    more; 0 if it does not say. `unsafe` says why it must not go on although it obeys: it is to be lifted; '' if it may.
    """

    time_ns: int
    position: Vector
    velocity: Vector
    force_n: float
    fault: str = ''
    watchdog_s: float = 0.0
    tangential_force_n: float = math.nan
    along_n: tuple[float, float] = (math.nan, math.nan)
    unsafe: str = ''

    @property
    def force_vector_n(self) -> Vector:
        """The whole force on the finger, as far as the arm measures it."""
        x, y = (0.0, 0.0) if all(map(math.isnan, self.along_n)) else self.along_n
        return x, y, self.force_n

    @property
    def force_size_n(self) -> float:
        """The size of the whole force, as far as the arm measures it."""
        return math.hypot(*self.force_vector_n)


@dataclass(frozen=True)
class ArmCommand:
    """What the finger shall do from now on: a velocity along the surface, and a velocity or a force normal to it.

    `normal_m_s` is positive away from the surface. If `force_n` is given, the arm controls that pressing force instead
    and ignores `normal_m_s`: above the surface it comes down until it presses.
    """

    tangential_m_s: tuple[float, float] = (0.0, 0.0)
    normal_m_s: float = 0.0
    force_n: float | None = None


class Arm(Protocol):
    """An arm under hybrid control: velocity along the surface, velocity or force along its normal.

    A command holds until the next one, but at most for a fraction of a second: an arm without commands stops by itself.
    Any method but `close` raises DeviceError if the arm cannot be reached.
    """

    def connect(self) -> None:
        """Reach the arm and clear its faults; may be called again after `close`."""

    def close(self) -> None:
        """Stop, and let the arm go; never raises, may be called twice."""

    def state(self) -> ArmState:
        """Return the newest measured state at once; its age tells whether the arm still answers."""

    def command(self, command: ArmCommand) -> None:
        """Take over a command at once; it does not wait for the arm to follow."""

    def stop(self) -> None:
        """Stand still and hold the position, whatever the arm was doing; may be called from any thread."""


class ForceReading(enum.Enum):
    """What the measured force of an arm does by itself; decides what counts as a frozen reading.

    An arm says it by an attribute `force_reading`; one that has none counts as `CONTROLLED`, which asks least.
    """

    NOISY = enum.auto()  # never twice the same to the last bit: a force sensor finer than its noise
    MEASURED = enum.auto()  # may stay the same, but not while the finger moves along the normal in contact
    CONTROLLED = enum.auto()  # the arm may keep it the same while it follows a surface: motor currents, own force mode


@runtime_checkable
class Recoverable(Protocol):
    """An arm that knows how to come free from a fault without being connected again."""

    def recover(self) -> None:
        """Clear the fault; DeviceError if that is not possible. Whoever calls it sees that the arm may move."""


@runtime_checkable
class Checkable(Protocol):
    """An arm that can be asked whether it is there without taking control of it."""

    def check(self) -> None:
        """Return if it answers and could move; raise DeviceError, with what stands in the way, if not."""


@runtime_checkable
class Rebootable(Protocol):
    """An arm of motors that latch an error until they are rebooted."""

    def reboot(self) -> str:
        """Let go, reboot what reports an error, stay unconnected; return what was done, or raise DeviceError."""


@runtime_checkable
class Warns(Protocol):
    """An arm that tells what is not as it should be although it moves."""

    def warning(self) -> str:
        """Return it in a sentence, '' if there is nothing."""


@runtime_checkable
class Doubting(Protocol):
    """An arm that tells why a motion must end although it obeys: then the finger can still be lifted."""

    def doubt(self) -> str:
        """Return it in a sentence, '' if there is no reason."""


@runtime_checkable
class Zeroing(Protocol):
    """An arm that zeroes its force sensor itself: at rest in free air, which a rise must have shown it."""

    @property
    def zeroed(self) -> bool:
        """Whether it did since it was connected, or recovered; before, its force is no measure of contact."""


@runtime_checkable
class SurfaceBound(Protocol):
    """An arm with a base frame, in which the surface has a pose."""

    @property
    def base_frame_id(self) -> str:
        """Name of the base frame on tf."""

    @property
    def surface_pose(self) -> tuple[float, ...]:
        """Pose of the surface in the base frame: place in m, then a rotation vector in rad, (6,)."""

    def move_surface(self, pose: Sequence[float]) -> None:
        """Let go, and take over another pose of the surface, (6,); it holds from the next connection on."""


@runtime_checkable
class Counting(Protocol):
    """An arm that counts what its operator should know."""

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals by name; DeviceError if it is not connected."""


class ArmClass(Protocol):
    """A class of arms: its parameter dataclass, and how to make one from it."""

    Params: type[Any]

    def __call__(self, params: Any) -> Arm:
        """Return an arm that is not yet connected."""
