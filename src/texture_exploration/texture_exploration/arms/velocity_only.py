"""An arm that knows velocities alone and follows them late, with a force loop of ours around it."""

from __future__ import annotations

import math
from collections import deque

from texture_exploration.arms.protocol import ArmCommand, ArmState, Vector
from texture_exploration.force_control import ContactState, ForceLoop, ForceLoopParams

HOLDS_S = 0.02  # so long an arm keeps a velocity when nobody asks for another


class CommandedVelocity:
    """Choose the velocity that carries out a command: a wanted force by the force loop, a velocity as it is.

    Towards the surface a commanded velocity is limited to what the force loop can still stop in time.

    Parameters
    ----------
    params
        The force loop.
    period_s
        How often `choose` is called.
    """

    def __init__(self, params: ForceLoopParams, period_s: float) -> None:
        self._loop = ForceLoop(params, period_s)
        self._travelled_m = 0.0

    @property
    def lag_s(self) -> float:
        """How late the arm follows, as measured while it came down; NaN until it is measured."""
        return self._loop.lag.value_s

    def doubt(self) -> str:
        """Return in a sentence why nobody should press by the force of this arm, '' if one may."""
        return self._loop.doubt()

    def travelled(self, distance_m: float) -> None:
        """Take note of how far the finger has gone along the surface since the last call."""
        self._travelled_m += distance_m

    def choose(self, command: ArmCommand, state: ArmState, held_s: float) -> Vector:
        """Return the velocity to ask for, m/s.

        Parameters
        ----------
        command
            What the arm shall do.
        state
            The newest state of the arm.
        held_s
            For how long the velocity of the last call was asked for.

        Returns
        -------
        (3,)
            Along the surface and its normal, m/s.
        """
        normal_m_s = self._normal_m_s(command, state, held_s)
        self._loop.asked(state.position[2], normal_m_s, held_s)
        return (*command.tangential_m_s, normal_m_s)

    def _normal_m_s(self, command: ArmCommand, state: ArmState, held_s: float) -> float:
        contact = ContactState(state.position[2], self._travelled_m, state.force_n)
        speed_m_s = math.hypot(*command.tangential_m_s)
        self._loop.observe(contact, speed_m_s)
        if command.force_n is None:
            self._loop.restart()
            return max(command.normal_m_s, -self._loop.approach_m_s(contact.height_m))
        return self._loop.velocity_m_s(command.force_n, contact, speed_m_s, held_s)


class VelocityForceControl:
    """Ask for velocities that press as wanted, and move by what was asked a delay ago.

    Parameters
    ----------
    params
        The force loop, and its delay.
    period_s
        How often it asks.
    now_ns
        The time.
    delay_s
        After which a velocity really comes into effect; the loop is only told that of `params`.
    """

    def __init__(self, params: ForceLoopParams, period_s: float, now_ns: int, delay_s: float) -> None:
        self._velocity = CommandedVelocity(params, period_s)
        self._delayed = DelayedVelocity(delay_s, now_ns)

    def doubt(self) -> str:
        """Return in a sentence why nobody should press by the force of this arm, '' if one may."""
        return self._velocity.doubt()

    def moved_m(self, now_ns: int) -> Vector:
        """Return how far the finger has gone since this was asked last."""
        moved = self._delayed.moved_m(now_ns)
        self._velocity.travelled(math.hypot(*moved[:2]))
        return moved

    def ask(self, command: ArmCommand, state: ArmState, dt_s: float) -> None:
        """Ask for the velocity that a command needs, `dt_s` after the last time.

        Parameters
        ----------
        command
            What the arm is to do.
        state
            What the arm measured last.
        dt_s
            Time since the last call.
        """
        self._delayed.ask(state.time_ns, self._velocity.choose(command, state, min(dt_s, HOLDS_S)))


class DelayedVelocity:
    """A velocity that comes into effect late, and holds for a short time only."""

    def __init__(self, delay_s: float, now_ns: int) -> None:
        self._delay_ns = round(delay_s * 1e9)
        self._coming: deque[tuple[int, Vector]] = deque()
        self._now: Vector = (0.0, 0.0, 0.0)
        self._since_ns = self._done_ns = now_ns

    def ask(self, now_ns: int, velocity: Vector) -> None:
        """Ask for a velocity, m/s."""
        self._coming.append((now_ns + self._delay_ns, velocity))

    def moved_m(self, until_ns: int) -> Vector:
        """Return how far it goes from the last time asked until now."""
        travelled: Vector = (0.0, 0.0, 0.0)
        while self._coming and self._coming[0][0] <= until_ns:
            begin_ns, velocity = self._coming.popleft()
            travelled = self._go(travelled, begin_ns)
            self._now, self._since_ns = velocity, begin_ns
        return self._go(travelled, until_ns)

    def _go(self, travelled: Vector, until_ns: int) -> Vector:
        held_s = max(0, min(until_ns, self._since_ns + round(HOLDS_S * 1e9)) - self._done_ns) * 1e-9
        self._done_ns = max(self._done_ns, until_ns)
        x, y, z = (at + speed * held_s for at, speed in zip(travelled, self._now, strict=True))
        return x, y, z
