"""Small neural networks trained together, from few examples and in few steps: quick, and good enough to compare by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.learners.levenberg_marquardt import SIGMOID, SLOPES, TRANSFERS
from texture_estimation.search.halves import Mask

STEPS = 10
FIRST_DAMPING, MORE, LESS = 1e-2, 10.0, 0.2


@dataclass(eq=False)
class SurrogateNetworks:
    """Networks of one hidden layer and one output each, over the same features: out · f(hidden x + bias) + out_bias.

    Parameters
    ----------
    hidden : (n_networks, n_features, n_hidden)
    bias, out : (n_networks, 1, n_hidden)
    out_bias : (n_networks, 1)
    transfer
        Transfer function f of the hidden layer, one of TRANSFERS.

    Examples
    --------
    >>> values = np.linspace(-1.0, 1.0, 20)[None, :, None]
    >>> networks = SurrogateNetworks.fitted(values, values[:, :, 0], n_hidden=3, rng=np.random.default_rng(0))
    >>> bool(np.abs(networks.outputs(values[0])[:, 0] - values[0, :, 0]).max() < 0.2)
    True
    """

    hidden: Array
    bias: Array
    out: Array
    out_bias: Array
    transfer: str = SIGMOID

    @classmethod
    def fitted(
        cls, values: Array, targets: Array, n_hidden: int, rng: np.random.Generator, transfer: str = SIGMOID
    ) -> SurrogateNetworks:
        """Return networks after their training.

        Parameters
        ----------
        values : (n_networks, n, n_features), or (1, n, n_features) if all train on the same examples
        targets : (n_networks, n)
        n_hidden
            Neurons of the hidden layer.
        rng
            Draws the first weights.
        transfer
            Of the hidden layer.

        Returns
        -------
        SurrogateNetworks
            n_networks of them.
        """
        networks = cls.random(len(targets), values.shape[-1], n_hidden, rng)
        networks.transfer = transfer
        networks.train(values, targets, STEPS)
        return networks

    @classmethod
    def random(cls, n_networks: int, n_features: int, n_hidden: int, rng: np.random.Generator) -> SurrogateNetworks:
        """Return networks before their training, alike for all.

        Parameters
        ----------
        n_networks
            Number of networks.
        n_features
            Number of inputs.
        n_hidden
            Neurons of the hidden layer.
        rng
            Draws the weights.

        Returns
        -------
        SurrogateNetworks
        """
        hidden = rng.normal(size=(1, n_features, n_hidden)) / np.sqrt(n_features)
        bias = rng.uniform(-1.0, 1.0, (1, 1, n_hidden))
        out = rng.normal(size=(1, 1, n_hidden)) / np.sqrt(n_hidden)
        copies = (n_networks, 1, 1)
        return cls(np.tile(hidden, copies), np.tile(bias, copies), np.tile(out, copies), np.full((n_networks, 1), 0.5))

    def outputs(self, standard: Array) -> Array:
        """Return the output of each network, (n, n_networks), of standardised values, (n, n_features).

        Parameters
        ----------
        standard : (n, n_features)

        Returns
        -------
        (n, n_networks)
        """
        n_networks, n_features, n_hidden = self.hidden.shape
        active = standard @ self.hidden.transpose(1, 0, 2).reshape(n_features, -1)
        active += self.bias.reshape(-1)
        active = TRANSFERS[self.transfer](active)
        active *= self.out.reshape(-1)
        outputs: Array = np.add.reduce(active.reshape(len(standard), n_networks, n_hidden), axis=-1)
        outputs += self.out_bias[:, 0]
        return outputs

    def train(self, values: Array, targets: Array, steps: int) -> None:
        """Make Levenberg-Marquardt steps towards targets (n_networks, n) of values (n_networks or 1, n, n_features).

        There are fewer examples than weights, mostly. So with the Jacobian J and the residual r, the step
        (JᵀJ + μ)⁻¹ Jᵀ r is taken as Jᵀ (J Jᵀ + μ)⁻¹ r, where J Jᵀ is a sum of products of small matrices.

        Parameters
        ----------
        values : (n_networks or 1, n, n_features)
            Standardised examples of each network, or of all.
        targets : (n_networks, n)
            What each network is to answer.
        steps
            Number of steps.
        """
        n_networks, n = targets.shape
        products = values @ values.swapaxes(-1, -2) + 1.0
        damping = np.full((n_networks, 1, 1), FIRST_DAMPING * n)
        active, residual = self._forward(values, targets)
        error = (residual * residual).sum(axis=1)
        diagonal = np.arange(n)
        for _ in range(steps):
            slopes = SLOPES[self.transfer](active) * self.out
            gram = slopes @ slopes.swapaxes(-1, -2)
            gram *= products
            gram += active @ active.swapaxes(-1, -2)
            gram += 1.0
            gram[:, diagonal, diagonal] += damping[..., 0]
            dual = np.linalg.solve(gram, residual[..., None])
            weighted = slopes * dual
            moved = SurrogateNetworks(
                self.hidden + values.swapaxes(-1, -2) @ weighted,
                self.bias + weighted.sum(axis=1, keepdims=True),
                self.out + dual.swapaxes(-1, -2) @ active,
                self.out_bias + dual.sum(axis=1),
                self.transfer,
            )
            new_active, new_residual = moved._forward(values, targets)
            new_error = (new_residual * new_residual).sum(axis=1)
            better = new_error < error
            damping *= np.where(better, LESS, MORE)[:, None, None]
            self._take(moved, better)
            active = np.where(better[:, None, None], new_active, active)
            residual = np.where(better[:, None], new_residual, residual)
            error = np.where(better, new_error, error)

    def _forward(self, values: Array, targets: Array) -> tuple[Array, Array]:
        active = TRANSFERS[self.transfer](values @ self.hidden + self.bias)
        return active, targets - (active * self.out).sum(axis=-1) - self.out_bias

    def _take(self, other: SurrogateNetworks, which: Mask) -> None:
        for name in ('hidden', 'bias', 'out', 'out_bias'):
            getattr(self, name)[which] = getattr(other, name)[which]


def sample_rows(y: Codes, training: Mask, most: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Return the rows of `most` training examples of each label, of the rarest one all, (n_labels, count).

    Parameters
    ----------
    y : (n,)
        Number of the label of each example.
    training : (n,) bool
        Which examples may be drawn.
    most
        Largest number of rows of each label.
    rng
        Draws them.

    Returns
    -------
    (n_labels, count)
        Indices; as many of each label.
    """
    members = [np.flatnonzero(training & (y == label)) for label in np.unique(y)]
    count = min(most, *map(len, members))
    return np.array([rng.choice(of_label, count, replace=False) for of_label in members])
