# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A hand of Dynamixel motors as an arm: some fingers hold, and the others slide as one."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from texture_core.config import find, param
from texture_core.errors import CommandRefused, DeviceError
from texture_core.types import DEVICES
from texture_exploration.arms.arm import STANDSTILL, Arm, ArmCommand, ArmState, Vector, check_command
from texture_exploration.arms.dynamixel import DynamixelBus, MotorState
from texture_exploration.arms.hand import ROLES, FingerSet, Joint, Profile, load_profile

# --------------------
# Motors in current-based position mode: the position leads, the current bounds the force.

FIRST_STATE_S = 15.0  # some 15 requests to each motor, which take 16 ms each with a USB adapter as delivered
COMMAND_S = 0.2  # time for which a command holds
CLOSING_M_S = 0.02  # speed of a finger that comes down to press
REACH_RAD = 0.3  # largest depth of the goal of a pressing motor within the object
SLACK_RAD = 0.2  # largest distance between the goal and a blocked motor
CATCH_UP, LONGEST_LAG_S = 1.25, 0.1  # a finger makes good a late cycle by a speed that is so much higher: no jerk
NOT_CONNECTED = 'the hand is not connected; connect it first'
HELD_FRACTION = 0.8  # of the wanted force: a finger that presses with it holds the object
LOST_FRACTION = 0.5  # one that presses less has lost it
SAMPLE_PERIOD_S = 0.01


@dataclass(frozen=True)
class InHandParams:
    """Parameters of the hand and of its grip."""

    finger_set: str = param('kaboli-train', 'Finger set of the hand: which fingers hold and which slide.')
    grip_force_n: float = param(2.0, 'Force with which each holding finger presses.', unit='N', low=0.1, high=20.0)
    grip_timeout_s: float = param(
        3.0, 'How long the fingers may take to grip the object before connecting fails.', unit='s', low=0.1, high=30.0
    )
    profile: str = param('leap', 'Profile of the hand: the name of a shipped one or the path of a file.')
    device: str = param(f'{DEVICES}/dynamixel', 'Path of the serial device of the hand.')


class Fingertip(NamedTuple):
    """Position, velocity and force of one fingertip, in the frame of its patch of the object; see `ArmState`."""

    position: Vector
    velocity: Vector
    force_n: float


class HandState(NamedTuple):
    """All fingertips at one time of CLOCK_MONOTONIC; `fault` says why the hand cannot move, '' if it can."""

    time_ns: int
    fingers: Mapping[str, Fingertip]
    fault: str


