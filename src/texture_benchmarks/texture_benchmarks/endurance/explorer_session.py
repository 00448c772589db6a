"""One explorer and its robot, started, asked, disturbed and ended."""

from __future__ import annotations

import signal
import time
from contextlib import ExitStack

from texture_benchmarks.endurance.robot_faults import (
    ROBOT_FAULTS,
    RobotSession,
    RobotTrial,
)
from texture_benchmarks.endurance.robot_record import ExplorerExit, RobotExploration
from texture_benchmarks.endurance.robot_requirements import (
    ABORTED,
    DEADLINE_S,
    HUNG,
    LOST,
    REFUSED,
    SUCCESS,
)
from texture_benchmarks.endurance.robot_rigs import TOUCH, RobotRig
from texture_benchmarks.endurance.ros.robot_client import RobotClient
from texture_benchmarks.endurance.timed_fault_injection import TIMEOUT_S, TimedFaultInjection
from texture_benchmarks.endurance.true_contact import true_contact
from texture_bringup.ros.operator import ExplorationResult, Operator
from texture_core.errors import InvalidParameter, LaunchFailed, MotionAborted
from texture_core.node_process import NodeProcess

START_DEADLINE_S = 60.0
SERVICE_DEADLINE_S = 30.0
MAX_ATTEMPTS = 3  # of the same request after a fault
PAUSE_S = 0.2


class ExplorerSession:
    """One life of the explorer on a rig that has been started; use it in a `with` block.

    Parameters
    ----------
    session
        What to do.
    rig
        Started.
    domain_id
        ROS domain of this run.
    """

    def __init__(self, session: RobotSession, rig: RobotRig, domain_id: int) -> None:
        self.explorations: list[RobotExploration] = []
        self._session = session
        self._rig = rig
        self._faults = ROBOT_FAULTS[session.rig]
        self._process = NodeProcess(
            'texture_exploration', 'explorer', rig.parameters, domain_id=domain_id, program=rig.program
        )
        self._domain_id = domain_id
        self._open = ExitStack()

    def __enter__(self) -> ExplorerSession:
        self._open.enter_context(self._process)
        self._client = self._open.enter_context(RobotClient(self._domain_id))
        self._operator = self._open.enter_context(Operator(domain_id=self._domain_id, guard=self._check))
        self._operator.wait_for_explorer(START_DEADLINE_S)
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def run(self) -> None:
        """Explore once for each trial, and again after each fault."""
        for trial in self._session.trials:
            if self._process.process.poll() is not None:
                return
            last = self._explore(trial, 0)
            self._rig.restore(trial.fault)
            known = self._faults[trial.fault.name]
            for attempt in range(1, MAX_ATTEMPTS + 1):
                if last.ending in (SUCCESS, LOST) or known.surface:
                    break
                last = self._explore(trial, attempt, self._remedy(last))
            time.sleep(PAUSE_S)

    def end(self) -> ExplorerExit:
        """End the explorer, and see that nothing is left with torque or in motion."""
        killed = self._process.process.poll() is not None
        how = 'SIGKILL in the slide' if killed else self._session.exit_by
        begin_s = time.monotonic()
        self._process.stop(getattr(signal, self._session.exit_by))
        return ExplorerExit(self._session.rig, how, begin_s, time.monotonic() - begin_s, self._rig.powered())

    @property
    def output(self) -> str:
        """What the explorer said."""
        return self._process.output

    def _check(self) -> None:
        if self._process.process.poll() is not None:
            raise MotionAborted('the explorer process has ended')

    def _explore(self, trial: RobotTrial, attempt: int, remedy: str = '') -> RobotExploration:
        """Explore with the fault of the trial, or without if this is a further attempt."""
        begin_s = time.monotonic()
        self._client.begin()
        when = self._faults[trial.fault.name].when if attempt == 0 else ''
        with TimedFaultInjection(trial, self._rig, self._client, self._process.process.pid, when) as injection:
            ending, message, exploration_id = self._ask(trial)
        end_s = time.monotonic()
        fingers = [item for item in list(self._rig.fingers.fingers) if begin_s <= item.time_ns * 1e-9 <= end_s]
        min_contact_n = TOUCH.lost_force_share * trial.request.force_n
        refused_program = trial.fault.name == 'another program at connect' and attempt == 0
        item = RobotExploration(
            rig=self._session.rig,
            fault=trial.fault.name,
            detail=injection.detail,
            injected=injection.done,
            attempt=attempt,
            begin_s=begin_s,
            end_s=end_s,
            motion=trial.request.motion,
            force_n=trial.request.force_n,
            ending=ending,
            message=message,
            contact=true_contact(fingers, self._client.slide_ns(exploration_id), min_contact_n),
            lost_contact_s=TOUCH.lost_contact_s,
            remedy=remedy,
            taken_over=self._rig.taken_over() if refused_program else '',
        )
        self.explorations.append(item)
        return item

    def _ask(self, trial: RobotTrial) -> tuple[str, str, str]:
        """Explore; return how it ended, the sentence, and the name of the exploration."""
        begin_s = time.monotonic()
        try:
            answer = self._operator.explore(trial.request)
        except (MotionAborted, LaunchFailed, InvalidParameter) as error:
            gone = self._process.process.poll() is not None
            hung = not gone and time.monotonic() - begin_s > min(TIMEOUT_S, DEADLINE_S)
            return HUNG if hung else LOST, str(error), ''
        return _ending(answer), answer.message, answer.exploration_id

    def _remedy(self, last: RobotExploration) -> str:
        """Recover, or reboot the motors if a sentence of the explorer asks for that; return the answers."""
        answers = []
        if not _asks_for_reboot(last.message):
            done, message = self._client.call('recover', SERVICE_DEADLINE_S)
            answers.append(f'recover: {message}')
            if done or not _asks_for_reboot(message):
                return answers[0]
        _, message = self._client.call('reboot', SERVICE_DEADLINE_S)
        return '; '.join([*answers, f'reboot: {message}'])


def _asks_for_reboot(message: str) -> bool:
    return "service 'reboot'" in message


def _ending(answer: ExplorationResult) -> str:
    return SUCCESS if answer.success else ABORTED if answer.exploration_id else REFUSED
