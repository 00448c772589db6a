# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sweep in virtual time: forces stay within their limits, and every end has a name."""

from pathlib import Path

import pytest

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.motion import ForceTrial, explored
from texture_benchmarks.study import BenchmarkOptions

MOST_N = {
    'stiffness as declared': 6.0,
    '20 kN/m declared': 6.0,
    'wall of 20 kN/m in the slide': 45.0,
    'wrong signs and axes': 10.0,
    'surface upside down': 10.0,
}
TRIALS = [
    (ForceTrial('20 kN/m declared', stiffness_n_m=20000.0, delay_s=0.02), 'success'),
    (ForceTrial('20 kN/m declared', stiffness_n_m=2000.0, delay_s=0.05, noise_n=0.02), 'success'),
    (ForceTrial('wall of 20 kN/m in the slide', delay_s=0.02, speed_m_s=0.05, wall_m=0.015), 'FORCE_LIMIT'),
    (ForceTrial('wall of 20 kN/m in the slide', delay_s=0.05, speed_m_s=0.02, wall_m=0.015), 'FORCE_LIMIT'),
    (ForceTrial('wall of 20 kN/m in the slide', delay_s=0.05, speed_m_s=0.05, wall_m=0.015), 'refused'),
    (ForceTrial('wrong signs and axes', fault='force sign'), 'FORCE_SENSOR'),
    (ForceTrial('surface upside down', 500.0, delay_s=0.02, height_m=0.001, fault='upside down'), 'MOTION_FAILED'),
    (ForceTrial('a sample that is no number', bad='rotation 2 nan', phase='slide'), 'ARM_FAULT'),
    (ForceTrial('two explorers', found_s=0.5, phase='contact'), 'ARM_FAULT'),
]


@pytest.mark.parametrize(('trial', 'end'), TRIALS, ids=[trial.name for trial, _ in TRIALS])
def test_a_trial_ends_as_named_within_its_force(trial, end):
    found = explored(trial)
    assert found.end == end, found
    assert max(found.normal_n, found.sideways_n) < MOST_N.get(trial.name, 10.0)
    assert found.named


def test_a_force_100_ms_late_by_stamps_of_arrival_is_named_and_no_success():
    found = explored(ForceTrial('late', 20000.0, delay_s=0.02, late_force_s=0.1))
    assert found.end == 'ARM_FAULT'
    assert "later than 'loop_delay_s'" in found.message


@pytest.mark.benchmark
def test_the_sweep_keeps_its_goals(tmp_path: Path) -> None:
    result, path = run_benchmark('motion', BenchmarkOptions(tmp_path, quick=True))
    assert path.is_file()
    for name, figures in result.numbers['rows'].items():
        assert figures['internal'] == 0, name
        assert figures['overshoot_of_success'] <= 0.2, name
        assert max(figures['normal_n'], figures['sideways_n']) <= MOST_N.get(name, 10.0), name
