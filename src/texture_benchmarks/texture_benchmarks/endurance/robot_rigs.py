"""The emulated robots of an endurance run: how each is started, made to fail and put right again."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, Protocol

from texture_benchmarks.endurance import emulated_hand, emulated_rails
from texture_benchmarks.endurance.emulated_process import EmulatedRobotProcess
from texture_benchmarks.endurance.robot_faults import (
    DROP_M,
    HAND,
    RAILS,
    ROBOT_FAULTS,
    SIMULATED_ARM,
    UR,
    PlannedRobotFault,
    RobotSession,
)
from texture_benchmarks.motion.robots_under_test import FingerLog
from texture_core.errors import DeviceError
from texture_exploration.motions.touch import TouchParams
from texture_simulation.devices.ur.params import UrControllerParams
from texture_simulation.devices.ur.process import ControllerProcess

UR_IP = '127.0.0.67'
ABOVE_PLANE_M = 0.008  # so much higher than the arm was told is the surface under the UR
ANOTHER_PROGRAM = 'external_control.urp'
OVERLOADED_MOTORS = (0, 1, 5, 9, 13)
UNLOCK_S = 5.5  # a protective stop is released on the pendant after this
OFF_S = 3.0  # after the end of the explorer motors must be off and robots at rest within
# On a busy machine an emulator or the explorer itself may be late; what is tested here is not that.
PATIENCE: Mapping[str, Any] = {'state_timeout_s': 1.0, 'watch_signal': False}
TOUCH = TouchParams()


class RobotRig(Protocol):
    """An emulated robot with its fault switches.

    `fingers` is what the emulator reports of the true force.
    """

    fingers: FingerLog

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Parameters of the explorer."""

    @property
    def program(self) -> Sequence[str]:
        """Command for the explorer instead of the installed executable; empty for that."""

    def __enter__(self) -> RobotRig: ...

    def __exit__(self, *_: object) -> None: ...

    def inject(self, fault: PlannedRobotFault, pid: int) -> str:
        """Inject a fault; `pid` is the explorer. Return its strength in words."""

    def restore(self, fault: PlannedRobotFault) -> None:
        """Remove what the fault changed around the robot, as a person at the robot would, once it rests."""

    def taken_over(self) -> str:
        """Return what became of a program of somebody else that is playing, '' if it was left alone."""

    def powered(self) -> str:
        """Return what still has torque or moves though the explorer has ended, '' if nothing."""


class SimulatedArmRig:
    """The simulated arm, which lives in the explorer; its surface has a step or an edge in some sessions."""

    program: Sequence[str] = ()

    def __init__(self, session: RobotSession) -> None:
        self.fingers = FingerLog()
        fault = ROBOT_FAULTS[SIMULATED_ARM][session.start_fault]
        self.parameters = {
            **PATIENCE, 'arm': 'simulated', 'finger_port': self.fingers.port, 'force_mode': session.force_mode,
            'seed': session.seed, **fault.surface,
        }  # fmt: skip
        self.actions: Mapping[str, Callable[[PlannedRobotFault, int], str]] = {
            'none': _do_nothing, 'surface': _do_nothing, 'kill': _kill, 'freeze': _freeze
        }  # fmt: skip

    def __enter__(self) -> SimulatedArmRig:
        self.fingers.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self.fingers.__exit__()

    def inject(self, fault: PlannedRobotFault, pid: int) -> str:
        """See `RobotRig.inject`."""
        return self.actions[ROBOT_FAULTS[SIMULATED_ARM][fault.name].action](fault, pid)

    def restore(self, fault: PlannedRobotFault) -> None:
        """The surface stays as it is."""

    def taken_over(self) -> str:
        """Return '': no other program can play."""
        return ''

    def powered(self) -> str:
        """Return '': the arm ends with the explorer."""
        return ''


