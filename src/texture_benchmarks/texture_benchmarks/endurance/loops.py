"""What goes on beside the nodes: explorations one after the other, and readings of their processes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress

from texture_benchmarks.endurance.endurance_record import (
    ABORTED,
    LOST,
    REFUSED,
    SUCCESS,
    ExplorationRecord,
)
from texture_benchmarks.endurance.machine_speed import MachineSpeed, measure_machine_speed
from texture_benchmarks.endurance.planned_explorations import PlannedExploration
from texture_benchmarks.endurance.processes import Processes
from texture_benchmarks.endurance.usage import ProcessUsage, read_usage
from texture_bringup.ros.operator import Operator
from texture_core.errors import InvalidParameter, LaunchFailed, MotionAborted, TextureError

SAMPLE_PERIOD_S = 10.0  # between two looks at the processes
# A surface that cannot be swapped within this time, for the bench does not answer, is told.
SWAP_DEADLINE_S = 60.0


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
