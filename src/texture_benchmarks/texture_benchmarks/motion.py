# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How hard a finger presses in virtual time, on physics that shares no code with the suite."""

from __future__ import annotations

import math
import threading
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult, resumed
from texture_core.errors import ExplorationError, TextureError
from texture_core.types import ExplorationRequest, ExplorationState, Phase
from texture_exploration.arms.arm import Vector
from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.tool_state import ForceSample, PoseSample, RosControllersParams
from texture_exploration.exploration import Exploration
from texture_exploration.motions import MOTIONS
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams

# --------------------
# A trial: what is true, what is declared, and what happens.

STEP_NS = 1_000_000  # of the physics
PERIOD_NS = 4_000_000  # of the thread of the arm
EXPLORER_PERIODS = 2.5
WALL_N_M = 20_000.0
FRICTION = 0.3
OFFSET_N = (0.7, -0.2, 1.1)  # what the sensor shows in free air
LIMIT_N = SafetyLimits().force_limit_n
TOOL_DOWN = (1.0, 0.0, 0.0, 0.0)  # half a turn about x
AFTER_S = 1.0  # how long the arm is watched after the end
REST_S = 0.3  # after a break nothing may move
MOVING_M_S = 0.0005
RISE = 'rise'  # the part of the approach before the force sensor is zeroed


class ForceTrial(NamedTuple):
    """One exploration; in a phase a sample is `bad`, the link is broken for a time, or a second explorer begins."""

    name: str
    stiffness_n_m: float = 2000.0
    declared_n_m: float = 20000.0
    delay_s: float = 0.008
    noise_n: float = 0.003
    seed: int = 0
    wanted_n: float = 5.0
    speed_m_s: float = 0.02
    height_m: float = 0.002
    wall_m: float = math.inf
    fault: str = ''  # velocity sign, force sign, velocity axes, force axes, upside down
    late_force_s: float = 0.0  # with stamps of arrival
    phase: str = ''
    bad: str = ''  # field, index and value
    broken_s: float = 0.0
    found_s: float = 0.0  # after which two explorers see each other


class TrialEnd(NamedTuple):
    """What a trial came to: largest true forces, N, time above the limit, s, and how it ended."""

    normal_n: float
    sideways_n: float
    above_s: float
    end: str
    message: str
    moved_after_break: bool = False

    @property
    def named(self) -> bool:
        """Whether it succeeded or ended with a reason that is no error of the program."""
        return self.end != ExplorationError.INTERNAL.name and 'internal error' not in self.message


# --------------------
# The machine at the other end of the topics: a late integrator, a spring, friction, a wall; no code of the suite.


