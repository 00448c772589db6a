# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The demonstration: train on slides simulated ahead of time, then recognise and reject on the emulator, live."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from texture_bringup.launcher import ChildLauncher
from texture_bringup.operator import ExplorationResult, Operator
from texture_core.config import write_json
from texture_core.errors import ExplorationError, InvalidData, LaunchFailed, MotionAborted
from texture_core.types import ExplorationRequest, Rejection, TextureEstimate
from texture_evaluation.charts import COLOURS, chart
from texture_evaluation.train import train_from_bags, train_grades_from_bags
from texture_simulation.offline import SlidePlan, write_simulated

# --------------------
# A ROS domain for the demonstration alone, so that it disturbs nothing that runs already.

# Domains whose ports are below the ephemeral ports of Linux:
# https://docs.ros.org/en/jazzy/Concepts/Intermediate/About-Domain-ID.html The tests of the suite have those above 60.
DOMAINS = range(1, 61)
# Ports of the first participant of domain d (DDSI-RTPS 2.2, 9.6.1.1): 7400 + 250·d + 10 and + 11.
FIRST_PORT, PORTS_PER_DOMAIN, FIRST_UNICAST = 7400, 250, 10


def free_domain() -> int:
    """Return a ROS domain that is not in use."""
    # Programs that start at the same moment look at different domains first.
    first = os.getpid() % len(DOMAINS)
    for domain_id in (*DOMAINS[first:], *DOMAINS[:first]):
        if all(_is_free(FIRST_PORT + PORTS_PER_DOMAIN * domain_id + FIRST_UNICAST + offset) for offset in (0, 1)):
            return domain_id
    raise LaunchFailed(f'every ROS domain from {DOMAINS[0]} to {DOMAINS[-1]} is in use; stop another program first')


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


def _free_port() -> int:
    """Return the usual port of the dashboard, or one that is free."""
    for port in (8085, 0):
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(('127.0.0.1', port))
            return int(probe.getsockname()[1])
    raise LaunchFailed('no TCP port is free; stop another program first')


# --------------------
# What the demonstration explores, and how.


@dataclass(frozen=True)
class DemoPlan:
    """Surfaces of the scene `twelve_textures` with made-up grades of roughness, and the slide over each."""

    trained: Mapping[str, float] = field(
        default_factory=lambda: {
            'glass': 1.0,
            'leather': 2.0,
            'woven_cloth': 2.5,
            'grid_2mm': 3.0,
            'ridge_1mm': 3.0,
            'sandpaper_fine': 3.5,
            'ridge_2mm_shallow': 4.0,
            'ridge_2mm_deep': 4.5,
        }
    )
    recognised: tuple[str, ...] = ('glass', 'leather', 'woven_cloth', 'ridge_2mm_deep')
    untrained: tuple[str, ...] = ('cardboard', 'ridge_3mm')
    training_slides: int = 40  # enough that a slide may end early: 299 must be held out to show 1 % wrong decisions
    speed_m_s: float = 0.05
    force_n: float = 1.0
    distance_m: float = 0.06
    untrained_speed_m_s: float = 0.02
    edge_m: float = 0.08  # where the sample ends

    def request(self, surface: str, speed_m_s: float = 0.0) -> ExplorationRequest:
        """Return a slide over a surface, at the speed of the training unless another is given, and as long in time."""
        speed_m_s = speed_m_s or self.speed_m_s
        return ExplorationRequest(
            'linear_slide',
            speed_m_s=speed_m_s,
            force_n=self.force_n,
            distance_m=self.distance_m * speed_m_s / self.speed_m_s,
            surface=surface,
            early_stopping=True,
        )

    def over_the_edge(self, surface: str) -> ExplorationRequest:
        """Return a slide that is longer than the sample."""
        return replace(self.request(surface), distance_m=1.5 * self.edge_m, early_stopping=False)


ACCEPTED, UNKNOWN = frozenset({Rejection.NONE}), frozenset({Rejection.NOVEL, Rejection.AMBIGUOUS})
OUTSIDE = frozenset({Rejection.OUTSIDE_TRAINING})


