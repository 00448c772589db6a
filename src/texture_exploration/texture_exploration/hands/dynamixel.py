"""A hand of Dynamixel motors in current-based position mode: the position leads, the current bounds the force."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterable, Mapping, Sequence

from texture_core.errors import DeviceError
from texture_exploration.arms.protocol import ArmCommand
from texture_exploration.hands.dynamixel_bus import DynamixelBus, Motor
from texture_exploration.hands.profile import Joint, Profile, load_profile
from texture_exploration.hands.protocol import FingerSet, Fingertip, HandState

FIRST_STATE_S = 5.0
COMMAND_S = 0.2  # a command holds so long
CLOSING_M_S = 0.02  # a finger that shall press comes down so fast
REACH_RAD = 0.3  # the goal of a pressing motor lies at most so far within the object
SLACK_RAD = 0.2  # a goal runs away from a motor that is held up by at most so much
SEARCH_S = 2.0  # one missing motor is looked for so often: it costs 34 ms of silence
LONGEST_STEP_S = 0.05
STANDSTILL = ArmCommand()


class DynamixelHand:
    """See `texture_exploration.hands.protocol.Hand`. One thread owns the bus.

    A motor that is missing or reports an error is named in the fault of the state; the others go on.

    Parameters
    ----------
    profile
        Name or path of a profile.
    device
        Serial device.
    torque_off_on_fault
        Let go when a motor reports an error or is missing.
    """

    def __init__(self, profile: str, device: str, torque_off_on_fault: bool = False) -> None:
        self.profile: Profile = load_profile(profile)
        self.finger_sets: Mapping[str, FingerSet] = self.profile.finger_sets
        self._device = device
        self._torque_off = torque_off_on_fault
        self._fingers = {name: Finger(joints, self.profile) for name, joints in self.profile.fingers.items()}
        self._state: HandState | None = None
        self._trouble = 'the hand is not connected; connect it first'
        self._grip: Mapping[str, float] = {}
        self._orders: dict[str, tuple[ArmCommand, float]] = {}
        self._fresh = threading.Event()
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None

    def connect(self) -> None:
        """Open the bus and find the motors; the pose now is where the fingers begin."""
        self.close()
        self._closing.clear()
        self._fresh.clear()
        self._trouble = ''
        self._thread = threading.Thread(target=self._run, name='dynamixel', daemon=True)
        self._thread.start()
        if not self._fresh.wait(FIRST_STATE_S) or self._trouble:
            trouble = self._trouble or f"the motors on '{self._device}' answer only in part; check the cables"
            self.close()
            raise DeviceError(trouble)

    def close(self) -> None:
        """Let go: torque off, and close the bus."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._grip, self._orders = {}, {}
        self._trouble = self._trouble or 'the hand is not connected; connect it first'

    def state(self) -> HandState:
        """Return the newest state."""
        if self._trouble or self._state is None:
            raise DeviceError(self._trouble)
        return self._state

    def grip(self, forces_n: Mapping[str, float]) -> None:
        """Press from the next cycle on."""
        self._grip = dict(forces_n)

    def command(self, fingers: Sequence[str], command: ArmCommand) -> None:
        """Follow from the next cycle on."""
        if self._trouble:
            raise DeviceError(self._trouble)
        for name in fingers:
            self._orders[name] = (command, time.monotonic())

    def _run(self) -> None:
        bus = None
        try:
            bus = DynamixelBus(self._device, self.profile)
            bus.start()
            self._lead(bus)
            bus.torque_off(self.profile.ids)
        except DeviceError as error:
            self._trouble = str(error)
            self._fresh.set()
        finally:
            if bus is not None:
                bus.close()

    def _lead(self, bus: DynamixelBus) -> None:
        """Read, decide and write, in one cycle after the other."""
        period_s = 1.0 / self.profile.rate_hz
        for finger in self._fingers.values():
            finger.restart()
        now_s = stepped_s = searched_s = time.monotonic()
        errors: dict[str, None] = {}
        while not self._closing.wait(max(0.0, now_s + period_s - time.monotonic())):
            now_s = time.monotonic()
            if bus.missing and now_s - searched_s > SEARCH_S:
                searched_s = now_s
                bus.look_for(min(bus.missing))
            motors = bus.read()
            if not motors:
                if bus.missing and self._fresh.is_set():
                    self._publish(self._fault(bus, errors))  # at once: before the others have been read again
                continue
            if error := bus.next_hardware_error():
                errors[error] = None
            fault = self._fault(bus, errors)
            goals = self._step(motors, min(LONGEST_STEP_S, now_s - stepped_s), now_s)
            stepped_s = now_s
            self._publish(fault)
            if fault and self._torque_off:
                bus.torque_off(self.profile.ids)
            else:
                bus.write_goals(goals)

    def _step(self, motors: Mapping[int, Motor], dt_s: float, now_s: float) -> dict[int, tuple[float, float]]:
        goals: dict[int, tuple[float, float]] = {}
        for name, finger in self._fingers.items():
            finger.measure(motors)
            command, given_s = self._orders.get(name, (STANDSTILL, now_s))
            if name in self._grip:
                command = ArmCommand(force_n=self._grip[name])
            elif now_s - given_s > COMMAND_S:
                command = STANDSTILL
            goals.update(finger.goals(command, dt_s))
        return goals

    def _fault(self, bus: DynamixelBus, errors: Iterable[str]) -> str:
        missing = [f'{self.profile.owner(motor)} does not answer' for motor in sorted(bus.missing)]
        return '; '.join([*missing, *errors])

    def _publish(self, fault: str) -> None:
        tips = {name: finger.tip for name, finger in self._fingers.items()}
        self._state = HandState(time.monotonic_ns(), tips, fault)
        self._fresh.set()


