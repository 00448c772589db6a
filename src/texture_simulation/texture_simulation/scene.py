# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A scene: surfaces, contact, friction and effects, from YAML."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from texture_core.config import find, find_file, from_mapping, load_yaml, look_up, param, safe_repr
from texture_core.errors import InvalidParameter
from texture_simulation.effects import EFFECTS
from texture_simulation.friction import FRICTIONS
from texture_simulation.surfaces import FLAT, KINDS, Curved, PlaceVariation, Surface

# --------------------
# Contact of a soft round finger with a texture at 1 N; how it depends on the force is an effect.


@dataclass(frozen=True)
class Contact:
    """A finger pressed on a plane with 1 N."""

    blur_m: float = param(
        1.2e-4,
        'Standard deviation of the spatial low-pass of the skin; larger values remove coarser texture.',
        unit='m',
        low=1e-5,
        high=1e-3,
    )
    stiffness_n_m: float = param(2000.0, 'Force per height of the texture.', unit='N/m', low=1.0, high=1e6)
    tip_radius_m: float = param(
        7e-3,
        'Radius of curvature of the fingertip; on a curved object a larger one changes the contact more.',
        unit='m',
        low=1e-3,
        high=0.1,
    )

    def on(self, radius_m: float) -> float:
        """Return how much smaller than on a plane the contact is on a convex object: a factor, at most 1.

        Two spheres touch as one of radius 1 / (1 / r + 1 / R) touches a plane, and size and stiffness of the contact
        are as the cube root of that.

        Source: Hertz 1882.
        """
        return 1.0 if math.isinf(radius_m) else (radius_m / (radius_m + self.tip_radius_m)) ** (1 / 3)


# --------------------
# A scene: the surfaces, the sensor, its contact and the disturbances, read from YAML.

DEFAULT_SENSOR = 'tsf85'
SHAPES: Mapping[str, type] = {'curved': Curved}
TERMS: Mapping[str, type] = {**KINDS, **FRICTIONS, **SHAPES}
SECTIONS = ('about', 'sensor', 'contact', 'effects', 'variation', 'surfaces')


@dataclass(frozen=True)
class Scene:
    """What there is to touch, and how it is measured."""

    name: str
    surfaces: Mapping[str, Surface]
    contact: Contact
    effects: Mapping[str, Any]
    sensor: str = DEFAULT_SENSOR
    about: str = ''

    def surface(self, name: str) -> Surface:
        """Return a surface by name; UnknownName with the nearest one if there is none."""
        return look_up(self.surfaces, name, 'surface')

    def effects_of(self, stage: str) -> list[Any]:
        """Return the effects that have the method of a stage (see effects.py), in the order of the catalogue."""
        return [self.effects[name] for name in EFFECTS if name in self.effects and hasattr(EFFECTS[name], stage)]

    def of_finger(self, finger: int) -> Scene:
        """Return the scene as one individual of the sensor senses it: with an individual skin and noise."""
        spread = self.effects.get('finger_spread')
        if spread is None:
            return self
        _, thicker, noisier = spread.factors(finger)
        effects = dict(self.effects)
        if 'noise' in effects:
            fast, slow = (count * noisier for count in (effects['noise'].fast_count, effects['noise'].slow_count))
            effects['noise'] = replace(effects['noise'], fast_count=fast, slow_count=slow)
        mean = self.contact
        contact = replace(mean, blur_m=mean.blur_m * thicker, stiffness_n_m=mean.stiffness_n_m / thicker)
        return replace(self, contact=contact, effects=effects)

    def without(self, effect: str) -> Scene:
        """Return the same scene with one of its effects off."""
        look_up(self.effects, effect, 'effect of this scene')
        return replace(self, effects={name: kept for name, kept in self.effects.items() if name != effect})


def load_scene(name_or_path: str) -> Scene:
    """Return a scene that the package ships in config/scenes, or that is in a file.

    Raises
    ------
    UnknownName, InvalidParameter
        If there is no such scene, or it contains something unknown or impossible.
    """
    path = find_file(name_or_path, 'texture_simulation', 'config/scenes', 'scene')
    return scene_from(path.stem, load_yaml(path, 'scene'))


def scene_from(name: str, content: Any) -> Scene:
    """Return the scene that a mapping with `surfaces`, and if wanted the other `SECTIONS`, describes."""
    where = f"scene '{name}'"
    if not isinstance(content, Mapping) or not isinstance(content.get('surfaces'), Mapping):
        raise InvalidParameter(f'{where} has no mapping `surfaces` of names to lists of terms; add one')
    unexpected = set(content) - set(SECTIONS)
    if unexpected:
        raise InvalidParameter(f'{where} has the sections {sorted(unexpected)}; allowed are {", ".join(SECTIONS)}')
    surfaces = {str(key): _surface(str(key), terms, where) for key, terms in content['surfaces'].items()}
    if 'variation' in content:
        variation = from_mapping(PlaceVariation, content['variation'] or {}, f'{where}, variation')
        surfaces = {key: replace(surface, variation=variation) for key, surface in surfaces.items()}
    return Scene(
        name=name,
        surfaces=surfaces,
        contact=from_mapping(Contact, content.get('contact') or {}, f'{where}, contact'),
        effects=_effects(content.get('effects') or {}, where),
        sensor=str(content.get('sensor', DEFAULT_SENSOR)),
        about=str(content.get('about', '')).strip(),
    )


def _effects(effects: Any, where: str) -> dict[str, Any]:
    if not isinstance(effects, Mapping):
        raise InvalidParameter(
            f'{where}, effects: came {safe_repr(effects)}; a mapping of effects to their parameters is needed'
        )
    return {
        name: from_mapping(find(EFFECTS, str(name), 'effect'), values or {}, f"{where}, effect '{name}'")
        for name, values in effects.items()
    }


def _surface(name: str, terms: Any, where: str) -> Surface:
    place = f"{where}, surface '{name}'"
    if not isinstance(terms, list) or not all(isinstance(term, Mapping) and 'kind' in term for term in terms):
        raise InvalidParameter(f'{place} is {safe_repr(terms)}; a list of terms, each with a `kind`, is needed')
    made: list[Any] = []
    for term in terms:
        values = dict(term)
        made.append(from_mapping(find(TERMS, str(values.pop('kind')), 'kind of surface term'), values, place))
    frictions = [term for term in made if type(term) in FRICTIONS.values()]
    if len(frictions) > 1:
        raise InvalidParameter(f'{place} has {len(frictions)} kinds of friction; name one of {", ".join(FRICTIONS)}')
    shapes = [term for term in made if type(term) in SHAPES.values()]
    if len(shapes) > 1:
        raise InvalidParameter(f'{place} has {len(shapes)} shapes; an object has one')
    relief = tuple(term for term in made if term not in (*frictions, *shapes))
    return Surface(name, relief, next(iter(frictions), None), next(iter(shapes), FLAT))
