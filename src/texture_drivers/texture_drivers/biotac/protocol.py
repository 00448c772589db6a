"""What BioTacs answer to the sampling commands of whole frames: bytes to counts. Knows no link and no clock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import InvalidData
from texture_drivers.biotac.tables import ECHO_BYTES, ERROR_WORDS, WORD_BYTES, BioTacLayout

ODD_PARITY = np.array([byte.bit_count() % 2 == 1 for byte in range(256)])


@dataclass(frozen=True, eq=False)
class Replies:
    """Some frames of all BioTacs of a board, in counts; NaN where a word was damaged.

    Parameters
    ----------
    pac : (n_frames * pac_per_frame, n_fingers) float32
        The fast pressure, in the order of time.
    slow : (n_frames, n_slow_channels, n_fingers) float32
        The other channels, in the order of `BioTacLayout.slow_channels`.
    damaged : (n_fingers,)
        Words with a wrong parity.
    refused : (n_fingers,)
        Those of the damaged words that are error words of the device.
    """

    pac: NDArray[np.float32]
    slow: NDArray[np.float32]
    damaged: NDArray[np.int64]
    refused: NDArray[np.int64]


def decode(frames: bytes, layout: BioTacLayout, fingers: int) -> Replies:
    """Return what the BioTacs measured in one or several whole frames.

    A word is 12 bits: seven in the upper bits of the first byte, five in the upper bits of the second; bit 0 of each
    byte makes its number of ones odd. A word belongs to the BioTac at its place in the reply, whatever became of
    its neighbours, and to the channel of its slot: what comes back while the command goes out is not relied on.

    Parameters
    ----------
    frames : n_frames * layout.frame_bytes(fingers)
        Replies in the order of time; each slot is two bytes of echo and two bytes for each BioTac.
    layout
        Slots of a frame, and the channel of each.
    fingers
        Number of BioTacs on the bus.

    Returns
    -------
    Replies
        Samples in counts and the damaged words, for each finger.

    Raises
    ------
    InvalidData
        If the length is not that of whole frames.
    """
    size = layout.frame_bytes(fingers)
    if not frames or len(frames) % size:
        raise InvalidData(
            f'{len(frames)} bytes came from the BioTac board; a multiple of {size} is needed '
            f'for {len(layout.slots)} slots of {fingers} BioTacs'
        )
    # (n_frames, n_slots, n_fingers, 2)
    slots = np.frombuffer(frames, np.uint8).reshape(-1, len(layout.slots), ECHO_BYTES + WORD_BYTES * fingers)
    words = slots[:, :, ECHO_BYTES:].reshape(*slots.shape[:2], fingers, WORD_BYTES)
    good = ODD_PARITY[words].all(axis=-1)
    first, second = words[..., 0].astype(np.uint16), words[..., 1]
    values = np.where(good, (first >> 1) * 32 + (second >> 3), np.nan).astype(np.float32)
    refused = np.isin(first << 8 | second, list(ERROR_WORDS)) & ~good
    return Replies(
        pac=values[:, 1::2].reshape(-1, fingers),
        slow=values[:, layout.slow_slots],
        damaged=(~good).sum(axis=(0, 1)),
        refused=refused.sum(axis=(0, 1)),
    )
