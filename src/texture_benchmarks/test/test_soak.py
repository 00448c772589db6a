# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Endurance without nodes: schedules, books and verdicts."""

import json
import math
import os
from itertools import islice

import numpy as np
import pytest

from texture_benchmarks.soak import (
    FAULTS,
    ExplorationRecord,
    FaultEvent,
    ForceAccount,
    HazardRecord,
    Processes,
    ProcessUsage,
    SampleAccount,
    SoakRecord,
    Totals,
    check_hazards,
    check_requirements,
    memory_growth,
    planned_explorations,
    planned_faults,
    read_usage,
    write,
    write_hazards,
)

HOUR_S = 3600
MIB = 2**20


def usages(node='emulator', pid=1, end_s=HOUR_S, growth=0.0):
    """Return looks at a process of 50 MiB that uses 20 % of a core and may grow evenly."""
    return [
        ProcessUsage(float(s), node, pid, int(50 * MIB * (1 + growth * s / end_s)), 0.2 * s)
        for s in range(0, end_s + 1, 10)
    ]


def explored(**changed):
    given = {'begin_s': 0.0, 'end_s': 2.0, 'wanted': 'success'}
    return ExplorationRecord(**{**given, 'ending': 'success', 'message': 'the motion ended as asked', **changed})


def record(**changed):
    given = {'begin_s': 0.0, 'end_s': float(HOUR_S), 'seed': 0, 'explored': [explored()], 'usages': usages()}
    return SoakRecord(**{**given, 'vectors': 10, **changed})


def failed(**changed):
    """Return what does not hold."""
    return [result.asked for result in check_requirements(record(**changed)) if not result.holds]


def test_the_same_seed_gives_the_same_faults_and_all_kinds_come() -> None:
    first, second = (list(islice(planned_faults(np.random.default_rng(3), 20.0), 300)) for _ in range(2))
    assert first == second
    assert {planned_fault.name for planned_fault in first} == set(FAULTS)
    assert np.mean([planned_fault.quiet_s for planned_fault in first]) == pytest.approx(20.0, rel=0.2)


def test_orders_are_possible_but_for_those_meant_to_be_refused() -> None:
    given = list(islice(planned_explorations(np.random.default_rng(0), ['glass', 'leather']), 300))
    speeds = [order.request.speed_m_s for order in given if not order.invalid_on_purpose]
    assert 0.02 < min(speeds) < max(speeds) < 0.25
    assert any(order.invalid_on_purpose for order in given)
    assert any(order.stop_after_s > 0 for order in given)
    assert {order.request.surface for order in given} == {'glass', 'leather'}


def test_counters_are_added_up_over_the_lives_of_a_node() -> None:
    totals = Totals()
    for samples, lost in ((100, 0), (900, 7), (50, 0), (60, 1)):
        totals.update({'samples': samples, 'lost': lost})
    assert totals.sums == {'samples': 960, 'lost': 8}


def test_the_book_of_samples_knows_losses_and_new_beginnings() -> None:
    book = SampleAccount()
    for index, stamp_ms in ((0, 0), (10, 10), (30, 30), (0, 540)):
        book.update(index, 10, stamp_ms * 1_000_000, 1000.0)
    assert (book.samples, book.gaps, book.restarts) == (40, 10, 1)
    assert book.away_s == pytest.approx(0.5)
    assert book.drift_s == pytest.approx(0.0)
    book.update(10, 10, 650_000_000, 1000.0)  # a hundred samples are missing, and the index does not tell
    assert book.drift_s == pytest.approx(0.1)


def test_processes_are_known_from_the_output_of_the_launcher(tmp_path) -> None:
    log = tmp_path / 'log'
    log.write_text('[launch] sensor started (process 12)\n[sensor] hello\n[launch] sensor was ki')
    processes = Processes(log)
    assert processes.update() == {'sensor': 12}
    with log.open('a') as file:
        file.write('lled by SIGKILL\n[launch] sensor started (process 13)\n')
    assert processes.update() == {'sensor': 13}
    assert processes.ends == ['sensor was killed by SIGKILL']


def test_what_this_process_uses_is_read_and_one_that_has_ended_uses_nothing() -> None:
    own = read_usage('test', os.getpid(), 1.0)
    assert own.resident_bytes > MIB
    assert own.cpu_s > 0
    assert read_usage('none', 2**22 + 1, 1.0) is None


def test_a_calm_hour_holds_everything() -> None:
    assert failed() == []


