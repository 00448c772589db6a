"""The report of an endurance run: figures as JSON, a page and a chart."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from texture_benchmarks.endurance.chart import draw
from texture_benchmarks.endurance.endurance_record import EnduranceRecord
from texture_benchmarks.endurance.page import as_page
from texture_benchmarks.endurance.process_load import cpu_change, lives, work_change
from texture_benchmarks.endurance.record_counts import endings, messages, recoveries, since, spread
from texture_benchmarks.endurance.requirements import RequirementResult, check_requirements
from texture_benchmarks.result import BenchmarkResult


def write(record: EnduranceRecord, out: Path) -> list[Path]:
    """Write endurance.md, endurance.json, endurance-events.json and endurance.png into a folder; return them."""
    results = check_requirements(record)
    page = out / 'endurance.md'
    page.write_text('\n'.join(as_page(record, results)) + '\n', encoding='utf-8')
    events = out / 'endurance-events.json'
    events.write_text(json.dumps(events_as_json(record), indent=1, ensure_ascii=False) + '\n', encoding='utf-8')
    chart = draw(record, out / 'endurance.png')
    return [page, _as_result(record, results, chart).write(out), events, chart]


def _as_result(record: EnduranceRecord, results: Sequence[RequirementResult], chart: Path) -> BenchmarkResult:
    return BenchmarkResult(
        name='endurance',
        measured='explorations by their ending, recovery after faults (s), memory of each process (bytes), computing '
        'time (share of a core), samples and feature vectors lost',
        data='emulated sensor and simulated arm; faults injected at random',
        split='none: one run; the model is trained on simulated slides',
        numbers=as_json(record, results),
        charts=(chart,),
    )


def as_json(record: EnduranceRecord, results: Sequence[RequirementResult]) -> dict[str, Any]:
    """Return the figures."""
    return {
        'seed': record.seed,
        'duration_s': record.end_s - record.begin_s,
        'requirements': [asdict(result) for result in results],
        'endings': endings(record),
        'messages': messages(record),
        'recovery_s': {name: spread(seconds) for name, seconds in recoveries(record).items()},
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
        'explorations': [since(record, asdict(item)) for item in record.explored],
        'faults': [since(record, asdict(item)) for item in record.fault_events],
        'usage': [since(record, asdict(item)) for item in record.usages],
        'pace': [since(record, asdict(item)) for item in record.machine_speeds],
    }
