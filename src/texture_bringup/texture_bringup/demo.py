# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The demonstration: record, train and recognise on the emulated rig."""

from __future__ import annotations

import math
import os
import shutil
import socket
import statistics
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from scipy.signal import welch

from texture_bringup.launcher import ChildLauncher
from texture_bringup.nodes.collector import recorder
from texture_bringup.operator import ExplorationResult, Operator
from texture_core.config import write_json
from texture_core.errors import InvalidData, LaunchFailed, MotionAborted
from texture_core.types import (
    NANOSECONDS,
    Array,
    ExplorationRequest,
    ExplorationState,
    Phase,
    Rejection,
    TactileSignal,
    TextureEstimate,
)
from texture_estimation.model import TextureModel, load_model
from texture_evaluation.charts import COLOURS, chart, draw_confusion
from texture_evaluation.commands import train as training
from texture_evaluation.evaluate import EvaluationReport, evaluate, percent
from texture_evaluation.train import train_from_bags
from texture_recordings.bags import read_bag

# --------------------
# A ROS domain of its own for a demonstration, so that it disturbs nothing that runs already.

# Domains whose ports lie below the ephemeral ports of Linux:
# https://docs.ros.org/en/jazzy/Concepts/Intermediate/About-Domain-ID.html The tests of the suite have those above 60.
DOMAINS = range(1, 61)
# Ports of the first participant of domain d (DDSI-RTPS 2.2, 9.6.1.1): 7400 + 250·d + 10 and + 11.
FIRST_PORT, PORTS_PER_DOMAIN, FIRST_UNICAST = 7400, 250, 10


def free_domain() -> int:
    """Return a ROS domain that nobody uses now."""
    # Programs that start at the same moment look at different domains first.
    first = os.getpid() % len(DOMAINS)
    for domain_id in (*DOMAINS[first:], *DOMAINS[:first]):
        if all(_is_free(FIRST_PORT + PORTS_PER_DOMAIN * domain_id + FIRST_UNICAST + offset) for offset in (0, 1)):
            return domain_id
    raise LaunchFailed(f'every ROS domain from {DOMAINS[0]} to {DOMAINS[-1]} is in use; stop something first')


