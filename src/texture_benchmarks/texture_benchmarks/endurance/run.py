"""The endurance run from beginning to end."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from texture_benchmarks.endurance.endurance_plan import SCENE, SURFACE, EndurancePlan, launched_nodes, trained_model
from texture_benchmarks.endurance.endurance_record import (
    RECOVERY_S,
    SUCCESS,
    EnduranceRecord,
    in_force,
)
from texture_benchmarks.endurance.faults import PlannedFault, planned_faults
from texture_benchmarks.endurance.loops import ExplorationLoop, UsageSampler
from texture_benchmarks.endurance.planned_explorations import PlannedExploration, planned_explorations
from texture_benchmarks.endurance.processes import Processes
from texture_benchmarks.endurance.ros.fault_injector import FaultInjector
from texture_benchmarks.endurance.ros.watcher import Watcher
from texture_bringup.demo.isolation import isolate
from texture_bringup.ros.operator import Operator
from texture_core.errors import TextureError
from texture_core.exploration import ExplorationRequest
from texture_simulation.scene import load_scene

REPORT_PERIOD_S = 60.0  # between two lines about how it goes
PAUSE_S, LOOK_AFTER_S = 0.2, 1.0  # between two explorations, the latter after one that did not succeed
START_DEADLINE_S = 120.0


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
            plan = replace(plan, model=trained_model(folder, plan.seed))
        isolation = isolate(folder)
        launcher = stack.enter_context(launched_nodes(isolation, folder, plan, log))
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
