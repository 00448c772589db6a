"""How each sensor's line bears bytes lost, added or changed: what is recovered, and what false is believed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from texture_benchmarks.charts import fault_chart
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_benchmarks.sensors.trial import CHECKSUMMED, PROTOCOLS, LinkStatistics, link_statistics
from texture_core.arrays import Array
from texture_simulation.devices.faults import ByteFaults

PACKETS, QUICK_PACKETS = 20_000, 1_000
RATES = (1e-5, 1e-4, 1e-3, 1e-2)
KINDS = {'drop': 'bytes lost', 'insert': 'bytes added', 'flip': 'one bit of a byte changed'}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Send packets of each sensor through each kind and rate of fault."""
    n_packets = QUICK_PACKETS if options.quick else PACKETS
    found = {
        sensor: {
            kind: {
                rate: link_statistics(
                    ByteFaults(**{kind: rate}), np.random.default_rng(options.seed), n_packets, sensor
                )
                for rate in RATES
            }
            for kind in KINDS
        }
        for sensor in PROTOCOLS
    }
    chart = fault_chart(
        {text: _lines(found, kind) for kind, text in KINDS.items()},
        'Packets recovered on a faulty line, and false ones believed (emulated devices)',
        options.out / 'sensors-faults.png',
    )
    return BenchmarkResult(
        name='sensors-faults',
        measured='packets recovered unharmed, and false packets believed, of those sent',
        data=f'{n_packets} packets of random content from each emulated device; a packet is one frame on its line '
        '(a millisecond of the TSF-85, 10 ms of the BioTac, 4 ms of the DAQ finger, 8 ms of the PVDF film, '
        'one sample of the AnySkin or PapillArray)',
        split='none: nothing is trained',
        numbers={
            sensor: {
                'checksum': sensor in CHECKSUMMED,
                **{kind: {f'{rate:g}': _numbers(row) for rate, row in rows.items()} for kind, rows in kinds.items()},
            }
            for sensor, kinds in found.items()
        },
        charts=(chart,),
    )


def _numbers(figures: LinkStatistics) -> Mapping[str, Any]:
    return {
        'sent': figures.sent,
        'recovered': figures.correct_share,
        'bogus': figures.false_packets,
        'refused': figures.refused,
    }


def _lines(
    found: Mapping[str, Mapping[str, Mapping[float, LinkStatistics]]], kind: str
) -> Mapping[str, tuple[Array, Array, Array]]:
    """Return what is drawn for a kind of fault: rates, share recovered and share of false packets of each sensor."""
    return {
        sensor: (
            np.array(RATES),
            np.array([row.correct_share for row in kinds[kind].values()]),
            np.array([row.false_packets / row.sent for row in kinds[kind].values()]),
        )
        for sensor, kinds in found.items()
    }
