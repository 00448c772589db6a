# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sub-commands of `texture` that start nodes: those of a launch file, the dashboard, the demonstration."""

from __future__ import annotations

import argparse
import fcntl
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, fields, is_dataclass
from difflib import get_close_matches
from importlib import import_module
from importlib.util import find_spec
from multiprocessing import Pipe, get_context
from multiprocessing.connection import Connection
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from texture_bringup.launcher import (
    EXPLORER,
    STOPPING_SIGNALS,
    VARIABLE,
    NodeDescription,
    Supervisor,
    find_launch_file,
    given_arguments,
    read,
)
from texture_core.cli import Command, add_namespace, add_parameters, add_seed, parameters_from, task
from texture_core.config import (
    check_parameter_file,
    find,
    folder,
    from_mapping,
    parameter_sections,
    parameters_of,
    reaches,
    ros_domain,
)
from texture_core.errors import InvalidLaunch, InvalidParameter, LaunchFailed, TextureError, UnknownName

# Each command imports what it starts when it runs: a launcher is a child of many programs, and is up sooner without.
# ruff: noqa: PLC0415


def _configure_launch(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('file', help="path of a launch file, or the name of one of the suite's, such as emulator")
    parser.add_argument('arguments', nargs='*', default=[], metavar='NAME:=VALUE', help='arguments of the launch file')
    parser.add_argument('--together', action='store_true', help=argparse.SUPPRESS)


def _launch(options: argparse.Namespace) -> int:
    """Run the nodes until they end or Ctrl-C; return 2 if a needed one was started wrongly, 1 if one died, else 0."""
    ros_domain()
    nodes = read(find_launch_file(options.file), given_arguments(options.arguments), os.environ)
    refuse_wrong(nodes)
    for line in raised_limits(nodes):
        _say(f'[launch] warning: {line}')
    return Supervisor(nodes, _say, together=options.together).run()


def _call(name: str, *values: Any) -> Any:
    module, _, function = name.partition(':')
    return attrgetter(function)(import_module(module))(*values)


# By program: what loads the files and names among its parameters, and refuses what the node would refuse.
LOADED: Mapping[str, Callable[[Any], Any]] = {
    'emulator': lambda given: _call('texture_simulation.scene:load_scene', given.scene).surface(given.surface),
    'classifier': lambda given: given.model and _call('texture_estimation.model:load_model', given.model),
    'roughness_estimator': lambda given: (
        given.model and _call('texture_estimation.roughness:load_roughness_model', given.model)
    ),
    'feature_extractor': lambda given: _call('texture_features.feature_set:FeatureSet.load', given.recipe),
    'adaptor': lambda given: _call('texture_drivers.nodes.adaptor:load_messages', given.mapping, given.finger),
    'record': lambda given: given.out and _call('texture_recordings.bags:refuse_existing', given.out),
    'replay': lambda given: (
        given.bag
        and (
            _call('texture_recordings.slides:find_slides', [given.bag], given.slides, given.from_namespace or None)
            if given.slides
            else _call('texture_recordings.bags:bags_in', given.bag)
        )
    ),
    'sensor': lambda given: _call('texture_drivers.catalogue:make_sensor', given, time.time_ns),
}
OF_ROS = {'use_sim_time', 'start_type_description_service'}  # parameters of every node


def refuse_wrong(nodes: Sequence[NodeDescription]) -> None:
    """Raise, before any node starts, what a node of the suite would refuse of its parameters and files, or its pipe.

    In a separate process: a launcher that stays needs none of their libraries.
    """
    ours, theirs = Pipe(duplex=False)
    checking = get_context('fork').Process(target=_answer, args=(theirs, nodes), daemon=True)
    # In that process for good: this one kills it. Here until it is known.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOPPING_SIGNALS)
    checking.start()
    theirs.close()
    try:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        with task('checking what the launch was given'):  # behind the fork, which copies no thread
            pipes = ours.recv()
    except EOFError as error:
        raise LaunchFailed(
            'what checks the arguments has ended without an answer; look at the lines above, and at the free memory'
        ) from error
    finally:
        checking.kill()
        checking.join()
    if isinstance(pipes, Exception):
        raise pipes
    for pipe in pipes:
        claim(Path(pipe).expanduser())


def _answer(asked: Connection, nodes: Sequence[NodeDescription]) -> None:
    """Send what `_check` returns, or the error of the user that it raises."""
    answer: list[str] | Exception
    try:
        answer = _check(nodes)
    except (TextureError, OSError) as error:
        answer = error
    asked.send(answer)


def _check(nodes: Sequence[NodeDescription]) -> list[str]:
    """Raise the first error in the parameters of some nodes and in their files; return the pipes of the emulators."""
    settings = [(node, _settings(node, nodes)) for node in nodes if _known(node)]
    loaded: dict[str, dict[tuple[str, str], Any]] = {}  # by program and the topic of the features
    # The recipe may be that of the model, which is looked at first.
    for node, given in sorted(settings, key=lambda one: one[0].executable == 'feature_extractor'):
        features = dict(node.remappings).get('features', 'features')
        if node.executable in LOADED:
            loaded.setdefault(node.executable, {})[node.namespace, features] = LOADED[node.executable](given)
    for place, extracted in loaded.get('feature_extractor', {}).items():
        for program in ('classifier', 'roughness_estimator'):
            model = loaded.get(program, {}).get(place)
            if model and (misfit := _call('texture_features.feature_set:recipe_misfit', extracted, model.feature_set)):
                raise InvalidLaunch(
                    f"the recipe does not fit model '{model.name}': {misfit}; leave recipe:= out, and it is that "
                    'of the model'
                )
    emulators = [node for node, _ in settings if node.executable == 'emulator']
    pipes = [str(part['finger_pipe']) for node in emulators for _, _, part in _sections(node) if 'finger_pipe' in part]
    for pipe in pipes:  # one uses it; else a recorder has made its bag
        _call('texture_core.types:FingerReceiver', pipe).close()
    return pipes


def _known(node: NodeDescription) -> bool:
    return node.package.startswith('texture_') and find_spec(f'{node.package}.nodes.{node.executable}') is not None


def _sections(node: NodeDescription) -> Iterator[tuple[Path | None, str, Mapping[str, Any]]]:
    """Yield what is given to a node in its order: parameter file or None, section, and values by name."""
    for item in node.parameters:
        if isinstance(item, Path) and node.executable == EXPLORER:
            check_parameter_file(item, node.full_name)  # limits in a misnamed section would have no effect
        found = [('', item)] if isinstance(item, Mapping) else parameter_sections(item)
        for section, values in found:
            if not section or reaches(section, node.full_name):
                yield item if isinstance(item, Path) else None, section, values


def _classes(node: NodeDescription, arm: str = '') -> list[type]:
    """Return the parameter classes that the module of a node names, with those of an arm, or of all: as files serve."""
    module = vars(import_module(f'{node.package}.nodes.{node.executable}'))
    own = [one for one in module.values() if isinstance(one, type) and is_dataclass(one)]
    arms = module.get('ARMS', {})
    chosen = [find(arms, arm, 'arm')] if arms and arm else arms.values()
    own = [one for one in own if any('description' in item.metadata for item in fields(one))]
    return [*own, *(one.Params for one in chosen)]


def _names(node: NodeDescription) -> set[str]:
    return OF_ROS | {item.name for one in _classes(node) for item in parameters_of(one)}


def _settings(node: NodeDescription, nodes: Sequence[NodeDescription]) -> SimpleNamespace:
    """Return all parameters of a node, each checked where it was given; TextureError for one that no node has."""
    given = list(_sections(node))
    arm = {name: value for _, _, values in given for name, value in values.items()}.get('arm', 'simulated')
    classes = _classes(node, str(arm))
    items = {item.name: item for one in classes for item in parameters_of(one)}
    values: dict[str, Any] = {}
    for path, section, part in given:
        for name, value in part.items():
            where = f"parameter file '{path}'" if path else _argument(node, name)
            if name in items:
                try:
                    values[name] = items[name].check(_number(items[name].type, value))
                except InvalidParameter as error:
                    raise InvalidParameter(f"{where}, node '{node.label}': {error}") from error
            elif not name.startswith('qos_overrides.'):
                readers = [one for one in nodes if path in one.parameters and reaches(section, one.full_name)] or [node]
                if all(_known(one) and name not in _names(one) for one in readers):
                    near = get_close_matches(name, set().union(*map(_names, readers)), n=1)
                    hint = f"; did you mean '{near[0]}'?" if near else ';'
                    raise UnknownName(
                        f"{where}: no parameter '{name}' of {', '.join(one.label for one in readers)}{hint} correct or "
                        'remove it, docs/reference/parameters.md has all names'
                    )
    settings = SimpleNamespace()
    for one in classes:
        made: object = from_mapping(
            one, {item.name: values[item.name] for item in parameters_of(one) if item.name in values}, node.label
        )
        vars(settings).update(vars(made))
    return settings


def _argument(node: NodeDescription, name: str) -> str:
    """Return where a launch file has the value of a parameter: its argument, or the node."""
    found = VARIABLE.findall(node.origins.get(name, ''))
    return f"launch argument '{found[0]}'" if found else 'launch file'


def _number(kind: type, value: Any) -> Any:
    """Return a number such as 1e-3, which ROS reads in a file and YAML takes for a text."""
    if kind is float and isinstance(value, str):
        with suppress(ValueError):
            return float(value)
    return value


def raised_limits(nodes: Sequence[NodeDescription]) -> Iterator[str]:
    """Yield a sentence for each force limit that a user's file sets above that of the preset of the robot."""
    for node in (node for node in nodes if node.executable == EXPLORER):
        found = [(path, values) for path, _, values in _sections(node)]
        if any(values.get('arm') == 'ur' for _, values in found):  # a file for it begins as a copy of this preset
            path = folder('texture_bringup', 'config/robots') / 'ur5e.yaml'
            found[:0] = [(path, values) for _, values in parameter_sections(path)]
        for name in ('max_force_n', 'force_limit_n'):
            given = [(path, float(values[name])) for path, values in found if name in values]
            safe = [(path.stem, force_n) for path, force_n in given if path and path.parent.name == 'robots']
            for preset, safe_n in safe[-1:]:
                file, force_n = given[-1]
                if force_n > safe_n:
                    yield f"'{name}' is {force_n:g} N by '{file}', above the {safe_n:g} N of the preset '{preset}'"


def claim(pipe: Path) -> None:
    """Hold the pipe of an emulator until this process ends: the sensor of a second one would read its devices."""
    pipe.parent.mkdir(parents=True, exist_ok=True)
    try:
        fcntl.flock(os.open(f'{pipe}.lock', os.O_RDWR | os.O_CREAT, 0o600), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise LaunchFailed(
            f"another emulator, of this launch or another one, has the pipe '{pipe}'; end that launch, or give each of "
            'them another argument `namespace`: push_ros_namespace alone does not name the folder of its devices'
        ) from error


def _say(line: str) -> None:
    try:
        print(f'{line}\n', end='', flush=True)  # in one piece: nodes write at the same time
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
