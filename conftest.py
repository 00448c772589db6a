"""Rules for every test of the repository."""

from __future__ import annotations

import os

import pytest


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Fail the run on the build server when a test was skipped: a skipped check counts as no check."""
    reporter = session.config.pluginmanager.get_plugin('terminalreporter')
    skipped = reporter.stats.get('skipped', []) if reporter else []
    if os.environ.get('CI') and skipped and exitstatus == pytest.ExitCode.OK:
        reporter.write_line(f'{len(skipped)} tests were skipped; on the build server every test must run', red=True)
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
