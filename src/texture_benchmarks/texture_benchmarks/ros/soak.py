# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Explore again and again while faults befall nodes and robot: what must hold, and what was seen.

All nodes of a tactile finger on an emulated arm behind ROS controllers run as processes. Each fault comes in turn, and
after it, unless it succeeded all the same, explorations without one until one does.
"""

from __future__ import annotations

import math
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import TwistStamped, WrenchStamped

from texture_benchmarks.study import BenchmarkResult
from texture_bringup.demo import free_domain
from texture_bringup.operator import Operator
from texture_core.errors import LaunchFailed, TextureError
from texture_core.ros import to_ns
from texture_core.ros_testing import LocalGraph, NodeProcess
from texture_core.types import NANOSECONDS, Array, ExplorationRequest, ExplorationState, Phase
from texture_evaluation.train import train_from_bags
from texture_exploration.safety import SafetyLimits
from texture_simulation.offline import SlidePlan, write_simulated
from texture_simulation.scene import load_scene

# --------------------
# What befalls an exploration, and the nodes that it befalls.


class Fault(NamedTuple):
    """What befalls an exploration once the finger slides; 'start' befalls the arm before it is connected."""

    action: str = ''  # 'start' or 'set' with parameters, 'freeze', 'kill', 'stop', 'command'
    node: str = ''
    given: Mapping[str, Any] = {}
    hold_s: float = 0.0
    obeys: bool = True  # whether the arm does what the explorer commands, and the explorer can command


NONE = 'none'
FAULTS: Mapping[str, Fault] = {
    'sensor unplugged': Fault('set', 'emulator', {'plugged': False}, 2.0),
    'bytes corrupted': Fault('set', 'emulator', {'bit_flips': 2e-3}, 3.0),
    'emulator frozen': Fault('freeze', 'emulator', hold_s=2.0),
    'sensor killed': Fault('kill', 'sensor'),
    'feature extractor killed': Fault('kill', 'feature_extractor'),
    'classifier killed': Fault('kill', 'classifier'),
    'stopped by the operator': Fault('stop'),
    'wall of 20 kN/m in the slide': Fault('start', given={'wall_m': 0.02}),
    'velocities inverted': Fault('start', given={'invert_twist': True}, obeys=False),
    'force inverted': Fault('start', given={'invert_force': True}),
    'force 0.5 s late': Fault('start', given={'force_delay_s': 0.5}),
    'force 0.5 s late with new stamps': Fault('start', given={'force_delay_s': 0.5, 'stamp_when_sent': True}),
    'explorer paused for 0.5 s': Fault('freeze', 'explorer', hold_s=0.5),
    'explorer stopped for 3 s': Fault('freeze', 'explorer', hold_s=3.0),
    'explorer killed': Fault('kill', 'explorer', obeys=False),
    'guard stopped for 3 s': Fault('freeze', 'guard', hold_s=3.0),
    'guard killed': Fault('kill', 'guard'),
    'second commander': Fault('command', hold_s=1.0),
}
HEALTHY = {'plugged': True, 'bit_flips': 0.0}
HARMLESS = {'wall_m': 2.0, 'invert_twist': False, 'invert_force': False, 'force_delay_s': 0.0, 'stamp_when_sent': False}
SCENE = 'twelve_textures'
SLIDE = {'speed_m_s': 0.05, 'force_n': 3.0, 'distance_m': 0.06, 'use_start': True}
GUARD = 'texture_exploration.ros.guard'
PACKAGES = {
    'emulator': 'texture_simulation',
    'sensor': 'texture_drivers',
    'twist_controller': 'texture_simulation',
    'feature_extractor': 'texture_features',
    'classifier': 'texture_estimation',
    'explorer': 'texture_exploration',
}
# Patient with a busy machine; what comes 0.5 s late is too late all the same.
PATIENT = {'connect_timeout_s': 10.0, 'deadman_s': 0.4, 'approach_timeout_s': 60.0,
           'state_timeout_s': 1.0, 'signal_timeout_s': 1.5}  # fmt: skip
PATCH = {'patch_x_low_m': -0.02, 'patch_x_high_m': 0.1, 'patch_y_low_m': -0.05, 'patch_y_high_m': 0.05}
EMULATED = {'accept_no_timeout': True, 'accept_shared_group': True, 'approach_stiffness_n_m': 2e4}
RESPAWNED = ('sensor', 'feature_extractor', 'classifier')  # what moves a robot, no launch file starts again
ANSWERS_S, RESPAWN_S, SETTLED_S, POLL_S = 120.0, 0.2, 1.0, 0.05
ATTEMPTS = 3  # a busy machine may abort before the slide, or slide too slowly for a success
HUNG_S, BACK_S, ABOVE_S, FREE_N = 60.0, 60.0, 0.1, 0.2
LIMIT_N = SafetyLimits().force_limit_n

# --------------------
# What is recorded, and what must hold.

SUCCESS = 'success'


class FaultTrial(NamedTuple):
    """One exploration, what befell it, and the true force on the finger meanwhile."""

    fault: str
    happened: bool  # what comes in the slide does not come without one
    ending: str
    message: str
    took_s: float = 0.0
    peak_n: float = 0.0
    above_s: float = 0.0  # time above the limit
    left_n: float = 0.0  # once it is over and the arm obeys


def check(trials: Sequence[FaultTrial], ended: int) -> dict[str, Any]:
    """Return what is required of a run: what was seen, and whether it holds."""
    calm = [one.ending == SUCCESS for one in trials if one.fault == NONE]
    blocked = any(not any(calm[i : i + ATTEMPTS]) for i in range(len(calm) - ATTEMPTS + 1))
    missing = {one.fault for one in trials} - {one.fault for one in trials if one.happened}
    nameless = sum(one.ending != SUCCESS and not one.message for one in trials)
    slowest_s = max(one.took_s for one in trials)
    longest, pressed = max(trials, key=lambda one: one.above_s), max(trials, key=lambda one: one.left_n)
    left = f'most {pressed.left_n:.2f} N, {pressed.fault}'
    above = f'most {1e3 * longest.above_s:.0f} ms, {longest.peak_n:.0f} N, {longest.fault}'
    found = {
        'every fault comes': (f'not: {", ".join(sorted(missing)) or "none"}', not missing),
        f'every exploration ends in {HUNG_S:g} s': (f'the longest took {slowest_s:.1f} s', slowest_s < HUNG_S),
        'every exploration succeeds or ends by name': (f'{nameless} without', not nameless),
        f'without a fault one of {ATTEMPTS} succeeds': (f'{sum(calm)} of {len(calm)} did', not blocked),
        f'no force is above {LIMIT_N:g} N for more than {ABOVE_S:g} s in all': (above, longest.above_s <= ABOVE_S),
        'no finger stays pressed where the arm obeys': (left, pressed.left_n <= FREE_N),
        'no node ends by itself': (f'{ended} did', not ended),
    }
    return {requirement: {'seen': seen, 'holds': holds} for requirement, (seen, holds) in found.items()}


# --------------------
# The run.


class Rig(LocalGraph):
    """All nodes as processes, an operator who explores with them, and injected faults; use it in a `with` block."""

    def __init__(self, domain_id: int, given: Mapping[str, Mapping[str, Any]]) -> None:
        super().__init__(domain_id, math.inf)
        self._given, self._nodes, self._over = given, dict[str, NodeProcess](), threading.Event()
        self._operator, self._other = Operator(domain_id=domain_id), Operator(domain_id=domain_id)
        self.ended = 0  # nodes that ended by themselves

    def __enter__(self) -> Rig:
        super().__enter__()
        self._wrenches = self.listen(WrenchStamped, 'true_wrench', 1000)
        self._thread = threading.Thread(target=self.until, args=(self._over.is_set,))
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        for name in reversed(self._nodes):  # the explorer first, which lifts the finger
            self._nodes[name].stop()
        for operator in (self._operator, self._other):
            operator.__exit__(None, None, None)
        self._over.set()
        self._thread.join()
        super().__exit__()

    def _forces(self) -> Array:
        """Return times, s, and true forces on the finger, N, since the exploration began, (n, 2)."""
        forces = [(one.header.stamp, one.wrench.force) for one in self._wrenches]
        return np.array([(to_ns(stamp) / NANOSECONDS, math.hypot(one.x, one.y, one.z)) for stamp, one in forces])

    def start(self, name: str, more: Mapping[str, Any] = {}) -> None:
        """Start a node, again if it runs; wait until an explorer answers, which it cannot do while it connects."""
        if name in self._nodes:
            self._nodes[name].stop()
        node = self._nodes[name] = NodeProcess(PACKAGES[name], name, {**self._given[name], **more})
        node.__enter__()
        deadline_s = time.monotonic() + ANSWERS_S
        while name == 'explorer':
            with suppress(LaunchFailed):  # an answer to a client that is not discovered yet is lost
                self._operator.stop()
                return
            if time.monotonic() > deadline_s:
                raise LaunchFailed(f'the explorer does not answer within {ANSWERS_S:g} s: {node.output}')

    def run(self, name: str, surface: str) -> FaultTrial:
        """Explore a surface with a fault, put right what it left, and wait until all works again."""
        fault = FAULTS.get(name, Fault())
        self._other.set_parameters('emulator', {'surface': surface})
        if fault.action == 'start':
            self._nodes['explorer'].stop()
            self.start('twist_controller', fault.given)  # with its finger where all began
            self.start('explorer')
        self._wrenches.clear()
        began_s = time.monotonic()
        explored = self._explore(fault, surface)
        took_s = time.monotonic() - began_s
        time.sleep(SETTLED_S)
        times_s, forces_n = self._forces().T
        left_n = float(forces_n[-1])
        # As an operator does after a fault: put the arm right, and lift the finger by another explorer.
        if fault.action == 'start' or not fault.obeys:
            self._other.set_parameters('twist_controller', HARMLESS)
            self.start('explorer')
            self._other.call('explorer/lift', 'start the explorer')
            time.sleep(SETTLED_S)
            left_n = left_n if fault.obeys else float(self._forces()[-1, 1])
        self.ended += sum(node.process.poll() is not None for node in self._nodes.values())
        self._other.wait_for_signal(BACK_S)
        above_s = float(np.diff(times_s)[forces_n[:-1] > LIMIT_N].sum())
        return FaultTrial(name, *explored, took_s, float(forces_n.max()), above_s, left_n)

    def _explore(self, fault: Fault, surface: str) -> tuple[bool, str, str]:
        """Explore; return whether the fault came, how the exploration ended, and why."""
        in_slide, acting = fault.action not in ('', 'start'), list[threading.Thread]()

        def on_progress(state: ExplorationState, _texture: Any) -> None:
            if state.phase is Phase.SLIDE and in_slide and not acting:
                acting.append(threading.Thread(target=self._act, args=(fault,)))
                acting[0].start()

        try:
            answer = self._operator.explore(ExplorationRequest('linear_slide', surface=surface, **SLIDE), on_progress)
            ending = SUCCESS if answer.success else 'aborted' if answer.exploration_id else 'refused'
            message = answer.message
        except TextureError as error:
            ending, message = 'lost', str(error)
        for thread in acting:
            thread.join()
        return bool(acting) or not in_slide, ending, message

    def _act(self, fault: Fault) -> None:
        if fault.action == 'stop':
            self._other.stop()
        elif fault.action == 'set':
            self._other.set_parameters(fault.node, fault.given)
            time.sleep(fault.hold_s)
            self._other.set_parameters(fault.node, HEALTHY)
        elif fault.action == 'command':
            self._command(time.monotonic() + fault.hold_s)
        elif fault.action == 'freeze':
            pid = self._pid(fault.node)
            os.kill(pid, signal.SIGSTOP)
            time.sleep(fault.hold_s)
            os.kill(pid, signal.SIGCONT)
        else:
            os.kill(self._pid(fault.node), signal.SIGKILL)
            if fault.node in RESPAWNED:
                time.sleep(RESPAWN_S)
                self.start(fault.node)

    def _pid(self, node: str) -> int:
        """Return the process of a node, or of the guard that the explorer has started."""
        if node != 'guard':
            return self._nodes[node].process.pid
        threads = Path(f'/proc/{self._nodes["explorer"].process.pid}/task').glob('*/children')
        pids = [int(pid) for thread in threads for pid in thread.read_text(encoding='ascii').split()]
        return next(pid for pid in pids if GUARD in Path(f'/proc/{pid}/cmdline').read_text(errors='replace'))

    def _command(self, end_s: float) -> None:
        """Also command the arm, along the surface."""
        publisher = self.peer.create_publisher(TwistStamped, 'twist_controller/twist', 1)
        twist = TwistStamped()
        twist.header.frame_id, twist.twist.linear.y = 'base', 0.01
        while time.monotonic() < end_s:
            twist.header.stamp = self.peer.get_clock().now().to_msg()
            publisher.publish(twist)
            time.sleep(POLL_S)
        self.peer.destroy_publisher(publisher)


def soak(
    duration_s: float, seed: int, say: Callable[[str], None], faults: Sequence[str] = tuple(FAULTS)
) -> BenchmarkResult:
    """Explore with each fault in turn, and without one after each, until the time is over; each comes once.

    How explorations end under each fault, and the true force on the finger (N).
    """
    with ExitStack() as stack:
        # Train on simulated slides, and start all nodes.
        folder, domain_id = Path(stack.enter_context(tempfile.TemporaryDirectory())), free_domain()
        rng, surfaces = np.random.default_rng(seed), list(load_scene(SCENE).surfaces)
        plan = SlidePlan(slides=5, speed_m_s=0.05, force_n=3.0, slide_s=1.0)
        train_from_bags('default', write_simulated(folder / 'slides', plan, rng, SCENE), out=folder / 'model')
        card, pipe, device = (str(folder / name) for name in ('model.json', 'finger', 'tsf85'))
        given: Mapping[str, Mapping[str, Any]] = {
            'emulator': {'scene': SCENE, 'seed': seed, 'sensor_link': device, 'finger_pipe': pipe},
            'sensor': {'device': device},
            # It keeps executing the last velocity.
            'twist_controller': {'finger_pipe': pipe, 'start_height_m': 0.002, 'command_timeout_s': 0.0},
            'feature_extractor': {'recipe': card},
            'classifier': {'model': card},
            'explorer': {'arm': 'ros_controllers', **PATIENT, **PATCH, **EMULATED},
        }
        running = stack.enter_context(Rig(domain_id, given))
        for name in PACKAGES:
            running.start(name)
        # Each fault, and after it explorations without one.
        trials, end_s = list[FaultTrial](), time.monotonic() + duration_s
        while not trials or time.monotonic() < end_s:
            for fault in rng.permutation(np.array(faults)).tolist():
                for name in (fault, NONE):
                    for _ in range(ATTEMPTS):
                        trials.append(found := running.run(name, str(rng.choice(surfaces))))
                        say(f'{name}: {found.ending} in {found.took_s:.1f} s, {found.peak_n:.1f} N: {found.message}')
                        if found.happened if name == fault else found.ending == SUCCESS:
                            break
                    if found.ending == SUCCESS:  # in spite of the fault: nothing more has to be shown
                        break
    return BenchmarkResult(
        data='emulated sensor, and an emulated arm of 2 kN/m behind ROS controllers without a timeout',
        split='none: one run; the model is trained on simulated slides',
        numbers={
            'seed': seed,
            'requirements': check(trials, running.ended),
            'trials': [one._asdict() for one in trials],
        },
    )
