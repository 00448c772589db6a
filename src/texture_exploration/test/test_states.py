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
from texture_exploration import force_control, guards, lift_first, safety, stages, surface, touch, watches
from texture_exploration.arms import arm, ros_controllers, tool_state
from texture_exploration.explorer import PERIOD_S
from texture_exploration.motions import MOTIONS

PAGE = Path(__file__).parents[3] / 'docs' / 'motion.md'


def table_below(heading, name=0):
    """Return the rows of a table of the page by the cell with the name, without it."""
    lines = PAGE.read_text(encoding='utf-8').partition(heading)[2].splitlines()[2:]
    rows = [[cell.strip(' `') for cell in line.strip('|').split('|')] for line in lines[: lines.index('')]]
    return {cells.pop(name): cells for cells in rows}


STATES = table_below('| state | commands')  # commands, end, and where an error leads
LIMITS = table_below('| quantity | default', name=-1)  # quantity, value, how fast, what follows


def kind(command):
    """Return which kind of command it is, in the words of the table."""
    if command.force_n is not None:
        return 'press'
    if command == arm.STANDSTILL:
        return 'rest'
    return 'along' if any(command.tangential_m_s) else 'up' if command.normal_m_s > 0 else 'down'


HAPPENS = {
    'nothing': (None, lambda table: None),
    'a force sensor that is zeroed late': (None, lambda table: None),
    'a stop in the slide': (Phase.SLIDE, lambda table: table.exploration.stop('enough')),
    'a stall': (Phase.SLIDE, lambda table: table.arm.jam()),
    'a push': (Phase.SLIDE, lambda table: table.arm.push(20.0)),
    'a frozen force': (Phase.CONTACT, lambda table: table.arm.freeze_force()),
    'something above the finger': (lift_first.Rise, lambda table: table.arm.push(8.0)),  # once it rises
}


@pytest.mark.parametrize('name', HAPPENS)
def test_each_state_commands_and_leads_to_what_its_row_says(make_table, monkeypatch, name):
    table, seen, entered = make_table(TableArmParams(start_height_m=0.003)), [], []
    where, happens = HAPPENS[name]
    if isinstance(where, Phase):
        table.when[where] = lambda: happens(table)
    plan, timed_step, begin = MOTIONS['linear_slide'], stages.Stage.timed_step, stages.Stage.begin
    zeroed_ns = table.now_ns + (3_000_000_000 if 'late' in name else 0)
    monkeypatch.setitem(
        MOTIONS, 'linear_slide', lambda *given: plan(*given).lift_first(lambda: table.now_ns >= zeroed_ns)
    )

    def noted(stage, time_ns, state):
        command = timed_step(stage, time_ns, state)
        if command is not None:
            if kind(command) == 'up' and type(stage) is where and not seen.count((where, 'up')):
                happens(table)
            seen.append((type(stage), kind(command)))
        return command

    monkeypatch.setattr(stages.Stage, 'timed_step', noted)
    monkeypatch.setattr(
        stages.Stage, 'begin', lambda stage, *given: (entered.append(type(stage)), begin(stage, *given))
    )
    table.explore(ExplorationRequest('linear_slide', distance_m=0.02))
    expected = [lift_first.GoBack] if where is lift_first.Rise else [lift_first.CalmDown, stages.LiftStage]
    assert {state for state, _ in seen} >= {lift_first.Rise, *expected}
    assert [(state.__name__, said) for state, said in seen if said not in STATES[state.__name__][0].split(', ')] == []
    order = [state for state in STATES if state != 'GoBack']
    if not where:
        assert [state.__name__ for state in entered] == order
        assert ((lift_first.CalmDown, 'up') in seen) is ('late' in name)
    for before, after in pairwise(state.__name__ for state in entered):
        follows = order[order.index(before) + 1 :][:1]
        assert after in follows or after.removesuffix('Stage') in STATES[before][2]


@pytest.mark.parametrize('name', [state for state in STATES if state not in ('GoBack', 'LiftStage')])
def test_a_stop_leads_from_each_state_to_what_its_row_says(make_table, monkeypatch, name):
    table, entered = make_table(TableArmParams(start_height_m=0.003)), []
    plan, begin = MOTIONS['linear_slide'], stages.Stage.begin
    monkeypatch.setitem(MOTIONS, 'linear_slide', lambda *given: plan(*given).lift_first(lambda: True))

    def begun(stage, *given):
        entered.append(type(stage).__name__)
        begin(stage, *given)
        if entered[-1] == name:
            table.exploration.stop('enough')

    monkeypatch.setattr(stages.Stage, 'begin', begun)
    table.arm.displace((0.01, 0.0, 0.0))  # off the start
    outcome = table.explore(ExplorationRequest('linear_slide', distance_m=0.02))
    assert (outcome.message, outcome.lifted, entered[-2:]) == ('enough', True, [name, 'LiftStage'])
    assert 'Lift' in STATES[name][2]


