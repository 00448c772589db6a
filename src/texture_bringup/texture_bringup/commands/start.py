# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sub-commands of `texture` that start nodes: those of a launch file, the dashboard, the demonstration."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path

from texture_bringup.launcher import (
    NodeDescription,
    Supervisor,
    all_arguments,
    end_with,
    find_launch_file,
    given_arguments,
    read,
)
from texture_core.cli import Command, add_namespace, add_parameters, add_seed, parameters_from

# Each command imports what it starts when it runs: a launcher is a child of many programs, and is up sooner without.
# ruff: noqa: PLC0415


def _configure_launch(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('file', help="path of a launch file, or the name of one of the suite's, such as emulator")
    parser.add_argument('arguments', nargs='*', default=[], metavar='NAME:=VALUE', help='arguments of the launch file')
    parser.add_argument('--parent', type=int, help=argparse.SUPPRESS)
    parser.add_argument('--show-args', action='store_true', help='show the arguments of the launch file')


def _launch(options: argparse.Namespace) -> int:
    """Run the nodes until they end or Ctrl-C; return 2 if a needed one was started wrongly, 1 if one died, else 0."""
    child = options.parent is not None  # of a program that needs all nodes: it and they end together
    if child:
        end_with(options.parent, signal.SIGINT)
    path = find_launch_file(options.file)
    if options.show_args:
        print(arguments_text(path))
        return 0
    given = given_arguments(options.arguments)
    nodes = read(path, given, os.environ)
    refuse_wrong(nodes, set(given.values()))
    return Supervisor(nodes, _say, together=child).run()


# What a node would refuse, by its program: the parameters of which all are looked at if one of them was given.
LOOKED_AT = {
    'emulator': ('scene', 'surface'),
    'classifier': ('model',),
    'roughness_estimator': ('model',),
    'feature_extractor': ('recipe',),
    'replay': ('bag',),
}


def _look_at(program: str, value: str, *more: str) -> None:
    """Load what a program would load of its parameters; TextureError if it cannot be."""
    if program == 'emulator':
        from texture_simulation.scene import load_scene

        load_scene(value).surface(*more)
    elif program == 'classifier':
        from texture_estimation.model import load_model

        load_model(value)
    elif program == 'roughness_estimator':
        from texture_estimation.roughness import load_roughness_model

        load_roughness_model(value)
    elif program == 'feature_extractor':
        from texture_features.feature_set import FeatureSet

        FeatureSet.load(value)
    else:
        from texture_recordings.bags import find_bags

        find_bags([value])


def refuse_wrong(nodes: Sequence[NodeDescription], given: set[str]) -> None:
    """Raise, before any node starts, the error of a node of the suite for a value that was given.

    In a separate process: libraries that start threads must not be in a launcher.
    """
    wanted = []
    for node in nodes:
        known = {name: value for one in node.parameters if isinstance(one, Mapping) for name, value in one.items()}
        values = [str(known.get(name, '')) for name in LOOKED_AT.get(node.executable, ())]
        if all(values) and given.intersection(values):
            wanted.append((node.executable, *values))
    if wanted:
        with ProcessPoolExecutor(1, get_context('fork')) as pool:
            for one in wanted:
                pool.submit(_look_at, *one).result()


def arguments_text(path: Path) -> str:
    """Return the arguments of a launch file and of those it includes with their defaults, one a line."""
    items = all_arguments(path, os.environ)
    given = [f'{name}:={item.get("default", "(required)")}' for name, item in items.items()]
    width = max(map(len, given), default=0)
    rows = zip(given, items.values(), strict=True)
    return '\n'.join(f'{text:<{width}}  {item.get("description", "")}'.rstrip() for text, item in rows)


def _say(line: str) -> None:
    try:
        print(line, flush=True)
    except BrokenPipeError:
        # Who read along has gone: nothing more can be shown, and the nodes are stopped in good order.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        os.kill(os.getpid(), signal.SIGTERM)


def _configure_dashboard(parser: argparse.ArgumentParser) -> None:
    from texture_bringup.nodes.dashboard import DashboardParams

    add_parameters(parser, DashboardParams)
    add_namespace(parser)


def _dashboard(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    from texture_bringup.nodes.dashboard import DashboardNode, DashboardParams
    from texture_core.ros import run_node

    run_node(DashboardNode, asdict(parameters_from(options, DashboardParams)), options.namespace)
    return 0


def _configure_demo(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--out', type=Path, default=Path('texture-demo'), metavar='DIR', help='folder for the results')
    parser.add_argument('--recipe', default='default', metavar='NAME', help='recipe that is trained (default: default)')
    parser.add_argument('--dashboard', action='store_true', help='serve the web page of the operator while it runs')
    add_seed(parser)


def _demo(options: argparse.Namespace) -> int:
    """Run the demonstration; return 1 if an answer was not as expected."""
    from texture_bringup.demo import demonstrate, line
    from texture_estimation.recipe import load_recipe

    load_recipe(options.recipe)  # refused before the nodes start
    line('Everything physical in this demonstration is simulated: surfaces, arm and sensor.')
    return 0 if demonstrate(options.out, options.recipe, options.seed, dashboard=options.dashboard) else 1


launch = Command('start the nodes of a launch file', _configure_launch, _launch)
dashboard = Command(
    'show a web page of the live estimates, with buttons to explore and stop', _configure_dashboard, _dashboard
)
demo = Command(
    'train on simulated slides, then recognise and reject surfaces on an emulated finger', _configure_demo, _demo
)
