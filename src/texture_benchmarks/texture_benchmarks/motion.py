# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How well force, speed and circle are kept, by which robot on which surface; and where force control is stable."""

from __future__ import annotations

import importlib.util
import math
import os
import statistics
import tempfile
import time
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from dataclasses import asdict, dataclass, fields, replace
from math import isfinite
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult
from texture_core.ros_testing import NodeProcess
from texture_core.types import Array, ExplorationRequest, ExplorationState, FingerReceiver, Phase
from texture_evaluation.charts import COLOURS, chart
from texture_exploration.arms.arm import Arm, ArmState
from texture_exploration.arms.in_hand import InHandArm, InHandParams
from texture_exploration.arms.rails import RailsArm, RailsParams
from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.simulated import PLANE, RATE_HZ, SimulatedArm, SimulatedArmParams, SurfaceShape
from texture_exploration.arms.tool_state import RosControllersParams
from texture_exploration.arms.ur import UrArm, UrArmParams
from texture_exploration.explorer import PERIOD_S, Exploration, ExplorationOutcome, Explorer
from texture_exploration.force_control import (
    ForceController,
    ForceLoopParams,
    LoopModel,
    lowest_unstable_gain,
    stability_limit_gain,
)
from texture_exploration.motions import MOTIONS
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import TouchParams
from texture_simulation.devices.dynamixel import LEAP_FINGERS, EmulatedDynamixelBus, leap_hand
from texture_simulation.devices.rails import EmulatedRails, RailsMachine
from texture_simulation.devices.ur import ControllerProcess, UrControllerParams

ARM_PERIOD_NS = round(1e9 / RATE_HZ)
SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.06)
CIRCLE = ExplorationRequest('circular', speed_m_s=0.1, force_n=1.0, radius_m=0.02, turns=2.0)
# One configuration for all stiffnesses: the stiffest contact is expected throughout.
ARM = SimulatedArmParams(force_mode=False, start_height_m=0.002, max_stiffness_n_m=20000.0)
SIMULATED_TOUCH = TouchParams(approach_stiffness_n_m=20000.0)
SIMULATED_LIMITS = SafetyLimits()
APART_S = 0.05
LIFTED = (Phase.LIFT, Phase.ABORTED, Phase.DONE)


@dataclass(frozen=True)
class ForceControlMetrics:
    """How an exploration went; shares of the wanted force and speed.

    `overshoot` is the highest force from the approach to the beginning of the slide, above the wanted; negative if it
    stayed below. The others are those of the slide: `force_rms`, `speed_error` (the largest), `mean_speed_error`, and
    `radius_error_m`, the largest distance from the circle, NaN if there was none. The speed is that of the finger in
    space: on a slope it is higher than along the level. All are NaN if it did not come to a slide; `message` says why.
    `peak_n` is the highest force of the whole exploration, and `noticed_s` the time from what was injected until the
    finger was lifted, or, without that, from the first loss of contact in the slide; NaN if there was none.
    """

    success: bool
    message: str
    overshoot: float = math.nan
    force_rms: float = math.nan
    speed_error: float = math.nan
    mean_speed_error: float = math.nan
    radius_error_m: float = math.nan
    peak_n: float = math.nan
    noticed_s: float = math.nan


@dataclass(frozen=True)
class Hazard:
    """What is under the finger, and what happens to a simulated arm at the third step of a phase, if anything."""

    surface: SurfaceShape = PLANE
    phase: Phase = Phase.SLIDE
    happens: Callable[[SimulatedArm], None] | None = None
    stiffnesses_n_m: tuple[float, ...] = (200.0, 2000.0, 5000.0, 20000.0)  # that it is tried on, N/m


Log = Sequence[tuple[Phase, ArmState]]


