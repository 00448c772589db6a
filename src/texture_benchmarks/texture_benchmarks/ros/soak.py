# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Run the nodes for hours: explore, inject faults, listen to everything."""

from __future__ import annotations

import math
import os
import re
import signal
import socket
import tempfile
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped, WrenchStamped
from rcl_interfaces.msg import Log
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from texture_msgs import msg

from texture_benchmarks import soak
from texture_benchmarks.ros.graph import Graph, GraphT
from texture_bringup.demo import free_domain, isolated
from texture_bringup.launcher import ChildLauncher
from texture_bringup.operator import Operator
from texture_core.errors import InvalidParameter, LaunchFailed, MotionAborted, TextureError
from texture_core.ros import ESTIMATE_QOS, FEATURE_QOS, to_ns
from texture_core.ros_testing import NodeProcess
from texture_core.types import NANOSECONDS, ExplorationRequest, ExplorationState, Phase
from texture_evaluation.train import train_from_bags
from texture_simulation.offline import SlidePlan, write_simulated
from texture_simulation.scene import load_scene


class Listener(Graph):
    """Take part in a graph in a thread of its own, from `with` to the end of the block."""

    def __init__(self, domain_id: int) -> None:
        super().__init__(domain_id, 'watcher')
        self._thread = threading.Thread(target=self._spin, name='watcher', daemon=True)

    def __enter__(self: GraphT) -> GraphT:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._context.try_shutdown()
        self._thread.join()
        super().__exit__()

    def _spin(self) -> None:
        with suppress(ExternalShutdownException):
            self._executor.spin()


COUNTED = re.compile(r'\d+')
LEVELS = {Log.WARN: 'WARN', Log.ERROR: 'ERROR', Log.FATAL: 'FATAL'}
# Deep: what this listener loses must not look as if the driver had lost it.
SIGNAL_QOS = QoSProfile(depth=2000, reliability=ReliabilityPolicy.BEST_EFFORT)
LOG_QOS = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Watcher(Listener):
    """Keep books about the nodes of one domain, in a thread of its own; use it in a `with` block."""

    def __init__(self, domain_id: int) -> None:
        self.signal = soak.SampleAccount()
        self.vectors: Counter[str] = Counter()  # by exploration, as their estimates
        self.estimates: Counter[str] = Counter()
        self.totals: defaultdict[str, soak.Totals] = defaultdict(soak.Totals)
        self.said: Counter[tuple[str, str, str]] = Counter()
        self.received_s: dict[str, float] = {}
        super().__init__(domain_id)
        node = self.node
        node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)
        node.create_subscription(Log, '/rosout', self._on_log, LOG_QOS)
        node.create_subscription(msg.TactileSignal, 'signal', self._on_signal, SIGNAL_QOS)
        node.create_subscription(msg.FeatureVector, 'features', self._on_vector, FEATURE_QOS)
        node.create_subscription(msg.TextureEstimate, 'texture', self._on_estimate, ESTIMATE_QOS)

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        for status in array.status:
            node = status.name.rpartition('/')[2]
            counters = soak.COUNTERS.get(node, ())
            self.totals[node].update({item.key: int(item.value) for item in status.values if item.key in counters})
            self.received_s[node] = time.monotonic()

    def _on_log(self, log: Log) -> None:
        if log.level in LEVELS:
            self.said[log.name, LEVELS[log.level], COUNTED.sub('…', log.msg)] += 1

    def _on_signal(self, batch: msg.TactileSignal) -> None:
        count = len(batch.samples) // max(1, len(batch.channels))
        self.signal.update(batch.first_sample, count, to_ns(batch.header.stamp), batch.sampling_rate_hz)
        self.received_s['signal'] = time.monotonic()

    def _on_vector(self, vector: msg.FeatureVector) -> None:
        self.vectors[vector.exploration_id] += 1

    def _on_estimate(self, estimate: msg.TextureEstimate) -> None:
        self.estimates[estimate.exploration_id] += 1


NODES = ('emulator', 'sensor', 'explorer', 'feature_extractor', 'classifier')
BACK_DEADLINE_S = 60.0
POLL_S = 0.05


