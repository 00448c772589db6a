"""A TSF-85 on a pseudo-terminal: listens to commands, streams what it is given."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from texture_simulation.devices.device import EmulatedDevice
from texture_simulation.devices.faults import FrameFaults
from texture_simulation.devices.tsf85_encoder import TAXELS, Counts, Image, Tsf85Encoder

AUTOSEND = re.compile(rb'\x9a.\x58\x01(.)', re.DOTALL)  # the last byte is the period in ms; 0 stops
KEPT_BYTES = 4  # of an incomplete command
UNKNOWN_ITEM = b'\x80'  # no type that any firmware known sends


class EmulatedTsf85(EmulatedDevice):
    """An emulated sensor: `advance` it by the milliseconds that have passed.

    Parameters
    ----------
    link, rng
        See `EmulatedDevice`.
    finger, long_stamps
        See `Tsf85Encoder`.
    """

    def __init__(self, link: Path, rng: np.random.Generator, finger: int = 0, long_stamps: bool = True) -> None:
        super().__init__(link, rng)
        self.started = False
        self.ignored_starts = 0  # so many start commands to come do not help, as after an unclean end
        self._encoder = Tsf85Encoder(finger, long_stamps)
        self._received = b''
        self._clock_ms = 0
        self._image: Image = np.zeros(TAXELS, dtype=np.uint16)
        self._image_is_new = False

    @property
    def streaming(self) -> bool:
        """Whether it sends."""
        return super().streaming and self.started

    def reset(self) -> None:
        """Begin the clock again, silent until started, as after a brown-out."""
        super().reset()
        self._clock_ms = 0
        self.started = False

    def plug_fingers(self, plugged: Sequence[bool]) -> None:
        """Pull the plugs of fingers, or plug them in again, one flag a finger; the hub stays on its line."""
        self._encoder.plug(plugged)

    def advance(self, dynamic: Counts, images: Image) -> None:
        """Let as many milliseconds pass as there are dynamic values, and send them if started.

        Parameters
        ----------
        dynamic : (n,) or (n, 2)
        images : (n_images, n_taxels) or (n_images, 2, n_taxels)
            New ones; the last is in force from the first of these milliseconds on.
        """
        self._execute(self._port.read())
        if len(images):
            self._image, self._image_is_new = images[-1], True
        data = b''
        if self.streaming:
            data, self._image_is_new = self._sent(dynamic), False
        self._send(data)
        self.skip(len(dynamic))

    def skip(self, milliseconds: int) -> None:
        """Let time pass of which nothing is sent."""
        self._clock_ms += milliseconds

    def _sent(self, dynamic: Counts) -> bytes:
        packets = self._encoder.packets(self._clock_ms, dynamic, self._image, self._image_is_new)
        if self.wrong_firmware:
            packets = (UNKNOWN_ITEM.join([packet[:4], packet[4:]]) for packet in packets)
        if self.frame_faults == FrameFaults():
            return b''.join(packets)
        return b''.join(self.frame_faults.apply(packet, self._rng) for packet in packets)

    def _execute(self, data: bytes) -> None:
        received = self._received + data
        for command in AUTOSEND.finditer(received):
            is_start = command.group(1) != b'\x00'
            self.started = is_start and not self.ignored_starts
            self.ignored_starts -= is_start and self.ignored_starts > 0
        self._received = received[-KEPT_BYTES:] if data else self._received
