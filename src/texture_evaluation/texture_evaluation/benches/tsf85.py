"""How the TSF-85's parser bears bytes that are lost, added or changed on the way."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from texture_core.arrays import AnyArray
from texture_drivers.tsf85 import tables
from texture_drivers.tsf85.protocol import Packet, PacketParser
from texture_evaluation.benches.result import Bench, BenchResult
from texture_evaluation.charts import line_chart
from texture_simulation.devices.faults import ByteFaults
from texture_simulation.devices.tsf85_encoder import Tsf85Encoder

PACKETS, QUICK_PACKETS = 20_000, 1_000
RATES = (1e-5, 1e-4, 1e-3, 1e-2)
KINDS = {'drop': 'bytes lost', 'insert': 'bytes added', 'flip': 'bits changed'}
IMAGE_EVERY = 17  # packets, about 60 Hz
READ_BYTES = 256  # what a read of the port returns at once
FINGER = 0


class Outcome(NamedTuple):
    """What became of the dynamic samples sent."""

    recovered: float  # share that arrived with its stamp and value
    false: float  # share of what was believed that was never sent so
    refused_bytes: int
    us_per_packet: float


def run(bench: Bench) -> BenchResult:
    """Send packets through each kind and rate of fault, and compare what is believed with what was sent."""
    n_packets = QUICK_PACKETS if bench.quick else PACKETS
    rng = np.random.default_rng(bench.seed)
    values = rng.integers(-2000, 2000, n_packets).astype(np.int16)
    sent = b''.join(_sent(values, rng))
    clean = _measure(sent, values)
    outcomes = {
        kind: [_measure(ByteFaults(**{kind: rate}).apply(sent, rng), values) for rate in RATES] for kind in KINDS
    }
    shown = {KINDS[kind]: (np.array(RATES), 100 * _column(rows, 'recovered')) for kind, rows in outcomes.items()}
    chart = line_chart(
        shown,
        f'TSF-85 parser on {n_packets} packets with faults on the line (simulated device)',
        ('faults per byte', 'samples recovered (%)'),
        bench.out / 'tsf85.png',
        logarithmic=True,
    )
    return BenchResult(
        name='tsf85',
        measured='share of samples recovered with their own stamp and value, and of false ones among those believed',
        data=f'{n_packets} packets of a simulated TSF-85, about {len(sent) // n_packets} bytes each',
        split='none: nothing is trained',
        numbers={
            'without_faults': clean._asdict(),
            **{
                kind: {f'{rate:g}': row._asdict() for rate, row in zip(RATES, rows, strict=True)}
                for kind, rows in outcomes.items()
            },
        },
        charts=(chart,),
    )


def _sent(values: AnyArray, rng: np.random.Generator) -> Iterator[bytes]:
    encoder = Tsf85Encoder(FINGER)
    for first in range(0, len(values), IMAGE_EVERY):
        image = rng.integers(0, 4000, 28).astype(np.uint16)
        yield encoder.encode(first, values[first : first + IMAGE_EVERY], image, image_is_new=True)


def _measure(data: bytes, values: AnyArray) -> Outcome:
    parser = PacketParser()
    packets: list[Packet] = []
    start = time.perf_counter()
    for first in range(0, len(data), READ_BYTES):
        packets += parser.feed(data[first : first + READ_BYTES])
    taken_s = time.perf_counter() - start
    believed = list(_dynamic(packets))
    right = {stamp for stamp, value in believed if 0 <= stamp < len(values) and values[stamp] == value}
    false = sum(stamp not in right for stamp, _ in believed)
    return Outcome(
        recovered=len(right) / len(values),
        false=false / max(1, len(believed)),
        refused_bytes=parser.refused_bytes,
        us_per_packet=1e6 * taken_s / len(values),
    )


def _dynamic(packets: Sequence[Packet]) -> Iterator[tuple[int, int]]:
    """Yield stamp and value of each sample of the finger."""
    for packet in packets:
        stamps = [item.values[0] for item in packet.items if item.kind == tables.TIMESTAMP]
        found = [i.values[0] for i in packet.items if i.kind == tables.DYNAMIC and i.finger == FINGER]
        if stamps and found:
            yield stamps[0], found[0]


def _column(rows: Sequence[Outcome], name: str) -> AnyArray:
    return np.array([getattr(row, name) for row in rows])
