# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Hours of explorations on the emulator with faults at random: what is injected, recorded, required and reported.

`texture_benchmarks.ros.soak` runs the nodes; here is all that needs no ROS.
"""

from __future__ import annotations

import math
import os
import re
import signal
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from texture_benchmarks.study import BenchmarkResult
from texture_core.types import NANOSECONDS, Array, ExplorationRequest
from texture_evaluation.charts import COLOURS, chart

SUCCESS, ABORTED, REFUSED, LOST = 'success', 'aborted', 'refused', 'lost'
ENDINGS = {SUCCESS: '#009E73', ABORTED: '#E69F00', REFUSED: '#56B4E9', LOST: '#D55E00'}
NUMBERS = re.compile(r"-?\d[\w.:-]*|'/[^']*'")  # and paths: they differ where sentences are alike
MIB = 2**20


# What is asked, and what is injected meanwhile


class Fault(NamedTuple):
    """A kind of fault: 'unplug', 'corrupt', 'freeze' or 'kill' a node; how often among others, and for how long, s."""

    action: str
    node: str
    weight: float
    low_s: float = 0.0
    high_s: float = 0.0


# Kills are rare, so that nodes also live long enough to show whether their memory grows.
FAULTS: Mapping[str, Fault] = {
    'sensor unplugged': Fault('unplug', 'emulator', 3.0, 0.3, 4.0),
    'bytes corrupted': Fault('corrupt', 'emulator', 3.0, 1.0, 5.0),
    'emulator frozen': Fault('freeze', 'emulator', 2.0, 0.2, 3.0),
    'explorer frozen': Fault('freeze', 'explorer', 2.0, 0.1, 3.0),
    'sensor killed': Fault('kill', 'sensor', 0.4),
    'feature_extractor killed': Fault('kill', 'feature_extractor', 0.4),
    'classifier killed': Fault('kill', 'classifier', 0.4),
    'explorer killed': Fault('kill', 'explorer', 0.4),
}
FLIPS = (1e-4, 2e-2)  # of a bit a byte: from a bad cable to a line on which hardly a packet is whole


class PlannedFault(NamedTuple):
    """One of `FAULTS`: after so much quiet, for so long; `strength` is the probability of a flipped bit."""

    name: str
    quiet_s: float
    hold_s: float
    strength: float


def planned_faults(rng: np.random.Generator, mean_quiet_s: float) -> Iterator[PlannedFault]:
    """Yield faults without end; the quiet before each is exponentially distributed."""
    names, weights = list(FAULTS), np.array([fault.weight for fault in FAULTS.values()])
    low, high = np.log(FLIPS)
    while True:
        name = names[int(rng.choice(len(names), p=weights / weights.sum()))]
        hold_s = float(rng.uniform(FAULTS[name].low_s, FAULTS[name].high_s))
        yield PlannedFault(name, float(rng.exponential(mean_quiet_s)), hold_s, float(np.exp(rng.uniform(low, high))))


STOPPED_SHARE, INVALID_SHARE = 0.08, 0.03  # shares of the explorations
NEW_SURFACE = 0.3  # how often the sample is swapped
IMPOSSIBLE_M_S = 9.0


class PlannedExploration(NamedTuple):
    """An exploration to ask for; `stop_after_s` is NaN if nobody stops it."""

    request: ExplorationRequest
    stop_after_s: float = math.nan

    @property
    def invalid_on_purpose(self) -> bool:
        """Whether it has to be refused."""
        return self.request.speed_m_s == IMPOSSIBLE_M_S


def planned_explorations(rng: np.random.Generator, surfaces: Sequence[str]) -> Iterator[PlannedExploration]:
    """Yield explorations without end; each names the surface that is to lie under the finger."""
    surface = surfaces[0]
    while True:
        if rng.random() < NEW_SURFACE:
            surface = surfaces[int(rng.integers(len(surfaces)))]
        given: dict[str, Any] = {
            'speed_m_s': float(rng.uniform(0.03, 0.15)) if rng.random() >= INVALID_SHARE else IMPOSSIBLE_M_S,
            'force_n': float(rng.uniform(0.5, 3.0)),
            'direction_rad': float(rng.uniform(-math.pi, math.pi)),
        }
        if rng.random() < 0.7:
            request = ExplorationRequest('linear_slide', distance_m=float(rng.uniform(0.03, 0.12)), **given)
        else:
            request = ExplorationRequest('circular', radius_m=0.015, turns=1.0, **given)
        request = replace(request, surface=surface, early_stopping=bool(rng.random() < 0.5))
        yield PlannedExploration(request, float(rng.uniform(0.1, 1.5)) if rng.random() < STOPPED_SHARE else math.nan)


# What is recorded

# What each node counts on /diagnostics; the other numbers there may fall, too.
COUNTERS: Mapping[str, tuple[str, ...]] = {
    'emulator': ('samples', 'skipped samples', 'bytes nobody took', 'refused finger states'),
    'sensor': ('samples', 'lost', 'bogus', 'refused_bytes', 'damaged_stamps', 'reopened', 'revived', 'clock_steps'),
    'feature_extractor': ('windows', 'skipped', 'lost_samples', 'restarts', 'old_states', 'invalid_messages'),
    'classifier': ('estimates', 'refused_vectors', 'not_finite_vectors', 'lost_vectors', 'invalid_messages'),
    'explorer': ('done', 'aborted', 'refused', 'late_steps'),
}


class Totals:
    """Add up counters of a node over its lives: a counter that falls has begun again."""

    def __init__(self) -> None:
        self._now: dict[str, int] = {}
        self._before: Counter[str] = Counter()

    def update(self, numbers: Mapping[str, int]) -> None:
        """Take note of a report; counters of one node that fall in it tell that it was started again."""
        if any(value < self._now.get(name, value) for name, value in numbers.items()):
            self._before.update(self._now)
            self._now = {}
        self._now.update(numbers)

    @property
    def sums(self) -> dict[str, int]:
        """Sum of each counter over all lives."""
        return {name: self._before[name] + self._now.get(name, 0) for name in {**self._before, **self._now}}


class SampleAccount:
    """Compare the running index of a stream with its stamps, life by life of its driver."""

    def __init__(self) -> None:
        self.samples = self.gaps = self.restarts = 0
        self.away_s = 0.0  # no driver ran: from the last sample of one to the first of the next
        self.drift_s = 0.0  # the most that index and stamps of one life disagree: what is missing in both books
        self._first: tuple[int, int] | None = None  # index and stamp of the life
        self._next_sample = self._end_ns = 0

    def update(self, first_sample: int, count: int, stamp_ns: int, rate_hz: float) -> None:
        """Take note of a batch."""
        if self._first is not None and first_sample < self._next_sample:
            self.restarts += 1
            self.away_s += (stamp_ns - self._end_ns) / NANOSECONDS
            self._first = None
        if self._first is None:
            self._first = first_sample, stamp_ns
        else:
            self.gaps += first_sample - self._next_sample
        # A loss that the driver has not noticed is in neither book: stamps then run ahead of the index.
        index, since_ns = self._first
        apart_s = (first_sample - index) / rate_hz - (stamp_ns - since_ns) / NANOSECONDS
        self.drift_s = max(self.drift_s, abs(apart_s))
        self.samples += count
        self._next_sample = first_sample + count
        self._end_ns = stamp_ns + round(count / rate_hz * NANOSECONDS)


STARTED = re.compile(r'\[launch\] (\S+) started \(process (\d+)\)')
ENDED = re.compile(r'\[launch\] (\S+) (?:died with|was killed by|has finished).*')


class Processes:
    """Follow the output of a launcher; use it from one thread."""

    def __init__(self, log: Path) -> None:
        self.pids: dict[str, int] = {}  # of each node that runs
        self.lives: list[tuple[str, int]] = []  # all there have been, in their order: name and process
        self.ends: list[str] = []  # what the launcher said about each end
        self._log = log
        self._position = 0
        self._rest = ''

    def update(self) -> dict[str, int]:
        """Read on, and return the process of each node that runs."""
        with self._log.open(encoding='utf-8', errors='replace') as log:
            log.seek(self._position)
            text = self._rest + log.read()
            self._position = log.tell()
        *lines, self._rest = text.split('\n')
        for line in lines:
            if started := STARTED.fullmatch(line):
                self.pids[started[1]] = int(started[2])
                self.lives.append((started[1], int(started[2])))
            elif ended := ENDED.fullmatch(line):
                self.pids.pop(ended[1], None)
                self.ends.append(line.removeprefix('[launch] '))
        return self.pids


class ProcessUsage(NamedTuple):
    """What a process used until a time (monotonic clock): memory in RAM, computing time."""

    time_s: float
    node: str
    pid: int
    resident_bytes: int
    cpu_s: float


def read_usage(node: str, pid: int, time_s: float) -> ProcessUsage | None:
    """Return what a process uses now; None if it has ended."""
    folder = Path('/proc') / str(pid)
    try:
        status = (folder / 'status').read_text(encoding='ascii', errors='replace')
        # The name of the command, in parentheses, may hold blanks: the fields are counted from behind it.
        fields = (folder / 'stat').read_text(encoding='ascii', errors='replace').rpartition(')')[2].split()
    except OSError:
        return None
    kib = {name: int(value) for name, value in re.findall(r'^(\w+):\s+(\d+) kB', status, re.MULTILINE)}
    if 'VmRSS' not in kib:  # it has ended, and nobody has asked how yet
        return None
    cpu_s = (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
    return ProcessUsage(time_s, node, pid, 1024 * kib['VmRSS'], cpu_s)


@dataclass(frozen=True)
class ExplorationRecord:
    """How one exploration went."""

    # when it was asked for, and answered (monotonic clock)
    begin_s: float
    end_s: float
    ending: str
    message: str  # why, in the words of the explorer or the operator
    wanted: str  # what was to be expected without a fault: 'aborted' for one that was stopped, or 'refused'
    exploration_id: str = ''  # '' if it was refused or lost
    faults: tuple[str, ...] = ()  # in force, or just ended

    @property
    def explained(self) -> bool:
        """Whether it ended as wanted, or a fault tells why not."""
        return self.ending in (SUCCESS, self.wanted) or bool(self.faults)


class FaultEvent(NamedTuple):
    """An injected fault: while it was in force, and when all nodes reported again and samples arrived.

    `back_s` is NaN if they did not in time, inf if the run ended before.
    """

    name: str
    begin_s: float
    end_s: float
    back_s: float
    detail: str


# A fault may still be measured for so long: connections are made again, queues are emptied.
RECOVERY_S = 5.0


def in_force(events: Sequence[FaultEvent], begin_s: float, end_s: float) -> tuple[str, ...]:
    """Return the faults that were measured in a stretch of time."""
    return tuple(
        item.name for item in events if item.begin_s <= end_s and begin_s <= max(item.end_s, item.back_s) + RECOVERY_S
    )


@dataclass(frozen=True)
class SoakRecord:
    """A whole run, in the order of time."""

    begin_s: float
    end_s: float
    seed: int
    explored: Sequence[ExplorationRecord]
    fault_events: Sequence[FaultEvent] = ()
    usages: Sequence[ProcessUsage] = ()
    totals: Mapping[str, Mapping[str, int]] = field(default_factory=dict)  # counters by node, over all of its lives
    signal: SampleAccount = field(default_factory=SampleAccount)
    vectors: int = 0  # feature vectors sent
    unanswered: Mapping[str, int] = field(default_factory=dict)  # those without an estimate, by exploration
    said: Sequence[tuple[str, str, str, int]] = ()  # node, level, sentence without its numbers, how often
    ends: Sequence[str] = ()  # what the launcher said about processes that ended
    ended_early_by: str = ''


# What is required

GROWTH = 0.01
HUNG_S = 60.0
DRIFT_S = 0.3  # of what a device that was frozen keeps and sends late, 0.25 s, nothing may be taken for new
WARM_UP_S = 300.0  # of a process, before its memory is evaluated
STRETCH_S = 120.0  # medians over so long are compared, and a life must have two of them after the warm-up


class Requirement(NamedTuple):
    """One thing asked, what was seen, and whether it holds."""

    asked: str
    seen: str
    holds: bool


def by_process(usages: Sequence[ProcessUsage]) -> dict[tuple[str, int], list[ProcessUsage]]:
    """Return what each process used, in the order of time."""
    found: dict[tuple[str, int], list[ProcessUsage]] = {}
    for usage in usages:
        found.setdefault((usage.node, usage.pid), []).append(usage)
    return found


def memory_growth(usages: Sequence[ProcessUsage]) -> list[dict[str, Any]]:
    """Return of each process that lived long enough its memory after the warm-up and at its end, and the growth."""
    found = []
    for (node, _), own in by_process(usages).items():
        born_s, died_s = own[0].time_s, own[-1].time_s
        if died_s - born_s >= WARM_UP_S + 2 * STRETCH_S:
            early = [one for one in own if born_s + WARM_UP_S <= one.time_s <= born_s + WARM_UP_S + STRETCH_S]
            late = [one for one in own if one.time_s >= died_s - STRETCH_S]
            begin, end = (float(np.median([one.resident_bytes for one in part])) for part in (early, late))
            grown = {'resident_bytes': (begin, end), 'growth': end / begin - 1}
            found.append({'node': node, 'age_s': died_s - born_s, **grown})
    return found


def cpu_shares(usages: Sequence[ProcessUsage]) -> dict[str, tuple[Array, Array]]:
    """Return of each node times (s) and shares of a core used between two looks at the same process."""
    points: dict[str, list[tuple[float, float]]] = {}
    for (node, _), own in by_process(usages).items():
        for before, after in pairwise(own):
            share = (after.cpu_s - before.cpu_s) / max(1e-3, after.time_s - before.time_s)
            points.setdefault(node, []).append((after.time_s, share))
    return {node: (np.array(sorted(pairs))[:, 0], np.array(sorted(pairs))[:, 1]) for node, pairs in points.items()}


def check_requirements(record: SoakRecord) -> list[Requirement]:
    """Return what was asked and seen."""
    explored, total = record.explored, len(record.explored)
    longest_s = max((item.end_s - item.begin_s for item in explored), default=0.0)
    hung = sum(item.end_s - item.begin_s > HUNG_S for item in explored)
    nameless = sum(item.ending != SUCCESS and not item.message for item in explored)
    unexplained = sum(not item.explained for item in explored)
    over = [item for item in record.fault_events if math.isfinite(item.end_s)]
    late = sum(math.isnan(item.back_s) for item in over)
    slowest_s = max((item.back_s - item.end_s for item in over if math.isfinite(item.back_s)), default=0.0)
    kills = sum(item.name.endswith('killed') for item in record.fault_events)
    memory = memory_growth(record.usages)
    worst = max(memory, key=lambda life: life['growth'], default=None)
    grown = f'{worst["node"]}, {worst["growth"]:+.2%} in {worst["age_s"] / 60:.0f} min' if worst else 'no process lived'
    counts, book = record.totals, record.signal
    counted = max(counts.get('sensor', {}).get('lost', 0), counts.get('feature_extractor', {}).get('lost_samples', 0))
    missing = max(0, book.gaps - counted)
    faults = {item.exploration_id: item.faults for item in explored}
    silent = sum(
        count
        for name, count in record.unanswered.items()
        if not any('classifier' in fault for fault in faults.get(name, ('classifier',)))
    )
    lost_vectors = counts.get('classifier', {}).get('lost_vectors', 0)
    return [
        Requirement('the run goes to its end', record.ended_early_by or 'it did', not record.ended_early_by),
        Requirement('every exploration ends', f'{hung} of {total} hung; the longest took {longest_s:.1f} s', not hung),
        Requirement(
            'every abort is named, and none comes without a fault',
            f'{nameless} without a reason; {unexplained} ended otherwise than asked while no fault was injected',
            not nameless and not unexplained,
        ),
        Requirement(
            'after every fault all nodes report and samples flow again',
            f'{late} of {len(over)} did not; the slowest recovery took {slowest_s:.1f} s',
            not late,
        ),
        Requirement(
            'no process ends but those that were killed',
            f'{len(record.ends)} ended, {kills} killed',
            len(record.ends) == kills,
        ),
        Requirement(
            'memory of each process grows < 1 %',
            f'most: {grown} ({len(memory)} processes that lived long enough)',
            worst is not None and worst['growth'] < GROWTH,
        ),
        Requirement(
            'every lost sample is counted',
            f'{book.gaps} of {book.samples + book.gaps} samples lost by the index, {missing} of them not counted on '
            f'/diagnostics; index and time differ by {book.drift_s * 1e3:.0f} ms at most',
            not missing and book.drift_s < DRIFT_S,
        ),
        Requirement(
            'every feature vector is answered or counted',
            f'{sum(record.unanswered.values())} of {record.vectors} without an estimate, {silent} while the classifier '
            f'ran, which counted {lost_vectors} as lost',
            silent <= lost_vectors,
        ),
    ]


# What is reported


def write(record: SoakRecord, out: Path) -> Path:
    """Write endurance.json and endurance.png into a folder; return the path of the figures."""
    endings: dict[str, Counter[str]] = {}
    for item in record.explored:
        endings.setdefault(item.ending, Counter())['with a fault' if item.faults else 'without'] += 1
    messages = Counter(f'{x.ending}: {NUMBERS.sub("…", x.message)}' for x in record.explored if x.ending != SUCCESS)
    recovery_s: dict[str, list[float]] = {}
    for event in record.fault_events:
        if math.isfinite(event.back_s - event.end_s):
            recovery_s.setdefault(event.name, []).append(event.back_s - event.end_s)
    numbers = {
        'seed': record.seed,
        'duration_s': record.end_s - record.begin_s,
        'requirements': [result._asdict() for result in check_requirements(record)],
        'endings': endings,
        'messages': dict(messages.most_common()),
        'recovery_s': {
            name: {'times': len(taken), 'median': float(np.median(taken)), 'longest': max(taken)}
            for name, taken in recovery_s.items()
        },
        'memory': memory_growth(record.usages),
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
        'said': [dict(zip(('node', 'level', 'text', 'times'), row, strict=True)) for row in record.said],
        'ends': list(record.ends),
    }
    return BenchmarkResult(
        name='endurance',
        measured='explorations by their ending, recovery after faults (s), memory of each process (bytes), computing '
        'time (share of a core), samples and feature vectors lost',
        data='emulated sensor and simulated arm; faults injected at random',
        split='none: one run; the model is trained on simulated slides',
        numbers=numbers,
        charts=(draw(record, out / 'endurance.png'),),
    ).write(out)


def draw(record: SoakRecord, path: Path) -> Path:
    """Draw memory and computing time of each node and the endings of explorations over the minutes of the run."""
    colours = dict(zip(dict.fromkeys(usage.node for usage in record.usages), COLOURS, strict=False))
    with chart(path, (10.0, 9.0)) as figure:
        memory, computing, endings = figure.subplots(3, 1, sharex=True)
        labels = set[str]()
        for (node, _), usages in by_process(record.usages).items():
            minutes = [(usage.time_s - record.begin_s) / 60 for usage in usages]
            label = None if node in labels else node
            memory.plot(minutes, [one.resident_bytes / MIB for one in usages], color=colours.get(node), label=label)
            memory.plot(minutes[0], usages[0].resident_bytes / MIB, '|', color=colours.get(node))
            labels.add(node)
        for node, (times_s, shares) in cpu_shares(record.usages).items():
            width = min(6, len(shares))
            means = np.convolve(100 * shares, np.full(width, 1 / width), mode='valid')
            computing.plot((times_s[width - 1 :] - record.begin_s) / 60, means, color=colours.get(node))
        for ending, colour in ENDINGS.items():
            found = [item for item in record.explored if item.ending == ending]
            minutes = [(item.end_s - record.begin_s) / 60 for item in found]
            taken_s = [item.end_s - item.begin_s for item in found]
            endings.plot(minutes, taken_s, '.', color=colour, label=f'{ending} ({len(found)})')
        for event in record.fault_events:
            endings.axvline((event.begin_s - record.begin_s) / 60, ymax=0.05, color='black', linewidth=0.8)
        memory.set(ylabel='resident memory (MiB)', title='1. Memory; a new line begins where a node was killed')
        computing.set(ylabel='computing time (% of a core)', title='2. Computing time of each node, means of a minute')
        endings.set(ylabel='time it took (s)', yscale='log', xlabel='time since the start (min)')
        endings.set_title('3. Each exploration and how it ended; ticks below: faults')
        for axes in (memory, computing):
            axes.set_ylim(bottom=0)
        for axes in (memory, endings):
            axes.legend(loc='center left', bbox_to_anchor=(1.0, 0.5))
    return path


# Hazards of an arm behind ROS controllers: what is wrong with it, and what is required of the force


class ArmHazard(NamedTuple):
    """What befalls an arm: parameters of its controller, a signal to a process, or somebody else who commands it."""

    given: Mapping[str, Any] = {}
    process: str = ''  # 'explorer' or 'guard', which gets the signal in the slide
    number: int = 0
    hold_s: float = 0.0  # a stopped process goes on afterwards; the other commander leaves
    commander: bool = False
    from_start: bool = False  # from before the arm is connected, with the finger where all began
    obeys: bool = True  # whether the arm does what the explorer commands, and the explorer can command


HAZARDS: Mapping[str, ArmHazard] = {
    'wall of 20 kN/m in the slide': ArmHazard({'wall_m': 0.02, 'wall_stiffness_n_m': 20000.0}, from_start=True),
    'velocities inverted': ArmHazard({'invert_twist': True}, from_start=True, obeys=False),
    'force inverted': ArmHazard({'invert_force': True}, from_start=True),
    'force 0.5 s late': ArmHazard({'force_delay_s': 0.5}, from_start=True),
    'force 0.5 s late with new stamps': ArmHazard({'force_delay_s': 0.5, 'stamp_when_sent': True}, from_start=True),
    'explorer paused for 0.5 s': ArmHazard(process='explorer', number=signal.SIGSTOP, hold_s=0.5),
    'explorer stopped for 3 s': ArmHazard(process='explorer', number=signal.SIGSTOP, hold_s=3.0),
    'explorer killed': ArmHazard(process='explorer', number=signal.SIGKILL, obeys=False),
    'guard stopped for 3 s': ArmHazard(process='guard', number=signal.SIGSTOP, hold_s=3.0),
    'guard killed': ArmHazard(process='guard', number=signal.SIGKILL),
    'second commander': ArmHazard(commander=True, hold_s=1.0),
}
NO_HAZARD = 'none'
ATTEMPTS = 3
HARMLESS: Mapping[str, Any] = {
    'wall_m': 2.0,
    'invert_twist': False,
    'invert_force': False,
    'force_delay_s': 0.0,
    'stamp_when_sent': False,
}
FORCE_LIMIT_N, ABOVE_S = 10.0, 0.1
FREE_N = 0.2


class ForceAccount:
    """Follow the size of a force: its peak, and the longest time without a break above the limit."""

    def __init__(self) -> None:
        self.newest_n = self.peak_n = self.above_s = 0.0
        self._since_s: float | None = None

    def update(self, time_s: float, force_n: float) -> None:
        """Take note of the force at a time."""
        self.newest_n, self.peak_n = force_n, max(self.peak_n, force_n)
        if force_n <= FORCE_LIMIT_N:
            self._since_s = None
            return
        self._since_s = time_s if self._since_s is None else self._since_s
        self.above_s = max(self.above_s, time_s - self._since_s)


class HazardRecord(NamedTuple):
    """How an exploration went in which something befell the arm, and the true force on the finger meanwhile."""

    hazard: str
    happened: bool  # what comes in the slide does not come if there is no slide
    ending: str
    message: str
    peak_n: float
    above_s: float
    left_n: float  # once the exploration was over, and the arm obeys


def check_hazards(records: Sequence[HazardRecord]) -> list[Requirement]:
    """Return what is required of the explorations with hazards, and what was seen."""
    calm = [item for item in records if item.hazard == NO_HAZARD]
    blocked = sum(all(item.ending != SUCCESS for item in calm[i : i + ATTEMPTS]) for i in range(len(calm)))
    missing = {item.hazard for item in records} - {item.hazard for item in records if item.happened}
    nameless = [item.hazard for item in records if item.ending != SUCCESS and not item.message]
    longest = max(records, key=lambda item: item.above_s)
    pressed = max(records, key=lambda item: item.left_n)
    return [
        Requirement('every hazard comes', f'not: {", ".join(sorted(missing)) or "none"}', not missing),
        Requirement('every exploration succeeds or is aborted by name', f'{len(nameless)} without', not nameless),
        Requirement(
            f'after a hazard one of {ATTEMPTS} explorations succeeds',
            f'{sum(item.ending == SUCCESS for item in calm)} of {len(calm)} succeeded',
            not blocked,
        ),
        Requirement(
            f'no force above {FORCE_LIMIT_N:g} N for more than {ABOVE_S:g} s in any direction',
            f'longest {longest.above_s * 1e3:.0f} ms, {longest.peak_n:.0f} N, {longest.hazard}',
            longest.above_s <= ABOVE_S,
        ),
        Requirement(
            'no finger stays pressed where the arm obeys',
            f'most {pressed.left_n:.2f} N, {pressed.hazard}',
            pressed.left_n <= FREE_N,
        ),
    ]


def write_hazards(records: Sequence[HazardRecord], out: Path, seed: int, duration_s: float) -> Path:
    """Write hazards.json into a folder; return the path of the figures."""
    numbers = {
        name: {
            'explorations': len(own),
            'endings': dict(Counter(item.ending for item in own)),
            'peak_n': max(item.peak_n for item in own),
            'above_ms': 1e3 * max(item.above_s for item in own),
            'left_n': max(item.left_n for item in own),
            'messages': sorted({item.message for item in own}),
        }
        for name in dict.fromkeys(item.hazard for item in records)
        if (own := [item for item in records if item.hazard == name])
    }
    return BenchmarkResult(
        name='hazards',
        measured='true force on the finger in any direction, its time above the limit, and what is left at the end',
        data='emulated arm behind ROS controllers; faults injected in the slide or before the arm is connected',
        split='none: one run',
        numbers={
            'seed': seed,
            'duration_s': duration_s,
            'explorations': len(records),
            'injections': sum(item.hazard != NO_HAZARD and item.happened for item in records),
            'requirements': [found._asdict() for found in check_hazards(records)],
            'hazards': numbers,
        },
    ).write(out)
