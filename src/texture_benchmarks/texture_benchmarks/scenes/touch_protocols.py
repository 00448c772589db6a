"""How surfaces of the scenes are touched, and the effects that are left out or added."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from texture_simulation.contact import Contact
from texture_simulation.effects.catalogue import EFFECTS
from texture_simulation.effects.contact_growth import ForceGain, PatchGrowth
from texture_simulation.effects.finger_spread import FingerSpread
from texture_simulation.effects.protocols import GrowthEffect
from texture_simulation.effects.slide_error import SlideError
from texture_simulation.effects.unevenness import Unevenness
from texture_simulation.scene import Scene
from texture_simulation.surfaces.surface import MIN_BLUR_M

PATCH = 'patch filter'
FRICTION = 'friction'


@dataclass(frozen=True)
class TouchProtocol:
    """How the surfaces of a scene are touched, as in its experiment.

    Parameters
    ----------
    speeds_m_s, forces_n, directions_rad
        Every combination is met equally often.
    duration_s, radius_m
        Of each slide.
    turned_rad
        A surface is measured once in each of these directions, and all are evaluated together.
    slow
        Whether the slow channels are used, too.
    tested_forces_n
        Other forces for the test; as in learning if empty.
    training_by, tested_by
        Individuals of the sensor.
    """

    speeds_m_s: Sequence[float]
    forces_n: Sequence[float]
    directions_rad: Sequence[float] = (0.0,)
    duration_s: float = 0.5
    radius_m: float = 0.0
    turned_rad: Sequence[float] = (0.0,)
    slow: bool = False
    tested_forces_n: Sequence[float] = ()
    training_by: Sequence[int] = (0,)
    tested_by: Sequence[int] = (0,)


RIGHT = np.pi / 2
# The papers' conditions; slides of 2 and 3 s are cut to 1 s. On the bench, one learns as the demo does, and then
# presses as one likes.
TOUCH_PROTOCOLS: Mapping[str, TouchProtocol] = {
    'twelve_textures': TouchProtocol((0.1,), (2.0,), tested_forces_n=(0.5, 2.0, 5.0)),
    'ets_linear': TouchProtocol((0.10, 0.15, 0.20), (1.0, 2.5, 5.0)),
    'ets_circular': TouchProtocol((0.1,), (2.5,), (RIGHT, np.pi / 3, np.pi / 4, 0.0), radius_m=0.02),
    'ets_fine': TouchProtocol((0.125,), (2.0,), duration_s=0.8),
    'roughness': TouchProtocol((0.10, 0.15, 0.20), (1.0, 2.5, 5.0), duration_s=0.7),
    'jamali': TouchProtocol((0.05,), (1.0,), duration_s=1.0),
    'kaboli': TouchProtocol((0.05,), (1.0,), duration_s=1.0, slow=True, training_by=(1, 2), tested_by=(0, 1)),
    'hu': TouchProtocol((0.0255,), (1.5,), duration_s=1.0, turned_rad=(0.0, RIGHT)),
    'sticky': TouchProtocol((0.02, 0.05), (1.0, 2.0)),
}
# Effects that left the scenes because they change no decision there; they are put back to be measured.
REMOVED_EFFECTS: Mapping[str, Mapping[str, Any]] = {
    'twelve_textures': {'slide_error': SlideError(0.01, 0.04), 'unevenness': Unevenness(0.15)},
    'ets_circular': {'patch_growth': PatchGrowth(), 'force_gain': ForceGain(), 'unevenness': Unevenness(0.15)},
    'ets_fine': {'patch_growth': PatchGrowth(), 'force_gain': ForceGain(), 'unevenness': Unevenness(0.1)},
    'jamali': {'patch_growth': PatchGrowth()},
    'kaboli': {
        'patch_growth': PatchGrowth(),
        'force_gain': ForceGain(),
        'finger_spread': FingerSpread(0.05),
        'unevenness': Unevenness(0.15),
    },
    'hu': {
        'patch_growth': PatchGrowth(),
        'force_gain': ForceGain(),
        'slide_error': SlideError(0.005, 0.03),
        'unevenness': Unevenness(0.2),
    },
    'sticky': {'patch_growth': PatchGrowth(), 'unevenness': Unevenness(0.1)},
}
# Effects that no scene names: each is put into `HOST` by itself, as strong as the catalogue has it, to be measured.
HOST = 'twelve_textures'
ADDED = ('skids', 'motor_vibration', 'skin', 'mains_hum', 'drift', 'dropouts', 'quantisation')


def completed(scene: Scene, touch_protocol: TouchProtocol) -> Scene:
    """Return a scene with what has left it for changing no decision (`REMOVED_EFFECTS`)."""
    for name, effect in REMOVED_EFFECTS.get(scene.name, {}).items():
        contact = _grown(scene.contact, effect, touch_protocol, -1)
        scene = replace(scene, effects={**scene.effects, name: effect}, contact=contact)
    return scene


def variants(scene: Scene, touch_protocol: TouchProtocol) -> dict[str, Scene]:
    """Return the scene without each of its effects, with a contact of a point, and without friction.

    What grows with the force stays as large as at the mean force: a term that only sets a constant is none.
    """
    made = {
        name: replace(_without(scene, name), contact=_grown(scene.contact, effect, touch_protocol, 1))
        for name, effect in scene.effects.items()
    }
    made[PATCH] = replace(scene, contact=replace(scene.contact, blur_m=MIN_BLUR_M))
    if any(surface.friction for surface in scene.surfaces.values()):
        bare = {name: replace(surface, friction=None) for name, surface in scene.surfaces.items()}
        made[FRICTION] = replace(scene, surfaces=bare)
    return made


def _without(scene: Scene, name: str) -> Scene:
    """Return a scene without an effect; what else is random stays as it was, so that slides are compared one by one."""
    if isinstance(scene.effects[name], SlideError):
        return replace(scene, effects={**scene.effects, name: SlideError(0.0, 0.0)})
    return scene.without(name)


def _grown(contact: Contact, effect: Any, touch_protocol: TouchProtocol, sign: int) -> Contact:
    """Return the contact with the growth of an effect at the mean force in it (sign 1), or taken out of it (-1)."""
    if not isinstance(effect, GrowthEffect):
        return contact
    force_n = np.array([np.mean(touch_protocol.forces_n)])
    blur, gain = (float(np.max(growth(force_n))) ** sign for growth in (effect.blur_growth, effect.gain_growth))
    return replace(contact, blur_m=contact.blur_m * blur, stiffness_n_m=contact.stiffness_n_m * gain)


def with_one_more(scene: Scene) -> dict[str, Scene]:
    """Return the scene with each of the effects that no scene names (`ADDED`)."""
    return {name: replace(scene, effects={**scene.effects, name: EFFECTS[name]()}) for name in ADDED}