class VirtualMachine:
    """A robot that keeps executing the last velocity, over a plane at z = 0 of its base."""

    def __init__(self, trial: ForceTrial) -> None:
        self.now_ns = 1_000_000_000
        self.trial = trial
        self.place = [0.0, 0.0, trial.height_m]
        self.velocity = [0.0, 0.0, 0.0]
        self.normal_n = self.sideways_n = 0.0
        self.largest_n, self.largest_sideways_n, self.above_s = 0.0, 0.0, 0.0
        self.broken_until_ns = 0
        self.spoil = 0  # samples of the field `bad` that are no number
        self.second_ns = 0  # when a second explorer began to command
        self.moved_after_break = False
        self.commanders: list[Commander] = []
        self._coming: deque[tuple[int, list[float]]] = deque()
        self._forces: deque[tuple[int, Vector]] = deque()
        self._rng = np.random.default_rng(trial.seed)

    @property
    def broken(self) -> bool:
        """Whether nothing goes through the link."""
        return self.now_ns < self.broken_until_ns

    def advance(self) -> None:
        """Advance by one step."""
        self.now_ns += STEP_NS
        while self._coming and self._coming[0][0] <= self.now_ns:
            self.velocity = self._coming.popleft()[1]
        self.place = [at + speed * STEP_NS * 1e-9 for at, speed in zip(self.place, self.velocity, strict=True)]
        x, _, z = self.place
        self.normal_n = self.trial.stiffness_n_m * max(0.0, -z)
        wall_n = WALL_N_M * max(0.0, x - self.trial.wall_m)
        vx, vy, _ = self.velocity
        slip = math.hypot(vx, vy)
        rub = FRICTION * self.normal_n / slip if slip > 1e-6 else 0.0
        on_finger = (-rub * vx - wall_n, -rub * vy, self.normal_n)
        self.sideways_n = math.hypot(*on_finger[:2])
        self.largest_n = max(self.largest_n, self.normal_n)
        self.largest_sideways_n = max(self.largest_sideways_n, self.sideways_n)
        self.above_s += STEP_NS * 1e-9 * (math.hypot(*on_finger) > LIMIT_N)
        self._forces.append((self.now_ns, on_finger))
        after_s = (self.now_ns - self.broken_until_ns) * 1e-9
        if self.broken_until_ns and REST_S < after_s < REST_S + 0.1 and max(map(abs, self.velocity)) > MOVING_M_S:
            self.moved_after_break = True

    def measure(self) -> None:
        """Publish a pose and a force, as a broadcaster does in each period."""
        pose = force = None
        if not self.broken:
            pose, force = self._measured()
        for commander in self.commanders:
            commander.pose, commander.force = pose, force

    def _measured(self) -> tuple[PoseSample, ForceSample]:
        due_ns = self.now_ns - round(self.trial.late_force_s * 1e9)
        while len(self._forces) > 1 and self._forces[1][0] <= due_ns:
            self._forces.popleft()
        x, y, z = self._forces[0][1]
        if self.trial.fault == 'force sign':
            x, y, z = -x, -y, -z
        elif self.trial.fault == 'force axes':
            x, z = z, x
        noise = self.trial.noise_n * self._rng.standard_normal(3)
        force = [float(true + off + more) for true, off, more in zip((x, y, z), OFFSET_N, noise, strict=True)]
        place, rotation, frame = list(self.place), list(TOOL_DOWN), 'base'
        if self.trial.bad.startswith('rotation'):  # which matters where forces are given in the frame of the tool
            force, frame = [force[0], -force[1], -force[2]], 'tool0_controller'
        if self.spoil:
            self.spoil -= 1
            field, index, value = self.trial.bad.split()
            {'force': force, 'place': place, 'rotation': rotation}[field][int(index)] = float(value)
        pose = PoseSample(self.now_ns, 'base', (place[0], place[1], place[2]), tuple(rotation))  # type: ignore[arg-type]
        return pose, ForceSample(self.now_ns, frame, (force[0], force[1], force[2]))

    def take(self, velocity_m_s: Vector) -> None:
        """Take a velocity of whichever commander, that comes into effect late."""
        if self.broken:
            return
        x, y, z = velocity_m_s
        if self.trial.fault == 'velocity sign':
            x, y, z = -x, -y, -z
        elif self.trial.fault == 'velocity axes':
            x, z = z, x
        self._coming.append((self.now_ns + round(self.trial.delay_s * 1e9), [x, y, z]))


class Commander:
    """The topics as one explorer has them: `texture_exploration.arms.ros_controllers.ControllerTopics`."""

    def __init__(self, machine: VirtualMachine) -> None:
        self.machine = machine
        self.pose: PoseSample | None = None
        self.force: ForceSample | None = None
        machine.commanders.append(self)

    def newest_pose(self) -> PoseSample | None:
        """Return the pose of this period."""
        return self.pose

    def newest_force(self) -> ForceSample | None:
        """Return the force of this period."""
        return self.force

    def listeners(self) -> int:
        """Return that the controller listens; discovery does not notice a short break."""
        return 1

    def unsafe(self) -> str:
        """Return that another commands the arm, once ROS has shown it."""
        begin_ns, found_s = self.machine.second_ns, self.machine.trial.found_s
        seen = begin_ns and (self.machine.now_ns - begin_ns) * 1e-9 >= found_s
        return 'another explorer also commands the arm' if seen else ''

    def beat(self, *, moving: bool) -> None:
        """There is no guard."""

    def send_velocity(self, velocity_m_s: Vector) -> None:
        """Command a velocity."""
        self.machine.take(velocity_m_s)

    def close(self) -> None:
        """There is nothing to wait for."""


# --------------------
# One exploration, or two on one machine: exploration and arm are those of the suite, time and physics are not.

LIMITS = SafetyLimits(approach_timeout_s=60.0, z_low_m=-0.06, surface_tolerance_m=0.05)  # 5 N on 0.2 kN/m: 25 mm


