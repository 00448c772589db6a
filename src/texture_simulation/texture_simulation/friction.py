# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Friction between finger and surface: Coulomb, Stribeck, stick-slip, and their integration in time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.errors import InvalidParameter
from texture_core.types import Array
from texture_simulation.path import Trajectory, before_first

# --------------------
# What makes a fingertip stick and slip: the friction of a surface and the skin that drags the tip over it.

# A fading bristle damping gives power back nowhere if no speed u has damping(u)·|u| > 4·friction(u); exp(−x²)·x is at
# most 1/√(2e), so damping·stribeck ≤ 4·√(2e)·kinetic is enough.
PASSIVE = 4 * math.sqrt(2 * math.e)


@dataclass(frozen=True)
class Stribeck:
    """A Stribeck curve: friction that falls from its value at rest to that of fast sliding."""

    static: float = param(
        0.9,
        'Coefficient of friction at rest, at which a sticking tip starts to slip, and of slow sliding.',
        low=0.0,
        high=5.0,
    )
    kinetic: float = param(0.5, 'Coefficient of kinetic friction of fast sliding.', low=1e-3, high=5.0)
    stribeck_m_s: float = param(
        0.05, 'Stribeck speed over which friction falls from static to kinetic.', unit='m/s', low=1e-4, high=10.0
    )
    viscous_s_m: float = param(0.0, 'Growth of the coefficient of friction per speed.', unit='s/m', low=0.0, high=100.0)
    FORCE_COUPLING: ClassVar[float] = 0.2  # measured force per tangential force on the skin

    def __post_init__(self) -> None:
        if self.static < self.kinetic:
            raise InvalidParameter(
                f'static friction {self.static} is below the kinetic one, {self.kinetic}; give at least as much'
            )


@dataclass(frozen=True)
class StickSlip(Stribeck):
    """Friction by LuGre bristles with a Stribeck curve, and a tip of some mass on the spring and damper of the skin.

    All friction is proportional to the normal force, so stiffness and damping of the bristles are given for 1 N. The
    values are guesses of the order of what is published for fingertips and silicone on smooth surfaces.
    """

    BRISTLE_1_M: ClassVar[float] = 1.5e5  # stiffness of the bristles
    BRISTLE_S_M: ClassVar[float] = 10.0  # their damping
    SKIN_N_M: ClassVar[float] = 1000.0  # tangential stiffness of the skin
    SKIN_N_S_M: ClassVar[float] = 0.4  # its damping
    MASS_KG: ClassVar[float] = 5e-4  # what moves of it
    STEP_S: ClassVar[float] = 2.5e-4  # longest step of the integration: exact to 1 % in period, 5 % in amplitude

    def __post_init__(self) -> None:
        super().__post_init__()
        most = PASSIVE * self.kinetic / self.stribeck_m_s
        if most < self.BRISTLE_S_M:
            raise InvalidParameter(
                f'kinetic is {self.kinetic} and stribeck_m_s {self.stribeck_m_s}; with the damping of the bristles, '
                f'{self.BRISTLE_S_M:g} s/m of at most {most:.3g} (9.33·kinetic/stribeck_m_s), friction would give out '
                'work that was never put in; raise kinetic or lower stribeck_m_s'
            )


# --------------------
# LuGre friction: the surfaces touch with bristles that bend before they slide (Canudas de Wit et al. 1995).
#
# State of the tip: `stretch_m` of the skin (base ahead of tip), `slip_m_s` (speed of the tip over the surface) and
# `bend_m` of the bristles. With N the normal force and g the Stribeck curve:
#
#     stretch' = speed − slip
#     mass·slip' = skin_n_m·stretch + skin_n_s_m·(speed − slip) − N·(σ0·bend + σ1(slip)·bend' + σ2·slip)
#     bend' = slip − σ0·|slip|·bend / g(slip)
#
# σ1 fades as the Stribeck curve does, which keeps friction passive at all speeds. What comes into contact when the
# force grows comes unbent, and what leaves takes its part of the bending with it: bend·N stays when N grows, bend
# stays when N falls. So a change of force adds no energy, and a new touch begins unbent.

Value = Any  # a float, or an array over scans: the same formulas serve both


class Tip(NamedTuple):
    """State of one tip (floats) or of many (arrays of one shape)."""

    stretch_m: Value
    slip_m_s: Value
    bend_m: Value


AT_REST = Tip(0.0, 0.0, 0.0)


# --------------------
# The integrator of the bristle model: stable with long steps however stiff the bristles are.

