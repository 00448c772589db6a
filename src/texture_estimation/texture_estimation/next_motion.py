"""Which motion to explore with next: the one expected to tell most about the textures that are still possible."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular
from sklearn.covariance import ledoit_wolf

from texture_core.arrays import AnyArray, Array
from texture_core.errors import InvalidData, InvalidParameter
from texture_estimation.log_probabilities import log_softmax

SMALLEST = 1e-6  # variance of a feature within textures, in that of all slides: equal to the last bit is luck
SAME_NATS = 1e-9  # informations that differ by less are the same
SAMPLES = 200  # of each texture; the error of the estimate is some hundredths of a nat


@dataclass(frozen=True)
class Motion:
    """One way to slide. Motions are told apart by all of their values, and learnt one by one.

    Parameters
    ----------
    motion
        Name in the catalogue of motions.
    direction_rad
        From +x towards +y.
    speed_m_s, force_n
        As asked for.
    duration_s
        What it costs: of two motions that tell as much, the shorter is made.
    """

    motion: str
    direction_rad: float
    speed_m_s: float
    force_n: float
    duration_s: float


class Choice(NamedTuple):
    """A motion, and the information expected of it in nats."""

    motion: Motion
    information: float


@dataclass(frozen=True, eq=False)
class Felt:
    """What the textures feel like under one motion: Gaussians that share their covariance, here made the identity.

    Parameters
    ----------
    projection : (n_features, n_features)
        Makes the covariance within textures the identity.
    means : (n_textures, n_features)
        Projected.
    """

    projection: Array
    means: Array

    @classmethod
    def learnt(cls, values: Array, codes: AnyArray, n_textures: int) -> Felt:
        """Learn from the mean features of slides, (n, n_features), and the number of the texture of each, (n,)."""
        scale = _scale(values, codes, n_textures)
        scaled = values / scale
        own = _means(scaled, codes, n_textures)
        # The shrinkage takes the number of slides for that of free deviations; means have used up some of them.
        covariance = (
            ledoit_wolf(scaled - own[codes], assume_centered=True)[0] * len(values) / (len(values) - n_textures)
        )
        told = np.diag(covariance) > 0.0
        root = np.linalg.cholesky(covariance + np.diag(~told * 1.0))
        whiten = solve_triangular(root, np.eye(len(root)), lower=True).T
        return cls(whiten / scale[:, None], own @ whiten)

    def log_likelihoods(self, values: Array) -> Array:
        """Return those of slides (..., n_features) by texture, (..., n_textures), less what all textures share."""
        off = (values @ self.projection)[..., None, :] - self.means
        return np.asarray(-0.5 * np.einsum('...i,...i->...', off, off))

    def least_information(self, log_prior: Array) -> float:
        """Return a lower bound of the information about the texture that one slide gives, in nats.

        From the distances between textures alone: nothing for equal ones, the entropy of the prior for ones far apart.

        Source: Kolchinsky & Tracey 2017, "Estimating mixture entropy with pairwise distances", with the
        Bhattacharyya distance, which of all Chernoff distances bounds best where the covariance is shared.
        """
        off = self.means[:, None, :] - self.means
        distance = np.einsum('ijk,ijk->ij', off, off) / 8.0
        prior = np.exp(log_prior)
        possible = prior > 0.0
        near = np.exp(-distance[possible][:, possible]) @ prior[possible]
        return max(0.0, -float(prior[possible] @ np.log(near)))

    def sampled_information(self, log_prior: Array, draws: Array) -> float:
        """Return the same by simulated slides, without bias: `draws` are standard normal, (n_samples, n_features)."""
        prior = np.exp(log_prior)
        information = 0.0
        for texture in np.flatnonzero(prior > 0.0):
            off = self.means[texture] + draws[:, None, :] - self.means
            likelihoods = -0.5 * np.einsum('nti,nti->nt', off, off)
            after = log_softmax(log_prior + likelihoods)[:, texture]
            information += prior[texture] * float(np.mean(after - log_prior[texture]))
        return max(0.0, information)


@dataclass(frozen=True, eq=False)
class Explorations:
    """What textures feel like under each motion, learnt from slides; tells what a slide says, and what to do next.

    Source: Fishel & Loeb 2012, "Bayesian exploration for intelligent identification of textures", who choose the motion
    that confuses the candidates least; here by the expected information, which is in nats and has no free exponent.
    """

    textures: tuple[str, ...]
    felt: Mapping[Motion, Felt]

    @classmethod
    def learnt(cls, values: Array, textures: Sequence[str], motions: Sequence[Motion]) -> Explorations:
        """Learn from slides.

        Parameters
        ----------
        values : (n_slides, n_features)
            Mean features of each slide.
        textures, motions : (n_slides,)
            What was slid over, and how.

        Raises
        ------
        InvalidData
            If values are not finite, or a motion lacks a texture, or no two slides of it are over the same texture.
        """
        values = np.asarray(values, dtype=np.float64)
        if values.ndim != 2 or not len(values) == len(textures) == len(motions) or not len(values):
            raise InvalidData(
                f'features of shape {values.shape} with {len(textures)} textures and {len(motions)} motions cannot be '
                'learnt from; give one row, one texture and one motion for each slide'
            )
        if not np.isfinite(values).all():
            raise InvalidData('features of slides hold values that are not finite; leave these slides out')
        names, codes = np.unique(np.asarray(textures), return_inverse=True)
        felt = {}
        for motion in dict.fromkeys(motions):
            rows = np.array([other == motion for other in motions])
            _check(motion, names, codes[rows])
            felt[motion] = Felt.learnt(values[rows], codes[rows], len(names))
        return cls(tuple(names.tolist()), felt)

    @property
    def ignorance(self) -> Array:
        """The log-prior before the first slide, (n_textures,): all textures alike."""
        return np.full(len(self.textures), -math.log(len(self.textures)))

    def update(self, log_prior: Array, motion: Motion, values: Array) -> Array:
        """Return the log-posterior (n_textures,) after a slide with mean features (n_features,)."""
        felt = self._felt(motion)
        values = np.asarray(values, dtype=np.float64)
        if values.shape != felt.projection.shape[:1] or not np.isfinite(values).all():
            raise InvalidData(
                f'features of shape {values.shape} do not tell about a slide; give {len(felt.projection)} finite '
                'values, as the slides that were learnt from have'
            )
        return log_softmax(self._checked(log_prior) + felt.log_likelihoods(values))

    def information(
        self, log_posterior: Array, motion: Motion, rng: np.random.Generator | None = None, samples: int = SAMPLES
    ) -> float:
        """Return the information in nats that a slide is expected to give.

        Parameters
        ----------
        log_posterior : (n_textures,)
            What is known so far.
        motion
            How it would slide.
        rng
            Of simulated slides; without one, the lower bound in closed form.
        samples
            Simulated slides over each texture.
        """
        felt, log_posterior = self._felt(motion), self._checked(log_posterior)
        if rng is None:
            return felt.least_information(log_posterior)
        return felt.sampled_information(log_posterior, rng.standard_normal((samples, felt.means.shape[1])))

    def best(self, log_posterior: Array, motions: Sequence[Motion], rng: np.random.Generator | None = None) -> Choice:
        """Return the motion expected to tell most; the shorter one, then the earlier one, of those that tell as much.

        Parameters
        ----------
        log_posterior : (n_textures,)
            What is known so far.
        motions
            Those that may be made.
        rng
            For an estimate by simulated slides; without one, by the lower bound in closed form.
        """
        if not motions:
            raise InvalidParameter('there is no motion to choose from; name at least one that was learnt')
        told = [Choice(motion, self.information(log_posterior, motion, rng)) for motion in motions]
        most = max(choice.information for choice in told)
        return min((c for c in told if c.information >= most - SAME_NATS), key=lambda c: c.motion.duration_s)

    def _felt(self, motion: Motion) -> Felt:
        if motion not in self.felt:
            known = '; '.join(str(other) for other in self.felt)
            raise InvalidParameter(f'{motion} was not learnt; choose one of: {known}')
        return self.felt[motion]

    def _checked(self, log_prior: Array) -> Array:
        log_prior = np.asarray(log_prior, dtype=np.float64)
        if log_prior.shape != (len(self.textures),) or not np.isfinite(log_prior.max()):
            raise InvalidData(
                f'log-probabilities of shape {log_prior.shape} do not fit; give one for each of the '
                f'{len(self.textures)} textures, of which at least one is possible'
            )
        return log_softmax(log_prior)


def _check(motion: Motion, names: AnyArray, codes: AnyArray) -> None:
    """Refuse slides from which a motion cannot be learnt."""
    missing = sorted(set(names.tolist()) - set(names[codes].tolist()))
    if missing:
        raise InvalidData(
            f'{motion} has no slide over {", ".join(missing)}; slide over every texture with every motion'
        )
    if len(codes) <= len(names):
        raise InvalidData(
            f'{motion} has one slide over each texture, which does not tell how much slides differ; add at least one'
        )


def _means(values: Array, codes: AnyArray, n_textures: int) -> Array:
    """Return the mean of each texture, (n_textures, n_features)."""
    return np.stack([values[codes == code].mean(axis=0) for code in range(n_textures)])


def _scale(values: Array, codes: AnyArray, n_textures: int) -> Array:
    """Return the standard deviation of each feature within textures, (n_features,); infinite where it is constant."""
    within = ((values - _means(values, codes, n_textures)[codes]) ** 2).sum(axis=0) / (len(values) - n_textures)
    variance = values.var(axis=0)
    constant = np.sqrt(variance) <= 1e-12 * np.abs(values).max(axis=0)
    scale: Array = np.where(constant, np.inf, np.sqrt(within + SMALLEST * variance))
    return scale