def simulate_force_controlled_slide(
    arm: SimulatedArmParams = ARM, request: ExplorationRequest = SLIDE, hazard: Hazard = Hazard()
) -> ForceControlMetrics:
    """Explore once with a simulated arm, under the real exploration loop; evaluated by the true force."""
    log: list[tuple[Phase, ArmState]] = []
    now_ns = due_ns = 0
    injected_ns: int | None = None

    def clock() -> int:
        return now_ns

    moving = SimulatedArm(arm, clock, own_thread=False, shape=hazard.surface)
    moving.connect()
    motion = MOTIONS[request.motion](request, moving.state().position, SIMULATED_TOUCH, SIMULATED_LIMITS)
    exploration = Exploration(
        'trial', request, arm=moving, motion=motion, limits=SIMULATED_LIMITS, clock=clock, on_state=lambda state: None
    )

    def pace() -> None:
        nonlocal now_ns, due_ns, injected_ns
        due_ns += round(PERIOD_S * 1e9)
        while now_ns + ARM_PERIOD_NS <= due_ns:
            now_ns += ARM_PERIOD_NS
            moving.step(ARM_PERIOD_NS * 1e-9)
        log.append((exploration.state.phase, replace(moving.state(), force_n=moving.true_force_n)))
        if hazard.happens and injected_ns is None and [phase for phase, _ in log[-3:]] == [hazard.phase] * 3:
            injected_ns = now_ns
            hazard.happens(moving)

    outcome = exploration.run(pace)
    moving.close()
    log.append((exploration.state.phase, replace(moving.state(), force_n=moving.true_force_n)))
    return replace(force_control_metrics(log, request, outcome), noticed_s=_noticed_s(log, injected_ns))


def _noticed_s(log: Log, begin_ns: int | None) -> float:
    """Return how long after `begin_ns`, or the first loss of contact in the slide, the finger was lifted, s."""
    if begin_ns is None:
        lost = (state.time_ns for phase, state in log if phase is Phase.SLIDE and state.force_n <= 0.0)
        begin_ns = next(lost, None)
    if begin_ns is None:
        return math.nan
    lifted = (state.time_ns for phase, state in log if phase in LIFTED and state.time_ns >= begin_ns)
    return (next(lifted, log[-1][1].time_ns) - begin_ns) * 1e-9


def force_control_metrics(log: Log, request: ExplorationRequest, outcome: ExplorationOutcome) -> ForceControlMetrics:
    """Return how an exploration went, from the states of the arm in each phase."""
    before = [state.force_n for phase, state in log if phase in (Phase.APPROACH, Phase.CONTACT)]
    sliding = [state for phase, state in log if phase is Phase.SLIDE]
    peak_n = max((state.force_n for _, state in log), default=math.nan)
    if not sliding:
        return ForceControlMetrics(outcome.success, outcome.message, peak_n=peak_n)
    # Logs hold the true force: that which the arm measures may be what is wrong.
    force = np.array([state.force_n for state in sliding]) / request.force_n
    speed = np.array([math.hypot(*state.velocity) for state in sliding]) / request.speed_m_s
    times_s = np.array([state.time_ns for state in sliding]) * 1e-9
    places = np.array([state.position for state in sliding])
    took_s, way_m = np.diff(times_s), np.linalg.norm(np.diff(places, axis=0), axis=1)
    near = took_s < APART_S  # between strokes the finger is lifted
    return ForceControlMetrics(
        success=outcome.success,
        message=outcome.message,
        overshoot=max(before) / request.force_n - 1,
        force_rms=float(np.sqrt(np.mean((force - 1) ** 2))),
        speed_error=float(np.abs(speed - 1).max()),
        mean_speed_error=abs(float(way_m[near].sum() / took_s[near].sum()) / request.speed_m_s - 1),
        radius_error_m=radius_error_m(places[:, :2], request.radius_m),
        peak_n=peak_n,
    )


def radius_error_m(places: Array, radius_m: float) -> float:
    """Return the largest distance of places, (n, 2), from a circle of that radius around their own middle, m.

    NaN if the radius is 0, for another path. The middle is that of the circle that fits best, by least squares
    (Kåsa 1976).
    """
    if not radius_m:
        return math.nan
    terms = np.column_stack([2 * places, np.ones(len(places))])
    middle = np.linalg.lstsq(terms, (places**2).sum(axis=1), rcond=None)[0][:2]
    return float(np.abs(np.hypot(*(places - middle).T) - radius_m).max())


# Surfaces to try force control on.
SURFACES: Mapping[str, SurfaceShape] = {
    'flat': PLANE,
    'rising 10°': SurfaceShape(tilt_rad=math.radians(10)),
    'falling 10°': SurfaceShape(tilt_rad=math.radians(-10)),
    'bump of 2 mm': SurfaceShape(bump_m=0.002),
    'sticky': SurfaceShape(adhesion_n=0.5, stick_slip_n=0.05),
}


LAGS_S = (0.0, 0.01, 0.02, 0.05)
DRIFT_N_S = 0.5


