"""Sensors on the emulator: a model on its device, brought forward in real time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from texture_core.finger_state import FingerState
from texture_core.signal import NANOSECONDS
from texture_simulation.devices.device import EmulatedDevice
from texture_simulation.finger_track import FingerTrack
from texture_simulation.surfaces.surface import Surface
from texture_simulation.trajectory import Trajectory

# After a longer stall of the machine the rest is skipped, and the driver sees a loss: the line's buffer takes no more.
LONGEST_BURST_S = 0.25


class SurfaceContact(Protocol):
    """Where a finger, or several, touch a surface."""

    @property
    def surface(self) -> Surface:
        """What is touched; it may be set."""

    @surface.setter
    def surface(self, surface: Surface) -> None: ...

    def relocate(self) -> None:
        """Let the sample lie otherwise from now on."""


class ContactModel(Protocol):
    """What a sensor model lets the emulator change."""

    @property
    def touch(self) -> SurfaceContact:
        """Where it touches."""


class LiveSensor:
    """Follow the finger with one sensor.

    Parameters
    ----------
    model, device
        What senses, and what sends.
    measure
        Measures along a piece of path and sends.
    skip
        Lets so many steps pass of which nothing is sent.
    rate_hz
        Steps a second: samples, or frames of them.
    points
        Of the path in a step.
    """

    def __init__(
        self,
        model: ContactModel,
        device: EmulatedDevice,
        measure: Callable[[Trajectory], None],
        skip: Callable[[int], None],
        *,
        rate_hz: float,
        points: int,
    ) -> None:
        self.model = model
        self.device = device
        self.done = 0  # steps, those that were skipped among them
        self.skipped = 0
        self._measure = measure
        self._skip = skip
        self._rate_hz = rate_hz
        self._points = points
        self._track = FingerTrack()
        self._start_ns: int | None = None

    def update(self, state: FingerState) -> None:
        """Take note of where the finger is."""
        self._track.update(state)

    def advance(self, now_ns: int) -> None:
        """Measure and send what is due; the first call is the beginning of time."""
        self._start_ns = now_ns if self._start_ns is None else self._start_ns
        due = int((now_ns - self._start_ns) / NANOSECONDS * self._rate_hz) - self.done
        skipped = max(0, due - round(LONGEST_BURST_S * self._rate_hz))
        if skipped:
            self.skipped += skipped
            self._skip(skipped)
        self.done += due
        if due > skipped:
            self._slide(due - skipped, self._start_ns + round(self.done / self._rate_hz * NANOSECONDS))

    def _slide(self, steps: int, until_ns: int) -> None:
        was_touching = self._track.touching
        path = self._track.advance(until_ns, self._points * steps, self._points * self._rate_hz)
        if not was_touching and self._track.touching:
            self.model.touch.relocate()
        self._measure(path)
