"""Drag tips over a surface, step by step: one scan in plain floats, or many at once in arrays."""

from __future__ import annotations

import math

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import InvalidData
from texture_simulation.stick_slip.bristle import AT_REST, Tip, Value
from texture_simulation.stick_slip.friction import StickSlip
from texture_simulation.stick_slip.integrator import Integrator, State, Step
from texture_simulation.stick_slip.semi_implicit import SEMI_IMPLICIT
from texture_simulation.stick_slip.stability_limit import check_step

FEW = 40  # scans; up to so many are faster one after another in floats than together in arrays


def drag(
    friction: StickSlip,
    speed_m_s: Array,
    force_n: Array,
    step_s: float,
    *,
    integrator: Integrator = SEMI_IMPLICIT,
    start: Tip = AT_REST,
    force_before_n: Value = 0.0,
) -> Tip:
    """Return the state at the end of each step.

    Parameters
    ----------
    speed_m_s, force_n : (..., n)
        Speed of the base along the path and normal force, at the end of each of n steps. Leading axes are scans.
    step_s
        Length of a step.
    integrator
        What integrates.
    start, force_before_n
        State of the tip and force before the first step, (...).
    friction
        Friction of the surface, and the skin.

    Returns
    -------
    Tip of arrays (..., n)

    Raises
    ------
    InvalidParameter
        If the step is beyond the border of the integrator.
    InvalidData
        If a speed or force is not finite, or a force is below 0.
    """
    check_drive(speed_m_s, force_n)
    if not speed_m_s.size:
        return Tip(*(np.zeros_like(speed_m_s) for _ in range(3)))
    check_step(integrator, friction, step_s, float(np.abs(speed_m_s).max()), float(force_n.max()))
    return drag_unchecked(
        friction, speed_m_s, force_n, step_s, integrator=integrator, start=start, force_before_n=force_before_n
    )


def drag_unchecked(
    friction: StickSlip,
    speed_m_s: Array,
    force_n: Array,
    step_s: float,
    *,
    integrator: Integrator,
    start: Tip = AT_REST,
    force_before_n: Value = 0.0,
) -> Tip:
    """Do as `drag` does, whatever comes of it; to find the borders.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    speed_m_s : (..., n)
        Speed of the base at the end of each step.
    force_n : (..., n)
        Normal force at the end of each step.
    step_s
        Length of an integration step.
    integrator
        What integrates.
    start
        State of the tip before the first step.
    force_before_n : (...)
        Force before the first step.

    Returns
    -------
    Tip of arrays (..., n)
    """
    before = np.concatenate([np.broadcast_to(force_before_n, speed_m_s.shape[:-1])[..., None], force_n[..., :-1]], -1)
    kept = np.divide(
        before, force_n, out=np.ones_like(before), where=force_n > before
    )  # of the bending, see bristle.py
    prepare = integrator.prepare
    if math.prod(speed_m_s.shape[:-1]) <= FEW:
        return _few(prepare(friction, step_s, math.exp), start, speed_m_s, force_n, kept)
    return _many(prepare(friction, step_s, np.exp), start, speed_m_s, force_n, kept)


def pull_n(friction: StickSlip, tip: Tip, speed_m_s: Array) -> Array:
    """Return the force of the skin on the tip: what the finger senses along the surface.

    Parameters
    ----------
    friction
        Friction of the surface, and the skin.
    tip
        State of the tip, arrays (..., n).
    speed_m_s : (..., n)
        Speed of the base.

    Returns
    -------
    (..., n)
        Force in N.
    """
    pull: Array = friction.skin_n_m * tip.stretch_m + friction.skin_n_s_m * (speed_m_s - tip.slip_m_s)
    return pull


def check_drive(speed_m_s: Array, force_n: Array) -> None:
    """Raise InvalidData for speeds and forces that no finger has.

    Parameters
    ----------
    speed_m_s, force_n : (..., n)
        For each step.

    Raises
    ------
    InvalidData
        If the shapes differ, a number is not finite, or a force is below 0.
    """
    if speed_m_s.shape != force_n.shape:
        raise InvalidData(f'speeds {speed_m_s.shape} and forces {force_n.shape}; give one of each for every step')
    if not (np.isfinite(speed_m_s).all() and np.isfinite(force_n).all()):
        raise InvalidData('a speed or force that is not finite; give numbers only')
    if (force_n < 0).any():
        raise InvalidData(f'a force of {force_n.min():.3g} N; a finger presses with 0 or more')


def _few(step: Step, start: Tip, speed_m_s: Array, force_n: Array, kept: Array) -> Tip:
    """Return the states of a few scans, (..., n), one after another in plain floats."""
    shape = speed_m_s.shape
    starts = [np.broadcast_to(value, shape[:-1]).ravel().tolist() for value in start]
    drives = [values.reshape(-1, shape[-1]).tolist() for values in (speed_m_s, force_n, kept)]
    states = [_one(step, first, *drive) for first, *drive in zip(zip(*starts, strict=True), *drives, strict=True)]
    return _tip(np.moveaxis(np.array(states), -1, 0).reshape(3, *shape))


def _one(
    step: Step, start: tuple[float, ...], speed_m_s: list[float], force_n: list[float], kept: list[float]
) -> list[State]:
    """Return the state at the end of each step."""
    stretch, slip, bend = start
    states: list[State] = []
    note = states.append
    for speed, force, share in zip(speed_m_s, force_n, kept, strict=True):
        stretch, slip, bend = state = step(stretch, slip, bend * share, speed, force)
        note(state)
    return states


def _many(step: Step, start: Tip, speed_m_s: Array, force_n: Array, kept: Array) -> Tip:
    """Return the states of many scans, (..., n)."""
    shape = speed_m_s.shape[:-1]
    stretch, slip, bend = (np.array(np.broadcast_to(value, shape), dtype=np.float64) for value in start)
    states = np.empty((3, speed_m_s.shape[-1], *shape))
    drives = (np.ascontiguousarray(np.moveaxis(values, -1, 0)) for values in (speed_m_s, force_n, kept))
    for i, (speed, force, share) in enumerate(zip(*drives, strict=True)):
        stretch, slip, bend = states[:, i] = step(stretch, slip, bend * share, speed, force)
    return _tip(np.moveaxis(states, 1, -1))


def _tip(states: Array) -> Tip:
    return Tip(states[0], states[1], states[2])
