"""Two fingers of a TSF-85 that slide together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from texture_drivers.tsf85.tables import LAYOUTS
from texture_simulation.scene import Scene
from texture_simulation.sensors.tsf85 import Tsf85Model
from texture_simulation.skin_contact import SkinContact
from texture_simulation.surfaces.surface import Surface
from texture_simulation.trajectory import Trajectory


class TwoContacts:
    """The contacts of two fingers that touch one surface, as one."""

    def __init__(self, contacts: Sequence[SkinContact]) -> None:
        self._contacts = contacts

    @property
    def surface(self) -> Surface:
        """What is touched."""
        return self._contacts[0].surface

    @surface.setter
    def surface(self, surface: Surface) -> None:
        for contact in self._contacts:
            contact.surface = surface

    def relocate(self) -> None:
        """Let each finger touch another place from now on."""
        for contact in self._contacts:
            contact.relocate()


class Tsf85Pair:
    """Two fingers of a TSF-85 that move as one, each an individual that touches a place of its own."""

    def __init__(self, scene: Scene, surface: Surface, rng: np.random.Generator) -> None:
        self._models = [
            Tsf85Model(scene.of_finger(finger), surface, rng, LAYOUTS['tsf85'], finger=finger) for finger in (0, 1)
        ]
        self.touch = TwoContacts([model.touch for model in self._models])

    def advance(self, path: Trajectory) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
        """Return what both measure along the next piece of path: (n_samples, 2) and (n_images, 2, n_taxels) counts."""
        dynamic, images = zip(*(model.advance(path) for model in self._models), strict=True)
        return np.stack(dynamic, axis=-1), np.stack(images, axis=1)