class VirtualExplorer:
    """One explorer of a machine."""

    def __init__(self, machine: VirtualMachine, happens: Callable[[str], None], direction_rad: float = 0.0) -> None:
        trial = machine.trial
        self._machine, self._happens, self._direction_rad = machine, happens, direction_rad
        self._touch = TouchParams(approach_stiffness_n_m=trial.declared_n_m)
        params = RosControllersParams(
            surface_x_m=0.0,
            surface_z_m=0.0,
            surface_rx_rad=math.pi if trial.fault == 'upside down' else 0.0,
            rate_hz=1e9 / PERIOD_NS,
            loop_delay_s=trial.delay_s,
            max_stiffness_n_m=trial.declared_n_m,
            max_impact_n=0.5,
            touching_n=max(0.03, 6.0 * trial.noise_n),
            accept_no_timeout=True,
            accept_shared_group=True,
        )
        topics = Commander(machine)
        self.arm = RosControllersArm(params, lambda: machine.now_ns, lambda _params: topics, own_thread=False)

    def explore(self, pace: Callable[[], None]) -> tuple[str, str]:
        """Explore once from where the finger is; return how it ended."""
        trial, machine = self._machine.trial, self._machine
        request = ExplorationRequest(
            'linear_slide',
            speed_m_s=trial.speed_m_s,
            force_n=trial.wanted_n,
            distance_m=0.03,
            direction_rad=self._direction_rad,
        )
        motion = MOTIONS[request.motion](request, self.arm.state().position, self._touch, LIMITS)
        outcome = Exploration(
            'trial',
            request,
            arm=self.arm,
            motion=motion.lift_first(lambda: self.arm.zeroed),
            limits=LIMITS,
            clock=lambda: machine.now_ns,
            on_state=self._on_state,
        ).run(pace)
        return 'success' if outcome.success else outcome.error.name, outcome.message

    def _on_state(self, state: ExplorationState) -> None:
        rises = state.phase is Phase.APPROACH and not self.arm.zeroed
        self._happens(RISE if rises else state.phase.value)


class Second(threading.Thread):
    """A second explorer, alternating with the caller of `step`: one of both threads runs at a time."""

    def __init__(self, machine: VirtualMachine) -> None:
        super().__init__(daemon=True)
        self._explorer = VirtualExplorer(machine, lambda _phase: None, math.pi)
        self.arm = self._explorer.arm
        self._ours, self._theirs = threading.Semaphore(0), threading.Semaphore(0)
        self.end = ''

    def step(self) -> None:
        """Let it do one step, as long as it explores."""
        if self.ident is None:
            self.start()
        elif self.is_alive():
            self._ours.release()
        else:
            return
        self._theirs.acquire()

    def run(self) -> None:
        """Explore, and hand the turn back for good."""
        try:
            self.end = ExplorationError.INTERNAL.name
            self.end, _ = self._explorer.explore(self._pace)
        finally:
            self._theirs.release()

    def _pace(self) -> None:
        self._theirs.release()
        self._ours.acquire()


def explored(trial: ForceTrial) -> TrialEnd:
    """Explore once, or with a second explorer that begins meanwhile; an exception is also an end."""
    machine, seconds, seen = VirtualMachine(trial), list[Second](), 0

    def happens(phase: str) -> None:
        nonlocal seen
        seen += phase == trial.phase
        if phase != trial.phase or seen != 3:
            return
        machine.spoil = bool(trial.bad)
        if trial.broken_s:
            machine.broken_until_ns = machine.now_ns + round(trial.broken_s * 1e9)
        if trial.found_s:
            machine.second_ns = machine.now_ns

    def pass_time() -> None:
        if machine.second_ns and not seconds:
            seconds.append(Second(machine))
            machine.measure()
            seconds[0].arm.connect()
        for _ in range(round(EXPLORER_PERIODS * PERIOD_NS / STEP_NS)):
            machine.advance()
            if machine.now_ns % PERIOD_NS == 0:
                machine.measure()
                explorer.arm.step()
                for second in seconds:
                    second.arm.step()
        for second in seconds:
            second.step()

    try:
        explorer = VirtualExplorer(machine, happens)
        machine.advance()
        machine.measure()
        explorer.arm.connect()
        for _ in range(30):  # a connection begins at rest
            pass_time()
        end, message = explorer.explore(pass_time)
    except TextureError as error:
        end, message = 'refused', str(error)
    except Exception as error:
        end, message = ExplorationError.INTERNAL.name, f'{type(error).__name__}: {error}'
    if end != 'refused':
        until_ns = max(machine.now_ns, machine.broken_until_ns) + round(AFTER_S * 1e9)
        while machine.now_ns < until_ns or any(second.is_alive() for second in seconds):
            pass_time()
    if any(second.end == ExplorationError.INTERNAL.name for second in seconds):
        end, message = ExplorationError.INTERNAL.name, f'that of the second explorer; {message}'
    forces = machine.largest_n, machine.largest_sideways_n, machine.above_s
    return TrialEnd(*forces, end, message, machine.moved_after_break)


# --------------------
# The sweep.

