"""The robot part of an endurance run: the launched explorer on emulated robots, one rig after the other."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from texture_benchmarks.endurance.explorer_session import ExplorerSession
from texture_benchmarks.endurance.robot_faults import (
    RobotSession,
    sessions,
)
from texture_benchmarks.endurance.robot_record import ExplorerExit, RobotExploration, RobotRecord
from texture_benchmarks.endurance.robot_requirements import (
    SUCCESS,
)
from texture_benchmarks.endurance.robot_rigs import RIG_CLASSES
from texture_bringup.demo.isolation import isolate
from texture_core.errors import TextureError


@dataclass(frozen=True)
class RobotPlan:
    """What is run.

    Parameters
    ----------
    duration_s
        How long; the session that runs then is finished.
    seed
        Of requests and faults.
    """

    duration_s: float = 2400.0
    seed: int = 0


def endure_robots(
    plan: RobotPlan,
    log: Path,
    say: Callable[[str], None],
    given: Iterable[RobotSession] = (),
    keep: Callable[[RobotRecord], object] = lambda _record: None,
) -> RobotRecord:
    """Let faults strike the emulated robots for a while; return what happened.

    Parameters
    ----------
    plan
        How long, and with what.
    log
        File for what the explorers say.
    say
        Called after each session with a line about its result.
    given
        These sessions instead of random ones; the run ends with them.
    keep
        Is given what happened so far after each session, so that nothing is lost with this process.

    Returns
    -------
    RobotRecord
        All sessions.
    """
    begin_s = time.monotonic()
    explorations: list[RobotExploration] = []
    exits: list[ExplorerExit] = []
    load: list[float] = []
    parameters: dict[str, dict[str, object]] = {}
    ended_early_by = ''

    def record(ended_by: str) -> RobotRecord:
        return RobotRecord(
            begin_s, time.monotonic(), plan.seed, len(exits), explorations, exits, parameters, load, ended_by
        )

    with tempfile.TemporaryDirectory(prefix='endurance_robots_') as folder, log.open('w', encoding='utf-8') as told:
        domain_id = isolate(Path(folder)).domain_id
        try:
            for session in given or sessions(plan.seed):
                if time.monotonic() > begin_s + plan.duration_s:
                    break
                explorer_exit = _run_session(session, domain_id, told.write, explorations, parameters)
                exits.append(explorer_exit)
                load.append(os.getloadavg()[0])
                keep(record('it has not ended yet'))
                say(_progress(session, explorations, begin_s + plan.duration_s))
        except KeyboardInterrupt:
            ended_early_by = f'it was interrupted {begin_s + plan.duration_s - time.monotonic():.0f} s before its end'
        except TextureError as error:
            ended_early_by = str(error)
    return record(ended_early_by)


def _run_session(
    session: RobotSession,
    domain_id: int,
    tell: Callable[[str], object],
    explorations: list[RobotExploration],
    parameters: dict[str, dict[str, object]],
) -> ExplorerExit:
    with RIG_CLASSES[session.rig](session) as rig:
        parameters[session.rig] = {name: value for name, value in rig.parameters.items() if name not in PLACES}
        with ExplorerSession(session, rig, domain_id) as life:
            try:
                life.run()
                return life.end()
            finally:
                explorations += life.explorations
                tell(f'--- {session}\n{life.output}')


PLACES = ('device', 'ip', 'finger_port', 'arm', 'hand', 'seed')  # parameters that say where and not how


def _progress(session: RobotSession, explorations: list[RobotExploration], until_s: float) -> str:
    good = sum(item.ending == SUCCESS for item in explorations)
    last = explorations[-1]
    return (
        f'{max(0.0, until_s - time.monotonic()) / 60:.0f} min left; {session.rig}: {len(explorations)} explorations '
        f'so far, {good} with success; the last one ({last.fault}): {last.ending}, {last.message}'
    )
