# SPDX-License-Identifier: Apache-2.0
"""`texture identify`: repeat the slide with the largest information gain until the texture is certain."""

from __future__ import annotations

import argparse

import numpy as np

from texture_bringup.commands.explore import progress_line, show_progress, tell
from texture_bringup.operator import Operator
from texture_core.errors import InvalidParameter
from texture_core.types import Array, ExplorationRequest, SlideMotion
from texture_estimation.model import TextureModel, load_model
from texture_estimation.next_motion import NextTouchModel, slide_values

SHOWN = 3  # textures, of those that are possible


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('model', help='trained on slides of several kinds over every texture')
    parser.add_argument('--sure', type=float, default=0.95, metavar='P', help='end at this probability; default: 0.95')
    parser.add_argument('--slides', type=int, default=6, metavar='N', help='at most so many; default: 6')
    parser.add_argument('--surface', default='', help='true name of the surface, if known; it labels a recording')
    parser.add_argument('--namespace', default='', help='namespace of the nodes')


def run(options: argparse.Namespace) -> int:
    """Slide until it is sure; return 1 as soon as a slide was ended early by a fault or a stop.

    Raises
    ------
    InvalidParameter
        If a number is out of its range.
    """
    if options.slides < 1 or not 0.0 < options.sure <= 1.0:
        raise InvalidParameter(
            f'--slides is {options.slides} and --sure {options.sure:g}; 1 or more and a probability are needed'
        )
    model = load_model(options.model)
    known = next_touch_model_of(model)
    belief, number = known.uniform_log_prior, 0
    with Operator(options.namespace) as operator:
        operator.wait_for_explorer(deadline_s=10.0)
        while number < options.slides and np.exp(belief.max()) < options.sure:
            number += 1
            motion, information = known.best_motion(belief, list(known.gaussians))
            print(f'slide {number}: {motion_text(motion)}; {information:.2f} nats expected')
            with progress_line():
                explored, vectors = operator.explore_with_features(request_of(motion, options.surface), show_progress)
            if not explored.success:
                return int(not tell(explored))
            belief = known.update(belief, motion, slide_values(vectors, model.feature_set))
            print(f'  {belief_text(known, belief)}')
    best = int(belief.argmax())
    print(f'texture: {known.textures[best]}, probability {np.exp(belief[best]):.2f} after {number} slides')
    return 0


def next_touch_model_of(model: TextureModel) -> NextTouchModel:
    """Return what the textures look like under each motion.

    Raises
    ------
    InvalidParameter
        If the model knows no motions.
    """
    if model.next_touch_model is None:
        raise InvalidParameter(
            f"model '{model.name}' knows no motions to choose from; train it on slides over every texture, two or more "
            'of each kind, in several directions or at several speeds or forces'
        )
    return model.next_touch_model


def request_of(motion: SlideMotion, surface: str) -> ExplorationRequest:
    """Return the request for a motion."""
    return ExplorationRequest(
        motion.motion,
        speed_m_s=motion.speed_m_s,
        force_n=motion.force_n,
        distance_m=motion.speed_m_s * motion.duration_s,
        direction_rad=motion.direction_rad,
        surface=surface,
    )


def motion_text(motion: SlideMotion) -> str:
    """Return a motion in words."""
    return (
        f'{motion.motion}, direction {motion.direction_rad:g} rad, {motion.speed_m_s:g} m/s, {motion.force_n:g} N, '
        f'{motion.duration_s:g} s'
    )


def belief_text(known: NextTouchModel, belief: Array) -> str:
    """Return the most probable textures in words.

    Parameters
    ----------
    belief : (n_textures,)
        Log-probabilities.
    """
    first = np.argsort(-belief, kind='stable')[:SHOWN]
    return ', '.join(f'{known.textures[k]} {np.exp(belief[k]):.2f}' for k in first)
