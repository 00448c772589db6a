"""The watchdog of the controller: it stops the arm when it hears nothing, and it waits while a command is carried out.

While ur-rtde waits until a command is acknowledged it sends nothing, so that the watchdog would stop the arm in the
middle of a stop. Nor may anything else be sent then: it would overwrite the command.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from texture_exploration.arms.ur_params import UrArmParams

MARGIN = 3.0  # of the period, over the time that the controller took to acknowledge the watchdog itself


class Watchdog:
    """Set the watchdog of the controller, and time the commands for which it has to wait.

    Parameters
    ----------
    control
        The RTDEControlInterface of ur-rtde.
    params
        The arm.
    guard
        Is told before each command how long it may take, s; whoever hangs longer is ended.
    clock
        In s.

    Attributes
    ----------
    armed
        The controller waits no longer than `moving_s`; no arm moves without.
    moving_s
        How long it waits while the arm moves: 1 / `watchdog_hz`, or longer if it acknowledged the watchdog itself late.
    slow, slowest_s
        How many commands took longer than that, and the longest time that one took.
    """

    def __init__(
        self,
        control: Any,
        params: UrArmParams,
        guard: Callable[[float], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.armed = False
        self.slow = 0
        self.slowest_s = 0.0
        self._control = control
        self._period_s = self.moving_s = 1.0 / params.watchdog_hz
        self._patient_s = max(params.acknowledge_s, self._period_s)
        self._guard = guard
        self._clock = clock

    @property
    def widened(self) -> bool:
        """Whether the controller waits longer than 1 / `watchdog_hz` while the arm moves."""
        return self.moving_s > self._period_s

    def arm(self) -> bool:
        """Let the watchdog guard a moving arm; return whether the controller agreed.

        A controller that acknowledges this late would be stopped by it at once: then it waits a little longer.
        """
        with self.patient():
            pass
        return self.armed

    @contextmanager
    def patient(self) -> Iterator[None]:
        """Let the watchdog wait for what is called within, and guard a moving arm again afterwards."""
        took_s = self._set(self._patient_s)
        self.armed = False
        try:
            yield
        finally:
            self.moving_s = max(self._period_s, min(MARGIN * took_s, self._patient_s))
            self._set(self.moving_s)

    def call(self, command: Callable[..., Any], *arguments: Any) -> bool:
        """Send a command that is acknowledged; return whether the controller took it."""
        self._guard(self._patient_s)
        begin_s = self._clock()
        taken = bool(command(*arguments))
        passed_s = self._clock() - begin_s
        self.slow += passed_s > self._period_s
        self.slowest_s = max(self.slowest_s, passed_s)
        return taken

    def _set(self, period_s: float) -> float:
        """Return how long it took."""
        begin_s = self._clock()
        self.armed = self.call(self._control.setWatchdog, 1.0 / period_s)
        return self._clock() - begin_s
