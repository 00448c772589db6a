"""The page of an endurance run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from texture_benchmarks.endurance.endurance_record import EnduranceRecord
from texture_benchmarks.endurance.process_load import cpu_change, lives
from texture_benchmarks.endurance.record_counts import endings, messages, recoveries
from texture_benchmarks.endurance.requirements import RequirementResult
from texture_benchmarks.result import machine

MIB = 2**20


def as_page(record: EnduranceRecord, results: Sequence[RequirementResult]) -> list[str]:
    """Return the lines of the page."""
    minutes = (record.end_s - record.begin_s) / 60
    return [
        '# Endurance',
        '',
        f'{minutes:.0f} minutes on the emulator, {len(record.explored)} explorations, {len(record.fault_events)} '
        f'faults; seed {record.seed}; {machine()}.',
        '',
        *_table(('asked', 'seen', 'holds'), [(v.asked, v.seen, 'yes' if v.holds else '**no**') for v in results]),
        '',
        '## Explorations',
        '',
        *_table(('ended', 'while faults was injected', 'without'), _endings_rows(record)),
        '',
        *_table(('reason', 'times'), [(text, str(n)) for text, n in messages(record).items()]),
        '',
        '## Faults',
        '',
        *_table(
            ('fault', 'times', 'all works again after, median (s)', 'longest (s)'),
            [
                (name, str(len(seconds)), f'{np.median(seconds):.1f}', f'{max(seconds):.1f}')
                for name, seconds in sorted(recoveries(record).items())
            ],
        ),
        '',
        '## Memory',
        '',
        *_table(
            (
                'process',
                'lived (min)',
                'resident after warm-up (MiB)',
                'at the end',
                'growth',
                'growth of its own part',
            ),
            [
                (
                    life.node,
                    f'{life.age_s / 60:.0f}',
                    f'{life.resident_bytes[0] / MIB:.1f}',
                    f'{life.resident_bytes[1] / MIB:.1f}',
                    f'{life.growth:+.2%}',
                    f'{life.own_growth:+.2%}',
                )
                for life in sorted(lives(record.usages), key=lambda life: (life.node, -life.age_s))
            ],
        ),
        '',
        '## Computing time',
        '',
        'At the median speed of the machine in the run, measured by a fixed piece of work.',
        '',
        *_table(
            ('node', 'first third after warm-up (% of a core)', 'last third'),
            [(node, f'{100 * a:.1f}', f'{100 * b:.1f}') for node, (a, b) in sorted(cpu_change(record).items())],
        ),
        '',
        '## Counted on /diagnostics, all lives of a node together',
        '',
        *_table(
            ('node', 'counters'),
            [
                (node, ', '.join(f'{name} {n}' for name, n in sums.items()))
                for node, sums in sorted(record.totals.items())
                if sums
            ],
        ),
        '',
        '## Warnings and errors of the nodes',
        '',
        *_table(('node', 'level', 'sentence', 'times'), [(*row[:3], str(row[3])) for row in record.said]),
    ]


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    lines = [head, ['---'] * len(head), *rows]
    return ['| ' + ' | '.join(cell.replace('|', '/').replace('\n', ' ') for cell in line) + ' |' for line in lines]


def _endings_rows(record: EnduranceRecord) -> list[Sequence[str]]:
    return [
        (ending, str(row.get('with a fault', 0)), str(row.get('without', 0))) for ending, row in endings(record).items()
    ]
