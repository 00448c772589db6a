# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The demonstration, shortened; what it prints is tested where it is made."""

import os
import re
import shlex
import signal
import socket
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from urllib.error import URLError
from urllib.request import urlopen

import pytest
from matplotlib.figure import Figure

from texture_bringup import demo
from texture_bringup.command import main
from texture_bringup.demo import (
    ACCEPTED,
    ATTEMPTS,
    FIRST_PORT,
    FIRST_UNICAST,
    PORTS_PER_DOMAIN,
    UNKNOWN,
    Slide,
    by_hand,
    free_domain,
    slide_over,
)
from texture_bringup.launcher import find_launch_file, given_arguments, read
from texture_bringup.operator import ExplorationResult
from texture_core.errors import ExplorationError
from texture_core.ros_testing import killed_on_error
from texture_core.types import ExplorationRequest, FingerReceiver, Rejection, RoughnessEstimate, TextureEstimate

pytestmark = pytest.mark.realtime

DEADLINE_S = 60.0
# The demonstration, for a test that does not look at its answers.
SHORT = """
import sys
from texture_bringup import command, demo
demo.TRAINING_SLIDES, demo.TRAINED = 2, {'brushed_metal': 1.0, 'ridge_2mm_deep': 4.5}
sys.exit(command.main(sys.argv[1:]))
"""


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


def test_the_picture_dots_what_is_before_the_first_estimate_and_has_times_below_each_panel(
    tmp_path, monkeypatch
) -> None:
    figure = Figure()
    monkeypatch.setattr(demo, 'chart', lambda *_: nullcontext(figure))
    seen = [
        TextureEstimate(0, 'a', 'glass', Rejection.NONE, probabilities=(0.9, 0.1), evidence_s=seconds)
        for seconds in (0.5, 0.6)
    ]
    answer = ExplorationResult(ExplorationError.NONE, '', 'a', seen[-1], RoughnessEstimate(0, 'a'))
    slide = Slide(
        'glass', 'glass', ACCEPTED, answer, [TextureEstimate(0, 'a', '', Rejection.TOO_LITTLE_EVIDENCE), *seen]
    )
    demo.draw([slide] * 3, tmp_path / 'demo.png')
    panels = figure.axes[:3]
    begins = [[(line.get_linestyle(), min(line.get_xdata())) for line in panel.lines] for panel in panels]
    assert begins == [[('-', 0.5), (':', 0.0)] * 2] * 3
    assert all(panel.xaxis.get_tick_params()['labelbottom'] for panel in panels)


def test_a_slide_that_lost_its_samples_says_so_in_the_table_and_in_its_panel(tmp_path, monkeypatch) -> None:
    figure, message = Figure(), 'no window could be used: its samples were lost'
    monkeypatch.setattr(demo, 'chart', lambda *_: nullcontext(figure))
    end = TextureEstimate(0, 'a', '', Rejection.TOO_LITTLE_EVIDENCE, message=message)
    answer = ExplorationResult(ExplorationError.NONE, '', 'a', end, RoughnessEstimate(0, 'a'))
    slide = Slide('cardboard', 'cardboard', UNKNOWN, answer, [])
    assert (slide.as_expected, slide.outcome) == (False, f'no answer: {message}')
    demo.draw([slide], tmp_path / 'demo.png')
    panel = figure.axes[0]
    assert (panel.get_title(), [text.get_text() for text in panel.texts]) == ('cardboard\nno answer', [message])


def page_at(address: str) -> bytes:
    """Return a page, or nothing if no server answers yet."""
    try:
        with urlopen(address, timeout=DEADLINE_S) as page:
            return page.read()
    except URLError:
        return b''


ENDS = {
    'aborted': (ExplorationError.ARM_FAULT, Rejection.NO_MODEL),
    'novel': (ExplorationError.NONE, Rejection.NOVEL),
    'lost': (ExplorationError.NONE, Rejection.TOO_LITTLE_EVIDENCE),
    'good': (ExplorationError.NONE, Rejection.NONE),
}


@pytest.mark.parametrize(
    ('ends', 'expected', 'last'),
    [
        (['good'], ACCEPTED, 'good'),
        (['aborted', 'good'], ACCEPTED, 'good'),
        (['novel', 'aborted', 'good'], ACCEPTED, 'good'),
        (['aborted'] * ATTEMPTS, ACCEPTED, 'aborted'),
        (['novel'], UNKNOWN, 'novel'),
        (['lost', 'novel'], UNKNOWN, 'novel'),
        (['good'], UNKNOWN, 'good'),  # a wrong label is never asked again
    ],
)
def test_an_aborted_slide_and_a_rejected_one_over_a_trained_surface_are_made_again(
    ends, expected, last, capsys
) -> None:
    made = iter(ends)

    def explore(_request, _on_progress):
        error, rejection = ENDS[name := next(made)]
        estimate = TextureEstimate(0, name, '' if name == 'lost' else 'felt', rejection)
        return ExplorationResult(error, f'it {name}', name, estimate, RoughnessEstimate(0, ''))

    operator = SimpleNamespace(explore=explore, set_parameters=lambda *_: None)
    request = ExplorationRequest('linear_slide', surface='felt')
    slide = slide_over(operator, request, 'felt', expected)
    assert (slide.answer.exploration_id, list(made)) == (last, [])
    assert capsys.readouterr().out.count('this try does not count, trying again') == len(ends) - 1


