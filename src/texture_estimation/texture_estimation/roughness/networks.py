"""Small neural networks of one output each, evaluated together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.learners.levenberg_marquardt import LINEAR, SIGMOID, TRANSFERS, Network, fit_network
from texture_estimation.learners.standardisation import standardisation

# One of so many windows of each texture tells when to stop: MATLAB holds out 15 %.
HELD_OUT = 7


@dataclass(frozen=True, eq=False)
class RegressionNetworks:
    """Hidden layers with one linear output each, over the same standardised features.

    Parameters
    ----------
    mean, scale : (n_features,)
    hidden : (n_networks · n_hidden, n_features)
    hidden_bias : (n_networks · n_hidden,)
    out : (n_networks, n_hidden)
    out_bias : (n_networks,)
    linear : ()
        Whether the hidden layers are linear, not sigmoid.

    Examples
    --------
    >>> zero, one = np.zeros(1), np.ones(1)
    >>> networks = RegressionNetworks(zero, one, one[None], zero, one[None], zero)
    >>> networks(np.array([[0.5]])).round(3).tolist()  # tanh(0.5)
    [[0.462]]
    """

    mean: Array
    scale: Array
    hidden: Array
    hidden_bias: Array
    out: Array
    out_bias: Array
    linear: Array = field(default_factory=lambda: np.array(False))

    def __call__(self, X: Array) -> Array:
        """Return the outputs, (..., n_networks) of (..., n_features)."""
        active = TRANSFERS[LINEAR if self.linear else SIGMOID](
            (X - self.mean) / self.scale @ self.hidden.T + self.hidden_bias
        )
        by_network = active.reshape(*active.shape[:-1], *self.out.shape)
        outputs: Array = (by_network * self.out).sum(axis=-1) + self.out_bias
        return outputs


def fit_networks(
    values: Array, targets: Sequence[Array], groups: Codes, *, hidden: int, iterations: int, seed: int, transfer: str
) -> Mapping[str, Any]:
    """Return the fields of `RegressionNetworks`, one network for each target, (n,), of values (n, n_features).

    Parameters
    ----------
    values : (n, n_features)
        Features of windows.
    targets : of each network (n,)
        What it is to answer.
    groups : (n,)
        Number of the texture of each window; whole textures are held out to stop early.
    hidden
        Neurons of the hidden layer.
    iterations
        Largest number of steps.
    seed
        Seed of the first weights and of what is held out.
    transfer
        Name of the transfer function of the output.

    Returns
    -------
    dict
        Arrays by the names of the fields.
    """
    mean, scale = standardisation(values)
    standard = (values - mean) / scale
    rng = np.random.default_rng(seed)
    held = _held_out(groups)
    fitted = [
        fit_network(Network.random(hidden, values.shape[1], rng, transfer), standard, target, held, iterations)
        for target in targets
    ]
    return {
        'mean': mean,
        'scale': scale,
        'hidden': np.concatenate([network.hidden for network in fitted]),
        'hidden_bias': np.concatenate([network.hidden_bias for network in fitted]),
        'out': np.stack([network.out for network in fitted]),
        'out_bias': np.array([network.out_bias for network in fitted]),
        'linear': np.array(transfer == LINEAR),
    }


def _held_out(textures: Codes) -> Any:
    """Return every seventh window of each texture, (n,) bool."""
    held = np.zeros(len(textures), dtype=bool)
    for code in np.unique(textures):
        held[np.flatnonzero(textures == code)[HELD_OUT - 1 :: HELD_OUT]] = True
    return held
