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

from texture_benchmarks.endurance.faults import Strike, strikes
from texture_benchmarks.endurance.orders import Order, orders
from texture_benchmarks.endurance.pace import Pace, measure_pace
from texture_benchmarks.endurance.processes import Processes
from texture_benchmarks.endurance.record import (
    ABORTED,
    AFTERMATH_S,
    LOST,
    REFUSED,
    SUCCESS,
    Explored,
    Record,
    in_force,
)
from texture_benchmarks.endurance.ros.fault_injector import Striker
from texture_benchmarks.endurance.ros.watcher import Watcher
from texture_benchmarks.endurance.usage import Use, read_use
from texture_bringup.demo.isolation import Isolation, isolate
from texture_bringup.ros.operator import Operator
from texture_core.errors import InvalidParameter, LaunchFailed, MotionAborted, TextureError
from texture_core.exploration import ExplorationRequest
from texture_evaluation.train import train_from_bags
from texture_launch.child import ChildLauncher
from texture_simulation.scene import load_scene
from texture_simulation.simulated_bags import SlidePlan, write_simulated

SCENE, SURFACE = 'twelve_textures', 'glass'
LOOK_S = 10.0  # between two looks at the processes
TOLD_S = 60.0  # between two lines about how it goes
PAUSE_S, LOOK_AFTER_S = 0.2, 1.0  # between two explorations, the latter after one that did not succeed
START_DEADLINE_S = 120.0
# A surface that cannot be swapped within this time, for the bench does not answer, is told.
SWAP_DEADLINE_S = 60.0
SLIDES = SlidePlan(slides=5, speed_m_s=0.08, force_n=1.5, slide_s=1.0)


class Looks:
    """Look from time to time at what the processes use and how quick the machine is; use it in a `with` block."""

    def __init__(self, processes: Processes) -> None:
        self.uses: list[Use] = []
        self.paces: list[Pace] = []
        self._processes = processes
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='looks', daemon=True)

    def __enter__(self) -> Looks:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stop.wait(LOOK_S):
            for node, pid in self._processes.update().items():
                use = read_use(node, pid, time.monotonic())
                if use is not None:
                    self.uses.append(use)
            self.paces.append(measure_pace(time.monotonic()))