class FaultInjector:
    """Inject faults in a thread of its own; use it in a `with` block."""

    def __init__(
        self, planned: Iterable[soak.PlannedFault], operator: Operator, processes: soak.Processes, watcher: Watcher
    ) -> None:
        self.fault_events: list[soak.FaultEvent] = []
        self.error: Exception | None = None
        self._planned_faults = planned
        self._operator = operator
        self._processes = processes
        self._watcher = watcher
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='fault_injector', daemon=True)

    def __enter__(self) -> FaultInjector:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    @property
    def over(self) -> bool:
        """Whether there are no more faults to come."""
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            for planned_fault in self._planned_faults:
                if self._stop.wait(planned_fault.quiet_s):
                    return
                self._inject(planned_fault)
        except Exception as error:  # stands in the report, which is written in any case
            self.error = error

    def _inject(self, planned: soak.PlannedFault) -> None:
        begin_s = time.monotonic()
        self.fault_events.append(soak.FaultEvent(planned.name, begin_s, math.inf, math.inf, ''))
        detail = self._act(planned, *soak.FAULTS[planned.name][:2])
        end_s = time.monotonic()
        self.fault_events[-1] = soak.FaultEvent(planned.name, begin_s, end_s, math.inf, detail)
        self.fault_events[-1] = soak.FaultEvent(planned.name, begin_s, end_s, self._back(end_s), detail)

    def _act(self, planned: soak.PlannedFault, action: str, node: str) -> str:
        """Inject a fault, and take back what does not heal by itself; return its strength in words."""
        if action in ('unplug', 'corrupt'):
            name, bad, good = ('plugged', False, True) if action == 'unplug' else ('bit_flips', planned.strength, 0.0)
            self._operator.set_parameters('emulator', {name: bad})
            self._stop.wait(planned.hold_s)
            self._operator.set_parameters('emulator', {name: good})
            return f'{name} {bad:g} for {planned.hold_s:.1f} s'
        pid = self._processes.update().get(node)
        if pid is None:
            raise LaunchFailed(f"node '{node}' does not run any more")
        if action == 'kill':
            os.kill(pid, signal.SIGKILL)
            return f'process {pid}'
        os.kill(pid, signal.SIGSTOP)
        try:
            self._stop.wait(planned.hold_s)
        finally:
            os.kill(pid, signal.SIGCONT)
        return f'for {planned.hold_s:.1f} s'

    def _back(self, since_s: float) -> float:
        """Return when all nodes report again and samples arrive: NaN if not in time, inf if the run ends before."""
        awaited = (*NODES, 'signal')
        while time.monotonic() < since_s + BACK_DEADLINE_S:
            if self._stop.is_set():
                return math.inf
            running = self._processes.update()
            if all(name in running for name in NODES):
                received_s = [self._watcher.received_s.get(name, 0.0) for name in awaited]
                if min(received_s) > since_s:
                    return max(received_s)
            time.sleep(POLL_S)
        return math.nan


SAMPLE_PERIOD_S = 10.0  # between two looks at the processes
# A surface that cannot be swapped within this time, for the bench does not answer, is told.
SWAP_DEADLINE_S = 60.0


class ExplorationLoop:
    """Run explorations one after the other and record how they ended."""

    def __init__(self, operator: Operator, stopper: Operator, check: Callable[[], None]) -> None:
        self.explored: list[soak.ExplorationRecord] = []
        self._check = check
        self._operator = operator
        self._stopper = stopper
        self._surface = ''

    def explore(self, planned: soak.PlannedExploration) -> None:
        """Explore as ordered, and note how it ended."""
        self._check()
        begin_s = time.monotonic()
        wanted, ending = soak.REFUSED if planned.invalid_on_purpose else soak.SUCCESS, soak.LOST
        stopped: list[str] = []
        exploration_id = ''
        try:
            if planned.request.surface != self._surface:
                self._operator.set_parameters('emulator', {'surface': planned.request.surface}, SWAP_DEADLINE_S)
                self._surface = planned.request.surface
            answer = self._operator.explore(planned.request, lambda *_: self._stop(planned, begin_s, stopped))
            ending = soak.SUCCESS if answer.success else soak.ABORTED if answer.exploration_id else soak.REFUSED
            message, exploration_id = answer.message, answer.exploration_id
        except (MotionAborted, LaunchFailed, InvalidParameter) as error:
            message = str(error)
        end_s = time.monotonic()
        self.explored.append(
            soak.ExplorationRecord(begin_s, end_s, ending, message, soak.ABORTED if stopped else wanted, exploration_id)
        )

    def _stop(self, planned: soak.PlannedExploration, begin_s: float, stopped: list[str]) -> None:
        if not stopped and time.monotonic() - begin_s > planned.stop_after_s:
            stopped.append('asked')
            with suppress(TextureError):  # the explorer is frozen or dead just now, which is told otherwise
                self._stopper.stop()


