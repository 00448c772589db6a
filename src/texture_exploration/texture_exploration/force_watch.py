"""Whether the measured force can be believed, and whether it is too high in any direction.

With a frozen or drifting sensor a force loop presses without limit; with a limit of the normal force alone a wall does.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from dataclasses import replace

from texture_core.exploration import Phase
from texture_exploration.arms.protocol import ArmCommand, ArmState, ForceReading, Vector
from texture_exploration.safety import SafetyLimits

MIN_REPEATS = 3  # of one reading, before it can count as frozen
CONTACT_N = 0.1  # above the force in free air, which may stay the same for long
HELD_SHARE = 0.1  # a force this close to the wanted one is being held
ZEROING_S = 0.1  # an arm may zero its force sensor while it stands, or as it moves off
BEFORE = 1000  # states before the contact
LOW_SHARE = 0.25  # of them lie below the force in free air: on a soft surface the force rises long before it counts
AFTER = 5  # readings in the upper half of the lift
MIN_RISE_M = 0.001  # a lift that was seen from less far below says nothing of free air
WAY_S = 0.15  # of commands that count as the way into an obstacle: no arm is later
BACK_S = 0.3  # no way back takes longer
HELPS_S = 0.09  # after which the force has begun to fall, if it ever will
BACK_SPEEDS_M_S = (0.02, 0.1)  # the way back was free a moment ago: it may be gone as fast as it was come
REST_NS = 50_000_000  # an arm that was told to stand still does so after this


class ForceWatch:
    """Compare each measured force with what the arm does.

    A reading is frozen if it stays the same to the last bit for `frozen_force_s`, in at least `MIN_REPEATS` states
    with new stamps, and this cannot be:

    - a sensor that always carries noise (`ForceReading.NOISY`): at any time;
    - one that may repeat itself (`MEASURED`): in contact, while the finger moves along the normal;
    - an arm that holds the force itself (`CONTROLLED`): the same, as long as the wanted force is not reached. The time
      in which it held the force does not count: the reading also stays until a lift that was commanded takes effect.

    The force in free air is compared before and after the slide: what differs is drift, and the true force of the slide
    was wrong by as much.

    Parameters
    ----------
    limits
        What counts as frozen, and how much drift is allowed.
    reading
        How the measured force of the arm behaves.
    wanted_n
        The force of the slide.
    """

    def __init__(self, limits: SafetyLimits, reading: ForceReading, wanted_n: float) -> None:
        self._limits = limits
        self._reading = reading
        self._wanted_n = wanted_n
        self._first: ArmState | None = None  # the first state with the present reading
        self._newest_ns = 0
        self._repeats = 0
        self._before: deque[float] = deque(maxlen=BEFORE)
        self._begin_ns: int | None = None
        self._lift: deque[tuple[float, float]] = deque(maxlen=BEFORE)  # height, m, and force, N

    def frozen(self, arm: ArmState, command: ArmCommand) -> str:
        """Return in a sentence that the reading is frozen, '' if not; `command` is what the arm was doing."""
        if self._first is None or arm.force_n != self._first.force_n or self._holds(arm.force_n, command):
            self._first, self._repeats, self._newest_ns = arm, 0, arm.time_ns
            return ''
        if arm.time_ns > self._newest_ns:
            self._newest_ns = arm.time_ns
            self._repeats += 1
        same_s = (arm.time_ns - self._first.time_ns) * 1e-9
        if self._repeats < MIN_REPEATS or same_s < self._limits.frozen_force_s:
            return ''
        moved_m = abs(arm.position[2] - self._first.position[2])
        if self._reading is not ForceReading.NOISY and not self._implausible(arm.force_n, moved_m):
            return ''
        return (
            f'the measured force is frozen: it has been {arm.force_n:.3f} N for {same_s * 1e3:.0f} ms, while the '
            f'finger moved by {moved_m * 1e3:.2f} mm along the normal; check the force sensor and its cable'
        )

    def note(self, phase: Phase, arm: ArmState, command: ArmCommand) -> None:
        """Take note of the force in free air, before the contact and after it.

        Parameters
        ----------
        phase
            Phase of the exploration; only approach and lift are of use.
        arm
            Newest state of the arm.
        command
            Last command of the arm.
        """
        if phase is Phase.APPROACH:
            self._note_free(arm, command)
        elif phase is Phase.LIFT:
            self._lift.append((arm.position[2], arm.force_n))

    def drifted(self) -> str:
        """Return in a sentence that the force in free air has changed over the exploration, '' if it has not."""
        after = self._forces_above()
        if not self._before or not after:
            return ''
        before_n, after_n = self._free_air_n, statistics.median(after)
        if abs(after_n - before_n) <= self._limits.force_drift_share * self._wanted_n:
            return ''
        return (
            f'the force in free air was {before_n:.2f} N before the slide and {after_n:.2f} N after it: the sensor '
            'drifted, and the true force was wrong by up to the difference; let it warm up, zero it and check it'
        )

    def _note_free(self, arm: ArmState, command: ArmCommand) -> None:
        if self._begin_ns is None or command == ArmCommand():
            self._begin_ns = arm.time_ns
        if arm.time_ns - self._begin_ns <= ZEROING_S * 1e9:
            self._before.clear()
        self._before.append(arm.force_n)

    def _forces_above(self) -> list[float]:
        """Return the last forces in the upper half of the lift.

        The finger still presses while it brakes, and a busy machine may see but few states of the lift itself.
        """
        if not self._lift:
            return []
        low_m, high_m = min(height_m for height_m, _ in self._lift), self._lift[-1][0]
        if high_m - low_m < MIN_RISE_M:
            return []
        middle_m = 0.5 * (low_m + high_m)
        return [force_n for height_m, force_n in self._lift if height_m > middle_m][-AFTER:]

    @property
    def _free_air_n(self) -> float:
        """The force without contact, as it was before the contact; 0 until it is known."""
        return sorted(self._before)[int(LOW_SHARE * len(self._before))] if self._before else 0.0

    def _implausible(self, force_n: float, moved_m: float) -> bool:
        return force_n - self._free_air_n >= CONTACT_N and moved_m >= self._limits.frozen_travel_m

    def _holds(self, force_n: float, command: ArmCommand) -> bool:
        """Return whether the arm keeps the force the same by itself."""
        if self._reading is not ForceReading.CONTROLLED:
            return False
        if command.force_n is None:
            return command.normal_m_s == 0.0
        return abs(command.force_n - force_n) <= HELD_SHARE * command.force_n


class ForceGuard:
    """Limit the whole force, and find the way back out of what the finger has met.

    As long as the arm has not zeroed its force sensor, only the change counts: since the start, or since the arm last
    stood still. The way back is that of the last commands: it needs neither the frame nor the sign of the force, nor
    those of the pose.

    Parameters
    ----------
    limits
        What is too much.

    Attributes
    ----------
    blocked : str
        In a sentence, that the force grew while the finger rose: it cannot be lifted.
    """

    def __init__(self, limits: SafetyLimits) -> None:
        self.blocked = ''
        self._limits = limits
        self._zero: Vector | None = None  # what the sensor shows at the start, while it is not zeroed
        self._moved_ns = 0
        self._way: deque[tuple[int, ArmCommand, float]] = deque()  # with the size of the force
        self._back: ArmCommand | None = None
        self._back_ns = 0
        self._came_back = False  # there is one way back
        self._largest_n = 0.0

    def relative(self, arm: ArmState, zeroed: bool, command: ArmCommand) -> ArmState:
        """Return the state with the force that counts; `command` is what the arm was doing."""
        if zeroed:
            self._zero = None
            return arm
        if command != ArmCommand():
            self._moved_ns = arm.time_ns
        if self._zero is None or arm.time_ns - self._moved_ns > REST_NS:
            self._zero = arm.force_vector_n
        x, y, z = (now_n - zero_n for now_n, zero_n in zip(arm.force_vector_n, self._zero, strict=True))
        return replace(arm, force_n=z, along_n=(x, y))

    def violation(self, arm: ArmState, phase: Phase) -> str:
        """Return in a sentence that a force is too high, '' if none is; a finger that is lifted may tear itself off."""
        excess = self._limits.force_violation(arm)
        return excess if excess or phase is Phase.LIFT else self._limits.friction_violation(arm)

    def yielding(self, arm: ArmState, command: ArmCommand, aborted: bool) -> ArmCommand:
        """Return the command; or, after an abort, the way back as long as the finger is held.

        Parameters
        ----------
        arm
            Newest state, from `relative`.
        command
            What the motion wants.
        aborted
            Whether the exploration is over but for the lift.
        """
        now_ns, size_n = arm.time_ns, arm.force_size_n
        held = bool(self._limits.force_violation(arm) or self._limits.friction_violation(arm))
        while self._way and now_ns - self._way[0][0] > WAY_S * 1e9:
            self._way.popleft()
        if aborted and held and self._way:
            # A force that did not grow on the way, as that of a broken sensor, does not end on the way back.
            if size_n - min(before_n for _, _, before_n in self._way) > self._limits.tangential_floor_n:
                self._back, self._back_ns = self._way_back(), now_ns
            self._way.clear()
            self._came_back = True
        if self._back is None:
            if not self._came_back:
                self._way.append((now_ns, command, size_n))
            return command
        # Half of the allowance: what is left then is no more than noise.
        self._largest_n = max(self._largest_n, size_n)
        back_s = (now_ns - self._back_ns) * 1e-9
        helps = back_s < HELPS_S or size_n < 0.95 * self._largest_n
        if size_n > 0.5 * self._limits.tangential_floor_n and back_s < BACK_S and helps:
            return self._back
        if self._back.normal_m_s < 0.0:
            self.blocked = 'the force grew while the finger rose; see that nothing is above it, and the surface pose'
        self._back = None
        return command

    def _way_back(self) -> ArmCommand | None:
        """Return the opposite of the last commands; away from a surface that was pressed on."""
        commands = [command for _, command, _ in self._way]
        x, y = (sum(command.tangential_m_s[axis] for command in commands) for axis in (0, 1))
        pressed = any(command.force_n is not None for command in commands)
        z = sum(command.normal_m_s for command in commands if command.force_n is None)
        size = math.hypot(x, y, z)
        if size == 0.0 and not pressed:
            return None
        fastest = max(math.hypot(*command.tangential_m_s, command.normal_m_s) for command in commands)
        speed = min(max(fastest, BACK_SPEEDS_M_S[0]), BACK_SPEEDS_M_S[1])
        x, y, z = (-speed * part / size if size else 0.0 for part in (x, y, z))
        return ArmCommand((x, y), normal_m_s=max(z, BACK_SPEEDS_M_S[0]) if pressed else z)
