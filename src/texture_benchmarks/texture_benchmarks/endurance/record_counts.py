"""What is counted over an endurance run."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from texture_benchmarks.endurance.endurance_record import EnduranceRecord

NUMBERS = re.compile(r'\d[\w.:-]*')


def endings(record: EnduranceRecord) -> dict[str, dict[str, int]]:
    """Return how often explorations ended in each way, with a fault and without."""
    counts = Counter((item.ending, 'with a fault' if item.faults else 'without') for item in record.explored)
    found: dict[str, dict[str, int]] = {}
    for (ending, when), number in sorted(counts.items()):
        found.setdefault(ending, {})[when] = number
    return found


def messages(record: EnduranceRecord) -> dict[str, int]:
    """Return what explorations without success said, with numbers left out, and how often."""
    texts = Counter(
        f'{item.ending}: {NUMBERS.sub("…", item.message)}' for item in record.explored if item.ending != 'success'
    )
    return dict(texts.most_common())


def recoveries(record: EnduranceRecord) -> dict[str, list[float]]:
    """Return the times of recovery, s, by the name of the fault."""
    found: dict[str, list[float]] = {}
    for item in record.fault_events:
        if math.isfinite(item.recovery_s):
            found.setdefault(item.name, []).append(item.recovery_s)
    return found


def spread(seconds: Sequence[float]) -> dict[str, float]:
    """Return count, median and longest of times, s."""
    return {'times': len(seconds), 'median': float(np.median(seconds)), 'longest': max(seconds)}


def since(record: EnduranceRecord, row: dict[str, Any]) -> dict[str, Any]:
    """Return a row with its times counted from the beginning; what is not known as None."""
    timed = {'begin_s', 'end_s', 'back_s', 'time_s'}
    moved = {name: round(value - record.begin_s, 3) if name in timed else value for name, value in row.items()}
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value for name, value in moved.items()
    }
