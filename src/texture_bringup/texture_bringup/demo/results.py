"""What came out of the recognising slides, as a table."""

from __future__ import annotations

import statistics
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from texture_core.estimates import TextureEstimate
from texture_core.signal import NANOSECONDS
from texture_estimation.open_set.domain import OUTSIDE
from texture_recordings.bags import read_bag


@dataclass(frozen=True)
class RecognisedSlide:
    """One slide: what lay under the finger, and what was said of it."""

    surface: str
    estimate: TextureEstimate

    @property
    def right(self) -> bool:
        """Whether the surface was recognised."""
        return self.estimate.known and self.estimate.label == self.surface


def is_refused(estimate: TextureEstimate) -> bool:
    """Return whether an estimate says that its exploration is outside what was trained, and claims nothing."""
    return estimate.message.startswith(OUTSIDE) and not estimate.known and not estimate.decided


def untrained_figures(estimate: TextureEstimate, speed_m_s: float) -> dict[str, Any]:
    """Return what is written of the slide at a speed that was not trained."""
    return {
        'speed_m_s': speed_m_s,
        'label': estimate.label,
        'known': estimate.known,
        'decided': estimate.decided,
        'message': estimate.message,
    }


def latencies_s(bag: Path) -> Mapping[str, float]:
    """Return for each exploration in a bag the median time from the end of a window to the arrival of its estimate."""
    found: defaultdict[str, list[float]] = defaultdict(list)
    for _, log_ns, estimate in read_bag(bag, ('texture',)):
        if estimate.windows and not estimate.final:
            found[estimate.exploration_id].append((log_ns - estimate.stamp_ns) / NANOSECONDS)
    return {name: statistics.median(values) for name, values in found.items()}


def table(rows: Sequence[RecognisedSlide], latencies: Mapping[str, float]) -> list[str]:
    """Return the lines of the table of results; latencies in s by exploration."""
    width = max(13, *(len(row.surface) for row in rows))
    lines = [f'{"surface":<{width}}  {"recognised as":<{width}}    confidence  sliding used  latency']
    for row in rows:
        latency_s = latencies.get(row.estimate.exploration_id)
        lines.append(
            f'{row.surface:<{width}}  {row.estimate.label or "nothing":<{width}}  {"✓" if row.right else "✗"} '
            f'{row.estimate.confidence:10.3f}  {row.estimate.evidence_s:10.1f} s  '
            + (f'{1000 * latency_s:4.0f} ms' if latency_s is not None else '   –')
        )
    return lines
