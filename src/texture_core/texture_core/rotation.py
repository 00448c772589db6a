"""Rotation vectors and quaternions, as robots use them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from texture_core.arrays import Array


def rotation_matrix(rotation_vector_rad: Sequence[float] | Array) -> Array:
    """Return the matrix that turns by |r| about the axis r/|r| (Rodrigues' formula).

    Parameters
    ----------
    rotation_vector_rad : (3,)

    Returns
    -------
    (3, 3)
        Its columns are the axes of the turned frame.
    """
    x, y, z = rotation_vector_rad
    angle = float(np.sqrt(x * x + y * y + z * z))
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # sin(a)/a and (1 − cos a)/a² in a form that holds for a = 0; numpy's sinc(t) is sin(πt)/(πt).
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    matrix: Array = np.eye(3) + first * cross + second * cross @ cross
    return matrix


def quaternion(rotation_vector_rad: Sequence[float] | Array) -> tuple[float, float, float, float]:
    """Return the quaternion x, y, z, w of ROS that turns by |r| about the axis r/|r|.

    Parameters
    ----------
    rotation_vector_rad : (3,)

    Returns
    -------
    (4,)
        Of length 1.

    Examples
    --------
    >>> [round(value, 3) for value in quaternion((0.0, 0.0, np.pi / 2))]
    [0.0, 0.0, 0.707, 0.707]
    """
    vector = np.array(rotation_vector_rad, dtype=float)
    half = 0.5 * float(np.linalg.norm(vector))
    x, y, z = (0.5 * np.sinc(half / np.pi) * vector).tolist()  # sin(half)/|r| in a form that holds for 0
    return x, y, z, float(np.cos(half))


def quaternion_matrix(quaternion: Sequence[float]) -> Array:
    """Return the matrix of a rotation that is given as the quaternion x, y, z, w of ROS.

    Parameters
    ----------
    quaternion : (4,)
        Of any length but 0; it is normalised.

    Returns
    -------
    (3, 3)
        Its columns are the axes of the turned frame; NaN for a quaternion of length 0, which is no rotation.
    """
    vector, w = np.array(quaternion[:3], dtype=float), float(quaternion[3])
    length = float(np.sqrt(vector @ vector + w * w))
    if length == 0.0:
        return np.full((3, 3), np.nan)
    vector, w = vector / length, w / length
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix: Array = np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross
    return matrix


def rotation_vector(matrix: Array) -> Array:
    """Return the rotation vector of a rotation, the inverse of `rotation_matrix`.

    Parameters
    ----------
    matrix : (3, 3)
        Orthonormal, with determinant 1.

    Returns
    -------
    (3,)
        rad; its length is from 0 to π.
    """
    # The quaternion from its largest component is exact also at half a turn (Shepperd 1978).
    trace = float(np.trace(matrix))
    squares = np.array([*(1.0 + 2.0 * np.diag(matrix) - trace), 1.0 + trace])  # 4·x², 4·y², 4·z², 4·w²
    largest = int(np.argmax(squares))
    products = matrix + matrix.T  # 4·x·y and so on beside the diagonal
    differences = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    if largest == 3:
        quaternion = np.array([*differences, squares[3]])
    else:
        quaternion = np.array([*products[largest], differences[largest]])
        quaternion[largest] = squares[largest]
    quaternion = quaternion / np.linalg.norm(quaternion)
    if quaternion[3] < 0.0:
        quaternion = -quaternion
    length = float(np.linalg.norm(quaternion[:3]))
    if length == 0.0:
        return np.zeros(3)
    vector: Array = quaternion[:3] * (2.0 * np.arctan2(length, quaternion[3]) / length)
    return vector
