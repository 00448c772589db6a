"""Fit a small neural network of one output by the Levenberg-Marquardt method, stopped early."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array

# As MATLAB's trainlm: damping at the start, its steps and its end, and failures on what is held out.
FIRST_DAMPING, MORE, LESS, MAX_DAMPING = 1e-3, 10.0, 0.1, 1e10
PATIENCE = 6
SOLVED = 1e-7  # mean square error of targets of 0 and 1
SIGMOID, LINEAR = 'sigmoid', 'linear'
TRANSFERS: Mapping[str, Callable[[Array], Array]] = {SIGMOID: np.tanh, LINEAR: lambda given: given}
SLOPES: Mapping[str, Callable[[Array], Array]] = {
    SIGMOID: lambda active: 1.0 - active * active,
    LINEAR: np.ones_like,
}


@dataclass(frozen=True, eq=False)
class Network:
    """One hidden layer and one linear output: out · f(hidden · x + hidden_bias) + out_bias.

    Parameters
    ----------
    hidden : (n_hidden, n_features)
    hidden_bias, out : (n_hidden,)
    out_bias
    transfer
        Transfer function f of the hidden layer, one of TRANSFERS: 'sigmoid' is tanh, 'linear' leaves its input.

    Examples
    --------
    >>> values = np.linspace(-2.0, 2.0, 40)[:, None]
    >>> start = Network.random(3, 1, np.random.default_rng(0))
    >>> trained = fit_network(start, values, np.tanh(2.0 * values[:, 0]), np.zeros(40, dtype=bool), 100)
    >>> bool(np.abs(trained(values) - np.tanh(2.0 * values[:, 0])).max() < 0.01)
    True
    """

    hidden: Array
    hidden_bias: Array
    out: Array
    out_bias: float
    transfer: str = SIGMOID

    @classmethod
    def random(cls, n_hidden: int, n_features: int, rng: np.random.Generator, transfer: str = SIGMOID) -> Network:
        """Return a network before its training, for inputs of unit variance.

        Parameters
        ----------
        n_hidden
            Neurons of the hidden layer.
        n_features
            Number of inputs.
        rng
            Draws the weights.
        transfer
            Transfer function of the hidden layer, one of TRANSFERS.

        Returns
        -------
        Network
        """
        hidden = rng.normal(size=(n_hidden, n_features)) / np.sqrt(n_features)
        bias = rng.uniform(-1.0, 1.0, n_hidden)
        return cls(hidden, bias, rng.normal(size=n_hidden) / np.sqrt(n_hidden), 0.5, transfer)

    def active(self, X: Array) -> Array:
        """Return what the hidden layer gives, (n, n_hidden) of (n, n_features).

        Parameters
        ----------
        X : (n, n_features)
            Standardised.

        Returns
        -------
        (n, n_hidden)
        """
        return TRANSFERS[self.transfer](X @ self.hidden.T + self.hidden_bias)

    def slope(self, active: Array) -> Array:
        """Return the derivative of the transfer function where it gives `active`, (n, n_hidden).

        Parameters
        ----------
        active : (n, n_hidden)
            As `active` gives it.

        Returns
        -------
        (n, n_hidden)
        """
        return SLOPES[self.transfer](active)

    def __call__(self, X: Array) -> Array:
        """Return the output, (n,) of (n, n_features)."""
        output: Array = self.active(X) @ self.out + self.out_bias
        return output

    def jacobian(self, values: Array) -> tuple[Array, Array]:
        """Return the output, (n,), and its derivative by each weight, (n, n_weights), in the order of `moved`.

        Parameters
        ----------
        values : (n, n_features)
            Standardised.

        Returns
        -------
        (n,)
            Output for each example.
        (n, n_weights)
            Derivative of each output by each weight.
        """
        active = self.active(values)
        by_bias = self.slope(active) * self.out
        by_hidden = by_bias[:, :, None] * values[:, None, :]
        columns = (by_hidden.reshape(len(values), -1), by_bias, active, np.ones((len(values), 1)))
        return active @ self.out + self.out_bias, np.concatenate(columns, axis=1)

    def moved(self, step: Array) -> Network:
        """Return the network with a step, (n_weights,), added to its weights.

        Parameters
        ----------
        step : (n_weights,)
            In the order of `jacobian`.
        """
        n_hidden = len(self.out)
        hidden, bias, out, out_bias = np.split(step, np.cumsum([self.hidden.size, n_hidden, n_hidden]))
        return Network(
            self.hidden + hidden.reshape(self.hidden.shape),
            self.hidden_bias + bias,
            self.out + out,
            self.out_bias + float(out_bias[0]),
            self.transfer,
        )


def fit_network(network: Network, values: Array, targets: Array, held: NDArray[np.bool_], iterations: int) -> Network:
    """Return the network after its training; of its states, the one with the least error on what is held out.

    Parameters
    ----------
    network
        Where to start.
    values, targets : (n, n_features), (n,)
        Examples.
    held : (n,) bool
        Examples held out, which tell when to stop; none to stop by `iterations` alone.
    iterations
        At most so many.

    Returns
    -------
    Network
        With the shape of `network`.

    Source: Hagan & Menhaj 1994; early stopping as in MATLAB's trainlm.
    """
    training, wanted = values[~held], targets[~held]
    held_rows = held if held.any() else ~held
    best, best_error = network, _error(network, values[held_rows], targets[held_rows])
    failures, damping = 0, FIRST_DAMPING
    for _ in range(iterations):
        stepped, damping = _step(network, training, wanted, damping)
        if stepped is None:
            break
        network = stepped
        error = _error(network, values[held_rows], targets[held_rows])
        if error < best_error:
            best, best_error, failures = network, error, 0
        else:
            failures += 1
        if failures >= PATIENCE or error < SOLVED:
            break
    return best


def _step(network: Network, values: Array, targets: Array, damping: float) -> tuple[Network | None, float]:
    """Return the network after one step that lessens the error, and the next damping; None if there is no such step."""
    n_weights = network.hidden.size + 2 * len(network.out) + 1
    linear = _by_examples(network, values) if n_weights > len(values) else _by_weights(network, values)
    residual = targets - linear.output
    error = float(residual @ residual) / len(residual)
    curvature = linear.curvature
    slope = linear.slope(residual)
    diagonal = np.diag_indices_from(curvature)
    own = curvature[diagonal]
    while damping <= MAX_DAMPING:
        curvature[diagonal] = own + damping
        solved: Array = np.asarray(np.linalg.solve(curvature, slope), dtype=np.float64)
        stepped = network.moved(linear.step(solved))
        if _error(stepped, values, targets) < error:
            return stepped, max(damping * LESS, 1e-12)
        damping *= MORE
    return None, damping


@dataclass(frozen=True, eq=False)
class _Linear:
    """A network near its weights: with Jacobian J and residual r, a step is (JᵀJ + μ)⁻¹ Jᵀr = Jᵀ(JJᵀ + μ)⁻¹ r."""

    output: Array
    curvature: Array
    slope: Callable[[Array], Array]
    step: Callable[[Array], Array]


def _by_weights(network: Network, values: Array) -> _Linear:
    """Return the first form, for fewer weights than examples."""
    output, jacobian = network.jacobian(values)
    return _Linear(output, jacobian.T @ jacobian, lambda residual: jacobian.T @ residual, lambda solved: solved)


def _by_examples(network: Network, values: Array) -> _Linear:
    """Return the second form, for fewer examples than weights; JJᵀ is made of its factors, without J."""
    active = network.active(values)
    by_bias = network.slope(active) * network.out
    curvature = (by_bias @ by_bias.T) * (values @ values.T + 1.0) + active @ active.T + 1.0

    def step(solved: Array) -> Array:
        weighted = by_bias * solved[:, None]
        parameters = ((weighted.T @ values).ravel(), weighted.sum(axis=0), solved @ active, solved.sum(keepdims=True))
        return np.concatenate(parameters)

    return _Linear(active @ network.out + network.out_bias, curvature, lambda residual: residual, step)


def _error(network: Network, values: Array, targets: Array) -> float:
    residual = targets - network(values)
    return float(residual @ residual) / len(residual)
