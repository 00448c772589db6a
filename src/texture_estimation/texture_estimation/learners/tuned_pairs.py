"""One machine or network for each pair of textures, each with features and parameters of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidParameter
from texture_core.plain_data import safe_repr
from texture_estimation.learners.ann_pairs import AnnPairs
from texture_estimation.learners.learner import Codes, Fitted, Learner
from texture_estimation.learners.pair_predictors import MACHINES, NETWORKS, TunedPairsPredictor, machines, networks
from texture_estimation.learners.pair_votes import TIES, PairVotes
from texture_estimation.learners.svm_pairs import SvmPairs
from texture_features.recipe_entry import choose, entry_of

NOTE = 'not calibrated: the pairs won are counted; {} of {} pairs have variables of their own'
KEYS = ('learner', 'pairs', 'ties')
PAIR_KEYS = ('pair', 'inputs', 'learner')
# What decides a pair, and how a bank of fitted ones is stored.
OF_PAIRS: Mapping[str, type[Learner]] = {'svm_pairs': SvmPairs, 'ann_pairs': AnnPairs}
BANKS = {'svm_pairs': (MACHINES, machines), 'ann_pairs': (NETWORKS, networks)}


@dataclass(frozen=True)
class TunedPair:
    """The variables of one pair of textures.

    Parameters
    ----------
    labels
        The two textures, in any order.
    inputs
        Inputs of the recipe whose features it sees, such as 'signal#2'; () for all.
    learner_name, learner
        What decides, of OF_PAIRS.

    Examples
    --------
    >>> TunedPair(('felt', 'cork'), ('signal#2',), 'svm_pairs', SvmPairs()).as_recipe()['pair']
    ['felt', 'cork']
    """

    labels: tuple[str, str]
    inputs: tuple[str, ...]
    learner_name: str
    learner: Learner

    @classmethod
    def from_recipe(cls, entry: Any, where: str) -> TunedPair:
        """Build from one entry of the list `pairs` of a recipe.

        Parameters
        ----------
        entry
            Mapping with `pair`, `learner` and, if not all inputs are used, `inputs`.
        where
            Where it stands, for the sentence of an error.

        Raises
        ------
        InvalidParameter, UnknownName
            If it is no such mapping, or names no learner of pairs.
        """
        if not isinstance(entry, Mapping):
            raise InvalidParameter(f'{where}: came {safe_repr(entry)}; a mapping with pair and learner is needed')
        for key in entry:
            if key not in PAIR_KEYS:
                raise InvalidParameter(f'{where}: {unknown_name(str(key), PAIR_KEYS, "key")}')
        labels, inputs = _texts(entry.get('pair'), 'pair', where), _texts(entry.get('inputs') or [], 'inputs', where)
        if len(labels) != 2 or labels[0] == labels[1]:
            raise InvalidParameter(f'{where}: pair is {list(labels)}; the labels of two textures are needed')
        learner = choose(OF_PAIRS, entry.get('learner', 'svm_pairs'), 'learner of pairs', where)
        return cls((labels[0], labels[1]), inputs, *learner)

    def as_recipe(self) -> dict[str, Any]:
        """Return the entry of a recipe."""
        of_all: dict[str, Any] = {'inputs': list(self.inputs)} if self.inputs else {}
        return {'pair': list(self.labels), **of_all, 'learner': {self.learner_name: entry_of(self.learner)}}


@dataclass(frozen=True)
class TunedPairs:
    """A machine or network for each pair of textures, each with its own features and parameters; most pairs won.

    The inputs of the recipe hold the features of all pairs; each pair is trained on, and sees, those of its own inputs.
    A pair that is not listed has all features and the common learner.

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.C: the learning is adapted
    to each pair of textures.

    Parameters
    ----------
    learner_name, learner
        What decides the pairs that are not listed.
    pairs
        Variables of single pairs.
    ties
        One of TIES: 'unclassified' returns no label, 'nearest' the one with larger margins.
    names, labels
        Of the features and the textures of the training; `of_examples` sets them.

    Examples
    --------
    In a recipe::

        inputs:
          signal: {features: [{spectral_peaks: {peaks: 3}}]}
          signal#2: {features: [{spectral_peaks: {peaks: 9}}, arc_length]}
        learner:
          tuned_pairs:
            learner: {svm_pairs: {kernel_scale: 4.0}}
            pairs:
              - {pair: [cork, felt], inputs: [signal#2], learner: {svm_pairs: {kernel_scale: 7.0}}}

    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 3))
    >>> pairs = [{'pair': ['cork', 'felt'], 'inputs': ['signal#2'], 'learner': 'ann_pairs'}]
    >>> learner = TunedPairs.from_recipe({'pairs': pairs}, 'recipe')
    >>> learner = learner.of_examples(['signal#1/a', 'signal#2/a', 'signal#2/b'], ['cork', 'felt'])
    >>> predictor = learner.predictor(learner.fit(values, codes, groups).parameters)
    >>> bool((predictor(values).argmax(axis=1) == codes).all())
    True
    """

    learner_name: str = 'svm_pairs'
    learner: Learner = field(default_factory=SvmPairs)
    pairs: tuple[TunedPair, ...] = ()
    ties: str = TIES[0]
    names: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.ties not in TIES:
            raise InvalidParameter(f"ties is '{self.ties}'; allowed is {' or '.join(TIES)}")
        listed = [frozenset(pair.labels) for pair in self.pairs]
        for labels in listed:
            if listed.count(labels) > 1:
                raise InvalidParameter(f'the pair {sorted(labels)} is listed twice; list it once')

    @classmethod
    def from_recipe(cls, values: Mapping[str, Any], where: str) -> TunedPairs:
        """Build from the section of a recipe.

        Parameters
        ----------
        values
            The section: `learner`, `pairs`, `ties`.
        where
            Where it stands, for the sentence of an error.

        Raises
        ------
        InvalidParameter, UnknownName
            If a key, a label or a learner is wrong.
        """
        if not isinstance(values, Mapping) or not isinstance(values.get('pairs') or [], list):
            raise InvalidParameter(f'{where}: came {safe_repr(values)}; a mapping with a list of pairs is needed')
        for key in values:
            if key not in KEYS:
                raise InvalidParameter(f'{where}: {unknown_name(str(key), KEYS, "key")}')
        learner = choose(OF_PAIRS, values.get('learner', 'svm_pairs'), 'learner of pairs', where)
        entries = enumerate(values.get('pairs') or [], 1)
        pairs = tuple(TunedPair.from_recipe(entry, f'{where}, pair {number}') for number, entry in entries)
        try:
            return cls(*learner, pairs, str(values.get('ties', TIES[0])))
        except InvalidParameter as error:
            raise InvalidParameter(f'{where}: {error}') from error

    def as_recipe(self) -> dict[str, Any]:
        """Return the section of a recipe."""
        return {
            'learner': {self.learner_name: entry_of(self.learner)},
            'pairs': [pair.as_recipe() for pair in self.pairs],
            'ties': self.ties,
        }

    def of_examples(self, names: Sequence[str], labels: Sequence[str]) -> TunedPairs:
        """Return the learner for examples with these features and textures.

        Parameters
        ----------
        names : (n_features,)
            Of the features, each beginning with its input.
        labels : (n_labels,)
            Of the textures, in the order of their numbers.

        Raises
        ------
        InvalidParameter
            If a pair sees an input that the examples lack.
        """
        bound = replace(self, names=tuple(names), labels=tuple(labels))
        for pair in self.pairs:
            bound._columns(pair)
        return bound

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,).

        Raises
        ------
        InvalidParameter
            If pairs have variables of their own, and nothing has told the names of features and textures.
        """
        if self.pairs and (len(self.names), len(self.labels)) != (X.shape[1], int(y.max()) + 1):
            raise InvalidParameter(
                'the pairs of the recipe have variables of their own, and the names of the features and textures are '
                "not known; train with `texture train`, or call the learner's `of_examples` first"
            )
        tuned = {frozenset(pair.labels): pair for pair in self.pairs}
        common = TunedPair(('', ' '), (), self.learner_name, self.learner)
        banks: dict[str, list[tuple[int, Codes, Mapping[str, Any]]]] = {name: [] for name in OF_PAIRS}
        n_tuned, pairs = 0, list(combinations(range(int(y.max()) + 1), 2))
        for number, (first, second) in enumerate(pairs):
            labels = frozenset(self.labels[code] for code in (first, second)) if self.pairs else frozenset()
            settings = tuned.get(labels, common)
            n_tuned += settings is not common
            columns = self._columns(settings) if settings.inputs else np.arange(X.shape[1])
            rows = np.flatnonzero((y == first) | (y == second))
            codes = (y[rows] == second).astype(np.intp)
            fitted = settings.learner.fit(X[np.ix_(rows, columns)], codes, groups[rows])
            banks[settings.learner_name].append((number, columns, fitted.parameters))
        parameters: dict[str, Any] = {'n_pairs': len(pairs), 'ties': self.ties}
        for name, members in banks.items():
            key, stack = BANKS[name]
            if members:
                parameters[key] = stack(members)
        return Fitted(parameters, None, NOTE.format(n_tuned, len(pairs)))

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> TunedPairsPredictor:
        """Return the predictor made from the stored parameters."""
        n_pairs = int(parameters['n_pairs'])
        return TunedPairsPredictor.of(parameters, n_pairs, PairVotes.of_pairs(n_pairs))

    def _columns(self, pair: TunedPair) -> Codes:
        """Return the numbers of the features that a pair sees."""
        own = tuple(f'{topic}/' for topic in pair.inputs)
        columns = np.flatnonzero([name.startswith(own) for name in self.names]) if own else np.arange(len(self.names))
        for topic in own:
            if not any(name.startswith(topic) for name in self.names):
                known = ', '.join(dict.fromkeys(name.split('/')[0] for name in self.names))
                raise InvalidParameter(
                    f"pair {list(pair.labels)} sees the input '{topic[:-1]}', which is not among the inputs of the "
                    f'recipe ({known}); name one of them'
                )
        return columns


def _texts(values: Any, what: str, where: str) -> tuple[str, ...]:
    if not isinstance(values, list | tuple) or not all(isinstance(value, str) for value in values):
        raise InvalidParameter(f'{where}: {what} is {safe_repr(values)}; a list of names is needed')
    return tuple(values)
