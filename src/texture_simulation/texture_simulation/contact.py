# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Force on the skin of a finger along a trajectory: the chain from positions to the variation of the force."""

from __future__ import annotations

import numpy as np

from texture_core.types import Array
from texture_simulation.effects import BatchShape
from texture_simulation.friction import SlidingDrag, TipDrag, make_drag
from texture_simulation.path import Trajectory, before_first
from texture_simulation.scene import Scene
from texture_simulation.surfaces import Surface

# A fingertip that slides over a curved object tilts to it by so much at most; then the hand turns it.
MAX_TILT_RAD = 0.5
START_TILT_RAD = 0.15  # assumption: how far the grip turns a finger to a curved object, at most, in either direction
SAMPLE_SIZE_M = 0.1  # where on the sample a slide begins is drawn from so much
# A point of a fast path represents the stretch up to the next: the texture is blurred by at least so much of the step.
# Half of the sampling rate is then measured to 17 %, what would be folded down to nearly 0 Hz to 0.1 %.
MIN_BLUR_PER_STEP = 0.6


class SkinContact:
    """Follow the skin over one surface, block by block."""

    def __init__(
        self,
        scene: Scene,
        surface: Surface,
        rng: np.random.Generator,
        rate_hz: float,
        *,
        finger: int,
        batch_shape: BatchShape,
    ) -> None:
        self._surface = surface
        self._rate_hz = rate_hz
        self._contact = scene.contact
        self._rng = rng
        self._batch_shape = batch_shape
        self._finger = finger
        self._before: tuple[Array, Array] | None = None
        self._blur_growths = [effect.blur_growth for effect in scene.effects_of('blur_growth')]
        self._gain_growths = [effect.gain_growth for effect in scene.effects_of('gain_growth')]
        self._gains = [effect.gain for effect in scene.effects_of('gain')]
        begun = rng, rate_hz, batch_shape
        self._trajectory_filters = [effect.start_path(*begun) for effect in scene.effects_of('start_path')]
        self.relocate()

    @property
    def surface(self) -> Surface:
        """What is touched."""
        return self._surface

    @surface.setter
    def surface(self, surface: Surface) -> None:
        self._surface = surface
        self._drag = self._make_drag()

    def relocate(self) -> None:
        """Move the sample: no two touches meet the same place, unless the sample varies."""
        self._x_m, self._y_m = self._rng.uniform(0.0, SAMPLE_SIZE_M, (2, *self._batch_shape, 1))
        if self._surface.variation is not None:  # then a place of the surface frame is a place of the sample
            self._x_m, self._y_m = np.zeros((2, *self._batch_shape, 1))
        curved = np.isfinite(self._surface.shape.radius_m)
        shape = (2, *self._batch_shape, 1)
        self._tilt_rad = self._rng.uniform(-START_TILT_RAD, START_TILT_RAD, shape) if curved else np.zeros(shape)
        self._before = None
        self._drag = self._make_drag()

    def blur_m(self, force_n: float) -> float:
        """Return over what length the contact averages under a force."""
        return float(self._blur_and_stiffness(np.array([force_n]))[0][0])

    def placed(self, path: Trajectory) -> Trajectory:
        """Return the path of the skin on the sample."""
        placed = path.moved(self._x_m, self._y_m)
        for apply in self._trajectory_filters:
            placed = apply(placed)
        return placed

    def variation_n(
        self, placed: Trajectory, skin_blur_m: float | Array = 0.0, offset_m: tuple[Array, Array] | None = None
    ) -> Array:
        """Return by how much the shape of the surface, and its friction, change the force on the skin; 0 in the air."""
        if not len(placed):
            return np.empty((*placed.x_m.shape[:-1], *np.shape(skin_blur_m)[:-1], 0))
        force_n = constant(placed.force_n)
        blur_m, gain = self._blur_and_stiffness(force_n)
        blur_m = np.maximum(blur_m, MIN_BLUR_PER_STEP * self._steps_m(placed))
        for factor in self._gains:
            gain = gain * factor(placed, self._finger)
        x_m, y_m = placed.x_m, placed.y_m
        if offset_m is not None:
            x_m, y_m = x_m[..., None, :] + offset_m[0], y_m[..., None, :] + offset_m[1]
            blur_m, gain = np.hypot(blur_m[..., None, :], skin_blur_m), gain[..., None, :]
        variation_n = gain * self._surface.height_m(x_m, y_m, blur_m)
        drag = self._drag  # may be replaced from another thread, where a sample is swapped
        if drag:
            # One skin is dragged as a whole: all elements of a finger with several sense the same.
            dragged_n = drag.advance(placed)
            if self._surface.variation is not None:
                dragged_n = (
                    dragged_n
                    * self._surface.variation.at(self._surface.name, *np.broadcast_arrays(placed.x_m, placed.y_m))[2]
                )
            variation_n = variation_n + (dragged_n if offset_m is None else dragged_n[..., None, :])
        return np.asarray(variation_n)

    def static_variation_n(self, placed: Trajectory, blur_m: float, offset_m: tuple[Array, Array]) -> Array:
        """Return the same of slow elements at chosen points, (..., n_elements, n): without what shakes the skin."""
        _, gain = self._blur_and_stiffness(placed.force_n)
        for factor in self._gains:
            gain = gain * factor(placed, self._finger)
        x_m, y_m = placed.x_m[..., None, :] + offset_m[0], placed.y_m[..., None, :] + offset_m[1]
        height = self._surface.height_m(x_m, y_m, np.full((1,), blur_m))
        return np.asarray(gain[..., None, :] * height)

    def centre_m(self, placed: Trajectory) -> tuple[Array | float, Array | float]:
        """Return where on the fingertip the load is, x and y, (..., n) each; 0 on a plane.

        On a curved object the place moves as the finger slides: its normal turns by the distance over
        the sum of both radii, as the finger keeps its direction.
        """
        radius_m, tip_m = self._surface.shape.radius_m, self._contact.tip_radius_m
        if np.isinf(radius_m):
            return 0.0, 0.0
        ways = placed.x_m - self._x_m, placed.y_m - self._y_m
        tilts = [start + way / (radius_m + tip_m) for start, way in zip(self._tilt_rad, ways, strict=True)]
        x_m, y_m = (tip_m * np.clip(tilt, -MAX_TILT_RAD, MAX_TILT_RAD) for tilt in tilts)
        return x_m, y_m

    @property
    def patch_ratio(self) -> float:
        """How much smaller than on a plane the contact is, at most 1."""
        return self._contact.on(self._surface.shape.radius_m)

    def _make_drag(self) -> TipDrag | SlidingDrag | None:
        """Return what senses the friction from here on, if there is any."""
        friction = self._surface.friction
        return make_drag(friction, self._rate_hz, self._rng, self._batch_shape) if friction else None

    def _blur_and_stiffness(self, force_n: Array) -> tuple[Array, Array]:
        """Return blur and stiffness at forces."""
        ratio = self.patch_ratio
        blur_m: Array = ratio * self._contact.blur_m * np.ones_like(force_n)
        stiffness: Array = ratio * self._contact.stiffness_n_m * (force_n > 0).astype(np.float64)
        for growth in self._blur_growths:
            blur_m = blur_m * growth(force_n)
        for growth in self._gain_growths:
            stiffness = stiffness * growth(force_n)
        return blur_m, stiffness

    def _steps_m(self, placed: Trajectory) -> Array:
        """Return how far it is from point to point, (..., n), or (..., 1) where that hardly matters."""
        x_m, y_m = self._before or before_first(placed)
        self._before = placed.x_m[..., -1:], placed.y_m[..., -1:]
        step_x, step_y = np.diff(placed.x_m, prepend=x_m), np.diff(placed.y_m, prepend=y_m)
        longest = np.abs(step_x).max(initial=0.0) + np.abs(step_y).max(initial=0.0)
        if MIN_BLUR_PER_STEP * longest < self._contact.blur_m / 2:
            return np.zeros_like(placed.x_m[..., :1])
        return np.asarray(np.hypot(step_x, step_y))


def constant(values: Array) -> Array:
    """Return (..., 1) of values that numpy repeats without a copy, as `numpy.broadcast_to` does, else the values."""
    return values[..., :1] if values.strides and values.strides[-1] == 0 and values.shape[-1] else values