class UrRig:
    """The emulated UR controller with a surface above the plane that the arm was told."""

    program: Sequence[str] = ()

    def __init__(self, session: RobotSession) -> None:
        self.fingers = FingerLog()
        self.parameters = {**PATIENCE, 'arm': 'ur', 'ip': UR_IP, 'silence_s': 1.0}
        self._session = session
        self._controller = ControllerProcess(
            UrControllerParams(
                ip=UR_IP,
                finger_port=self.fingers.port,
                surface_z_m=UrControllerParams().surface_z_m + ABOVE_PLANE_M,
                seed=session.seed,
            )
        )
        self._open = ExitStack()
        self.actions: Mapping[str, Callable[[PlannedRobotFault, int], str]] = {
            'none': _do_nothing, 'another program': _do_nothing, 'kill': _kill, 'freeze': _freeze,
            'freeze worker': _freeze_worker, 'protective stop': self._stop, 'slow': self._slow, 'drop': self._drop,
        }  # fmt: skip

    def __enter__(self) -> UrRig:
        self._open.enter_context(self.fingers)
        self._open.enter_context(self._controller)
        if ROBOT_FAULTS[UR][self._session.start_fault].action == 'another program':
            self._controller.ask(f'load {ANOTHER_PROGRAM}')
            self._controller.ask('play')
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def inject(self, fault: PlannedRobotFault, pid: int) -> str:
        """See `RobotRig.inject`."""
        return self.actions[ROBOT_FAULTS[UR][fault.name].action](fault, pid)

    def restore(self, fault: PlannedRobotFault) -> None:
        """See `RobotRig.restore`."""
        action = ROBOT_FAULTS[UR][fault.name].action
        if action == 'another program':
            self._controller.ask('stop')
        elif action == 'slow':
            self._controller.ask('emulate slow 0')
        elif action == 'protective stop':
            time.sleep(UNLOCK_S)
            self._controller.ask('unlock protective stop')
        elif action == 'drop':
            self._controller.ask('emulate drop 0')

    def taken_over(self) -> str:
        """Return the state of programs unless the other one still plays."""
        state = self._controller.ask('programState')
        return '' if state == f'PLAYING {ANOTHER_PROGRAM}' else state

    def powered(self) -> str:
        """Return that the robot still moves."""
        moving = not _until(lambda: _rests(self.fingers))
        return f'the robot moves: {self.fingers.fingers[-1]}' if moving else ''

    def _stop(self, _fault: PlannedRobotFault, _pid: int) -> str:
        return self._controller.ask('emulate protective stop')

    def _slow(self, fault: PlannedRobotFault, _pid: int) -> str:
        self._controller.ask(f'emulate slow {fault.strength:.3f}')
        return f'blocking calls are acknowledged after {1e3 * fault.strength:.0f} ms'

    def _drop(self, _fault: PlannedRobotFault, _pid: int) -> str:
        self._controller.ask(f'emulate drop {DROP_M}')
        return f'the surface drops by {1e3 * DROP_M:.0f} mm'


class HandRig:
    """The emulated LEAP hand, whose explorer has two errors that signals trigger."""

    program: Sequence[str] = (sys.executable, '-m', 'texture_benchmarks.endurance.ros.hand_explorer')

    def __init__(self, session: RobotSession) -> None:
        self.fingers = FingerLog()
        self._session = session
        self._folder = tempfile.TemporaryDirectory(prefix='endurance_hand_')
        self._hand = EmulatedRobotProcess(emulated_hand.__name__, Path(self._folder.name) / 'bus', self.fingers.port)
        # Motors report their speed and current in coarse steps: as in the launch file of the hand.
        self.parameters = {
            **PATIENCE, 'arm': 'hand', 'hand': 'dynamixel', 'device': str(self._hand.link), 'grip_timeout_s': 20.0,
            'speed_tolerance': 0.3, 'force_tolerance': 0.2,
        }  # fmt: skip
        self._open = ExitStack()
        self.actions: Mapping[str, Callable[[PlannedRobotFault, int], str]] = {
            'none': _do_nothing, 'kill': _kill, 'overload': self._overload, 'unplug': self._unplug, 'drop': self._drop,
            'exception': _signalled(signal.SIGUSR1, 'an exception is raised in the bus thread'),
            'NaN force': _signalled(signal.SIGUSR2, 'the next force goal is NaN'),
        }  # fmt: skip

    def __enter__(self) -> HandRig:
        self._open.callback(self._folder.cleanup)
        self._open.enter_context(self.fingers)
        self._open.enter_context(self._hand)
        if ROBOT_FAULTS[HAND][self._session.start_fault].action == 'overload':
            self._hand.ask(f'overload {self._motor()}')
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def inject(self, fault: PlannedRobotFault, pid: int) -> str:
        """See `RobotRig.inject`."""
        known = ROBOT_FAULTS[HAND][fault.name]
        return '' if fault.name == self._session.start_fault else self.actions[known.action](fault, pid)

    def restore(self, fault: PlannedRobotFault) -> None:
        """See `RobotRig.restore`."""
        if ROBOT_FAULTS[HAND][fault.name].action == 'drop':
            self._hand.ask(f'stiffness {emulated_hand.STIFFNESS_N_M}')

    def taken_over(self) -> str:
        """Return '': no other program can play."""
        return ''

    def powered(self) -> str:
        """Return the motors that have torque."""
        off = _until(lambda: not self._hand.ask('torque'))
        return '' if off else f'motors {self._hand.ask("torque")} have torque'

    def _motor(self) -> int:
        return OVERLOADED_MOTORS[self._session.seed % len(OVERLOADED_MOTORS)]

    def _overload(self, _fault: PlannedRobotFault, _pid: int) -> str:
        self._hand.ask(f'overload {self._motor()}')
        return f'motor {self._motor()}'

    def _unplug(self, fault: PlannedRobotFault, _pid: int) -> str:
        self._hand.ask('unplug')
        time.sleep(fault.strength)
        self._hand.ask('plug')
        return f'for {fault.strength:.2f} s'

    def _drop(self, _fault: PlannedRobotFault, _pid: int) -> str:
        self._hand.ask('stiffness 0')
        return 'the object is gone'


