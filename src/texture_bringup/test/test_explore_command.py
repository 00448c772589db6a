# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What `texture explore` prints when an exploration does not come to its end."""

import math
import subprocess
import sys
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

from texture_bringup.command import main
from texture_bringup.commands.explore import explore, explored, requests_of
from texture_bringup.feed import texture_text
from texture_bringup.operator import ExplorationResult, Operator
from texture_core.cli import Parser, run_program
from texture_core.errors import ExplorationError, MotionAborted
from texture_core.types import (
    ExplorationRequest,
    ExplorationState,
    FeatureVector,
    Phase,
    Rejection,
    RoughnessEstimate,
    SlideMotion,
    TextureEstimate,
)
from texture_estimation.next_motion import NextTouchModel
from texture_exploration.safety import RANGES
from texture_features.correction import write_reference

pytestmark = pytest.mark.ros

OUTSIDE = 'outside the training: speed 0.02 m/s, trained 0.05 m/s'
LEFT_OUT = '2 of 7 windows were left out; too little training: 5 slides could be held out'
ENDED = 'the exploration has ended: cancelled by the client'


@pytest.mark.parametrize(
    ('error', 'lines'),
    [
        (KeyboardInterrupt(ENDED), [ENDED, 'texture: interrupted']),
        (MotionAborted('no answer'), ['texture: no answer']),
    ],
)
def test_what_ended_an_exploration_stands_on_lines_of_its_own_below_the_progress(monkeypatch, capsys, error, lines):
    def explore(_request, on_progress):
        on_progress(ExplorationState(0, 'one', 'linear_slide', Phase.SLIDE), TextureEstimate(0, 'one'))
        raise error

    monkeypatch.setattr('sys.stderr.isatty', lambda: True)
    run_program(lambda: explored(explore, ExplorationRequest('linear_slide')))
    progress, *below = capsys.readouterr().err.splitlines()
    assert progress.strip() == ''  # the terminal returns to the beginning of the line before it draws
    assert below[0].startswith('slide')
    assert below[1:] == lines


@pytest.mark.parametrize('json', [[], ['--json']], ids=['text', 'json'])
@pytest.mark.parametrize(('last', 'code'), [('aborted', 4), ('refused', 2), ('vanished', 4)])
def test_slides_in_several_directions_end_with_the_first_that_fails(monkeypatch, capsys, last, code, json):
    """Whatever aborted a slide, somebody has to look at it: an operator who is away must not find the finger worn."""
    nothing = TextureEstimate(0, ''), RoughnessEstimate(0, '')
    made = ExplorationResult(ExplorationError.NONE, 'the motion was completed', 'one', *nothing)
    ends = {
        'vanished': MotionAborted('the explorer has vanished'),
        'refused': ExplorationResult(ExplorationError.FORCE_LIMIT, 'too hard', '', *nothing),
        'aborted': ExplorationResult(ExplorationError.FORCE_LIMIT, 'too hard', 'three', *nothing),
    }
    operator = MagicMock()
    operator.__enter__.return_value.explore.side_effect = [made, made, ends[last]]
    monkeypatch.setattr('texture_bringup.commands.explore.Operator', lambda _namespace: operator)
    assert main(['explore', 'linear_slide', *json, '--direction', '0', '180', '45.5', '180']) == code
    asked = [call.args[0] for call in operator.__enter__.return_value.explore.call_args_list]
    assert [round(math.degrees(one.direction_rad)) for one in asked] == [0, 180, 46]
    assert '2 of 4 slides were made\n' in capsys.readouterr().err


