"""How many packets of a TSF-85 survive a bad line, and whether anything false is believed."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from texture_drivers.tsf85.protocol import Packet, PacketParser
from texture_simulation.devices.faults import ByteFaults
from texture_simulation.devices.tsf85_encoder import TAXELS, Tsf85Encoder

MILLISECONDS_PER_IMAGE = 16
CHUNK_BYTES = 512  # as a driver reads: the parser sees no more at once


@dataclass(frozen=True)
class LineFigures:
    """What came of the packets that were sent.

    `bogus` are accepted packets that were never sent. With bytes lost or added, the strict walk can refuse them all;
    a changed value byte inside an intact packet cannot be seen by anyone, as the protocol has no checksum.
    """

    sent: int
    genuine: int
    bogus: int
    refused: int

    @property
    def genuine_share(self) -> float:
        """Share of the packets that arrived unharmed."""
        return self.genuine / self.sent


def line_figures(faults: ByteFaults, rng: np.random.Generator, n_packets: int = 20_000) -> LineFigures:
    """Send packets of random content over a bad line and parse what arrives."""
    blocks = _blocks(rng, n_packets)
    sent = Counter(packet for block in blocks for packet in _parsed(block))
    parser = PacketParser()
    wire = faults.apply(b''.join(blocks), rng)
    chunks = (wire[first : first + CHUNK_BYTES] for first in range(0, len(wire), CHUNK_BYTES))
    came = Counter(packet for chunk in chunks for packet in parser.feed(chunk))
    genuine = (sent & came).total()
    return LineFigures(sent=sent.total(), genuine=genuine, bogus=came.total() - genuine, refused=parser.refused)


def _blocks(rng: np.random.Generator, n_packets: int) -> list[bytes]:
    """Return the bytes of a stream in pieces of 16 ms: an image and 16 dynamic packets each."""
    encoder = Tsf85Encoder()
    values = [
        (
            rng.integers(-(2**15), 2**15, MILLISECONDS_PER_IMAGE, dtype=np.int16),
            rng.integers(0, 2**16, TAXELS, dtype=np.uint16),
        )
        for _ in range(n_packets // (MILLISECONDS_PER_IMAGE + 1))
    ]
    return [
        encoder.encode(number * MILLISECONDS_PER_IMAGE, dynamic, image, image_is_new=True)
        for number, (dynamic, image) in enumerate(values)
    ]


def _parsed(block: bytes) -> list[Packet]:
    """Return the packets of an unharmed block; the start byte of a next one lets the last one out."""
    return PacketParser().feed(block + b'\x9a')