State = tuple[Value, Value, Value]
# Takes stretch, slip, bend, and the speed and the force at the end of the step; returns the next state.
Step = Callable[[Value, Value, Value, Value, Value], State]
CORRECTIONS = 2  # solutions of the semi-implicit step: one with the friction of the old speed, one with that of the new


def semi_implicit(friction: StickSlip, step_s: float, exp: Any = math.exp) -> Step:
    """Return a step with friction and damping at the new speed and the skin's spring at the old stretch.

    Friction at the new speed makes the bristles harmless however stiff they are; the spring at the old stretch keeps
    the natural oscillation of the skin from being damped numerically; that oscillation alone limits the step, to 1.9 ms
    with the skin of `StickSlip` at any force. The new slip w = ±W solves a quadratic equation:

        bend' = (bend + h·w) / (1 + q·W), q = h·σ0/g
        (mass/h + c + N·σ2)·w + N·(σ0·bend' + σ1·(bend' − bend)/h) = mass·slip/h + k·stretch + c·speed

    The Stribeck curve g and σ1 are taken at the old slip first, then once again at the slip that this gave.
    """
    stiffness, damping, viscous = friction.SKIN_N_M, friction.SKIN_N_S_M, friction.viscous_s_m
    bristle, bristle_damping = friction.BRISTLE_1_M, friction.BRISTLE_S_M
    kinetic, more = friction.kinetic, friction.static - friction.kinetic
    inertia, narrow, step_bristle = friction.MASS_KG / step_s, -1 / friction.stribeck_m_s**2, step_s * bristle
    copysign = math.copysign if exp is math.exp else np.copysign

    def step(stretch: Value, slip: Value, bend: Value, speed: Value, force: Value) -> State:
        linear = inertia + damping + force * viscous
        drive = inertia * slip + stiffness * stretch + damping * speed
        left = drive - force * bristle * bend
        size, sign = abs(left), copysign(1.0, left)
        for _ in range(CORRECTIONS):
            fading = exp(narrow * slip * slip)
            bent = step_bristle / (kinetic + more * fading)
            holding = force * bristle_damping * fading
            square = linear * bent
            middle = linear + force * step_bristle + holding - sign * bent * (drive + holding * bend / step_s)
            fast = ((middle * middle + 4 * square * size) ** 0.5 - middle) / (2 * square)
            slip = sign * fast
        return stretch + step_s * (speed - slip), slip, (bend + step_s * slip) / (1 + bent * fast)

    return step


# --------------------
# Drag tips over a surface, step by step: one scan in plain floats, or many at once in arrays.

FEW = 40  # scans; up to this number they are faster one after another in floats than together in arrays


def drag(
    friction: StickSlip,
    speed_m_s: Array,
    force_n: Array,
    step_s: float,
    *,
    start: Tip = AT_REST,
    force_before_n: Value = 0.0,
) -> Tip:
    """Return the state at the end of each step."""
    if not speed_m_s.size:
        return Tip(*(np.zeros_like(speed_m_s) for _ in range(3)))
    before = np.concatenate([np.broadcast_to(force_before_n, speed_m_s.shape[:-1])[..., None], force_n[..., :-1]], -1)
    # What comes into contact when the force grows comes unbent: so much is kept of the bending.
    kept = np.divide(before, force_n, out=np.ones_like(before), where=force_n > before)
    if math.prod(speed_m_s.shape[:-1]) <= FEW:
        return _few(semi_implicit(friction, step_s), start, speed_m_s, force_n, kept)
    return _many(semi_implicit(friction, step_s, np.exp), start, speed_m_s, force_n, kept)


def pull_n(friction: StickSlip, tip: Tip, speed_m_s: Array) -> Array:
    """Return the force of the skin on the tip: what the finger senses along the surface."""
    return np.asarray(friction.SKIN_N_M * tip.stretch_m + friction.SKIN_N_S_M * (speed_m_s - tip.slip_m_s))


def _few(step: Step, start: Tip, speed_m_s: Array, force_n: Array, kept: Array) -> Tip:
    """Return the states of a few scans, (..., n), one after another in plain floats."""
    shape = speed_m_s.shape
    starts = [np.broadcast_to(value, shape[:-1]).ravel().tolist() for value in start]
    drives = [values.reshape(-1, shape[-1]).tolist() for values in (speed_m_s, force_n, kept)]
    states = [_one(step, first, *drive) for first, *drive in zip(zip(*starts, strict=True), *drives, strict=True)]
    return Tip(*np.moveaxis(np.array(states), -1, 0).reshape(3, *shape))