def test_surface_timeout_and_early_stopping_apply_to_each_motion_of_a_preset(monkeypatch):
    nothing = TextureEstimate(0, ''), RoughnessEstimate(0, '')
    made = ExplorationResult(ExplorationError.NONE, 'the motion was completed', 'one', *nothing)
    operator = MagicMock()
    operator.__enter__.return_value.explore.return_value = made
    monkeypatch.setattr('texture_bringup.commands.explore.Operator', lambda _namespace: operator)
    more = ['--surface', 'oak', '--early-stopping', '--timeout', '9']
    main(['explore', '--preset', 'ets-linear', '--repeats', '2', *more])
    main(['explore', 'linear_slide', '--repeats', '2', '--direction', '0', '90'])
    asked = [call.args[0] for call in operator.__enter__.return_value.explore.call_args_list]
    preset, slides = asked[:-4], asked[-4:]
    assert preset == 2 * preset[: len(preset) // 2]
    assert {(one.surface, one.early_stopping, one.timeout_s) for one in preset} == {('oak', True, 9.0)}
    assert [round(math.degrees(one.direction_rad)) for one in slides] == [0, 90, 0, 90]


def test_each_number_of_a_motion_has_an_option_that_is_its_name_without_the_unit():
    parser = Parser()
    explore.configure(parser)
    given = {'speed': 0.1, 'force': 2.0, 'distance': 0.3, 'radius': 0.04, 'turns': 5.0, 'duration': 6.0}
    words = [word for name, value in given.items() for word in (f'--{name}', str(value))]
    [request] = requests_of(parser.parse_args(['circular', *words]))
    assert {name: getattr(request, name) for name in RANGES} == dict(zip(RANGES, given.values(), strict=True))


def test_identify_makes_the_slide_that_distinguishes_textures_until_one_is_decided(monkeypatch, capsys):
    apart, alike = (SlideMotion('linear_slide', angle, 0.1, 2.0, 0.5) for angle in (0.0, math.pi / 4))
    slides = [
        (motion, texture, [10.0 * (motion is apart and texture == 'ridges_x') + wobble])
        for motion in (apart, alike)
        for texture in ('ridges_x', 'ridges_y')
        for wobble in (-0.1, 0.1)
    ]
    motions, textures, values = zip(*slides, strict=True)
    known = NextTouchModel.fit(np.array(values), textures, motions)
    ended = ExplorationResult(ExplorationError.NONE, '', 'one', TextureEstimate(0, ''), RoughnessEstimate(0, ''))
    seen = FeatureVector(0, 'one', 0.5, 0.1, ('a',), np.array([10.0]), feature_set='kind')
    operator = MagicMock()
    slide = operator.__enter__.return_value.explore_with_features
    slide.return_value = ended, [seen]
    model = SimpleNamespace(name='m', next_touch_model=known, feature_set='kind')
    monkeypatch.setattr('texture_estimation.model.load_model', lambda _path: model)
    monkeypatch.setattr('texture_bringup.commands.explore.Operator', lambda _namespace: operator)
    assert main(['identify', 'm', '--sure', '0.9']) == 0
    said = capsys.readouterr().out
    assert said.startswith('slide 1: linear_slide, direction 0°, 0.1 m/s, 2 N, 0.5 s; ')
    assert 'texture: ridges_x, probability ' in said
    assert {call.args[0].direction_rad for call in slide.call_args_list} == {0.0}
    assert main(['identify', 'm', '--sure', '1', '--most', '1']) == 0
    assert 'texture: undecided, --sure 1 is not reached (nearest: ridges_x, probability ' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('rejection', 'message', 'reason'),
    [
        (Rejection.NONE, '', None),
        (Rejection.OUTSIDE_TRAINING, OUTSIDE, OUTSIDE),  # begins with the reason itself
        (Rejection.NOVEL, '', 'it resembles no trained texture'),
        (Rejection.AMBIGUOUS, '', 'ambiguous'),
        (Rejection.TOO_LITTLE_TRAINING, '', 'too little training'),
        (Rejection.TOO_LITTLE_TRAINING, LEFT_OUT, LEFT_OUT),
    ],
)
def test_an_estimate_that_is_not_known_leads_with_that_and_says_why(rejection, message, reason):
    nearest = 'glass, confidence 0.78 after 2.9 s'
    estimate = TextureEstimate(0, 'one', 'glass', rejection, 0.78, evidence_s=2.9, message=message)
    assert texture_text(estimate) == (f'unknown (nearest: {nearest}): {reason}' if reason else nearest)


def test_explore_begins_without_the_libraries_of_training_and_of_bags():
    code = (
        'import sys, texture_bringup.commands.explore; print(*sorted({"rosbags", "scipy", "sklearn"} & {*sys.modules}))'
    )
    assert not subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True).stdout.strip()


def test_who_interrupts_before_the_request_reads_that_nothing_was_requested(monkeypatch, capsys):
    with Operator() as operator:
        monkeypatch.setattr(operator, '_step', MagicMock(side_effect=KeyboardInterrupt))
        assert run_program(lambda: operator.wait_for_explorer(1.0)) == 130
    assert capsys.readouterr().err == 'texture: interrupted; nothing was requested\n'


def test_the_help_lists_the_motions(capsys):
    with pytest.raises(SystemExit):
        main(['explore', '--help'])
    assert 'linear_slide, ' in ' '.join(capsys.readouterr().out.split())


USUAL = {'speed_m_s': 0.05, 'force_n': 0.0, 'distance_m': 0.15, 'direction_rad': 0.0}
SLOWER = {'speed_m_s': 0.02, 'distance_m': 0.1}
STORED = {'speed_m_s': 0.03, 'force_n': 5.0, 'distance_m': 0.08, 'direction_rad': math.pi / 2}


@pytest.mark.parametrize(
    ('stored', 'options', 'made'),
    [
        (STORED, (), STORED),
        ({}, (), USUAL),  # a reference without the numbers of its slide
        ({'force_n': 5.0}, (), {**USUAL, 'force_n': 5.0}),
        (STORED, ('--force', '5', '--direction', '90'), STORED),
        ({'force_n': 5.0}, ('--speed', '0.02', '--distance', '0.1'), {**USUAL, **SLOWER, 'force_n': 5.0}),
        (STORED, ('--store',), USUAL),  # another slide becomes the reference
    ],
)
def test_a_check_repeats_the_slide_of_the_reference(monkeypatch, tmp_path, stored, options, made):
    asked = []

    def slide(_bag, request, _namespace, _count):
        asked.append(request)
        raise MotionAborted('enough seen')

    monkeypatch.setattr('texture_estimation.model.load_model', lambda _path: MagicMock())
    monkeypatch.setattr('texture_bringup.commands.explore.slide_over_plate', slide)
    write_reference(tmp_path / 'model', {}, stored)
    assert main(['check', str(tmp_path / 'model'), *options]) != 0
    [request] = asked
    assert {name: getattr(request, name) for name in made} == pytest.approx(made)
    assert (request.motion, request.surface) == ('linear_slide', 'reference plate')


def test_a_check_by_another_slide_than_that_of_the_reference_is_refused(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr('texture_estimation.model.load_model', lambda _path: MagicMock())
    write_reference(tmp_path / 'model', {}, STORED)
    assert main(['check', str(tmp_path / 'model'), '--force', '4']) == 2
    assert '--force is 4 N, and the reference was made with 5 N; leave it out' in capsys.readouterr().err
    assert main(['check', str(tmp_path / 'model'), '--direction', '0']) == 2
    assert '--direction is 0 degrees, and the reference was made with 90 degrees' in capsys.readouterr().err
