# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import re
import threading

import numpy as np
import pytest

from texture_core.errors import ExplorationError
from texture_core.types import Rejection, RoughnessEstimate, TextureEstimate
from texture_exploration.exploration import (
    STILL_MOVING,
    ExplorationEstimates,
    ExplorationOutcome,
    may_stop,
    new_id,
)


@pytest.mark.parametrize(
    ('outcome', 'severity', 'sentence'),
    [
        (ExplorationOutcome(ExplorationError.NONE, 'done', True), 'info', '17: done'),
        (
            ExplorationOutcome(ExplorationError.STOPPED, 'stopped', True),
            'warning',
            '17: stopped; the finger was lifted',
        ),
        (ExplorationOutcome(ExplorationError.STOPPED, 'no lift', True, lifted=False), 'error', '17: no lift'),
        (STILL_MOVING, 'error', '17: the explorer ended before the finger was lifted; look at the robot'),
    ],
)
def test_an_abort_is_a_warning_and_a_finger_that_was_not_lifted_an_error(outcome, severity, sentence):
    assert (outcome.severity, outcome.sentence('17')) == (severity, sentence)


def test_an_id_tells_time_and_number_and_differs_between_two_nodes_that_begin_at_once():
    names = [new_id(1_500_000_000, 2, np.random.default_rng(seed)) for seed in (1, 2)]
    assert all(re.fullmatch(r'19700101T000001-002-[0-9a-f]{4}', name) for name in names)
    assert names[0] != names[1]


def texture(**values):
    return TextureEstimate(
        **{'stamp_ns': 1, 'exploration_id': 'one', 'label': 'cork', 'rejection': Rejection.NONE, **values}
    )


def test_a_known_texture_that_is_decided_ends_the_slide():
    assert may_stop(texture(confidence=0.95, decided=True))
    assert not may_stop(texture(confidence=0.95))
    assert not may_stop(texture(confidence=0.95, decided=True, rejection=Rejection.NOVEL))
    assert not may_stop(texture(decided=True))  # confidence unknown


def test_the_final_estimate_ends_the_waiting():
    estimates = ExplorationEstimates('one')
    later = threading.Timer(0.05, estimates.update, [texture(final=True)])
    later.start()
    assert estimates.wait_until_final(['texture'], timeout_s=10.0)
    assert estimates.texture.label == 'cork'


def test_without_a_final_estimate_the_newest_stays():
    estimates = ExplorationEstimates('one')
    estimates.update(texture(windows=2))
    estimates.update(RoughnessEstimate(1, 'one', final=True))
    assert estimates.wait_until_final(['roughness'], timeout_s=0.0)
    assert not estimates.wait_until_final(['texture', 'roughness'], timeout_s=0.01)
    assert estimates.texture.windows == 2


def test_nobody_waits_any_longer_once_it_is_given_up():
    estimates = ExplorationEstimates('one')
    estimates.cancel()
    assert not estimates.wait_until_final(['texture'], timeout_s=60.0)
