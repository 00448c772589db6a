"""Strike a running bench with faults, and see whether all comes back."""

from __future__ import annotations

import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Mapping

from texture_benchmarks.endurance.faults import Strike
from texture_benchmarks.endurance.processes import Processes
from texture_benchmarks.endurance.record import Struck
from texture_benchmarks.endurance.ros.watcher import Watcher
from texture_bringup.ros.operator import Operator
from texture_core.errors import LaunchFailed

NODES = ('bench', 'sensor', 'explorer', 'feature_extractor', 'classifier')
BACK_DEADLINE_S = 60.0
POLL_S = 0.05


class Striker:
    """Let faults strike in a thread of its own; use it in a `with` block.

    Parameters
    ----------
    strikes
        Which.
    operator
        For the faults of the bench; used by this thread alone.
    processes
        The nodes; the same.
    watcher
        Tells when a node is heard again.

    Attributes
    ----------
    struck
        What struck so far; the one in force stands in it with an end that is not yet known (inf).
    error
        What ended the thread early; None if nothing did.
    """

    def __init__(self, strikes: Iterable[Strike], operator: Operator, processes: Processes, watcher: Watcher) -> None:
        self.struck: list[Struck] = []
        self.error: Exception | None = None
        self._strikes = strikes
        self._operator = operator
        self._processes = processes
        self._watcher = watcher
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='striker', daemon=True)
        self._acts: Mapping[str, Callable[[Strike], str]] = {
            'unplug': self._unplug, 'corrupt': self._corrupt, 'freeze': self._freeze, 'kill': self._kill
        }  # fmt: skip

    def __enter__(self) -> Striker:
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
            for strike in self._strikes:
                if self._stop.wait(strike.quiet_s):
                    return
                self._strike(strike)
        except Exception as error:  # told in the report, which is written in any case
            self.error = error

    def _strike(self, strike: Strike) -> None:
        begin_s = time.monotonic()
        self.struck.append(Struck(strike.name, begin_s, math.inf, math.inf, ''))
        detail = self._acts[strike.fault.action](strike)
        end_s = time.monotonic()
        self.struck[-1] = Struck(strike.name, begin_s, end_s, math.inf, detail)
        self.struck[-1] = Struck(strike.name, begin_s, end_s, self._back(end_s), detail)

    def _unplug(self, strike: Strike) -> str:
        self._operator.set_parameters('bench', {'plugged': False})
        self._stop.wait(strike.hold_s)
        self._operator.set_parameters('bench', {'plugged': True})
        return f'for {strike.hold_s:.1f} s'

    def _corrupt(self, strike: Strike) -> str:
        self._operator.set_parameters('bench', {'bit_flips': strike.strength})
        self._stop.wait(strike.hold_s)
        self._operator.set_parameters('bench', {'bit_flips': 0.0})
        return f'a bit in {1 / strike.strength:.0f} bytes, for {strike.hold_s:.1f} s'

    def _freeze(self, strike: Strike) -> str:
        pid = self._pid(strike)
        os.kill(pid, signal.SIGSTOP)
        try:
            self._stop.wait(strike.hold_s)
        finally:
            os.kill(pid, signal.SIGCONT)
        return f'for {strike.hold_s:.1f} s'

    def _kill(self, strike: Strike) -> str:
        pid = self._pid(strike)
        os.kill(pid, signal.SIGKILL)
        return f'process {pid}'

    def _pid(self, strike: Strike) -> int:
        pids = self._processes.update()
        if strike.fault.node not in pids:
            raise LaunchFailed(f"node '{strike.fault.node}' does not run any more")
        return pids[strike.fault.node]

    def _back(self, since_s: float) -> float:
        """Return when all nodes are heard again and samples flow: NaN if not in time, inf if the run ends before."""
        awaited = (*NODES, 'signal')
        while time.monotonic() < since_s + BACK_DEADLINE_S:
            if self._stop.is_set():
                return math.inf
            running = self._processes.update()
            if all(name in running for name in NODES):
                heard_s = [self._watcher.heard_s.get(name, 0.0) for name in awaited]
                if min(heard_s) > since_s:
                    return max(heard_s)
            time.sleep(POLL_S)
        return math.nan
