# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sub-commands of `texture` that show catalogues, a bag or a model, and this machine."""

from __future__ import annotations

import argparse
import grp
import inspect
import os
import platform
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import yaml

from texture_core.cli import Command
from texture_core.config import find, folder, shipped
from texture_core.types import NANOSECONDS

# What a command needs is imported when it runs: each looks at other packages.
# ruff: noqa: PLC0415

Row = tuple[str, str]


def table(rows: Iterable[Row]) -> str:
    """Return rows of a name and a text as lines, the texts below each other."""
    rows = list(rows)
    width = max((len(name) for name, _ in rows), default=0)
    return '\n'.join(f'{name:<{width}}  {text}'.rstrip() for name, text in rows)


# --------------------
# List what can be chosen.


def _sensors() -> Iterator[Row]:
    from texture_drivers.catalogue import SENSORS
    from texture_simulation.emulator import LIVE_SENSORS

    for name, sensor in SENSORS.items():
        yield name, sensor.about + ('' if name in LIVE_SENSORS else '; not on the emulator')


def _arms() -> Iterator[Row]:
    from texture_exploration.arms.catalogue import ARMS

    for name, arm in ARMS.items():
        yield name, inspect.cleandoc(arm.__doc__ or '').partition('\n')[0]


def _motions() -> Iterator[Row]:
    from texture_exploration.motions import DEFAULTS
    from texture_exploration.safety import SafetyLimits

    for motion, defaults in DEFAULTS.items():
        ranges = {name: (value, *SafetyLimits().range(name)) for name, value in defaults.items()}
        yield (
            motion,
            ', '.join(
                f'{name} {value:g} ({low:g} to {high:g} {unit})' for name, (value, low, high, unit) in ranges.items()
            ),
        )


def _recipes() -> Iterator[Row]:
    for kind in ('config/recipes', 'config/roughness'):
        ours = folder('texture_estimation', kind)
        # Those of the papers come last.
        for name, path in sorted(shipped('texture_estimation', kind).items(), key=lambda one: one[1].parent != ours):
            yield name, str(yaml.safe_load(path.read_text(encoding='utf-8')).get('description', ''))


def _surfaces() -> Iterator[Row]:
    from texture_simulation.scene import load_scene

    for name in shipped('texture_simulation', 'config/scenes'):
        scene = load_scene(name)
        yield name, f'{scene.sensor}: {", ".join(scene.surfaces)}'


LISTS: Mapping[str, tuple[str, Callable[[], Iterable[Row]]]] = {
    'sensors': ('what `sensor:=` of a launch takes', _sensors),
    'motions': ('what `texture explore` takes, with default and range of each number', _motions),
    'arms': ('what the parameter `arm` of the explorer takes', _arms),
    'recipes': ('what `texture train` takes', _recipes),
    'surfaces': ('what the emulator simulates, by scene', _surfaces),
}


def _configure_list(parser: argparse.ArgumentParser) -> None:
    about = '; '.join(f'{name}: {meaning}' for name, (meaning, _) in LISTS.items())
    parser.add_argument('what', metavar='{' + ','.join(LISTS) + '}', help=about)


def _list(options: argparse.Namespace) -> int:
    print(table(find(LISTS, options.what, 'list')[1]()))
    return 0


# --------------------
# What a bag or a model holds.


