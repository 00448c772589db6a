# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Endurance: what is required of a run, without nodes; and each fault once, with all of them."""

import json
from contextlib import nullcontext
from types import SimpleNamespace

import pytest

pytestmark = pytest.mark.ros

from texture_benchmarks.ros import soak as module
from texture_benchmarks.ros.soak import FAULTS, NONE, FaultTrial, check, soak

CALM = FaultTrial(NONE, True, 'success', 'the motion was completed', took_s=5.0, peak_n=3.1)
FAULT = CALM._replace(fault='guard killed', ending='aborted', message='the guard has ended')


def failed(*trials, ended=0):
    """Return what does not hold."""
    return [requirement for requirement, one in check([FAULT, CALM, *trials], ended).items() if not one['holds']]


@pytest.mark.parametrize(
    ('trials', 'requirements'),
    [
        ([], []),
        ([FAULT._replace(took_s=61.0)], ['every exploration ends in 60 s']),
        ([FAULT._replace(message='')], ['every exploration succeeds or ends by name']),
        ([FAULT._replace(fault='stopped', happened=False)], ['every fault comes']),
        ([CALM._replace(ending='aborted')] * 3, ['without a fault one of 3 succeeds']),
        ([FAULT._replace(above_s=0.11)], ['no force is above 10 N for more than 0.1 s in all']),
        ([FAULT._replace(left_n=0.3)], ['no finger stays pressed where the arm obeys']),
    ],
)
def test_what_does_not_hold_is_named(trials, requirements) -> None:
    assert failed(*trials) == requirements
    assert failed(*trials, ended=1) == [*requirements, 'no node ends by itself']


def test_after_each_fault_that_ends_an_exploration_calm_ones_come_until_one_succeeds(monkeypatch, tmp_path) -> None:
    answers = {'guard killed': [FAULT], 'sensor killed': [CALM._replace(fault='sensor killed')]}
    answers[NONE] = [CALM._replace(ending='aborted'), CALM]
    rig = SimpleNamespace(run=lambda name, _surface: answers[name].pop(0), start=lambda _name: None, ended=0)
    monkeypatch.setattr(module, 'Rig', lambda *_: nullcontext(rig))
    for name in ('write_simulated', 'train_from_bags'):
        monkeypatch.setattr(module, name, lambda *_, **__: None)
    result = soak(1e-6, 0, lambda _line: None, ('guard killed', 'sensor killed'))
    numbers = json.loads(result.write(tmp_path, 'endurance', '').read_text())['numbers']
    assert sorted(one['fault'] for one in numbers['trials']) == ['guard killed', NONE, NONE, 'sensor killed']
    assert all(one['holds'] for one in numbers['requirements'].values())


@pytest.mark.benchmark
@pytest.mark.realtime
def test_each_fault_ends_within_the_limits_with_a_free_finger_and_a_calm_exploration_after_it() -> None:
    logged: list[str] = []
    numbers = soak(1.0, 0, logged.append).numbers
    assert {one['fault'] for one in numbers['trials']} == {*FAULTS, NONE}
    assert [requirement for requirement, one in numbers['requirements'].items() if not one['holds']] == [], logged
