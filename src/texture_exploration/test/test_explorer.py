# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import importlib
import math
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from texture_core.errors import DeviceError, ExplorationError, MotionRefused, UnknownName
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms.simulated import SimulatedArm
from texture_exploration.explorer import Explorer
from texture_exploration.guards import SignalWatch
from texture_exploration.safety import SafetyLimits, SurfacePatch
from texture_exploration.touch import TouchParams

QUICK = ExplorationRequest('linear_slide', speed_m_s=0.1, distance_m=0.02)
SLOW = ExplorationRequest('linear_slide', speed_m_s=0.01, distance_m=0.1)
DEADLINE_S = 60.0


def test_explorations_follow_each_other(explorer):
    for name in ('one', 'two'):
        exploration = explorer.begin(name, QUICK)
        assert exploration.ended.wait(DEADLINE_S)
        assert exploration.outcome.success, exploration.outcome.message
    assert (explorer.counts['done'], explorer.counts['aborted'], explorer.counts['refused']) == (2, 0, 0)


def test_a_second_exploration_at_once_is_refused(explorer):
    explorer.table.gate.clear()
    explorer.begin('one', SLOW)
    with pytest.raises(MotionRefused, match="'one' is still running"):
        explorer.begin('two', QUICK)
    assert explorer.counts['refused'] == 1


def test_a_fault_in_a_users_planner_is_told_with_its_file_and_line(explorer, tmp_path, monkeypatch):
    file = tmp_path / 'users_planner.py'
    file.write_text('def plan(*_):\n    return 1 / 0\n')
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(UnknownName, match="no motion 'users_planner:plan'"):
        explorer.begin('one', ExplorationRequest('users_planner:plan'))
    assert 'users_planner' not in sys.modules  # a request over the network chooses no import
    explorer.motions = {'users_planner:plan': importlib.import_module('users_planner').plan}
    with pytest.raises(MotionRefused) as refused:
        explorer.begin('one', ExplorationRequest('users_planner:plan'))
    assert refused.value.error == ExplorationError.INVALID_REQUEST
    assert f'failed with ZeroDivisionError: division by zero ({file}:2); correct it there' in str(refused.value)


@pytest.mark.parametrize(
    'limits',
    [SafetyLimits(x_low_m=0.05), SafetyLimits(y_high_m=-0.02), SafetyLimits(z_low_m=0.05, surface_tolerance_m=0.06)],
)
def test_a_motion_that_would_begin_outside_the_workspace_is_refused(explorer, limits):
    """Beyond a limit no crossing of it is seen: a wrong pose of the surface would switch the workspace off."""
    explorer.limits = limits
    with pytest.raises(MotionRefused, match=r'lies outside the workspace: [xyz] is -?0\.0\d+ m, allowed is') as refused:
        explorer.begin('one', QUICK)
    assert refused.value.error == ExplorationError.OUTSIDE_WORKSPACE
    assert explorer.counts['refused'] == 1


def test_a_start_outside_names_every_axis_at_once_and_a_finger_brought_inside_begins_there(explorer):
    explorer.limits = SafetyLimits(x_low_m=0.05, z_high_m=0.001)
    both = r'x is 0\.0000 m, allowed is 0\.05 to 0\.2 m and z is 0\.0020 m, allowed is -0\.02 to 0\.001 m; bring'
    with pytest.raises(MotionRefused, match=both):
        explorer.check_start()
    with pytest.raises(MotionRefused, match=both):
        explorer.begin('one', QUICK)
    explorer.limits = SafetyLimits(x_low_m=0.05)
    explorer.arm.displace((0.06, 0.0, 0.0))
    exploration = explorer.begin('one', QUICK)
    assert exploration.ended.wait(DEADLINE_S)
    assert exploration.outcome.success, exploration.outcome.message
    explorer.check_start()


def test_stopping_lifts_the_finger(explorer):
    explorer.table.gate.clear()
    exploration = explorer.begin('one', SLOW)
    assert explorer.stop('enough') == 'stopping; the finger is being lifted'
    explorer.table.gate.set()
    assert exploration.ended.wait(DEADLINE_S)
    assert (exploration.outcome.message, explorer.counts['aborted']) == ('enough', 1)
    assert explorer.stop('again') == 'no exploration is running; earlier requests are cancelled'


