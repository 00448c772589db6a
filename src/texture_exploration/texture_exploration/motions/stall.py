"""Whether the finger moves along the surface as it is commanded to, and whether the slide was what was asked for."""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Iterator

from texture_core.errors import MotionAborted
from texture_exploration.arms.protocol import ArmState
from texture_exploration.motions.touch import TouchParams

PEAK_NS = 50_000_000  # speed and tangential force are means over so long: motors step, sensors are noisy
FORCES = 3  # newest normal forces, of which the middle one counts: one alone may be wrong
LONGEST_STEP_NS = 50_000_000  # a command that was given longer ago may have run out: the comparison starts again


class StallWatch:
    """Compare the way that the finger makes with the way that was commanded, over the last `stall_s`.

    Only the way in the commanded direction counts, so that noise of the position does not add up, and a finger that
    goes to and fro may turn. Time is that of the arm's states; after a pause of this machine the comparison starts
    again.

    Parameters
    ----------
    touch
        The limits.
    """

    def __init__(self, touch: TouchParams) -> None:
        self._touch = touch
        self._ways: deque[tuple[int, float, float]] = deque()  # time, ns, and ways commanded and made so far, m
        self._velocity = (0.0, 0.0)  # commanded last
        self._place = (0.0, 0.0)

    def restart(self) -> None:
        """The finger moves from here on."""
        self._ways.clear()

    def update(self, arm: ArmState, velocity_m_s: tuple[float, float]) -> None:
        """Take a state of the arm, and the velocity that is commanded from now on.

        Raises
        ------
        MotionAborted
            If the finger has moved by less than `stall_speed_share` of the commanded way.
        """
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
        if made_m >= self._touch.stall_speed_share * commanded_m:
            return
        raise MotionAborted(
            f'the finger stalled: in {self._touch.stall_s * 1e3:.0f} ms it moved by {made_m * 1e3:.2f} of '
            f'{commanded_m * 1e3:.2f} mm; see what holds it, and whether the robot or its operator slows it down'
        )


class SlideWatch:
    """Compare mean and peak of speed, normal and tangential force of a slide with what was asked for.

    The speed is that from place to place, where the path asks for a constant one: not in turns. The tangential force
    counts where the arm measures it.

    Parameters
    ----------
    speed_m_s, force_n
        What was asked for.
    touch
        By how much mean and peak may differ.
    """

    def __init__(self, speed_m_s: float, force_n: float, touch: TouchParams) -> None:
        self._speed_m_s, self._force_n = speed_m_s, force_n
        self._touch = touch
        # A slide begins within twice the tolerance, so a smaller share would refuse what was let in.
        self._mean_force_share = max(touch.mean_force_share, 2 * touch.force_tolerance)
        self._recent: deque[ArmState] = deque()  # over PEAK_NS of constant speed
        self._forces: deque[float] = deque(maxlen=FORCES)
        self._chunk: ArmState | None = None  # where the present piece of the mean speed began
        self._way_m = self._way_s = 0.0
        self._force_sum_n = self._tangential_sum_n = 0.0
        self._states = self._tangential_states = 0
        self._peaks = [0.0, 0.0, 0.0]  # normal force, speed, tangential force

    def restart(self) -> None:
        """The finger slides on from here; what was measured stays."""
        self._recent.clear()
        self._forces.clear()
        self._chunk = None

    def update(self, arm: ArmState, constant: bool) -> bool:
        """Take a state; return whether what it shows is within what was asked for.

        Parameters
        ----------
        arm
            Newest state; one that was seen before changes nothing.
        constant
            Whether the path asks for a constant speed here.

        Returns
        -------
        bool
            Also True if there is too little to tell.
        """
        last_ns = self._recent[-1].time_ns if self._recent else 0
        self._states += 1
        self._force_sum_n += arm.force_n
        self._forces.append(arm.force_n)
        if math.isfinite(arm.tangential_force_n):
            self._tangential_states += 1
            self._tangential_sum_n += abs(arm.tangential_force_n)
        if not constant or arm.time_ns - last_ns > LONGEST_STEP_NS:
            self._recent.clear()
            self._chunk = None
        if not self._recent or arm.time_ns > last_ns:
            self._recent.append(arm)
        while arm.time_ns - self._recent[0].time_ns > PEAK_NS:
            self._recent.popleft()
        self._add_way(arm)
        now = [statistics.median(self._forces), self._fast_m_s(), self._tangential_n()]
        self._peaks = [max(peak, value) for peak, value in zip(self._peaks, now, strict=True)]
        return all(value <= most for value, most in zip(now, self._most, strict=True))

    def flaw(self) -> str:
        """Return in a sentence what was asked and what was measured if that differs too much, '' if not."""
        return '; '.join(self._differences())

    @property
    def _most(self) -> tuple[float, float, float]:
        """Largest normal force, speed and tangential force for a moment."""
        touch = self._touch
        return (
            (1 + touch.peak_force_share) * self._force_n,
            (1 + touch.peak_speed_share) * self._speed_m_s,
            touch.peak_friction * self._force_n,
        )

    def _differences(self) -> Iterator[str]:
        touch, asked_n, asked_m_s = self._touch, self._force_n, self._speed_m_s
        mean_n = self._force_sum_n / max(1, self._states)
        if not abs(mean_n - asked_n) <= self._mean_force_share * asked_n:  # so NaN is none
            yield (
                f'the mean force of the slide was {mean_n:.2f} N, more than {self._mean_force_share:.0%} off the '
                f"{asked_n:g} N that were asked for ('mean_force_share'); slide more slowly, or check the force "
                'control of the arm'
            )
        mean_m_s = self._way_m / self._way_s if self._way_s else asked_m_s
        if not abs(mean_m_s - asked_m_s) <= touch.mean_speed_share * asked_m_s:
            yield (
                f'the mean speed of the slide was {mean_m_s:.4f} m/s, more than {touch.mean_speed_share:.0%} off the '
                f"{asked_m_s:g} m/s that were asked for ('mean_speed_share'); see what scales the speed of the arm"
            )
        mean_n = self._tangential_sum_n / max(1, self._tangential_states)
        if mean_n > touch.mean_friction * asked_n:
            yield (
                f'the mean force along the surface was {mean_n:.2f} N, and {touch.mean_friction * asked_n:.2f} N are '
                f"allowed with {asked_n:g} N asked for ('mean_friction'); see whether the finger catches on something"
            )
        measured = (
            ('force', 'N', f'{asked_n:g} N', 'peak_force_share'),
            ('speed', 'm/s', f'{asked_m_s:g} m/s', 'peak_speed_share'),
            ('force along the surface', 'N', f'a force of {asked_n:g} N', 'peak_friction'),
        )
        for (what, unit, asked, parameter), peak, most in zip(measured, self._peaks, self._most, strict=True):
            if not peak <= most:
                yield (
                    f'the {what} of the slide reached {peak:.3g} {unit}, and {most:.3g} {unit} are allowed with '
                    f"{asked} asked for ('{parameter}')"
                )

    def _add_way(self, arm: ArmState) -> None:
        """Add up the way in pieces of PEAK_NS: noise of the place makes shorter ones too long."""
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

    def _tangential_n(self) -> float:
        known = [abs(arm.tangential_force_n) for arm in self._recent if math.isfinite(arm.tangential_force_n)]
        return statistics.fmean(known) if len(known) >= FORCES else 0.0
