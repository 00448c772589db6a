# SPDX-License-Identifier: Apache-2.0
"""Adapt a model to a day or a finger by one or more labelled slides of it, by means of its training slides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import InvalidData
from texture_core.types import Array
from texture_estimation.decisions import ErrorBound
from texture_estimation.learners.discriminant import Discriminant
from texture_estimation.model import TextureModel
from texture_estimation.numerics import shrunk_covariance
from texture_features.examples import LabelledFeatures, SlideConditions

DIRECTIONS = 40  # of largest variance over slides, in which covariances can be told from some hundred slides
SHRINKAGE = 0.1  # of the covariances, towards their diagonal and towards a round one
DAY_SUFFIX = '-today'


def adapted(model: TextureModel, training: LabelledFeatures, today: LabelledFeatures) -> TextureModel:
    """Return the model as a discriminant whose classes are where slides of today and of the training place them.

    A class of a session is Gaussian about its mean over sessions, and slides are Gaussian about the class of their
    session (two covariances); the slides of today say where the classes are today, and each counts as much as it is
    certain. A surface without a slide of today moves by the mean of those that have some. The answer is a label alone:
    nothing shows which slides of today would be unknown, so no slide is known.

    Parameters
    ----------
    model
        Trained with a recipe whose features `training` and `today` hold.
    training
        The slides of the training, with their sessions: several of at least one surface.
    today
        Labelled slides of today.

    Raises
    ------
    InvalidData
        If the training has one session of each surface, or a slide of today is of no trained surface.

    Source: Ioffe 2006, "Probabilistic linear discriminant analysis"; Prince & Elder 2007.
    """
    means, labels, sessions = _slide_means(training)
    shots, shot_labels, _ = _slide_means(today)
    names = list(model.trained_labels)
    if strange := sorted(set(shot_labels) - set(names)):
        raise InvalidData(f"'{strange[0]}' is not a trained surface; label the slides of today with {', '.join(names)}")
    centre, scale = means.mean(axis=0), means.std(axis=0)
    scale[scale <= 1e-9 * (1.0 + np.abs(centre))] = np.inf  # a constant feature tells nothing
    standard = (means - centre) / scale
    axes = np.linalg.svd(standard, full_matrices=False)[2][:DIRECTIONS].T
    points, seen = standard @ axes, ((shots - centre) / scale) @ axes
    within, between, classes = _covariances(points, labels, sessions, names)
    moved, uncertain = np.full_like(classes, np.nan), np.zeros_like(within)
    for number, name in enumerate(names):
        own = seen[shot_labels == name]
        if len(own):
            gain = between @ np.linalg.inv(between + within / len(own))
            moved[number] = classes[number] + gain @ (own.mean(axis=0) - classes[number])
            uncertain += (between - gain @ between) * len(own) / len(seen)
    shift = np.nanmean(moved - classes, axis=0)
    moved = np.where(np.isnan(moved), classes + shift, moved)
    weights = np.linalg.solve(within + uncertain, moved.T)
    offsets = -0.5 * np.einsum('cf,fc->c', moved, weights)
    weights = (axes @ weights) / scale[:, None]
    return replace(
        model,
        name=f'{model.name}{DAY_SUFFIX}',
        recipe=replace(
            model.recipe,
            learner_name='discriminant',
            learner=Discriminant(),
            training=replace(model.recipe.training, known=False),
        ),
        parameters={'weights': weights, 'offsets': offsets - centre @ weights},
        decisions=replace(
            model.decisions,
            error_bound=ErrorBound(0, model.decisions.error_bound.max_error_rate),
            novelty_detector=None,
        ),
        next_touch_model=None,
        examples=None,
        added_slides=(),
        slide_gaussians=None,
        labels=model.trained_labels,
    )


def _slide_means(features: LabelledFeatures) -> tuple[Array, NDArray[np.str_], NDArray[np.str_]]:
    """Return the mean features of slides, (n_slides, n_features), their labels and sessions."""
    slides, rows, numbers = np.unique(features.groups, return_index=True, return_inverse=True)
    means = np.stack([features.values[numbers == number].mean(axis=0) for number in range(len(slides))])
    sessions = [features.conditions.get(name, SlideConditions()).session for name in slides.tolist()]
    return means, features.labels[rows], np.array(sessions)


def _covariances(
    points: Array, labels: NDArray[np.str_], sessions: NDArray[np.str_], names: list[str]
) -> tuple[Array, Array, Array]:
    """Return the covariances within a session and between sessions of a label, and the mean of each label."""
    classes, inside, across, groups = [], [], [], 0
    for name in names:
        own = labels == name
        centres = []
        for session in np.unique(sessions[own]):
            group = points[own & (sessions == session)]
            centres.append(group.mean(axis=0))
            inside.append(group - centres[-1])
            groups += 1
        classes.append(np.mean(centres, axis=0))
        if len(centres) > 1:
            across.append(np.sqrt(len(centres) / (len(centres) - 1)) * (np.array(centres) - classes[-1]))
    if not across:
        raise InvalidData(
            'the training has one session of each surface, which does not show how days differ; train on several '
            'days, or train again with the slides of today'
        )
    deviations, shifts = np.concatenate(inside), np.concatenate(across)
    within = deviations.T @ deviations / max(1, len(deviations) - groups)
    between = shifts.T @ shifts / len(shifts)
    size = len(within)
    within = shrunk_covariance(within, SHRINKAGE)
    between = (1.0 - SHRINKAGE) * between + SHRINKAGE * np.trace(between) / size * np.eye(size)
    return within + 1e-9 * np.trace(within) / size * np.eye(size), between, np.array(classes)