class InHandArm(Arm):
    """A Dynamixel hand: some fingers hold once connected, the others slide.

    The state is the mean of the sliding fingers. A holding finger that presses with less than half of the wanted force
    is a fault.

    One thread owns the bus. A motor that is missing or reports an error is named in the fault of the state until the
    hand is connected again; the others go on. However the thread or the process ends, the torque is switched off: by
    the thread itself, by a guard process when the process is gone; and without a message for the time in the profile,
    the Bus Watchdog of the motors stops them.
    """

    Params = InHandParams

    def __init__(self, params: InHandParams = InHandParams()) -> None:
        self._params = params
        self.profile: Profile = load_profile(params.profile)
        self.fingers: FingerSet = find(self.profile.finger_sets, params.finger_set, 'finger set')
        self._fingers = {name: DynamixelFinger(joints, self.profile) for name, joints in self.profile.fingers.items()}
        self._state: HandState | None = None
        self._failure = NOT_CONNECTED
        self._rebooted = False  # since the last connection
        self._highest_a: Mapping[int, float] = {}
        self._grips = False
        self._command = (STANDSTILL, 0.0)  # of the sliding fingers, and when it came
        self._fresh = threading.Event()
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None

    def connect(self) -> None:
        """Open the bus, find the motors, whose present pose is the start of the fingers, and grip the object."""
        self.close()
        self._closing.clear()
        self._fresh.clear()
        self._failure = ''
        self._thread = threading.Thread(target=self._run, name='dynamixel', daemon=True)
        self._thread.start()
        try:
            if not self._fresh.wait(FIRST_STATE_S) or self._failure:
                partly = f"the motors on '{self._params.device}' answer only partly; check the cables"
                raise DeviceError(self._failure or partly)
            self._take_hold()
        except BaseException:
            self.close()  # a hand that is not connected holds nothing
            raise

    def close(self) -> None:
        """Release the object: torque off, and close the bus."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._grips, self._command = False, (STANDSTILL, 0.0)
        self._failure = self._failure or NOT_CONNECTED

    def state(self) -> ArmState:
        """Return the mean of the sliding fingers.

        Raises
        ------
        DeviceError
            If the hand is not connected or does not answer.
        """
        hand = self._hand()
        tips = [hand.fingers[name] for name in self.fingers.slide]
        weak = self._weak(hand, LOST_FRACTION)
        return ArmState(
            time_ns=hand.time_ns,
            position=_mean([tip.position for tip in tips]),
            velocity=_mean([tip.velocity for tip in tips]),
            force_n=sum(tip.force_n for tip in tips) / len(tips),
            fault=hand.fault or (f'the grip is lost: {weak}' if weak else ''),
        )

    def command(self, command: ArmCommand) -> None:
        """Let the sliding fingers follow from the next cycle on.

        Raises
        ------
        DeviceError
            If the hand is not connected.
        CommandRefused
            If the command is beyond the limits of the arm or the current of a motor; the fingers stop.
        """
        if self._failure:
            raise DeviceError(self._failure)
        self._check(self.fingers.slide, command)
        self._command = (command, time.monotonic())

    def stop(self) -> None:
        """Stop the sliding fingers; the others keep holding."""
        self.command(STANDSTILL)

    def recover(self) -> None:
        """Release the object, reboot the motors that report a hardware error, and stay unconnected."""
        self.close()
        bus = DynamixelBus(self._params.device, self.profile)
        try:
            bus.reboot()
            self._rebooted = True
        finally:
            bus.close()

    def _hand(self) -> HandState:
        """Return the newest state of all fingers."""
        if self._failure or self._state is None:
            raise DeviceError(self._failure)
        return self._state

    def _take_hold(self) -> None:
        self._check(self.fingers.hold, ArmCommand(force_n=self._params.grip_force_n))
        self._grips = True
        end_s = time.monotonic() + self._params.grip_timeout_s
        while weak := self._weak(self._hand(), HELD_FRACTION):
            if time.monotonic() > end_s:
                raise DeviceError(f'there is nothing to hold: {weak}; give the hand an object')
            time.sleep(SAMPLE_PERIOD_S)

    def _weak(self, hand: HandState, fraction: float) -> str:
        """Return which holding finger presses with less than a fraction of the wanted force, '' if none."""
        wanted = self._params.grip_force_n
        weak = [name for name in self.fingers.hold if hand.fingers[name].force_n < fraction * wanted]
        return ', '.join(f'{name} presses with {hand.fingers[name].force_n:.2f} N of {wanted:g} N' for name in weak)

    def _rest(self) -> None:
        self._command = (STANDSTILL, 0.0)

    def _check(self, fingers: Iterable[str], command: ArmCommand) -> None:
        """Refuse a command beyond its limits or beyond the current of a motor; the fingers stop."""
        check_command(command, self._rest)
        for name in fingers:
            joint, profile = self.profile.fingers[name]['press'], self.profile
            highest_a = self._highest_a.get(joint.id, math.inf)
            highest_n = (highest_a - profile.idle_a) * profile.torque_nm_a / abs(joint.lever_m)
            if command.force_n is not None and command.force_n > highest_n:
                self._rest()
                raise CommandRefused(
                    f'the command was refused and {name} stopped: the force is {command.force_n:g} N, and the Current '
                    f'Limit of its motor allows {highest_n:.3g} N; ask for less, or raise that limit with DYNAMIXEL '
                    'Wizard'
                )

    def _run(self) -> None:
        bus = guard = None
        try:
            bus = DynamixelBus(self._params.device, self.profile)
            guard = bus.guard()
            self._highest_a = bus.limits_a
            bus.start(rebooted=self._rebooted)
            self._rebooted = False
            self._control_loop(bus)
        except DeviceError as error:
            self._failure = str(error)
        except BaseException as error:
            # Also an error of this program must neither leave the motors pressing nor pass in silence.
            self._failure = f'the hand was released after an error in its program ({type(error).__name__}: {error})'
            raise
        finally:
            if bus is not None:
                bus.let_go()
                bus.close()
            if guard is not None:
                guard.dismiss()
            self._fresh.set()

    def _control_loop(self, bus: DynamixelBus) -> None:
        """Read, decide and write, in one cycle after the other."""
        period_s = 1.0 / self.profile.rate_hz
        for finger in self._fingers.values():
            finger.restart()
        now_s = stepped_s = time.monotonic()
        errors, lag_s = dict[str, None](), 0.0  # and for how long the fingers still have to move
        while not self._closing.wait(max(0.0, now_s + period_s - time.monotonic())):
            now_s, asked_ns = time.monotonic(), time.monotonic_ns()  # motors answer soon, a busy machine reads it late
            motors = bus.read()
            if not motors:
                if bus.missing and self._fresh.is_set():
                    self._publish(bus, errors, asked_ns)  # at once: before the others have been read again
                continue
            if error := bus.check_next():
                errors[error] = None
            lag_s, stepped_s = min(LONGEST_LAG_S, lag_s + now_s - stepped_s), now_s
            step_s = min(CATCH_UP * period_s, lag_s)
            lag_s -= step_s
            goals = self._step(motors, step_s, now_s)
            self._publish(bus, errors, asked_ns)
            bus.write_goals(goals)

    def _step(self, motors: Mapping[int, MotorState], dt_s: float, now_s: float) -> dict[int, tuple[float, float]]:
        command, given_s = self._command
        slides = command if now_s - given_s <= COMMAND_S else STANDSTILL
        grip = ArmCommand(force_n=self._params.grip_force_n) if self._grips else STANDSTILL
        commands = {**dict.fromkeys(self.fingers.slide, slides), **dict.fromkeys(self.fingers.hold, grip)}
        goals: dict[int, tuple[float, float]] = {}
        for name, finger in self._fingers.items():
            finger.measure(motors)
            goals.update(finger.goals(commands.get(name, STANDSTILL), dt_s))
        return goals

    def _publish(self, bus: DynamixelBus, errors: Iterable[str], asked_ns: int) -> None:
        fault = '; '.join(dict.fromkeys([*map(bus.why_missing, sorted(bus.missing)), *errors]))
        self._state = HandState(asked_ns, {name: finger.tip for name, finger in self._fingers.items()}, fault)
        self._fresh.set()


class DynamixelFinger:
    """Angles and currents of a finger's motors, as a fingertip and back.

    The levers turn angles into ways around the pose at the start; across and along are arcs that are taken as straight.
    """

    def __init__(self, joints: Mapping[str, Joint], profile: Profile) -> None:
        self._joints = joints
        self._profile = profile
        self.restart()

    def restart(self) -> None:
        """The next measurement is the pose at the start."""
        self._motors: dict[str, MotorState] = {}
        self._start: dict[str, float] = {}
        self._goal: dict[str, float] = {}
        self._pressing = False

    def measure(self, motors: Mapping[int, MotorState]) -> None:
        """Take the measurements of the motors; a missing one keeps its last."""
        for role, joint in self._joints.items():
            motor = motors.get(joint.id)
            if motor is not None:
                self._motors[role] = motor
                self._start.setdefault(role, motor.position_rad)
                self._goal.setdefault(role, motor.position_rad)

    @property
    def tip(self) -> Fingertip:
        """Place, speed and force."""
        ways, speeds = dict.fromkeys(ROLES, 0.0), dict.fromkeys(ROLES, 0.0)
        for role, motor in self._motors.items():
            lever_m = self._joints[role].lever_m
            ways[role] = (motor.position_rad - self._start[role]) * lever_m
            speeds[role] = motor.velocity_rad_s * lever_m
        place = (ways['across'], ways['along'], self._profile.start_height_m - ways['press'])
        return Fingertip(place, (speeds['across'], speeds['along'], -speeds['press']), self._force_n())

    def goals(self, command: ArmCommand, dt_s: float) -> dict[int, tuple[float, float]]:
        """Return highest current and position for each motor."""
        profile = self._profile
        speeds = dict(zip(('across', 'along'), command.tangential_m_s, strict=True))
        goals = {}
        for role, joint in self._joints.items():
            if role not in self._goal:
                continue
            if role == 'press':
                goals[joint.id] = self._press(command, joint, dt_s)
            else:
                self._advance(role, speeds[role] * dt_s / joint.lever_m, SLACK_RAD)
                goals[joint.id] = (profile.move_a, self._goal[role])
        return goals

    def _press(self, command: ArmCommand, joint: Joint, dt_s: float) -> tuple[float, float]:
        """Pressing, the goal lies within the object and the current bounds the force; else the position leads."""
        pressing = command.force_n is not None
        if self._pressing and not pressing:
            self._goal['press'] = self._motors['press'].position_rad
        self._pressing = pressing
        if command.force_n is None:
            self._advance('press', -command.normal_m_s * dt_s / joint.lever_m, SLACK_RAD)
            return self._profile.move_a, self._goal['press']
        self._advance('press', CLOSING_M_S * dt_s / joint.lever_m, REACH_RAD)
        current_a = self._profile.idle_a + command.force_n * abs(joint.lever_m) / self._profile.torque_nm_a
        return current_a, self._goal['press']

    def _advance(self, role: str, angle_rad: float, max_lead_rad: float) -> None:
        at = self._motors[role].position_rad
        self._goal[role] = min(at + max_lead_rad, max(at - max_lead_rad, self._goal[role] + angle_rad))

    def _force_n(self) -> float:
        if 'press' not in self._motors:
            return 0.0
        lever = self._joints['press'].lever_m
        pressing_a = math.copysign(self._motors['press'].current_a, self._motors['press'].current_a * lever)
        return max(0.0, pressing_a - self._profile.idle_a) * self._profile.torque_nm_a / abs(lever)


def _mean(vectors: list[Vector]) -> Vector:
    x, y, z = (sum(axis) / len(vectors) for axis in zip(*vectors, strict=True))
    return x, y, z
