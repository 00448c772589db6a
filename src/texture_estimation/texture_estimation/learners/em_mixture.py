"""Clusters found without labels, then named after the labels that most of their examples have."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.learners.learner import Codes, Fitted
from texture_estimation.learners.standardisation import standardisation
from texture_estimation.log_probabilities import log_softmax

# A label to which no cluster belongs keeps so much, so that its logarithm is finite.
LEAST = 1e-6


@dataclass(frozen=True)
class EmMixture:
    """A mixture of normal distributions fitted by expectation and maximisation; classes to clusters by majority.

    A label that no cluster is named after is never recognised.

    Source: Kaboli et al. 2015, section V.C.

    Examples
    --------
    >>> import numpy as np
    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 3))
    >>> fitted = EmMixture().fit(values, codes, groups)
    >>> predictor = EmMixture.predictor(fitted.parameters)
    >>> isinstance(predictor, MixturePredictor), bool((predictor(values).argmax(axis=1) == codes).all())
    (True, True)
    """

    clusters_per_label: int = param(
        1, 'Sets the number of clusters per label; more clusters fit more diverse slides of one label.', low=1, high=50
    )
    covariance: str = param(
        'full',
        "Covariance of a cluster: 'full', or 'diag' if features are taken as independent.",
        choices=('full', 'diag'),
    )
    regularisation: float = param(
        1e-3,
        'Sets the variance added to the standardised features, which keeps clusters from collapsing; a '
        'larger one smooths more.',
        low=1e-9,
    )
    starts: int = param(
        3, 'Number of random initialisations; the result with the highest likelihood is kept.', low=1, high=1000
    )
    seed: int = param(0, 'Sets the seed of the random initialisations; equal seeds give equal models.', low=0)

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""
        from sklearn.mixture import GaussianMixture  # noqa: PLC0415  # scikit-learn takes a second to import

        mean, scale = standardisation(X)
        standard = (X - mean) / scale
        n_labels = int(y.max()) + 1
        distinct = len(np.unique(standard, axis=0))
        mixture = GaussianMixture(
            min(self.clusters_per_label * n_labels, distinct),
            covariance_type=self.covariance,
            reg_covar=self.regularisation,
            n_init=self.starts,
            random_state=self.seed,
        ).fit(standard)
        found = mixture.predict(standard)
        n_clusters = len(mixture.weights_)
        counts = np.zeros((n_clusters, n_labels))
        np.add.at(counts, (found, y), 1.0)
        factors = mixture.precisions_cholesky_
        parameters = {
            'mean': mean,
            'scale': scale,
            'centres': mixture.means_,
            'factors': factors if self.covariance == 'full' else np.stack([np.diag(row) for row in factors]),
            'log_weights': np.log(mixture.weights_),
            'names': np.eye(n_labels)[counts.argmax(axis=1)],
        }
        return Fitted(parameters, None, 'not calibrated: probabilities of clusters found without labels')

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> MixturePredictor:
        """Return the predictor made from the stored parameters."""
        return MixturePredictor(**parameters)


@dataclass(frozen=True, eq=False)
class MixturePredictor:
    """A mixture of normal distributions, each with the name of a label.

    Parameters
    ----------
    mean, scale : (n_features,)
        Of the standardisation.
    centres : (n_clusters, n_features)
    factors : (n_clusters, n_features, n_features)
        Upper triangular; the precision matrix is factor · factorᵀ.
    log_weights : (n_clusters,)
    names : (n_clusters, n_labels)
        1 for the label of the cluster, else 0.
    """

    mean: Array
    scale: Array
    centres: Array
    factors: Array
    log_weights: Array
    names: Array

    def __post_init__(self) -> None:
        n_features = self.factors.shape[1]
        together = self.factors.transpose(1, 0, 2).reshape(n_features, -1)
        shift = np.einsum('kf,kfg->kg', self.centres, self.factors)
        determinants = np.log(np.diagonal(self.factors, axis1=1, axis2=2)).sum(axis=1)
        object.__setattr__(self, '_together', together.copy())
        object.__setattr__(self, '_shift', shift)
        object.__setattr__(self, '_constant', determinants + self.log_weights)

    def __call__(self, X: Array) -> Array:
        """Return the log-probability of each label, (..., n_labels) of (..., n_features)."""
        shares = np.exp(log_softmax(self.cluster_scores(X)))
        return log_softmax(np.log(shares @ self.names + LEAST))

    def cluster_scores(self, X: Array) -> Array:
        """Return the log-density of each cluster times its weight, but for a constant, (..., n_clusters).

        Parameters
        ----------
        X : (..., n_features)

        Returns
        -------
        (..., n_clusters)
            In nats.
        """
        standard = (X - self.mean) / self.scale
        white = (standard @ self._together).reshape(*standard.shape[:-1], *self._shift.shape)  # type: ignore[attr-defined]
        white -= self._shift  # type: ignore[attr-defined]
        scores: Array = self._constant - 0.5 * np.add.reduce(white * white, axis=-1)  # type: ignore[attr-defined]
        return scores
