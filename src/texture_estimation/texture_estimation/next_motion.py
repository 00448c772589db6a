# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Choice of the next touch: the motion with the largest expected information gain about the texture."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from texture_core.errors import InvalidData, ModelMismatch
from texture_core.types import AnyArray, Array, FeatureVector, SlideMotion, group_similar
from texture_estimation.learners.learner import group_means, log_loss, log_softmax
from texture_features.feature_set import fingerprint_difference

SMALLEST = 1e-6  # variance of a feature within textures, in that of all slides: equal to the last bit is luck
CONSTANT = 1e-12  # largest deviation of a constant feature, relative to its largest value
SAME_NATS = 1e-9  # informations that differ by less are the same
LEAST = 2  # slides of one kind over one texture that show how much slides differ; kinds among which to choose
PARTS = 5  # that are held out in turn, to calibrate the confidence
MIN_TEMPER = 1e-3


class NextTouch(NamedTuple):
    """A motion and its expected information gain in nats."""

    motion: SlideMotion
    information: float


def log_likelihoods(places: Array, means: Array) -> Array:
    """Return those of slides under one motion by texture, (..., n_textures), less the mean over all textures."""
    off = places[..., None, :] - means
    return np.asarray(-0.5 * np.einsum('...i,...i->...', off, off))


def least_information(means: Array, log_prior: Array) -> float:
    """Return a lower bound of the information about the texture that one slide gives, in nats.

    From the distances between textures alone: nothing for equal ones, the entropy of the prior for distant ones.

    Source: Kolchinsky & Tracey 2017, "Estimating mixture entropy with pairwise distances", with the Bhattacharyya
    distance, which of all Chernoff distances bounds best where the covariance is shared.
    """
    off = means[:, None, :] - means
    distance = np.einsum('ijk,ijk->ij', off, off) / 8.0
    prior = np.exp(log_prior)
    possible = prior > 0.0
    near = np.exp(-distance[possible][:, possible]) @ prior[possible]
    return max(0.0, -float(prior[possible] @ np.log(near)))


@dataclass(frozen=True, eq=False)
class NextTouchModel:
    """Class-conditional Gaussians of each motion; updates the posterior and chooses the next touch.

    Source: Fishel & Loeb 2012, "Bayesian exploration for intelligent identification of textures", who choose the motion
    that confuses the candidates least; here by the expected information, which is in nats and has no free exponent.
    """

    textures: tuple[str, ...]
    projection: Array
    motions: tuple[SlideMotion, ...]
    means: Array

    def __post_init__(self) -> None:
        shape = len(self.motions), len(self.textures), *self.projection.shape[1:]
        if self.means.shape != shape:
            raise InvalidData(f'means of motions and textures have the shape {self.means.shape}; {shape} is needed')

    @classmethod
    def fit(cls, values: Array, textures: Sequence[str], motions: Sequence[SlideMotion]) -> NextTouchModel:
        """Learn from slides."""
        names, codes = np.unique(np.asarray(textures), return_inverse=True)
        made = list(dict.fromkeys(motions))
        cells = np.array([made.index(motion) for motion in motions]) * len(names) + codes
        counts = np.bincount(cells, minlength=len(made) * len(names))
        for motion, over in zip(made, counts.reshape(len(made), -1) > 0, strict=True):
            if not over.all():
                raise InvalidData(f'{motion} has no slide over {", ".join(names[~over])}; slide over every texture')
        if counts.max() < LEAST:
            raise InvalidData('one slide of a kind over each texture does not show how much slides differ; add some')
        (projection, means), sure = _fit(values, cells, len(names)), math.sqrt(_temper(values, cells, len(names)))
        return cls(tuple(names.tolist()), sure * projection, tuple(made), sure * means)

    @classmethod
    def of_slides(
        cls, values: Array, textures: Sequence[str], motions: Sequence[SlideMotion | None]
    ) -> NextTouchModel | None:
        """Learn from slides as an arm made them: none is exactly like another, and some motions lack textures."""
        known_motions = [number for number, motion in enumerate(motions) if motion]
        made = dict(zip(known_motions, group_similar([motion for motion in motions if motion]), strict=True))
        often = Counter((kind, textures[number]) for number, kind in made.items())
        every = set(textures)
        whole = {kind for kind in set(made.values()) if all(often[kind, texture] >= LEAST for texture in every)}
        if len(whole) < LEAST or len(every) < LEAST:
            return None
        used = [number for number, kind in made.items() if kind in whole]
        return cls.fit(values[used], [textures[number] for number in used], [made[number] for number in used])

    @property
    def uniform_log_prior(self) -> Array:
        """The log-prior before the first slide, (n_textures,): all textures alike."""
        return np.full(len(self.textures), -math.log(len(self.textures)))

    def update(self, log_prior: Array, motion: SlideMotion, values: Array) -> Array:
        """Return the log-posterior (n_textures,) after a slide with mean features (n_features,)."""
        means = self.means[self.motions.index(motion)]
        return log_softmax(log_prior + log_likelihoods(values @ self.projection, means))

    def information(self, log_posterior: Array, motion: SlideMotion) -> float:
        """Return the information in nats that a slide is expected to give, by its lower bound in closed form."""
        return least_information(self.means[self.motions.index(motion)], log_softmax(log_posterior))

    def best_motion(self, log_posterior: Array, motions: Sequence[SlideMotion]) -> NextTouch:
        """Return the motion with the largest expected information gain; of equal ones the shortest."""
        choices = [NextTouch(motion, self.information(log_posterior, motion)) for motion in motions]
        most = max(choice.information for choice in choices)
        return min((c for c in choices if c.information >= most - SAME_NATS), key=lambda c: c.motion.duration_s)


