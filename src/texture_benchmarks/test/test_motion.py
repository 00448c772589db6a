# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The force loop through the explorer, on an arm without a force mode."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.motion import ARM, Hazard, simulate_force_controlled_slide
from texture_benchmarks.study import BenchmarkOptions
from texture_exploration.arms.simulated import SimulatedSurface, SurfaceShape
from texture_exploration.force_control import StiffnessEstimate

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

TILT = math.radians(10)


def slide(stiffness, **surface):
    """Return overshoot, root mean square and speed error of a slide with 1 N, as shares."""
    hazard = Hazard(SurfaceShape(**surface))
    trial = simulate_force_controlled_slide(replace(ARM, stiffness_n_m=stiffness), hazard=hazard)
    assert trial.success, trial.message
    return trial.overshoot, trial.force_rms, trial.speed_error


@pytest.mark.parametrize('stiffness', [200.0, 2000.0, 20000.0])
def test_from_soft_to_stiff_the_contact_is_gentle_and_the_slide_steady(stiffness):
    overshoot, rms, speed = slide(stiffness)
    assert overshoot < 0.2
    assert rms < 0.05
    assert speed < 0.02


@pytest.mark.parametrize('lag_s', [0.0, 0.01, 0.02, 0.05])
@pytest.mark.parametrize('stiffness', [200.0, 2000.0, 5000.0, 20000.0])
def test_an_arm_that_is_later_than_declared_does_not_overshoot(stiffness, lag_s):
    trial = simulate_force_controlled_slide(replace(ARM, stiffness_n_m=stiffness, undeclared_lag_s=lag_s))
    assert trial.overshoot < 0.2
    if (stiffness, lag_s) == (20000.0, 0.05) and not trial.success:
        assert 'the contact with the surface was lost' in trial.message  # one of sixteen seeds: it lifts off by 50 µm
    else:
        assert trial.success, trial.message
        assert trial.force_rms < 0.1


@pytest.mark.parametrize('tilt', [-TILT, TILT])
@pytest.mark.parametrize('stiffness', [200.0, 2000.0, 20000.0])
def test_a_tilted_surface_is_followed(stiffness, tilt):
    overshoot, rms, speed = slide(stiffness, tilt_rad=tilt)
    assert overshoot < 0.2
    assert rms < 0.05
    assert speed < 0.02


# The overshoot asked for, 20 %, holds within 20 % of the true stiffness. Felt 40 % too stiff, part of the steepest
# slope is not fed forward while the finger gains speed: the force rises higher then, but settles before the slide.
@pytest.mark.parametrize(('share', 'most'), [(0.7, 0.2), (0.8, 0.2), (1.2, 0.2), (1.4, 0.35)])
def test_a_stiffness_that_was_measured_wrongly_does_no_harm(share, most, monkeypatch):
    measured = StiffnessEstimate._slope
    monkeypatch.setattr(StiffnessEstimate, '_slope', lambda self: share * measured(self))
    overshoot, rms, _ = slide(20000.0, tilt_rad=TILT)
    assert overshoot < most
    assert rms < 0.05


def test_a_finger_that_stiffens_as_it_is_pressed_is_held(monkeypatch):
    def hertz(surface, x_m, z_m):
        # Hertz 1882: F ~ depth^1.5; at 1 N as stiff as the spring would be.
        depth = max(0.0, surface.height_m(x_m) - z_m)
        return (surface._stiffness_n_m * depth / 1.5) ** 1.5

    monkeypatch.setattr(SimulatedSurface, 'force_n', hertz)
    overshoot, rms, _ = slide(20000.0, tilt_rad=TILT)
    assert overshoot < 0.2
    assert rms < 0.05


def test_a_noisy_force_does_not_shake_the_finger(monkeypatch):
    rng, force_n = np.random.default_rng(1), SimulatedSurface.force_n
    monkeypatch.setattr(SimulatedSurface, 'force_n', lambda *where: force_n(*where) + 0.005 * rng.standard_normal())
    overshoot, rms, _ = slide(20000.0, tilt_rad=TILT)
    assert overshoot < 0.2
    assert rms < 0.05


def test_a_sticky_surface_neither_holds_the_finger_nor_sets_it_swinging():
    # The surface itself lets the force swing by 0.05 N, which is 0.029 N in the root mean square.
    _, rms, speed = slide(2000.0, adhesion_n=0.5, stick_slip_n=0.05)
    assert rms < 2 * 0.029
    assert speed < 0.02


@pytest.mark.benchmark
def test_force_speed_and_circle_are_kept_and_the_limit_is_foretold(tmp_path: Path) -> None:
    result, path = run_benchmark('motion', BenchmarkOptions(tmp_path, quick=True))
    numbers, targets = result.numbers, result.numbers['targets']
    assert path.is_file()
    assert all(chart.is_file() for chart in result.charts)
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
    late = [row for rows in numbers['hazards']['none'].values() for row in rows.values()]
    assert max(row['overshoot'] for row in late) <= targets['overshoot']
    for name, by_lag in numbers['hazards'].items():
        for row in (row for rows in by_lag.values() for row in rows.values()):
            if not name.startswith(('soft layer', 'step up')):  # a peak above `peak_force_fraction` is no success
                assert row['success'] == name.startswith('none'), (name, row)
            assert row['peak_n'] < 6.0, (name, row)
    assert numbers['border_error'] <= targets['border_error']
    assert min(numbers['margin'].values()) >= targets['margin']
