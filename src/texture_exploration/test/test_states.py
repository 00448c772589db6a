# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state machine and the limits: what the page shows is what the code does."""

from pathlib import Path

import pytest

from texture_core.types import ExplorationRequest, Phase
from texture_exploration import force_control, guards, lift_first, safety, stages, touch, watches
from texture_exploration.arms.arm import STANDSTILL
from texture_exploration.arms.simulated import SimulatedArmParams
from texture_exploration.motion import STATES, state_table
from texture_exploration.motions import MOTIONS
from texture_exploration.safety import LIMITS, limit_table

PAGE = Path(__file__).parents[3] / 'docs' / 'motion.md'


def test_the_page_shows_the_states_and_the_limits_of_the_code():
    page = PAGE.read_text(encoding='utf-8')
    assert state_table() in page
    assert limit_table() in page


def kind(command):
    """Return which kind of command it is, in the words of the table."""
    if command.force_n is not None:
        return 'press'
    if command == STANDSTILL:
        return 'rest'
    return 'along' if any(command.tangential_m_s) else 'up' if command.normal_m_s > 0 else 'down'


HAPPENS = {
    'nothing': (None, lambda table: None),
    'a stop in the slide': (Phase.SLIDE, lambda table: table.exploration.stop('enough')),
    'a stall': (Phase.SLIDE, lambda table: table.arm.jam()),
    'a push': (Phase.SLIDE, lambda table: table.arm.push(20.0)),
    'a frozen force': (Phase.CONTACT, lambda table: table.arm.freeze_force()),
}


@pytest.mark.parametrize('name', HAPPENS)
def test_each_state_commands_what_its_row_says(make_table, monkeypatch, name):
    table, seen = make_table(SimulatedArmParams(start_height_m=0.003)), []
    phase, happens = HAPPENS[name]
    if phase:
        table.when[phase] = lambda: happens(table)
    plan, timed_step = MOTIONS['linear_slide'], stages.Stage.timed_step
    monkeypatch.setitem(MOTIONS, 'linear_slide', lambda *given: plan(*given).lift_first(lambda: True))

    def noted(stage, time_ns, arm):
        command = timed_step(stage, time_ns, arm)
        if command is not None:
            seen.append((type(stage), kind(command)))
        return command

    monkeypatch.setattr(stages.Stage, 'timed_step', noted)
    table.explore(ExplorationRequest('linear_slide', distance_m=0.02))
    assert {state for state, _ in seen} >= {lift_first.Rise, lift_first.CalmDown, stages.LiftStage}
    assert [(state.__name__, said) for state, said in seen if said not in state.commands] == []
    assert {state for state, _ in seen} <= set(STATES)


def test_every_limit_of_the_table_is_a_name_of_the_code():
    known = {name for module in (force_control, lift_first, safety, touch, watches) for name in vars(module)}
    for given in (safety.SafetyLimits, safety.CommandLimits, guards.SignalWatchParams, touch.TouchParams):
        known |= {*vars(given), *given.__dataclass_fields__}
    for row in LIMITS:
        names = row.name.replace(', …', '').replace(' to ', ', ').split(', ')
        assert [name for name in names if name not in known] == []


DECLARED = {
    'force_limit_n': (safety.SafetyLimits().force_limit_n, '10 N'),
    'friction_limit': (safety.SafetyLimits().friction_limit, '2 × normal + 1 N'),
    'state_timeout_s': (safety.SafetyLimits().state_timeout_s, '0.13 s'),
    'frozen_force_s': (safety.SafetyLimits().frozen_force_s, '0.06 s'),
    'lost_contact_s': (touch.TouchParams().lost_contact_s, '0.1 s'),
    'stall_s': (touch.TouchParams().stall_s, '25 % in 0.25 s'),
    'signal_timeout_s': (guards.SignalWatchParams().signal_timeout_s, '0.5 s'),
}


@pytest.mark.parametrize('name', DECLARED)
def test_the_value_in_the_table_is_the_default_of_the_code(name):
    value, stated = DECLARED[name]
    assert next(row.value for row in LIMITS if row.name == name) == stated
    assert f'{value:g}' in stated
