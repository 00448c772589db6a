"""What an exploration may ask for, and what ends it at once."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from texture_core.errors import InvalidParameter, MotionRefused
from texture_core.exploration import ExplorationRequest
from texture_core.parameters import param
from texture_exploration.arms.protocol import ArmState, Vector

# Several turns are a direction, too; an angle beyond this one is a mistake, and loses its meaning by rounding.
MAX_DIRECTION_RAD = 100.0


@dataclass(frozen=True)
class SafetyLimits:
    """Limits of what is asked, of what is measured, and of how long each phase may take."""

    min_speed_m_s: float = param(
        0.002, 'Sets the lowest speed that may be requested; slower requests are refused.', unit='m/s', low=1e-4
    )
    max_speed_m_s: float = param(
        0.25,
        'Sets the highest speed that may be requested; faster requests are refused.',
        unit='m/s',
        low=1e-4,
        high=1.0,
    )
    min_force_n: float = param(
        0.1, 'Sets the lowest normal force that may be requested; smaller forces are refused.', unit='N', low=0.01
    )
    max_force_n: float = param(
        6.0,
        'Sets the highest normal force that may be requested; larger forces are refused.',
        unit='N',
        low=0.01,
        high=50.0,
    )
    force_limit_n: float = param(
        10.0,
        'Sets the measured force, in any direction, above which an exploration is aborted.',
        unit='N',
        low=0.1,
        high=100.0,
    )
    friction_limit: float = param(
        2.0,
        'Sets the highest force along the surface, as a multiple of the normal force, above which an exploration is '
        'aborted; it must exceed the friction of finger and samples.',
        low=0.1,
        high=20.0,
    )
    tangential_floor_n: float = param(
        1.0,
        'Sets the force along the surface that is allowed beside friction; it must exceed the noise of the force '
        'sensor.',
        unit='N',
        low=0.05,
        high=20.0,
    )
    frozen_force_s: float = param(
        0.06,
        'Sets how long a measured force may stay exactly the same, where it should change, before the '
        'exploration is aborted.',
        unit='s',
        low=0.02,
        high=5.0,
    )
    frozen_travel_m: float = param(
        0.00005,
        'Sets the travel along the normal, in contact, after which the measured force must have changed; a '
        'longer travel notices a frozen force later.',
        unit='m',
        low=1e-6,
        high=0.01,
    )
    force_drift_share: float = param(
        0.3,
        'Sets the largest change of the force in free air over an exploration, as a share of the wanted '
        'force; more aborts it.',
        low=0.01,
        high=10.0,
    )
    min_distance_m: float = param(
        0.002, 'Sets the shortest slide that may be requested; shorter requests are refused.', unit='m', low=1e-4
    )
    max_distance_m: float = param(
        1.0, 'Sets the longest slide that may be requested; longer requests are refused.', unit='m', low=1e-3
    )
    min_radius_m: float = param(
        0.005, 'Sets the smallest circle radius that may be requested; smaller circles are refused.', unit='m', low=1e-3
    )
    max_radius_m: float = param(
        0.1, 'Sets the largest circle radius that may be requested; larger circles are refused.', unit='m', low=1e-3
    )
    min_turns: float = param(
        0.1, 'Sets the smallest number of turns that may be requested; fewer turns are refused.', low=0.01
    )
    max_turns: float = param(
        100.0, 'Sets the largest number of turns that may be requested; more turns are refused.', low=0.01
    )
    max_turning_m_s2: float = param(
        5.0,
        'Sets the highest centripetal acceleration on a circle; a larger value allows faster and smaller circles.',
        unit='m/s²',
        low=0.05,
        high=20.0,
    )
    min_duration_s: float = param(
        0.1, 'Sets the shortest in-hand slide that may be requested; shorter requests are refused.', unit='s', low=0.01
    )
    max_duration_s: float = param(
        60.0, 'Sets the longest in-hand slide that may be requested; longer requests are refused.', unit='s', low=0.01
    )
    x_low_m: float = param(
        -0.2,
        'Sets the lowest x coordinate of the workspace in the surface frame; leaving it aborts.',
        unit='m',
        low=-2.0,
        high=2.0,
    )
    x_high_m: float = param(
        0.2,
        'Sets the highest x coordinate of the workspace in the surface frame; leaving it aborts.',
        unit='m',
        low=-2.0,
        high=2.0,
    )
    y_low_m: float = param(
        -0.2,
        'Sets the lowest y coordinate of the workspace in the surface frame; leaving it aborts.',
        unit='m',
        low=-2.0,
        high=2.0,
    )
    y_high_m: float = param(
        0.2,
        'Sets the highest y coordinate of the workspace in the surface frame; leaving it aborts.',
        unit='m',
        low=-2.0,
        high=2.0,
    )
    z_low_m: float = param(
        -0.02,
        'Sets the lowest z coordinate of the workspace in the surface frame; leaving it aborts.',
        unit='m',
        low=-2.0,
        high=2.0,
    )
    z_high_m: float = param(
        0.2,
        'Sets the highest z coordinate of the workspace in the surface frame; leaving it aborts.',
        unit='m',
        low=-2.0,
        high=2.0,
    )
    state_timeout_s: float = param(
        0.13,
        'Sets the age of the newest arm state above which an exploration is aborted; a longer time notices '
        'a dead arm later.',
        unit='s',
        low=0.01,
        high=2.0,
    )
    approach_timeout_s: float = param(
        10.0, 'Sets how long the approach to the surface may take before the exploration is aborted.', unit='s', low=0.1
    )
    contact_timeout_s: float = param(
        3.0, 'Sets how long force and speed may take to settle before the exploration is aborted.', unit='s', low=0.1
    )
    slide_overtime_s: float = param(
        2.0, 'Sets how much longer than planned a slide may take before the exploration is aborted.', unit='s', low=0.1
    )
    lift_timeout_s: float = param(
        5.0, 'Sets how long braking and lifting may take before the exploration is aborted.', unit='s', low=0.1
    )

    def __post_init__(self) -> None:
        for axis, (low, high) in self.workspace.items():
            if not low < high:
                raise InvalidParameter(
                    f"parameter '{axis}_low_m' is {low:g}; it must be below '{axis}_high_m', which is {high:g} m"
                )
        if self.force_limit_n <= self.max_force_n:
            raise InvalidParameter(
                f"parameter 'force_limit_n' is {self.force_limit_n}; "
                f"it must be above 'max_force_n', which is {self.max_force_n} N"
            )

    @property
    def workspace(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest coordinate along each axis, m."""
        return {
            'x': (self.x_low_m, self.x_high_m),
            'y': (self.y_low_m, self.y_high_m),
            'z': (self.z_low_m, self.z_high_m),
        }

    def complete(self, request: ExplorationRequest, defaults: Mapping[str, float]) -> ExplorationRequest:
        """Return a request with the motion's defaults for those of its numbers that are 0.

        Raises
        ------
        MotionRefused
            If a number is out of its range, or belongs to another motion.
        """
        numbers: dict[str, Any] = {name: getattr(request, name) or value for name, value in defaults.items()}
        given, request = request, replace(request, **numbers)
        for name in defaults:
            low_name, high_name, unit = RANGES[name]
            value, low, high = getattr(request, name), getattr(self, low_name), getattr(self, high_name)
            if not low <= value <= high:
                shown = stated(getattr(given, name), value)
                raise MotionRefused(f'{request.motion}: {name} is {shown}; allowed is {low:g} to {high:g} {unit}')
        self.refuse_unused(request, RANGES.keys() - defaults.keys())
        if not abs(request.direction_rad) <= MAX_DIRECTION_RAD:
            allowed = f'allowed is -{MAX_DIRECTION_RAD:g} to {MAX_DIRECTION_RAD:g} rad'
            raise MotionRefused(f'{request.motion}: direction_rad is {request.direction_rad:g}; {allowed}')
        return request

    @staticmethod
    def refuse_unused(request: ExplorationRequest, names: Iterable[str]) -> None:
        """Refuse a request that gives a number which the motion does not know: it means another motion.

        Raises
        ------
        MotionRefused
            If such a number is not 0.
        """
        given = sorted(name for name in names if getattr(request, name) != 0.0)
        if given:
            raise MotionRefused(f'{request.motion} knows no {" and no ".join(given)}; leave it at 0')

    def free_distance_m(self, start: Vector, direction_rad: float) -> float:
        """Return how far the finger can go from `start` along the surface before it leaves the workspace, m."""
        steps = (math.cos(direction_rad), math.sin(direction_rad))
        rooms = [
            ((high if step > 0 else low) - at) / step
            for step, at, (low, high) in zip(steps, start, self.workspace.values(), strict=False)
            if abs(step) > 1e-9
        ]
        return max(0.0, min(rooms))

    def force_violation(self, arm: ArmState) -> str:
        """Return in a sentence that the force is too high, or that it or the place is unknown; '' if not."""
        # Written so that NaN is too much too.
        if not arm.force_n <= self.force_limit_n:
            return f'the force of {arm.force_n:.2f} N is above the limit of {self.force_limit_n:g} N'
        if arm.force_n < -self.force_limit_n:
            return (
                f'the force of {arm.force_n:.2f} N pulls by more than the limit of {self.force_limit_n:g} N; if the '
                'finger was pressing, its sign is wrong'
            )
        if not arm.force_size_n <= self.force_limit_n:
            x, y, z = arm.force_vector_n
            return (
                f'the force of {arm.force_size_n:.2f} N ({x:.2f} and {y:.2f} N along the surface, {z:.2f} N normal to '
                f'it) is above the limit of {self.force_limit_n:g} N'
            )
        if not all(map(math.isfinite, arm.position)):
            return f'the place of the finger is unknown: the arm tells {arm.position}'
        return ''

    def friction_violation(self, arm: ArmState) -> str:
        """Return in a sentence that more than friction holds the finger along the surface, '' if not."""
        x, y, normal_n = arm.force_vector_n
        most_n = self.friction_limit * abs(normal_n) + self.tangential_floor_n
        if math.hypot(x, y) <= most_n:
            return ''
        return (
            f'the force along the surface of {math.hypot(x, y):.2f} N is more than friction can be, {most_n:.2f} N '
            f'under {normal_n:.2f} N: the finger met something, or its force is given in another frame; see '
            "'friction_limit' and 'tangential_floor_n'"
        )

    def workspace_violation(self, arm: ArmState) -> str:
        """Return in a sentence where the finger has left the workspace, '' if it has not."""
        for at, (axis, (low, high)) in zip(arm.position, self.workspace.items(), strict=True):
            if not low <= at <= high:
                return f'the finger left the workspace: {axis} is {at:.4f} m, allowed is {low:g} to {high:g} m'
        return ''


# What can be asked for: its limits in SafetyLimits and its unit.
def stated(given: float, value: float) -> str:
    """Return a number of a request in words; a `given` of 0 stands for the default of the motion."""
    return f'{value:g}' if given else f'{value:g} (the default of the motion)'


RANGES = {
    'speed_m_s': ('min_speed_m_s', 'max_speed_m_s', 'm/s'),
    'force_n': ('min_force_n', 'max_force_n', 'N'),
    'distance_m': ('min_distance_m', 'max_distance_m', 'm'),
    'radius_m': ('min_radius_m', 'max_radius_m', 'm'),
    'turns': ('min_turns', 'max_turns', 'turns'),
    'duration_s': ('min_duration_s', 'max_duration_s', 's'),
}
