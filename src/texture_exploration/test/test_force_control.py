"""The force loop alone, and through the explorer on an arm without a force mode."""

import math
from dataclasses import replace

import numpy as np
import pytest

from texture_core.errors import InvalidParameter
from texture_exploration.arms.simulated import SimulatedArm, SimulatedArmParams
from texture_exploration.force_control import ForceController, ForceLoopParams, SlopeObserver, StiffnessEstimate
from texture_exploration.force_trials import ARM, SURFACES, slide_trial, surface_trials
from texture_exploration.motions.touch import TouchParams
from texture_exploration.stability import growth

TILT = math.radians(10)
PERIOD_S = 0.004


def slide(stiffness, acceleration_m_s2=1.0, **surface):
    """Return overshoot, root mean square and speed error of a slide with 1 N, as shares."""
    arm = replace(ARM, stiffness_n_m=stiffness, stiffest_n_m=max(stiffness, 1000.0), **surface)
    trial = slide_trial(arm, touch=TouchParams(acceleration_m_s2=acceleration_m_s2))
    assert trial.success, trial.message
    return trial.overshoot, trial.force_rms, trial.speed_error


@pytest.mark.parametrize('stiffness', [200.0, 2000.0, 20000.0])
def test_from_soft_to_stiff_the_contact_is_gentle_and_the_slide_steady(stiffness):
    overshoot, rms, speed = slide(stiffness)
    assert overshoot < 0.2
    assert rms < 0.05
    assert speed < 0.02


@pytest.mark.parametrize('tilt', [-TILT, TILT])
@pytest.mark.parametrize('stiffness', [200.0, 2000.0])
def test_a_tilted_surface_is_followed(stiffness, tilt):
    overshoot, rms, _ = slide(stiffness, tilt_rad=tilt)
    assert overshoot < 0.2
    assert rms < 0.05


def test_a_stiff_tilted_surface_wants_a_soft_start():
    _, rms, _ = slide(20000.0, 0.2, tilt_rad=TILT)
    assert rms < 0.05


def test_a_bump_of_two_millimetres_is_followed():
    _, rms, _ = slide(2000.0, bump_m=0.002)
    assert rms < 0.05


def test_a_sticky_surface_neither_holds_the_finger_nor_sets_it_swinging():
    # The surface itself lets the force swing by 0.05 N, which is 0.029 N in the root mean square.
    _, rms, speed = slide(2000.0, adhesion_n=0.5, stick_slip_n=0.05)
    assert rms < 2 * 0.029
    assert speed < 0.02


@pytest.mark.parametrize('stiffness', [100.0, 1e3, 1e4, 1e5])
@pytest.mark.parametrize('delay', [0.0, 0.005, 0.02])
def test_the_chosen_gain_is_stable_with_twice_the_stiffness_or_twice_the_delay(stiffness, delay):
    gain = ForceLoopParams(loop_delay_s=delay).best_gain(stiffness, PERIOD_S)
    for params, felt in [
        (ForceLoopParams(loop_delay_s=delay), 2 * stiffness),
        (ForceLoopParams(loop_delay_s=2 * delay), stiffness),
    ]:
        assert growth(params.loop(felt, PERIOD_S, gain)) < 1.0


def test_an_unstable_gain_is_refused_with_one_that_would_do():
    params = SimulatedArmParams(force_mode=False, force_gain_m_s_n=0.1, stiffest_n_m=20000.0, loop_delay_s=0.01)
    with pytest.raises(
        InvalidParameter, match=r"'force_gain_m_s_n' is 0\.1; .* unstable from (\S+) m/s/N on; choose"
    ) as told:
        SimulatedArm(params, own_thread=False)
    advised = float(str(told.value).rsplit('choose ', 1)[1].split(',')[0])
    SimulatedArm(
        SimulatedArmParams(force_mode=False, force_gain_m_s_n=advised, stiffest_n_m=20000.0, loop_delay_s=0.01)
    )


def test_the_stiffness_is_felt_from_the_rise_of_the_force():
    estimate = StiffnessEstimate()
    for depth in np.linspace(0.0, 4e-4, 8):
        estimate.update(0.003 - depth, 1500.0 * depth)
    assert estimate.value_n_m == pytest.approx(1500.0)


def test_a_limited_speed_does_not_wind_up():
    controller = ForceController(0.01, integral_s=0.1, max_speed_m_s=0.02)
    for _ in range(1000):
        assert controller.update(10.0, PERIOD_S) == -0.02
    assert controller.update(-0.1, PERIOD_S) > 0.0


def test_the_observer_sees_a_slope_at_once_when_the_speed_changes():
    observer, height = SlopeObserver(), 0.0
    for step in range(200):
        speed = 0.05 * step / 200
        height += 0.1 * speed * PERIOD_S
        rise = observer.update(height, speed, PERIOD_S)
    assert rise == pytest.approx(0.1 * speed, rel=0.02)


def test_a_trial_without_a_surface_says_why():
    trial = slide_trial(replace(ARM, stiffness_n_m=0.0), touch=TouchParams(approach_travel_m=0.01))
    assert not trial.success
    assert 'no surface' in trial.message
    assert math.isnan(trial.force_rms)


def test_the_trials_cover_all_surfaces():
    trials = surface_trials([2000.0])
    assert set(trials) == set(SURFACES)
    assert all(trial[2000.0].success for trial in trials.values())
