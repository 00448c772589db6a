# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A machine that only records needs the messages, the core, the drivers and this package, and no numerical library."""

import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray

from texture_core.ros import has_ended
from texture_core.ros_testing import LocalGraph
from texture_recordings.bags import read_bag

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

DOMAIN = 96
STOP_DEADLINE_S = 30.0
# Runs main() of the module named first, in a Python to which other packages are not installed.
ALONE = """
import importlib, sys

SUITE = {'texture_core', 'texture_drivers', 'texture_msgs', 'texture_recordings'}
ABSENT = {'joblib', 'matplotlib', 'nltk', 'pymoo', 'scipy', 'skops', 'sklearn'}

class Absent:
    def find_spec(self, name, path=None, target=None):
        package = name.partition('.')[0]
        if package in ABSENT or (package.startswith('texture_') and package not in SUITE):
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)

sys.meta_path.insert(0, Absent())
importlib.import_module(sys.argv.pop(1)).main()
"""
# A sensor whose samples are their numbers.
COUNTING = """
import time

import numpy as np

from texture_core.types import TactileSignal

class Counting:
    counts, expected_rates_hz = {}, {'signal': 1000.0}

    def __init__(self, params, now_ns):
        self.now_ns, self.first = now_ns, 0

    def open(self):
        pass

    close = open

    def read(self):
        time.sleep(0.01)
        samples = self.first + np.arange(10, dtype=np.float32)[:, None]
        self.first += 10
        return {'signal': [TactileSignal(self.now_ns(), 's', ('film',), (), 1000.0, self.first - 10, samples)]}
"""


@contextmanager
def alone(module: str, log: Path, **parameters: str) -> Iterator[subprocess.Popen]:
    """Run a single node, and end it as Ctrl-C does."""
    given = [part for name, value in parameters.items() for part in ('-p', f'{name}:={value}')]
    command = [sys.executable, '-c', ALONE, module, '--ros-args', *given]
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(DOMAIN)}
    environment['PYTHONPATH'] = f'{log.parent}:{environment.get("PYTHONPATH", "")}'
    with log.open('w') as file:
        process = subprocess.Popen(command, env=environment, stdout=file, stderr=subprocess.STDOUT)
    try:
        yield process
    finally:
        process.send_signal(2)
        try:
            process.wait(STOP_DEADLINE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def recorded(reports: list[DiagnosticArray]) -> int:
    """Return how many samples the recorder reports."""
    values = [value for report in reports for status in report.status for value in status.values]
    return max((int(value.value) for value in values if value.key == 'samples /signal'), default=0)


def ended(reports: list[DiagnosticArray]) -> list[str]:
    """Return the nodes that reported their end."""
    return [status.name for report in reports for status in report.status if has_ended(status)]


@contextmanager
def recording(folder: Path) -> Iterator[tuple[LocalGraph, list[DiagnosticArray], subprocess.Popen, subprocess.Popen]]:
    """Run a recorder and a sensor, and end them; give the graph, the diagnostics and both processes."""
    (folder / 'counting.py').write_text(COUNTING)
    with LocalGraph(DOMAIN, deadline_s=60.0) as graph:
        reports = graph.listen(DiagnosticArray, '/diagnostics')
        with (
            alone('texture_recordings.nodes.record', folder / 'record.log', out=str(folder / 'bag')) as record,
            alone('texture_drivers.nodes.sensor', folder / 'sensor.log', sensor='counting:Counting') as sensor,
        ):
            yield graph, reports, record, sensor
        if record.returncode == 0:
            graph.until(lambda: ended(reports) == ['/record'])


def samples_in_order(bag: Path) -> int:
    """Return how many samples a bag has, each of which has the value of its number."""
    batches = [batch for _, _, batch in read_bag(bag, ('signal',))]
    assert all(batch.samples[0] == batch.first_sample for batch in batches)
    return sum(len(batch.samples) for batch in batches)


def test_a_sensor_is_recorded_without_numerical_libraries_and_without_the_rest_of_the_suite(tmp_path: Path) -> None:
    with recording(tmp_path) as (graph, reports, record, sensor):
        graph.until(lambda: recorded(reports) > 300 or record.poll() is not None or sensor.poll() is not None)
        assert not ended(reports)
    logs = '\n'.join(log.read_text() for log in tmp_path.glob('*.log'))
    assert (record.returncode, sensor.returncode) == (0, 0), logs
    assert samples_in_order(tmp_path / 'bag') > 300


def test_what_a_recorder_has_until_a_second_before_it_is_killed_is_read(tmp_path: Path) -> None:
    with recording(tmp_path) as (graph, reports, record, _):
        graph.until(lambda: recorded(reports[:-6]) > 300)  # reports of the last three seconds
        record.kill()
    assert samples_in_order(tmp_path / 'bag') > 1000


def test_a_recorder_on_a_full_disk_ends_with_one_sentence_and_keeps_what_it_has(tmp_path: Path) -> None:
    file = tmp_path / 'bag' / 'bag.mcap'
    with recording(tmp_path) as (graph, reports, record, _):
        graph.until(lambda: recorded(reports) > 300 and file.stat().st_size > 10_000)  # more than the log
        resource.prlimit(record.pid, resource.RLIMIT_FSIZE, (file.stat().st_size + 100, -1))
        graph.until(lambda: record.poll() is not None)
    log = (tmp_path / 'record.log').read_text()
    assert record.returncode == 2, log
    assert "bag' cannot be written: File too large; name another folder, or free some space" in log
    assert 'Traceback' not in log
    assert 'FATAL' not in log
    assert samples_in_order(tmp_path / 'bag') > 300


@pytest.mark.parametrize('module', ['texture_features.features.spectral', 'scipy.signal'])
def test_what_is_absent_here_cannot_be_imported(module: str) -> None:
    done = subprocess.run([sys.executable, '-c', ALONE, module], check=False, capture_output=True, text=True)
    assert 'ModuleNotFoundError' in done.stderr
