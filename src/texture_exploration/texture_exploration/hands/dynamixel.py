"""A hand of Dynamixel motors in current-based position mode: the position leads, the current bounds the force."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from texture_core.errors import CommandRefused, DeviceError
from texture_exploration.arms.command_limits import CommandLimits
from texture_exploration.arms.protocol import ArmCommand
from texture_exploration.hands.dynamixel_bus import DynamixelBus, MotorState
from texture_exploration.hands.profile import Joint, Profile, load_profile
from texture_exploration.hands.protocol import FingerSet, Fingertip, HandState
from texture_exploration.hands.torque_guard import TorqueGuard, torque_off_packet

FIRST_STATE_S = 15.0  # some 15 questions to each motor, which take 16 ms each with a USB adapter as delivered
COMMAND_S = 0.2  # a command holds so long
CLOSING_M_S = 0.02  # a finger that shall press comes down so fast
REACH_RAD = 0.3  # the goal of a pressing motor lies at most so far within the object
SLACK_RAD = 0.2  # a goal runs away from a motor that is held up by at most so much
SEARCH_S = 2.0  # one missing motor is looked for so often: it costs 34 ms of silence
LONGEST_STEP_S = 0.05
RATE_CYCLES = 40  # the rate is measured over so many
SLOW_SHARE = 0.7  # of the rate of the profile; a bus that makes less is told
LATENCY_FILE = '/sys/class/tty/{}/device/latency_timer'  # of adapters by FTDI, ms
STANDSTILL = ArmCommand()
LIMITS = CommandLimits()
NOT_CONNECTED = 'the hand is not connected; connect it first'


class DynamixelHand:
    """See `texture_exploration.hands.protocol.Hand`. One thread owns the bus.

    A motor that is missing or reports an error is named in the fault of the state; the others go on. However the thread
    or the process ends, the torque is switched off: by the thread itself, by a `TorqueGuard` when the process is gone;
    and if nobody speaks to the motors for the time in the profile, their Bus Watchdog stops them.

    Parameters
    ----------
    profile
        Name or path of a profile.
    device
        Serial device.
    torque_off_on_fault
        Let go when a motor reports an error or is missing.
    limits
        Of every single command.
    """

    def __init__(
        self, profile: str, device: str, torque_off_on_fault: bool = False, limits: CommandLimits = LIMITS
    ) -> None:
        self.profile: Profile = load_profile(profile)
        self.finger_sets: Mapping[str, FingerSet] = self.profile.finger_sets
        self._device = device
        self._torque_off = torque_off_on_fault
        self._limits = limits
        self._fingers = {name: DynamixelFinger(joints, self.profile) for name, joints in self.profile.fingers.items()}
        self._state: HandState | None = None
        self._failure = NOT_CONNECTED
        self._warning = self._doubt = ''
        self._highest_a: Mapping[int, float] = {}
        self._grip: Mapping[str, float] = {}
        self._commands: dict[str, tuple[ArmCommand, float]] = {}
        self._fresh = threading.Event()
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None

    def connect(self) -> None:
        """Open the bus and find the motors; the pose now is where the fingers begin.

        Raises
        ------
        DeviceError
            If the bus cannot be opened, or motors are missing, of another model or silent.
        """
        self.close()
        self._closing.clear()
        self._fresh.clear()
        self._failure = self._warning = self._doubt = ''
        self._thread = threading.Thread(target=self._run, name='dynamixel', daemon=True)
        self._thread.start()
        if not self._fresh.wait(FIRST_STATE_S) or self._failure:
            failure = self._failure or f"the motors on '{self._device}' answer only in part; check the cables"
            self.close()
            raise DeviceError(failure)

    def close(self) -> None:
        """Let go: torque off, and close the bus."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._grip, self._commands = {}, {}
        self._failure = self._failure or NOT_CONNECTED

    def state(self) -> HandState:
        """Return the newest state.

        Raises
        ------
        DeviceError
            If the hand is not connected, or the bus has failed.
        """
        if self._failure or self._state is None:
            raise DeviceError(self._failure)
        return self._state

    def warning(self) -> str:
        """Return what is not as it should be although the hand moves, '' if nothing."""
        return '; '.join(filter(None, (self._doubt, self._warning)))

    def grip(self, forces_n: Mapping[str, float]) -> None:
        """Press from the next cycle on."""
        for name, force_n in forces_n.items():
            self._check(name, ArmCommand(force_n=force_n))
        self._grip = dict(forces_n)

    def command(self, fingers: Sequence[str], command: ArmCommand) -> None:
        """Follow from the next cycle on; what is refused makes these fingers stand still.

        Raises
        ------
        DeviceError
            If the bus has failed.
        CommandRefused
            If the command is out of the limits of a finger.
        """
        if self._failure:
            raise DeviceError(self._failure)
        for name in fingers:
            self._check(name, command)
        self._order(fingers, command)

    def reboot(self) -> str:
        """Let go, reboot the motors that report a hardware error, and stay unconnected; return in words what was done.

        Raises
        ------
        DeviceError
            If the bus cannot be reached, or a motor still reports an error.
        """
        self.close()
        bus = DynamixelBus(self._device, self.profile)
        try:
            rebooted = bus.reboot()
        finally:
            bus.close()
        self._failure = NOT_CONNECTED
        if not rebooted:
            return 'no motor that answers reports an error; none was rebooted, and the hand let go'
        return f'rebooted: {", ".join(map(self.profile.owner, rebooted))}; the hand let go, the next request connects'

    def _order(self, fingers: Sequence[str], command: ArmCommand) -> None:
        for name in fingers:
            self._commands[name] = (command, time.monotonic())

    def _check(self, name: str, command: ArmCommand) -> None:
        """Refuse what exceeds the limits of commands or the current that the motor takes."""
        self._limits.check(command, lambda: self._order([name], STANDSTILL))
        highest_n = self._highest_n(name)
        if command.force_n is not None and command.force_n > highest_n:
            self._order([name], STANDSTILL)
            raise CommandRefused(
                f'the command was refused and {name} stopped: the force is {command.force_n:g} N, and the Current '
                f'Limit of its motor allows {highest_n:.3g} N; ask for less, or raise that limit with DYNAMIXEL Wizard'
            )

    def _highest_n(self, name: str) -> float:
        joint = self.profile.fingers[name]['press']
        highest_a = self._highest_a.get(joint.id, math.inf)
        return (highest_a - self.profile.idle_a) * self.profile.torque_nm_a / abs(joint.lever_m)

    def _run(self) -> None:
        bus = guard = None
        try:
            bus = DynamixelBus(self._device, self.profile)
            off = torque_off_packet(self.profile.table['torque_enable'][0], self.profile.ids)
            guard = TorqueGuard(self._device, self.profile.baud, off)
            self._highest_a = bus.limits_a
            bus.start()
            self._doubt = self._doubtful(bus.deaf)
            self._control_loop(bus)
        except DeviceError as error:
            self._failure = str(error)
        except BaseException as error:
            # Also an error of this program must neither leave the motors pressing nor pass in silence.
            self._failure = f'the hand was let go after an error in its program ({type(error).__name__}: {error})'
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
        now_s = stepped_s = searched_s = time.monotonic()
        errors: dict[str, None] = {}
        cycles: deque[float] = deque(maxlen=RATE_CYCLES)
        let_go = ''
        while not self._closing.wait(max(0.0, now_s + period_s - time.monotonic())):
            now_s = time.monotonic()
            if bus.missing and not let_go and now_s - searched_s > SEARCH_S:
                searched_s = now_s
                bus.look_for(min(bus.missing))
            motors = bus.read()
            if not motors:
                if bus.missing and self._fresh.is_set():
                    self._publish(let_go or self._fault(bus, errors))  # at once: before the others have been read again
                continue
            if error := bus.check_next():
                errors[error] = None
            fault = let_go or self._fault(bus, errors)
            goals = self._step(motors, min(LONGEST_STEP_S, now_s - stepped_s), now_s)
            stepped_s = now_s
            self._publish(fault)
            if fault and self._torque_off:
                let_go = fault  # stays: motors without torque follow nothing, even when the missing one is back
                bus.torque_off(self.profile.ids)
            else:
                bus.write_goals(goals)
            cycles.append(now_s)
            self._warning = self._slowness(cycles)

    def _doubtful(self, deaf: Iterable[int]) -> str:
        """Return what to say of motors whose watchdog may not stop them, '' if there are none."""
        numbers = ', '.join(map(str, sorted(deaf)))
        if not numbers or not self.profile.watchdog:
            return ''
        return (
            f'the watchdog of motors {numbers} may not stop them when the cable is out or the computer hangs: their '
            'firmware is known to go on; update it with DYNAMIXEL Wizard'
        )

    def _slowness(self, cycles: Sequence[float]) -> str:
        """Return what to say of the rate of the cycles that began at these times, '' if they are fast enough."""
        if len(cycles) < RATE_CYCLES:
            return self._warning
        rate_hz = (len(cycles) - 1) / (cycles[-1] - cycles[0])
        if rate_hz >= SLOW_SHARE * self.profile.rate_hz:
            return ''
        latency = Path(LATENCY_FILE.format(Path(self._device).resolve().name))
        adapter = f' (now {latency.read_text().strip()} ms)' if latency.is_file() else ''
        return (
            f'the bus makes {rate_hz:.0f} of {self.profile.rate_hz:g} cycles a second: set the latency timer of '
            f"the USB adapter to 1 ms{adapter}, raise the baud rate ({self.profile.baud}) or lower 'rate_hz' of the "
            f"profile '{self.profile.name}'"
        )

    def _step(self, motors: Mapping[int, MotorState], dt_s: float, now_s: float) -> dict[int, tuple[float, float]]:
        goals: dict[int, tuple[float, float]] = {}
        for name, finger in self._fingers.items():
            finger.measure(motors)
            command, given_s = self._commands.get(name, (STANDSTILL, now_s))
            if name in self._grip:
                command = ArmCommand(force_n=self._grip[name])
            elif now_s - given_s > COMMAND_S:
                command = STANDSTILL
            goals.update(finger.goals(command, dt_s))
        return goals

    def _fault(self, bus: DynamixelBus, errors: Iterable[str]) -> str:
        return '; '.join(dict.fromkeys([*map(bus.why_missing, sorted(bus.missing)), *errors]))

    def _publish(self, fault: str) -> None:
        tips = {name: finger.tip for name, finger in self._fingers.items()}
        self._state = HandState(time.monotonic_ns(), tips, fault)
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
        """Take what the motors measure; one that is missing keeps its last, and begins where it is when it is back."""
        for role, joint in self._joints.items():
            motor = motors.get(joint.id)
            if motor is None:
                self._goal.pop(role, None)  # of before it sagged or was turned: it would snap there
            else:
                self._motors[role] = motor
                self._start.setdefault(role, motor.position_rad)
                self._goal.setdefault(role, motor.position_rad)

    @property
    def tip(self) -> Fingertip:
        """Place, speed and force."""
        x, y, depth = (self._travel_m(role) for role in ('across', 'along', 'press'))
        vx, vy, down = (self._speed(role) for role in ('across', 'along', 'press'))
        return Fingertip((x, y, self._profile.start_height_m - depth), (vx, vy, -down), self._force_n())

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
        return self._profile.idle_a + command.force_n * abs(joint.lever_m) / self._profile.torque_nm_a, self._goal[
            'press'
        ]

    def _advance(self, role: str, angle_rad: float, max_lead_rad: float) -> None:
        at = self._motors[role].position_rad
        self._goal[role] = min(at + max_lead_rad, max(at - max_lead_rad, self._goal[role] + angle_rad))

    def _travel_m(self, role: str) -> float:
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
