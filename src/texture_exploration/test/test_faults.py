"""What befalls a robot in the middle of a slide: told in time and in words, and the next exploration works."""

import re
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager

import pytest

from texture_core.exploration import ExplorationRequest, Phase
from texture_exploration.arms.in_hand import InHandArm, InHandParams
from texture_exploration.arms.rails import RailsArm, RailsParams
from texture_exploration.arms.ur import UrArm, UrArmParams
from texture_exploration.explorer import Explorer
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits
from texture_simulation.devices.dynamixel import LEAP_IDS, LEAP_PRESSING, DynamixelMotors, EmulatedDynamixelBus
from texture_simulation.devices.rails import EmulatedRails, RailsMachine
from texture_simulation.devices.ur.params import UrControllerParams
from texture_simulation.devices.ur.process import ControllerProcess

DEADLINE_S = 30.0
BUSY_S = 0.5  # a machine that stalls tells later; the figures are recorded
HEIGHT_M = 0.003
UR = UrControllerParams(ip='127.0.0.56', start_height_m=HEIGHT_M, force_offset_n=0.0, unlock_delay_s=0.2)
SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.04)
RUB = ExplorationRequest('in_hand_sliding', speed_m_s=0.02, force_n=1.0, duration_s=1.5)
TOUCH = TouchParams(approach_speed_m_s=0.02, speed_tolerance=0.3, force_tolerance=0.2)


@contextmanager
def ur(_folder):
    with ControllerProcess(UR) as controller:
        yield controller, UrArm(UrArmParams(ip=UR.ip, unlock_protective_stop=True)), SLIDE


@contextmanager
def rails(folder):
    with EmulatedRails(folder / 'rails', RailsMachine(start_height_m=HEIGHT_M)) as device:
        yield device, RailsArm(RailsParams(device=str(device.port.link), height_m=HEIGHT_M)), SLIDE


@contextmanager
def hand(folder):
    with EmulatedDynamixelBus(folder / 'bus', DynamixelMotors(list(LEAP_IDS), LEAP_PRESSING)) as bus:
        yield bus, InHandArm(InHandParams(hand='dynamixel', device=str(bus.port.link), grip_timeout_s=20.0)), RUB


def nothing(_device):
    pass


def lose(motor):
    return lambda bus: setattr(bus.motors, 'absent', motor)


# Robot, module it needs, what happens, how it is mended, what is told, and how soon at most.
FAULTS = {
    'ur freezes': (ur, 'rtde_control', ControllerProcess.freeze, ControllerProcess.thaw, 'silent|not answered', 0.16),
    'ur dies': (ur, 'rtde_control', ControllerProcess.stop, ControllerProcess.start, 'lost|silent|not answered', 0.16),
    'ur stops protectively': (
        ur, 'rtde_control', lambda c: c.ask('emulate protective stop'), nothing, 'protective stop', 0.1,
    ),
    'ur is stopped by hand': (ur, 'rtde_control', lambda c: c.ask('stop'), nothing, 'its control program', 0.1),
    'rails lose their cable': (rails, 'serial', EmulatedRails.unplug, EmulatedRails.plug, 'cannot be reached', 0.1),
    'rails fall silent': (
        rails, 'serial', lambda r: setattr(r, 'mute', True), lambda r: setattr(r, 'mute', False), 'not answered', 0.17,
    ),
    'rails meet something': (
        rails,
        'serial',
        lambda r: setattr(r.firmware, 'machine', RailsMachine(start_height_m=HEIGHT_M, stalled=True)),
        lambda r: setattr(r.firmware, 'machine', RailsMachine(start_height_m=HEIGHT_M)),
        'does not follow its motor',
        0.1,
    ),
    'a hand loses a sliding motor': (hand, 'dynamixel_sdk', lose({0}), lose(set()), 'motor 0 .* does not answer', 0.15),
    'a hand loses a holding motor': (hand, 'dynamixel_sdk', lose({13}), lose(set()), 'motor 13 .* not answer', 0.15),
    'a hand loses its cable': (
        hand, 'dynamixel_sdk', EmulatedDynamixelBus.unplug, EmulatedDynamixelBus.plug, 'cannot be reached', 0.1,
    ),
}  # fmt: skip


def explored(explorer, request, on_slide=None):
    """Return the exploration, after doing something in the middle of its slide, and when that was, in ns."""
    exploration = explorer.begin('one', request)
    done_ns = 0
    while not exploration.ended.wait(0.002):
        if on_slide and not done_ns and exploration.state.phase is Phase.SLIDE:
            done_ns = time.monotonic_ns()
            on_slide()
    return exploration, done_ns


@pytest.mark.parametrize('name', FAULTS)
def test_a_fault_in_the_slide_is_told_in_time_and_the_next_exploration_works(name, tmp_path, record_property):
    robot, module, happens, mended, told, soon_s = FAULTS[name]
    pytest.importorskip(module)
    with ExitStack() as open_now:
        device, arm, request = open_now.enter_context(robot(tmp_path))
        # On a busy machine, too, the motor that is silent shall be named.
        limits = SafetyLimits(stale_s=0.4) if robot is hand else SafetyLimits()
        explorer = Explorer(arm, TOUCH, limits, lambda state: None)
        open_now.callback(explorer.close)
        explorer.connect()
        exploration, since_ns = explored(explorer, request, lambda: happens(device))
        outcome = exploration.outcome
        assert (outcome.success, outcome.slid, exploration.state.phase) == (False, True, Phase.ABORTED), outcome
        detected_s = (exploration.state.stamp_ns - since_ns) * 1e-9
        record_property('detected_s', detected_s)
        print(f'{name}: {detected_s * 1e3:.0f} ms: {outcome.message}')
        assert re.search(told, outcome.message), outcome.message
        assert detected_s < soon_s + BUSY_S
        mended(device)
        explorer.limits = SafetyLimits(stale_s=1.0)
        again, _ = explored(explorer, request)
        assert again.outcome.success, again.outcome.message


KILLED = """
from texture_exploration.arms.rails import RailsArm, RailsParams
from texture_exploration.explorer import Explorer
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits
from texture_core.exploration import ExplorationRequest
import sys
explorer = Explorer(RailsArm(RailsParams(device=sys.argv[1])), TouchParams(), SafetyLimits(stale_s=1.0), lambda s: None)
explorer.connect()
explorer.begin('one', ExplorationRequest('linear_slide', speed_m_s=0.05, distance_m=0.15)).ended.wait()
"""


def test_when_the_explorer_is_killed_in_the_slide_the_rails_stop_by_themselves(tmp_path, record_property):
    def until(condition):
        deadline = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < deadline
            time.sleep(0.002)

    with EmulatedRails(tmp_path / 'rails') as rails_there:
        firmware = rails_there.firmware
        with subprocess.Popen([sys.executable, '-c', KILLED, str(rails_there.port.link)]) as explorer:
            until(lambda: firmware.velocity[0] > 0.045)
            explorer.send_signal(signal.SIGKILL)
            begin_s = time.monotonic()
        until(lambda: not firmware.velocity.any())
        stopped_s = time.monotonic() - begin_s
        record_property('stopped_s', stopped_s)
        print(f'rails stopped {stopped_s * 1e3:.0f} ms after the death of the explorer')
        assert firmware.watchdog_stops == 1
        assert stopped_s < 0.2 + BUSY_S
        arm = RailsArm(RailsParams(device=str(rails_there.port.link)))
        explorer = Explorer(arm, TOUCH, SafetyLimits(stale_s=1.0), lambda state: None)
        explorer.connect()
        assert explored(explorer, SLIDE)[0].outcome.success
        explorer.close()
