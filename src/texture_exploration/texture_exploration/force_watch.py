"""Whether the measured force can be believed: with a frozen or drifting sensor a force loop presses without limit."""

from __future__ import annotations

import statistics
from collections import deque

from texture_core.exploration import Phase
from texture_exploration.arms.protocol import ArmCommand, ArmState, ForceReading
from texture_exploration.safety import SafetyLimits

MIN_REPEATS = 3  # of one reading, before it can count as frozen
CONTACT_N = 0.1  # above the force in free air, which may stay the same for long
HELD_SHARE = 0.1  # a force this close to the wanted one is being held
ZEROING_S = 0.1  # an arm may zero its force sensor while it stands, or as it moves off
BEFORE = 1000  # states before the contact
LOW_SHARE = 0.25  # of them lie below the force in free air: on a soft surface the force rises long before it counts
AFTER = 5  # readings in the upper half of the lift
MIN_RISE_M = 0.001  # a lift that was seen from less far below says nothing of free air


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
