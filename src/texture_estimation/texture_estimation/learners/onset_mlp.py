"""Multilayer perceptron with a linear discriminant for the first window of a slide."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.learners.augmented_examples import AugmentedExamples
from texture_estimation.learners.learner import Codes
from texture_estimation.learners.linear_discriminant import linear_discriminant
from texture_estimation.learners.mlp import Mlp
from texture_estimation.learners.onset_mlp_predictor import OnsetMlpPredictor
from texture_features.features.slide_onset import NAME

UNBOUND = -1


@dataclass(frozen=True)
class OnsetMlp(Mlp):
    """The network `mlp` for all windows; the first of a slide is also judged by linear discriminant analysis.

    While friction, contact and sensor settle, features have other means and another covariance than later: a classifier
    of all windows knows little of it. First windows therefore have class-conditional Gaussians of their own, with one
    covariance that is shrunk towards its diagonal, as there is one example a slide. Their log-probabilities are added
    to those of the network. The feature `slide_onset` says which windows these are; the network does not see it.
    Without this feature there is the network alone.

    Source: Fisher 1936; Friedman 1989 for the shrinkage.

    Examples
    --------
    >>> codes, slides = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> X = np.stack([codes + 0.1 * np.random.default_rng(0).standard_normal(40), np.arange(40) % 5 == 0], axis=1)
    >>> learner = OnsetMlp(epochs=1).of_examples(['signal/mean/pac', 'signal/slide_onset'], ['cork', 'felt'])
    >>> predictor = learner.predictor(learner.fit(X, codes, slides).parameters)
    >>> predictor(np.array([[0.0, 1.0], [1.0, 1.0]])).argmax(axis=1).tolist()
    [0, 1]
    """

    onset_weight: float = param(
        1.0,
        'Sets the weight of the discriminant of the first window, relative to the network; a larger one lets the first '
        'window count more in the whole slide.',
        low=0.0,
        high=100.0,
    )
    shrinkage: float = param(
        0.3,
        'Sets how far the correlations within classes are shrunk towards 0; more needs fewer slides and separates '
        'less finely.',
        low=0.0,
        high=1.0,
    )
    column: int = param(
        UNBOUND, 'Number of the feature `slide_onset`; set by the training from the names of the features.', low=UNBOUND
    )

    def of_examples(self, names: Sequence[str], _labels: Sequence[str]) -> OnsetMlp:
        """Return the learner for examples with these features; without `slide_onset` it is the network alone."""
        found = [number for number, name in enumerate(names) if name.rsplit('/', 1)[-1] == NAME]
        return dataclasses.replace(self, column=found[0] if found else UNBOUND)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> OnsetMlpPredictor:
        """Return the predictor made from the stored parameters."""
        network = Mlp.predictor(parameters)
        return OnsetMlpPredictor(
            network.hidden,
            network.hidden_offset,
            network.output,
            network.output_offset,
            np.asarray(parameters['onset'], dtype=np.float64, order='F'),
            np.asarray(parameters['onset_offset'], dtype=np.float64),
            int(parameters['onset_column']),
        )

    def _fit(
        self, X: Array, y: Codes, n_labels: int, augmented: AugmentedExamples | None, share: float = 1.0
    ) -> dict[str, Array]:
        """Return the layers of the network and that of the onset."""
        blind = X.copy()
        first: Codes = np.zeros(0, dtype=np.intp)
        if self.column != UNBOUND:
            first = np.flatnonzero(X[:, self.column] > 0.0)
            blind[:, self.column] = 0.0  # what is constant tells nothing
        network = super()._fit(blind, y, n_labels, augmented, share)
        values, codes = X[first].astype(np.float64), y[first]
        if augmented is not None and len(first):
            values, codes = self._with_copies(values, codes, augmented)
        onset, offset = linear_discriminant(values, codes, n_labels, self.shrinkage)
        return {
            **network,
            'onset': self.onset_weight * onset,
            'onset_offset': self.onset_weight * offset,
            'onset_column': np.array(self.column),
        }

    def _with_copies(self, values: Array, codes: Codes, augmented: AugmentedExamples) -> tuple[Array, Codes]:
        """Return the first windows with those of changed copies, and all of them at both ends of the range of gains."""
        rows = np.unique(augmented.rows)
        rows = rows[augmented.values[rows, self.column] > 0.0]
        every = np.concatenate([values, augmented.values[rows].astype(np.float64)])
        labels = np.concatenate([codes, augmented.codes[rows]])
        louder = np.log(augmented.augmentation.gain_range) / np.sqrt(3.0) * augmented.gain_response
        return np.concatenate([every + louder, every - louder]), np.concatenate([labels, labels])
