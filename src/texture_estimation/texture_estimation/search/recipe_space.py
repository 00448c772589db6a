"""Which parts of a recipe a search varies: a table in YAML, and the recipes that individuals stand for."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic

from texture_core.catalogue import find, unknown_name
from texture_core.errors import InvalidParameter
from texture_core.plain_data import load_yaml, safe_repr
from texture_core.resources import find_file
from texture_estimation.search.recipe_edits import Edit, edit_from, enter_place, path_of
from texture_estimation.search.search_task import R
from texture_estimation.search.variables import Categorical, Individual, Integer, LogReal, SearchSpace, Value, Variable

MAX_INCLUDES = 10
KEYS = ('description', 'include', 'variables', 'recipes', 'pairs_of', 'learners')  # the last three: whom it belongs to
PACKAGE, FOLDER = 'texture_estimation', 'config/search'


@dataclass(frozen=True)
class Axis:
    """A variable, and what each of its values does to a recipe.

    Parameters
    ----------
    variable
        Its values.
    path
        What is set to the value; () if `edits` tell.
    edits
        For each option of a choice.

    Examples
    --------
    >>> from texture_estimation.search.variables import Integer
    >>> [edit] = Axis(Integer(1, 5), ('learner', 'folds')).edits_for(3)
    >>> edit.path, edit.value
    (('learner', 'folds'), 3)
    """

    variable: Variable
    path: tuple[str, ...] = ()
    edits: Mapping[str, tuple[Edit, ...]] | None = None

    def edits_for(self, value: Value) -> tuple[Edit, ...]:
        """Return the changes that a value stands for."""
        return (Edit('set', self.path, value),) if self.edits is None else self.edits[str(value)]


@dataclass(frozen=True)
class RecipeSpace(Generic[R]):
    """The variables of a recipe, of textures or of roughness.

    Examples
    --------
    >>> import numpy as np
    >>> from texture_estimation.recipe import load_recipe
    >>> space = RecipeSpace.load('svm-rbf', load_recipe('any-speed'))
    >>> space.recipe(space.variables.decode(np.full(len(space.variables.names), 0.5))).learner_name
    'svm_rbf'
    """

    base: R
    axes: Mapping[str, Axis]
    name: str = ''

    @classmethod
    def load(cls, name_or_path: str, base: R) -> RecipeSpace[R]:
        """Read a table of variables, by the name of a shipped one or by path.

        Raises
        ------
        UnknownName, InvalidParameter
            If there is none, it is wrong, or the recipe lacks what it varies.
        """
        space = cls(base, _read(name_or_path), Path(name_or_path).stem)
        space.recipe(tuple(axis.variable.value(0) for axis in space.axes.values()))  # refused now, not amid a search
        return space

    @property
    def variables(self) -> SearchSpace:
        """What the search sees."""
        return SearchSpace({name: axis.variable for name, axis in self.axes.items()})

    def recipe(self, individual: Individual) -> R:
        """Return the recipe that an individual stands for."""
        content = copy.deepcopy(self.base.as_mapping())
        for axis, value in zip(self.axes.values(), individual, strict=True):
            for edit in axis.edits_for(value):
                edit.apply(content)
        recipe: R = self.base.from_mapping(content, self.base.name)
        return recipe

    def of_base(self) -> Individual:
        """Return the individual nearest to the recipe itself."""
        content = self.base.as_mapping()
        return tuple(self._present(axis, content) for axis in self.axes.values())

    def table(self) -> list[tuple[str, str, str]]:
        """Return name, kind and range of each variable, for people."""
        return [(name, *_extracted(axis.variable)) for name, axis in self.axes.items()]

    def _present(self, axis: Axis, content: Mapping[str, Any]) -> Value:
        variable = axis.variable
        if axis.edits is not None:
            return next(
                (option for option in axis.edits if self._changes_nothing(axis.edits[option], content)),
                variable.value(0),
            )
        place: Any = content
        for step in axis.path:
            place = enter_place(place, step, axis.path)
        try:
            return variable.value(variable.index(place))
        except ValueError:
            return variable.value(0)

    def _changes_nothing(self, edits: Sequence[Edit], content: Mapping[str, Any]) -> bool:
        changed = copy.deepcopy(dict(content))
        for edit in edits:
            edit.apply(changed)
        same: bool = self.base.from_mapping(changed, '').as_mapping() == content
        return same


def _read(name_or_path: str, depth: int = 0) -> dict[str, Axis]:
    path = find_file(name_or_path, PACKAGE, FOLDER, 'search space')
    content = load_yaml(path, 'search space')
    if not isinstance(content, Mapping):
        raise InvalidParameter(f"search space '{path}' holds no mapping; 'variables' is needed")
    for key in content:
        if key not in KEYS:
            raise InvalidParameter(f"search space '{path}': {unknown_name(str(key), KEYS, 'key')}")
    included, variables = content.get('include') or [], content.get('variables') or {}
    if not isinstance(included, list) or not isinstance(variables, Mapping) or depth > MAX_INCLUDES:
        raise InvalidParameter(
            f"search space '{path}': 'include' is a list, at most {MAX_INCLUDES} deep, and 'variables' a mapping"
        )
    axes: dict[str, Axis] = {}
    for other in included:
        axes.update(_read(str(other), depth + 1))
    for name, entry in variables.items():
        axes[str(name)] = _axis(entry, f"search space '{path.stem}', variable '{name}'")
    return axes


def _axis(entry: Any, where: str) -> Axis:
    if not isinstance(entry, Mapping) or 'kind' not in entry:
        raise InvalidParameter(
            f"{where}: came {safe_repr(entry)}; a mapping with 'kind' ({', '.join(KINDS)}) is needed"
        )
    values = {key: value for key, value in entry.items() if key != 'kind'}
    try:
        return find(KINDS, str(entry['kind']), 'kind of variable')(values)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InvalidParameter(f'{where}: {dict(entry)} cannot be used ({type(error).__name__}: {error})') from error
    except InvalidParameter as error:
        raise InvalidParameter(f'{where}: {error}') from error


def _integer(entry: Mapping[str, Any]) -> Axis:
    return Axis(Integer(int(entry['low']), int(entry['high'])), path_of(entry['set']))


def _log(entry: Mapping[str, Any]) -> Axis:
    return Axis(LogReal(float(entry['low']), float(entry['high'])), path_of(entry['set']))


def _choice(entry: Mapping[str, Any]) -> Axis:
    options = entry['options']
    if not isinstance(options, Mapping):
        return Axis(Categorical(tuple(map(str, options))), path_of(entry['set']))
    edits = {str(option): tuple(edit_from(step) for step in steps or ()) for option, steps in options.items()}
    return Axis(Categorical(tuple(edits)), edits=edits)


def _use(entry: Mapping[str, Any]) -> Axis:
    path = path_of(entry['feature'])
    return Axis(Categorical(('no', 'yes')), edits={'no': (Edit('drop', path),), 'yes': (Edit('use', path),)})


def _extracted(variable: Variable) -> tuple[str, str]:
    if isinstance(variable, Categorical):
        return 'choice', ', '.join(variable.options)
    kind = 'whole number' if isinstance(variable, Integer) else 'logarithmic'
    return kind, f'{variable.value(0):g} to {variable.value(variable.count - 1):g}'


KINDS = {'integer': _integer, 'log': _log, 'choice': _choice, 'use': _use}
