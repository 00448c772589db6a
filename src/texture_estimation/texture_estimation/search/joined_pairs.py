"""One recipe of the recipes that the searches of all pairs have found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from texture_core.errors import InvalidParameter
from texture_estimation.recipe import Recipe
from texture_features.feature_set import AGAIN

LEARNER = 'texture_papers.roberge:TunedPairs'
SHARED = ('windows', 'evidence', 'training')


def joined_recipe(recipes: Mapping[tuple[str, str], Recipe], base: Recipe) -> Recipe:
    """Return the recipe of one model in which each pair of textures has the features and the learner of its own recipe.

    Each input of a pair's recipe becomes an input of the joined one, named 'signal#1' and so on; pairs with the same
    features share one.

    Parameters
    ----------
    recipes
        Recipe of each pair, by the two labels.
    base
        From which they were searched: gives windows, evidence rule and training, and decides pairs that are not listed.

    Returns
    -------
    Recipe
        With the learner `TunedPairs` of texture_papers.

    Raises
    ------
    InvalidParameter
        If the pairs differ in what all windows share: their length, the evidence rule or the training.

    Examples
    --------
    >>> from texture_estimation.recipe import load_recipe
    >>> one = load_recipe('ets-linear-svm')
    >>> joined = joined_recipe({('cork', 'felt'): one, ('cork', 'wood'): one, ('felt', 'wood'): one}, one)
    >>> [item.topic for item in joined.feature_set.inputs], len(joined.learner.pairs)
    (['signal#1'], 3)
    """
    contents = {pair: recipe.as_mapping() for pair, recipe in recipes.items()}
    shared = _shared(contents)
    inputs: dict[str, Any] = {}
    pairs = []
    for pair, content in contents.items():
        own = [_placed(inputs, topic, section) for topic, section in content['inputs'].items()]
        pairs.append({'pair': list(pair), 'inputs': own, 'learner': content['learner']})
    of_base = base.as_mapping()
    return Recipe.from_mapping(
        {
            'description': f'{base.description} Each pair with variables of its own.'.strip(),
            **shared,
            'inputs': inputs,
            'learner': {LEARNER: {'learner': of_base['learner'], 'pairs': pairs}},
        },
        f'{base.name}-pairs',
    )


def _shared(contents: Mapping[tuple[str, str], Mapping[str, Any]]) -> dict[str, Any]:
    """Return the sections that all pairs have in common."""
    first_pair, first = next(iter(contents.items()))
    for pair, content in contents.items():
        for section in SHARED:
            if content[section] != first[section]:
                raise InvalidParameter(
                    f"the pairs {list(first_pair)} and {list(pair)} differ in '{section}', which a model has once; "
                    'search without varying it'
                )
    return {section: first[section] for section in SHARED}


def _placed(inputs: dict[str, Any], topic: str, section: Any) -> str:
    """Return the name under which an input of a pair stands among the inputs; it is added if it is new."""
    plain = topic.partition(AGAIN)[0]
    for name, known in inputs.items():
        if name.partition(AGAIN)[0] == plain and known == section:
            return name
    name = f'{plain}{AGAIN}{1 + sum(known.partition(AGAIN)[0] == plain for known in inputs)}'
    inputs[name] = section
    return name
