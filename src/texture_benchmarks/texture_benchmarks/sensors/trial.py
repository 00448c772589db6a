"""How many packets of a sensor survive a disturbed line, and whether false packets are accepted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from texture_core.arrays import Array
from texture_core.catalogue import find
from texture_core.framing import Frame, FrameDecoder
from texture_drivers.anyskin.protocol import FrameParser
from texture_drivers.papillarray import protocol as papillarray
from texture_drivers.tsf85.protocol import Packet, Tsf85Parser
from texture_simulation.devices import anyskin, daq, pvdf
from texture_simulation.devices.biotac_encoder import encode_replies, reply_frame
from texture_simulation.devices.faults import ByteFaults
from texture_simulation.devices.papillarray_encoder import PILLARS, QUANTITIES, PapillArrayEncoder
from texture_simulation.devices.sampler import MICROSECONDS, SampledStream, encode
from texture_simulation.devices.tsf85_encoder import TAXELS, Tsf85Encoder

MILLISECONDS_PER_IMAGE = 16
BIOTAC_SLOTS, BIOTAC_FRAME_US = 44, 10_000
FIELD_UT = 1000.0  # spread of the field of an AnySkin
PAPILLARRAY_US = 1000.0
CHUNK_BYTES = 512  # as a driver reads: the parser sees no more at once


@dataclass(frozen=True)
class LinkStatistics:
    """What came of the packets that were sent.

    `false_packets` are accepted packets that were never sent. A cyclic checksum refuses them all. Of the
    PapillArray's sum two changed bits may leave nothing to see. The TSF-85 and the AnySkin
    have none: with bytes lost or added, strict parsers can refuse them; a changed value byte inside an intact packet
    cannot be seen by anyone, unless it leaves the range.
    """

    sent: int
    correct_packets: int
    false_packets: int
    refused: int

    @property
    def correct_share(self) -> float:
        """Share of the packets that arrived unharmed."""
        return self.correct_packets / self.sent


class PacketReceiver(Protocol):
    """A driver's parser."""

    def feed(self, data: bytes) -> Sequence[Hashable]:
        """Return the packets completed by `data`."""

    @property
    def refused(self) -> int:
        """How many candidates were refused."""


class Tsf85Receiver:
    """The TSF-85's parser."""

    def __init__(self) -> None:
        self._parser = Tsf85Parser()

    def feed(self, data: bytes) -> list[Packet]:
        """Return packets."""
        return self._parser.feed(data)

    @property
    def refused(self) -> int:
        """Start bytes that led to no packet."""
        return self._parser.refused


class FrameReceiver:
    """The parser of all devices with framed lines."""

    def __init__(self) -> None:
        self._deframer = FrameDecoder()

    def feed(self, data: bytes) -> list[Frame]:
        """Return frames, whatever was missing before them."""
        return [frame._replace(lost=0) for frame in self._deframer.feed(data)]

    @property
    def refused(self) -> int:
        """Frames that failed the check."""
        return self._deframer.bad_frames


class AnySkinReceiver:
    """The AnySkin's parser."""

    def __init__(self) -> None:
        self._parser = FrameParser()

    def feed(self, data: bytes) -> list[bytes]:
        """Return the values of each frame, as bytes."""
        return [values.tobytes() for run in self._parser.feed(data) for values in run.values]

    @property
    def refused(self) -> int:
        """Frames that did not fit while it was certain where they begin."""
        return self._parser.refused


class PapillArrayReceiver:
    """The PapillArray's parser, and the check of what its packets hold."""

    def __init__(self) -> None:
        self._parser = papillarray.PapillArrayParser()
        self._malformed = 0

    def feed(self, data: bytes) -> list[bytes]:
        """Return the contents of packets."""
        packets = self._parser.feed(data)
        valid = [packet for packet in packets if papillarray.layout_of(packet)]
        self._malformed += len(packets) - len(valid)
        return valid

    @property
    def refused(self) -> int:
        """Packets that failed a check."""
        return self._parser.refused + self._malformed


@dataclass(frozen=True)
class ProtocolUnderTest:
    """What a device sends, and what hears it.

    Parameters
    ----------
    packets
        Yields so many packets of random content, as bytes.
    receiver
        Makes a parser.
    passed_over
        Packets at the start of a line, even a good one, that the parser only uses to find where packets begin.
    """

    packets: Callable[[np.random.Generator, int], Iterator[bytes]]
    receiver: Callable[[], PacketReceiver]
    passed_over: int = 0


