"""Which shipped search space belongs to a recipe, or else to its learner."""

from __future__ import annotations

from collections.abc import Mapping

from texture_core.errors import InvalidParameter

OF_RECIPES: Mapping[str, str] = {
    'ets-linear-ann': 'ets-ann',
    'ets-linear-ann-vote': 'ets-ann',
    'ets-linear-svm': 'ets-svm',
    'ets-linear-svm-vote': 'ets-svm',
    'ets-circular-ann': 'ets-circular-ann',
    'ets-circular-svm': 'ets-circular-svm',
    'ets-fine-ann': 'ets-fine-ann',
    'ets-fine-svm': 'ets-fine-svm',
    'ets-roughness-ann1': 'ets-roughness-ann1',
    'ets-roughness-ann5': 'ets-roughness-ann5',
    'ets-roughness-svm5': 'ets-roughness-svm5',
}
# All pairs of one model share the length of the windows, so it is not searched for each of them.
OF_PAIRS: Mapping[str, str] = {
    'ets-circular-ann': 'ets-circular-pairs-ann',
    'ets-circular-svm': 'ets-circular-pairs-svm',
}
OF_LEARNERS: Mapping[str, str] = {
    'ann_pairs': 'ann-pairs',
    'svm_pairs': 'svm-pairs',
    'svm_rbf': 'svm-rbf',
    'mlp': 'mlp',
}


def shipped_space(recipe: str, learner: str, *, per_pair: bool = False) -> str:
    """Return the name of the search space of a recipe, or else of its learner.

    Parameters
    ----------
    recipe, learner
        Names.
    per_pair
        Whether each pair of surfaces is searched for by itself.

    Returns
    -------
    str

    Raises
    ------
    InvalidParameter
        If neither has one.
    """
    of_pairs = OF_PAIRS.get(recipe) if per_pair else None
    name = of_pairs or OF_RECIPES.get(recipe) or OF_LEARNERS.get(learner)
    if not name:
        raise InvalidParameter(
            f"recipe '{recipe}' has no search space of its own, nor has '{learner}'; "
            'say with --search FILE what is to be varied'
        )
    return name
