"""The endurance run from beginning to end."""

from __future__ import annotations

import os
import socket
import tempfile
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from texture_benchmarks.endurance.endurance_record import (
    ABORTED,
    LOST,
    RECOVERY_S,
    REFUSED,
    SUCCESS,
    EnduranceRecord,
    ExplorationRecord,
    in_force,
)
from texture_benchmarks.endurance.faults import PlannedFault, planned_faults
from texture_benchmarks.endurance.machine_speed import MachineSpeed, measure_machine_speed
from texture_benchmarks.endurance.planned_explorations import PlannedExploration, planned_explorations
from texture_benchmarks.endurance.processes import Processes
from texture_benchmarks.endurance.ros.fault_injector import FaultInjector
from texture_benchmarks.endurance.ros.watcher import Watcher
from texture_benchmarks.endurance.usage import ProcessUsage, read_usage
from texture_bringup.demo.isolation import Isolation, isolate
from texture_bringup.ros.operator import Operator
from texture_core.errors import InvalidParameter, LaunchFailed, MotionAborted, TextureError
from texture_core.exploration import ExplorationRequest
from texture_evaluation.train import train_from_bags
from texture_launch.child import ChildLauncher
from texture_simulation.scene import load_scene
from texture_simulation.simulated_bags import SlidePlan, write_simulated

SCENE, SURFACE = 'twelve_textures', 'glass'
SAMPLE_PERIOD_S = 10.0  # between two looks at the processes
REPORT_PERIOD_S = 60.0  # between two lines about how it goes
PAUSE_S, LOOK_AFTER_S = 0.2, 1.0  # between two explorations, the latter after one that did not succeed
START_DEADLINE_S = 120.0
# A surface that cannot be swapped within this time, for the bench does not answer, is told.
SWAP_DEADLINE_S = 60.0
SLIDES = SlidePlan(slides=5, speed_m_s=0.08, force_n=1.5, slide_s=1.0)


class UsageSampler:
    """Look from time to time at what the processes use and how quick the machine is; use it in a `with` block."""

    def __init__(self, processes: Processes) -> None:
        self.usages: list[ProcessUsage] = []
        self.machine_speeds: list[MachineSpeed] = []
        self._processes = processes
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='usage_sampler', daemon=True)

    def __enter__(self) -> UsageSampler:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stop.wait(SAMPLE_PERIOD_S):
            for node, pid in self._processes.update().items():
                usage = read_usage(node, pid, time.monotonic())
                if usage is not None:
                    self.usages.append(usage)
            self.machine_speeds.append(measure_machine_speed(time.monotonic()))


class ExplorationLoop:
    """Run explorations one after the other and record how they ended.

    Parameters
    ----------
    operator, stopper
        Who explores, and who presses stop meanwhile.
    check
        Raises LaunchFailed if the nodes have ended for good.
    """

    def __init__(self, operator: Operator, stopper: Operator, check: Callable[[], None]) -> None:
        self.explored: list[ExplorationRecord] = []
        self._check = check
        self._operator = operator
        self._stopper = stopper
        self._surface = ''

    def explore(self, planned: PlannedExploration) -> None:
        """Explore as ordered, and note how it ended."""
        self._check()
        begin_s = time.monotonic()
        wanted, ending, message = REFUSED if planned.invalid_on_purpose else SUCCESS, LOST, ''
        stopped: list[str] = []
        try:
            self._lay(planned.request.surface)
            answer = self._operator.explore(planned.request, lambda *_: self._stop(planned, begin_s, stopped))
        except (MotionAborted, LaunchFailed, InvalidParameter) as error:
            message, answer = str(error), None
        if answer is not None:
            ending = SUCCESS if answer.success else ABORTED if answer.exploration_id else REFUSED
            message = answer.message
        self.explored.append(
            ExplorationRecord(
                begin_s=begin_s,
                end_s=time.monotonic(),
                motion=planned.request.motion,
                surface=planned.request.surface,
                ending=ending,
                message=message,
                wanted=ABORTED if stopped else wanted,
                exploration_id=answer.exploration_id if answer else '',
                label=answer.texture.label if answer else '',
                final=bool(answer and answer.texture.final),
            )
        )

    def _lay(self, surface: str) -> None:
        if surface != self._surface:
            self._operator.set_parameters('emulator', {'surface': surface}, SWAP_DEADLINE_S)
            self._surface = surface

    def _stop(self, planned: PlannedExploration, begin_s: float, stopped: list[str]) -> None:
        if not stopped and time.monotonic() - begin_s > planned.stop_after_s:
            stopped.append('asked')
            with suppress(TextureError):  # the explorer is frozen or dead just now, which is told otherwise
                self._stopper.stop()


@dataclass(frozen=True)
class EndurancePlan:
    """What is run.

    Parameters
    ----------
    duration_s
        How long.
    quiet_s
        Mean time between two faults.
    seed
        Of orders, faults and the bench.
    model
        That the classifier classifies by; None: one is trained on simulated slides first.
    settle_s
        Time for the nodes to find each other, before anything is asked of them.
    """

    duration_s: float = 3600.0
    quiet_s: float = 20.0
    seed: int = 0
    model: Path | None = None
    settle_s: float = 10.0