class Finger:
    """Angles and currents of a finger's motors, as a fingertip and back.

    The levers turn angles into ways around the pose at the start; across and along are arcs that are taken as straight.
    """

    def __init__(self, joints: Mapping[str, Joint], profile: Profile) -> None:
        self._joints = joints
        self._profile = profile
        self.restart()

    def restart(self) -> None:
        """The next measurement is the pose at the start."""
        self._motors: dict[str, Motor] = {}
        self._start: dict[str, float] = {}
        self._goal: dict[str, float] = {}
        self._pressing = False

    def measure(self, motors: Mapping[int, Motor]) -> None:
        """Take what the motors measure; one that is missing keeps its last."""
        for role, joint in self._joints.items():
            motor = motors.get(joint.id)
            if motor is not None:
                self._motors[role] = motor
                self._start.setdefault(role, motor.position_rad)
                self._goal.setdefault(role, motor.position_rad)

    @property
    def tip(self) -> Fingertip:
        """Place, speed and force."""
        x, y, depth = (self._way(role) for role in ('across', 'along', 'press'))
        vx, vy, down = (self._speed(role) for role in ('across', 'along', 'press'))
        return Fingertip((x, y, self._profile.start_height_m - depth), (vx, vy, -down), self._force_n())

    def goals(self, command: ArmCommand, dt_s: float) -> dict[int, tuple[float, float]]:
        """Return highest current and position for each motor."""
        profile = self._profile
        speeds = dict(zip(('across', 'along'), command.tangential_m_s, strict=True))
        goals = {}
        for role, joint in self._joints.items():
            if role not in self._motors:
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
        return self._profile.idle_a + command.force_n * abs(joint.lever_m) / self._profile.torque_nm_a, self._goal[
            'press'
        ]

    def _advance(self, role: str, angle_rad: float, ahead_rad: float) -> None:
        at = self._motors[role].position_rad
        self._goal[role] = min(at + ahead_rad, max(at - ahead_rad, self._goal[role] + angle_rad))

    def _way(self, role: str) -> float:
        if role not in self._motors:
            return 0.0
        return (self._motors[role].position_rad - self._start[role]) * self._joints[role].lever_m

    def _speed(self, role: str) -> float:
        return self._motors[role].velocity_rad_s * self._joints[role].lever_m if role in self._motors else 0.0

    def _force_n(self) -> float:
        if 'press' not in self._motors:
            return 0.0
        lever = self._joints['press'].lever_m
        pressing_a = math.copysign(self._motors['press'].current_a, self._motors['press'].current_a * lever)
        return max(0.0, pressing_a - self._profile.idle_a) * self._profile.torque_nm_a / abs(lever)