SCENE, SURFACE = 'twelve_textures', 'glass'
SLIDES = SlidePlan(slides=5, speed_m_s=0.08, force_n=1.5, slide_s=1.0)


@dataclass(frozen=True)
class SoakPlan:
    """What is run."""

    duration_s: float = 3600.0  # How long
    quiet_s: float = 20.0  # Mean time between two faults
    seed: int = 0  # Of orders, faults and the bench
    model: Path | None = None  # That the classifier classifies by; None: one is trained on simulated slides first
    settle_s: float = 10.0  # Time for the nodes to find each other, before anything is asked of them


def launched_nodes(domain_id: int, folder: Path, plan: SoakPlan, log: Path) -> ChildLauncher:
    """Return the launch of the emulator with a model, trained if there is none; use it in a `with` block."""
    model = plan.model
    if model is None:
        bags = write_simulated(folder / 'slides', SLIDES, np.random.default_rng(plan.seed), SCENE)
        train_from_bags('default', bags, out=folder / 'model')
        model = folder / 'model'
    card = model.with_suffix('.json').resolve()
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind(('127.0.0.1', 0))
        port = int(probe.getsockname()[1])
    arguments = {
        'devices': folder,
        'scene': SCENE,
        'seed': plan.seed,
        'model': card,
        'recipe': card,
        'watch_signal': 'true',
        'dashboard': 'true',
        'dashboard_port': port,
    }
    environment = isolated(domain_id, {**os.environ, 'ROS_LOG_DIR': str(folder / 'ros_log')})
    return ChildLauncher('emulator', arguments, environment, log, together=False)


REPORT_PERIOD_S = 60.0  # between two lines about how it goes
PAUSE_S, LOOK_AFTER_S = 0.2, 1.0  # between two explorations, the latter after one that did not succeed
START_DEADLINE_S = 120.0
CALM_S = soak.RECOVERY_S  # after the last fault, before the last exploration


def endure(
    plan: SoakPlan, log: Path, say: Callable[[str], None], faults: Iterable[soak.PlannedFault] = ()
) -> soak.SoakRecord:
    """Explore again and again for a while, with faults at random, and once more in peace; return what happened.

    With faults of one's own, the run ends when they are over. `say` is told now and then how it goes.
    """
    with tempfile.TemporaryDirectory(prefix='texture_endurance_') as name, ExitStack() as stack:
        domain = free_domain()
        launcher = stack.enter_context(launched_nodes(domain, Path(name), plan, log))
        clients = [stack.enter_context(Operator(domain_id=domain, guard=launcher.check)) for _ in range(3)]
        watcher = stack.enter_context(Watcher(domain))
        clients[0].wait_for_explorer(START_DEADLINE_S)
        clients[0].wait_for_signal(START_DEADLINE_S)
        time.sleep(plan.settle_s)
        rngs = [np.random.default_rng((plan.seed, i)) for i in range(2)]
        planned = faults or soak.planned_faults(rngs[0], plan.quiet_s)
        injector = FaultInjector(planned, clients[1], soak.Processes(log), watcher)
        loop = ExplorationLoop(clients[0], clients[2], launcher.check)
        begin_s, processes, usages = time.monotonic(), soak.Processes(log), list[soak.ProcessUsage]()

        def look() -> None:
            found = [soak.read_usage(node, pid, time.monotonic()) for node, pid in processes.update().items()]
            usages.extend(usage for usage in found if usage)

        ended_early_by = _work(loop, injector, rngs[1], begin_s + plan.duration_s, (look, say))
        end_s = time.monotonic()
        processes.update()
    events = list(injector.fault_events)
    return soak.SoakRecord(
        begin_s=begin_s,
        end_s=end_s,
        seed=plan.seed,
        explored=[replace(item, faults=soak.in_force(events, item.begin_s, item.end_s)) for item in loop.explored],
        fault_events=events,
        usages=usages,
        totals={node: totals.sums for node, totals in watcher.totals.items()},
        signal=watcher.signal,
        vectors=sum(watcher.vectors.values()),
        unanswered={
            name: n - watcher.estimates[name] for name, n in watcher.vectors.items() if n > watcher.estimates[name]
        },
        said=[(*what, n) for what, n in watcher.said.most_common()],
        ends=processes.ends,
        ended_early_by=ended_early_by,
    )