def _one(
    step: Step, start: tuple[float, ...], speed_m_s: list[float], force_n: list[float], kept: list[float]
) -> list[State]:
    """Return the state at the end of each step."""
    stretch, slip, bend = start
    states: list[State] = []
    note = states.append
    for speed, force, fraction in zip(speed_m_s, force_n, kept, strict=True):
        stretch, slip, bend = state = step(stretch, slip, bend * fraction, speed, force)
        note(state)
    return states


def _many(step: Step, start: Tip, speed_m_s: Array, force_n: Array, kept: Array) -> Tip:
    """Return the states of many scans, (..., n)."""
    shape = speed_m_s.shape[:-1]
    stretch, slip, bend = (np.array(np.broadcast_to(value, shape), dtype=np.float64) for value in start)
    states = np.empty((3, speed_m_s.shape[-1], *shape))
    drives = (np.ascontiguousarray(np.moveaxis(values, -1, 0)) for values in (speed_m_s, force_n, kept))
    for i, (speed, force, fraction) in enumerate(zip(*drives, strict=True)):
        stretch, slip, bend = states[:, i] = step(stretch, slip, bend * fraction, speed, force)
    return Tip(*np.moveaxis(states, 1, -1))


# --------------------
# The Stribeck curve: friction that falls from its value at rest to that of sliding.


def coefficient(friction: Stribeck, speed_m_s: Array) -> Array:
    """Return the coefficient of friction of steady sliding, without the viscous part: in kinetic to static.

    kinetic + (static − kinetic)·exp(−(speed/stribeck)²).
    Source: Bo & Pavelescu 1982; Armstrong-Hélouvry et al. 1994.
    """
    fraction: Array = np.exp(-((np.asarray(speed_m_s) / friction.stribeck_m_s) ** 2))
    return friction.kinetic + (friction.static - friction.kinetic) * fraction


def steady_force_n(friction: Stribeck, speed_m_s: Array, force_n: float) -> Array:
    """Return the friction of steady sliding, against the movement, with the viscous part."""
    speed = np.asarray(speed_m_s)
    return force_n * (np.sign(speed) * coefficient(friction, speed) + friction.viscous_s_m * speed)


# --------------------
# Force that a sensor measures from stick-slip along a trajectory, block by block.

JUMP_M_S = 3.0  # what moves faster than this was put elsewhere, it did not slide


class TipDrag:
    """Follow the tip of a finger that is dragged along a path; what lies between the blocks is continuous."""

    def __init__(self, friction: StickSlip, rate_hz: float, stretched: float | Array = 0.0) -> None:
        self.friction = friction
        self._rate_hz = rate_hz
        self._substeps = max(1, math.ceil(1 / (rate_hz * friction.STEP_S) - 1e-9))
        self._step_s = 1 / (rate_hz * self._substeps)
        self._stretched = np.asarray(stretched, dtype=np.float64)
        self._tip = AT_REST
        self._before: tuple[Array, Array, Array, Array] | None = None  # x, y, speed and force, (..., 1)
        self._forward: tuple[Array, Array] | None = None  # the direction that counts as forward, (..., 1)

    def advance(self, path: Trajectory) -> Array:
        """Return the force that the sensor senses in addition to the shape of the surface, (..., n), N."""
        if not len(path):
            return np.zeros_like(path.x_m)
        speed_m_s, force_n = self._along(path), np.maximum(path.force_n, 0.0)
        _, _, speed_before, force_before = self._before or self._first(force_n[..., :1])
        speeds, forces = self._between(speed_before, speed_m_s), self._between(force_before, force_n)
        tip = drag(self.friction, speeds, forces, self._step_s, start=self._tip, force_before_n=force_before[..., 0])
        self._tip = Tip(*(values[..., -1] for values in tip))
        self._before = path.x_m[..., -1:], path.y_m[..., -1:], speed_m_s[..., -1:], force_n[..., -1:]
        sensed_n: Array = self.friction.FORCE_COUPLING * pull_n(self.friction, tip, speeds)
        return sensed_n[..., self._substeps - 1 :: self._substeps]

    def _first(self, force_n: Array) -> tuple[Array, Array, Array, Array]:
        """Return what was before the first point, (..., 1) each, and let the tip hang there."""
        nothing = np.zeros_like(force_n)
        if not self._stretched.any():
            return (nothing,) * 4
        pull_n = self._stretched * self.friction.static * force_n[..., 0]
        bend_m = self._stretched * self.friction.static / self.friction.BRISTLE_1_M
        self._tip = Tip(pull_n / self.friction.SKIN_N_M, np.zeros_like(pull_n), bend_m)
        return nothing, nothing, nothing, force_n

    def _along(self, path: Trajectory) -> Array:
        """Return the speed at each point, (..., n); below 0 while the path reverses."""
        x_m, y_m = self._before[:2] if self._before else (path.x_m[..., :1], path.y_m[..., :1])
        dx_m, dy_m = np.diff(path.x_m, prepend=x_m), np.diff(path.y_m, prepend=y_m)
        speed_m_s: Array = np.hypot(dx_m, dy_m) * self._rate_hz
        speed_m_s[speed_m_s > JUMP_M_S] = 0.0
        speed_m_s *= self._signs(dx_m, dy_m, speed_m_s > 0)
        return speed_m_s

    def _signs(self, dx_m: Array, dy_m: Array, moving: NDArray[np.bool_]) -> Array:
        """Return +1 or −1 at each point, (..., n): the sign changes where the path turns by more than a right angle."""
        known = self._forward or (np.zeros_like(dx_m[..., :1]),) * 2
        x, y = (np.concatenate(pair, axis=-1) for pair in zip(known, (dx_m, dy_m), strict=True))
        numbers = np.arange(1, dx_m.shape[-1] + 1)
        last = np.maximum.accumulate(np.where(moving, numbers, 0), axis=-1)  # at each point, the last that moved
        before = np.concatenate([np.zeros_like(last[..., :1]), last[..., :-1]], axis=-1)
        along = dx_m * np.take_along_axis(x, before, -1) + dy_m * np.take_along_axis(y, before, -1)
        signs: Array = np.cumprod(np.where(moving & (along < 0), -1.0, 1.0), axis=-1)
        # The forward direction stays, whatever the direction of the tip at the end of the block.
        end = last[..., -1:]
        forward_x, forward_y = (signs[..., -1:] * np.take_along_axis(place, end, -1) for place in (x, y))
        self._forward = forward_x, forward_y
        return signs

    def _between(self, before: Array, values: Array) -> Array:
        """Return values at the end of each step, straight from point to point, (..., n · steps between points)."""
        if self._substeps == 1:
            return values
        known = np.concatenate([before, values[..., :-1]], axis=-1)[..., None]
        fractions = np.arange(1, self._substeps + 1) / self._substeps
        steps: Array = known + (values[..., None] - known) * fractions
        return steps.reshape(*values.shape[:-1], -1)


