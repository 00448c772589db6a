# SPDX-License-Identifier: Apache-2.0
"""What every study is given and hands back; recordings, workers and charts that several of them share."""

from __future__ import annotations

import json
import multiprocessing
import os
import platform
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from texture_core.errors import DeviceError, InvalidData
from texture_core.types import Array
from texture_estimation.search import single_blas_thread
from texture_evaluation.charts import COLOURS, chart, line_styles, pareto_front
from texture_evaluation.metrics import SlideResult
from texture_recordings.public_sets import IMPORTS

CPU_INFO = Path('/proc/cpuinfo')


@dataclass(frozen=True)
class BenchmarkOptions:
    """Where a benchmark writes, where recorded data lies, and whether to hurry."""

    out: Path  # Folder for the JSON and the chart
    # Folder that holds the recorded data sets, each in its own folder; None if there is none
    data: Path | None = None
    seed: int = 0  # Of everything random
    quick: bool = False  # Fewer repetitions, for tests; such numbers are not for publishing
    # Folder of data sets that are imported already, each in its own folder; see `imported`
    bags: Path | None = None

    def recordings(self, name: str) -> Path:
        """Return the folder of a recorded data set, by its name; InvalidData says that it is missing."""
        if self.data is None or not (self.data / name).is_dir():
            where = self.data or 'no folder'
            raise InvalidData(f"no recorded data in '{where}'; give the folder that holds {name}/ with --data")
        return self.data / name


@dataclass(frozen=True)
class BenchmarkResult:
    """The numbers of one benchmark, and in one line each what was measured on what."""

    name: str
    measured: str | None  # mostly the docstring of what measured it
    data: str
    split: str
    numbers: Mapping[str, Any]
    charts: tuple[Path, ...] = field(default=())

    def write(self, out: Path) -> Path:
        """Write the JSON and return its path."""
        out.mkdir(parents=True, exist_ok=True)
        content = {
            'name': self.name,
            'measured': ' '.join((self.measured or '').split()),
            'data': self.data,
            'split': self.split,
            'machine': machine(),
            'numbers': self.numbers,
            'charts': [chart.name for chart in self.charts],
        }
        path = out / f'{self.name}.json'
        path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + '\n', encoding='utf-8')
        return path


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = (head, ['---'] * len(head), *rows)
    return ''.join(f'| {" | ".join(line)} |\n' for line in lines)


def machine() -> str:
    """Return the processor, how many of its cores there are, and the Python in use."""
    lines = CPU_INFO.read_text(encoding='utf-8', errors='replace').splitlines() if CPU_INFO.exists() else []
    models = [line.partition(':')[2].strip() for line in lines if line.startswith('model name')]
    model = models[0] if models else platform.machine()
    return f'{model}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}'


Job = TypeVar('Job')
Out = TypeVar('Out')

_work: list[Callable[[Any], Any]] = []  # of a worker


def map_forked(work: Callable[[Job], Out], jobs: Sequence[Job]) -> list[Out]:
    """Return work(job) for each job, in their order."""
    context = multiprocessing.get_context('fork')
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), context, _begin, (work,)) as pool:
        return list(pool.map(_do, jobs))


def _begin(work: Callable[[Any], Any]) -> None:
    _work[:] = [work]


def _do(job: Any) -> Any:
    with single_blas_thread():
        return _work[0](job)


def in_own_process(measure: Callable[[], Out]) -> Out:
    """Return what a function returns in a process of its own, whose memory nothing else has used."""
    context = multiprocessing.get_context('fork')
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=lambda: there.send(measure()))
    process.start()
    there.close()
    try:
        found: Out = here.recv()
    except EOFError as error:
        raise DeviceError('a measurement ended without an answer; see above, or give it more memory') from error
    finally:
        process.join()
    return found


@contextmanager
def imported(
    options: BenchmarkOptions, name: str, slides: str = '', materials: Sequence[str] = ()
) -> Iterator[list[Path]]:
    """Give the bags of a data set, or of a part of it, to a `with` block."""
    kept = options.bags / name if options.bags else None
    if kept and kept.is_dir() and not (slides or materials):
        yield sorted(kept.iterdir())
        return
    source = options.recordings(name)
    with tempfile.TemporaryDirectory() as folder:
        yield IMPORTS[name](source, Path(folder), slides, materials)


@contextmanager
def importing_once(options: BenchmarkOptions, names: Sequence[str]) -> Iterator[BenchmarkOptions]:
    """Import what is there of some data sets, and give a bench that has their bags to a `with` block.

    One that cannot be imported is left to the benchmarks that need it: they say why, and the others go on.
    """
    with tempfile.TemporaryDirectory() as folder:
        for name in () if options.quick else names:  # a quick run reads parts
            half_done = Path(folder) / f'{name}.part'
            if options.data and (options.data / name).is_dir():
                with suppress(InvalidData, OSError):
                    IMPORTS[name](options.data / name, half_done)
                    half_done.rename(Path(folder) / name)
        yield replace(options, bags=Path(folder))


def decided_at(results: Sequence[SlideResult], confidences: Sequence[float]) -> tuple[Array, Array]:
    """Return mean time (s) and share right of slides that end at a confidence or go on to their end, (n,) each."""
    times, shares = [], []
    for confidence in confidences:
        ends = [next((e for e in r.estimates if e.confidence >= confidence), r.estimates[-1]) for r in results]
        times.append(float(np.mean([end.evidence_s for end in ends])))
        shares.append(float(np.mean([end.label == result.surface for end, result in zip(ends, results, strict=True)])))
    return np.array(times), np.array(shares)


FEW_LINES = 5  # more names than these would cover lines
DIRECT_LABELS = 10  # names in a chart of many methods
LABEL_DECADES, LABEL_SHARE = 0.4, 0.035  # room of a name, on the axes of cost and share
ROOM_DECADES = 0.3  # left of the cheapest point