def _work(
    loop: ExplorationLoop,
    injector: FaultInjector,
    rng: np.random.Generator,
    until_s: float,
    told: tuple[Callable[[], None], Callable[[str], None]],
) -> str:
    """Explore until the time is over; return what ended it early, '' if nothing did."""
    look, say = told
    reported_s = looked_s = time.monotonic()
    try:
        with injector:
            for planned in soak.planned_explorations(rng, list(load_scene(SCENE).surfaces)):
                if time.monotonic() > until_s or injector.over:
                    break
                loop.explore(planned)
                last = loop.explored[-1]
                time.sleep(PAUSE_S if last.ending == soak.SUCCESS else LOOK_AFTER_S)
                if time.monotonic() > looked_s + SAMPLE_PERIOD_S:
                    looked_s = time.monotonic()
                    look()
                if time.monotonic() > reported_s + REPORT_PERIOD_S:
                    reported_s = time.monotonic()
                    say(
                        f'{(until_s - reported_s) / 60:.0f} min left; {len(loop.explored)} explorations, '
                        f'{len(injector.fault_events)} faults; the last one: {last.ending}, {last.message}'
                    )
        time.sleep(CALM_S)
        loop.explore(soak.PlannedExploration(ExplorationRequest('linear_slide', surface=SURFACE)))
    except KeyboardInterrupt:
        return f'it was interrupted {until_s - time.monotonic():.0f} s before its end'
    except TextureError as error:
        return str(error)
    return f'the faults ended early: {injector.error!r}' if injector.error else ''


# Hazards of an arm behind ROS controllers

ARM = {
    'arm': 'ros_controllers',
    'accept_no_timeout': True,
    'accept_shared_group': True,
    'watch_signal': False,
    'connect_timeout_s': 10.0,
    # Patient with a busy machine; what comes 0.5 s late is too late all the same.
    'deadman_s': 0.4,
    'state_timeout_s': 1.0,
    'approach_timeout_s': 60.0,
    'approach_stiffness_n_m': 20000.0,
}
CONTROLLER = {'start_height_m': 0.004, 'command_timeout_s': 0.0}  # it holds the last velocity for ever
SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=3.0, distance_m=0.06)
GUARD = 'texture_exploration.ros.guard'
SETTLED_S = 1.0
OTHER_M_S, OTHER_PERIOD_S = 0.01, 0.02  # what the other commander wants, along the surface, and how often


