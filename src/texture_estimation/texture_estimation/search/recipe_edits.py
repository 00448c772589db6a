"""Edits that a search applies to a recipe."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from texture_core.catalogue import find
from texture_core.errors import InvalidParameter


@dataclass(frozen=True)
class Edit:
    """One change of a recipe: `path` ('inputs/signal/features/force') is set to a value, used, or dropped.

    Examples
    --------
    >>> recipe = {'windows': {'length_s': 0.5}}
    >>> Edit('set', ('windows', 'length_s'), 1.0).apply(recipe)
    >>> recipe
    {'windows': {'length_s': 1.0}}
    """

    action: str
    path: tuple[str, ...]
    value: Any = None

    def apply(self, recipe: dict[str, Any]) -> None:
        """Change a recipe written as mappings and lists.

        Raises
        ------
        InvalidParameter
            If the recipe has no such place.
        """
        *way, last = self.path
        place: Any = recipe
        for step in way:
            place = enter_place(place, step, self.path)
        ACTIONS[self.action](place, last, self.value)


def edit_from(step: Mapping[str, Any]) -> Edit:
    """Return the edit that a step of a search space describes."""
    [(action, path)] = [(key, value) for key, value in step.items() if key != 'to']
    find(ACTIONS, str(action), 'change of a recipe')
    return Edit(str(action), path_of(path), step.get('to'))


def path_of(text: str) -> tuple[str, ...]:
    """Return the steps of a path such as 'inputs/signal/features'."""
    return tuple(str(text).split('/'))


def _set(place: Any, last: str, value: Any) -> None:
    old = place.get(last)
    place[last] = float(value) if isinstance(old, float) and isinstance(value, int) else value


def _use_feature(features: list[Any], name: str, value: Any) -> None:
    if _position(features, name) is None:
        features.append({name: dict(value or {})})


def _drop_feature(features: list[Any], name: str, value: Any) -> None:
    position = _position(features, name)
    if position is not None:
        del features[position]


def _position(features: Sequence[Any], name: str) -> int | None:
    return next((index for index, entry in enumerate(features) if name in entry), None)


def enter_place(place: Any, step: str, path: Sequence[str]) -> Any:
    """Return what a recipe holds below a place.

    Parameters
    ----------
    place
        A mapping, or a list of features.
    step
        Its key, or the name of a feature.
    path
        The whole path, for messages.

    Returns
    -------
    object

    Raises
    ------
    InvalidParameter
        If there is nothing of this name.
    """
    if isinstance(place, list):
        position = _position(place, step)
        place = place[position] if position is not None else {}
    if not isinstance(place, Mapping) or step not in place:
        raise InvalidParameter(
            f"the recipe has no '{'/'.join(path)}', which the search varies ('{step}' is not there); "
            'add it to the recipe, or give a search space that fits with --search'
        )
    return place[step]


ACTIONS = {'set': _set, 'use': _use_feature, 'drop': _drop_feature}