@pytest.mark.parametrize(
    ('cancelled', 'ends'),
    [
        (False, [ExplorationError.STOPPED, ExplorationError.STOPPED, ExplorationError.INVALID_REQUEST]),
        (True, [ExplorationError.CANCELLED]),
    ],
)
def test_a_request_that_is_stopped_or_cancelled_while_it_waits_or_is_prepared_moves_nothing(
    explorer, monkeypatch, cancelled, ends
):
    connecting, connected, connect = threading.Event(), threading.Event(), explorer.arm.connect
    came, clock = [], explorer.clock
    monkeypatch.setattr(explorer, 'clock', lambda: (came.append(None), clock())[1])
    monkeypatch.setattr(explorer.arm, 'connect', lambda: (connecting.set(), connected.wait(60.0), connect()))
    explorer.arm.fail('protective stop')
    withdrawn = threading.Event()
    with ThreadPoolExecutor() as pool:
        asked = [pool.submit(explorer.begin, 'one', QUICK, withdrawn.is_set)]
        assert connecting.wait(60.0)
        if cancelled:
            withdrawn.set()
        else:  # two wait for the first one
            came.clear()
            asked += [pool.submit(explorer.begin, 'two', QUICK), pool.submit(explorer.lift)]
            while len(came) < 2:  # each reads the clock when it comes
                pass
            explorer.table.now_ns += 1
            assert 'earlier requests are cancelled' in explorer.stop('enough')
        connected.set()
        assert [one.exception(60.0).error for one in asked] == ends
    assert (explorer.table.states, explorer.current) == ([], None)
    assert explorer.begin('three', QUICK).ended.wait(DEADLINE_S)


@pytest.mark.parametrize(
    ('first_sample_s', 'stop_s', 'message'),
    [
        (0.3, math.inf, ''),
        (math.inf, math.inf, "no samples on 'signal' for 5"),
        (math.inf, 0.1, 'the request was stopped before anything moved'),
    ],
    ids=['a late one', 'none', 'none, and a stop'],
)
def test_nothing_moves_before_the_first_sample(explorer, first_sample_s, stop_s, message):
    table, watch = explorer.table, SignalWatch(0.5, lambda: explorer.table.now_ns)
    table.signal_fault = watch.signal_fault
    start_ns, home_m, seen = table.now_ns, explorer.arm.state().position, []

    def look():
        time_s = (table.now_ns - start_ns) * 1e-9
        if time_s >= first_sample_s:
            watch.on_samples()
        seen.append((time_s, explorer.arm.state().position))
        if time_s >= stop_s:
            explorer.stop('enough')

    table.at_each_step = look
    if message:
        with pytest.raises(MotionRefused, match=message):
            explorer.begin('one', QUICK)
    else:
        exploration = explorer.begin('one', QUICK)
        assert exploration.ended.wait(DEADLINE_S)
        assert exploration.outcome.success, exploration.outcome.message
    assert {place_m for time_s, place_m in seen if time_s < first_sample_s} == {home_m}


def test_an_arm_that_failed_is_connected_again_by_the_next_request(explorer):
    explorer.arm.fail('protective stop')
    assert explorer.fault() == 'the arm reports a fault: protective stop'
    exploration = explorer.begin('one', QUICK)
    assert exploration.ended.wait(DEADLINE_S)
    assert exploration.outcome.success, exploration.outcome.message


def test_recovering_frees_a_failed_arm_but_not_in_the_middle_of_an_exploration(explorer):
    explorer.arm.fail('protective stop')
    explorer.recover()
    assert explorer.fault() == ''
    explorer.table.gate.clear()
    explorer.begin('one', SLOW)
    with pytest.raises(MotionRefused, match="'one' is still running"):
        explorer.recover()


