# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""`texture scene`: draw a simulated surface, the path over it, the signal and its spectrum."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.cli import add_seed
from texture_core.config import from_mapping
from texture_evaluation.charts import COLOURS, chart
from texture_simulation.scene import Scene, load_scene
from texture_simulation.scene_view import SceneView, ViewPlan, view

# --------------------
# Pictures of simulated scenes: surfaces below each other.

MM, UM = 1e3, 1e6
SHOWN_S = 0.25
MIN_DENSITY = 1e-6  # of the highest: what lies below is not shown
RELIEF_COLOURS = 'cividis'


def picture(views: Sequence[SceneView], title: str, path: str | Path) -> Path:
    """Draw surfaces, one in each row: relief with the path of the finger, profile, signal and spectrum."""
    alone = len(views) == 1  # its panels are two by two, so that they can be read in a page
    with chart(path, (8.6, 5.6) if alone else (13.0, 0.8 + 1.75 * len(views)), title) as figure:
        if alone:
            rows = figure.subplots(2, 2).reshape(1, 4)
        else:
            rows = figure.subplots(len(views), 4, squeeze=False, width_ratios=[1.5, 1, 1, 1])
        for (relief, profile, signal, spectrum), view in zip(rows, views, strict=True):
            image = _relief(relief, view)
            figure.colorbar(image, ax=relief, label='µm', fraction=0.03)
            relief.set_title(view.surface, fontweight='bold')
            _profile(profile, view)
            _signal(signal, view)
            _spectrum(spectrum, view)
        power = 'its power' + ('; dotted: speed / pitch' if any(view.lines_hz for view in views) else '')
        for axes, name in zip(rows[0][1:], ('height along the path', 'signal', power), strict=True):
            axes.set_title(name)
        below = -0.22 if alone else -0.3
        rows[0][1].legend(loc='upper center', bbox_to_anchor=(0.5, below), ncols=2, fontsize=8 if alone else 7)
    return Path(path)


def caption(name: str, sensor: str, plan: ViewPlan) -> str:
    """Return what is shown, in one line."""
    way = f'a circle of {MM * plan.radius_m:g} mm' if plan.radius_m else 'a line'
    return f'{name}, simulated: along {way} at {plan.speed_m_s:g} m/s with {plan.force_n:g} N ({sensor})'


def _relief(axes: Any, view: SceneView) -> Any:
    image = axes.imshow(
        UM * view.relief_m,
        origin='lower',
        extent=[MM * edge for edge in view.extent_m],
        cmap=RELIEF_COLOURS,
        aspect='equal',
    )
    axes.plot(MM * view.way.x_m, MM * view.way.y_m, color='white', linewidth=2.4)
    axes.plot(MM * view.way.x_m, MM * view.way.y_m, color=COLOURS[5], linewidth=1.2)
    axes.plot(MM * view.way.x_m[0], MM * view.way.y_m[0], 'o', color=COLOURS[5], markeredgecolor='white')
    axes.grid(visible=False)
    axes.set_anchor('W')
    axes.set(xlabel='x (mm)', ylabel='y (mm)')
    return image


def _profile(axes: Any, view: SceneView) -> None:
    axes.plot(MM * view.along_m, UM * view.sharp_m, color=COLOURS[4], linewidth=0.8, label='as it is')
    axes.plot(MM * view.along_m, UM * view.blurred_m, color=COLOURS[0], linewidth=1.2, label='as the skin measures it')
    axes.set(xlabel='path (mm)', ylabel='height (µm)')
    axes.set_xlim(0, MM * view.along_m[-1])


def _signal(axes: Any, view: SceneView) -> None:
    shown = view.time_s <= SHOWN_S
    axes.plot(view.time_s[shown], view.signal[shown], color=COLOURS[0], linewidth=0.8)
    axes.set(xlabel='time (s)', ylabel=f'signal ({view.unit})')


def _spectrum(axes: Any, view: SceneView) -> None:
    axes.semilogy(view.frequency_hz[1:], view.density[1:], color=COLOURS[0], linewidth=1.0)
    for line in view.lines_hz:
        axes.axvline(line, color=COLOURS[5], linestyle=':', linewidth=1.2)
    axes.set(xlabel='frequency (Hz)', ylabel=f'{view.unit}²/Hz')
    axes.set_xlim(0, view.frequency_hz[-1])
    highest = view.density[1:].max()
    if highest > 0:
        axes.set_ylim(max(view.density[1:].min() / 2, MIN_DENSITY * highest), 3 * highest)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    usual = ViewPlan()
    parser.add_argument('name', help='scene that is shipped, such as ets_fine, or path of a scene file')
    parser.add_argument('surface', nargs='?', help='one of its surfaces; all below each other if not given')
    parser.add_argument('-o', '--out', type=Path, metavar='PNG', help='picture to write; default: out/scenes/NAME.png')
    parser.add_argument('--speed', type=float, default=usual.speed_m_s, metavar='M_S', help='m/s')
    parser.add_argument('--force', type=float, default=usual.force_n, metavar='N', help='N')
    parser.add_argument('--duration', type=float, default=usual.duration_s, metavar='S', help='of the slide, s')
    parser.add_argument('--direction', type=float, default=0.0, metavar='DEG', help='of travel, from +x towards +y')
    parser.add_argument('--radius', type=float, default=0.0, metavar='M', help='of a circle, m; 0: a line')
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Draw, and say what the scene is."""
    scene = load_scene(options.name)
    plan = from_mapping(
        ViewPlan,
        {
            'speed_m_s': options.speed,
            'force_n': options.force,
            'duration_s': options.duration,
            'direction_rad': math.radians(options.direction),
            'radius_m': options.radius,
        },
        'texture scene',
    )
    out = options.out or Path('out/scenes') / ('_'.join(filter(None, (scene.name, options.surface))) + '.png')
    rng = np.random.default_rng(options.seed)
    names = [options.surface] if options.surface else list(scene.surfaces)
    views = [view(scene, name, plan, rng) for name in names]
    picture(views, caption(options.surface or f'Scene {scene.name}', scene.sensor, plan), out)
    for line in summary(scene):
        print(line)
    print(f'  {out}')
    return 0


def summary(scene: Scene) -> list[str]:
    """Return what a scene holds, in lines."""
    return [
        f'scene {scene.name}: {scene.about}' if scene.about else f'scene {scene.name}',
        f'surfaces: {", ".join(scene.surfaces)}',
        f'sensor: {scene.sensor}; effects: {", ".join(scene.effects) or "none"}',
    ]
