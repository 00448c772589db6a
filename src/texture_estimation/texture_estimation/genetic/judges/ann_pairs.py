"""Quick stand-ins for the networks of all pairs: trained together, from few examples, in few steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_estimation.genetic.halves import Mask
from texture_estimation.genetic.judges.judge import ScoresOfHalf
from texture_estimation.learners.ann_pairs import AnnPairs
from texture_estimation.learners.learner import Codes
from texture_estimation.learners.pair_votes import PairVotes
from texture_estimation.learners.standardisation import standardisation

# Examples of each label that a network learns from, and its steps.
EXAMPLES, STEPS = 32, 10
FIRST_DAMPING, MORE, LESS = 1e-2, 10.0, 0.2


def ann_pairs(learner: AnnPairs, values: Array, codes: Codes, groups: Codes) -> ScoresOfHalf:
    """Return what judges a half by the pairs won.

    Each network sees 32 learnt examples of each label and makes ten steps of the Levenberg-Marquardt method, without
    a part held out to stop early; `exact` does what the learner does. Both accuracies are told of the whole half.
    """
    mean, scale = standardisation(values)
    standard = np.ascontiguousarray((values - mean) / scale)
    votes = PairVotes(int(codes.max()) + 1)

    def scores(learnt: Mask) -> Array:
        rng = np.random.default_rng(learner.seed)
        networks = Networks.fitted(standard, codes, learnt, learner.hidden, rng)
        return votes.won(networks.outputs(standard) > 0.5)

    return scores


@dataclass(eq=False)
class Networks:
    """Networks of one hidden layer, one for each pair: out · tanh(hidden x + bias) + out_bias.

    Parameters
    ----------
    hidden : (n_pairs, n_features, n_hidden)
    bias, out : (n_pairs, 1, n_hidden)
    out_bias : (n_pairs, 1)
    """

    hidden: Array
    bias: Array
    out: Array
    out_bias: Array

    @classmethod
    def fitted(cls, standard: Array, codes: Codes, learnt: Mask, n_hidden: int, rng: np.random.Generator) -> Networks:
        """Return the networks of all pairs, which answer 1 for the first and 0 for the second label of theirs."""
        n_labels = int(codes.max()) + 1
        members = [np.flatnonzero(learnt & (codes == label)) for label in range(n_labels)]
        count = min(EXAMPLES, *map(len, members))
        rows = np.array([rng.choice(of_label, count, replace=False) for of_label in members])
        first, second = np.triu_indices(n_labels, k=1)
        values = standard[np.concatenate([rows[first], rows[second]], axis=1)]
        targets = np.tile(np.repeat([1.0, 0.0], count), (len(first), 1))
        networks = cls.random(len(first), values.shape[-1], n_hidden, rng)
        networks.train(values, targets, STEPS)
        return networks

    @classmethod
    def random(cls, n_pairs: int, n_features: int, n_hidden: int, rng: np.random.Generator) -> Networks:
        """Return networks before their training, alike for all pairs."""
        hidden = rng.normal(size=(1, n_features, n_hidden)) / np.sqrt(n_features)
        bias = rng.uniform(-1.0, 1.0, (1, 1, n_hidden))
        out = rng.normal(size=(1, 1, n_hidden)) / np.sqrt(n_hidden)
        copies = (n_pairs, 1, 1)
        return cls(np.tile(hidden, copies), np.tile(bias, copies), np.tile(out, copies), np.full((n_pairs, 1), 0.5))

    def outputs(self, standard: Array) -> Array:
        """Return the output of each network, (n, n_pairs), of standardised values, (n, n_features)."""
        n_pairs, n_features, n_hidden = self.hidden.shape
        active = standard @ self.hidden.transpose(1, 0, 2).reshape(n_features, -1)
        active += self.bias.reshape(-1)
        np.tanh(active, out=active)
        active *= self.out.reshape(-1)
        outputs: Array = np.add.reduce(active.reshape(len(standard), n_pairs, n_hidden), axis=-1)
        outputs += self.out_bias[:, 0]
        return outputs

    def train(self, values: Array, targets: Array, steps: int) -> None:
        """Make Levenberg-Marquardt steps towards targets (n_pairs, n) of values (n_pairs, n, n_features).

        There are fewer examples than weights, mostly. So with the Jacobian J and the residual r, the step
        (JᵀJ + μ)⁻¹ Jᵀ r is taken as Jᵀ (J Jᵀ + μ)⁻¹ r, where J Jᵀ is a sum of products of small matrices.
        """
        n_pairs, n, _ = values.shape
        products = values @ values.swapaxes(-1, -2) + 1.0
        damping = np.full((n_pairs, 1, 1), FIRST_DAMPING * n)
        active, residual = self._forward(values, targets)
        error = (residual * residual).sum(axis=1)
        diagonal = np.arange(n)
        for _ in range(steps):
            slopes = (1.0 - active * active) * self.out
            gram = slopes @ slopes.swapaxes(-1, -2)
            gram *= products
            gram += active @ active.swapaxes(-1, -2)
            gram += 1.0
            gram[:, diagonal, diagonal] += damping[..., 0]
            dual = np.linalg.solve(gram, residual[..., None])
            weighted = slopes * dual
            moved = Networks(
                self.hidden + values.swapaxes(-1, -2) @ weighted,
                self.bias + weighted.sum(axis=1, keepdims=True),
                self.out + dual.swapaxes(-1, -2) @ active,
                self.out_bias + dual.sum(axis=1),
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
        active = np.tanh(values @ self.hidden + self.bias)
        return active, targets - (active * self.out).sum(axis=-1) - self.out_bias

    def _take(self, other: Networks, which: Mask) -> None:
        for name in ('hidden', 'bias', 'out', 'out_bias'):
            getattr(self, name)[which] = getattr(other, name)[which]
