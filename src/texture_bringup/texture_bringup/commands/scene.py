"""`texture scene`: draw a simulated surface, the way over it, the signal and its spectrum."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from texture_bringup.scene_charts import caption, slide_picture, table_picture
from texture_core.command_options import add_seed
from texture_core.parameters import from_mapping
from texture_simulation.scene import Scene, load_scene
from texture_simulation.scene_view import ViewPlan, view


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
    if options.surface:
        slide_picture(views[0], caption(options.surface, scene.sensor, plan), out)
    else:
        table_picture(views, caption(f'Scene {scene.name}', scene.sensor, plan), out)
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
