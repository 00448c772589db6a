# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fabrics by a finger of PVDF (Hu et al. 2014): power spectrum, principal components, machines by Max Wins.

What the paper describes and what is done here, element by element:

slide
    :Paper: 25.5 mm/s, 1.5 N, along x and along y, 60 places on each linen (5.1). Time and sampling rate are not
        told, nor whether the finger is lifted between both.
    :Here: Preset `hu-cross`: both in one contact, 3.25 s each; `hu`: one by one. 12 288 points at 4096 Hz are 3 s.
spectrum
    :Paper: Fast Fourier transform, 12 288 points (4.1); figure 8 shows power densities.
    :Here: `Spectrum` of magnitudes, nearest to the 39 components. A Hann taper and zeros up to 24 576 samples are
        ours.
centring
    :Paper: The mean of each example over its points (eq. 7).
    :Here: The same.
components
    :Paper: 99 % of the variance: 39 of the 60 slides of one linen (5.2); the examples as they are are projected (eq.
        12).
    :Here: Of all training slides, since machines need one basis; the centred examples are projected. `hu-components`
        has those of one linen.
x and y
    :Paper: Joined, 78 numbers (5.2).
    :Here: `hu-pca-svm-xy`: inputs `signal@x` and `signal@y`, each with its components, about 150 numbers; the
        experiment also has 39 + 39.
machine
    :Paper: RBF, one against one, Max Wins (4.2). Width and penalty are not given.
    :Here: `SvmMaxWins`: those of scikit-learn's `SVC`, with C = 10.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from texture_core.config import param
from texture_core.errors import InvalidParameter
from texture_core.types import Array
from texture_estimation.learners.learner import Codes, Fitted
from texture_estimation.learners.sklearn_learner import packed, unpacked
from texture_features.features.spectral import long_densities
from texture_features.windows import WindowBatch
from texture_papers.roberge import PairsPredictor, decisions_of

SCALES: Mapping[str, Callable[[Array, float], Array]] = {
    'log': lambda density, floor: np.log(density + floor),
    'power': lambda density, floor: density,
    'magnitude': lambda density, floor: np.sqrt(density),
}


@dataclass(frozen=True)
class Spectrum:
    """Power spectral density at equal steps up to half the sampling rate, its square root or its logarithm.

    Meant for a learner that begins with principal components. A window shorter than 2 · `points` is padded with zeros;
    of a longer one the mean over segments of that length, half overlapping, is taken.

    Source: Hu et al. 2014, section 4.1 (12 288 points there).
    """

    per_channel: ClassVar[bool] = True

    points: int = param(
        12288,
        'Number of frequency bins k · rate / (2 · points), k from 1.',
        low=2,
        high=1 << 19,
    )
    scale: str = param(
        'log',
        "What is given of the power density: its logarithm 'log', 'power' itself, or its square root 'magnitude'.",
        choices=tuple(SCALES),
    )
    floor: float = param(
        1e-20,
        'Power density added before the logarithm, so that silence gives a finite value, unit²/Hz.',
        low=1e-300,
        high=1e300,
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the frequency, from 1."""
        return tuple(str(point + 1) for point in range(self.points))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(density + floor), the density, or its square root."""
        density = long_densities(windows.rows, windows.rate_hz, self.points)
        return SCALES[self.scale](density, self.floor)


TINY = 1e-12


@dataclass(frozen=True)
class SvmMaxWins:
    """The first principal components that explain most of the variance, and RBF SVMs for all pairs of labels.

    The mean of each example over its features is subtracted (eq. 7). The machines are scikit-learn's `SVC` with its
    usual kernel width, gamma = 1 / (n_components · variance). The label that wins most pairs is taken; ties are broken
    by the clearer decisions.

    Source: Hu et al. 2014, section 4: 99 % of the variance, for each of two directions, joined.
    """

    variance: float = param(
        0.99,
        'Fraction of the variance that the kept principal components explain.',
        low=0.01,
        high=1.0,
    )
    components: int = param(0, 'Number of components of each block instead; 0: by the variance.', low=0, high=10_000)
    blocks: int = param(
        1,
        'Number of equal feature blocks with separate components, such as the directions x and y.',
        low=1,
        high=64,
    )
    c: float = param(
        10.0,
        'Penalty of a training error (box constraint C); a larger one fits the training data more closely.',
        low=1e-6,
        high=1e9,
    )

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""
        from sklearn.svm import SVC  # noqa: PLC0415  # scikit-learn takes a second to import

        components = self._components(X)
        machine = SVC(C=self.c, decision_function_shape='ovo').fit(X @ components, y)
        note = f'not calibrated: pairs won; {components.shape[1]} principal components'
        return Fitted({'components': components, 'packed': packed(machine, 'SVC')}, None, note)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> PairsPredictor:
        """Return the predictor made from the stored parameters."""
        components, machine = parameters['components'], unpacked(parameters['packed'])
        return PairsPredictor(lambda X: decisions_of(machine, X @ components), 'nearest')

    def _components(self, values: Array) -> Array:
        """Return the components of all blocks, (n_features, n_components), less their means.

        x - mean(x) projected on p is x projected on p - mean(p).
        """
        n_features = values.shape[1]
        if n_features % self.blocks:
            raise InvalidParameter(
                f"parameter 'blocks' of svm_max_wins is {self.blocks}, which does not divide {n_features} features; "
                'give as many blocks as directions are joined'
            )
        size, found = n_features // self.blocks, []
        for number, part in enumerate(np.split(values, self.blocks, axis=1)):
            kept = principal_components(part - part.mean(axis=1, keepdims=True), self.variance, self.components)
            before, after = number * size, n_features - (number + 1) * size
            found.append(np.pad(kept - kept.mean(axis=0), ((before, after), (0, 0))))
        return np.concatenate(found, axis=1)


def principal_components(centred: Array, fraction: float, wanted: int = 0) -> Array:
    """Return the fewest components, (n_features, n_components), that explain a fraction of the variance, or `wanted`.

    Source: Hu et al. 2014, eq. 7 to 12.
    """
    n, n_features = centred.shape
    # The smaller of the two products has the same variances; its vectors lead to those of the other.
    wide = n < n_features
    variances, vectors = np.linalg.eigh(centred @ centred.T if wide else centred.T @ centred)
    variances, vectors = np.maximum(variances[::-1], 0.0), vectors[:, ::-1]
    total = float(variances.sum())
    if total <= 0.0:
        return np.eye(n_features, 1)
    explained = np.cumsum(variances) / total
    count = wanted or int(np.searchsorted(explained, fraction - TINY)) + 1
    kept = vectors[:, : min(count, int((variances > TINY * variances[0]).sum()))]
    return np.asarray(centred.T @ kept / np.sqrt(variances[: kept.shape[1]]) if wide else kept)
