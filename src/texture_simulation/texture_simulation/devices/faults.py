"""What goes wrong on the way: with bytes, and with whole frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.parameters import param


@dataclass(frozen=True)
class ByteFaults:
    """How likely each byte is to suffer."""

    drop: float = param(0.0, 'Sets the probability that a byte is lost on the line.', low=0.0, high=1.0)
    insert: float = param(0.0, 'Sets the probability that a random byte is inserted before a byte.', low=0.0, high=1.0)
    flip: float = param(0.0, 'Sets the probability that one bit of a byte is changed.', low=0.0, high=1.0)

    def apply(self, data: bytes, rng: np.random.Generator) -> bytes:
        """Return what arrives of `data`."""
        if not (self.drop or self.insert or self.flip):
            return data
        values = np.frombuffer(data, dtype=np.uint8).copy()
        flipped = rng.random(len(values)) < self.flip
        values[flipped] ^= np.uint8(1) << rng.integers(0, 8, flipped.sum(), dtype=np.uint8)
        values = values[rng.random(len(values)) >= self.drop]
        places = np.flatnonzero(rng.random(len(values)) < self.insert)
        return np.insert(values, places, rng.integers(0, 256, len(places), dtype=np.uint8)).tobytes()


@dataclass(frozen=True)
class FrameFaults:
    """Parameters of the faults that are injected in frames or packets."""

    skip: float = param(0.0, 'Sets the probability that a frame is numbered and not sent.', low=0.0, high=1.0)
    duplicate: float = param(0.0, 'Sets the probability that a frame is sent twice.', low=0.0, high=1.0)

    def apply(self, frame: bytes, rng: np.random.Generator) -> bytes:
        """Return what is sent of a frame."""
        if rng.random() < self.skip:
            return b''
        return frame * 2 if rng.random() < self.duplicate else frame
