"""Rotation vectors, as robots use them."""

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
