# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Checks that a finger keeps contact, moves as commanded, and slides as requested."""

from __future__ import annotations

import math
import statistics
from collections import deque
from dataclasses import replace

from texture_core.errors import ExplorationError, MotionAborted
from texture_exploration.arms.arm import ArmState
from texture_exploration.touch import TouchParams

# --------------------
# Whether the finger still touches the surface while it moves along it.


class ContactLost(MotionAborted):
    """The finger has been off the surface for longer than is allowed."""


class ContactWatch:
    """Decide from the measured force whether the finger touches, and for how long it has not.

    A force below `lost_force_fraction` of the wanted one counts as no contact. Gaps up to `lost_contact_s` are bounces,
    which a rough surface causes; a longer one is a lost surface. Time is that of the arm's states, so a pause of this
    machine is no loss.
    """

    def __init__(self, force_n: float, touch: TouchParams) -> None:
        self._force_n = force_n
        self._least_n = touch.lost_force_fraction * force_n
        self._longest_s = touch.lost_contact_s
        self._lost_ns: int | None = None
        self._force_now_n = force_n

    @property
    def touching(self) -> bool:
        """Whether the newest state was one with contact."""
        return self._lost_ns is None

    def update(self, arm: ArmState) -> None:
        """Take a state of the arm."""
        self._force_now_n = arm.force_n
        # Written so that NaN is no contact.
        if arm.force_n >= self._least_n:
            self._lost_ns = None
            return
        if self._lost_ns is None:
            self._lost_ns = arm.time_ns
        lost_s = (arm.time_ns - self._lost_ns) * 1e-9
        if lost_s >= self._longest_s:
            self.refuse(lost_s)

    def refuse(self, lost_s: float = 0.0) -> None:
        """Raise ContactLost in a sentence."""
        since = f' for {lost_s * 1e3:.0f} ms' if lost_s else ''
        raise ContactLost(
            f'the contact with the surface was lost{since}: the force is {self._force_now_n:.2f} N of '
            f'{self._force_n:g} N; check that the surface continues along the whole path, or raise '
            "'lost_contact_s' if it is rough"
        )


# --------------------
# Whether the finger moves along the surface as commanded, and whether the slide was as requested.

PEAK_NS = 50_000_000  # averaging time of the speed: motors step
FORCES = 3  # newest normal forces, of which the middle one counts: one alone may be wrong
LONGEST_STEP_NS = 50_000_000  # a command that was given longer ago may have run out: the comparison starts again


class StallWatch:
    """Compare the distance of the finger with the commanded one, over the last `stall_s`.

    Only the way in the commanded direction counts, so that noise of the position does not add up, and a finger that
    goes to and fro may turn. Time is that of the arm's states; after a pause of this machine the comparison starts
    again.
    """

    def __init__(self, touch: TouchParams) -> None:
        self._touch = touch
        self._ways: deque[tuple[int, float, float]] = deque()  # time, ns, and ways commanded and made so far, m
        self._velocity = (0.0, 0.0)  # commanded last
        self._place = (0.0, 0.0)

    def update(self, arm: ArmState, velocity_m_s: tuple[float, float]) -> None:
        """Take a state of the arm, and the velocity that is commanded from now on."""
        x, y, _ = arm.position
        if not self._ways or arm.time_ns - self._ways[-1][0] > LONGEST_STEP_NS:
            self._ways.clear()
            self._ways.append((arm.time_ns, 0.0, 0.0))
        elif arm.time_ns > self._ways[-1][0]:
            self._add(arm.time_ns, x - self._place[0], y - self._place[1])
            self._check(arm.time_ns)
        self._place, self._velocity = (x, y), velocity_m_s

    def _add(self, time_ns: int, x_m: float, y_m: float) -> None:
        before_ns, commanded_m, made_m = self._ways[-1]
        vx, vy = self._velocity
        speed = math.hypot(vx, vy)
        commanded_m += speed * (time_ns - before_ns) * 1e-9
        made_m += (vx * x_m + vy * y_m) / speed if speed > 0 else 0.0
        self._ways.append((time_ns, commanded_m, made_m))

    def _check(self, now_ns: int) -> None:
        begin_ns = now_ns - round(self._touch.stall_s * 1e9)
        if self._ways[0][0] > begin_ns:
            return
        while self._ways[1][0] <= begin_ns:
            self._ways.popleft()
        commanded_m, made_m = (now - then for now, then in zip(self._ways[-1][1:], self._ways[0][1:], strict=True))
        # Written so that NaN is a stall.
        if made_m >= self._touch.stall_speed_fraction * commanded_m:
            return
        raise MotionAborted(
            f'the finger stalled: in {self._touch.stall_s * 1e3:.0f} ms it moved by {made_m * 1e3:.2f} of '
            f'{commanded_m * 1e3:.2f} mm; check what blocks it, and whether the robot or its operator reduces its speed'
        )


