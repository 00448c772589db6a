"""The benchmark of motion in reduced size: every figure is there, and within its target."""

from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.motion.tables import robot_table
from texture_benchmarks.motion.trial import radius_error_m
from texture_benchmarks.result import BenchmarkOptions

pytestmark = pytest.mark.realtime


@pytest.mark.benchmark
def test_force_speed_and_circle_are_kept_and_the_limit_is_foretold(tmp_path: Path) -> None:
    result, path = run_benchmark('motion', BenchmarkOptions(tmp_path, quick=True))
    numbers, targets = result.numbers, result.numbers['targets']
    assert path.is_file()
    assert all(chart.is_file() for chart in result.charts)
    assert '| emulated rails | 2000 N/m | circular |' in (tmp_path / 'motion.md').read_text()
    assert set(numbers['robots']) == {'simulated, force mode', 'simulated, velocities only', 'emulated rails'}
    rows = {
        name: [row for both in robot.values() for row in both.values()] for name, robot in numbers['robots'].items()
    }
    assert all(row['success'] for robot in rows.values() for row in robot), rows
    # Those that run in real time are evaluated on a quiet machine only.
    for row in rows['simulated, force mode'] + rows['simulated, velocities only']:
        assert row['force_rms'] <= targets['force_rms']
        assert row['overshoot'] <= targets['overshoot']
        assert row['speed_error'] <= targets['speed_error']
        assert row.get('radius_error_m', 0.0) <= targets['radius_error_m']
    late = [row for rows in numbers['undeclared_lag'].values() for row in rows.values()]
    assert max(row['overshoot'] for row in late) <= targets['overshoot']
    for name, by_lag in numbers['hazards'].items():
        for row in (row for rows in by_lag.values() for row in rows.values()):
            assert row['success'] == name.startswith(('none', 'soft layer', 'step up')), (name, row)
            assert row['peak_n'] < 6.0, (name, row)
    assert numbers['border_error'] <= targets['border_error']
    assert min(numbers['margin'].values()) >= targets['margin']


def test_the_error_of_a_radius_is_the_largest_distance_from_the_circle() -> None:
    angle = np.linspace(0.0, 4.0, 50)
    places = 0.3 + 0.02 * np.column_stack([np.cos(angle), np.sin(angle)])
    assert radius_error_m(places, 0.02) == pytest.approx(0.0, abs=1e-12)
    assert radius_error_m(places, 0.0195) == pytest.approx(0.0005)


def test_the_table_shows_in_bold_what_misses_its_target():
    numbers = {'linear_slide': {'force_rms': 0.05, 'speed_error': 1.5, 'mean_speed_error': 0.5}}
    table = robot_table({'hand': {'200 N/m': numbers}}, {'force_rms': 0.05, 'speed_error': 0.02})
    assert table.splitlines()[-1] == '| hand | 200 N/m | linear_slide | 5.00 |  | **150.00** | 50.00 |  |'
