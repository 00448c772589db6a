# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is seen of a recording and of this machine on a terminal, and how an exploration ends for a script."""

import json
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from texture_bringup.command import main
from texture_bringup.commands.explore import as_json, exit_code
from texture_bringup.commands.watch import picture
from texture_bringup.feed import Feed
from texture_bringup.operator import ExplorationResult
from texture_core.errors import ExplorationError
from texture_core.types import (
    ExplorationState,
    ModelInfo,
    Phase,
    Rejection,
    RoughnessEstimate,
    TactileSignal,
    TextureEstimate,
)
from texture_recordings.bags import BagWriter

pytestmark = pytest.mark.ros
NOVEL = TextureEstimate(3, 'a', 'cork', Rejection.NOVEL, confidence=0.61, evidence_s=0.6)


def signal(first):
    samples = np.full((10, 1), 2.0, np.float32)
    return TactileSignal(first, 'tsf85/dynamic', ('dynamic',), ('count',), 1000.0, first, samples)


@pytest.fixture
def bag(tmp_path):
    """Return a recording of a slide over cork that is rejected."""
    with BagWriter(tmp_path / 'bag') as writer:
        writer.write('model_info', ModelInfo(0, 'm', 1, ('cork', 'felt')), 1)
        writer.write('signal', signal(0), 2)
        writer.write('exploration', ExplorationState(1, 'a', 'linear_slide', Phase.SLIDE, 0.1, 0.05, 1.0), 3)
        writer.write('texture', NOVEL, 4)
        writer.write('exploration', ExplorationState(2, 'a', 'linear_slide', Phase.DONE, surface='cork'), 5)
    return tmp_path / 'bag'


def test_a_recording_is_shown_as_a_line_for_each_change_without_a_terminal(bag, capsys):
    assert main(['watch', str(bag)]) == 0
    lines = capsys.readouterr().out.splitlines()
    slide = next(one for one in lines if 'cork' in one and one.startswith('slide'))
    assert '0.050 m/s  1.00 N' in slide
    assert 'unknown (nearest: cork, confidence 0.61 after 0.6 s): it resembles no trained texture' in slide
    assert lines[-1].startswith('done')


def test_what_the_estimate_says_is_not_repeated_for_the_classifier():
    feed = Feed()
    for name, message in (('classifier', 'no model is loaded; give one'), ('sensor', 'no sample for 2 s')):
        feed.node_statuses.update(name, 'WARN', message, 0.0)
    console = Console(file=StringIO(), width=200)
    console.print(picture(feed.frame(0.0), 1.0))
    said = console.file.getvalue()
    assert said.count('no model is loaded') == 1
    assert 'sensor: no sample for 2 s' in said


def test_a_bag_is_described_by_its_messages_and_slides(bag, capsys):
    assert main(['info', str(bag)]) == 0
    said = capsys.readouterr().out
    assert '1 message of tsf85/dynamic, 1 × 1000 Hz' in said
    assert '1 done' in next(one for one in said.splitlines() if one.strip().startswith('cork'))


@pytest.mark.parametrize(
    ('what', 'named'),
    [
        ('sensors', 'tsf85'),
        ('motions', 'distance_m 0.1'),
        ('arms', 'rails'),
        ('recipes', 'default'),
        ('surfaces', 'glass'),
    ],
)
def test_a_catalogue_is_listed(what, named, capsys):
    assert main(['list', what]) == 0
    assert named in capsys.readouterr().out


def test_the_machine_is_shown_on_one_screen(capsys):
    assert main(['doctor']) == 0
    names = [one.split('  ')[0] for one in capsys.readouterr().out.splitlines()]
    assert names == ['system', 'Python', 'ROS', 'DDS', 'serial ports', 'groups', 'versions']


@pytest.mark.parametrize(
    ('error', 'rejection', 'name', 'code', 'outcome'),
    [
        (ExplorationError.NONE, Rejection.NONE, 'a', 0, 'accepted'),
        (ExplorationError.NONE, Rejection.NOVEL, 'a', 3, 'rejected'),
        (ExplorationError.NONE, Rejection.NO_MODEL, 'a', 5, 'no model'),
        (ExplorationError.FORCE_LIMIT, Rejection.NONE, 'a', 4, 'aborted'),
        (ExplorationError.BUSY, Rejection.NO_MODEL, '', 2, 'refused'),
    ],
)
def test_the_end_of_an_exploration_is_a_code_and_json(error, rejection, name, code, outcome):
    texture = TextureEstimate(0, 'a', 'cork', rejection)
    result = ExplorationResult(error, 'so it ended', name, texture, RoughnessEstimate(0, 'a'))
    assert exit_code(result) == code
    shown = json.loads(json.dumps(as_json(result), allow_nan=False))
    assert (shown['outcome'], shown['texture']['label']) == (outcome, 'cork')