class SlideWatch:
    """Compare mean and peak of speed and normal force of a slide with the request.

    The speed is that from place to place, where the path has a constant one: not in turns.
    """

    def __init__(self, speed_m_s: float, force_n: float, touch: TouchParams) -> None:
        self._speed_m_s, self._force_n = speed_m_s, force_n
        self._touch = touch
        # A slide begins within twice the tolerance, so a smaller fraction would refuse accepted starts.
        self._mean_force_fraction = max(touch.mean_force_fraction, 2 * touch.force_tolerance)
        self._recent: deque[ArmState] = deque()  # over PEAK_NS of constant speed
        self._forces: deque[float] = deque(maxlen=FORCES)
        self._chunk: ArmState | None = None  # where the present piece of the mean speed began
        self._way_m = self._way_s = 0.0
        self._force_sum_n, self._states = 0.0, 0
        self._most = (1 + touch.peak_force_fraction) * force_n, (1 + touch.peak_speed_fraction) * speed_m_s
        self._peaks = [0.0, 0.0]  # force and speed

    def update(self, arm: ArmState, constant: bool) -> bool:
        """Take a state; return whether it is within the tolerance of the request."""
        if arm.place_ns:  # a force that is older than the place is no speed
            arm = replace(arm, time_ns=arm.place_ns)
        last_ns = self._recent[-1].time_ns if self._recent else 0
        self._states += 1
        self._force_sum_n += arm.force_n
        self._forces.append(arm.force_n)
        if not (constant and 0 <= arm.time_ns - last_ns <= LONGEST_STEP_NS):  # below 0: a clock was set back
            self._recent.clear()
            self._chunk = None
        if not self._recent or arm.time_ns > last_ns:
            self._recent.append(arm)
        while arm.time_ns - self._recent[0].time_ns > PEAK_NS:
            self._recent.popleft()
        self._add_way(arm)
        now = [statistics.median(self._forces), self._fast_m_s()]
        self._peaks = [max(peak, value) for peak, value in zip(self._peaks, now, strict=True)]
        return all(value <= most for value, most in zip(now, self._most, strict=True))

    def flaw(self) -> str:
        """Return in a sentence the request and the measurement if they differ too much, '' if not."""
        flaws: list[str] = []
        touch, asked_n, asked_m_s = self._touch, self._force_n, self._speed_m_s
        mean_n = self._force_sum_n / max(1, self._states)
        if not abs(mean_n - asked_n) <= self._mean_force_fraction * asked_n:  # so NaN is none
            flaws.append(
                f'the mean force of the slide was {mean_n:.2f} N, more than {self._mean_force_fraction:.0%} off the '
                f'{asked_n:g} N requested; slide more slowly, or check the force '
                'control of the arm'
            )
        mean_m_s = self._way_m / self._way_s if self._way_s else asked_m_s
        if not abs(mean_m_s - asked_m_s) <= touch.mean_speed_fraction * asked_m_s:
            flaws.append(
                f'the mean speed of the slide was {mean_m_s:.4f} m/s, more than {touch.mean_speed_fraction:.0%} off '
                f"the {asked_m_s:g} m/s requested ('mean_speed_fraction'); reduce the load of the "
                "computer, or check what scales the arm's speed"
            )
        measured = (
            ('force', 'N', asked_n, 'peak_force_fraction'),
            ('speed', 'm/s', asked_m_s, 'peak_speed_fraction'),
        )
        for (what, unit, asked, parameter), peak, most in zip(measured, self._peaks, self._most, strict=True):
            if not peak <= most:
                flaws.append(
                    f'the {what} of the slide reached {peak:.3g} {unit}, and {most:.3g} {unit} are allowed with '
                    f"{asked:g} {unit} requested ('{parameter}')"
                )
        return '; '.join(flaws)

    def _add_way(self, arm: ArmState) -> None:
        """Sum the distance in pieces of PEAK_NS: noise of the position makes shorter ones too long."""
        if self._chunk is None:
            self._chunk = arm
        took_ns = arm.time_ns - self._chunk.time_ns
        if took_ns >= PEAK_NS:
            self._way_m += math.dist(arm.position[:2], self._chunk.position[:2])
            self._way_s += took_ns * 1e-9
            self._chunk = arm

    def _fast_m_s(self) -> float:
        first, last = self._recent[0], self._recent[-1]
        took_s = (last.time_ns - first.time_ns) * 1e-9
        return math.dist(first.position[:2], last.position[:2]) / took_s if took_s >= 0.6e-9 * PEAK_NS else 0.0


# --------------------
# Whether the force is too high before the slide.

OVERSHOOT = 0.2  # of the wanted force, that pressing may exceed it


class OvershootWatch:
    """Abort before the slide if the force exceeds the request: the middle one of the newest forces counts."""

    def __init__(self, force_n: float, touch: TouchParams) -> None:
        self._force_n = force_n
        self._most_n = (1.0 + max(OVERSHOOT, touch.force_tolerance)) * force_n
        self._forces: deque[float] = deque(maxlen=FORCES)

    def update(self, arm: ArmState) -> None:
        """Take a state; MotionAborted if the force is too high."""
        self._forces.append(arm.force_n)
        reached_n = statistics.median(self._forces)
        if len(self._forces) == FORCES and reached_n > self._most_n:
            raise MotionAborted(
                f'the force reached {reached_n:.2f} N of {self._force_n:.3g} N requested before the slide; the contact '
                "is stiffer than 'max_stiffness_n_m' or 'approach_stiffness_n_m', or arm or force later than "
                "'loop_delay_s', as with a busy computer",
                ExplorationError.FORCE_LIMIT,
            )