@dataclass(frozen=True)
class Slide:
    """Result of one slide: the surface, what was expected, the answer, and the estimates while it lasted."""

    surface: str
    title: str
    expected: frozenset[Rejection]  # one of them; none for a contact that is lost
    answer: ExplorationResult
    estimates: Sequence[TextureEstimate]

    @property
    def as_expected(self) -> bool:
        """Whether the answer is the right one."""
        if not self.expected:
            return self.answer.error is ExplorationError.MOTION_FAILED
        right = self.answer.texture.label == self.surface or self.expected != ACCEPTED
        return self.answer.success and self.answer.texture.rejection in self.expected and right

    @property
    def outcome(self) -> str:
        """The result as a short text."""
        estimate, roughness = self.answer.texture, self.answer.roughness
        if not self.expected:
            return self.answer.message
        if estimate.rejection is not Rejection.NONE:
            if estimate.rejection is Rejection.OUTSIDE_TRAINING:
                return f'rejected, {estimate.message}'
            return f'rejected, {estimate.rejection.name.lower().replace("_", " ")} (nearest: {estimate.label})'
        grade = f'; roughness {roughness.grade:.1f} of 5' if roughness.valid else ''
        early = ', ended early' if estimate.decided else ''
        return f'accepted as {estimate.label} after {estimate.evidence_s:.1f} s{early}{grade}'


# --------------------
# What the demonstration prints while it runs, for a reader who sees the suite for the first time.


class ProgressLog:
    """Print the progress, each section with the time since the start."""

    def __init__(self, out: TextIO = sys.stdout) -> None:
        self._out = out
        self._start_s = time.monotonic()

    def section(self, text: str) -> None:
        """Begin something new."""
        print(f'\n[{time.monotonic() - self._start_s:3.0f} s]  {text}', file=self._out, flush=True)

    def line(self, text: str) -> None:
        """Print a line within the section."""
        print(f'{" " * 8}{text}', file=self._out, flush=True)


# --------------------
# The emulator of the demonstration: its processes, and what the operator does with it.

START_DEADLINE_S = 60.0  # a slow machine that imports everything for the first time
ATTEMPTS = 3  # a machine that is busy with something else delays the emulated arm, and the explorer aborts


class DemoRig:
    """Run the emulator and the real nodes in a separate ROS domain; use it in a `with` block."""

    def __init__(self, folder: Path, log: Path, arguments: Mapping[str, Any]) -> None:
        domain_id = free_domain()
        environment = isolated(domain_id, {**os.environ, 'ROS_LOG_DIR': str(folder / 'ros_log')})
        self._launcher = ChildLauncher('emulator', {'devices': folder, **arguments}, environment, log)
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

    def set_parameters(self, node: str, **values: object) -> None:
        """Set parameters of a node."""
        self._operator.set_parameters(node, values)

    def explore(
        self, request: ExplorationRequest, report: Callable[[str], None], ends: ExplorationError = ExplorationError.NONE
    ) -> tuple[ExplorationResult, list[TextureEstimate]]:
        """Put the surface of a request under the finger and slide; return the answer and the estimates on the way."""
        self.set_parameters('emulator', surface=request.surface)
        estimates: list[TextureEstimate] = []

        def explore(wanted: ExplorationRequest) -> ExplorationResult:
            estimates.clear()
            return self._operator.explore(wanted, lambda _state, texture: estimates.append(texture))

        return explore_with_retries(explore, request, report, ends), estimates


def explore_with_retries(
    explore: Callable[[ExplorationRequest], ExplorationResult],
    request: ExplorationRequest,
    report: Callable[[str], None],
    ends: ExplorationError = ExplorationError.NONE,
) -> ExplorationResult:
    """Return the result of an exploration; one that ends in another way is made again, twice at most."""
    for left in reversed(range(ATTEMPTS)):
        explored = explore(request)
        if explored.error is ends:
            break
        if not left:
            raise MotionAborted(f'the exploration of {request.surface} failed: {explored.message}')
        report(f'aborted: {explored.message}; trying again')
    return explored


