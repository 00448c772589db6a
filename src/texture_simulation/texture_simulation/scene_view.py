# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""One slide over a simulated surface, from the relief to the spectrum, as arrays to be drawn."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import welch

from texture_core.config import find, param
from texture_core.types import Array
from texture_simulation.path import SimulatedSlide, Trajectory
from texture_simulation.scene import Scene
from texture_simulation.sensor_models import SENSORS
from texture_simulation.surfaces import MIN_BLUR_M, Circles, Grating, Grid, Surface, Weave

MIN_SIDE_M = 8e-3  # of the relief that is shown
MAX_POINTS = 700  # of the relief along its longer side
PROFILE_M = 15e-3  # as much of the way is shown as a profile
SEGMENT_S = 0.25  # of the spectrum


@dataclass(frozen=True)
class ViewPlan:
    """The slide that is shown."""

    speed_m_s: float = param(
        0.1,
        'Speed along the surface; a higher speed raises all frequencies of the signal.',
        unit='m/s',
        low=0.001,
        high=1.0,
    )
    force_n: float = param(2.0, 'Normal force; a larger force gives a stronger signal.', unit='N', low=0.01, high=20.0)
    duration_s: float = param(
        0.5, 'Duration of the slide; a longer slide shows more of the surface.', unit='s', low=0.05, high=20.0
    )
    direction_rad: float = param(
        0.0, 'Direction of travel, from +x towards +y.', unit='rad', low=-2 * math.pi, high=2 * math.pi
    )
    radius_m: float = param(0.0, 'Radius of a circle; 0 is a straight line.', unit='m', low=0.0, high=0.5)

    @property
    def sliding(self) -> SimulatedSlide:
        """The same as the simulation takes it."""
        return SimulatedSlide(self.speed_m_s, self.force_n, self.duration_s, self.direction_rad, self.radius_m)


@dataclass(frozen=True, eq=False)
class SceneView:
    """One slide."""

    surface: str
    sensor: str
    channel: str
    relief_m: Array
    extent_m: tuple[float, float, float, float]
    way: Trajectory
    along_m: Array
    sharp_m: Array
    blurred_m: Array
    time_s: Array
    signal: Array
    frequency_hz: Array
    density: Array
    lines_hz: Sequence[float]
    unit: str


def view(scene: Scene, surface: str, plan: ViewPlan, rng: np.random.Generator) -> SceneView:
    """Return one slide over a surface at the exact speed and force of the plan, with the other effects of the scene."""
    touched = scene.surface(surface)
    kind = find(SENSORS, scene.sensor, 'sensor model')
    model = kind.make(scene, touched, rng, settled=True)
    n_points = kind.step_points * math.ceil(plan.duration_s * kind.path_rate_hz / kind.step_points)
    speed, force = np.array([plan.speed_m_s]), np.array([plan.force_n])
    path = plan.sliding.steady_path(speed, force, n_points, kind.path_rate_hz)
    x_m, y_m = model.touch.start_m
    signal = model.streams(path, slow=False)[kind.fast.topic][:, 0]
    way = path.moved(x_m, y_m)
    shown = way.at(slice(0, max(2, round(PROFILE_M / plan.speed_m_s * kind.path_rate_hz))))
    n_segment = min(len(signal), round(SEGMENT_S * kind.fast.rate_hz))
    frequency_hz, density = welch(signal, kind.fast.rate_hz, nperseg=n_segment)
    relief_m, extent_m = _relief(touched, way)
    return SceneView(
        surface=surface,
        sensor=scene.sensor,
        channel=kind.fast.channels[0],
        relief_m=relief_m,
        extent_m=extent_m,
        way=way,
        along_m=plan.speed_m_s / kind.path_rate_hz * np.arange(len(shown), dtype=np.float64),
        sharp_m=_height(touched, shown, MIN_BLUR_M),
        blurred_m=_height(touched, shown, model.touch.blur_m(plan.force_n)),
        time_s=np.arange(len(signal), dtype=np.float64) / kind.fast.rate_hz,
        signal=signal,
        frequency_hz=frequency_hz,
        density=density,
        lines_hz=[] if plan.radius_m else lines_hz(touched, plan.speed_m_s, plan.direction_rad),
        unit=kind.fast.unit,
    )


def _height(surface: Surface, way: Trajectory, blur_m: float) -> Array:
    return surface.height_m(way.x_m, way.y_m, np.full(1, blur_m))


def _relief(surface: Surface, way: Trajectory) -> tuple[Array, tuple[float, float, float, float]]:
    """Return the height over a rectangle around a way, and its edges."""
    edges = []
    for place in (way.x_m, way.y_m):
        middle, half = (place.max() + place.min()) / 2, max(MIN_SIDE_M, np.ptp(place) + MIN_SIDE_M / 4) / 2
        edges.append((float(middle - half), float(middle + half)))
    longest = max(high - low for low, high in edges)
    x_m, y_m = (np.linspace(low, high, round(MAX_POINTS * (high - low) / longest)) for low, high in edges)
    grid_x, grid_y = np.meshgrid(x_m, y_m)
    return surface.height_m(grid_x, grid_y, np.full((1, 1), MIN_BLUR_M)), (*edges[0], *edges[1])


def lines_hz(surface: Surface, speed_m_s: float, direction_rad: float) -> list[float]:
    """Return where ridges have their first line on a straight slide: speed · |cos(angle to the ridges)| / pitch."""
    waves = [wave for term in surface.terms for wave in WAVES.get(type(term), _no_waves)(term)]
    lines = [speed_m_s * abs(math.cos(angle - direction_rad)) / pitch for pitch, angle in waves]
    return sorted({round(line, 6) for line in lines if line > 1e-3})


def _no_waves(term: Any) -> list[tuple[float, float]]:
    return []


# Pitch and direction of the straight waves of a kind of relief.
WAVES: Mapping[type, Callable[[Any], list[tuple[float, float]]]] = {
    Grating: lambda term: [(term.pitch_m, term.angle_rad)],
    Grid: lambda term: [(term.pitch_x_m, term.angle_rad), (term.pitch_y_m, term.angle_rad + math.pi / 2)],
    Weave: lambda term: [(term.pitch_x_m, 0.0), (term.pitch_y_m, math.pi / 2)],
    Circles: _no_waves,  # their angle changes on the way
}