def link_statistics(
    faults: ByteFaults, rng: np.random.Generator, n_packets: int = 20_000, sensor: str = 'tsf85'
) -> LinkStatistics:
    """Send packets of random content over a bad line and parse what arrives.

    Parameters
    ----------
    faults
        Probabilities of faults for each byte.
    rng
        Content of the packets, and the faults.
    n_packets
        Number of packets.
    sensor
        Name of the sensor.

    Returns
    -------
    LinkStatistics
        Packets sent, recovered and false.

    Raises
    ------
    UnknownName
        If no such sensor has a line.
    """
    line = find(PROTOCOLS, sensor, 'line of a sensor')
    packets = list(line.packets(rng, n_packets))
    sent = _received(line.receiver(), b''.join(packets))
    receiver = line.receiver()
    received = _received(receiver, faults.apply(b''.join(packets), rng))
    correct_packets = (sent & received).total()
    return LinkStatistics(len(packets), correct_packets, received.total() - correct_packets, receiver.refused)


def _received(receiver: PacketReceiver, wire: bytes) -> Counter[Hashable]:
    # The start byte after the end lets the very last packet of a TSF-85 out, which waits for its successor.
    chunks = [wire[first : first + CHUNK_BYTES] for first in range(0, len(wire), CHUNK_BYTES)]
    return Counter(packet for chunk in [*chunks, b'\x9a'] for packet in receiver.feed(chunk))


def _tsf85(rng: np.random.Generator, n_packets: int) -> Iterator[bytes]:
    """Yield an image and 16 dynamic packets, again and again."""
    encoder = Tsf85Encoder()
    for number in range(n_packets // (MILLISECONDS_PER_IMAGE + 1)):
        dynamic = rng.integers(-(2**15), 2**15, MILLISECONDS_PER_IMAGE, dtype=np.int16)
        image = rng.integers(0, 2**16, TAXELS, dtype=np.uint16)
        yield from encoder.packets(number * MILLISECONDS_PER_IMAGE, dynamic, image, image_is_new=True)


def _biotac(rng: np.random.Generator, n_packets: int) -> Iterator[bytes]:
    """Yield frames of a board with one finger."""
    values = rng.integers(0, 2**12, (n_packets, BIOTAC_SLOTS, 1), dtype=np.uint16)
    for number, reply in enumerate(encode_replies(values)):
        yield reply_frame(number, number * BIOTAC_FRAME_US, values[number], reply.tobytes())


def _anyskin(rng: np.random.Generator, n_packets: int) -> Iterator[bytes]:
    """Yield frames of five magnetometers."""
    axes = 3 * anyskin.MAGNETOMETERS
    yield from anyskin.encode(rng.normal(0.0, FIELD_UT, (n_packets, axes)))


def _papillarray(rng: np.random.Generator, n_packets: int) -> Iterator[bytes]:
    """Yield packets of a hub with one array."""
    pillars = rng.normal(0.0, 1.0, (n_packets, 1, PILLARS, QUANTITIES))
    times_us: Array = PAPILLARRAY_US * np.arange(n_packets, dtype=np.float64)
    yield from PapillArrayEncoder(1).packets(0, times_us, pillars)


def _sampled(stream: SampledStream) -> Callable[[np.random.Generator, int], Iterator[bytes]]:
    """Return what yields frames of a stream."""

    def packets(rng: np.random.Generator, n_packets: int) -> Iterator[bytes]:
        frame_us = stream.rows * MICROSECONDS / stream.rate_hz
        values = rng.integers(-(2**15), 2**15, (n_packets, stream.rows, stream.columns), dtype=np.int16)
        for number, counts in enumerate(values):
            yield encode(stream, number, round(number * frame_us), counts)

    return packets


PROTOCOLS: Mapping[str, ProtocolUnderTest] = {
    'tsf85': ProtocolUnderTest(_tsf85, Tsf85Receiver),
    'biotac': ProtocolUnderTest(_biotac, FrameReceiver),
    'daq': ProtocolUnderTest(_sampled(daq.STREAM), FrameReceiver),
    'pvdf': ProtocolUnderTest(_sampled(pvdf.FILM), FrameReceiver),
    'anyskin': ProtocolUnderTest(_anyskin, AnySkinReceiver, passed_over=1),
    'papillarray': ProtocolUnderTest(_papillarray, PapillArrayReceiver, passed_over=1),
}
CHECKSUMMED = frozenset({'biotac', 'daq', 'pvdf'})  # lines with a cyclic checksum; that of a PapillArray is a sum