# --------------------
# The demonstration from beginning to end.

TRAINING, MODEL, ROUGHNESS = 'training', 'model', 'roughness'  # in the folder of the results
PICTURE, FIGURES, LOG, GRADES = 'demo.png', 'demo.json', 'nodes.log', 'grades.csv'


def _clear(folder: Path) -> None:
    """Make the folder; remove what an earlier demonstration has left there, and nothing else."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(folder / TRAINING, ignore_errors=True)
        models = (f'{name}{ending}' for name in (MODEL, ROUGHNESS) for ending in ('.npz', '.json'))
        for file in (PICTURE, FIGURES, LOG, GRADES, *models):
            (folder / file).unlink(missing_ok=True)
    except OSError as error:
        raise InvalidData(f"'{folder}' cannot be used: {error.strerror}; name another with --out") from error


def demonstrate(
    out: Path, recipe: str, seed: int, plan: DemoPlan, progress: ProgressLog, *, dashboard: bool = False
) -> bool:
    """Train, recognise and reject on the emulator, and report; return whether every answer was as expected."""
    _clear(out)
    _train(out, recipe, seed, plan, progress)
    progress.section('Starting the emulator: surfaces, arm and sensor are simulated, all other nodes are the real ones')
    arguments: dict[str, Any] = {
        'recipe': (out / f'{MODEL}.json').resolve(),
        'model': (out / f'{MODEL}.npz').resolve(),
        'roughness_model': (out / f'{ROUGHNESS}.json').resolve(),
        'seed': seed + 1,
    }
    if dashboard:
        arguments |= {'dashboard': 'true', 'dashboard_port': _free_port()}
    with tempfile.TemporaryDirectory(prefix='texture_demo_') as folder:
        parameters = Path(folder) / 'explorer.yaml'
        parameters.write_text(f'/**/explorer: {{ros__parameters: {{edge_m: {plan.edge_m}}}}}\n')
        arguments['explorer_params'] = parameters
        with DemoRig(Path(folder), out / LOG, arguments) as rig:
            if dashboard:
                progress.line(f'dashboard: http://127.0.0.1:{arguments["dashboard_port"]} while this runs')
            slides = _explore(rig, plan, progress)
    _report(slides, out, progress)
    return all(slide.as_expected for slide in slides)


def _train(out: Path, recipe: str, seed: int, plan: DemoPlan, progress: ProgressLog) -> None:
    """Simulate a session of slides over each surface, and train both models on them."""
    progress.section(f'Simulating {plan.training_slides} slides over each of {len(plan.trained)} surfaces')
    slides = SlidePlan(plan.training_slides, plan.speed_m_s, plan.force_n, plan.distance_m / plan.speed_m_s)
    bags = write_simulated(out / TRAINING, slides, np.random.default_rng(seed), surfaces=tuple(plan.trained))
    progress.section('Training a texture model and a roughness model (as `texture train` does)')
    model = train_from_bags(recipe, bags, out=out / MODEL)
    rows = [f'{surface},{grade}' for surface, grade in plan.trained.items()]
    (out / GRADES).write_text('\n'.join(['texture,grade', *rows, '']))
    train_grades_from_bags('roughness', bags, out / GRADES, out=out / ROUGHNESS)
    reasons = (model.acceptance.reason, model.acceptance.decided_reason)
    progress.line(f'trained on {len(plan.trained)} surfaces: {", ".join(plan.trained)}')
    for reason in filter(None, reasons):
        progress.line(reason)


def _explore(rig: DemoRig, plan: DemoPlan, progress: ProgressLog) -> list[Slide]:
    """Make all slides, and print what was answered to each."""
    slides: list[Slide] = []

    def slide(request: ExplorationRequest, title: str, expected: frozenset[Rejection]) -> None:
        ends = ExplorationError.NONE if expected else ExplorationError.MOTION_FAILED
        made = Slide(request.surface, title, expected, *rig.explore(request, progress.line, ends))
        if expected == ACCEPTED and made.answer.texture.rejection is not Rejection.NONE:
            # By its calibration the model rejects one slide in 25 over trained surfaces.
            progress.line(f'· {title:<28}{made.outcome}; trying again')
            made = Slide(request.surface, title, expected, *rig.explore(request, progress.line, ends))
        slides.append(made)
        progress.line(f'{"✓" if made.as_expected else "✗"} {title:<28}{made.outcome}')

    progress.section('Trained surfaces: a slide ends as soon as the evidence is enough')
    for surface in plan.recognised:
        slide(plan.request(surface), surface, ACCEPTED)
    progress.section('Surfaces that were never trained')
    for surface in plan.untrained:
        slide(plan.request(surface), surface, UNKNOWN)
    progress.section('A speed that was not trained, and a slide over the edge of the sample')
    shown, speed_m_s = plan.recognised[-1], plan.untrained_speed_m_s
    slide(plan.request(shown, speed_m_s), f'{shown} at {speed_m_s:g} m/s', OUTSIDE)
    slide(plan.over_the_edge(shown), 'over the edge', frozenset())
    return slides


def _report(slides: Sequence[Slide], out: Path, progress: ProgressLog) -> None:
    """Store the answers and draw the picture."""
    figures = [
        {
            'surface': slide.surface,
            'title': slide.title,
            'as_expected': slide.as_expected,
            'outcome': slide.outcome,
            'label': slide.answer.texture.label,
            'rejection': slide.answer.texture.rejection.name,
            'decided': slide.answer.texture.decided,
            'evidence_s': slide.answer.texture.evidence_s,
        }
        for slide in slides
    ]
    write_json({'slides': figures}, out / FIGURES)
    draw([slide for slide in slides if slide.expected], out / PICTURE)
    right = sum(slide.as_expected for slide in slides)
    progress.section(f'Done: {right} of {len(slides)} results as expected. Look at {out / PICTURE}')
    progress.line(f'training slides, models, answers and the log of the nodes are in {out}/')


def draw(slides: Sequence[Slide], path: Path) -> None:
    """Draw for each slide how the probabilities grew while the finger slid, and how it ended."""
    columns = 4
    rows = -(-len(slides) // columns)
    title = 'Probability of each trained surface while the finger slides (simulated)'
    with chart(path, (11.0, 2.7 * rows + 0.6), title) as figure:
        axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axis in axes.ravel()[len(slides) :]:
            axis.set_visible(False)
        for axis, slide in zip(axes.ravel(), slides, strict=False):
            _draw_slide(axis, slide)
        axes[0, 0].set_xlim(0.0, 1.05 * max(slide.answer.texture.evidence_s for slide in slides))
        for axis in axes[:, 0]:
            axis.set_ylabel('probability')
        for axis in axes[-1]:
            axis.set_xlabel('sliding time (s)')


def _draw_slide(axis: Any, slide: Slide) -> None:
    estimates = [estimate for estimate in (*slide.estimates, slide.answer.texture) if estimate.probabilities]
    final = slide.answer.texture
    accepted = final.rejection is Rejection.NONE
    # Before the first window all surfaces are equally probable
    count = len(final.probabilities) or 1
    seconds = [0.0, *(estimate.evidence_s for estimate in estimates)]
    best = int(np.argmax(final.probabilities)) if final.probabilities else -1
    for number in range(count):
        values = [1.0 / count, *(estimate.probabilities[number] for estimate in estimates)]
        colour = 'lightgrey' if number != best else COLOURS[2] if accepted else COLOURS[5]
        width, above = (2.0, 3) if number == best else (1.0, 2)
        axis.plot(seconds, values, color=colour, marker='.', linewidth=width, zorder=above)
    nearest = f'\nnearest: {final.label}' if final.label else ''
    reason = final.rejection.name.lower().replace('_', ' ')
    verdict = f'accepted: {final.label}' if accepted else f'rejected: {reason}{nearest}'
    axis.set_title(f'{slide.title}\n{verdict}', color=COLOURS[2] if accepted else COLOURS[5])
    axis.set_ylim(0.0, 1.05)