HAZARDS: Mapping[str, Hazard] = {
    'none': Hazard(),
    'step down 12 mm': Hazard(SurfaceShape(step_m=-0.012)),
    'step up 1 mm': Hazard(SurfaceShape(step_m=0.001), stiffnesses_n_m=(200.0, 2000.0)),
    'edge: the surface ends': Hazard(SurfaceShape(edge_m=0.03)),
    'soft layer of 1 mm on 20 kN/m': Hazard(SurfaceShape(layer_m=0.001), stiffnesses_n_m=(200.0, 500.0, 1000.0)),
    'force frozen in the approach': Hazard(phase=Phase.APPROACH, happens=SimulatedArm.freeze_force),
    'force frozen while pressing': Hazard(phase=Phase.CONTACT, happens=SimulatedArm.freeze_force),
    'force frozen in the slide': Hazard(happens=SimulatedArm.freeze_force),
    'force frozen in the slide, rising 10°': Hazard(SurfaceShape(tilt_rad=0.1745), happens=SimulatedArm.freeze_force),
    'force drifts up by 0.5 N/s': Hazard(happens=lambda arm: arm.drift_force(DRIFT_N_S)),
    'force drifts down by 0.5 N/s': Hazard(happens=lambda arm: arm.drift_force(-DRIFT_N_S)),
}


def hazard_trials(hazard: Hazard, stiffnesses_n_m: Sequence[float], lag_s: float) -> Trials:
    """Return the trials with a hazard by stiffness, of an arm with an undeclared lag that knows velocities alone."""
    return {
        k: simulate_force_controlled_slide(replace(ARM, stiffness_n_m=k, undeclared_lag_s=lag_s), hazard=hazard)
        for k in stiffnesses_n_m
    }


TARGETS = {
    'force_rms': 0.05,
    'overshoot': 0.2,
    'speed_error': 0.02,
    'radius_error_m': 0.001,
    'border_error': 0.1,
    'margin': 2.0,
}


def margins() -> dict[str, float]:
    """Return how many times stiffer, and later, the contact may be than expected before the chosen gain is unstable."""
    params, period_s = ForceLoopParams(), 1 / RATE_HZ
    gain = params.default_gain(params.max_stiffness_n_m, period_s)
    delays = np.linspace(1.0, 20.0, 191)
    loop = params.loop(params.max_stiffness_n_m, period_s)
    late = [stability_limit_gain(replace(loop, delay_s=float(f) * params.loop_delay_s)) > gain for f in delays]
    return {'stiffness': stability_limit_gain(loop) / gain, 'delay': float(delays[np.argmin(late)])}


HEIGHT_M = 0.002
UR_IP = '127.0.0.66'


CONTROLLER_DOMAIN = 99
LAG_S = 0.02


DEADLINE_S = 60.0
READ_S = 0.05  # how often: what is not read soon is lost
GRIP_S = 20.0


TOUCH = TouchParams()
RUB = ExplorationRequest('in_hand_sliding', speed_m_s=0.02, force_n=1.0, distance_m=0.02, duration_s=3.0)


@contextmanager
def ur(stiffness_n_m: float, finger_pipe: str) -> Iterator[Arm]:
    """Start an emulated UR controller."""
    params = UrControllerParams(
        ip=UR_IP, finger_pipe=finger_pipe, stiffness_n_m=stiffness_n_m, start_height_m=HEIGHT_M, force_offset_n=0.0
    )
    with ControllerProcess(params):
        yield UrArm(UrArmParams(ip=UR_IP))


@contextmanager
def rails(stiffness_n_m: float, finger_pipe: str) -> Iterator[Arm]:
    """Start emulated rails."""
    machine = RailsMachine(stiffness_n_m=stiffness_n_m, start_height_m=HEIGHT_M)
    with (
        tempfile.TemporaryDirectory() as folder,
        EmulatedRails(Path(folder) / 'rails', machine, finger_pipe=finger_pipe) as made,
    ):
        yield RailsArm(RailsParams(device=str(made.port.link), height_m=HEIGHT_M))


@contextmanager
def hand(stiffness_n_m: float, finger_pipe: str) -> Iterator[Arm]:
    """Start an emulated LEAP hand; its index finger is looked at."""
    motors = leap_hand(stiffness_n_m)
    with (
        tempfile.TemporaryDirectory() as folder,
        EmulatedDynamixelBus(Path(folder) / 'hand', motors, LEAP_FINGERS['index'], finger_pipe) as made,
    ):
        yield InHandArm(InHandParams(hand='dynamixel', device=str(made.port.link), grip_timeout_s=GRIP_S))


