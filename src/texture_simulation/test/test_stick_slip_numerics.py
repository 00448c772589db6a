# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from texture_core.errors import InvalidParameter
from texture_simulation.friction import SEMI_IMPLICIT, StickSlip, TipDrag, check_step, jacobian, solve
from texture_simulation.path import Trajectory

USUAL = StickSlip()
RATE_HZ = 2000.0


def test_eigenvalues_at_rest_are_those_of_a_mass_on_bristles_and_skin() -> None:
    roots = jacobian(USUAL, 0.0, 2.0)
    stiffness = USUAL.skin_n_m + 2.0 * USUAL.bristle_1_m
    damping = USUAL.skin_n_s_m + 2.0 * USUAL.bristle_s_m
    expected = np.append(np.roots([USUAL.mass_kg, damping, stiffness]), 0.0)
    assert np.allclose(np.sort_complex(np.linalg.eigvals(roots)), np.sort_complex(expected), atol=1e-3)


def test_no_step_and_a_coarse_one_are_refused() -> None:
    with pytest.raises(InvalidParameter, match='must be above 0'):
        check_step(SEMI_IMPLICIT, USUAL, 0.0, 0.1, 1.0)
    with pytest.raises(InvalidParameter, match='allows at most'):
        TipDrag(StickSlip(step_s=0.05), RATE_HZ)


def test_both_solvers_of_scipy_agree() -> None:
    times_s = np.arange(1, 21) * 1e-3
    tips = [solve(USUAL, 0.1, 1.0, times_s, method=method, tolerance=1e-7).tip for method in ('lsoda', 'radau')]
    assert np.allclose(tips[0].stretch_m, tips[1].stretch_m, rtol=1e-3)


def along_x(x_m: np.ndarray, force_n: float = 2.0) -> Trajectory:
    return Trajectory(x_m, np.zeros_like(x_m), np.full_like(x_m, force_n))


def test_a_path_in_blocks_senses_like_the_whole() -> None:
    path = along_x(0.05 / RATE_HZ * np.arange(600))
    whole = TipDrag(USUAL, RATE_HZ).advance(path)
    follower = TipDrag(USUAL, RATE_HZ)
    parts = [follower.advance(path.at(slice(first, first + 7))) for first in range(0, 600, 7)]
    assert np.allclose(np.concatenate(parts), whole, atol=1e-12)
    assert not len(follower.advance(along_x(np.zeros(0))))


def test_back_the_way_it_came_the_skin_is_pulled_the_other_way_even_after_a_rest() -> None:
    friction = StickSlip(skin_n_s_m=20.0)
    there = 0.1 / RATE_HZ * np.arange(800)
    offset = np.concatenate([there, np.full(200, there[-1]), there[::-1]])
    measured = TipDrag(friction, RATE_HZ).advance(along_x(offset)) / friction.force_coupling
    assert measured[700] == pytest.approx(2.0 * 0.5, rel=0.05)
    assert measured[-50] == pytest.approx(-2.0 * 0.5, rel=0.05)
