# SPDX-License-Identifier: Apache-2.0
"""What `texture explore` prints when an exploration does not come to its end."""

import pytest

from texture_bringup.command import main
from texture_bringup.commands.explore import explored, texture_text
from texture_core.cli import run_program
from texture_core.errors import MotionAborted
from texture_core.types import ExplorationRequest, ExplorationState, Phase, Rejection, TextureEstimate

pytestmark = pytest.mark.ros

OUTSIDE = 'outside what was trained: speed 0.02 m/s, trained 0.05 m/s'
ENDED = 'the exploration has ended: cancelled by the client'


class EndingOperator:
    """An operator whose exploration ends in mid-slide."""

    def __init__(self, error):
        self._error = error

    def explore(self, _request, on_progress):
        on_progress(ExplorationState(0, 'one', 'linear_slide', Phase.SLIDE), TextureEstimate(0, 'one'))
        raise self._error


@pytest.mark.parametrize(
    ('error', 'lines'),
    [
        (KeyboardInterrupt(ENDED), [ENDED, 'texture: interrupted']),
        (MotionAborted('no answer'), ['texture: no answer']),
    ],
)
def test_what_ended_an_exploration_stands_on_lines_of_its_own_below_the_progress(monkeypatch, capsys, error, lines):
    monkeypatch.setattr('sys.stderr.isatty', lambda: True)
    run_program(lambda: explored(EndingOperator(error), ExplorationRequest('linear_slide')))
    progress, *below = capsys.readouterr().err.splitlines()
    assert progress.strip() == ''  # the terminal returns to the beginning of the line before it draws
    assert below[0].startswith('slide')
    assert below[1:] == lines


@pytest.mark.parametrize(
    ('known', 'message', 'text'),
    [
        (True, '', 'glass, confidence 0.78 after 2.9 s'),
        (False, OUTSIDE, f'unknown (nearest: glass, confidence 0.78 after 2.9 s): {OUTSIDE}'),
        (False, '', 'unknown (nearest: glass, confidence 0.78 after 2.9 s): it resembles none of the known textures'),
    ],
)
def test_an_estimate_that_is_not_known_leads_with_that_and_says_why(known, message, text):
    rejection = Rejection.NONE if known else Rejection.NOVEL
    estimate = TextureEstimate(0, 'one', 'glass', rejection, 0.78, evidence_s=2.9, message=message)
    assert texture_text(estimate) == text


def test_the_help_lists_the_motions(capsys):
    with pytest.raises(SystemExit):
        main(['explore', '--help'])
    assert 'linear_slide, ' in ' '.join(capsys.readouterr().out.split())


def test_a_check_without_its_model_is_refused_before_an_explorer_is_waited_for(monkeypatch, capsys):
    monkeypatch.setattr('texture_bringup.commands.explore.slide_over_plate', lambda *_: pytest.fail('the robot moved'))
    assert main(['check', 'absent']) != 0
    assert 'absent' in capsys.readouterr().err
