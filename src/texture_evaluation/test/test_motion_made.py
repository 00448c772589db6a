# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from texture_core.types import ExplorationState, Phase, SlideMotion
from texture_estimation.recipe import load_recipe
from texture_recordings.dataset import SlideDataset, motion_made
from texture_simulation.offline import SlidePlan, write_simulated

SECOND = 1_000_000_000
TOUCH = ExplorationState(0, 'id', 'linear_slide', Phase.CONTACT)
SLIDE = ExplorationState(SECOND, 'id', 'linear_slide', Phase.SLIDE, 0.5, 0.1, 2.0, 0.7)
LATER = replace(SLIDE, stamp_ns=2 * SECOND)
LIFT = ExplorationState(3 * SECOND, 'id', 'linear_slide', Phase.LIFT)


def test_a_slide_lasts_from_its_first_state_to_the_lift_or_as_long_as_was_guaranteed() -> None:
    assert motion_made([TOUCH, SLIDE, LATER, LIFT]) == SlideMotion('linear_slide', 0.7, 0.1, 2.0, 2.0)
    assert motion_made([TOUCH, SLIDE, LATER]) == SlideMotion('linear_slide', 0.7, 0.1, 2.0, 1.5)


@pytest.mark.parametrize(
    'states',
    [
        [TOUCH, LIFT],
        [replace(SLIDE, motion='circular'), LIFT],
        [replace(SLIDE, speed_m_s=math.nan), LIFT],
        [replace(SLIDE, force_n=0.0), LIFT],
        [replace(SLIDE, direction_rad=math.nan), LIFT],
        [SLIDE, replace(LATER, direction_rad=1.5), LIFT],
        [replace(SLIDE, steady_s=0.0)],
    ],
)
def test_a_slide_of_which_too_little_is_known_or_that_turns_is_no_motion(states: list[ExplorationState]) -> None:
    assert motion_made(states) is None


def test_slides_in_bags_report_how_they_were_made(tmp_path) -> None:
    plan = SlidePlan(slides=2, slide_s=0.6, speed_m_s=0.05, force_n=1.5, direction_rad=0.5)
    bags = write_simulated(tmp_path, plan, np.random.default_rng(0), surfaces=['glass'])
    examples = SlideDataset.from_bags(bags).features(load_recipe('fast').feature_set)
    made = SlideMotion('linear_slide', 0.5, 0.05, 1.5, pytest.approx(0.6))
    assert examples.motions == {'glass/1': made, 'glass/2': made}