def endure(
    plan: EndurancePlan, log: Path, say: Callable[[str], None], faults: Iterable[PlannedFault] = ()
) -> EnduranceRecord:
    """Explore again and again for a while, with faults at random, and once more in peace; return what happened.

    Parameters
    ----------
    plan
        How long, and with what.
    log
        File for what the nodes say.
    say
        Called now and then with a line about the progress.
    faults
        These faults instead of random ones; the run ends when they are over.

    Returns
    -------
    EnduranceRecord
        Explorations, faults and usage.
    """
    with tempfile.TemporaryDirectory(prefix='texture_endurance_') as name, ExitStack() as stack:
        folder = Path(name)
        if plan.model is None:
            say(f'training a model on simulated slides over the surfaces of the scene {SCENE}')
            plan = replace(plan, model=_model(folder, plan.seed))
        isolation = isolate(folder)
        launcher = stack.enter_context(_launched(isolation, folder, plan, log))
        domain = isolation.domain_id
        clients = [stack.enter_context(Operator(domain_id=domain, guard=launcher.check)) for _ in range(3)]
        watcher = stack.enter_context(Watcher(domain))
        clients[0].wait_for_explorer(START_DEADLINE_S)
        clients[0].wait_for_signal(START_DEADLINE_S)
        time.sleep(plan.settle_s)
        usage_sampler = stack.enter_context(UsageSampler(Processes(log)))
        rngs = [np.random.default_rng((plan.seed, i)) for i in range(2)]
        fault_injector = FaultInjector(
            faults or planned_faults(rngs[0], plan.quiet_s), clients[1], Processes(log), watcher
        )
        exploration_loop = ExplorationLoop(clients[0], clients[2], launcher.check)
        begin_s = time.monotonic()
        ended_early_by = _work(exploration_loop, fault_injector, rngs[1], begin_s + plan.duration_s, say)
        end_s = time.monotonic()
        processes = Processes(log)
        processes.update()
    fault_events = list(fault_injector.fault_events)
    return EnduranceRecord(
        begin_s=begin_s,
        end_s=end_s,
        seed=plan.seed,
        explored=[
            replace(item, faults=in_force(fault_events, item.begin_s, item.end_s)) for item in exploration_loop.explored
        ],
        fault_events=fault_events,
        usages=usage_sampler.usages,
        machine_speeds=usage_sampler.machine_speeds,
        totals={node: totals.sums for node, totals in watcher.totals.items()},
        signal=watcher.signal,
        vectors=sum(watcher.answers.vectors.values()),
        unanswered=watcher.answers.unanswered,
        said=[(*what, n) for what, n in watcher.said.most_common()],
        ends=processes.ends,
        ended_early_by=ended_early_by,
    )


def _work(
    exploration_loop: ExplorationLoop,
    fault_injector: FaultInjector,
    rng: np.random.Generator,
    until_s: float,
    say: Callable[[str], None],
) -> str:
    """Explore until the time is over; return what ended it early, '' if nothing did."""
    reported_s = time.monotonic()
    try:
        with fault_injector:
            for planned in planned_explorations(rng, list(load_scene(SCENE).surfaces)):
                if time.monotonic() > until_s or fault_injector.over:
                    break
                exploration_loop.explore(planned)
                time.sleep(PAUSE_S if exploration_loop.explored[-1].ending == SUCCESS else LOOK_AFTER_S)
                if time.monotonic() > reported_s + REPORT_PERIOD_S:
                    reported_s = time.monotonic()
                    say(_progress(exploration_loop, fault_injector, until_s - reported_s))
        time.sleep(RECOVERY_S)
        exploration_loop.explore(PlannedExploration(ExplorationRequest('linear_slide', surface=SURFACE)))
    except KeyboardInterrupt:
        return f'it was interrupted {until_s - time.monotonic():.0f} s before its end'
    except TextureError as error:
        return str(error)
    return f'the faults ended early: {fault_injector.error!r}' if fault_injector.error else ''


def _progress(exploration_loop: ExplorationLoop, fault_injector: FaultInjector, left_s: float) -> str:
    last = exploration_loop.explored[-1]
    good = sum(item.ending == SUCCESS for item in exploration_loop.explored)
    return (
        f'{left_s / 60:.0f} min left; {len(exploration_loop.explored)} explorations, {good} with success; '
        f'{len(fault_injector.fault_events)} faults; the last one: {last.ending}, {last.message}'
    )


def _launched(isolation: Isolation, folder: Path, plan: EndurancePlan, log: Path) -> ChildLauncher:
    assert plan.model is not None
    card = plan.model.with_suffix('.json').resolve()
    arguments = {
        'device': isolation.device,
        'finger_port': isolation.finger_port,
        'scene': SCENE,
        'seed': plan.seed,
        'model': card,
        'recipe': card,
        'watch_signal': 'true',
        'dashboard': 'true',
        'dashboard_port': _free_tcp_port(),
    }
    environment = isolation.environment({**os.environ, 'ROS_LOG_DIR': str(folder / 'ros_log')})
    return ChildLauncher('emulator', arguments, environment, log, together=False)


def _model(folder: Path, seed: int) -> Path:
    bags = write_simulated(folder / 'slides', SLIDES, np.random.default_rng(seed), SCENE)
    train_from_bags('default', bags, out=folder / 'model')
    return folder / 'model'


def _free_tcp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])