@pytest.mark.parametrize(
    ('changed', 'asked'),
    [
        ({'explored': [explored(end_s=80.0)]}, 'every exploration ends'),
        ({'explored': [explored(ending='aborted', message='')]}, 'every abort is named'),
        ({'explored': [explored(ending='aborted', message='why')]}, 'every abort is named'),
        ({'fault_events': [FaultEvent('emulator frozen', 5.0, 6.0, math.nan, '')]}, 'after every fault'),
        ({'ends': ['sensor died with exit code 1']}, 'no process ends'),
        ({'usages': usages(growth=0.05)}, 'memory of each process'),
        ({'ended_early_by': 'it was interrupted'}, 'the run goes to its end'),
        ({'unanswered': {'a': 1}, 'explored': [explored(exploration_id='a')]}, 'every feature vector'),
    ],
)
def test_what_does_not_hold_is_named(changed, asked) -> None:
    assert [text[: len(asked)] for text in failed(**changed)] == [asked]


def test_samples_that_nobody_counted_are_seen() -> None:
    book = SampleAccount()
    book.update(0, 10, 0, 1000.0)
    book.update(60, 10, 60_000_000, 1000.0)
    assert failed(signal=book) == ['every lost sample is counted']
    assert failed(signal=book, totals={'sensor': {'lost': 50}}) == []


def test_an_abort_during_a_fault_and_one_that_was_asked_for_are_explained() -> None:
    assert failed(explored=[explored(ending='aborted', message='why', faults=('emulator frozen',))]) == []
    assert failed(explored=[explored(ending='aborted', message='why', wanted='aborted')]) == []


def test_vectors_that_the_classifier_counted_as_lost_are_no_secret() -> None:
    lost = {'unanswered': {'a': 2}, 'explored': [explored(exploration_id='a', faults=('feature_extractor killed',))]}
    assert failed(**lost, totals={'classifier': {'lost_vectors': 1}}) == ['every feature vector is answered or counted']
    assert failed(**lost, totals={'classifier': {'lost_vectors': 2}}) == []


def test_vectors_that_a_killed_classifier_did_not_answer_are_explained() -> None:
    killed = explored(exploration_id='a', faults=('classifier killed',))
    assert failed(unanswered={'a': 3}, explored=[killed]) == []


def test_a_process_that_lived_for_minutes_only_is_not_evaluated_by_its_memory() -> None:
    assert memory_growth(usages(end_s=400)) == []
    assert len(memory_growth([*usages(end_s=400), *usages(pid=2)])) == 1


def test_the_report_has_a_chart_and_figures(tmp_path) -> None:
    fault_events = [
        FaultEvent('emulator frozen', 5.0, 6.0, 7.5, 'for 1 s'),
        FaultEvent('sensor unplugged', 9.0, math.inf, math.inf, ''),
    ]
    path = write(record(fault_events=fault_events, said=[('sensor', 'WARN', 'gone', 3)]), tmp_path)
    numbers = json.loads(path.read_text())['numbers']
    assert numbers['recovery_s'] == {'emulator frozen': {'times': 1, 'median': 1.5, 'longest': 1.5}}
    assert numbers['said'] == [{'node': 'sensor', 'level': 'WARN', 'text': 'gone', 'times': 3}]
    assert numbers['endings'] == {'success': {'without': 1}}
    assert (tmp_path / 'endurance.png').read_bytes().startswith(b'\x89PNG')


def test_a_force_above_the_limit_is_timed_without_a_break() -> None:
    force = ForceAccount()
    for time_s, force_n in ((0.0, 5.0), (0.1, 11.0), (0.15, 12.0), (0.2, 9.0), (0.3, 20.0), (0.32, 2.0)):
        force.update(time_s, force_n)
    assert (force.newest_n, force.peak_n, round(force.above_s, 9)) == (2.0, 20.0, 0.05)


@pytest.mark.parametrize(
    ('changed', 'asked'),
    [
        ({}, []),
        ({'ending': 'aborted'}, []),
        ({'ending': 'aborted', 'message': ''}, ['every exploration succeeds or is aborted by name']),
        ({'hazard': 'none', 'ending': 'aborted'}, ['after a hazard one of 3 explorations succeeds']),
        ({'hazard': 'guard stopped for 3 s', 'happened': False}, ['every hazard comes']),
        ({'happened': False}, []),  # but in another attempt
        ({'above_s': 0.11}, ['no force above 10 N for more than 0.1 s in any direction']),
        ({'left_n': 0.3}, ['no finger stays pressed where the arm obeys']),
    ],
)
def test_a_hazard_that_breaks_a_limit_is_named(changed, asked, tmp_path) -> None:
    found = HazardRecord('guard killed', True, 'success', 'the motion ended as asked', 12.0, 0.05, 0.0)
    records = [found, found._replace(**changed)]
    assert [result.asked for result in check_hazards(records) if not result.holds] == asked
    numbers = json.loads(write_hazards(records, tmp_path, 0, 60.0).read_text())['numbers']
    assert (numbers['injections'], numbers['hazards']['guard killed']['peak_n']) == (
        sum(item.hazard != 'none' and item.happened for item in records),
        12,
    )
