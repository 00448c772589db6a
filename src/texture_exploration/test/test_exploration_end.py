# SPDX-License-Identifier: Apache-2.0
import re

import numpy as np
import pytest

from texture_core.errors import ExplorationError
from texture_exploration.explorer import STILL_MOVING, ExplorationOutcome, new_id


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