class Day:
    """An operator's day: one exploration after the other.

    Parameters
    ----------
    operator, stopper
        Who explores, and who presses stop meanwhile.
    check
        Raises LaunchFailed if the nodes have ended for good.
    """

    def __init__(self, operator: Operator, stopper: Operator, check: Callable[[], None]) -> None:
        self.explored: list[Explored] = []
        self._check = check
        self._operator = operator
        self._stopper = stopper
        self._surface = ''

    def explore(self, order: Order) -> None:
        """Explore as ordered, and note how it ended."""
        self._check()
        begin_s = time.monotonic()
        wanted, ending, message = REFUSED if order.mistaken else SUCCESS, LOST, ''
        stopped: list[str] = []
        try:
            self._lay(order.request.surface)
            answer = self._operator.explore(order.request, lambda *_: self._stop(order, begin_s, stopped))
        except (MotionAborted, LaunchFailed, InvalidParameter) as error:
            message, answer = str(error), None
        if answer is not None:
            ending = SUCCESS if answer.success else ABORTED if answer.exploration_id else REFUSED
            message = answer.message
        self.explored.append(
            Explored(
                begin_s=begin_s,
                end_s=time.monotonic(),
                motion=order.request.motion,
                surface=order.request.surface,
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
            self._operator.set_parameters('bench', {'surface': surface}, SWAP_DEADLINE_S)
            self._surface = surface

    def _stop(self, order: Order, begin_s: float, stopped: list[str]) -> None:
        if not stopped and time.monotonic() - begin_s > order.stop_after_s:
            stopped.append('asked')
            with suppress(TextureError):  # the explorer is frozen or dead just now, which is told otherwise
                self._stopper.stop()


@dataclass(frozen=True)
class Plan:
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
        That the classifier judges by; None: one is trained on simulated slides first.
    settle_s
        Time for the nodes to find each other, before anything is asked of them.
    """

    duration_s: float = 3600.0
    quiet_s: float = 20.0
    seed: int = 0
    model: Path | None = None
    settle_s: float = 10.0


def endure(plan: Plan, log: Path, say: Callable[[str], None], faults: Iterable[Strike] = ()) -> Record:
    """Explore again and again for a while, with faults at random, and once more in peace; return what happened.

    Parameters
    ----------
    plan
        How long, and with what.
    log
        File for what the nodes say.
    say
        Is told now and then how it goes.
    faults
        These faults instead of random ones; the run ends when they are over.
    """
    with tempfile.TemporaryDirectory(prefix='texture_endurance_') as name, ExitStack() as stack:
        folder = Path(name)
        if plan.model is None:
            say(f'training a model on simulated slides over the surfaces of the scene {SCENE}')
            plan = replace(plan, model=_model(folder, plan.seed))
        isolation = isolate(folder)
        launcher = stack.enter_context(_launched(isolation, folder, plan, log))
        domain = isolation.domain_id
        hands = [stack.enter_context(Operator(domain_id=domain, guard=launcher.check)) for _ in range(3)]
        watcher = stack.enter_context(Watcher(domain))
        hands[0].wait_for_explorer(START_DEADLINE_S)
        hands[0].wait_for_signal(START_DEADLINE_S)
        time.sleep(plan.settle_s)
        looks = stack.enter_context(Looks(Processes(log)))
        rngs = [np.random.default_rng((plan.seed, i)) for i in range(2)]
        striker = Striker(faults or strikes(rngs[0], plan.quiet_s), hands[1], Processes(log), watcher)
        day = Day(hands[0], hands[2], launcher.check)
        begin_s = time.monotonic()
        trouble = _work(day, striker, rngs[1], begin_s + plan.duration_s, say)
        end_s = time.monotonic()
        processes = Processes(log)
        processes.update()
    struck = list(striker.struck)
    return Record(
        begin_s=begin_s,
        end_s=end_s,
        seed=plan.seed,
        explored=[replace(item, faults=in_force(struck, item.begin_s, item.end_s)) for item in day.explored],
        struck=struck,
        uses=looks.uses,
        paces=looks.paces,
        totals={node: totals.sums for node, totals in watcher.totals.items()},
        signal=watcher.signal,
        vectors=sum(watcher.ledger.vectors.values()),
        unanswered=watcher.ledger.unanswered,
        said=[(*what, n) for what, n in watcher.said.most_common()],
        ends=processes.ends,
        trouble=trouble,
    )


def _work(day: Day, striker: Striker, rng: np.random.Generator, until_s: float, say: Callable[[str], None]) -> str:
    """Explore until the time is over; return what ended it early, '' if nothing did."""
    told_s = time.monotonic()
    try:
        with striker:
            for order in orders(rng, list(load_scene(SCENE).surfaces)):
                if time.monotonic() > until_s or striker.over:
                    break
                day.explore(order)
                time.sleep(PAUSE_S if day.explored[-1].ending == SUCCESS else LOOK_AFTER_S)
                if time.monotonic() > told_s + TOLD_S:
                    told_s = time.monotonic()
                    say(_progress(day, striker, until_s - told_s))
        time.sleep(AFTERMATH_S)
        day.explore(Order(ExplorationRequest('linear_slide', surface=SURFACE)))
    except KeyboardInterrupt:
        return f'it was interrupted {until_s - time.monotonic():.0f} s before its end'
    except TextureError as error:
        return str(error)
    return f'the faults ended early: {striker.error!r}' if striker.error else ''


def _progress(day: Day, striker: Striker, left_s: float) -> str:
    last = day.explored[-1]
    good = sum(item.ending == SUCCESS for item in day.explored)
    return (
        f'{left_s / 60:.0f} min left; {len(day.explored)} explorations, {good} with success; '
        f'{len(striker.struck)} faults; the last one: {last.ending}, {last.message}'
    )


def _launched(isolation: Isolation, folder: Path, plan: Plan, log: Path) -> ChildLauncher:
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
    return ChildLauncher('bench', arguments, environment, log, together=False)


def _model(folder: Path, seed: int) -> Path:
    bags = write_simulated(folder / 'slides', SLIDES, np.random.default_rng(seed), SCENE)
    train_from_bags('default', bags, out=folder / 'model')
    return folder / 'model'


def _free_tcp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])
