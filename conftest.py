# SPDX-License-Identifier: Apache-2.0
"""Rules for every test of the repository."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import pytest

# Files that hold no such test are not imported by `-m realtime` and `-m benchmark`: each worker saves seconds.
NAMED_MARKERS = ('realtime', 'benchmark')
SYSTEM_LIBRARIES = ('PortAudio is not installed', 'ALSA is not installed')  # why tests of sound cards are skipped
SYSTEM = 'texture_bringup'  # the package whose realtime tests start all nodes


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import only files with a test that was asked for, and doctests only of modules that need no ROS."""
    if collection_path.suffix != '.py' or collection_path.name == 'conftest.py':
        return None
    text = _text(collection_path)
    if collection_path.name.startswith('test_'):
        return True if any(marker not in text for marker in asked_for(config.getoption('markexpr'))) else None
    needs_ros = bool({'nodes', 'ros', 'ros.py', 'ros_testing.py', 'operator.py'} & set(collection_path.parts))
    return True if config.getoption('doctestmodules') and (needs_ros or '>>> ' not in text) else None


def asked_for(expression: str) -> list[str]:
    """Return the markers that each test must have which an expression of `-m` selects."""
    terms = [] if re.search(r'\bor\b|[()]', expression) else expression.split(' and ')
    return [marker for marker in NAMED_MARKERS if marker in terms]


def pytest_collection_modifyitems(items: list[pytest.Item], config: pytest.Config) -> None:
    """Refuse a marked test whose file does not name the marker: `-m` would not find it. Spread tests of all nodes."""
    for item in items:
        for marker in NAMED_MARKERS:
            if item.get_closest_marker(marker) and marker not in _text(item.path):
                raise pytest.UsageError(f"{item.path} does not name the marker '{marker}' of its test {item.name}")
    if 'realtime' in asked_for(config.getoption('markexpr')):
        order = {path: place for place, path in enumerate(spread(list(dict.fromkeys(item.path for item in items))))}
        items.sort(key=lambda item: order[item.path])


def spread(paths: Sequence[Path]) -> list[Path]:
    """Return the files with those that start the whole suite spread over the others.

    A few of them at once need the whole machine, and then samples are lost. The longest are last in the alphabet, so
    they come first.
    """
    system = [path for path in paths if SYSTEM in path.parts][::-1]
    others = [path for path in paths if SYSTEM not in path.parts]
    places = {path: place / len(own) for own in (system, others) for place, path in enumerate(own)}
    return sorted([*system, *others], key=places.__getitem__)


@cache
def _text(path: Path) -> str:
    return path.read_text(encoding='utf-8')


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Fail the run on the build server when a test was skipped: a skipped check counts as no check.

    Only the lack of a system library that the set-up cannot install is allowed; pytest names each of these tests.
    """
    reporter = session.config.pluginmanager.get_plugin('terminalreporter')
    reports = reporter.stats.get('skipped', []) if reporter else []
    skipped = [report for report in reports if not any(reason in str(report.longrepr) for reason in SYSTEM_LIBRARIES)]
    if os.environ.get('CI') and skipped and exitstatus == pytest.ExitCode.OK:
        reporter.write_line(f'{len(skipped)} tests were skipped; on the build server every test must run', red=True)
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
