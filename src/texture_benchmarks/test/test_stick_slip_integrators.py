import math

import numpy as np
import pytest

from texture_benchmarks.stick_slip.integrators import INTEGRATORS
from texture_benchmarks.stick_slip.simulated_limit import ContactRegime, simulated_max_stable_step_s
from texture_core.errors import InvalidParameter
from texture_simulation.stick_slip.friction import StickSlip
from texture_simulation.stick_slip.integrator import Integrator
from texture_simulation.stick_slip.reference import solve
from texture_simulation.stick_slip.simulate import drag, pull_n
from texture_simulation.stick_slip.stability_limit import MARGIN, check_step, max_stable_step_s

USUAL = StickSlip()


@pytest.mark.parametrize('integrator', INTEGRATORS.values(), ids=INTEGRATORS)
@pytest.mark.parametrize('regime', ContactRegime)
def test_the_limit_of_stability_is_found_where_it_was_predicted(integrator: Integrator, regime: ContactRegime) -> None:
    slip_m_s = 0.0 if regime is ContactRegime.STICK else 0.4
    predicted_s = integrator.limit_s(USUAL, slip_m_s, 2.0)
    between = (predicted_s / 3, predicted_s * 3) if math.isfinite(predicted_s) else (1e-5, 0.1)
    found_s = simulated_max_stable_step_s(integrator, USUAL, regime, 2.0, slip_m_s=0.4, between_s=between)
    assert found_s == pytest.approx(predicted_s, rel=0.02)


def test_the_limit_of_euler_falls_with_the_stiffness_and_that_of_the_default_does_not() -> None:
    soft, stiff = StickSlip(bristle_1_m=1e5), StickSlip(bristle_1_m=1e7)
    euler_s, default_s = (
        [max_stable_step_s(INTEGRATORS[name], friction, 0.1, 1.0) for friction in (soft, stiff)]
        for name in ('explicit_euler', 'semi_implicit')
    )
    assert euler_s[1] < 0.02 * euler_s[0]
    assert default_s[1] == default_s[0]


@pytest.mark.parametrize('integrator', INTEGRATORS.values(), ids=INTEGRATORS)
def test_a_step_beyond_the_limit_is_refused_with_what_is_allowed(integrator: Integrator) -> None:
    allowed_s = MARGIN * max_stable_step_s(integrator, USUAL, 0.1, 2.0)
    check_step(integrator, USUAL, 0.99 * allowed_s, 0.1, 2.0)
    with pytest.raises(InvalidParameter, match=f'{integrator.name} allows at most .* take a shorter step_s'):
        drag(USUAL, np.full(3, 0.1), np.full(3, 2.0), 1.01 * allowed_s, integrator=integrator)


def test_all_integrators_come_to_the_reference_as_the_step_shrinks() -> None:
    friction, speed_m_s, force_n = StickSlip(bristle_1_m=3e4, stribeck_m_s=0.03), 0.1, 1.0
    times_s = np.arange(1, 61) * 1e-3
    exact = solve(friction, speed_m_s, force_n, times_s, tolerance=1e-8).tip
    expected_n = pull_n(friction, exact, np.full(60, speed_m_s))
    for method, integrator in INTEGRATORS.items():
        errors = []
        for steps in (100, 400):
            drive = np.full(60 * steps, speed_m_s)
            tip = drag(
                friction,
                drive,
                np.full_like(drive, force_n),
                1e-3 / steps,
                integrator=integrator,
                force_before_n=force_n,
            )
            errors.append(np.abs(pull_n(friction, tip, drive)[steps - 1 :: steps] - expected_n).max())
        assert errors[1] < 0.05 * np.ptp(expected_n), method
        assert errors[1] < 0.4 * errors[0] or errors[1] < 1e-5, method
