# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state machine and the limits: what the page shows is what the code does."""

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from table_arm import TableArmParams

from texture_core.types import ExplorationRequest, Phase
from texture_exploration import force_control, guards, lift_first, safety, stages, touch, watches
from texture_exploration.arms.arm import STANDSTILL
from texture_exploration.explorer import PERIOD_S
from texture_exploration.motion import STATES, limit_table, state_table
from texture_exploration.motions import MOTIONS

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
def test_each_state_commands_and_leads_to_what_its_row_says(make_table, monkeypatch, name):
    table, seen, entered = make_table(TableArmParams(start_height_m=0.003)), [], []
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
    for name in re.findall(r'^\| `(.*?)`', limit_table(), re.MULTILINE):
        assert {*name.replace(', …', '').replace(' to ', ', ').split(', ')} <= known


def test_the_sentences_of_the_pages_hold_the_limits_of_the_code():
    limits, touching = safety.SafetyLimits(), touch.TouchParams()
    stiff = replace(touching, approach_stiffness_n_m=20000.0)
    slow, slower = (f'{1e3 * stiff.slide_m_s(limits.force_limit_n, delay_s):.0f} mm/s' for delay_s in (0.02, 0.05))
    mean, speed, peak = touching.mean_force_fraction, touching.mean_speed_fraction, touching.peak_force_fraction
    sentences = {
        'motion.md': [
            f'exceed {touch.WALL_SHARE:g} times `force_limit_n`',
            f'at 20 kN/m above {slow} with 20 ms delay, above {slower} with 50 ms',
            f'× (delay + {1e3 * touch.STEP_S:g} ms) × stiffness',
            f'The gain is {force_control.GAIN_MARGIN:g} times lower',
            f'no approach of {1e3 * force_control.SLOWEST_APPROACH_M_S:g} mm/s',
            f'*waited {limits.contact_timeout_s} s for the force to settle*',
        ],
        'safety.md': [
            f'at most `travel_speed_m_s` ({1e3 * touching.travel_speed_m_s:g} mm/s)',
            f'repeated for {1e3 * limits.frozen_force_s:g} ms',
            f'over {100 * limits.force_drift_fraction:g} % of the requested force',
            f'above {safety.MOST_FORCE_N / 1e3:g} kN or {safety.MOST_M:g} m',
            f'after `loop_delay_s` + {1e3 * force_control.LATE_S:g} ms',
            f'or {100 * watches.OVERSHOOT:g} % overshoot before the slide',
            f'below {touching.unheard_force_fraction:g} × the requested',
            f'probe of {1e3 * lift_first.PROBE_M:g} mm at {1e3 * lift_first.PROBE_M_S:g} mm/s',
            f'below {100 * touching.lost_force_fraction:g} % of the requested force',
            f'under {100 * touching.stall_speed_fraction:g} % of the path',
            f'mean force off by {100 * mean:g} %, speed by {100 * speed:g} %, peak by {100 * peak:g} %',
            f'outside {safety.RANGES["speed_m_s"][0]:g} to {limits.max_speed_m_s:g} m/s, {limits.min_force_n:g} to '
            f'{limits.max_force_n:g} N',
        ],
    }
    for name, expected in sentences.items():
        page = PAGE.with_name(name).read_text()
        assert [sentence for sentence in expected if sentence not in page] == []
        assert {*map(float, re.findall(r'above (\d+) N', page))} == {limits.force_limit_n}


def test_each_step_of_the_table_is_the_period_of_the_explorer():
    assert f'each step, {1e3 * PERIOD_S:g} ms' in limit_table()
