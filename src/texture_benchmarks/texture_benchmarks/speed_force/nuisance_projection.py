"""Nuisance attribute projection: remove what the sliding direction does to the load on a taxel array."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array

ENERGY = 0.95


@dataclass(frozen=True, eq=False)
class NuisanceProjection:
    """A projection of the taxels onto what a turn leaves alone.

    A finger that comes to slide is still sheared the other way, or not at all; a few millimetres later friction has
    sheared it. The difference is what a turn does, and every slide begins with one: nothing need be known about slides
    in the other direction. The main directions of these differences are projected out.

    Source: nuisance attribute projection, Solomonoff, Campbell & Boardman 2005, with the start of a slide as nuisance.

    Parameters
    ----------
    projection : (n_taxels, n_taxels)
        To be multiplied from the right.
    """

    projection: Array

    @classmethod
    def fit(cls, starts: Array, steady: Array, energy: float = ENERGY) -> NuisanceProjection:
        """Return the projection from slides.

        Parameters
        ----------
        starts, steady : (n, n_taxels)
            The load, as `centred_log_ratio` gives it, when the finger is about to slide and while it slides.
        energy
            As many directions are taken out as hold this share of the squared differences; none for 0.

        Returns
        -------
        NuisanceProjection
        """
        _, strength, directions = np.linalg.svd(steady - starts, full_matrices=False)
        held = np.cumsum(strength**2) / np.sum(strength**2)
        count = int(np.searchsorted(held, energy)) + 1 if energy > 0.0 else 0
        main = directions[:count]
        return cls(np.eye(steady.shape[1]) - main.T @ main)

    def __call__(self, loads: Array) -> Array:
        """Return loads (n, n_taxels) without what a turn changes."""
        free: Array = loads @ self.projection
        return free
