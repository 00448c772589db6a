# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What happens when the finger loses the surface: it is noticed, named, and nothing of it counts as sliding."""

import math
from dataclasses import replace

import numpy as np
import pytest
from table_arm import Shape, TableArmParams

from texture_core.types import NANOSECONDS, ExplorationRequest, Phase, TactileSignal
from texture_exploration.arms.arm import ArmState
from texture_exploration.touch import TouchParams
from texture_exploration.watches import ContactLost, ContactWatch
from texture_features.windows import CutWindow, WindowParams, cut_recording

REQUEST = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.15)
DROP = Shape(step_m=-0.012)
EDGE_IN_SLIDE_M = 0.06
RATE_HZ = 1000.0
WINDOWS = WindowParams(length_s=0.1, hop_s=0.02)


def sliding(table):
    return [state for state in table.states if state.phase is Phase.SLIDE]


def windows_from(table, measured):
    """Cut a recording of the exploration; `measured` gives the samples at times, ns."""
    begin_ns, end_ns = table.states[0].stamp_ns, table.states[-1].stamp_ns
    times = np.arange(begin_ns, end_ns, round(NANOSECONDS / RATE_HZ))
    samples = np.asarray(measured(times), dtype=np.float32)[:, None]
    batches = [
        TactileSignal(int(times[first]), 's', ('touch',), (), RATE_HZ, first, samples[first : first + 5])
        for first in range(0, len(times), 5)
    ]
    return [one for one in cut_recording({'signal': batches}, table.states, WINDOWS) if isinstance(one, CutWindow)]


def least_touching(table):
    """Return the smallest fraction of a window in which the finger touched, and the number of windows."""
    stamps, forces = map(np.array, zip(*table.pressed, strict=True))
    windows = windows_from(table, lambda times: forces[np.searchsorted(stamps, times).clip(max=len(stamps) - 1)] > 0)
    return min(window.windows['signal'].samples.mean() for window in windows), len(windows)


@pytest.mark.parametrize(('force_n', 'touching'), [(0.51, True), (0.49, False), (0.05, False), (math.nan, False)])
def test_contact_is_lost_below_a_quarter_of_the_wanted_force(force_n, touching):
    watch = ContactWatch(2.0, TouchParams())
    watch.update(ArmState(1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), force_n))
    assert watch.touching == touching
    if not touching:
        with pytest.raises(ContactLost, match=r'lost for 100 ms: the force is \S+ N of 2 N'):
            watch.update(ArmState(100_000_001, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), force_n))


@pytest.mark.parametrize('shape', [DROP, Shape(edge_m=EDGE_IN_SLIDE_M)], ids=['a drop', 'an edge'])
@pytest.mark.parametrize('force_mode', [True, False])
def test_a_surface_that_is_lost_in_the_slide_aborts_with_its_reason(make_table, shape, force_mode):
    table = make_table(TableArmParams(force_mode=force_mode, start_height_m=0.002), shape=shape)
    outcome = table.explore(REQUEST)
    assert not outcome.success
    assert outcome.message.startswith('the contact with the surface was lost for 1')
    assert table.phases[-2:] == [Phase.LIFT, Phase.ABORTED]


def test_no_state_without_contact_guarantees_anything_and_no_window_is_cut_from_air(make_table):
    table = make_table(shape=DROP)
    table.explore(REQUEST)
    assert min(state.force_n for state in sliding(table)) < 0.1
    assert all(state.steady_s == 0.0 for state in sliding(table) if state.force_n < 0.1)
    fraction, windows = least_touching(table)
    assert windows > 10
    assert fraction >= 0.9  # a loss is known one step of the exploration after it happened, 10 ms


def test_a_rough_surface_that_the_finger_bounces_over_is_slid_on(make_table):
    table = make_table(touch=TouchParams(peak_force_fraction=3.0))  # it comes down hard after each bounce
    slid = []

    def bounce():
        if table.phases[-1:] == [Phase.SLIDE]:
            slid.append(table.now_ns)
        bounces = table.phases[-1:] == [Phase.SLIDE] and len(slid) % 50 < 6
        table.arm.push(-4.0 if bounces else 0.0)  # off the surface for 60 ms, twice a second

    table.at_each_step = bounce
    outcome = table.explore(REQUEST)
    assert outcome.success, outcome.message
    assert sum(state.steady_s == 0.0 for state in sliding(table)) > 10
    assert least_touching(table)[0] >= 0.9


@pytest.mark.parametrize(
    ('edge_m', 'success'),
    [
        (0.002, False),  # while it gains speed
        (0.150, False),  # 0.1 s before the end of the slide
        (0.160, True),  # while it brakes
    ],
)
def test_a_surface_that_ends_counts_only_if_the_slide_was_whole(make_table, edge_m, success):
    table = make_table(shape=Shape(edge_m=edge_m))
    outcome = table.explore(REQUEST)
    assert (outcome.success, table.arm.state().force_n) == (success, 0.0)
    if not success:
        assert 'the contact with the surface was lost' in outcome.message


