"""Two BioTacs on one board that slide together; the third place of the board is empty."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texture_drivers.biotac.tables import BioTacLayout
from texture_simulation.scene import Scene
from texture_simulation.sensors.biotac import BioTacModel
from texture_simulation.sensors.tsf85_pair import TwoContacts
from texture_simulation.surfaces.surface import Surface
from texture_simulation.trajectory import Trajectory

SERIALS = ('BT-0', 'BT-1', '')  # by place; '' where there is no finger


class BioTacHand:
    """Two BioTacs that move as one, each an individual that touches a place of its own."""

    def __init__(self, scene: Scene, surface: Surface, rng: np.random.Generator, layout: BioTacLayout) -> None:
        self._models = [
            BioTacModel(scene.of_finger(place), surface, rng, layout, finger=place)
            for place, serial in enumerate(SERIALS)
            if serial
        ]
        self.touch = TwoContacts([model.touch for model in self._models])

    @property
    def points_per_frame(self) -> int:
        """Points of the path, at 4.4 kHz, that one frame takes."""
        return self._models[0].points_per_frame

    def advance(self, path: Trajectory) -> NDArray[np.uint16]:
        """Return what all places measure along the next piece of path, (n_frames, n_slots, n_places) counts."""
        measured = [model.advance(path) for model in self._models]
        empty = [np.zeros_like(measured[0])] * (len(SERIALS) - len(measured))
        return np.stack([*measured, *empty], axis=-1)
