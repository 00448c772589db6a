"""Rules for every test of the repository."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Collect doctests from the modules that hold one and need no ROS; others are not even imported."""
    is_module = collection_path.suffix == '.py' and not collection_path.name.startswith(('test_', 'conftest'))
    if not config.getoption('doctestmodules') or not is_module:
        return None
    needs_ros = bool({'nodes', 'ros'} & set(collection_path.parts))
    return True if needs_ros or '>>> ' not in collection_path.read_text(encoding='utf-8') else None


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Fail the run on the build server when a test was skipped: a skipped check counts as no check."""
    reporter = session.config.pluginmanager.get_plugin('terminalreporter')
    skipped = reporter.stats.get('skipped', []) if reporter else []
    if os.environ.get('CI') and skipped and exitstatus == pytest.ExitCode.OK:
        reporter.write_line(f'{len(skipped)} tests were skipped; on the build server every test must run', red=True)
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
