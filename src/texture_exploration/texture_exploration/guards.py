# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether arm, force and sensor can be believed while the finger moves, and whether the force is too high."""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from texture_core.config import param
from texture_core.errors import InvalidParameter
from texture_core.types import Phase
from texture_exploration.arms.arm import ArmCommand, ArmState, Vector
from texture_exploration.safety import MOST_FORCE_N, MOST_M, SafetyLimits

# --------------------
# Duration of a silence while the loop was running.

# After a longer gap between two steps this process slept: the age of the arm's state does not concern the arm.
GAP_NS = 50_000_000


@dataclass(frozen=True)
class Listening:
    """Start of the loop and its newest gap: after a pause of the machine a silence does not concern sensor or arm.

    Only the newest gap is left out of a silence. If every gap were, a busy machine whose steps are late again and again
    would never notice that an arm or a sensor is silent.
    """

    since_ns: int = 0
    gap_start_ns: int = 0
    gap_end_ns: int = 0

    def silence_s(self, heard_ns: int, now_ns: int) -> float:
        """Return the duration of the silence, s, without its part in the newest gap."""
        start_ns = max(heard_ns, self.since_ns)
        silent_ns = now_ns - start_ns
        # Only the part of the gap after the last message counts.
        if self.gap_end_ns > start_ns:
            silent_ns -= self.gap_end_ns - max(self.gap_start_ns, start_ns)
        return silent_ns * 1e-9


WITHOUT_GAPS = Listening()


# --------------------
# Implausible numbers of arms and sensors.


def impossible(what: str, numbers: Iterable[float], most: float, unit: str) -> str:
    """Return in a short sentence which number is implausible, '' if none is."""
    for number in numbers:
        if not math.isfinite(number):
            return f'the arm reports a {what} that is no number ({number:g})'
        if abs(number) > most:
            return f'the arm reports a {what} of {number:.3g} {unit}, which no {"sensor" if unit == "N" else "arm"} has'
    return ''


def sound(arm: ArmState, before: ArmState) -> ArmState:
    """Return the state; implausible numbers are replaced by those of `before` and make it unsafe.

    A place that stays unknown becomes old, so that the arm counts as silent; a force that stays unknown does not keep a
    finger from being lifted.
    """
    place = impossible('place', arm.position, MOST_M, 'm') or impossible('velocity', arm.velocity, MOST_M, 'm/s')
    if place:
        return replace(before, unsafe=arm.unsafe or place, fault=arm.fault)
    along_n = () if all(map(math.isnan, arm.along_n)) else arm.along_n
    force = impossible('force', (arm.force_n, *along_n), MOST_FORCE_N, 'N')
    if force:
        return replace(arm, force_n=before.force_n, along_n=before.along_n, unsafe=arm.unsafe or force)
    return arm


# --------------------
# Whether the measured force can be believed, and whether it is too high in any direction.
#
# With a frozen or drifting sensor a force loop presses without limit; with a limit of the normal force alone a wall
# does.

MIN_REPEATS = 3  # of one reading, before it can count as frozen
FROZEN_TRAVEL_M = 0.00005  # along the normal, in contact, after which a force must have changed
CONTACT_N = 0.1  # above the force in free air, which may stay the same for long
HELD_FRACTION = 0.1  # a force this close to the wanted one is being held
ZEROING_S = 0.1  # an arm may zero its force sensor at rest, or as it starts to move
BEFORE = 1000  # states before the contact
LOW_FRACTION = 0.25  # of them are below the force in free air: on a soft surface the force rises long before it counts
AFTER = 5  # readings in the upper half of the lift
MIN_RISE_M = 0.001  # a lift that was observed over a shorter distance does not show free air
WAY_S = 0.15  # of commands that count as the way into an obstacle: no arm is later
BACK_S = 0.3  # no way back takes longer
HELPS_S = 0.09  # after which the force has begun to fall, if it ever will
BACK_SPEEDS_M_S = (0.02, 0.1)  # the way back was free a moment ago: it may be as fast as the way there