def slide_values(vectors: Sequence[FeatureVector], feature_set: str) -> Array:
    """Return the mean features of a slide, (n_features,), from those of its windows."""
    for vector in vectors:
        if vector.feature_set != feature_set:
            raise ModelMismatch(f'the model does not fit: {fingerprint_difference(vector.feature_set, feature_set)}')
    usable = [vector.values for vector in vectors if np.isfinite(vector.values).all()]
    if not usable:
        raise InvalidData(f'none of the {len(vectors)} windows of the slide could be used; slide longer')
    return np.mean(usable, axis=0)


def _fit(values: Array, cells: AnyArray, n_textures: int) -> tuple[Array, Array]:
    """Learn from the mean features of slides, (n_slides, n_features).

    Return the axes, (n_features, n_axes), and on them the mean of each texture, (n_motions, n_textures, n_axes).

    Slides share their covariance, whatever the texture and the motion. Means of few slides differ by chance: along
    each axis they are drawn to the middle of their motion as far as their spread is not more than chance, and what
    stays uncertain about them is added to what differs between slides.

    Source: Ioffe 2006, "Probabilistic linear discriminant analysis", with a covariance shrunk as Ledoit and Wolf do.
    """
    from scipy.linalg import eigh  # noqa: PLC0415  # takes 0.3 s, and only training needs it
    from sklearn.covariance import ledoit_wolf  # noqa: PLC0415  # takes seconds, and is not needed to classify

    counts = np.bincount(cells)
    means = group_means(values, cells)
    off, freedom = values - means[cells], len(values) - len(counts)
    overall, within = values.var(axis=0), np.square(off).sum(axis=0) / freedom
    constant = np.sqrt(overall) <= CONSTANT * np.abs(values).max(axis=0)
    scale = np.sqrt(np.where(constant, np.inf, np.maximum(within, SMALLEST * overall)))
    # The shrinkage takes the number of slides for that of free deviations; means have used up some of them.
    covariance = ledoit_wolf(off / scale, assume_centered=True)[0] * len(values) / freedom
    by_motion = means.reshape(-1, n_textures, values.shape[1])
    deviations = (by_motion - by_motion.mean(axis=1, keepdims=True)).reshape(means.shape) / scale
    between = deviations.T @ deviations / (len(by_motion) * max(n_textures - 1, 1))
    spread, axes = eigh(between, covariance + np.diag(1.0 * (np.diag(covariance) <= 0.0)))
    chance = float((1.0 / counts).mean())
    spread -= chance
    axes, spread = axes[:, spread > 0.0], spread[spread > 0.0]
    drawn = spread / (spread + chance)
    projection = axes / scale[:, None] / np.sqrt(1.0 + chance * drawn)
    projected = by_motion @ projection
    middle = projected.mean(axis=1, keepdims=True)
    return projection, middle + drawn * (projected - middle)


def _temper(values: Array, cells: AnyArray, n_textures: int) -> float:
    """Return the exponent of the likelihoods that makes slides held out most probable: they are not quite Gaussian."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415  # takes 0.3 s, and only training needs it

    # Slides of one texture and motion are held out in turn, the first one in another part for the next texture: so that
    # where there are two of each not all are missed at once. One that is alone is never held out.
    _, numbers, counts = np.unique(cells, return_inverse=True, return_counts=True)
    ranks = np.array([np.count_nonzero(cells[:row] == cell) for row, cell in enumerate(cells)])
    parts = np.where(counts[numbers] >= LEAST, (ranks + numbers) % PARTS, -1)
    found = []
    for part in range(PARTS):
        held_out = parts == part
        if held_out.any() and np.count_nonzero(~held_out) > len(counts):
            projection, means = _fit(values[~held_out], cells[~held_out], n_textures)
            likelihoods = log_likelihoods(values[held_out] @ projection, means[cells[held_out] // n_textures])
            found.append((likelihoods, cells[held_out] % n_textures))
    if not found:
        return 1.0
    untempered, truth = (np.concatenate(each) for each in zip(*found, strict=True))

    def loss(logarithm: float) -> float:
        return log_loss(log_softmax(math.exp(logarithm) * untempered), truth)

    return math.exp(minimize_scalar(loss, bounds=(math.log(MIN_TEMPER), 0.0), method='bounded').x)
