from __future__ import annotations

import numpy as np
import pytest

from texture_core.types import quaternion, quaternion_matrix, rotation_matrix, rotation_vector


def test_a_quarter_turn_about_z_brings_x_to_y() -> None:
    assert rotation_matrix([0.0, 0.0, np.pi / 2]) @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])


def test_no_rotation_is_the_identity() -> None:
    assert rotation_matrix([0.0, 0.0, 0.0]) == pytest.approx(np.eye(3))


def test_a_rotation_keeps_lengths_and_handedness() -> None:
    matrix = rotation_matrix([0.3, -2.0, 1.1])
    assert matrix @ matrix.T == pytest.approx(np.eye(3))
    assert np.linalg.det(matrix) == pytest.approx(1.0)


def test_the_axis_of_a_rotation_stays_where_it_is() -> None:
    axis = np.array([0.3, -2.0, 1.1])
    assert rotation_matrix(axis) @ axis == pytest.approx(axis)


def test_a_quaternion_turns_as_the_rotation_vector_does() -> None:
    half = 0.35
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    quaternion = (*(np.sin(half) * axis), np.cos(half))
    assert quaternion_matrix(quaternion) == pytest.approx(rotation_matrix(2 * half * axis))
    assert quaternion_matrix(np.array(quaternion) * 3.0) == pytest.approx(rotation_matrix(2 * half * axis))


def test_a_quaternion_of_length_zero_is_no_rotation() -> None:
    assert np.isnan(quaternion_matrix((0.0, 0.0, 0.0, 0.0))).all()


@pytest.mark.parametrize('angle_rad', [0.0, 1e-9, 0.3, 2.0, np.pi - 1e-9, np.pi])
@pytest.mark.parametrize('axis', [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.0, 0.8), (-2 / 3, 1 / 3, 2 / 3)])
def test_the_rotation_vector_of_a_matrix_gives_the_matrix_again(angle_rad: float, axis: tuple[float, ...]) -> None:
    matrix = rotation_matrix(angle_rad * np.array(axis))
    vector = rotation_vector(matrix)
    assert rotation_matrix(vector) == pytest.approx(matrix, abs=1e-12)
    assert np.linalg.norm(vector) == pytest.approx(angle_rad, abs=1e-8)


@pytest.mark.parametrize('turned', [(0.0, 0.0, 0.0), (1e-9, 0.0, 0.0), (0.3, -0.2, 0.9), (np.pi, 0.0, 0.0)])
def test_a_quaternion_turns_as_its_rotation_vector(turned: tuple[float, ...]) -> None:
    assert quaternion_matrix(quaternion(turned)) == pytest.approx(rotation_matrix(turned), abs=1e-12)