@pytest.mark.ros
def test_it_accepts_trained_surfaces_and_rejects_others_and_leaves_a_picture(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(demo, 'RECOGNISED', ('brushed_metal', 'ridge_2mm_deep'))
    monkeypatch.setattr(demo, 'UNTRAINED', ('cardboard',))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('XDG_RUNTIME_DIR', str(tmp_path))
    right = demo.demonstrate(tmp_path / 'demo', 'default', 0)
    said = capsys.readouterr().out
    assert right, said
    for line in (
        r'✓ brushed_metal +accepted as brushed_metal after [\d.]+ s, ended early',
        r'✓ ridge_2mm_deep +accepted as ridge_2mm_deep',
        r'✓ cardboard +rejected, (novel|ambiguous)',
        r'✓ ridge_2mm_deep at 0\.02 m/s +rejected, outside the training: speed 0\.0[12]\d* m/s',
        r'✓ over the edge +the contact with the surface was lost',
    ):
        assert re.search(line, said), said
    assert (tmp_path / 'demo/demo.png').stat().st_size > 10_000
    # The two lines at the end work as they are printed, also beside an emulator with the pipe of the default.
    launch, explore = (line.split() for line in said.splitlines()[-2:])
    other = FingerReceiver(str(tmp_path / 'tactile_texture/finger'))
    with subprocess.Popen(launch, stdout=subprocess.PIPE, text=True) as launcher, killed_on_error(launcher):
        assert any('the sensor delivers samples' in line for line in launcher.stdout)
        explored = subprocess.run(explore, check=False, capture_output=True, text=True, timeout=DEADLINE_S)
        launcher.send_signal(signal.SIGINT)
        launcher.communicate(timeout=DEADLINE_S)
    other.close()
    assert re.search(r'texture: +leather, confidence', explored.stdout), explored


def test_the_lines_for_the_user_name_the_page_only_where_it_was_asked_for() -> None:
    usual, explore = by_hand(Path('my out'), 0)
    assert "'model:=my out/model.npz'" in usual
    assert 'dashboard' not in usual
    assert '--namespace demo' in explore
    nodes = read(find_launch_file('emulator'), given_arguments(shlex.split(usual)[3:]), os.environ)
    assert {node.namespace for node in nodes} == {'/demo'}
    other, _ = by_hand(Path('out'), 8123)
    nodes = read(find_launch_file('emulator'), given_arguments(shlex.split(other)[3:]), os.environ)
    given = {
        node.name: {k: v for one in node.parameters if isinstance(one, dict) for k, v in one.items()} for node in nodes
    }
    assert given['dashboard']['port'] == 8123
    assert given['feature_extractor']['recipe'] == given['classifier']['model'] == 'out/model.npz'


@pytest.mark.ros
def test_it_serves_the_page_of_the_operator_and_ctrl_c_ends_it_cleanly_and_leaves_no_process(tmp_path) -> None:
    command = [sys.executable, '-c', SHORT, 'demo', '--dashboard', '--out', str(tmp_path)]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as demo,
        killed_on_error(demo),
    ):
        address = next(line.split()[1] for line in demo.stdout if 'dashboard: ' in line)
        assert any(f'the dashboard is at {address} now' in line for line in demo.stdout)
        deadline = time.monotonic() + DEADLINE_S
        while b'<html' not in page_at(address):  # the server is up a moment after its node
            assert time.monotonic() < deadline
            time.sleep(0.05)
        pids = started(tmp_path / 'nodes.log')
        demo.send_signal(signal.SIGINT)
        _, said = demo.communicate(timeout=DEADLINE_S)
    assert demo.returncode == 130
    # A slow start has said what it waits for; an exploration may have begun.
    ended = '; the exploration has ended: cancelled by the client; the finger was lifted'
    shown = r'((waiting:|waiting for|training) [^\n]*\n)*'
    assert re.fullmatch(rf'{shown}texture: interrupted({ended})?\n', said), said
    assert 'Traceback' not in said
    assert len(pids) == 8
    assert not any(Path(f'/proc/{pid}').exists() for pid in pids)


def test_a_domain_in_use_is_left_alone() -> None:
    first = free_domain()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(('', FIRST_PORT + PORTS_PER_DOMAIN * first + FIRST_UNICAST))
        assert free_domain() != first


def test_a_folder_of_other_files_is_refused_and_left_as_it_is(tmp_path, capsys) -> None:
    (tmp_path / 'training').mkdir()
    (tmp_path / 'training' / 'notes.txt').write_text('mine')
    assert main(['demo', '--out', str(tmp_path)]) == 2
    assert 'holds files that no demonstration wrote' in capsys.readouterr().err
    assert (tmp_path / 'training' / 'notes.txt').read_text() == 'mine'