def isolated(domain_id: int, environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment for processes that meet in a domain of this machine only."""
    return {**environment, 'ROS_DOMAIN_ID': str(domain_id), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', port))
        except OSError:
            return False
    return True


# --------------------
# What the demonstration explores, and how.


@dataclass(frozen=True)
class DemoPlan:
    """Surfaces of the scene `twelve_textures`, slides over each, and the slide itself.

    The finger touches each time at another place; every second slide goes the other way. A last slide at
    `untrained_speed_m_s` shows what is said outside the conditions of the training.
    """

    surfaces: tuple[str, ...] = ('glass', 'leather', 'woven_cloth', 'ridge_2mm_deep')
    shown: str = 'ridge_2mm_deep'  # in the picture: its ridges make a line in the spectrum, at speed / pitch
    learning_slides: int = 3
    recognition_slides: int = 2
    speed_m_s: float = 0.05
    force_n: float = 1.0
    distance_m: float = 0.06
    untrained_speed_m_s: float = 0.02

    def requests(self, surface: str, slides: int, early_stopping: bool = False) -> Iterator[ExplorationRequest]:
        """Yield the explorations of one surface."""
        for number in range(slides):
            yield ExplorationRequest(
                'linear_slide',
                speed_m_s=self.speed_m_s,
                force_n=self.force_n,
                distance_m=self.distance_m,
                direction_rad=math.pi * (number % 2),
                surface=surface,
                early_stopping=early_stopping,
            )

    def untrained_request(self) -> ExplorationRequest:
        """Return a slide over the shown surface, as in the training but for its speed, and as long in time."""
        [usual] = self.requests(self.shown, 1, early_stopping=True)
        slower = self.untrained_speed_m_s / self.speed_m_s
        return replace(usual, speed_m_s=self.untrained_speed_m_s, distance_m=slower * self.distance_m)


# --------------------
# What the demonstration says while it runs, for a reader who sees the suite for the first time.


class ProgressLog:
    """Tell what happens, each chapter with the time since the start."""

    def __init__(self, out: TextIO = sys.stdout) -> None:
        self._out = out
        self._start_s = time.monotonic()

    def section(self, text: str) -> None:
        """Begin something new."""
        print(f'\n[{time.monotonic() - self._start_s:3.0f} s]  {text}', file=self._out, flush=True)

    def line(self, text: str) -> None:
        """Say something within the chapter."""
        print(f'{" " * 8}{text}', file=self._out, flush=True)


# --------------------
# What came out of the recognising slides.


Row = tuple[str, TextureEstimate]  # what lay under the finger, and what was said of it


def is_right(row: Row) -> bool:
    """Return whether the surface was recognised."""
    surface, estimate = row
    return estimate.known and estimate.label == surface


def is_refused(estimate: TextureEstimate) -> bool:
    """Return whether an estimate says that its exploration is outside what was trained, and claims nothing."""
    return estimate.rejection is Rejection.OUTSIDE_TRAINING and not estimate.decided


def latencies_s(bag: Path) -> Mapping[str, float]:
    """Return for each exploration in a bag the median time from the end of a window to the arrival of its estimate."""
    found: defaultdict[str, list[float]] = defaultdict(list)
    for _, log_ns, estimate in read_bag(bag, ('texture',)):
        if estimate.windows and not estimate.final:
            found[estimate.exploration_id].append((log_ns - estimate.stamp_ns) / NANOSECONDS)
    return {name: statistics.median(values) for name, values in found.items()}


# --------------------
# The emulator of the demonstration: its processes, and what the operator does with it.

START_DEADLINE_S = 60.0  # a slow machine that imports everything for the first time


class DemoRig:
    """Run the bench in a ROS domain of its own; use it in a `with` block."""

    def __init__(self, folder: Path, log: Path, recipe: str, seed: int) -> None:
        domain_id = free_domain()
        self._environment = isolated(domain_id, {**os.environ, 'ROS_LOG_DIR': str(folder / 'ros_log')})
        arguments = {'devices': folder, 'recipe': recipe, 'seed': seed}
        self._launcher = ChildLauncher('emulator', arguments, self._environment, log)
        self._operator = Operator(domain_id=domain_id, guard=self._launcher.check)
        self._open = ExitStack()

    def __enter__(self) -> DemoRig:
        with ExitStack() as opening:
            opening.enter_context(self._launcher)
            opening.enter_context(self._operator)
            self._operator.wait_for_explorer(START_DEADLINE_S)
            self._operator.wait_for_signal(START_DEADLINE_S)
            self._open = opening.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    @contextmanager
    def recording(self, bag: Path) -> Iterator[None]:
        """Record the topics into a new bag for the length of a `with` block."""
        with recorder(self._operator, bag, '', self._environment) as check:
            yield
            check()

    def explore(
        self, surface: str, requests: Iterator[ExplorationRequest], tell: Callable[[str], None]
    ) -> Iterator[ExplorationResult]:
        """Lay a surface under the finger and explore it; see `explore_patiently`."""
        self._operator.set_parameters('emulator', {'surface': surface})
        for request in requests:
            yield explore_patiently(self._operator.explore, request, tell)

    def use_model(self, model: Path) -> None:
        """Let the running classifier load a model."""
        self._operator.set_parameters('classifier', {'model': str(model)})


ATTEMPTS = 3  # a machine that is busy with something else holds the emulated arm up, and the explorer aborts


def explore_patiently(
    explore: Callable[[ExplorationRequest], ExplorationResult], request: ExplorationRequest, tell: Callable[[str], None]
) -> ExplorationResult:
    """Return the result of an exploration; an aborted one is made again, twice at most."""
    for left in reversed(range(ATTEMPTS)):
        explored = explore(request)
        if explored.success:
            break
        if not left:
            raise MotionAborted(f'the exploration of {request.surface} failed: {explored.message}')
        tell(f'aborted: {explored.message}; once more')
    return explored


# --------------------
# The picture of the demonstration: one recognised slide from touch to decision.

SHOWN_S = 0.5


def recorded(
    bag: Path,
) -> tuple[dict[str, list[ExplorationState]], dict[str, list[TextureEstimate]], list[TactileSignal]]:
    """Return what a bag holds: slide states and estimates of each exploration, all vibration batches."""
    states: defaultdict[str, list[ExplorationState]] = defaultdict(list)
    estimates: defaultdict[str, list[TextureEstimate]] = defaultdict(list)
    batches: list[TactileSignal] = []
    for _, _, value in read_bag(bag, ('exploration', 'signal', 'texture')):
        if isinstance(value, TactileSignal):
            batches.append(value)
        elif isinstance(value, TextureEstimate) and value.probabilities:
            estimates[value.exploration_id].append(value)
        elif isinstance(value, ExplorationState) and value.phase is Phase.SLIDE:
            states[value.exploration_id].append(value)
    return states, estimates, batches


def sliding_samples(states: Sequence[ExplorationState], batches: Iterable[TactileSignal]) -> Array:
    """Return the samples of an exploration while the finger slid, (n_samples,)."""
    start_ns, end_ns = states[0].stamp_ns, states[-1].stamp_ns
    inside = [batch for batch in batches if start_ns <= batch.stamp_ns and batch.end_ns <= end_ns]
    samples: Array = np.concatenate([batch.samples[:, 0] for batch in inside]).astype(np.float64)
    return samples


def draw(bag: Path, surface: str, model: TextureModel, report: EvaluationReport, path: Path, *, note: str = '') -> None:
    """Draw an exploration of a surface, and the confusion of all explorations in the bag."""
    states, estimates, batches = recorded(bag)
    surfaces = {name: states[name][0].surface for name in estimates}
    own = [name for name in surfaces if surfaces[name] == surface]
    name = min(own, key=lambda each: estimates[each][0].confidence)
    slides = {label: sliding_samples(states[each], batches) for each, label in {**surfaces, name: surface}.items()}
    slides[surface] = sliding_samples(states[name], batches)
    rate_hz, unit = batches[0].sampling_rate_hz, batches[0].common_unit
    title = f'How a slide over {surface} is recognised (simulated Robotiq TSF-85)'
    with chart(path, (11.0, 8.8), title, points=11.0) as figure:
        (signal, spectrum), (evidence, table) = figure.subplots(2, 2)
        shown = slides[surface][: round(SHOWN_S * rate_hz)]
        signal.plot(np.arange(len(shown)) / rate_hz, shown, color=COLOURS[0], linewidth=0.8)
        signal.set(xlabel='time since the slide began (s)', ylabel=f'signal ({unit or "no unit"})')
        signal.set_title(f'1. The fingertip vibrates while it slides: the first {SHOWN_S} s')
        # That of the slide has the first colour, here and in the next panel.
        colours = dict(zip(sorted(slides, key=lambda label: label != surface), COLOURS, strict=False))
        for label, colour in colours.items():
            samples = slides[label]
            hertz, power = welch(samples, fs=rate_hz, nperseg=min(len(samples), round(rate_hz / 2)))
            width, above = (1.6, 3) if label == surface else (0.7, 2)
            spectrum.semilogy(hertz[1:], power[1:], color=colour, linewidth=width, label=label, zorder=above)
        spectrum.set(xlabel='frequency (Hz)', ylabel=f'power density ({f"{unit}²" if unit else "1"}/Hz)')
        spectrum.set_title('2. Its spectrum is the mark of the surface')
        spectrum.legend(loc='upper right')
        _draw_evidence(evidence, model.labels, estimates[name], colours)
        draw_confusion(table, report.labels, report.confusion)
        table.set_title('4. Single windows of all test slides')
        if note:
            figure.supxlabel(note, fontsize=9)


def _draw_evidence(
    axes: Any, labels: Sequence[str], estimates: Sequence[TextureEstimate], colours: Mapping[str, str]
) -> None:
    """Draw the probability of each surface after each window, in its colour, and the confidence that is reported."""
    seconds = [estimate.evidence_s for estimate in estimates]
    for column, label in enumerate(labels):
        share = [100 * estimate.probabilities[column] for estimate in estimates]
        axes.plot(seconds, share, marker='.', color=colours.get(label, 'grey'), label=label, alpha=0.7)
    confidence = [100 * estimate.confidence for estimate in estimates]
    axes.plot(seconds, confidence, color='black', linestyle='--', label='confidence reported')
    axes.set(xlabel='sliding time used (s)', ylabel='probability, confidence (%)', ylim=(-4, 104))
    axes.set_xlim(left=0)
    axes.set_title(f'3. Confidence after each window; {confidence[-1]:.0f} % at the end')
    axes.legend(loc='center left')


# --------------------
# The demonstration from beginning to end.


LEARNING_BAG, RECOGNITION_BAG, MODEL = 'learning_bag', 'recognition_bag', 'model'  # in the folder of the results
PICTURE, FIGURES, LOG = 'demo.png', 'evaluation.json', 'nodes.log'


def _clear(folder: Path) -> None:
    """Make the folder; remove what an earlier demonstration has left there, and nothing else."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for bag in (LEARNING_BAG, RECOGNITION_BAG):
            shutil.rmtree(folder / bag, ignore_errors=True)
        for file in (PICTURE, FIGURES, LOG, f'{MODEL}.npz', f'{MODEL}.json'):
            (folder / file).unlink(missing_ok=True)
    except OSError as error:
        raise InvalidData(f"'{folder}' cannot be used: {error.strerror}; name another with --out") from error


def demonstrate(out: Path, recipe: str, seed: int, plan: DemoPlan, progress: ProgressLog) -> bool:
    """Explore, learn, recognise and report on the emulator; return whether all was recognised that was trained."""
    _clear(out)
    progress.section('Starting the emulator: simulated surfaces, arm and sensor; the other nodes are the real ones')
    with (
        tempfile.TemporaryDirectory(prefix='texture_demo_') as folder,
        DemoRig(Path(folder), out / LOG, recipe, seed) as rig,
    ):
        progress.line('5 nodes run, and the sensor delivers 1000 samples a second')
        _learn(rig, out, plan, progress)
        _train(out, recipe, progress)
        rig.use_model((out / MODEL).resolve())
        progress.line('the running classifier has taken the model over')
        rows = _recognise(rig, out, plan, progress)
        untrained = _explore_untrained(rig, plan, progress)
    report = _report(rows, untrained, out, plan, progress)
    return all(map(is_right, rows)) and len(report.known) >= len(rows) and is_refused(untrained)


def _learn(rig: DemoRig, out: Path, plan: DemoPlan, progress: ProgressLog) -> None:
    progress.section(f'Learning: {plan.learning_slides} slides over each of {len(plan.surfaces)} simulated surfaces')
    with rig.recording(out / LEARNING_BAG):
        for surface in plan.surfaces:
            explored = list(rig.explore(surface, plan.requests(surface, plan.learning_slides), progress.line))
            progress.line(f'{surface:<18}{len(explored)} slides recorded')


def _train(out: Path, recipe: str, progress: ProgressLog) -> None:
    progress.section('Training on that recording (the same as `texture train`)')
    model = train_from_bags(recipe, [out / LEARNING_BAG], out=out / MODEL)
    for line in training.summary(model, out / MODEL):
        progress.line(line)


def _recognise(rig: DemoRig, out: Path, plan: DemoPlan, progress: ProgressLog) -> list[Row]:
    progress.section('Recognising: new slides at other places; each may end as soon as its label is decided')
    rows = []
    with rig.recording(out / RECOGNITION_BAG):
        for surface in plan.surfaces:
            requests = plan.requests(surface, plan.recognition_slides, early_stopping=True)
            for explored in rig.explore(surface, requests, progress.line):
                rows.append((surface, explored.texture))
                progress.line(f'{surface:<18}recognised as {explored.texture.label or "nothing"}')
    return rows


def _explore_untrained(rig: DemoRig, plan: DemoPlan, progress: ProgressLog) -> TextureEstimate:
    speed, usual = plan.untrained_speed_m_s, plan.speed_m_s
    progress.section(f'Outside the training: {plan.shown} again, at {speed:g} m/s instead of {usual:g} m/s')
    [explored] = rig.explore(plan.shown, iter([plan.untrained_request()]), progress.line)
    estimate: TextureEstimate = explored.texture
    progress.line(f'the estimate says: {estimate.message or "nothing"}')
    progress.line('the surface counts as unknown, and the slide is not ended early')
    return estimate


def _report(
    rows: list[Row], untrained: TextureEstimate, out: Path, plan: DemoPlan, progress: ProgressLog
) -> EvaluationReport:
    progress.section('Result')
    latencies = latencies_s(out / RECOGNITION_BAG)
    for surface, estimate in rows:
        progress.line(
            f'{surface:<18}{"✓" if is_right((surface, estimate)) else "✗"} {estimate.label or "nothing"}, confidence '
            f'{estimate.confidence:.3f} after {estimate.evidence_s:.1f} s of sliding, latency '
            f'{1000 * latencies.get(estimate.exploration_id, math.nan):.0f} ms'
        )
    progress.line(f'{sum(map(is_right, rows))} of {len(rows)} slides over simulated surfaces recognised')
    progress.line('latency: from the last sample of a window to its estimate at another process')
    model = load_model(out / MODEL)
    report = evaluate(model, [out / RECOGNITION_BAG])
    said = {name: getattr(untrained, name) for name in ('label', 'known', 'decided', 'message')}
    figures = {**report.as_json(), 'untrained_speed': {'speed_m_s': plan.untrained_speed_m_s, **said}}
    write_json(figures, out / FIGURES)
    windows = percent(report.as_json()['window_accuracy'])
    progress.line(f'`texture evaluate` reads the same recording: {windows} of single windows right')
    refusal = f'The same surface at {plan.untrained_speed_m_s:g} m/s: {untrained.message}'
    note = '\n'.join(filter(None, [model.acceptance.reason or model.acceptance.decided_reason, refusal]))
    draw(out / RECOGNITION_BAG, plan.shown, model, report, out / PICTURE, note=note)
    progress.section(f'Done. Look at {out / PICTURE}')
    progress.line(f'recordings, model, figures and the log of the nodes are in {out}/')
    return report