def values():
    """Return the value of each limit as the page writes it."""
    limits, touching = safety.SafetyLimits(), touch.TouchParams()
    low_m, high_m, wall_n = limits.z_low_m, limits.z_high_m, touch.WALL_SHARE * limits.force_limit_n
    stages_s = limits.approach_timeout_s, limits.contact_timeout_s, limits.slide_overtime_s, limits.lift_timeout_s
    speeds = arm.MOST_COMMAND_M_S, arm.MOST_NORMAL_COMMAND_M_S, arm.MOST_COMMAND_N
    return {
        'MOST_FORCE_N, MOST_M': f'finite, {safety.MOST_FORCE_N / 1e3:g} kN, {safety.MOST_M:g} m',
        'force_limit_n': f'{limits.force_limit_n:g} N',
        'WALL_SHARE': f'{touch.WALL_SHARE:g} × force_limit_n, {wall_n:g} N',
        'friction_limit': f'{limits.friction_limit:g} × normal + {limits.tangential_floor_n:g} N',
        'x_low_m to z_high_m': f'±{limits.x_high_m:g} m; {low_m:g} to {high_m:g} m',
        'surface_tolerance_m': f'{1e3 * limits.surface_tolerance_m:g} mm',
        'state_timeout_s': f'{limits.state_timeout_s:g} s',
        'signal_timeout_s': f'{guards.SignalWatchParams().signal_timeout_s:g} s',
        'frozen_force_s': f'{limits.frozen_force_s:g} s',
        'force_drift_fraction': f'{100 * limits.force_drift_fraction:g} %',
        'OVERSHOOT': f'{100 * watches.OVERSHOOT:g} % above the requested',
        'HARD, LATE_S': f'{force_control.HARD:g} × the impact at `max_stiffness_n_m`; '
        f'{1e3 * force_control.LATE_S:g} ms late',
        'peak_force_fraction': f'{100 * touching.peak_force_fraction:g} % above the requested',
        'peak_speed_fraction': f'{100 * touching.peak_speed_fraction:g} % above the requested',
        'lost_contact_s': f'{touching.lost_contact_s:g} s',
        'stall_s': f'{100 * touching.stall_speed_fraction:g} % in {touching.stall_s:g} s',
        'MOST_FORCE_SHARE': f'{100 * lift_first.MOST_FORCE_SHARE:g} % of force_limit_n',
        'approach_travel_m': f'{1e3 * touching.approach_travel_m:g} mm',
        'approach_timeout_s, …': f'{", ".join(f"{one:g}" for one in stages_s)} s',
        'MOST_COMMAND_M_S, …': f'{speeds[0]:g} m/s, {speeds[1]:g} m/s, {speeds[2]:g} N',
    }


def test_the_page_shows_the_states_and_the_limits_of_the_code():
    assert set(STATES) == {stage.__name__ for stage in stages.Stage.__subclasses__()}
    assert {name: cells[1].replace('−', '-') for name, cells in LIMITS.items()} == values()
    assert LIMITS['HARD, LATE_S'][2] == f'delay + {force_control.LATE_S + 2 * force_control.HALF_S:g} s'
    steps = {how_fast for _, _, how_fast, _ in LIMITS.values() if how_fast.startswith('each step')}
    assert steps == {f'each step, {1e3 * PERIOD_S:g} ms'}


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
            f'mean force off by {100 * mean:g} % (UR5e presets ',
            f'), speed by {100 * speed:g} %, peak by {100 * peak:g} %',
            f'after {1e3 * tool_state.FOLLOW_M:g} mm commanded and {1e-9 * tool_state.FOLLOW_NS:g} s, without a tenth',
            f'motion after {1e-9 * ros_controllers.RESTS_WITHIN_NS:g} s is a fault',
            f'guard, {1e3 * tool_state.HEARTBEAT_S:g} ms without heartbeat',
            f'touches too light, before zeroing, within {1e3 * surface.NARROWEST_M:g} mm of another',
            f'outside {safety.RANGES["speed_m_s"][0]:g} to {limits.max_speed_m_s:g} m/s, {limits.min_force_n:g} to '
            f'{limits.max_force_n:g} N',
        ],
    }
    for name, expected in sentences.items():
        page = PAGE.with_name(name).read_text()
        assert [sentence for sentence in expected if sentence not in page] == []
        assert {*map(float, re.findall(r'above (\d+) N', page))} == {limits.force_limit_n}