class RailsRig:
    """The emulated rails."""

    program: Sequence[str] = ()

    def __init__(self, session: RobotSession) -> None:
        self.fingers = FingerLog()
        self._folder = tempfile.TemporaryDirectory(prefix='endurance_rails_')
        self._rails = EmulatedRobotProcess(
            emulated_rails.__name__, Path(self._folder.name) / 'rails', self.fingers.port
        )
        height_m = emulated_rails.FREE.start_height_m
        self.parameters: Mapping[str, Any] = {
            **PATIENCE, 'arm': 'rails', 'device': str(self._rails.link), 'height_m': height_m
        }  # fmt: skip
        self._open = ExitStack()
        self.actions: Mapping[str, Callable[[PlannedRobotFault, int], str]] = {
            'none': _do_nothing, 'kill': _kill, 'unplug': self._unplug, 'silence': self._silence,
            'block': self._block, 'drop': self._drop,
        }  # fmt: skip

    def __enter__(self) -> RailsRig:
        self._open.callback(self._folder.cleanup)
        self._open.enter_context(self.fingers)
        self._open.enter_context(self._rails)
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def inject(self, fault: PlannedRobotFault, pid: int) -> str:
        """See `RobotRig.inject`."""
        return self.actions[ROBOT_FAULTS[RAILS][fault.name].action](fault, pid)

    def restore(self, fault: PlannedRobotFault) -> None:
        """See `RobotRig.restore`."""
        for command in ('block 0', 'drop 0'):
            self._rails.ask(command)

    def taken_over(self) -> str:
        """Return '': no other program can play."""
        return ''

    def powered(self) -> str:
        """Return that the rails still move."""
        moving = not _until(lambda: _rests(self.fingers))
        return f'the rails move: {self.fingers.fingers[-1]}' if moving else ''

    def _unplug(self, fault: PlannedRobotFault, _pid: int) -> str:
        return self._for_a_while('unplug', 'plug', fault.strength)

    def _silence(self, fault: PlannedRobotFault, _pid: int) -> str:
        return self._for_a_while('silent 1', 'silent 0', fault.strength)

    def _block(self, _fault: PlannedRobotFault, _pid: int) -> str:
        self._rails.ask('block 1')
        return 'the encoders do not follow the motors'

    def _drop(self, _fault: PlannedRobotFault, _pid: int) -> str:
        self._rails.ask(f'drop {DROP_M}')
        return f'the surface drops by {1e3 * DROP_M:.0f} mm'

    def _for_a_while(self, begin: str, end: str, seconds: float) -> str:
        self._rails.ask(begin)
        time.sleep(seconds)
        self._rails.ask(end)
        return f'for {seconds:.2f} s'


RIG_CLASSES: Mapping[str, Callable[[RobotSession], RobotRig]] = {
    UR: UrRig,
    HAND: HandRig,
    RAILS: RailsRig,
    SIMULATED_ARM: SimulatedArmRig,
}


def _rests(fingers: FingerLog) -> bool:
    finger = fingers.fingers[-1]
    return finger.vx_m_s == finger.vy_m_s == finger.vz_m_s == 0.0


def _do_nothing(_fault: PlannedRobotFault, _pid: int) -> str:
    return ''


def _kill(_fault: PlannedRobotFault, pid: int) -> str:
    os.kill(pid, signal.SIGKILL)
    return f'process {pid}'


def _freeze(fault: PlannedRobotFault, pid: int) -> str:
    """Stop a process for a while: it gives no commands."""
    os.kill(pid, signal.SIGSTOP)
    try:
        time.sleep(fault.strength)
    finally:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGCONT)
    return f'no command for {fault.strength:.2f} s'


def _freeze_worker(fault: PlannedRobotFault, pid: int) -> str:
    """Freeze the process that talks to the UR controller, so that the watchdog of the controller trips."""
    threads = Path(f'/proc/{pid}/task').iterdir()
    children = [child for thread in threads for child in (thread / 'children').read_text(encoding='ascii').split()]
    if not children:
        raise DeviceError('the explorer has no worker process that could be frozen')
    return _freeze(fault, int(children[0]))


def _signalled(number: int, told: str) -> Callable[[PlannedRobotFault, int], str]:
    def act(_fault: PlannedRobotFault, pid: int) -> str:
        os.kill(pid, number)
        return told

    return act


def _until(condition: Callable[[], bool]) -> bool:
    """Return whether a condition became true within `OFF_S`."""
    end_s = time.monotonic() + OFF_S
    while not condition():
        if time.monotonic() > end_s:
            return False
        time.sleep(0.02)
    return True
