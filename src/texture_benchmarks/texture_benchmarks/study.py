# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Inputs and results of every study; their common recordings and workers."""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import signal
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from texture_core.errors import DeviceError, InvalidData
from texture_core.types import AnyArray
from texture_estimation.recipe import Recipe
from texture_evaluation.cross_validation import interval, single_blas_thread
from texture_papers.protocol import ExperimentResult
from texture_recordings.dataset import SlideDataset
from texture_recordings.public_sets import IMPORTS
from texture_recordings.slides import STREAMS

DATA = {
    'biotac20': 'BioTac, 20 materials × 40 slides of 6 s (github dexrob/BioTac_slide_20_50, Gao et al. 2020)',
    'ntp21': 'MEMS array of 9 taxels, 21 textures × 4 speeds × 4 forces, one slide each (github LIMB-UCF/NTP)',
}
QUICK_MATERIALS, QUICK_SLIDES = ('material01', 'material02', 'material03'), '1-6'
SPACING_S = 0.5
ROUNDING = 1e-9  # of a quotient of two times


@dataclass(frozen=True)
class BenchmarkOptions:
    """Folders of results and recorded data, and whether to run a reduced benchmark."""

    out: Path  # Folder for the JSON and the chart
    # Folder that holds the recorded data sets, each in a separate folder; None if there is none
    data: Path | None = None
    seed: int = 0  # Of everything random
    quick: bool = False  # Fewer repetitions, for tests; such numbers are not for publishing

    def has(self, name: str) -> bool:
        """Return whether there is a recorded data set of this name."""
        return self.data is not None and (self.data / name).is_dir()

    def recordings(self, name: str) -> Path:
        """Return the folder of a recorded data set, by its name; InvalidData if it is missing."""
        if self.data is None or not self.has(name):
            missing = f"there is no '{name}' in '{self.data}'" if self.data else 'no folder of recorded data was given'
            raise InvalidData(f'{missing}; give the folder that holds {name}/ with --data')
        return self.data / name


@dataclass(frozen=True)
class BenchmarkResult:
    """The numbers of one benchmark, and in one line each what they are of."""

    data: str
    split: str
    numbers: Mapping[str, Any]
    charts: tuple[Path, ...] = field(default=())

    def write(self, out: Path, name: str, measured: str | None) -> Path:
        """Write the JSON and return its path; what was `measured` is the docstring of what measured it."""
        sentence = ' '.join((measured or '').split())
        return ExperimentResult(name, sentence, self.data, self.split, self.numbers, self.charts).write(out)


Job = TypeVar('Job')
Out = TypeVar('Out')

_work: list[Any] = []  # of a worker


def map_forked(work: Callable[[Job], Out], jobs: Sequence[Job]) -> list[Out]:
    """Return work(job) for each job, in their order; one job alone has memory that nothing else has used."""
    found = {place: future.result() for place, future in _forked(work, jobs)}
    return [found[place] for place in range(len(jobs))]


def resumed(work: Callable[[Job], Out], jobs: Mapping[str, Job], path: Path) -> dict[str, Out]:
    """Return work(job) by the name of each part; those that an interrupted run has written to the file come from there.

    A part that fails is named. The file goes when nothing is missing.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = path.read_text(encoding='utf-8').splitlines() if path.is_file() else []
    try:
        found = {line['part']: line['found'] for line in map(json.loads, lines)}
    except (ValueError, TypeError, KeyError) as broken:
        raise outdated(path) from broken
    if not found.keys() <= jobs.keys():
        raise outdated(path)
    if found:
        print(f"{len(found)} parts are of an earlier run, from '{path}'; remove it to compute all again", flush=True)
    left = [name for name in jobs if name not in found]
    with path.open('a', encoding='utf-8') as file:
        for place, future in _forked(lambda name: work(jobs[name]), left):
            if (error := future.exception()) is not None:
                print(f'{left[place]} failed: {type(error).__name__}: {error}', flush=True)
                continue
            found[left[place]] = future.result()
            file.write(json.dumps({'part': left[place], 'found': future.result()}) + '\n')
            file.flush()
    if found.keys() == jobs.keys():
        path.unlink()
    return {name: found[name] for name in jobs if name in found}


def outdated(path: Path) -> InvalidData:
    """Return the error for parts of an earlier run that do not fit this one."""
    return InvalidData(f"'{path}' is of a run with other parts or of an older version; remove it to compute all again")


def _forked(work: Callable[[Job], Out], jobs: Sequence[Job]) -> Iterator[tuple[int, Future[Out]]]:
    """Yield the places of jobs and what they came to, as they are finished."""
    context = multiprocessing.get_context('fork')
    count = min(len(jobs), len(os.sched_getaffinity(0)))
    others = multiprocessing.active_children()
    pool = ProcessPoolExecutor(max(count, 1), context, _begin, (work,))
    places = {pool.submit(_do, job): place for place, job in enumerate(jobs)}
    begun = [process for process in multiprocessing.active_children() if process not in others]
    try:
        for future in as_completed(places):
            if isinstance(future.exception(), BrokenProcessPool):
                raise DeviceError('a measurement ended without a result; see above, or give it more memory')
            yield places[future], future
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in begun:
            process.terminate()


def _begin(work: Callable[[Any], Any]) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # the command's handler raises KeyboardInterrupt, a traceback here
    _work[:] = [work, single_blas_thread()]  # from here on: nothing leaves this block


def _do(job: Any) -> Any:
    return _work[0](job)


def fraction_interval(which: AnyArray | Sequence[bool], clusters: Sequence[str]) -> list[float]:
    """Return the 95 % interval of a fraction, over clusters: slides of one are no independent draws."""
    return interval(np.stack([which, np.ones(len(which))], axis=1), clusters)


def recorded(
    options: BenchmarkOptions,
    name: str,
    quick: tuple[str, Sequence[str]] = ('', ()),
    topics: Sequence[str] = STREAMS,
) -> SlideDataset:
    """Return a recorded data set; of a reduced run the slides and materials of `quick`."""
    with tempfile.TemporaryDirectory() as folder:
        some = quick if options.quick else ('', ())
        bags = IMPORTS[name](options.recordings(name), Path(folder), *some)
        return SlideDataset.from_bags(bags, topics=topics)


def with_spaced_windows(recipe: Recipe) -> Recipe:
    """Return a recipe whose training windows begin every SPACING_S or more: the papers' SVMs take hours otherwise."""
    hop_s = recipe.feature_set.windows.hop_s
    spacing_s = hop_s * math.ceil(SPACING_S / hop_s - ROUNDING)
    return replace(recipe, training=replace(recipe.training, hop_s=spacing_s))