class ForceWatch:
    """Compare each measured force with what the arm does.

    A reading is frozen if it stays the same to the last bit for `frozen_force_s`, in at least `MIN_REPEATS` states
    with new stamps, and this cannot be:

    - a sensor that always carries noise (`Arm.noisy_force`): at any time;
    - another arm: in contact, while the finger moves along the normal and the wanted force is not reached. The time in
      which it held the force does not count: the reading also stays until a lift that was commanded takes effect.

    The force in free air is compared before and after the slide: what differs is drift, and the true force of the slide
    was wrong by as much.
    """

    def __init__(self, limits: SafetyLimits, noisy: bool, wanted_n: float) -> None:
        self._limits = limits
        self._noisy = noisy
        self._wanted_n = wanted_n
        self._first: ArmState | None = None  # the first state with the present reading
        self._newest_ns = 0
        self._repeats = 0
        self._before: deque[float] = deque(maxlen=BEFORE)
        self._begin_ns: int | None = None
        self._lift: deque[tuple[float, float]] = deque(maxlen=BEFORE)  # height, m, and force, N

    def frozen(self, arm: ArmState, command: ArmCommand) -> str:
        """Return in a sentence that the reading is frozen, '' if not; `command` is the present command."""
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
        moves_in_contact = arm.force_n - self._free_air_n >= CONTACT_N and moved_m >= FROZEN_TRAVEL_M
        if not self._noisy and not moves_in_contact:
            return ''
        return (
            f'the measured force is frozen: it has been {arm.force_n:.3f} N for {same_s * 1e3:.0f} ms, while the '
            f'finger moved by {moved_m * 1e3:.2f} mm along the normal; check the force sensor and its cable'
        )

    def note(self, phase: Phase, arm: ArmState, command: ArmCommand) -> None:
        """Note the force in free air, before the contact and after it."""
        if phase is Phase.APPROACH:
            if self._begin_ns is None or command == ArmCommand():
                self._begin_ns = arm.time_ns
            if arm.time_ns - self._begin_ns <= ZEROING_S * 1e9:
                self._before.clear()
            self._before.append(arm.force_n)
        elif phase is Phase.LIFT:
            self._lift.append((arm.position[2], arm.force_n))

    def drifted(self) -> str:
        """Return in a sentence that the force in free air has changed over the exploration, '' if it has not.

        After it, the last forces in the upper half of the lift count: the finger still presses while it brakes, and a
        busy machine may get only few states of the lift.
        """
        if not self._before or not self._lift:
            return ''
        low_m, high_m = min(height_m for height_m, _ in self._lift), self._lift[-1][0]
        if high_m - low_m < MIN_RISE_M:
            return ''
        after = [force_n for height_m, force_n in self._lift if height_m > 0.5 * (low_m + high_m)][-AFTER:]
        before_n, after_n = self._free_air_n, statistics.median(after)
        if abs(after_n - before_n) <= self._limits.force_drift_fraction * self._wanted_n:
            return ''
        return (
            f'the force in free air was {before_n:.2f} N before the slide and {after_n:.2f} N after it: the sensor '
            'drifted, and the true force was wrong by up to the difference; let it warm up, zero it and check it'
        )

    @property
    def _free_air_n(self) -> float:
        """The force without contact, as it was before the contact; 0 until it is known."""
        return sorted(self._before)[int(LOW_FRACTION * len(self._before))] if self._before else 0.0

    def _holds(self, force_n: float, command: ArmCommand) -> bool:
        """Return whether the arm controls the force to a constant value."""
        if self._noisy:
            return False
        if command.force_n is None:
            return command.normal_m_s == 0.0
        return abs(command.force_n - force_n) <= HELD_FRACTION * command.force_n


