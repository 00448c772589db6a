"""A scene: the surfaces on the table, the finger's contact, and what disturbs it. Read from YAML."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import yaml

from texture_core.catalogue import find
from texture_core.errors import InvalidParameter
from texture_core.parameters import from_mapping
from texture_core.resources import find_file
from texture_simulation.contact import Contact
from texture_simulation.effects import Effects
from texture_simulation.surfaces import KINDS, Surface


@dataclass(frozen=True)
class Scene:
    """What there is to touch, and how it is felt."""

    name: str
    surfaces: Mapping[str, Surface]
    contact: Contact
    effects: Effects

    def surface(self, name: str) -> Surface:
        """Return a surface by name; UnknownName with the nearest one if there is none."""
        return find(self.surfaces, name, 'surface')


def load_scene(name_or_path: str) -> Scene:
    """Return a scene that the package ships in config/scenes, or that stands in a file.

    Raises
    ------
    UnknownName, InvalidParameter
        If there is no such scene, or it contains something unknown or impossible.
    """
    path = find_file(name_or_path, 'texture_simulation', 'config/scenes', 'scene')
    try:
        content = yaml.safe_load(path.read_text())
    except yaml.YAMLError as error:
        raise InvalidParameter(f'scene {path} is no YAML: {error}') from error
    return scene_from(path.stem, content)


def scene_from(name: str, content: Any) -> Scene:
    """Return the scene that a mapping with `surfaces`, and if wanted `contact` and `effects`, describes."""
    where = f"scene '{name}'"
    if not isinstance(content, Mapping) or not isinstance(content.get('surfaces'), Mapping):
        raise InvalidParameter(f'{where} has no mapping `surfaces` of names to lists of terms; add one')
    strange = set(content) - {'surfaces', 'contact', 'effects'}
    if strange:
        raise InvalidParameter(f'{where} has the sections {sorted(strange)}; allowed are surfaces, contact, effects')
    return Scene(
        name=name,
        surfaces={str(key): _surface(str(key), terms, where) for key, terms in content['surfaces'].items()},
        contact=from_mapping(Contact, content.get('contact') or {}, f'{where}, contact'),
        effects=from_mapping(Effects, content.get('effects') or {}, f'{where}, effects'),
    )


def _surface(name: str, terms: Any, where: str) -> Surface:
    place = f"{where}, surface '{name}'"
    if not isinstance(terms, list) or not all(isinstance(term, Mapping) and 'kind' in term for term in terms):
        raise InvalidParameter(f'{place} is {terms!r}; a list of terms, each with a `kind`, is needed')
    return Surface(name, tuple(_term(dict(term), place) for term in terms))


def _term(term: dict[str, Any], place: str) -> Any:
    return from_mapping(find(KINDS, str(term.pop('kind')), 'kind of surface term'), term, place)
