"""Machines and networks that see different features, as plain arrays that are evaluated together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.errors import ModelMismatch
from texture_estimation.learners.learner import Codes
from texture_estimation.learners.pair_votes import PairVotes
from texture_estimation.log_probabilities import log_softmax

MACHINES, NETWORKS = 'machines', 'networks'  # names of their parts in the model file
ROUNDED_UP = 0.5  # a network's output above it is 1, which is the first label of its pair
# Number of the pair, the features it sees and the fitted parameters of its learner, trained on two labels.
FittedPair = tuple[int, Codes, Mapping[str, Any]]


@dataclass(frozen=True, eq=False)
class PairInputs:
    """What each of several learners sees: features of its own; one with fewer is filled up with what adds nothing.

    Parameters
    ----------
    pairs : (n,)
        Number of the pair that each decides.
    columns : (n, n_inputs)
        Features that each sees; 0 where it has fewer.
    mean, inverse_scale : (n, n_inputs)
        Of the standardisation; an inverse scale of 0 takes a feature out.

    Examples
    --------
    >>> inputs = PairInputs(np.array([0]), np.array([[1]]), np.array([[2.0]]), np.array([[0.5]]))
    >>> inputs.standardised(np.array([9.0, 4.0])).tolist()  # (4 - 2) / 2, of the second feature alone
    [[1.0]]
    """

    pairs: Codes
    columns: Codes
    mean: Array
    inverse_scale: Array

    def standardised(self, X: Array) -> Array:
        """Return what each learner sees, (..., n, n_inputs) of (..., n_features).

        Parameters
        ----------
        X : (..., n_features)

        Returns
        -------
        (..., n, n_inputs)
        """
        seen: Array = (X[..., self.columns] - self.mean) * self.inverse_scale
        return seen


@dataclass(frozen=True, eq=False)
class PairMachines(PairInputs):
    """RBF machines, each with features of its own; smaller ones are filled up with what adds nothing.

    Parameters
    ----------
    pairs, columns, mean, inverse_scale
        As of `PairInputs`.
    vectors : (n, n_vectors, n_inputs)
        Standardised support vectors times 2 gamma.
    squares, coefficients : (n, n_vectors)
        Squared lengths of the vectors times gamma, and their coefficients; 0 where a machine has fewer.
    intercepts, gamma : (n,)

    Examples
    --------
    >>> one, vector = np.ones((1, 1)), np.array([[[4.0]]])  # a support vector at 2, of the second feature alone
    >>> bank = PairMachines(np.array([0]), np.array([[1]]), 0 * one, one, vector, 4 * one, one, np.zeros(1), np.ones(1))
    >>> bank.decisions(np.array([[9.0, 2.0], [9.0, 3.0]])).round(3)[:, 0].tolist()  # exp(-distance²)
    [1.0, 0.368]
    """

    vectors: Array
    squares: Array
    coefficients: Array
    intercepts: Array
    gamma: Array

    def decisions(self, X: Array) -> Array:
        """Return the decision of each machine, (..., n) of (..., n_features); positive for its first label.

        Parameters
        ----------
        X : (..., n_features)

        Returns
        -------
        (..., n)
        """
        standard = self.standardised(X)
        squares = self.gamma * np.add.reduce(standard * standard, axis=-1)
        exponents = _products(self.vectors, standard)
        exponents -= self.squares
        exponents -= squares[..., None]
        np.exp(exponents, out=exponents)
        exponents *= self.coefficients
        decisions: Array = np.add.reduce(exponents, axis=-1)
        return decisions + self.intercepts


@dataclass(frozen=True, eq=False)
class PairNetworks(PairInputs):
    """Networks with a sigmoid hidden layer, each with features and neurons of its own; smaller ones are filled up.

    Parameters
    ----------
    pairs, columns, mean, inverse_scale
        As of `PairInputs`.
    hidden : (n, n_hidden, n_inputs)
    hidden_bias, out : (n, n_hidden)
        0 where a network has fewer neurons.
    out_bias : (n,)

    Examples
    --------
    >>> one = np.ones((1, 1))  # one network with one neuron, of the second feature alone
    >>> bank = PairNetworks(np.array([0]), np.array([[1]]), 0 * one, one, one[None], 0 * one, one, np.zeros(1))
    >>> bank.decisions(np.array([[5.0, 0.0]])).tolist()  # tanh(0) - 0.5
    [[-0.5]]
    """

    hidden: Array
    hidden_bias: Array
    out: Array
    out_bias: Array

    def decisions(self, X: Array) -> Array:
        """Return the output of each network less what is rounded up, (..., n); positive for its first label.

        Parameters
        ----------
        X : (..., n_features)

        Returns
        -------
        (..., n)
        """
        standard = self.standardised(X)
        active = _products(self.hidden, standard)
        active += self.hidden_bias
        np.tanh(active, out=active)
        active *= self.out
        outputs: Array = np.add.reduce(active, axis=-1)
        return outputs + self.out_bias - ROUNDED_UP


@dataclass(frozen=True, eq=False)
class TunedPairsPredictor:
    """The machines and networks of all pairs, evaluated together.

    Examples
    --------
    >>> bank = PairNetworks(np.array([0]), np.array([[1]]), np.zeros((1, 1)), np.ones((1, 1)), np.full((1, 1, 1), 9.0),
    ...                     np.zeros((1, 1)), np.ones((1, 1)), np.zeros(1))
    >>> predictor = TunedPairsPredictor((bank,), PairVotes(2), 'unclassified')
    >>> predictor(np.array([[0.0, 1.0], [0.0, -1.0]])).argmax(axis=1).tolist()  # it sees the second feature alone
    [0, 1]
    """

    banks: tuple[PairMachines | PairNetworks, ...]
    votes: PairVotes
    ties: str

    @classmethod
    def of(cls, parameters: Mapping[str, Any], n_pairs: int, votes: PairVotes) -> TunedPairsPredictor:
        """Return the predictor of stored parameters.

        Parameters
        ----------
        parameters
            As the model file holds them.
        n_pairs
            Number of pairs.
        votes
            Counts the pairs won.

        Returns
        -------
        TunedPairsPredictor
            Ready to predict.

        Raises
        ------
        ModelMismatch
            If the pairs are not each decided once.
        """
        kinds: tuple[tuple[str, Any], ...] = ((MACHINES, PairMachines), (NETWORKS, PairNetworks))
        banks = tuple(kind(**parameters[name]) for name, kind in kinds if name in parameters)
        decided = sorted(np.concatenate([bank.pairs for bank in banks]).tolist()) if banks else []
        if decided != list(range(n_pairs)):
            raise ModelMismatch(f'its {n_pairs} pairs are decided by {len(decided)} learners, or some not once')
        return cls(banks, votes, str(parameters['ties']))

    def __call__(self, X: Array) -> Array:
        """Return log softmax of the number of pairs won, (..., n_labels) of (..., n_features)."""
        return log_softmax(self.votes.counted(self.decisions(X), self.ties))

    def decisions(self, X: Array) -> Array:
        """Return the decision of each pair, (..., n_pairs); positive for its first label.

        Parameters
        ----------
        X : (..., n_features)

        Returns
        -------
        (..., n_pairs)
            Pairs in the order (0, 1), (0, 2), …, (1, 2), ….
        """
        decisions = np.empty((*X.shape[:-1], sum(len(bank.pairs) for bank in self.banks)))
        for bank in self.banks:
            decisions[..., bank.pairs] = bank.decisions(X)
        return decisions


def machines(members: Sequence[FittedPair]) -> dict[str, Array | Codes]:
    """Return the arrays of `PairMachines` of machines fitted to two labels each.

    Parameters
    ----------
    members
        Number, features and parameters of `SvmPairs` of each.

    Returns
    -------
    dict
        Arrays by the names of the fields.
    """
    from texture_estimation.learners.svm_pairs import SvmPairs  # noqa: PLC0415  # which needs no bank of machines

    svms = [SvmPairs.predictor(parameters).svm for _, _, parameters in members]
    common = _common(members, [svm.mean for svm in svms], [svm.scale for svm in svms])
    return {
        **common,
        'vectors': _filled([svm.vectors for svm in svms]),
        'squares': _filled([svm.squares for svm in svms]),
        'coefficients': _filled([svm.coefficients.reshape(-1) for svm in svms]),
        'intercepts': np.array([svm.intercepts[0] for svm in svms]),
        'gamma': np.array([svm.gamma for svm in svms]),
    }


def networks(members: Sequence[FittedPair]) -> dict[str, Array | Codes]:
    """Return the arrays of `PairNetworks` of networks fitted to two labels each.

    Parameters
    ----------
    members
        Number, features and parameters of `AnnPairs` of each.

    Returns
    -------
    dict
        Arrays by the names of the fields.
    """
    fitted = [parameters for _, _, parameters in members]
    common = _common(members, [one['mean'] for one in fitted], [one['scale'] for one in fitted])
    weights = {name: _filled([one[name][0] for one in fitted]) for name in ('hidden', 'hidden_bias', 'out')}
    return {**common, **weights, 'out_bias': np.array([one['out_bias'][0] for one in fitted])}


def _common(members: Sequence[FittedPair], means: Sequence[Array], scales: Sequence[Array]) -> dict[str, Any]:
    return {
        'pairs': np.array([number for number, _, _ in members], dtype=np.intp),
        'columns': _filled([columns for _, columns, _ in members]).astype(np.intp),
        'mean': _filled(means),
        'inverse_scale': _filled([1.0 / scale for scale in scales]),
    }


def _filled(arrays: Sequence[Array | NDArray[np.intp]]) -> Array:
    """Return arrays as one, smaller ones filled up with zeros."""
    shape = np.max([array.shape for array in arrays], axis=0)
    filled = np.zeros((len(arrays), *shape))
    for place, array in zip(filled, arrays, strict=True):
        place[tuple(slice(length) for length in array.shape)] = array
    return filled


def _products(weights: Array, values: Array) -> Array:
    """Return the products of each learner's weights, (n, m, k), with its values, (..., n, k): (..., n, m)."""
    if values.ndim == 2:
        alone: Array = (weights @ values[..., None])[..., 0]
        return alone
    rows = values.reshape(-1, *values.shape[-2:])
    of_many: Array = (rows.swapaxes(0, 1) @ weights.swapaxes(1, 2)).swapaxes(0, 1)
    return np.ascontiguousarray(of_many).reshape(*values.shape[:-1], weights.shape[1])
