"""A TSF-85 on a pseudo-terminal: listens to commands, streams what it is given."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from texture_simulation.devices.faults import ByteFaults
from texture_simulation.devices.pty_port import PtyPort
from texture_simulation.devices.tsf85_encoder import TAXELS, Counts, Image, Tsf85Encoder

AUTOSEND = re.compile(rb'\x9a.\x58\x01(.)', re.DOTALL)  # the last byte is the period in ms; 0 stops
KEPT_BYTES = 4  # of an incomplete command


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
        self.streaming = False
        self.mute = False  # open but silent, until told to start again
        self._port = PtyPort(link)
        self._rng = rng
        self._encoder = Tsf85Encoder(finger, long_stamps)
        self._heard = b''
        self._clock_ms = 0
        self._image: Image = np.zeros(TAXELS, dtype=np.uint16)
        self._image_is_new = True

    @property
    def plugged(self) -> bool:
        """Whether the device is there."""
        return self._port.plugged

    @property
    def dropped_bytes(self) -> int:
        """How many bytes nobody took."""
        return self._port.dropped_bytes

    def plug(self) -> None:
        """Appear, under a new name, with the clock at 0 and silent until started."""
        self._port.plug()
        self._clock_ms = 0
        self.streaming = False

    def unplug(self) -> None:
        """Vanish."""
        self._port.unplug()

    def advance(self, dynamic: Counts, images: Image) -> None:
        """Let as many milliseconds pass as there are dynamic values, and send them if started.

        Parameters
        ----------
        dynamic : (n,)
        images : (n_images, 28)
            New ones; the last is in force from the first of these milliseconds on.
        """
        self._obey(self._port.read())
        if len(images):
            self._image, self._image_is_new = images[-1], True
        if self.plugged and self.streaming and not self.mute:
            data = self._encoder.encode(self._clock_ms, dynamic, self._image, self._image_is_new)
            self._port.write(self.faults.apply(data, self._rng))
            self._image_is_new = False
        self.pass_by(len(dynamic))

    def pass_by(self, milliseconds: int) -> None:
        """Let time pass of which nothing is sent."""
        self._clock_ms += milliseconds

    def _obey(self, data: bytes) -> None:
        heard = self._heard + data
        for command in AUTOSEND.finditer(heard):
            self.streaming = command.group(1) != b'\x00'
            self.mute = self.mute and not self.streaming
        self._heard = heard[-KEPT_BYTES:] if data else self._heard
