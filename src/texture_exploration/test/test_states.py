# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state machine and the limits: what the page shows is what the code does."""

import re
from itertools import pairwise
from pathlib import Path

import pytest

from texture_core.types import ExplorationRequest, Phase
from texture_exploration import force_control, guards, lift_first, safety, stages, touch, watches
from texture_exploration.arms.arm import STANDSTILL
from texture_exploration.arms.simulated import SimulatedArmParams
from texture_exploration.explorer import PERIOD_S
from texture_exploration.motion import LIMITS, STATES, state_table
from texture_exploration.motions import MOTIONS

PAGE = Path(__file__).parents[3] / 'docs' / 'motion.md'


def test_the_page_shows_the_states_and_the_limits_of_the_code():
    page = PAGE.read_text(encoding='utf-8')
    assert state_table() in page
    assert LIMITS in page


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
def test_each_state_commands_and_leads_to_what_its_row_says(make_table, monkeypatch, name):
    table, seen, entered = make_table(SimulatedArmParams(start_height_m=0.003)), [], []
    phase, happens = HAPPENS[name]
    if phase:
        table.when[phase] = lambda: happens(table)
    plan, timed_step, begin = MOTIONS['linear_slide'], stages.Stage.timed_step, stages.Stage.begin
    monkeypatch.setitem(MOTIONS, 'linear_slide', lambda *given: plan(*given).lift_first(lambda: True))

    def noted(stage, time_ns, arm):
        command = timed_step(stage, time_ns, arm)
        if command is not None:
            seen.append((type(stage), kind(command)))
        return command

    monkeypatch.setattr(stages.Stage, 'timed_step', noted)
    monkeypatch.setattr(
        stages.Stage, 'begin', lambda stage, *given: (entered.append(type(stage)), begin(stage, *given))
    )
    table.explore(ExplorationRequest('linear_slide', distance_m=0.02))
    assert {state for state, _ in seen} >= {lift_first.Rise, lift_first.CalmDown, stages.LiftStage}
    assert [(state.__name__, said) for state, said in seen if said not in state.commands] == []
    assert {state for state, _ in seen} <= set(STATES)
    order = [state for state in STATES if state is not lift_first.GoBack]
    for before, after in pairwise(entered):
        assert after is order[order.index(before) + 1] or after.__name__.removesuffix('Stage') in before.on_error


def test_every_limit_of_the_table_is_a_name_of_the_code():
    known = {name for module in (force_control, lift_first, safety, touch, watches) for name in vars(module)}
    for given in (safety.SafetyLimits, safety.CommandLimits, guards.SignalWatchParams, touch.TouchParams):
        known |= {*vars(given), *given.__dataclass_fields__}
    for name in re.findall(r'^\| `(.*?)`', LIMITS, re.MULTILINE):
        assert {*name.replace(', …', '').replace(' to ', ', ').split(', ')} <= known


def test_the_sentences_of_the_pages_hold_the_limits_of_the_code():
    limit_n, stiff = safety.SafetyLimits().force_limit_n, touch.TouchParams(approach_stiffness_n_m=20000.0)
    slow, slower = (f'{1e3 * stiff.slide_m_s(limit_n, delay_s):.0f} mm/s with' for delay_s in (0.02, 0.05))
    assert f'exceed {touch.WALL_SHARE:g} times `force_limit_n`' in PAGE.read_text()
    assert f'at 20 kN/m above {slow} 20 ms delay, above {slower} 50 ms' in PAGE.read_text()
    assert f'(delay + {1e3 * touch.STEP_S:g} ms)' in PAGE.read_text()
    for page in (PAGE, PAGE.with_name('safety.md')):
        above = re.findall(r'above (\d+) N', page.read_text())
        assert {*map(float, above)} == {limit_n}


def test_each_step_of_the_table_is_the_period_of_the_explorer():
    assert f'each step, {1e3 * PERIOD_S:g} ms' in LIMITS
