"""A bridge with a board of BioTacs on a pseudo-terminal: streams what it is given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texture_core.parameters import param
from texture_simulation.devices.biotac_encoder import VERSION, Bytes, Values, encode_replies, reply_frame, serials_frame
from texture_simulation.devices.faults import ByteFaults, FrameFaults
from texture_simulation.devices.pty_port import PtyPort

SLOT_US = 1e6 / 4400
FRAMES_PER_SERIALS = 100
WRONG_VERSION = 99


@dataclass(frozen=True)
class BoardFaults:
    """What goes wrong before the bridge's check sum is made."""

    flip: float = param(0.0, 'Probability that one bit of a byte on the SPI bus is changed.', low=0.0, high=1.0)


class EmulatedBioTac:
    """An emulated bridge without a clock of its own: `advance` it by the frames that have been sampled.

    Its time is its own: called at another pace than nominal it is a device whose clock drifts.

    Parameters
    ----------
    link
        Symbolic link that leads to the device; this is the path for the driver.
    rng
        Randomness of the faults.
    serials
        Serial number of the BioTac at each place, '' where there is none.
    """

    def __init__(
        self, link: Path, rng: np.random.Generator, serials: Sequence[str] = ('BT-2P-02.2.0-B-11-E-00-04',)
    ) -> None:
        self.faults = ByteFaults()
        self.frame_faults = FrameFaults()
        self.board_faults = BoardFaults()
        self.mute = False
        self.stalled = False
        self.wrong_firmware = False
        self._port = PtyPort(link)
        self._rng = rng
        self._serials = serials
        self._absent = [place for place, serial in enumerate(serials) if not serial]
        self._frames = 0
        self._kept = b''

    @property
    def plugged(self) -> bool:
        """Whether the device is there."""
        return self._port.plugged

    @property
    def streaming(self) -> bool:
        """Whether it sends."""
        return self.plugged and not self.mute

    @property
    def dropped_bytes(self) -> int:
        """How many bytes nobody took."""
        return self._port.dropped_bytes

    def plug(self) -> None:
        """Appear, under a new name, with sequence and clock at 0."""
        self._port.plug()
        self.reset()

    def unplug(self) -> None:
        """Vanish."""
        self._port.unplug()

    def reset(self) -> None:
        """Begin the sequence numbers and the clock anew, as after a brown-out."""
        self._frames = 0
        self._kept = b''

    def pass_by(self, frames: int) -> None:
        """Let time pass without sending: frames are lost."""
        self._frames += frames

    def advance(self, values: Values) -> None:
        """Sample some frames and send them.

        Parameters
        ----------
        values : (n_frames, n_slots, n_fingers) counts, 0 to 4095
        """
        replies = self._disturb(encode_replies(values, self._absent))
        data = b''.join(self._sent(frame, reply.tobytes()) for frame, reply in zip(values, replies, strict=True))
        if not self.streaming:
            return
        self._kept += data
        if not self.stalled:
            self._port.write(self.faults.apply(self._kept, self._rng))
            self._kept = b''

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
