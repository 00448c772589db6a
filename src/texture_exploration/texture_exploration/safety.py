# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Limits of requests, and of measured forces and positions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from texture_core.config import param
from texture_core.errors import ExplorationError, InvalidParameter, MotionRefused
from texture_core.types import ExplorationRequest
from texture_exploration.arms.arm import ArmState, Vector

# --------------------
# Limits of requests and measurements.

MOST_FORCE_N = 1e4  # no sensor measures more
MOST_M = 100.0  # of a place, and of a speed in m/s: no arm has more


MAX_DISTANCE_M = 1.0
# Of a request: lowest, highest, unit and meaning. A number is the same for every robot; a name is a configurable limit.
RANGES: Mapping[str, tuple[float | str, float | str, str, str]] = {
    'speed_m_s': (0.002, 'max_speed_m_s', 'm/s', 'speed along the surface'),
    'force_n': ('min_force_n', 'max_force_n', 'N', 'force on the surface, newton'),
    'distance_m': (0.002, MAX_DISTANCE_M, 'm', 'length of a straight slide'),
    'radius_m': (0.005, 0.1, 'm', 'radius, if the motion has one'),
    'turns': (0.1, 100.0, 'turns', 'number of turns, if the motion has some'),
    'duration_s': (0.1, 60.0, 's', 'duration of an in-hand slide'),
}
# Limits of which the first must be below the second.
ORDERED = (
    *((f'{axis}_low_m', f'{axis}_high_m', 'm') for axis in 'xyz'),
    ('z_low_m', 'surface_tolerance_m', 'm'),  # else every contact is outside
    ('min_force_n', 'max_force_n', 'N'),
    ('max_force_n', 'force_limit_n', 'N'),
)
# Several turns are also a direction; an angle beyond this one is a mistake, and loses precision by rounding.
MAX_DIRECTION_RAD = 100.0


def shown(force_n: float) -> str:
    """Return a force of any size in few characters."""
    return f'{force_n:.2f}' if abs(force_n) <= MOST_FORCE_N else f'{force_n:.3g}'


WORKSPACE = 'coordinate of the workspace in the surface frame; leaving it aborts.'
PATCH = 'coordinate of the surface patch; touches set it; one without extent is none.'


def _edge(value: float, which: str, of: str = WORKSPACE) -> Any:
    """Declare an edge of the workspace or of the patch."""
    return param(value, f'{which} {of}', unit='m', low=-2.0, high=2.0)


