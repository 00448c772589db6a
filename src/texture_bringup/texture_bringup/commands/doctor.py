# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""`texture doctor`: show what matters of this machine: ports, groups, ROS, versions."""

from __future__ import annotations

import argparse
import grp
import os
import platform
from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version

PACKAGES = ('texture_core', 'rclpy', 'numpy', 'scipy', 'scikit-learn', 'rosbags', 'ur-rtde', 'miniaudio', 'aiohttp')
GROUPS = {'dialout': 'serial devices', 'audio': 'sound cards', 'realtime': 'real-time priority'}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return 'not installed'


def _ports() -> str:
    from serial.tools import list_ports  # noqa: PLC0415 - looked at here alone

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
        from texture_bringup.operator import middleware  # noqa: PLC0415 - what is broken is told

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


def configure(_parser: argparse.ArgumentParser) -> None:
    """Add no argument."""


def run(_options: argparse.Namespace) -> int:
    """Show a line for each fact."""
    width = max(map(len, CHECKS))
    for name, check in CHECKS.items():
        print(f'{name:<{width}}  {check()}')
    return 0
