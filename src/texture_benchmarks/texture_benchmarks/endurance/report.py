"""The report of an endurance run: figures as JSON, a page and a chart."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.endurance.chart import draw
from texture_benchmarks.endurance.endurance_record import EnduranceRecord
from texture_benchmarks.endurance.requirements import (
    RequirementResult,
    check_requirements,
    cpu_change,
    lives,
    work_change,
)
from texture_benchmarks.result import machine

MIB = 2**20
NUMBERS = re.compile(r'\d[\w.:-]*')


def write(record: EnduranceRecord, out: Path) -> list[Path]:
    """Write endurance.md, endurance.json, endurance-events.json and endurance.png into a folder; return them."""
    results = check_requirements(record)
    page = out / 'endurance.md'
    page.write_text('\n'.join(as_page(record, results)) + '\n', encoding='utf-8')
    figures = _write_json(out / 'endurance.json', as_json(record, results))
    events = _write_json(out / 'endurance-events.json', events_as_json(record))
    return [page, figures, events, draw(record, out / 'endurance.png')]


def _write_json(path: Path, content: Any) -> Path:
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + '\n', encoding='utf-8')
    return path


def as_json(record: EnduranceRecord, results: Sequence[RequirementResult]) -> dict[str, Any]:
    """Return the figures."""
    return {
        'machine': machine(),
        'seed': record.seed,
        'duration_s': record.end_s - record.begin_s,
        'verdicts': [asdict(result) for result in results],
        'endings': _endings(record),
        'messages': _messages(record),
        'recovery_s': {name: _spread(seconds) for name, seconds in _recoveries(record).items()},
        'memory': [
            {**asdict(life), 'growth': life.growth, 'own_growth': life.own_growth} for life in lives(record.usages)
        ],
        'cpu_share_early_late': dict(cpu_change(record)),
        'fixed_work_s_early_late': work_change(record),
        'counters': record.totals,
        'signal': {
            'samples': record.signal.samples,
            'lost': record.signal.gaps,
            'restarts': record.signal.restarts,
            'driver_away_s': record.signal.away_s,
            'index_off_time_s': record.signal.drift_s,
        },
        'vectors': record.vectors,
        'unanswered_vectors': record.unanswered,
        'said': [{'node': node, 'level': level, 'text': text, 'times': n} for node, level, text, n in record.said],
        'ends': list(record.ends),
    }


def events_as_json(record: EnduranceRecord) -> dict[str, Any]:
    """Return each exploration, fault and look at a process; times are counted from the beginning of the run."""
    return {
        'explorations': [_since(record, asdict(item)) for item in record.explored],
        'faults': [_since(record, asdict(item)) for item in record.fault_events],
        'usage': [_since(record, asdict(item)) for item in record.usages],
        'pace': [_since(record, asdict(item)) for item in record.machine_speeds],
    }


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
        *_table(('reason', 'times'), [(text, str(n)) for text, n in _messages(record).items()]),
        '',
        '## Faults',
        '',
        *_table(
            ('fault', 'times', 'all works again after, median (s)', 'longest (s)'),
            [
                (name, str(len(seconds)), f'{np.median(seconds):.1f}', f'{max(seconds):.1f}')
                for name, seconds in sorted(_recoveries(record).items())
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


def _endings(record: EnduranceRecord) -> dict[str, dict[str, int]]:
    counts = Counter((item.ending, 'with a fault' if item.faults else 'without') for item in record.explored)
    found: dict[str, dict[str, int]] = {}
    for (ending, when), number in sorted(counts.items()):
        found.setdefault(ending, {})[when] = number
    return found


def _endings_rows(record: EnduranceRecord) -> list[Sequence[str]]:
    return [
        (ending, str(row.get('with a fault', 0)), str(row.get('without', 0)))
        for ending, row in _endings(record).items()
    ]


def _messages(record: EnduranceRecord) -> dict[str, int]:
    texts = Counter(
        f'{item.ending}: {NUMBERS.sub("…", item.message)}' for item in record.explored if item.ending != 'success'
    )
    return dict(texts.most_common())


def _recoveries(record: EnduranceRecord) -> dict[str, list[float]]:
    found: dict[str, list[float]] = {}
    for item in record.fault_events:
        if math.isfinite(item.recovery_s):
            found.setdefault(item.name, []).append(item.recovery_s)
    return found


def _spread(seconds: Sequence[float]) -> dict[str, float]:
    return {'times': len(seconds), 'median': float(np.median(seconds)), 'longest': max(seconds)}


def _since(record: EnduranceRecord, row: dict[str, Any]) -> dict[str, Any]:
    """Return a row with its times counted from the beginning; what is not known as None."""
    timed = {'begin_s', 'end_s', 'back_s', 'time_s'}
    moved = {name: round(value - record.begin_s, 3) if name in timed else value for name, value in row.items()}
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value for name, value in moved.items()
    }
