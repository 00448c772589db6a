"""What all emulated sensor devices have in common: they can be plugged, and the same can go wrong with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from texture_simulation.devices.faults import ByteFaults, FrameFaults
from texture_simulation.devices.pty_port import PtyPort


class EmulatedDevice:
    """An emulated device on a pseudo-terminal.

    It has no clock of its own: each kind is given the samples, and a caller of another pace than nominal makes it a
    device whose clock drifts.

    Parameters
    ----------
    link
        Symbolic link that leads to the device; this is the path for the driver.
    rng
        Randomness of the faults.
    """

    def __init__(self, link: Path, rng: np.random.Generator) -> None:
        self.faults = ByteFaults()  # bytes lost, added, changed
        self.frame_faults = FrameFaults()  # frames left out or sent twice
        self.silent = False  # open but silent
        self.stalled = False  # keeps what it samples, and sends it all at once when it goes on
        self.wrong_firmware = False  # sends what no driver knows
        self._port = PtyPort(link)
        self._rng = rng
        self._held_back = b''

    @property
    def plugged(self) -> bool:
        """Whether the device is there."""
        return self._port.plugged

    @property
    def streaming(self) -> bool:
        """Whether it sends."""
        return self.plugged and not self.silent

    @property
    def dropped_bytes(self) -> int:
        """How many bytes nobody took."""
        return self._port.dropped_bytes

    def plug(self) -> None:
        """Appear, under a new name, with clock and numbers at the beginning."""
        self._port.plug()
        self.reset()

    def unplug(self) -> None:
        """Vanish."""
        self._port.unplug()

    def reset(self) -> None:
        """Begin clock and numbers again, as after a brown-out."""
        self._held_back = b''

    def _send(self, data: bytes) -> None:
        if self.streaming:
            self._held_back += data
        if not self.stalled:
            self._port.write(self.faults.apply(self._held_back, self._rng))
            self._held_back = b''