def _configure_info(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('path', help='bag, folder of bags, or model')
    parser.add_argument('--namespace', metavar='NS', help='namespace of the recorded nodes, if there are several')


def _info(options: argparse.Namespace) -> int:
    from texture_core.errors import InvalidData
    from texture_recordings.bags import bags_in

    path = Path(options.path)
    # A model is one of two files with the same name; everything else is read as a bag, whose errors are reported.
    endings = ('.npz', '.json')
    half = any(Path(f'{path}{ending}').is_file() for ending in endings)
    if not path.is_dir() and (half or path.suffix in endings):
        print('\n'.join(_model_lines(path)))
        return 0
    if path.is_file() and path.suffix != '.mcap':
        raise InvalidData(f"'{path}' is no bag (a folder, or an .mcap file) and no model (.npz with .json); name one")
    for bag in bags_in(path):
        print(f'{bag}\n{table(_bag_rows(bag, options.namespace))}')
    return 0


def _model_lines(path: Path) -> list[str]:
    from texture_estimation.model import load_model, read_card
    from texture_estimation.roughness import load_roughness_model
    from texture_evaluation.commands.train import graded_summary, summary

    if 'regressor' in read_card(path)['recipe']:
        graded = load_roughness_model(path)
        return [f'roughness model {graded.name}', *graded_summary(graded, path)[:-1]]
    model = load_model(path)
    return [f'model {model.name}', *summary(model, path)[:-1], f'topics: {", ".join(model.recipe.feature_set.topics)}']


def _bag_rows(bag: Path, namespace: str | None) -> Iterator[Row]:
    """Yield number of messages by topic, length, sensors, and the slides over each surface of a bag."""
    from texture_core.errors import counted
    from texture_core.types import ExplorationState, Phase, TactileSignal
    from texture_recordings.bags import read_bag

    counts: Counter[str] = Counter()
    ends: dict[str, tuple[str, Phase]] = {}
    sensors: dict[str, str] = {}
    first_ns = last_ns = 0
    for topic, log_ns, value in read_bag(bag, None, namespace):
        counts[topic] += 1
        first_ns, last_ns = first_ns or log_ns, log_ns
        if isinstance(value, TactileSignal):
            sensors.setdefault(topic, f'{value.sensor}, {len(value.channels)} × {value.sampling_rate_hz:g} Hz')
        elif isinstance(value, ExplorationState) and value.exploration_id:
            ends[value.exploration_id] = value.surface, value.phase
    yield '  length', f'{(last_ns - first_ns) / NANOSECONDS:.1f} s'
    for topic, count in sorted(counts.items()):
        yield f'  {topic}', f'{counted(count, "message")}{f" of {sensors[topic]}" if topic in sensors else ""}'
    for surface in sorted({surface for surface, _ in ends.values()}):
        phases = Counter(phase.value for name, phase in ends.values() if name == surface)
        yield f'  {surface or "(no surface)"}', ', '.join(f'{count} {phase}' for phase, count in phases.items())


# --------------------
# What of this machine matters, on one screen.

PACKAGES = ('texture_core', 'rclpy', 'numpy', 'scipy', 'scikit-learn', 'rosbags', 'ur-rtde', 'miniaudio', 'aiohttp')
GROUPS = {'dialout': 'serial devices', 'audio': 'sound cards', 'realtime': 'real-time priority'}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return 'not installed'


def _ports() -> str:
    from serial.tools import list_ports

    found = [f'{port.device} ({port.description})' for port in list_ports.comports()]
    return ', '.join(found) or 'none; plug the sensor in, and check whether its kernel driver is loaded'


def _groups() -> str:
    mine = set(os.getgroups())
    members = {one.gr_name for one in grp.getgrall() if one.gr_gid in mine}
    return ', '.join(
        f'{name} {"yes" if name in members or not os.geteuid() else "no"} ({use})' for name, use in GROUPS.items()
    )


def _ros() -> str:
    distribution = os.environ.get('ROS_DISTRO', '')
    sourced = [place for place in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if '/opt/ros/' in place]
    where = f'sourced from {sourced[0]}' if sourced else 'from the Python packages of the set-up, none is sourced'
    return f'{distribution or "no distribution"}, {where}'


def _dds() -> str:
    try:
        from texture_bringup.operator import middleware

        name = middleware()
    except Exception as error:  # this command reports any error of a broken installation
        name = f'cannot be loaded: {error}'
    domain, reach = os.environ.get('ROS_DOMAIN_ID', '0'), os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    return f'{name}, domain {domain}, discovery range {reach}'


CHECKS: Mapping[str, Callable[[], str]] = {
    'system': lambda: f'{platform.platform()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}',
    'Python': platform.python_version,
    'ROS': _ros,
    'DDS': _dds,
    'serial ports': _ports,
    'groups': _groups,
    'versions': lambda: ', '.join(f'{name} {_version(name)}' for name in PACKAGES),
}


def _doctor(_options: argparse.Namespace) -> int:
    print(table((name, check()) for name, check in CHECKS.items()))
    return 0


list_ = Command('list what can be chosen: sensors, motions, arms, recipes, surfaces', _configure_list, _list)
info = Command('show what a bag or a model holds', _configure_info, _info)
doctor = Command('show what matters of this machine: ports, groups, ROS, versions', lambda _parser: None, _doctor)
