"""A bridge with a board of BioTacs on a pseudo-terminal: streams what it is given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texture_core.parameters import param
from texture_simulation.devices.biotac_encoder import VERSION, Bytes, Values, encode_replies, reply_frame, serials_frame
from texture_simulation.devices.device import EmulatedDevice

SLOT_US = 1e6 / 4400
FRAMES_PER_SERIALS = 100
WRONG_VERSION = 99


@dataclass(frozen=True)
class BoardFaults:
    """What goes wrong before the bridge's check sum is made."""

    flip: float = param(
        0.0, 'Sets the probability that one bit of a byte on the SPI bus is changed.', low=0.0, high=1.0
    )


class EmulatedBioTac(EmulatedDevice):
    """An emulated bridge: `advance` it by the frames that have been sampled.

    Parameters
    ----------
    link, rng
        See `EmulatedDevice`.
    serials
        Serial number of the BioTac at each place, '' where there is none.
    """

    def __init__(
        self, link: Path, rng: np.random.Generator, serials: Sequence[str] = ('BT-2P-02.2.0-B-11-E-00-04',)
    ) -> None:
        super().__init__(link, rng)
        self.board_faults = BoardFaults()
        self._serials = serials
        self._absent = [place for place, serial in enumerate(serials) if not serial]
        self._frames = 0

    def reset(self) -> None:
        """Begin the sequence numbers and the clock again, as after a brown-out."""
        super().reset()
        self._frames = 0

    def skip(self, frames: int) -> None:
        """Let time pass without sending: frames are lost."""
        self._frames += frames

    def advance(self, values: Values) -> None:
        """Sample some frames and send them.

        Parameters
        ----------
        values : (n_frames, n_slots, n_fingers) counts, 0 to 4095
        """
        replies = self._disturb(encode_replies(values, self._absent))
        self._send(b''.join(self._sent(frame, reply.tobytes()) for frame, reply in zip(values, replies, strict=True)))

    def _sent(self, values: Values, reply: bytes) -> bytes:
        """Return the bytes that one frame becomes."""
        time_us = round(self._frames * len(values) * SLOT_US)
        data = reply_frame(self._frames, time_us, values, reply, WRONG_VERSION if self.wrong_firmware else VERSION)
        serials_sent, turn = divmod(self._frames, FRAMES_PER_SERIALS)
        self._frames += 1
        sent = self.frame_faults.apply(data, self._rng)
        return sent if turn else serials_frame(serials_sent, time_us, self._serials) + sent

    def _disturb(self, replies: Bytes) -> Bytes:
        """Return replies with flipped bits."""
        hit = self._rng.random(replies.shape) < self.board_faults.flip
        bits = np.uint8(1) << self._rng.integers(0, 8, replies.shape, dtype=np.uint8)
        return np.where(hit, replies ^ bits, replies)
