"""Quick stand-ins for the networks of all pairs: trained together, from few examples, in few steps."""

from __future__ import annotations

import numpy as np

from texture_core.arrays import Array
from texture_estimation.learners.ann_pairs import ROUNDED_UP, AnnPairs
from texture_estimation.learners.learner import Codes
from texture_estimation.learners.pair_votes import PairVotes
from texture_estimation.learners.standardisation import standardisation
from texture_estimation.search.halves import Mask
from texture_estimation.search.surrogates.networks import SurrogateNetworks, sample_rows
from texture_estimation.search.surrogates.surrogate import ScoresOfHalf

# Examples that are used for training, of all labels: with many labels there are many networks, and time for few each.
EXAMPLES = 200


def ann_pairs(learner: AnnPairs, X: Array, y: Codes, groups: Codes) -> ScoresOfHalf:
    """Return a scorer of one half split by the pairs won.

    Each network sees the examples of its pair, of 200 that are drawn from all labels, and makes ten steps of the
    Levenberg-Marquardt method, without a part held out to stop early; `exact` does what the learner does. Both
    accuracies are those of the whole half.
    """
    mean, scale = standardisation(X)
    standard = np.ascontiguousarray((X - mean) / scale)
    n_labels = int(y.max()) + 1
    first, second = np.triu_indices(n_labels, k=1)
    votes = PairVotes(n_labels)

    def scores(training: Mask) -> Array:
        rng = np.random.default_rng(learner.seed)
        rows = sample_rows(y, training, EXAMPLES // n_labels, rng)
        of_pairs = standard[np.concatenate([rows[first], rows[second]], axis=1)]
        # 1 for the first label of a pair, 0 for the second
        targets = np.tile(np.repeat([1.0, 0.0], rows.shape[1]), (len(first), 1))
        networks = SurrogateNetworks.fitted(of_pairs, targets, learner.hidden, rng)
        return votes.counted(networks.outputs(standard) - ROUNDED_UP, learner.ties)

    return scores