STIFFNESSES_N_M = (200.0, 600.0, 2000.0, 6000.0, 20000.0)
DELAYS_S = (0.0, 0.008, 0.02, 0.05)
NOISES_N = (0.003, 0.01, 0.02)
SEEDS, QUICK_STEP = 20, 5  # of the noise; every so many trials of one seed
GAPS_M = (0.001, 0.002, 0.004, 0.008, 0.012)
BREAKS_S = (0.1, 0.3, 0.7, 2.0, 5.0)
FOUND_S = (0.05, 0.5, 2.0, 6.0)
PHASES = (RISE, 'approach', 'contact', 'slide', 'lift')
FAULTS = ('velocity sign', 'force sign', 'velocity axes', 'force axes')
FIELDS = [f'{field} {index}' for field, size in (('force', 3), ('place', 3), ('rotation', 4)) for index in range(size)]
BAD = [f'{field} {value}' for field, value in product(FIELDS, ('nan', 'inf', '1e308'))]


def sweep(seeds: int) -> Iterator[ForceTrial]:
    """Return the trials of the sweep; `seeds` of the noise for each."""
    for k, delay, noise, seed in product(STIFFNESSES_N_M, DELAYS_S, NOISES_N, range(seeds)):
        yield ForceTrial('stiffness as declared', k, k, delay, noise, seed)
        yield ForceTrial('20 kN/m declared', k, 20000.0, delay, noise, seed)
    for k, seed in product(STIFFNESSES_N_M, range(seeds)):
        yield ForceTrial('force 100 ms late, stamped on arrival', k, 20000.0, 0.02, seed=seed, late_force_s=0.1)
        yield ForceTrial('contact four times stiffer than declared', k, k / 4, 0.02, seed=seed)
    for speed, delay, seed in product((0.02, 0.05), DELAYS_S, range(seeds)):
        yield ForceTrial('wall of 20 kN/m in the slide', 2000.0, 20000.0, delay, 0.003, seed, 5.0, speed, wall_m=0.015)
    for fault, k, seed in product(FAULTS, STIFFNESSES_N_M, range(seeds)):
        yield ForceTrial('wrong signs and axes', k, 20000.0, 0.02, 0.003, seed, fault=fault)
    for k, gap, seed in product((500.0, 1000.0, 2000.0, 20000.0), GAPS_M, range(seeds)):
        yield ForceTrial('surface upside down', k, 20000.0, 0.02, 0.003, seed, height_m=gap, fault='upside down')
    for what, phase, seed in product(BAD, PHASES, range(seeds)):
        yield ForceTrial('a sample that is no number', seed=seed, bad=what, phase=phase)
    for broken_s, phase, seed in product(BREAKS_S, PHASES, range(seeds)):
        yield ForceTrial('link broken for 0.1 to 5 s', seed=seed, broken_s=broken_s, phase=phase)
    for found_s, phase, seed in product(FOUND_S, PHASES, range(seeds)):
        yield ForceTrial('two explorers', seed=seed, found_s=found_s, phase=phase)


Trials = list[tuple[ForceTrial, TrialEnd]]


def row(trials: Trials) -> dict[str, Any]:
    """Return the figures of one row of the table."""
    ends = [end for _, end in trials]
    good = [(trial, end) for trial, end in trials if end.end == 'success']
    return {
        'trials': len(ends),
        'normal_n': max(end.normal_n for end in ends),
        'sideways_n': max(end.sideways_n for end in ends),
        'above_s': max(end.above_s for end in ends),
        'success': len(good),
        'overshoot_of_success': max((end.normal_n / trial.wanted_n - 1.0 for trial, end in good), default=0.0),
        'internal': sum(not end.named for end in ends),
        'moved_after_break': sum(end.moved_after_break for end in ends),
        'ends': dict(Counter(end.end for end in ends).most_common()),
    }


FINISHED = 'motion.jsonl'  # a line for each trial, as it is finished


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Slide 30 mm with 5 N in virtual time on physics that shares no code with the suite.

    A late integrator on a spring with friction, by an arm of ROS controllers that holds the last velocity: stiffness
    of 0.2 to 20 kN/m, delay of 0 to 50 ms, noise of 3 to 20 mN; a wall, wrong signs and axes, a surface upside down 1
    to 12 mm away; in each phase non-finite samples, broken links and a second explorer. Largest true forces of
    each kind of trial, the most time above 10 N, and how the trials ended.
    """
    trials = list(sweep(1))[::QUICK_STEP] if options.quick else list(sweep(SEEDS))
    planned = {', '.join(map(str, trial)): trial for trial in trials}
    ended = resumed(explored, planned, options.out / FINISHED)
    rows: defaultdict[str, Trials] = defaultdict(list)
    for name, end in ended.items():
        rows[planned[name].name].append((planned[name], TrialEnd(*end)))
    return BenchmarkResult(
        data='virtual arm and surface, in virtual time',
        split='none: nothing is trained',
        numbers={
            'seeds': len({trial.seed for trial in trials}),
            'planned': len(planned),
            'rows': {name: row(trials) for name, trials in rows.items()},
        },
    )
