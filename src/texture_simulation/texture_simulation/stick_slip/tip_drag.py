"""Force that a sensor measures from stick-slip along a trajectory, block by block."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_simulation.stick_slip.bristle import AT_REST, Tip
from texture_simulation.stick_slip.friction import StickSlip
from texture_simulation.stick_slip.semi_implicit import SEMI_IMPLICIT
from texture_simulation.stick_slip.simulate import drag, pull_n
from texture_simulation.stick_slip.stability_limit import check_step
from texture_simulation.trajectory import Trajectory

JUMP_M_S = 3.0  # what moves faster than this was put elsewhere, it did not slide


class TipDrag:
    """Follow the tip of a finger that is dragged along a path; what lies between the blocks is continuous.

    Parameters
    ----------
    friction
        Of the surface, and the skin.
    rate_hz
        Points of the path a second; several steps are taken between two points where `step_s` asks for it.
    stretched : number or (...)
        How far the skin is stretched at the first point, as a share of what makes it let go: a slide need not begin
        with a touch.

    Raises
    ------
    InvalidParameter
        If the step is beyond the border of stability.
    """

    def __init__(self, friction: StickSlip, rate_hz: float, stretched: float | Array = 0.0) -> None:
        self.friction = friction
        self._rate_hz = rate_hz
        check_step(SEMI_IMPLICIT, friction, friction.step_s, 0.0, 0.0)
        self._substeps = max(1, math.ceil(1 / (rate_hz * friction.step_s) - 1e-9))
        self._step_s = 1 / (rate_hz * self._substeps)
        self._stretched = np.asarray(stretched, dtype=np.float64)
        self._tip = AT_REST
        self._before: tuple[Array, Array, Array, Array] | None = None  # x, y, speed and force, (..., 1)
        self._forward: tuple[Array, Array] | None = None  # the direction that counts as forward, (..., 1)

    def advance(self, path: Trajectory) -> Array:
        """Return the force that the sensor senses beside the shape of the surface, (..., n), N."""
        if not len(path):
            return np.zeros_like(path.x_m)
        speed_m_s, force_n = self._along(path), np.maximum(path.force_n, 0.0)
        _, _, speed_before, force_before = self._before or self._first(force_n[..., :1])
        speeds, forces = self._between(speed_before, speed_m_s), self._between(force_before, force_n)
        tip = drag(self.friction, speeds, forces, self._step_s, start=self._tip, force_before_n=force_before[..., 0])
        self._tip = Tip(*(values[..., -1] for values in tip))
        self._before = path.x_m[..., -1:], path.y_m[..., -1:], speed_m_s[..., -1:], force_n[..., -1:]
        sensed_n: Array = self.friction.force_coupling * pull_n(self.friction, tip, speeds)
        return sensed_n[..., self._substeps - 1 :: self._substeps]

    def _first(self, force_n: Array) -> tuple[Array, Array, Array, Array]:
        """Return what was before the first point, (..., 1) each, and let the tip hang there."""
        nothing = np.zeros_like(force_n)
        if not self._stretched.any():
            return (nothing,) * 4
        pull_n = self._stretched * self.friction.static * force_n[..., 0]
        bend_m = self._stretched * self.friction.static / self.friction.bristle_1_m
        self._tip = Tip(pull_n / self.friction.skin_n_m, np.zeros_like(pull_n), bend_m)
        return nothing, nothing, nothing, force_n

    def _along(self, path: Trajectory) -> Array:
        """Return the speed at each point, (..., n); below 0 while the path goes back the way it came."""
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
        # What counts as forward stays, whatever way the tip goes at the end of the block.
        end = last[..., -1:]
        self._forward = (
            signs[..., -1:] * np.take_along_axis(x, end, -1),
            signs[..., -1:] * np.take_along_axis(y, end, -1),
        )
        return signs

    def _between(self, before: Array, values: Array) -> Array:
        """Return values at the end of each step, straight from point to point, (..., n · steps between points)."""
        if self._substeps == 1:
            return values
        known = np.concatenate([before, values[..., :-1]], axis=-1)[..., None]
        shares = np.arange(1, self._substeps + 1) / self._substeps
        steps: Array = known + (values[..., None] - known) * shares
        return steps.reshape(*values.shape[:-1], -1)
