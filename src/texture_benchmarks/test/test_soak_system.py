# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Endurance, shortened: an explorer that is killed comes back, and every exploration has an end."""

import os

import numpy as np
import pytest

pytestmark = [pytest.mark.benchmark, pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

from texture_benchmarks.ros import soak
from texture_benchmarks.soak import HAZARDS, LOST, PlannedFault, check_hazards
from texture_bringup import operator as operators
from texture_evaluation.train import train_from_bags
from texture_simulation.offline import SlidePlan, write_simulated

FAULTS = ('explorer killed',)
DEADLINE_S = 60.0


@pytest.fixture
def model(tmp_path):
    bags = write_simulated(
        tmp_path / 'bags', SlidePlan(slides=3, slide_s=1.0), np.random.default_rng(0), surfaces=('glass', 'leather')
    )
    train_from_bags('default', bags, out=tmp_path / 'model')
    return tmp_path / 'model'


def test_a_killed_explorer_comes_back_and_every_exploration_ends_with_a_reason(model, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(soak, 'CALM_S', 0.0)
    monkeypatch.setattr(operators, 'RETRY_PERIOD_S', 1.0)
    monkeypatch.setattr(operators, 'ACCEPT_S', 5.0)
    faults = [PlannedFault(name, 0.5, 0.5, 0.0) for name in FAULTS]
    record = soak.endure(
        soak.SoakPlan(DEADLINE_S, model=model, settle_s=1.0), tmp_path / 'nodes.log', lambda _: None, faults
    )
    reported = (tmp_path / 'nodes.log').read_text()
    assert record.ended_early_by == '', reported
    assert [item.name for item in record.fault_events] == list(FAULTS)
    assert all(np.isfinite(item.back_s) for item in record.fault_events), reported
    assert record.ends == ['explorer was killed by SIGKILL']
    assert all(item.message for item in record.explored)
    assert all(item.faults for item in record.explored if item.ending == LOST)


def test_each_hazard_of_an_arm_ends_within_the_limits_with_a_free_finger_and_a_calm_exploration_after_it() -> None:
    said: list[str] = []
    records = soak.endure_hazards(soak.SoakPlan(0.0), said.append)
    assert {item.hazard for item in records} == {*HAZARDS, 'none'}
    assert [result for result in check_hazards(records) if not result.holds] == [], said
