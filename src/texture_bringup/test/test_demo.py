# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The demonstration, shortened; what it prints is tested where it is made."""

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

from texture_bringup.demo import (
    ACCEPTED,
    ATTEMPTS,
    UNKNOWN,
    DemoPlan,
    ProgressLog,
    Slide,
    demonstrate,
    explore_with_retries,
)
from texture_bringup.operator import ExplorationResult
from texture_core.errors import ExplorationError, MotionAborted
from texture_core.ros_testing import killed_on_error
from texture_core.types import ExplorationRequest, Rejection, RoughnessEstimate, TextureEstimate

pytestmark = pytest.mark.realtime

DEADLINE_S = 60.0
SHORT = DemoPlan(recognised=('glass', 'ridge_2mm_deep'), untrained=('cardboard',))


def started(log: Path) -> list[int]:
    """Return the processes of the nodes."""
    return [int(number) for number in re.findall(r'started \(process (\d+)\)', log.read_text())]


@pytest.mark.parametrize(
    ('expected', 'label', 'rejection', 'as_expected'),
    [
        (ACCEPTED, 'glass', Rejection.NONE, True),
        (ACCEPTED, 'leather', Rejection.NONE, False),
        (ACCEPTED, 'glass', Rejection.NOVEL, False),
        (UNKNOWN, 'leather', Rejection.NOVEL, True),
        (UNKNOWN, 'leather', Rejection.AMBIGUOUS, True),
        (UNKNOWN, 'leather', Rejection.NONE, False),
        (UNKNOWN, 'leather', Rejection.OUTSIDE_TRAINING, False),
    ],
)
def test_an_answer_is_as_expected_if_label_and_rejection_are(
    expected: frozenset[Rejection], label: str, rejection: Rejection, as_expected: bool
) -> None:
    estimate = TextureEstimate(0, 'a', label, rejection)
    answer = ExplorationResult(ExplorationError.NONE, '', 'a', estimate, RoughnessEstimate(0, 'a'))
    assert Slide('glass', 'glass', expected, answer, []).as_expected is as_expected


@pytest.mark.parametrize('aborted', range(ATTEMPTS + 1))
def test_an_aborted_slide_is_made_again_and_that_is_said(aborted: int) -> None:
    nothing = TextureEstimate(0, '', ''), RoughnessEstimate(0, '')
    results = [
        ExplorationResult(ExplorationError.ARM_FAULT, 'the arm has not answered for 135 ms', 'late', *nothing)
    ] * aborted
    results.append(ExplorationResult(ExplorationError.NONE, 'the motion was completed', 'good', *nothing))
    said: list[str] = []
    made = iter(results)
    if aborted == ATTEMPTS:
        with pytest.raises(MotionAborted, match='the exploration of felt failed: the arm has not answered'):
            explore_with_retries(lambda _: next(made), ExplorationRequest('linear_slide', surface='felt'), said.append)
    else:
        explored = explore_with_retries(lambda _: next(made), ExplorationRequest('linear_slide'), said.append)
        assert explored.exploration_id == 'good'
        assert said == ['aborted: the arm has not answered for 135 ms; trying again'] * aborted


@pytest.mark.ros
def test_it_accepts_trained_surfaces_and_rejects_others_and_leaves_models_answers_and_picture(tmp_path) -> None:
    out = io.StringIO()
    assert demonstrate(tmp_path / 'demo', 'default', 0, SHORT, ProgressLog(out=out)), out.getvalue()
    slides = {slide['title']: slide for slide in json.loads((tmp_path / 'demo/demo.json').read_text())['slides']}
    assert slides.pop('cardboard')['rejection'] in ('NOVEL', 'AMBIGUOUS')
    assert {title: slide['rejection'] for title, slide in slides.items() if title != 'over the edge'} == {
        'glass': 'NONE',
        'ridge_2mm_deep': 'NONE',
        'ridge_2mm_deep at 0.02 m/s': 'OUTSIDE_TRAINING',
    }
    assert slides['glass']['decided']
    assert slides['over the edge']['outcome'].startswith('the contact with the surface was lost')
    assert re.search(r'rejected, outside the training: speed 0\.0[12]\d* m/s', out.getvalue())
    assert (tmp_path / 'demo/demo.png').stat().st_size > 10_000


@pytest.mark.ros
def test_ctrl_c_ends_it_cleanly_and_leaves_no_process(tmp_path) -> None:
    command = [sys.executable, '-m', 'texture_bringup.command', 'demo', '--out', str(tmp_path)]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as demo,
        killed_on_error(demo),
    ):
        for line in demo.stdout:
            if 'Trained surfaces' in line:
                break
        pids = [
            int(number) for number in re.findall(r'started \(process (\d+)\)', (tmp_path / 'nodes.log').read_text())
        ]
        demo.send_signal(signal.SIGINT)
        _, said = demo.communicate(timeout=DEADLINE_S)
    assert demo.returncode == 130
    # A slow start has said what it waits for.
    shown = r'((waiting:|waiting for|fit|read bags|compute features) [^\n]*\n)*'
    assert re.fullmatch(rf'{shown}texture: interrupted\n', said), said
    assert 'Traceback' not in said
    assert len(pids) == 7
    assert not any(Path(f'/proc/{pid}').exists() for pid in pids)


@pytest.mark.ros
def test_the_nodes_end_even_if_the_demonstration_is_killed(tmp_path) -> None:
    command = [sys.executable, '-m', 'texture_bringup.command', 'demo', '--out', str(tmp_path)]
    environment = {**os.environ, 'TMPDIR': str(tmp_path)}
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as demo,
        killed_on_error(demo),
    ):
        log = tmp_path / 'nodes.log'
        deadline = time.monotonic() + DEADLINE_S
        while not (log.exists() and 'classifier started' in log.read_text()):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        demo.kill()
    pids = started(log)
    while any(Path(f'/proc/{pid}').exists() for pid in pids):
        assert time.monotonic() < deadline
        time.sleep(0.05)