class HazardRig(Listener):
    """An emulated controller, an explorer and what befalls them; use it in a `with` block."""

    def __init__(self, domain_id: int, clients: Sequence[Operator]) -> None:
        super().__init__(domain_id)
        self.force = soak.ForceAccount()
        self._explorations, self._settings = clients
        self._domain_id = domain_id
        self._controller = self._new_controller({})
        self._explorer = self._new_explorer()
        self.node.create_subscription(WrenchStamped, 'true_wrench', self._on_wrench, 1000)

    def __enter__(self) -> HazardRig:
        self._controller.__enter__()
        self._explorer.__enter__()
        return super().__enter__()

    def __exit__(self, *error: object) -> None:
        self._explorer.stop()
        self._controller.stop()
        super().__exit__(*error)

    def explore(self, name: str) -> soak.HazardRecord:
        """Explore while something befalls the arm, put it right, and return how it went."""
        hazard = soak.HAZARDS.get(name, soak.ArmHazard())
        if hazard.from_start:
            self._begin_anew(hazard.given)
        self._wait_for_explorer()
        self.force = soak.ForceAccount()
        happened = [] if hazard.process or hazard.commander else ['before']

        def on_progress(state: ExplorationState, _texture: Any) -> None:
            if state.phase is Phase.SLIDE and not happened:
                happened.append('in the slide')
                self._act(hazard)

        exploration_id = ''
        try:
            answer = self._explorations.explore(SLIDE, on_progress)
            message, exploration_id = answer.message, answer.exploration_id
            ending = soak.SUCCESS if answer.success else soak.ABORTED if exploration_id else soak.REFUSED
        except (MotionAborted, LaunchFailed) as error:
            ending, message = soak.LOST, str(error)
        time.sleep(SETTLED_S)
        left_n, force = self.force.newest_n, self.force
        if not hazard.obeys:
            self._lift_anew()
            left_n = self.force.newest_n
        if hazard.from_start or not hazard.obeys:
            self._begin_anew({})
        return soak.HazardRecord(name, bool(happened), ending, message, force.peak_n, force.above_s, left_n)

    def _act(self, hazard: soak.ArmHazard) -> None:
        if hazard.commander:
            self._command_too(hazard.hold_s)
            return
        pid = self._explorer.process.pid
        if hazard.process == 'guard':
            pid = next(child for child in children(pid) if GUARD in command_line(child))
        os.kill(pid, hazard.number)
        if hazard.hold_s:
            time.sleep(hazard.hold_s)
            os.kill(pid, signal.SIGCONT)

    def _command_too(self, hold_s: float) -> None:
        publisher = self.node.create_publisher(TwistStamped, 'twist_controller/twist', 1)
        end_s = time.monotonic() + hold_s
        while time.monotonic() < end_s:
            twist = TwistStamped()
            twist.header.stamp, twist.header.frame_id = self.node.get_clock().now().to_msg(), 'base'
            twist.twist.linear.y = OTHER_M_S
            publisher.publish(twist)
            time.sleep(OTHER_PERIOD_S)
        self.node.destroy_publisher(publisher)

    def _begin_anew(self, given: Mapping[str, Any]) -> None:
        """Start a controller with other parameters, with its finger where all began, and an explorer on it."""
        self._explorer.stop()
        self._controller.stop()
        self._controller = self._new_controller(given).__enter__()
        self._explorer = self._new_explorer().__enter__()

    def _lift_anew(self) -> None:
        """Put the controller right, and lift the finger by another explorer, as an operator does after a fault."""
        self._explorer.stop()
        self._settings.set_parameters('twist_controller', soak.HARMLESS)
        self._explorer = self._new_explorer().__enter__()
        self._wait_for_explorer()
        with suppress(TextureError):  # what is left of the force tells
            self._settings.call('explorer/lift', 'start the explorer')
        time.sleep(SETTLED_S)

    def _wait_for_explorer(self) -> None:
        """Wait until the explorer answers: it is there for nobody as long as it connects to its arm.

        An answer to one whom it has not discovered yet is lost, so that it is asked again.
        """
        self._explorations.wait_for_explorer(START_DEADLINE_S)
        deadline_s = time.monotonic() + START_DEADLINE_S
        while time.monotonic() < deadline_s:
            with suppress(LaunchFailed):
                self._explorations.stop()
                return
        raise LaunchFailed(f'the explorer does not answer (waited {START_DEADLINE_S:.0f} s)')

    def _new_controller(self, given: Mapping[str, Any]) -> NodeProcess:
        return NodeProcess('texture_simulation', 'twist_controller', {**CONTROLLER, **given}, domain_id=self._domain_id)

    def _new_explorer(self) -> NodeProcess:
        return NodeProcess('texture_exploration', 'explorer', ARM, domain_id=self._domain_id)

    def _on_wrench(self, wrench: WrenchStamped) -> None:
        force = wrench.wrench.force
        self.force.update(to_ns(wrench.header.stamp) / NANOSECONDS, math.hypot(force.x, force.y, force.z))


def children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    found: list[int] = []
    for thread in Path('/proc', str(pid), 'task').glob('*/children'):
        with suppress(OSError):  # it has ended meanwhile
            found += map(int, thread.read_text(encoding='ascii').split())
    return found


def command_line(pid: int) -> list[str]:
    """Return the words by which a process was started, none if it has ended."""
    try:
        return (Path('/proc') / str(pid) / 'cmdline').read_text(errors='replace').split('\0')
    except OSError:
        return []


def endure_hazards(
    plan: SoakPlan, say: Callable[[str], None], names: Sequence[str] = tuple(soak.HAZARDS)
) -> list[soak.HazardRecord]:
    """Explore with each hazard in turn, in calm after each, again and again until the time is over; each comes once."""
    records: list[soak.HazardRecord] = []
    with ExitStack() as stack:
        domain = free_domain()
        stack.enter_context(mock.patch.dict(os.environ, isolated(domain, os.environ)))
        clients = [stack.enter_context(Operator(domain_id=domain)) for _ in range(2)]
        rig = stack.enter_context(HazardRig(domain, clients))
        end_s = time.monotonic() + plan.duration_s
        rng = np.random.default_rng(plan.seed)
        while not records or time.monotonic() < end_s:
            for name in rng.permutation(np.array(names)).tolist():
                # A busy machine may abort before the slide, or slide too slowly for a success: so many attempts.
                for hazard in (name, soak.NO_HAZARD):
                    for _ in range(soak.ATTEMPTS):
                        records.append(found := rig.explore(hazard))
                        say(
                            f'{hazard}: {found.ending}, {found.peak_n:.1f} N, {found.above_s * 1e3:.0f} ms above '
                            f'{soak.FORCE_LIMIT_N:g} N, {found.left_n:.2f} N left: {found.message}'
                        )
                        if found.happened if hazard == name else found.ending == soak.SUCCESS:
                            break
    return records
