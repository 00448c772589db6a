# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The demonstration, shortened; what it prints is tested where it is made."""

import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from urllib.error import URLError
from urllib.request import urlopen

import pytest

from texture_bringup import demo
from texture_bringup.demo import (
    ACCEPTED,
    ATTEMPTS,
    FIRST_PORT,
    FIRST_UNICAST,
    PORTS_PER_DOMAIN,
    UNKNOWN,
    Slide,
    free_domain,
    slide_over,
)
from texture_bringup.operator import ExplorationResult
from texture_core.errors import ExplorationError
from texture_core.ros_testing import killed_on_error
from texture_core.types import ExplorationRequest, Rejection, RoughnessEstimate, TextureEstimate

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
        (['good'], UNKNOWN, 'good'),  # a wrong label is never asked again
    ],
)
def test_an_aborted_slide_and_a_rejected_one_over_a_trained_surface_are_made_again(
    ends, expected, last, capsys
) -> None:
    made = iter(ends)

    def explore(_request, _on_progress):
        error, rejection = ENDS[name := next(made)]
        estimate = TextureEstimate(0, name, 'felt', rejection)
        return ExplorationResult(error, f'it {name}', name, estimate, RoughnessEstimate(0, ''))

    operator = SimpleNamespace(explore=explore, set_parameters=lambda *_: None)
    request = ExplorationRequest('linear_slide', surface='felt')
    slide = slide_over(operator, request, 'felt', expected)
    assert (slide.answer.exploration_id, list(made)) == (last, [])
    assert capsys.readouterr().out.count('trying again') == len(ends) - 1


@pytest.mark.ros
def test_it_accepts_trained_surfaces_and_rejects_others_and_leaves_a_picture(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(demo, 'RECOGNISED', ('brushed_metal', 'ridge_2mm_deep'))
    monkeypatch.setattr(demo, 'UNTRAINED', ('cardboard',))
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


@pytest.mark.ros
def test_it_serves_the_page_of_the_operator_and_ctrl_c_ends_it_cleanly_and_leaves_no_process(tmp_path) -> None:
    command = [sys.executable, '-c', SHORT, 'demo', '--dashboard', '--out', str(tmp_path)]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as demo,
        killed_on_error(demo),
    ):
        for line in demo.stdout:
            if 'dashboard: ' in line:
                address = line.split()[1]
                break
        deadline = time.monotonic() + DEADLINE_S
        while b'<html' not in page_at(address):  # the server is up a moment after its node
            assert time.monotonic() < deadline
            time.sleep(0.05)
        pids = started(tmp_path / 'nodes.log')
        demo.send_signal(signal.SIGINT)
        _, said = demo.communicate(timeout=DEADLINE_S)
    assert demo.returncode == 130
    # A slow start has said what it waits for.
    shown = r'((waiting:|waiting for|fitting|reading bags|computing features) [^\n]*\n)*'
    assert re.fullmatch(rf'{shown}texture: interrupted\n', said), said
    assert 'Traceback' not in said
    assert len(pids) == 8
    assert not any(Path(f'/proc/{pid}').exists() for pid in pids)


def test_a_domain_in_use_is_left_alone() -> None:
    first = free_domain()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(('', FIRST_PORT + PORTS_PER_DOMAIN * first + FIRST_UNICAST))
        assert free_domain() != first