@dataclass(frozen=True)
class SafetyLimits:
    """Limits of requests, of measurements and of the duration of each phase."""

    max_speed_m_s: float = param(
        0.25, 'Highest speed that may be requested; a faster one is refused.', unit='m/s', low=0.002, high=1.0
    )
    min_force_n: float = param(
        0.1, 'Lowest normal force that may be requested; a smaller one is refused.', unit='N', low=0.01
    )
    max_force_n: float = param(
        6.0, 'Highest normal force that may be requested; a larger one is refused.', unit='N', low=0.01, high=50.0
    )
    force_limit_n: float = param(
        10.0, 'Measured force, in any direction, above which an exploration aborts.', unit='N', low=0.1, high=100.0
    )
    friction_limit: float = param(
        2.0, 'Force along the surface, by the normal force, that aborts; it must exceed friction.', low=0.1, high=20.0
    )
    tangential_floor_n: float = param(
        1.0, 'Force along the surface allowed beyond friction; above all noise.', unit='N', low=0.05, high=20.0
    )
    frozen_force_s = 0.06  # of a reading that stays the same where it should change: six states at 100 Hz
    force_drift_fraction = 0.3  # of the wanted force, that the force in free air may change over an exploration
    max_turning_m_s2 = 5.0  # centripetal acceleration on a circle: half of what an arm of 1 kg turns by with 10 N
    x_low_m: float = _edge(-0.2, 'Lowest x')
    x_high_m: float = _edge(0.2, 'Highest x')
    y_low_m: float = _edge(-0.2, 'Lowest y')
    y_high_m: float = _edge(0.2, 'Highest y')
    z_low_m: float = _edge(-0.02, 'Lowest z')
    z_high_m: float = _edge(0.2, 'Highest z')
    surface_tolerance_m: float = param(
        0.02, 'Largest height of a contact above or below the declared surface.', unit='m', low=0.001, high=0.5
    )
    state_timeout_s: float = param(
        0.13, 'Age of the newest state of the arm that aborts.', unit='s', low=0.01, high=2.0
    )
    approach_timeout_s: float = param(10.0, 'How long the approach to the surface may take.', unit='s', low=0.1)
    contact_timeout_s = 10.0  # that force and speed may take to settle: a contact 30 times softer than declared
    slide_overtime_s = 2.0  # longer than planned, that a slide may take
    lift_timeout_s = 5.0  # that braking and lifting may take: three times what they do

    def __post_init__(self) -> None:
        for lower, higher, unit in ORDERED:
            low, high = getattr(self, lower), getattr(self, higher)
            if not low < high and (low, lower) != (high, 'min_force_n'):  # a single force may be allowed
                raise InvalidParameter(f"'{lower}' is {low:g}; it must be below '{higher}', {high:g} {unit}")

    @property
    def workspace(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest coordinate along each axis, m."""
        return {
            'x': (self.x_low_m, self.x_high_m),
            'y': (self.y_low_m, self.y_high_m),
            'z': (self.z_low_m, self.z_high_m),
        }

    def range(self, name: str) -> tuple[float, float, str]:
        """Return lowest and highest allowed value, and unit, of a number of a request."""
        low, high, unit, _ = RANGES[name]
        low, high = (getattr(self, limit) if isinstance(limit, str) else limit for limit in (low, high))
        return low, high, unit

    def default(self, name: str, value: float) -> float:
        """Return the default of a motion, or the nearest value that is allowed here."""
        low, high, _ = self.range(name)
        return min(max(value, low), high)

    def complete(self, request: ExplorationRequest, defaults: Mapping[str, float]) -> ExplorationRequest:
        """Return a request with the motion's defaults for those of its numbers that are 0, or refuse it."""
        numbers: dict[str, Any] = {
            name: getattr(request, name) or self.default(name, value) for name, value in defaults.items()
        }
        request = replace(request, **numbers)
        for name, value in numbers.items():
            low, high, unit = self.range(name)
            if not low <= value <= high:
                raise MotionRefused(
                    f'{request.motion}: {name} is {value:g}; allowed is {low:g} to {high:g} {unit}', field=name
                )
        self.refuse_unused(request, RANGES.keys() - defaults.keys())
        if not abs(request.direction_rad) <= MAX_DIRECTION_RAD:
            given, most = (math.degrees(angle) for angle in (request.direction_rad, MAX_DIRECTION_RAD))
            raise MotionRefused(
                f'{request.motion}: the direction is {given:g}°; allowed is -{most:.0f}° to {most:.0f}°',
                field='direction_rad',
            )
        return request

    @staticmethod
    def refuse_unused(request: ExplorationRequest, names: Iterable[str]) -> None:
        """Refuse a request with a number that the motion does not use: it means another motion."""
        given = sorted(name for name in names if getattr(request, name) != 0.0)
        if given:
            raise MotionRefused(
                f'{request.motion} does not use {" and ".join(given)}; leave it at 0',
                ExplorationError.UNUSED_FIELD,
                given[0],
            )

    def free_distance_m(self, start: Vector, direction_rad: float) -> float:
        """Return how far the finger can go from `start` along the surface before it leaves the workspace, m."""
        return max(0.0, self._nearest_limit(start, direction_rad)[0])

    def limits_ahead(self, start: Vector, *directions_rad: float) -> str:
        """Return as text the start of the finger and the limits that it meets first in these directions."""
        names = [self._nearest_limit(start, direction_rad)[1] for direction_rad in directions_rad]
        declared = ' and '.join(f"'{name}' is {getattr(self, name):g} m" for name in dict.fromkeys(names))
        return f'from x {start[0]:.3f} and y {start[1]:.3f} m, as {declared}'

    def _nearest_limit(self, start: Vector, direction_rad: float) -> tuple[float, str]:
        steps = (math.cos(direction_rad), math.sin(direction_rad))
        return min(
            (((high if step > 0 else low) - at) / step, f'{axis}_{"high" if step > 0 else "low"}_m')
            for step, at, (axis, (low, high)) in zip(steps, start, self.workspace.items(), strict=False)
            if abs(step) > 1e-9
        )

    def force_violation(self, arm: ArmState) -> str:
        """Return in a sentence that the force is too high, or that it or the place is unknown; '' if not."""
        # Written so that NaN also exceeds the limit.
        if not arm.force_n <= self.force_limit_n:
            return f'the force of {shown(arm.force_n)} N is above the limit of {self.force_limit_n:g} N'
        if arm.force_n < -self.force_limit_n:
            return (
                f'the force of {shown(arm.force_n)} N pulls by more than the limit of {self.force_limit_n:g} N; if the '
                'finger was pressing, its sign is wrong'
            )
        if not arm.force_size_n <= self.force_limit_n:
            x, y, z = map(shown, arm.force_vector_n)
            return (
                f'the force of {shown(arm.force_size_n)} N ({x} and {y} N along the surface, {z} N normal to it) is '
                f'above the limit of {self.force_limit_n:g} N'
            )
        return ''

    def friction_violation(self, arm: ArmState) -> str:
        """Return in a sentence that the force along the surface exceeds friction, '' if not."""
        x, y, normal_n = arm.force_vector_n
        most_n = self.friction_limit * abs(normal_n) + self.tangential_floor_n
        if math.hypot(x, y) <= most_n:
            return ''
        return (
            f'the force along the surface of {math.hypot(x, y):.2f} N is more than friction allows, {most_n:.2f} N '
            f'under {normal_n:.2f} N: the finger met something, or its force is given in another frame; see '
            "'friction_limit' and 'tangential_floor_n'"
        )

    def outside(self, position: Vector) -> str:
        """Return as text along which axes a position in the surface frame, m, is outside the workspace, or ''."""
        return ' and '.join(
            f'{axis} is {at:.4f} m, allowed is {low:g} to {high:g} m'
            for at, (axis, (low, high)) in zip(position, self.workspace.items(), strict=True)
            if not low <= at <= high
        )


# --------------------
# The part of the surface on which an exploration with a start may begin.


@dataclass(frozen=True)
class SurfacePatch:
    """The rectangle of the surface frame in which an exploration with a start stays; none without extent."""

    patch_x_low_m: float = _edge(0.0, 'Lowest x', PATCH)
    patch_x_high_m: float = _edge(0.0, 'Highest x', PATCH)
    patch_y_low_m: float = _edge(0.0, 'Lowest y', PATCH)
    patch_y_high_m: float = _edge(0.0, 'Highest y', PATCH)

    def start(self, request: ExplorationRequest, home: Vector, limits: SafetyLimits) -> Vector:
        """Return where an exploration begins: at `home`, or above its start at the same height."""
        if not request.use_start:
            return home
        if not (self.patch_x_low_m < self.patch_x_high_m and self.patch_y_low_m < self.patch_y_high_m):
            raise MotionRefused(
                f'{request.motion}: no surface patch is set for a start; touch the corners of the surface '
                "(touch_surface), or set 'patch_x_low_m', 'patch_x_high_m', 'patch_y_low_m' and 'patch_y_high_m'",
                ExplorationError.OUTSIDE_WORKSPACE,
                'use_start',
            )
        for name, low, high in (
            ('start_x_m', max(limits.x_low_m, self.patch_x_low_m), min(limits.x_high_m, self.patch_x_high_m)),
            ('start_y_m', max(limits.y_low_m, self.patch_y_low_m), min(limits.y_high_m, self.patch_y_high_m)),
        ):
            at = getattr(request, name)
            if not low <= at <= high:  # so NaN is also off
                raise MotionRefused(
                    f'{request.motion}: {name} is {at:g}, off the surface patch; allowed is {low:g} to {high:g} m',
                    ExplorationError.OUTSIDE_WORKSPACE,
                    name,
                )
        return request.start_x_m, request.start_y_m, home[2]

    def within(self, limits: SafetyLimits) -> SafetyLimits:
        """Return the limits with the patch as the workspace along the surface."""
        return replace(
            limits,
            x_low_m=max(limits.x_low_m, self.patch_x_low_m),
            x_high_m=min(limits.x_high_m, self.patch_x_high_m),
            y_low_m=max(limits.y_low_m, self.patch_y_low_m),
            y_high_m=min(limits.y_high_m, self.patch_y_high_m),
        )