class ForceGuard:
    """Limit the whole force, and find the way back from an obstacle.

    As long as the arm has not zeroed its force sensor, only the change since the start counts. The way back
    is that of the last commands: it needs neither the frame nor the sign of the force, nor those of the pose.
    """

    def __init__(self, limits: SafetyLimits) -> None:
        self.blocked = ''
        self._limits = limits
        self._zero: Vector | None = None  # reading of the sensor at the start, while it is not zeroed
        self._way: deque[tuple[int, ArmCommand, float]] = deque()  # with the size of the force
        self._back: ArmCommand | None = None
        self._back_ns = self._newest_ns = 0
        self._paused = False
        self._came_back = False  # there is one way back
        self._largest_n = 0.0

    def relative(self, arm: ArmState, zeroed: bool) -> ArmState:
        """Return the state with the force that counts."""
        if zeroed:
            self._zero = None
            return arm
        if self._zero is None:
            self._zero = arm.force_vector_n
        x, y, z = (now_n - zero_n for now_n, zero_n in zip(arm.force_vector_n, self._zero, strict=True))
        return replace(arm, force_n=z, along_n=(x, y))

    def violation(self, arm: ArmState, phase: Phase) -> str:
        """Return in a sentence that a force is too high, '' if none is; a lifted finger may come off with a jerk."""
        excess = self._limits.force_violation(arm)
        return excess if excess or phase is Phase.LIFT else self._limits.friction_violation(arm)

    def yielding(self, arm: ArmState, command: ArmCommand, aborted: bool) -> ArmCommand:
        """Return the command; or, after an abort, the way back as long as the finger is blocked."""
        now_ns, size_n = arm.time_ns, arm.force_size_n
        held = bool(self._limits.force_violation(arm) or self._limits.friction_violation(arm))
        if aborted and held and self._way:
            # A force that did not grow on the way, as that of a broken sensor, does not end on the way back.
            if size_n - min(before_n for _, _, before_n in self._way) > self._limits.tangential_floor_n:
                self._back = self._way_back()
                self._back_ns = self._newest_ns = now_ns
            self._way.clear()
            self._came_back = True
        if self._back is None:
            if not self._came_back:
                self._way.append((now_ns, command, size_n))
                # Counted from the newest command: after a pause of this process it is the one that led to the obstacle.
                while now_ns - self._way[0][0] > WAY_S * 1e9:
                    self._way.popleft()
            return command
        # After a pause of this process the way back has yet to take effect; only once, so that it ends.
        if now_ns - self._newest_ns > GAP_NS and not self._paused:
            self._paused, self._back_ns = True, now_ns
        self._newest_ns = now_ns
        # Half of the allowance: what is left then is no more than noise.
        self._largest_n = max(self._largest_n, size_n)
        back_s = (now_ns - self._back_ns) * 1e-9
        helps = back_s < HELPS_S or size_n < 0.95 * self._largest_n
        if size_n > 0.5 * self._limits.tangential_floor_n and back_s < BACK_S and helps:
            return self._back
        if self._back.normal_m_s < 0.0:
            self.blocked = 'the force increased while the finger rose; check the space above it and the surface pose'
        self._back = None
        return command

    def _way_back(self) -> ArmCommand | None:
        """Return the opposite of the last commands; off a surface in contact."""
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


# --------------------
# Whether samples arrive while the finger moves: a slide without them is useless.


@dataclass(frozen=True)
class SignalWatchParams:
    """Parameters of the supervision of the sensor samples."""

    watch_signal: bool = param(True, "Aborts an exploration when no samples arrive on the topics of 'signal_topics'.")
    signal_topics: str = param(
        'signal',
        "Topics whose samples are watched, separated by spaces: 'finger0/signal finger1/signal' for two fingers.",
    )
    signal_timeout_s: float = param(
        0.5, 'How long no sample may arrive before the exploration aborts.', unit='s', low=0.02, high=5.0
    )

    def __post_init__(self) -> None:
        if not self.topics:
            raise InvalidParameter("parameter 'signal_topics' is empty; name a topic, or set 'watch_signal' to false")

    @property
    def topics(self) -> tuple[str, ...]:
        """Each of the topics once."""
        return tuple(dict.fromkeys(self.signal_topics.split()))


class SignalWatch:
    """Note the last arrival of each stream; `on_samples` and `signal_fault` may be called from different threads."""

    def __init__(self, timeout_s: float, clock: Callable[[], int], topics: Sequence[str] = ('signal',)) -> None:
        self._timeout_s = timeout_s
        self._clock = clock
        self._last_samples_ns = dict.fromkeys(topics, 0)

    def on_samples(self, topic: str = 'signal') -> None:
        """Note the arrival of samples."""
        self._last_samples_ns[topic] = self._clock()

    def signal_fault(self, listening: Listening) -> str:
        """Return in a sentence which streams are silent while the loop runs, '' if none is."""
        now_ns = self._clock()
        ages_s = {topic: listening.silence_s(last, now_ns) for topic, last in self._last_samples_ns.items()}
        silent = {topic: age_s for topic, age_s in ages_s.items() if age_s > self._timeout_s}
        if not silent:
            return ''
        named = ' and '.join(f"'{topic}'" for topic in silent)
        return f'no samples on {named} for {max(silent.values()) * 1e3:.0f} ms; check the sensor; its node logs why'
