"""What was found while tables were imported: slides, malformed rows, gaps, jitter."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from texture_recordings.tables.table import EXAMPLES, MalformedRow
from texture_recordings.tables.time_grid import GridRows


@dataclass
class StreamCounts:
    """Counts of one stream over all slides."""

    rate_hz: float = 0.0
    samples: int = 0
    gaps: int = 0
    lost: int = 0
    disordered: int = 0
    repaired: int = 0
    steps: int = 0
    jitter_sum_s2: float = 0.0
    jitter_max_s: float = 0.0

    def add(self, rows: GridRows, repaired: int) -> None:
        """Count one slide."""
        self.samples += len(rows.samples)
        self.gaps += rows.gaps
        self.lost += rows.lost
        self.disordered += rows.disordered
        self.repaired += repaired
        self.steps += len(rows.jitter_s)
        self.jitter_sum_s2 += float(np.square(rows.jitter_s).sum())
        self.jitter_max_s = max(self.jitter_max_s, float(np.abs(rows.jitter_s).max(initial=0.0)))

    @property
    def jitter_s(self) -> float:
        """Root mean square of what steps of time differ from the sampling interval."""
        return float(np.sqrt(self.jitter_sum_s2 / self.steps)) if self.steps else 0.0


@dataclass
class ImportReport:
    """Counts of an import.

    Examples
    --------
    >>> report = ImportReport(files=1, rows=10, streams={'signal': StreamCounts(rate_hz=100.0, samples=10)})
    >>> report.note('run.csv', 2, [])
    >>> report.lines()[1]
    'malformed rows: 2 of 10'
    """

    bags: list[Path] = field(default_factory=list)
    files: int = 0
    ignored_files: int = 0
    rows: int = 0
    malformed_rows: int = 0
    examples: list[str] = field(default_factory=list)
    short_slides: int = 0
    slides: Counter[str] = field(default_factory=Counter)
    streams: dict[str, StreamCounts] = field(default_factory=dict)

    def note(self, place: str, count: int, rows: Iterable[MalformedRow]) -> None:
        """Count malformed rows of a table, and keep the first ones.

        Parameters
        ----------
        place
            File, and array in it.
        count
            Number of malformed rows.
        rows
            The first of them.
        """
        self.malformed_rows += count
        if count:
            self.examples += [f"'{place}', {row}" for row in rows][: EXAMPLES - len(self.examples)]

    def lines(self) -> list[str]:
        """Return the counts in lines for people."""
        slides = sum(self.slides.values())
        said = [
            f'{slides} slides over {len(self.slides)} surfaces from {self.files} files'
            + (f'; {self.ignored_files} files have other names' if self.ignored_files else ''),
            f'malformed rows: {self.malformed_rows} of {self.rows}',
            *(f'  {example}' for example in self.examples),
        ]
        for name, stream in self.streams.items():
            said.append(
                f'{name}: {stream.samples} samples at {stream.rate_hz:g} Hz; jitter {1e3 * stream.jitter_s:.2f} ms '
                f'rms, {1e3 * stream.jitter_max_s:.2f} ms at most; {stream.lost} samples lost in {stream.gaps} gaps, '
                f'{stream.disordered} rows out of order left out, {stream.repaired} samples interpolated'
            )
        if self.short_slides:
            said.append(f'slides too short, left out: {self.short_slides}')
        return said
