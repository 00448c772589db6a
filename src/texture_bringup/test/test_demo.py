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

from texture_bringup.demo import ATTEMPTS, DemoPlan, ProgressLog, demonstrate, explore_patiently, is_refused
from texture_bringup.operator import ExplorationResult
from texture_core.errors import ExplorationError, MotionAborted
from texture_core.ros_testing import killed_on_error
from texture_core.types import ExplorationRequest, Rejection, RoughnessEstimate, TextureEstimate

pytestmark = pytest.mark.realtime

DEADLINE_S = 60.0
SHORT = DemoPlan(surfaces=('glass', 'ridge_2mm_deep'), learning_slides=2, recognition_slides=1)


def started(log: Path) -> list[int]:
    """Return the processes of the nodes."""
    return [int(number) for number in re.findall(r'started \(process (\d+)\)', log.read_text())]


@pytest.mark.parametrize(
    ('estimate', 'refused'),
    [
        (TextureEstimate(0, 'a', 'glass', Rejection.OUTSIDE_TRAINING), True),
        (TextureEstimate(0, 'a', 'glass', Rejection.NONE), False),
        (TextureEstimate(0, 'a', 'glass'), False),
    ],
)
def test_a_refusal_names_the_condition_and_claims_nothing(estimate: TextureEstimate, refused: bool) -> None:
    assert is_refused(estimate) is refused


@pytest.mark.parametrize('aborted', range(ATTEMPTS + 1))
def test_an_aborted_slide_is_made_again_and_that_is_said(aborted: int) -> None:
    nothing = TextureEstimate(0, '', ''), RoughnessEstimate(0, '')
    results = [
        ExplorationResult(ExplorationError.ARM_FAULT, 'the arm has not answered for 135 ms', 'late', *nothing)
    ] * aborted
    results.append(ExplorationResult(ExplorationError.NONE, 'the motion ended as asked', 'good', *nothing))
    said: list[str] = []
    made = iter(results)
    if aborted == ATTEMPTS:
        with pytest.raises(MotionAborted, match='the exploration of felt failed: the arm has not answered'):
            explore_patiently(lambda _: next(made), ExplorationRequest('linear_slide', surface='felt'), said.append)
    else:
        explored = explore_patiently(lambda _: next(made), ExplorationRequest('linear_slide'), said.append)
        assert explored.exploration_id == 'good'
        assert said == ['aborted: the arm has not answered for 135 ms; once more'] * aborted


@pytest.mark.ros
def test_it_learns_recognises_and_leaves_recordings_model_figures_and_picture(tmp_path) -> None:
    out = io.StringIO()
    assert demonstrate(tmp_path / 'demo', 'default', 0, SHORT, ProgressLog(out=out)), out.getvalue()
    assert '2 of 2 slides over simulated surfaces recognised' in out.getvalue()
    figures = json.loads((tmp_path / 'demo/evaluation.json').read_text())
    assert figures['labels'] == ['glass', 'ridge_2mm_deep']
    assert (figures['untrained_speed']['known'], figures['untrained_speed']['decided']) == (False, False)
    message = figures['untrained_speed']['message']
    slow = re.match(r'outside what was trained: speed ([\d.]+) m/s, trained (?:0\.0[45]\d* to )?0\.05', message)
    assert slow is not None, message
    assert float(slow[1]) == pytest.approx(0.02, rel=0.1)
    assert slow[0] in out.getvalue()
    assert (tmp_path / 'demo/demo.png').stat().st_size > 10_000


@pytest.mark.ros
def test_ctrl_c_ends_it_cleanly_and_leaves_no_process(tmp_path) -> None:
    command = [sys.executable, '-m', 'texture_bringup.command', 'demo', '--out', str(tmp_path)]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as demo,
        killed_on_error(demo),
    ):
        for line in demo.stdout:
            if 'Learning' in line:
                break
        pids = [
            int(number) for number in re.findall(r'started \(process (\d+)\)', (tmp_path / 'nodes.log').read_text())
        ]
        demo.send_signal(signal.SIGINT)
        _, said = demo.communicate(timeout=DEADLINE_S)
    assert demo.returncode == 130
    # A slow start has said what it waits for.
    assert re.fullmatch(r'(waiting; so far [^\n]*\n)*texture: interrupted\n', said), said
    assert 'Traceback' not in said
    assert len(pids) == 5
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