def test_closing_while_it_moves_lifts_the_finger_and_ends_the_thread(explorer, monkeypatch):
    """It closes at the third state of the slide, so that there is something to lift from; time rests until it does."""
    explorer.table.when[Phase.SLIDE] = explorer.table.gate.clear
    exploration = explorer.begin('one', SLOW)
    while explorer.table.gate.is_set():
        assert not exploration.ended.wait(0.001)
    stop = exploration.stop
    monkeypatch.setattr(exploration, 'stop', lambda reason: (stop(reason), explorer.table.gate.set()))
    explorer.close()
    assert exploration.outcome.message == 'the explorer was shut down'
    assert exploration.state.phase is Phase.ABORTED
    assert explorer.arm.state().position[2] > 0.001
    for opens in (lambda: None, explorer.connect):  # an activation that was under way does not open it again
        opens()
        with pytest.raises(MotionRefused, match='shutting down'):
            explorer.begin('two', QUICK)
    explorer.close()


class LostArm(SimulatedArm):
    def connect(self):
        raise DeviceError('the arm does not answer; check its cable')

    def state(self):
        raise DeviceError('not connected')


def test_an_arm_that_cannot_be_reached_refuses_in_a_sentence():
    explorer = Explorer(LostArm(), TouchParams(), SafetyLimits(), lambda state: None)
    with pytest.raises(MotionRefused, match='the arm is not ready: the arm does not answer'):
        explorer.begin('one', QUICK)
    assert explorer.fault() == 'not connected'


PATCH = SurfacePatch(-0.03, 0.05, -0.02, 0.02)
THERE = replace(QUICK, use_start=True, start_x_m=0.0, start_y_m=-0.02)


@pytest.mark.parametrize(
    ('patch', 'edges'),
    [
        (SurfacePatch(-0.03, 0.05, -0.02, 0.04), (-0.03, 0.05, -0.02, 0.04)),
        (SurfacePatch(-0.3, 0.05, -0.02, 0.04), (-0.1, 0.05, -0.02, 0.04)),
        (SurfacePatch(-0.03, 0.5, -0.02, 0.04), (-0.03, 0.11, -0.02, 0.04)),
        (SurfacePatch(-0.03, 0.05, -0.2, 0.04), (-0.03, 0.05, -0.12, 0.04)),
        (SurfacePatch(-0.03, 0.05, -0.02, 0.4), (-0.03, 0.05, -0.02, 0.13)),
    ],
)
def test_on_a_patch_the_workspace_along_the_surface_is_what_both_allow(patch, edges):
    limits = SafetyLimits(x_low_m=-0.1, x_high_m=0.11, y_low_m=-0.12, y_high_m=0.13)
    within = patch.within(limits)
    assert (within.x_low_m, within.x_high_m, within.y_low_m, within.y_high_m) == edges
    assert (within.z_low_m, within.z_high_m) == (limits.z_low_m, limits.z_high_m)


def test_an_exploration_begins_at_its_start_on_the_patch_and_lifts_there(explorer):
    explorer.patch = PATCH
    exploration = explorer.begin('one', THERE)
    assert exploration.ended.wait(DEADLINE_S)
    assert exploration.outcome.success, exploration.outcome.message
    states = explorer.table.states
    touched = next(state for state in states if state.phase is Phase.CONTACT)
    assert (touched.x_m, touched.y_m) == pytest.approx((0.0, -0.02), abs=0.001)
    travelling = [state for state in states if state.phase is Phase.APPROACH and abs(state.y_m) < 0.019]
    assert min(state.z_m for state in travelling) > 0.0015  # in free air
    end = explorer.arm.state().position
    assert end[0] > 0.02 and end[2] > 0.0015


@pytest.mark.parametrize(
    ('patch', 'start', 'said'),
    [
        (SurfacePatch(), {}, 'no surface patch is set'),
        (PATCH, {'start_x_m': 0.06}, r'start_x_m is 0\.06, off the surface patch; allowed is -0\.03 to 0\.05 m'),
        (PATCH, {'start_y_m': float('nan')}, 'start_y_m is nan, off the surface patch'),
        (PATCH, {'start_x_m': 0.045}, 'leaves the workspace.*the workspace of a request with a start is the surface'),
        (SurfacePatch(-0.03, 0.05, 0.3, 0.4), {'start_y_m': 0.35}, 'start_y_m is 0.35, off'),
    ],
)
def test_a_start_off_the_patch_or_a_slide_that_leaves_it_is_refused(explorer, patch, start, said):
    explorer.patch = patch
    with pytest.raises(MotionRefused, match=said):
        explorer.begin('one', replace(THERE, **start))
