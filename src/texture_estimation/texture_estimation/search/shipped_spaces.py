"""Which shipped search space belongs to a recipe, or else to its learner."""

from __future__ import annotations

from texture_core.errors import InvalidParameter
from texture_core.plain_data import load_yaml
from texture_core.resources import shipped


def space_for(key: str, name: str) -> str | None:
    """Return the name of the search space that lists a name under `key`; None if none does.

    Parameters
    ----------
    key
        'recipes', 'learners', or 'pairs_of' where each pair of surfaces of a recipe is searched for by itself.
    name
        Of the recipe or learner.
    """
    spaces = shipped('texture_estimation', 'config/search')
    return next((stem for stem, path in spaces.items() if name in load_yaml(path, 'search space').get(key, ())), None)


def shipped_space(recipe: str, learner: str, *, per_pair: bool = False) -> str:
    """Return the name of the search space of a recipe, or else of its learner.

    Raises
    ------
    InvalidParameter
        If neither has one.
    """
    of_pairs = space_for('pairs_of', recipe) if per_pair else None
    name = of_pairs or space_for('recipes', recipe) or space_for('learners', learner)
    if not name:
        raise InvalidParameter(
            f"recipe '{recipe}' has no search space of its own, nor has '{learner}'; "
            'say with --search FILE what is to be varied'
        )
    return name
