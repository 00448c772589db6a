"""What a benchmark hands back: numbers as JSON, with the machine, the data and the split they were got from."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from texture_core.errors import InvalidData

CPU_INFO = Path('/proc/cpuinfo')


@dataclass(frozen=True)
class BenchmarkOptions:
    """Where a benchmark writes, where recorded data lies, and whether to hurry.

    Parameters
    ----------
    out
        Folder for the JSON and the chart.
    data
        Folder that holds the recorded data sets, each in its own folder; None if there is none.
    seed
        Of everything random.
    duration_s
        Of the one measurement whose length may be chosen.
    bags
        Folder of data sets that are imported already, each in its own folder; see `imports.imported`.
    quick
        Fewer repetitions, for tests; such numbers are not for publishing.
    own_methods
        Recipes of one's own, by path, and estimators by 'module:Class', that `recipes` tries beside the shipped ones.
    own_bags
        Labelled bags, or folders of bags, that `recipes` takes in place of the recorded data sets.
    """

    out: Path
    data: Path | None = None
    seed: int = 0
    quick: bool = False
    duration_s: float = 30.0
    bags: Path | None = None
    own_methods: tuple[str, ...] = ()
    own_bags: tuple[Path, ...] = ()

    def recordings(self, name: str, *more: str) -> list[Path]:
        """Return the folders of recorded data sets, by the names of these.

        Raises
        ------
        InvalidData
            If one of them is missing.
        """
        folders = [self.data / each for each in (name, *more)] if self.data else []
        if not folders or not all(folder.is_dir() for folder in folders):
            wanted = ' and '.join(f'{each}/' for each in (name, *more))
            raise InvalidData(
                f"no recorded data in '{self.data or 'no folder'}'; give the folder that holds {wanted} with --data"
            )
        return folders


@dataclass(frozen=True)
class BenchmarkResult:
    """The numbers of one benchmark, and in one line each what was measured on what."""

    name: str
    measured: str
    data: str
    split: str
    numbers: Mapping[str, Any]
    charts: tuple[Path, ...] = field(default=())

    def write(self, out: Path) -> Path:
        """Write the JSON and return its path."""
        out.mkdir(parents=True, exist_ok=True)
        content = {
            'name': self.name,
            'measured': self.measured,
            'data': self.data,
            'split': self.split,
            'machine': machine(),
            'numbers': self.numbers,
            'charts': [chart.name for chart in self.charts],
        }
        path = out / f'{self.name}.json'
        path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + '\n', encoding='utf-8')
        return path


def machine() -> str:
    """Return the processor, how many of its cores there are, and the Python in use."""
    lines = CPU_INFO.read_text(encoding='utf-8', errors='replace').splitlines() if CPU_INFO.exists() else []
    models = [line.partition(':')[2].strip() for line in lines if line.startswith('model name')]
    model = models[0] if models else platform.machine()
    return f'{model}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}'