def evidence_chart(series: Mapping[str, tuple[Array, Array]], title: str, path: str | Path) -> Path:
    """Draw the share of slides recognised over the sliding time used, one line a method."""
    percent = {name: (seconds, 100 * np.asarray(accuracy)) for name, (seconds, accuracy) in series.items()}
    return line_chart(percent, title, ('sliding time used (s)', 'slides recognised (%)'), path)


def line_chart(
    series: Mapping[str, tuple[Array, Array]],
    title: str,
    axis_labels: tuple[str, str],
    path: str | Path,
    *,
    logarithmic: bool = False,
) -> Path:
    """Draw lines of percentages over x, on a logarithmic x axis if wanted; (x, y) by the name of each line."""
    with chart(path, (7.0, 4.2)) as figure:
        axes = figure.subplots()
        for (name, (x, y)), style in zip(series.items(), line_styles(), strict=False):
            axes.plot(x, y, label=name, marker='.', **style)
        axes.set(xlabel=axis_labels[0], ylabel=axis_labels[1], title=title)
        if logarithmic:
            axes.set_xscale('log')
        else:
            axes.set_xlim(left=0)
        axes.set_ylim(top=101)
        if len(series) > FEW_LINES:
            axes.legend(loc='upper center', bbox_to_anchor=(0.5, -0.14), ncols=4, fontsize=8)
        else:
            axes.legend(loc='best')
    return Path(path)


def front_chart(
    panels: Mapping[str, Mapping[str, tuple[float, float]]],
    title: str,
    axis_labels: tuple[str, str],
    path: str | Path,
) -> Path:
    """Draw methods by cost and share of successes, with the front that no other betters; a row for each data set."""
    with chart(path, (7.4, 0.6 + 4.0 * len(panels)), title) as figure:
        rows = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
        for axes, (name, points) in zip(rows, panels.items(), strict=True):
            axes.set(ylabel=axis_labels[1], title=name, xscale='log', ylim=(0, 101))
            _front(axes, points)
        rows[-1].set_xlabel(axis_labels[0])
    return Path(path)


def histogram_chart(series: Mapping[str, Array], title: str, axis_label: str, path: str | Path) -> Path:
    """Draw how values are spread, each group on its own row; the line stands at 99 % of them."""
    with chart(path, (7.0, 1.0 + 1.3 * len(series)), title) as figure:
        rows = figure.subplots(len(series), 1, sharex=True, squeeze=False)[:, 0]
        longest = max(float(np.max(values)) for values in series.values())
        edges = np.linspace(0.0, 1.02 * longest, 120)
        for axes, (name, values) in zip(rows, series.items(), strict=True):
            p99 = float(np.percentile(values, 99))
            axes.hist(values, bins=edges, color=COLOURS[0])
            axes.axvline(p99, color=COLOURS[5], linestyle='--')
            axes.set_title(f'{name}: median {np.median(values):.2f}, 99 % below {p99:.2f}', fontsize=9)
            axes.set_ylabel('windows')
        rows[-1].set_xlabel(axis_label)
    return Path(path)


def _front(axes: Any, points: Mapping[str, tuple[float, float]]) -> None:
    values = list(points.values())
    best = pareto_front(values)
    axes.step(
        [values[index][0] for index in best], [100 * values[index][1] for index in best],
        where='post', color=COLOURS[5], linewidth=1,
    )  # fmt: skip
    for index, (cost, share) in enumerate(values):
        axes.plot(cost, 100 * share, '.', color=COLOURS[5 if index in best else 0])
    costs = [cost for cost, _ in values]
    axes.set_xlim(min(costs) / 10**ROOM_DECADES, 3.5 * max(costs))  # room for the names at both ends
    names = list(points)
    for index, (start, height) in _named(values, best).items():
        left = start < np.log10(values[index][0])
        axes.annotate(
            names[index], (values[index][0], 100 * height), xytext=(-5 if left else 5, 0), textcoords='offset points',
            va='center', ha='right' if left else 'left', fontsize=8, fontweight='bold' if index in best else 'normal',
        )  # fmt: skip


def _free_places(
    points: Sequence[tuple[float, float]], index: int, places: Mapping[int, tuple[float, float]]
) -> list[tuple[float, float]]:
    """Return where the name of a point covers no other point and no name, and does not leave the chart on the left."""
    (x, y), up = points[index], LABEL_SHARE / 2
    edge = min(point[0] for point in points) - ROOM_DECADES
    return [
        place
        for place in ((x, y + up), (x - LABEL_DECADES, y + up), (x, y - up))
        if place[0] >= edge
        and not any(_covers(place, other, LABEL_DECADES) for other in places.values())
        and not any(_covers(place, point, 0.0) for point in points if point != points[index])
    ]


def _named(values: Sequence[tuple[float, float]], best: Sequence[int]) -> dict[int, tuple[float, float]]:
    """Return where names stand, in decades and as a share: the front, then the best that cover nothing."""
    points = [(float(np.log10(cost)), share) for cost, share in values]
    others = sorted(set(range(len(points))) - set(best), key=lambda index: -points[index][1])
    places: dict[int, tuple[float, float]] = {}
    for index in [*sorted(best, key=lambda index: -points[index][1]), *others]:
        free = _free_places(points, index, places)
        if free and len(places) < DIRECT_LABELS:
            places[index] = free[0]
    return places


def _covers(place: tuple[float, float], other: tuple[float, float], length: float) -> bool:
    """Return whether a name that starts at a place lies on another one of a length in decades, or on a point (0)."""
    return -length < other[0] - place[0] < LABEL_DECADES and abs(place[1] - other[1]) < LABEL_SHARE
