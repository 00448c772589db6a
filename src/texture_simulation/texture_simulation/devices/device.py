"""What all emulated sensor devices have in common: they can be plugged, and the same can go wrong with them."""

from __future__ import annotations

from typing import Protocol

from texture_simulation.devices.faults import ByteFaults, FrameFaults


class Device(Protocol):
    """An emulated device on a pseudo-terminal.

    It has no clock of its own: each kind is told what has been sampled, and a caller of another pace than nominal makes
    it a device whose clock drifts.
    """

    faults: ByteFaults  # bytes lost, added, changed
    frame_faults: FrameFaults  # frames left out or sent twice
    mute: bool  # open but silent
    stalled: bool  # keeps what it samples, and sends it all at once when it goes on
    wrong_firmware: bool  # sends what no driver knows

    @property
    def plugged(self) -> bool:
        """Whether the device is there."""

    @property
    def streaming(self) -> bool:
        """Whether it sends."""

    @property
    def dropped_bytes(self) -> int:
        """How many bytes nobody took."""

    def plug(self) -> None:
        """Appear, under a new name, with clock and numbers at the beginning."""

    def unplug(self) -> None:
        """Vanish."""
