"""Inject a fault at a set time of a session."""

from __future__ import annotations

import threading

from texture_benchmarks.endurance.robot_faults import (
    IN_SLIDE,
    RobotTrial,
    planned_slide_s,
)
from texture_benchmarks.endurance.robot_rigs import RobotRig
from texture_benchmarks.endurance.ros.robot_client import RobotClient

TIMEOUT_S = 45.0  # of an exploration, told to the operator: it cancels then


class TimedFaultInjection:
    """A fault that is injected in a thread while somebody waits for the exploration; use it in a `with` block.

    Attributes
    ----------
    done, detail
        Whether it was injected, and its strength in words.
    """

    def __init__(self, trial: RobotTrial, rig: RobotRig, client: RobotClient, pid: int, when: str) -> None:
        self.done, self.detail = False, ''
        self._trial, self._rig, self._client, self._pid = trial, rig, client, pid
        self._when = when
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name='injection', daemon=True)

    def __enter__(self) -> TimedFaultInjection:
        if self._when == IN_SLIDE:
            self._thread.start()
        elif self._when:
            self._inject()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        if self._thread.ident is not None:
            self._thread.join()

    def _run(self) -> None:
        if not self._client.wait_for_slide(self._over, TIMEOUT_S):
            return
        delay_s = self._trial.fault.at_share * planned_slide_s(self._trial.request)
        if not self._over.wait(delay_s):
            self._inject()

    def _inject(self) -> None:
        self.detail = self._rig.inject(self._trial.fault, self._pid)
        self.done = True