@contextmanager
def ros_controllers(stiffness_n_m: float, finger_pipe: str) -> Iterator[Arm]:
    """Start an emulated velocity controller with a lag of 20 ms, known only through its topics, in a domain of its own.

    The stiffest contact is expected throughout, and may be met with half of the wanted force.
    """
    emulated = {'finger_pipe': finger_pipe, 'stiffness_n_m': stiffness_n_m, 'start_height_m': HEIGHT_M, 'lag_s': LAG_S}
    isolation = {'ROS_DOMAIN_ID': str(CONTROLLER_DOMAIN), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    with mock.patch.dict(os.environ, isolation), NodeProcess('texture_simulation', 'twist_controller', emulated):
        # A busy machine is not what is tried here.
        yield RosControllersArm(
            RosControllersParams(
                accept_no_timeout=True,
                accept_shared_group=True,
                connect_timeout_s=DEADLINE_S,
                deadman_s=1.0,
                max_stiffness_n_m=20000.0,
                max_impact_n=0.5,
            )
        )


@dataclass(frozen=True)
class RobotUnderTest:
    """An emulated robot: how it is started, what it does, how it touches, and the module that it needs."""

    start: Callable[[float, str], AbstractContextManager[Arm]]
    needs: str
    requests: tuple[ExplorationRequest, ...] = (SLIDE, CIRCLE)
    touch: TouchParams = TOUCH


ROBOTS: Mapping[str, RobotUnderTest] = {
    'emulated UR': RobotUnderTest(ur, 'rtde_control'),
    'emulated rails': RobotUnderTest(rails, 'serial'),
    'emulated ROS controllers': RobotUnderTest(ros_controllers, 'rclpy', (SLIDE, CIRCLE, RUB)),
    # Motors tell their speed and current in coarse steps.
    'emulated hand': RobotUnderTest(
        hand, 'dynamixel_sdk', (RUB,), TouchParams(speed_tolerance=0.3, force_tolerance=0.2)
    ),
}


LIMITS = SafetyLimits(state_timeout_s=1.0, approach_timeout_s=40.0)  # a busy machine is not what is tried here


def robot_trial(name: str, stiffness_n_m: float, request: ExplorationRequest) -> ForceControlMetrics:
    """Explore once with one of `ROBOTS`, over a surface of that stiffness; evaluated by what the emulator reports.

    Left out is what the finger did before the first state, and what of a slide was not guaranteed to be steady.
    """
    robot = ROBOTS[name]
    states: list[ExplorationState] = []
    with ExitStack() as stack:
        pipe = str(Path(stack.enter_context(tempfile.TemporaryDirectory()), 'finger'))
        told = stack.enter_context(closing(FingerReceiver(pipe)))
        arm = stack.enter_context(robot.start(stiffness_n_m, pipe))
        explorer = Explorer(arm, replace(robot.touch, approach_stiffness_n_m=stiffness_n_m), LIMITS, states.append)
        stack.callback(explorer.close)
        explorer.connect()
        told.states()  # of before
        exploration, fingers, late_s = explorer.begin('trial', request), [], time.monotonic() + DEADLINE_S
        while not exploration.ended.wait(READ_S) and time.monotonic() < late_s:
            fingers += told.states()
        fingers += told.states()
        begins, phases = [state.stamp_ns for state in states], []
        for finger in fingers:
            newest = bisect_right(begins, finger.time_ns) - 1
            state = states[newest] if newest >= 0 else None
            if state and (state.phase is not Phase.SLIDE or finger.time_ns <= state.stamp_ns + state.steady_s * 1e9):
                velocity = (finger.vx_m_s, finger.vy_m_s, finger.vz_m_s)
                position = (finger.x_m, finger.y_m, finger.z_m)
                phases.append((state.phase, ArmState(finger.time_ns, position, velocity, finger.force_n)))
        return force_control_metrics(phases, request, exploration.outcome)


def typical_trial(name: str, stiffness_n_m: float, request: ExplorationRequest, repeats: int) -> ForceControlMetrics:
    """Return the median of each number of several trials, or one that failed: the machine may have been busy once."""
    trials = [robot_trial(name, stiffness_n_m, request) for _ in range(repeats)]
    failed = [trial for trial in trials if not trial.success]
    if failed:
        return failed[0]
    names = [field.name for field in fields(ForceControlMetrics) if field.name not in ('success', 'message')]
    medians = {name: statistics.median(getattr(trial, name) for trial in trials) for name in names}
    return ForceControlMetrics(True, trials[0].message, **medians)


STYLES = list(zip(COLOURS, 'o^vsDP', strict=False))
Trials = Mapping[float, ForceControlMetrics]  # by stiffness in N/m


def surface_chart(surfaces: Mapping[str, Trials], path: Path) -> Path:
    """Draw force and speed errors over stiffness, a line for each surface."""
    with chart(path, (9.0, 4.4), 'An arm without a force mode over simulated surfaces: 1 N, 0.05 m/s') as figure:
        for axes, number, title in zip(
            figure.subplots(1, 2),
            ('force_rms', 'speed_error'),
            ('force error, rms (%)', 'largest speed error in space (%)'),
            strict=True,
        ):
            for (name, trials), (colour, marker) in zip(surfaces.items(), STYLES, strict=False):
                values = [100 * getattr(trial, number) for trial in trials.values()]
                axes.semilogx([k / 1000 for k in trials], values, color=colour, marker=marker, markersize=4, label=name)
            axes.axhline(100 * TARGETS[number], color='black', linestyle='--', linewidth=1)
            ticks = (0.2, 2, 20)
            axes.set(title=title, xlabel='stiffness of the contact (kN/m)', xticks=ticks, xticklabels=map(str, ticks))
            axes.set_ylim(bottom=0)
        figure.axes[0].legend(loc='best')
    return path


CYCLES = 60  # a simulated loop is judged after so many delays
SMALL = 0.1
FINE = 20  # simulation steps per period


def simulated_stability_limit_gain(loop: LoopModel) -> float:
    """Return the gain from which a running `ForceController` makes a disturbance grow, m/s/N."""
    return lowest_unstable_gain(loop, lambda gain: _disturbance_decays(replace(loop, gain_m_s_n=gain)), bisections=12)


def _disturbance_decays(loop: LoopModel) -> bool:
    """Run the controller on a spring, finely integrated, after a jolt of 1 N; return whether the swinging shrinks."""
    running = ForceController(loop.gain_m_s_n, loop.integral_s)
    fine_s = loop.period_s / FINE
    late = round(loop.delay_s / fine_s)
    periods = math.ceil(CYCLES * (loop.delay_s + loop.period_s) / loop.period_s)
    error, peaks = 1.0, np.empty(periods)
    velocities = np.zeros(late + FINE * periods)
    for period in range(periods):
        now = FINE * period
        velocities[late + now : late + now + FINE] = running.update(error, loop.period_s)
        error += loop.stiffness_n_m * fine_s * float(velocities[now : now + FINE].sum())
        peaks[period] = abs(error)
        if peaks[period] > 1e6:
            return False
    third = periods // 3
    # The integral part may leave a small slow rest that still rises; a swinging that grows began with 1.
    return bool(peaks[-third:].max() < max(SMALL, peaks[third : 2 * third].max()))


def stability_chart(
    stiffness_n_m: Sequence[float],
    delay_s: Sequence[float],
    period_s: float = 0.004,
    integral_s: float = 0.5,
) -> dict[str, Array]:
    """Return the data of a chart: the stability limit of the gain over stiffness and delay, predicted and simulated."""
    loops = [[LoopModel(k, 0.0, delay, period_s, integral_s) for delay in delay_s] for k in stiffness_n_m]
    return {
        'stiffness_n_m': np.array(stiffness_n_m, dtype=float),
        'delay_s': np.array(delay_s, dtype=float),
        'predicted': np.array([[stability_limit_gain(loop) for loop in row] for row in loops]),
        'simulated': np.array([[simulated_stability_limit_gain(loop) for loop in row] for row in loops]),
    }


def border_chart(border: Mapping[str, Array], path: Path) -> Path:
    """Draw the gain from which the loop is unstable over its delay, predicted and simulated, and the chosen gains."""
    with chart(path, (8.0, 5.0)) as figure:
        axes = figure.subplots()
        delay_ms = 1000 * border['delay_s']
        rows = zip(border['stiffness_n_m'], border['predicted'], border['simulated'], COLOURS, strict=False)
        for stiffness, predicted, simulated, colour in rows:
            chosen = [
                ForceLoopParams(loop_delay_s=delay).default_gain(stiffness, 1 / RATE_HZ) for delay in border['delay_s']
            ]
            axes.semilogy(delay_ms, predicted, color=colour, label=f'{stiffness / 1000:g} kN/m')
            axes.semilogy(delay_ms, simulated, '.', color=colour)
            axes.semilogy(delay_ms, chosen, ':', color=colour)
        title = (
            'Stability limit of the force control at 250 Hz: eigenvalues (lines), simulation (dots)\n'
            'Dotted: the gain that the controller chooses'
        )
        axes.set(xlabel='delay of the loop (ms)', ylabel='gain (m/s per N)', title=title)
        axes.legend(loc='center left', bbox_to_anchor=(1.0, 0.5), title='stiffness')
    return path


STIFFNESSES_N_M = (200.0, 2000.0, 20000.0)
FINE_STIFFNESSES_N_M = tuple(float(k) for k in np.geomspace(200.0, 20000.0, 9))
BORDER_STIFFNESSES_N_M = (100.0, 1e3, 1e4, 1e5)
DELAYS_S = tuple(float(delay) for delay in np.linspace(0.0, 0.02, 21))
QUICK_DELAYS_S = (0.0, 0.008, 0.02)
QUICK_ROBOTS = ('emulated rails',)
REPEATS = 3  # of the emulated robots
SIMULATED: Mapping[str, SimulatedArmParams] = {
    'simulated, force mode': replace(ARM, force_mode=True),
    'simulated, velocities only': ARM,
}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Slide straight and in a circle with every robot, over every surface; draw the border of stability.

    One slide of 60 mm at 0.05 m/s and one of two turns at 0.1 m/s on a circle of 20 mm, with 1 N, for each robot and
    stiffness; in the hand and with ROS controllers strokes of 20 mm at 0.02 m/s. Shares of what was asked for:
    overshoot until the slide begins, force error (root mean square), largest and mean speed error of the slide;
    largest distance from the circle. Of emulated robots the median of 3 slides.
    """
    stiffnesses = STIFFNESSES_N_M[1:2] if options.quick else STIFFNESSES_N_M
    fine = STIFFNESSES_N_M if options.quick else FINE_STIFFNESSES_N_M
    lags_s, most = (LAGS_S[::3], 2) if options.quick else (LAGS_S, None)
    surfaces = {name: hazard_trials(Hazard(shape), fine, 0.0) for name, shape in SURFACES.items()}
    hazards = {
        name: {
            f'{1e3 * lag_s:.0f} ms': _rows(hazard_trials(hazard, hazard.stiffnesses_n_m[:most], lag_s))
            for lag_s in lags_s
        }
        for name, hazard in HAZARDS.items()
    }
    border = stability_chart(BORDER_STIFFNESSES_N_M, QUICK_DELAYS_S if options.quick else DELAYS_S)
    robots = {
        name: {
            f'{k:.0f} N/m': {
                request.motion: _row(simulate_force_controlled_slide(replace(arm, stiffness_n_m=k), request))
                for request in (SLIDE, CIRCLE)
            }
            for k in stiffnesses
        }
        for name, arm in SIMULATED.items()
    }
    here = [name for name, robot in ROBOTS.items() if importlib.util.find_spec(robot.needs)]
    for name in QUICK_ROBOTS if options.quick else here:
        robots[name] = {
            f'{k:.0f} N/m': {
                request.motion: _row(typical_trial(name, k, request, 1 if options.quick else REPEATS))
                for request in ROBOTS[name].requests
            }
            for k in stiffnesses
        }
    return BenchmarkResult(
        name='motion',
        measured=run.__doc__,
        data='simulated surfaces; the emulated robots in real time, on the same machine',
        split='none: nothing is trained; the force loop was designed on these surfaces',
        numbers={
            'targets': TARGETS,
            'robots': robots,
            'surfaces_velocities_only': {name: _rows(trials) for name, trials in surfaces.items()},
            'hazards': hazards,
            'border_error': float(np.abs(border['simulated'] / border['predicted'] - 1).max()),
            'margin': margins(),
        },
        charts=(
            surface_chart(surfaces, options.out / 'motion_surfaces.png'),
            border_chart(border, options.out / 'motion_stability.png'),
        ),
    )


def _rows(trials: Trials) -> dict[str, Any]:
    return {f'{stiffness:.0f} N/m': _row(trial) for stiffness, trial in trials.items()}


def _row(trial: ForceControlMetrics) -> dict[str, Any]:
    """Return the numbers of a trial; what there is none of is left out, as is the message of a success."""
    numbers = {name: value for name, value in asdict(trial).items() if isinstance(value, float) and isfinite(value)}
    return {'success': trial.success, **numbers, **({} if trial.success else {'message': trial.message})}