def test_contact_lost_on_the_last_step_of_the_slide_is_no_success(make_table):
    whole = make_table()
    whole.explore(REQUEST)
    last_m = max(
        place[0] for state, place in zip(whole.states, whole.places, strict=True) if state.phase is Phase.SLIDE
    )
    table = make_table(shape=Shape(edge_m=last_m - 0.0002))
    outcome = table.explore(REQUEST)
    assert not outcome.success
    assert 'the contact with the surface was lost' in outcome.message


def test_finishing_while_the_contact_is_lost_is_no_success(make_table):
    table = make_table(shape=DROP)
    on_state = table.on_state

    def finish_in_the_air(state):
        on_state(state)
        if state.phase is Phase.SLIDE and state.force_n < 0.1:
            table.exploration.finish('the operator had enough')

    table.on_state = finish_in_the_air
    outcome = table.explore(REQUEST)
    assert not outcome.success
    assert 'the contact with the surface was lost' in outcome.message


@pytest.mark.parametrize(('force_mode', 'tilt_rad'), [(True, -0.1745), (True, 0.1745), (False, -0.02), (False, 0.02)])
def test_a_tilted_surface_is_not_lost(make_table, tilt_rad, force_mode):
    """By 10 degrees with a force mode, by 1 degree with one gain for the stiffest contact."""
    arm = TableArmParams(force_mode=force_mode, start_height_m=0.005)
    table = make_table(arm, shape=Shape(tilt_rad=tilt_rad))
    outcome = table.explore(replace(REQUEST, distance_m=0.05))
    assert outcome.success, outcome.message


def test_a_force_that_stays_just_above_the_limit_of_contact_is_no_success(make_table):
    table = make_table()
    pushed, rng = [0.0], np.random.default_rng(1)

    def hold():
        if table.phases[-1:] == [Phase.SLIDE]:
            pushed[0] += 0.3 + 0.001 * rng.standard_normal() - table.arm.true_force_n
            table.arm.push(pushed[0])

    table.at_each_step = hold
    outcome = table.explore(REQUEST)
    assert not outcome.success
    assert outcome.message.startswith(('the mean force of the slide was 0.', 'the contact with the surface was lost'))


def test_a_force_at_the_edge_of_its_tolerance_is_a_success(table, monkeypatch):
    monkeypatch.setattr(TableArmParams, 'admittance_m_s_n', 7e-4)
    table.when[Phase.SLIDE] = lambda: table.arm.push(-0.19)
    assert table.explore(REQUEST).success


@pytest.mark.parametrize(
    'request_',
    [
        ExplorationRequest('circular', speed_m_s=0.05, force_n=1.0, radius_m=0.02, turns=1.0, direction_rad=3.1416),
        ExplorationRequest('in_hand_sliding', speed_m_s=0.02, force_n=1.0, distance_m=0.03, duration_s=3.0),
    ],
    ids=lambda request_: request_.motion,
)
def test_circles_and_strokes_that_leave_the_surface_abort_too(make_table, request_):
    table = make_table(shape=Shape(edge_m=0.017))
    outcome = table.explore(request_)
    assert not outcome.success
    assert 'the contact with the surface was lost' in outcome.message
    assert all(state.steady_s == 0.0 for state in sliding(table) if state.force_n < 0.1)


def test_a_slope_that_the_force_loop_cannot_follow_is_named(make_table):
    table = make_table(TableArmParams(force_mode=False, start_height_m=0.005), shape=Shape(tilt_rad=0.1745))
    outcome = table.explore(replace(REQUEST, distance_m=0.05))
    assert outcome.message.startswith('the force reached 1.2')
    assert outcome.lifted


@pytest.mark.parametrize('peak_n', [1.86, 3.0])
def test_a_force_that_departs_in_the_slide_is_no_success_and_no_window_is_cut_from_it(table, peak_n, monkeypatch):
    monkeypatch.setattr(TableArmParams, 'admittance_m_s_n', 7e-4)  # it gives way slowly
    table.when[Phase.SLIDE] = lambda: setattr(table, 'pressed_ns', table.now_ns)
    table.pressed_ns = None

    def press():
        pressed_s = (table.now_ns - table.pressed_ns) * 1e-9 if table.pressed_ns else 0.0
        wanted_n = peak_n + 0.01 * math.sin(1e3 * pressed_s)  # a frozen force would be named instead
        table.arm.push(wanted_n - table.arm.true_force_n + table.arm.push_n if 0.5 < pressed_s < 0.65 else 0.0)

    table.at_each_step = press
    outcome = table.explore(ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.1))
    assert (outcome.success, outcome.slid) == (False, True)
    assert "1 N requested ('peak_force_fraction')" in outcome.message
    pressed = [state for state in sliding(table) if state.force_n > 1.5]
    assert len(pressed) > 5
    assert not any(state.steady_s for state in pressed[2:])
    windows = windows_from(table, lambda times: np.zeros(len(times)))
    assert len(windows) > 20
    spans = [(window.start_ns, window.start_ns + 100_000_000) for window in windows]
    assert not any(begin <= state.stamp_ns < end for begin, end in spans for state in pressed[2:])
