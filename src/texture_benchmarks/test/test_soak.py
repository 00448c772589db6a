# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Endurance: what is required of a run, without nodes; and each fault once, with all of them."""

import json
import math
from collections import Counter
from contextlib import nullcontext
from types import SimpleNamespace

import pytest

pytestmark = pytest.mark.ros

from texture_benchmarks.ros import soak as module
from texture_benchmarks.ros.soak import ENDINGS, FAULTS, LOOKS, NONE, FaultTrial, check, figures, longest_above_s, soak

CALM = FaultTrial(NONE, True, 'success', 'the motion was completed', took_s=5.0, back_s=1.0, peak_n=3.1)
FAULT = CALM._replace(fault='guard killed', ending='aborted', message='the guard has ended')
MIB = 2**20


def failed(*trials, counts=(), memory=()):
    """Return what does not hold, shortened to its beginning."""
    found = check([FAULT, CALM, *trials], Counter(dict(counts)), memory)
    return [requirement for requirement, one in found.items() if not one['holds']]


def test_a_calm_run_holds_everything() -> None:
    assert failed() == []


@pytest.mark.parametrize(
    ('trials', 'requirement'),
    [
        ([FAULT._replace(took_s=61.0)], 'every exploration ends in 60 s'),
        ([FAULT._replace(message='')], 'every exploration succeeds or ends by name'),
        ([FAULT._replace(fault='stopped', happened=False)], 'every fault comes'),
        ([CALM._replace(ending='aborted')] * 3, 'without a fault one of 3 succeeds'),
        ([FAULT._replace(back_s=math.nan)], 'all nodes report and samples flow in 60 s'),
        ([FAULT._replace(above_s=0.11)], 'no force is above 10 N for more than 0.1 s'),
        ([FAULT._replace(left_n=0.3)], 'no finger stays pressed where the arm obeys'),
        ([FAULT._replace(silent=1)], 'every vector is answered or counted'),
    ],
)
def test_what_does_not_hold_is_named(trials, requirement) -> None:
    assert failed(*trials) == [requirement]


def test_what_a_killed_classifier_leaves_and_what_is_counted_is_excused() -> None:
    assert failed(FAULT._replace(fault='classifier killed', silent=3)) == []
    assert failed(FAULT._replace(silent=1), counts={'classifier lost_vectors': 1}) == []


def test_samples_that_nobody_counted_and_nodes_that_end_are_seen() -> None:
    assert failed(counts={'lost': 50, 'sensor lost': 49}) == ['every lost sample is counted']
    assert failed(counts={'lost': 50, 'sensor lost': 50, 'ended': 1}) == ['no node ends by itself']


def test_memory_that_grows_after_the_beginning_is_seen() -> None:
    settled = [50 * MIB] * LOOKS
    assert failed(memory=[settled, [40 * MIB, *settled], [round((1 + i / 10) * MIB) for i in range(LOOKS - 1)]]) == []
    assert failed(memory=[[round((50 + i / 10) * MIB) for i in range(LOOKS)]]) == ['memory grows less than 1 %']


def test_a_force_above_the_limit_is_timed_without_a_break() -> None:
    forces = [(0.0, 5.0), (0.1, 11.0), (0.15, 12.0), (0.2, 9.0), (0.3, 20.0), (0.32, 2.0)]
    assert longest_above_s(forces) == pytest.approx(0.05)


def test_sentences_that_differ_in_numbers_are_one() -> None:
    found = figures([FAULT._replace(message=f'waited {seconds} s') for seconds in ('10.0', '9.5')])
    assert (found['messages'], found['aborted'], found['peak_n']) == (['waited … s'], 2, 3.1)


def test_after_each_fault_that_ends_an_exploration_calm_ones_come_until_one_succeeds(monkeypatch, tmp_path) -> None:
    answers = {'guard killed': [FAULT], 'sensor killed': [CALM._replace(fault='sensor killed')]}
    answers[NONE] = [CALM._replace(ending='aborted'), CALM]
    rig = SimpleNamespace(
        run=lambda name, _surface: answers[name].pop(0), start=lambda _name: None, counts=Counter(), memory={}
    )
    monkeypatch.setattr(module, 'Rig', lambda *_: nullcontext(rig))
    for name in ('write_simulated', 'train_from_bags'):
        monkeypatch.setattr(module, name, lambda *_, **__: None)
    result = soak(1e-6, 0, lambda _line: None, ('guard killed', 'sensor killed'))
    numbers = json.loads(result.write(tmp_path).read_text())['numbers']
    assert {name: one['explorations'] for name, one in numbers['faults'].items()} == {
        'guard killed': 1,
        'sensor killed': 1,
        NONE: 2,
    }
    assert all(one['holds'] for one in numbers['requirements'].values())


@pytest.mark.benchmark
@pytest.mark.realtime
def test_each_fault_ends_within_the_limits_with_a_free_finger_and_a_calm_exploration_after_it() -> None:
    logged: list[str] = []
    numbers = soak(1.0, 0, logged.append).numbers
    assert set(numbers['faults']) == {*FAULTS, NONE}
    assert [requirement for requirement, one in numbers['requirements'].items() if not one['holds']] == [], logged
    assert all(one['explorations'] == sum(one[ending] for ending in ENDINGS) for one in numbers['faults'].values())
