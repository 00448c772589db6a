"""A hand without a robot: five simulated fingers around an elastic object."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence

from texture_exploration.arms.command_limits import CommandLimits
from texture_exploration.arms.protocol import ArmCommand
from texture_exploration.arms.simulated import RATE_HZ, SimulatedArm, SimulatedArmParams
from texture_exploration.hands.protocol import FingerSet, Fingertip, HandState

FINGERS = ('thumb', 'index', 'middle', 'ring', 'little')
# Kaboli et al. 2015: which fingers held and which slid, for learning and for testing.
FINGER_SETS = {
    'kaboli-train': FingerSet(hold=('thumb', 'little', 'ring'), slide=('index', 'middle')),
    'kaboli-test': FingerSet(hold=('little', 'ring', 'middle'), slide=('thumb', 'index')),
}
START_M = 0.004
LIMITS = CommandLimits()


class SimulatedHand:
    """Each finger is a simulated arm of its own; see `texture_exploration.hands.protocol.Hand`.

    Parameters
    ----------
    clock
        CLOCK_MONOTONIC in ns.
    own_thread
        Move by itself once connected. If False, whoever owns the hand calls `step`.
    limits
        Of every single command.
    """

    finger_sets: Mapping[str, FingerSet] = FINGER_SETS

    def __init__(
        self,
        clock: Callable[[], int] = time.monotonic_ns,
        own_thread: bool = True,
        limits: CommandLimits = LIMITS,
    ) -> None:
        params = SimulatedArmParams(start_height_m=START_M)
        self.fingers = {name: SimulatedArm(params, clock, own_thread=False) for name in FINGERS}
        self._clock = clock
        self._limits = limits
        self._own_thread = own_thread
        self._grip: dict[str, ArmCommand] = {}
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None

    def connect(self) -> None:
        """Start to move in time."""
        self.close()
        self._closing.clear()
        for finger in self.fingers.values():
            finger.connect()
        if self._own_thread:
            self._thread = threading.Thread(target=self._run, name='simulated_hand', daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Let go and end the thread."""
        self._grip = {}
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        for finger in self.fingers.values():
            finger.close()

    def state(self) -> HandState:
        """Return the newest state."""
        states = {name: finger.state() for name, finger in self.fingers.items()}
        tips = {name: Fingertip(one.position, one.velocity, one.force_n) for name, one in states.items()}
        return HandState(
            min(one.time_ns for one in states.values()), tips, '; '.join(s.fault for s in states.values() if s.fault)
        )

    def grip(self, forces_n: Mapping[str, float]) -> None:
        """Press from the next step on."""
        grip = {name: ArmCommand(force_n=force) for name, force in forces_n.items()}
        for command in grip.values():
            self._limits.check(command)
        self._grip = grip

    def command(self, fingers: Sequence[str], command: ArmCommand) -> None:
        """Follow from the next step on."""
        self._limits.check(command, lambda: self._send(fingers, ArmCommand()))
        self._send(fingers, command)

    def warning(self) -> str:
        """Nothing ever is amiss that `state` does not tell."""
        return ''

    def _send(self, fingers: Sequence[str], command: ArmCommand) -> None:
        for name in fingers:
            self.fingers[name].command(command)

    def step(self, dt_s: float) -> None:
        """Move all fingers."""
        for name, command in self._grip.items():
            self.fingers[name].command(command)
        for finger in self.fingers.values():
            finger.step(dt_s)

    def _run(self) -> None:
        last_ns = self._clock()
        while not self._closing.wait(1 / RATE_HZ):
            now_ns = self._clock()
            self.step((now_ns - last_ns) * 1e-9)
            last_ns = now_ns
