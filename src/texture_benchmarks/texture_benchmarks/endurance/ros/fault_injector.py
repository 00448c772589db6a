"""Fault injection into the running emulator, and measurement of the recovery."""

from __future__ import annotations

import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Mapping

from texture_benchmarks.endurance.endurance_record import FaultEvent
from texture_benchmarks.endurance.faults import PlannedFault
from texture_benchmarks.endurance.processes import Processes
from texture_benchmarks.endurance.ros.watcher import Watcher
from texture_bringup.ros.operator import Operator
from texture_core.errors import LaunchFailed

NODES = ('emulator', 'sensor', 'explorer', 'feature_extractor', 'classifier')
BACK_DEADLINE_S = 60.0
POLL_S = 0.05


class FaultInjector:
    """Inject faults in a thread of its own; use it in a `with` block.

    Parameters
    ----------
    planned_faults
        Which.
    operator
        For the faults of the bench; used by this thread alone.
    processes
        The nodes; the same.
    watcher
        Returns when a node has reported again.

    Attributes
    ----------
    fault_events
        What was injected so far; the one in force stands in it with an end that is not yet known (inf).
    error
        What ended the thread early; None if nothing did.
    """

    def __init__(
        self, planned_faults: Iterable[PlannedFault], operator: Operator, processes: Processes, watcher: Watcher
    ) -> None:
        self.fault_events: list[FaultEvent] = []
        self.error: Exception | None = None
        self._planned_faults = planned_faults
        self._operator = operator
        self._processes = processes
        self._watcher = watcher
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='fault_injector', daemon=True)
        self._acts: Mapping[str, Callable[[PlannedFault], str]] = {
            'unplug': self._unplug, 'corrupt': self._corrupt, 'freeze': self._freeze, 'kill': self._kill
        }  # fmt: skip

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

    def _inject(self, planned_fault: PlannedFault) -> None:
        begin_s = time.monotonic()
        self.fault_events.append(FaultEvent(planned_fault.name, begin_s, math.inf, math.inf, ''))
        detail = self._acts[planned_fault.fault.action](planned_fault)
        end_s = time.monotonic()
        self.fault_events[-1] = FaultEvent(planned_fault.name, begin_s, end_s, math.inf, detail)
        self.fault_events[-1] = FaultEvent(planned_fault.name, begin_s, end_s, self._back(end_s), detail)

    def _unplug(self, planned_fault: PlannedFault) -> str:
        self._operator.set_parameters('emulator', {'plugged': False})
        self._stop.wait(planned_fault.hold_s)
        self._operator.set_parameters('emulator', {'plugged': True})
        return f'for {planned_fault.hold_s:.1f} s'

    def _corrupt(self, planned_fault: PlannedFault) -> str:
        self._operator.set_parameters('emulator', {'bit_flips': planned_fault.strength})
        self._stop.wait(planned_fault.hold_s)
        self._operator.set_parameters('emulator', {'bit_flips': 0.0})
        return f'a bit in {1 / planned_fault.strength:.0f} bytes, for {planned_fault.hold_s:.1f} s'

    def _freeze(self, planned_fault: PlannedFault) -> str:
        pid = self._pid(planned_fault)
        os.kill(pid, signal.SIGSTOP)
        try:
            self._stop.wait(planned_fault.hold_s)
        finally:
            os.kill(pid, signal.SIGCONT)
        return f'for {planned_fault.hold_s:.1f} s'

    def _kill(self, planned_fault: PlannedFault) -> str:
        pid = self._pid(planned_fault)
        os.kill(pid, signal.SIGKILL)
        return f'process {pid}'

    def _pid(self, planned_fault: PlannedFault) -> int:
        pids = self._processes.update()
        if planned_fault.fault.node not in pids:
            raise LaunchFailed(f"node '{planned_fault.fault.node}' does not run any more")
        return pids[planned_fault.fault.node]

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
