"""A TSF-85 on a pseudo-terminal: listens to commands, streams what it is given."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from texture_simulation.devices.faults import ByteFaults, FrameFaults
from texture_simulation.devices.pty_port import PtyPort
from texture_simulation.devices.tsf85_encoder import TAXELS, Counts, Image, Tsf85Encoder

AUTOSEND = re.compile(rb'\x9a.\x58\x01(.)', re.DOTALL)  # the last byte is the period in ms; 0 stops
KEPT_BYTES = 4  # of an incomplete command
UNKNOWN_ITEM = b'\x80'  # no type that any firmware known sends


class EmulatedTsf85:
    """An emulated sensor without a clock of its own: `advance` it by the milliseconds that have passed.

    Parameters
    ----------
    link
        Symbolic link that leads to the device; this is the path for the driver.
    rng
        Randomness of the faults.
    finger, long_stamps
        See `Tsf85Encoder`.
    """

    def __init__(self, link: Path, rng: np.random.Generator, finger: int = 0, long_stamps: bool = True) -> None:
        self.faults = ByteFaults()
        self.frame_faults = FrameFaults()
        self.started = False
        self.mute = False
        self.stalled = False
        self.wrong_firmware = False
        self.deaf_starts = 0  # so many start commands to come do not help, as after an unclean end
        self._port = PtyPort(link)
        self._rng = rng
        self._encoder = Tsf85Encoder(finger, long_stamps)
        self._heard = self._kept = b''
        self._clock_ms = 0
        self._image: Image = np.zeros(TAXELS, dtype=np.uint16)
        self._image_is_new = False

    @property
    def plugged(self) -> bool:
        """Whether the device is there."""
        return self._port.plugged

    @property
    def streaming(self) -> bool:
        """Whether it sends."""
        return self.plugged and self.started and not self.mute

    @property
    def dropped_bytes(self) -> int:
        """How many bytes nobody took."""
        return self._port.dropped_bytes

    def plug(self) -> None:
        """Appear, under a new name, with the clock at 0 and silent until started."""
        self._port.plug()
        self._clock_ms = 0
        self._kept = b''
        self.started = False

    def unplug(self) -> None:
        """Vanish."""
        self._port.unplug()

    def advance(self, dynamic: Counts, images: Image) -> None:
        """Let as many milliseconds pass as there are dynamic values, and send them if started.

        Parameters
        ----------
        dynamic : (n,) or (n, 2)
        images : (n_images, n_taxels) or (n_images, 2, n_taxels)
            New ones; the last is in force from the first of these milliseconds on.
        """
        self._obey(self._port.read())
        if len(images):
            self._image, self._image_is_new = images[-1], True
        if self.streaming:
            self._kept += self._sent(dynamic)
            self._image_is_new = False
        if not self.stalled:
            self._port.write(self.faults.apply(self._kept, self._rng))
            self._kept = b''
        self.pass_by(len(dynamic))

    def pass_by(self, milliseconds: int) -> None:
        """Let time pass of which nothing is sent."""
        self._clock_ms += milliseconds

    def _sent(self, dynamic: Counts) -> bytes:
        packets = self._encoder.packets(self._clock_ms, dynamic, self._image, self._image_is_new)
        if self.wrong_firmware:
            packets = (UNKNOWN_ITEM.join([packet[:4], packet[4:]]) for packet in packets)
        if self.frame_faults == FrameFaults():
            return b''.join(packets)
        return b''.join(self.frame_faults.apply(packet, self._rng) for packet in packets)

    def _obey(self, data: bytes) -> None:
        heard = self._heard + data
        for command in AUTOSEND.finditer(heard):
            is_start = command.group(1) != b'\x00'
            self.started = is_start and not self.deaf_starts
            self.deaf_starts -= is_start and self.deaf_starts > 0
        self._heard = heard[-KEPT_BYTES:] if data else self._heard
