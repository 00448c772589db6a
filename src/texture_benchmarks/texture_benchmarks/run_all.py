"""All benchmarks, each in a process of its own: one that fails stops no other."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess

from texture_estimation.search.parallel import single_blas_thread

Act = Callable[[str], int]  # runs a benchmark by its name and returns the exit code of its process

# Here accuracy counts: they run side by side, one on each core, the longest first. `biotac20` uses the models that
# `decisions` has trained.
SIDE_BY_SIDE = (
    'decisions',
    'trust',
    'learning',
    'ablation',
    'robustness',
    'speed_force',
    'biotac20',
    'onset',
    'next_motion',
    'next_motion_recorded',
    'sensors',
    'segmentation',
    'clock',
)
# What explains rather than measures how well and how fast surfaces are recognised, and what takes ten minutes of a core
# or more; without them all benchmarks take half an hour.
LONG = frozenset(
    {
        'ablation',
        'frontier',
        'recipes',
        'robustness',
        'optimise_large',
        'optimise_pairs',
        'scenes',
        'load',
        'motion',
        'peers',
        'scale',
        'sensors',
        'stick_slip',
        'trust',
    }
)
# What many of them read is imported once.
IMPORTED = ('biotac20', 'ntp21')


def run_all(names: Sequence[str], act: Act) -> dict[str, int]:
    """Run benchmarks, those of SIDE_BY_SIDE first, then the others one by one; return the exit codes by name.

    Parameters
    ----------
    names
        Of the benchmarks.
    act
        Runs one.
    """
    beside = [name for name in SIDE_BY_SIDE if name in names]
    alone = [name for name in names if name not in SIDE_BY_SIDE]
    return {**in_processes(beside, act, os.cpu_count() or 1), **in_processes(alone, act, 1)}


def in_processes(names: Sequence[str], act: Act, at_once: int) -> dict[str, int]:
    """Run the act for each name in a process, so many at once; return the exit codes, below 0 of what was killed.

    Parameters
    ----------
    names
        Names of the benchmarks.
    act
        What each process does.
    at_once
        Number of processes at one time.

    Returns
    -------
    dict
        Exit code of each name.
    """
    waiting, codes = list(names), {}
    running: dict[object, tuple[str, BaseProcess]] = {}
    while waiting or running:
        while waiting and len(running) < at_once:
            name = waiting.pop(0)
            process = _started(name, act, at_once)
            running[process.sentinel] = name, process
        for ended in wait([process.sentinel for _, process in running.values()]):
            name, done = running.pop(ended)
            done.join()
            codes[name] = done.exitcode or 0
    return codes


def _run(name: str, act: Act, at_once: int) -> None:
    with single_blas_thread() if at_once > 1 else nullcontext():
        raise SystemExit(act(name))


def _started(name: str, act: Act, at_once: int) -> BaseProcess:
    """Start the act for one name in a process of its own."""
    context = multiprocessing.get_context('fork')  # nothing is imported again
    process = context.Process(target=_run, args=(name, act, at_once), name=name)
    process.start()
    return process