# --------------------
# Friction that only ever slides.

CREEP_M_S = 1e-3  # below about this speed friction builds up, so that nothing jumps where a slide begins


@dataclass(frozen=True)
class SlidingFriction(Stribeck):
    """A Stribeck curve without memory: the skin is pulled along as at a steady speed, and never hangs.

    For surfaces on which nothing sticks, hundreds of times cheaper than `StickSlip`.
    """


class SlidingDrag:
    """Follow a finger that slides along a path; what lies between the blocks is continuous."""

    def __init__(self, friction: SlidingFriction, rate_hz: float) -> None:
        self._friction = friction
        self._rate_hz = rate_hz
        self._before: tuple[Array, Array] | None = None

    def advance(self, path: Trajectory) -> Array:
        """Return the force that the sensor senses, (..., n) N: of one sign, for both directions of the finger."""
        if not len(path):
            return np.zeros_like(path.x_m)
        x_m, y_m = self._before or before_first(path)
        self._before = path.x_m[..., -1:], path.y_m[..., -1:]
        speed_m_s = np.hypot(np.diff(path.x_m, prepend=x_m), np.diff(path.y_m, prepend=y_m)) * self._rate_hz
        built_up = speed_m_s / np.hypot(speed_m_s, CREEP_M_S)
        pull_n = np.maximum(path.force_n, 0.0) * built_up * steady_force_n(self._friction, speed_m_s, 1.0)
        return np.asarray(self._friction.FORCE_COUPLING * pull_n)


# --------------------
# The kinds of friction by name, each off unless a surface names it, and what follows a finger with them.

FRICTIONS: Mapping[str, type] = {
    'sliding_friction': SlidingFriction,  # a Stribeck curve, without memory
    'stick_slip': StickSlip,  # bristles (LuGre): the skin hangs and lets go
}


def make_drag(
    friction: Any, rate_hz: float, rng: np.random.Generator, batch_shape: tuple[int, ...]
) -> TipDrag | SlidingDrag:
    """Return what follows a finger over a surface."""
    if isinstance(friction, SlidingFriction):
        return SlidingDrag(friction, rate_hz)
    # Slides that are cut out of longer ones begin with the skin at any point of its cycle, not all at the same.
    return TipDrag(friction, rate_hz, stretched=rng.uniform(0.0, 1.0, batch_shape))


def sliding_coefficient(friction: Stribeck, speed_m_s: Array) -> Array:
    """Return tangential over normal force of a finger that slides steadily."""
    return steady_force_n(friction, speed_m_s, 1.0)
