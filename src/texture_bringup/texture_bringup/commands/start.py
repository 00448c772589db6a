# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sub-commands of `texture` that start nodes: those of a launch file, the dashboard, the demonstration."""

from __future__ import annotations

import argparse
import fcntl
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from importlib import import_module
from multiprocessing import get_context
from operator import attrgetter
from pathlib import Path

from texture_bringup.launcher import (
    NodeDescription,
    Supervisor,
    find_launch_file,
    given_arguments,
    read,
)
from texture_core.cli import Command, add_namespace, add_parameters, add_seed, parameters_from, task
from texture_core.errors import LaunchFailed

# Each command imports what it starts when it runs: a launcher is a child of many programs, and is up sooner without.
# ruff: noqa: PLC0415


def _configure_launch(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('file', help="path of a launch file, or the name of one of the suite's, such as emulator")
    parser.add_argument('arguments', nargs='*', default=[], metavar='NAME:=VALUE', help='arguments of the launch file')
    parser.add_argument('--together', action='store_true', help=argparse.SUPPRESS)


def _launch(options: argparse.Namespace) -> int:
    """Run the nodes until they end or Ctrl-C; return 2 if a needed one was started wrongly, 1 if one died, else 0."""
    given = given_arguments(options.arguments)
    nodes = read(find_launch_file(options.file), given, os.environ)
    refuse_wrong(nodes, set(given.values()))
    return Supervisor(nodes, _say, together=options.together).run()


# By program: the function that loads the first of these parameters, and refuses what the node would refuse.
LOOKED_AT = {
    'emulator': ('texture_simulation.scene', 'load_scene', 'scene', 'surface'),
    'classifier': ('texture_estimation.model', 'load_model', 'model'),
    'roughness_estimator': ('texture_estimation.roughness', 'load_roughness_model', 'model'),
    'feature_extractor': ('texture_features.feature_set', 'FeatureSet.load', 'recipe'),
    'adaptor': ('texture_drivers.adaptor', 'load_mapping', 'mapping'),
    'replay': ('texture_recordings.bags', 'bags_in', 'bag'),
}


def _look_at(module: str, load: str, value: str, *surfaces: str) -> None:
    """Load what a node would load, and the surfaces of a scene; TextureError if they cannot be."""
    loaded = attrgetter(load)(import_module(module))(value)
    for surface in surfaces:
        loaded.surface(surface)


def refuse_wrong(nodes: Sequence[NodeDescription], given: set[str]) -> None:
    """Raise, before any node starts, the error of a node of the suite for a value that was given, or its pipe.

    In a separate process: a launcher that stays needs none of their libraries.
    """
    wanted: list[tuple[str, ...]] = []
    pipes = set()
    for node in sorted(nodes, key=lambda node: node.executable == 'feature_extractor'):  # its recipe may be the model's
        module, load, *names = LOOKED_AT.get(node.executable, ('', ''))
        known = {name: value for one in node.parameters if isinstance(one, Mapping) for name, value in one.items()}
        values = [str(known.get(name, '')) for name in names]
        if node.executable == 'emulator' and 'finger_pipe' in known:  # one uses it; else a recorder has made its bag
            wanted.append(('texture_core.types', 'FingerReceiver', str(known['finger_pipe'])))
            pipes.add(Path(str(known['finger_pipe'])).expanduser())
        if all(values) and given.intersection(values):
            wanted.append((module, load, *values))
    if wanted:
        with ProcessPoolExecutor(1, get_context('fork')) as pool:
            checks = [pool.submit(_look_at, *one) for one in wanted]
            with task('checking the files that the launch names'):  # behind the fork, which copies no thread
                for check in checks:
                    check.result()
    for pipe in pipes:
        claim(pipe)


def claim(pipe: Path) -> None:
    """Hold the pipe of an emulator until this process ends: the sensor of a second launch would read its devices."""
    pipe.parent.mkdir(parents=True, exist_ok=True)
    try:
        fcntl.flock(os.open(f'{pipe}.lock', os.O_RDWR | os.O_CREAT, 0o600), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise LaunchFailed(
            f"another launch has the emulator at '{pipe}'; end it, or give this one another namespace"
        ) from error


def _say(line: str) -> None:
    try:
        print(f'{line}\n', end='', flush=True)  # in one piece: nodes write at the same time
    except UnicodeEncodeError:  # the encoding of the output lacks a letter
        _say(ascii(line))
    except OSError:
        # Who read along has gone, or the disk is full: nothing more can be shown, and the nodes are stopped in good
        # order. Not raised: the output of a node must be read to its end, or the node stands still.
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
