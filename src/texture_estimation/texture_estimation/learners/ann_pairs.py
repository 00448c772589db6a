"""One neural network for each pair of textures; the texture that wins most pairs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.learners.learner import Codes, Fitted
from texture_estimation.learners.levenberg_marquardt import Network, fit_network
from texture_estimation.learners.pair_votes import TIES, PairVotes
from texture_estimation.learners.standardisation import standardisation
from texture_estimation.log_probabilities import log_softmax

NOTE = 'not calibrated: the pairs won are counted'
ROUNDED_UP = 0.5  # an output above it is 1, which is the first label of the pair
# One of so many is held out of each network's training to stop it: MATLAB holds out 15 %.
HELD_OUT = 7


@dataclass(frozen=True)
class AnnPairs:
    """A network with a sigmoid hidden layer and a linear, rounded output for each pair; most pairs won.

    Trained by the Levenberg-Marquardt method with early stopping on every seventh slide, as MATLAB does by default.

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.C.

    Examples
    --------
    >>> import numpy as np
    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 3))
    >>> fitted = AnnPairs().fit(values, codes, groups)
    >>> predictor = AnnPairs.predictor(fitted.parameters)
    >>> isinstance(predictor, PairNetworksPredictor), bool((predictor(values).argmax(axis=1) == codes).all())
    (True, True)
    """

    hidden: int = param(
        10,
        'Sets the number of neurons in the hidden layer; more neurons separate finer and cost computing time.',
        low=1,
        high=200,
    )
    iterations: int = param(
        30, 'Sets the largest number of training iterations; more take longer to train.', low=1, high=10_000
    )
    seed: int = param(0, 'Sets the seed of the initial weights; equal seeds give equal models.', low=0)
    ties: str = param(
        'unclassified',
        "How ties are broken: 'unclassified' returns no label, 'nearest' the one with larger margins.",
        choices=TIES,
    )

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""
        mean, scale = standardisation(X)
        standard = (X - mean) / scale
        held = _held_out(y, groups)
        rng = np.random.default_rng(self.seed)
        n_labels = int(y.max()) + 1
        networks = []
        for first, second in combinations(range(n_labels), 2):
            rows = np.flatnonzero((y == first) | (y == second))
            start = Network.random(self.hidden, X.shape[1], rng)
            targets = (y[rows] == first).astype(np.float64)
            networks.append(fit_network(start, standard[rows], targets, held[rows], self.iterations))
        parameters = {
            'mean': mean,
            'scale': scale,
            'hidden': np.stack([network.hidden for network in networks]),
            'hidden_bias': np.stack([network.hidden_bias for network in networks]),
            'out': np.stack([network.out for network in networks]),
            'out_bias': np.array([network.out_bias for network in networks]),
            'ties': self.ties,
        }
        return Fitted(parameters, None, NOTE)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> PairNetworksPredictor:
        """Return the predictor made from the stored parameters."""
        return PairNetworksPredictor(**parameters)


@dataclass(frozen=True, eq=False)
class PairNetworksPredictor:
    """The networks of all pairs, evaluated together.

    Parameters
    ----------
    mean, scale : (n_features,)
        Of the standardisation.
    hidden : (n_pairs, n_hidden, n_features)
    hidden_bias, out : (n_pairs, n_hidden)
    out_bias : (n_pairs,)
    ties
        One of TIES.
    """

    mean: Array
    scale: Array
    hidden: Array
    hidden_bias: Array
    out: Array
    out_bias: Array
    ties: str

    def __post_init__(self) -> None:
        n_pairs = len(self.out_bias)
        weights = self.hidden.reshape(-1, len(self.mean)) / self.scale
        object.__setattr__(self, '_weights', weights.T.copy())
        object.__setattr__(self, '_votes', PairVotes.of_pairs(n_pairs))

    def __call__(self, X: Array) -> Array:
        """Return log softmax of the number of pairs won, (..., n_labels) of (..., n_features)."""
        votes: PairVotes = self._votes  # type: ignore[attr-defined]
        return log_softmax(votes.counted(self.outputs(X) - ROUNDED_UP, self.ties))

    def outputs(self, values: Array) -> Array:
        """Return the output of each pair's network, (..., n_pairs): about 1 for its first label, 0 for its second.

        Parameters
        ----------
        values : (..., n_features)

        Returns
        -------
        (..., n_pairs)
            Pairs in the order (0, 1), (0, 2), …, (1, 2), ….
        """
        active = (values - self.mean) @ self._weights  # type: ignore[attr-defined]
        active += self.hidden_bias.reshape(-1)
        np.tanh(active, out=active)
        layers = active.reshape(*values.shape[:-1], *self.out.shape)
        layers *= self.out
        outputs: Array = np.add.reduce(layers, axis=-1)
        return outputs + self.out_bias


def _held_out(y: Codes, groups: Codes) -> NDArray[np.bool_]:
    """Return which examples tell when to stop: every seventh slide of a label, or example if there are few slides."""
    held = np.zeros(len(y), dtype=bool)
    for code in np.unique(y):
        rows = np.flatnonzero(y == code)
        slides = np.unique(groups[rows], return_inverse=True)[1].reshape(-1)
        number = slides if slides.max() + 1 >= HELD_OUT else np.arange(len(rows))
        held[rows] = number % HELD_OUT == HELD_OUT - 1
    return held
