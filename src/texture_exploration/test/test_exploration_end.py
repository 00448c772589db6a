# SPDX-License-Identifier: Apache-2.0
import pytest

from texture_core.errors import ExplorationError
from texture_exploration.explorer import STILL_MOVING, ExplorationEnd, ExplorationOutcome


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
    end = ExplorationEnd('17', outcome)
    assert (end.severity, end.sentence) == (severity, sentence)
