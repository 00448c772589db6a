# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The demonstration: train on slides simulated ahead of time, then recognise and reject on the emulator, live."""

from __future__ import annotations

import os
import shlex
import shutil
import socket
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_bringup.feed import in_words
from texture_bringup.launcher import ChildLauncher
from texture_bringup.operator import ExplorationResult, Operator
from texture_core.cli import task
from texture_core.errors import ExplorationError, InvalidData, LaunchFailed
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


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', port))
        except OSError:
            return False
    return True


def _free_port() -> int:
    """Return a TCP port that is free."""
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])


# --------------------
# What the demonstration explores, and how.

# Surfaces of the scene `twelve_textures`, with made-up grades of roughness.
TRAINED = {
    'brushed_metal': 1.0,
    'leather': 2.0,
    'woven_cloth': 2.5,
    'grid_2mm': 3.0,
    'ridge_1mm': 3.0,
    'sandpaper_fine': 3.5,
    'ridge_2mm_shallow': 4.0,
    'ridge_2mm_deep': 4.5,
}
RECOGNISED = ('brushed_metal', 'leather', 'woven_cloth', 'ridge_2mm_deep')
UNTRAINED = ('cardboard', 'ridge_3mm')
TRAINING_SLIDES = 40  # enough that a slide may end early: 299 must be held out to show 1 % wrong decisions
SPEED_M_S, FORCE_N, DISTANCE_M = 0.05, 1.0, 0.06
UNTRAINED_SPEED_M_S = 0.02
EDGE_M = 0.08  # where the sample ends
ACCEPTED, UNKNOWN = frozenset({Rejection.NONE}), frozenset({Rejection.NOVEL, Rejection.AMBIGUOUS})
OUTSIDE = frozenset({Rejection.OUTSIDE_TRAINING})
LOST: frozenset[Rejection] = frozenset()  # of the contact


@dataclass(frozen=True)
class Slide:
    """Result of one slide: the surface, what was expected, the answer, and the estimates while it lasted."""

    surface: str
    title: str
    expected: frozenset[Rejection]  # one of them; none for a contact that is lost
    answer: ExplorationResult
    estimates: Sequence[TextureEstimate]

    @property
    def ended(self) -> bool:
        """Whether the motion ended as expected."""
        return self.answer.error is (ExplorationError.NONE if self.expected else ExplorationError.MOTION_FAILED)

    @property
    def as_expected(self) -> bool:
        """Whether the answer is the right one."""
        if not (self.ended and self.expected):
            return self.ended
        right = self.answer.texture.label == self.surface or self.expected != ACCEPTED
        return self.answer.texture.rejection in self.expected and right

    @property
    def outcome(self) -> str:
        """The result as a short text."""
        estimate, roughness = self.answer.texture, self.answer.roughness
        if not self.answer.success:
            return self.answer.message
        if estimate.rejection is Rejection.OUTSIDE_TRAINING:
            return f'rejected, {estimate.message}'
        if not estimate.label:
            return f'no answer: {estimate.message}'
        if estimate.rejection is not Rejection.NONE:
            return f'rejected, {in_words(estimate.rejection)} (nearest: {estimate.label})'
        grade = f'; roughness {roughness.grade:.1f} of 5' if roughness.valid else ''
        early = ', ended early' if estimate.decided else ''
        return f'accepted as {estimate.label} after {estimate.evidence_s:.1f} s{early}{grade}'


# --------------------
# What the demonstration prints while it runs, for a reader who sees the suite for the first time.


START_S = time.monotonic()


def section(text: str) -> None:
    """Begin something new, with the time since the start."""
    print(f'\n[{time.monotonic() - START_S:3.0f} s]  {text}', flush=True)


def line(text: str) -> None:
    """Print a line within the section."""
    print(f'{" " * 8}{text}', flush=True)


# --------------------
# The demonstration from beginning to end.

TRAINING, MODEL, ROUGHNESS = 'training', 'model', 'roughness'  # in the folder of the results
PICTURE, LOG, GRADES = 'demo.png', 'nodes.log', 'grades.csv'


def _clear(folder: Path) -> None:
    """Make the folder; remove what an earlier demonstration has left there, and nothing else."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()) and not (folder / LOG).exists():
            raise InvalidData(f"'{folder}' holds files that no demonstration wrote; name another folder with --out")
        for left in (TRAINING, f'{MODEL}.added'):
            shutil.rmtree(folder / left, ignore_errors=True)
        models = (f'{name}{ending}' for name in (MODEL, ROUGHNESS) for ending in ('.npz', '.json'))
        for file in (PICTURE, LOG, GRADES, *models):
            (folder / file).unlink(missing_ok=True)
        (folder / LOG).touch()  # marks the folder from the beginning
    except OSError as error:
        raise InvalidData(f"'{folder}' cannot be used: {error.strerror}; name another with --out") from error


START_DEADLINE_S = 60.0  # a slow machine that imports everything for the first time
ATTEMPTS = 3  # a machine that is busy with something else delays the emulated arm, and the explorer aborts


def demonstrate(out: Path, recipe: str, seed: int, *, dashboard: bool = False) -> bool:
    """Train, recognise and reject on the emulator, and report; return whether every answer was as expected."""
    _clear(out)
    _train(out, recipe, seed)
    port = _free_port() if dashboard else 0
    address = f'http://127.0.0.1:{port}'
    if dashboard:
        line(f'dashboard: {address} from `Starting the emulator` to `Ending the nodes`')
    section('Starting the emulator: surfaces, arm and sensor are simulated, all other nodes are the real ones')
    with tempfile.TemporaryDirectory(prefix='texture_demo_') as name:
        folder = Path(name)
        (folder / 'explorer.yaml').write_text(f'/**/explorer: {{ros__parameters: {{edge_m: {EDGE_M}}}}}\n')
        arguments: dict[str, Any] = {
            'devices': folder,
            'explorer_params': folder / 'explorer.yaml',
            'recipe': (out / f'{MODEL}.json').resolve(),
            'model': (out / f'{MODEL}.npz').resolve(),
            'roughness_model': (out / f'{ROUGHNESS}.json').resolve(),
            'seed': seed + 1,
        }
        if dashboard:
            arguments |= {'dashboard': 'true', 'dashboard_port': port}
        domain_id = free_domain()
        environment = {
            **os.environ,
            'ROS_DOMAIN_ID': str(domain_id),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_LOG_DIR': str(folder / 'ros_log'),
        }
        with (
            ChildLauncher('emulator', arguments, environment, out / LOG) as launcher,
            Operator(domain_id=domain_id, guard=launcher.check) as operator,
        ):
            operator.wait_for_explorer(START_DEADLINE_S)
            operator.wait_for_signal(START_DEADLINE_S)
            if dashboard:
                operator.wait_for_node('dashboard', START_DEADLINE_S)
                line(f'the dashboard is at {address} now')
            slides = _explore(operator)
            section('Ending the nodes, then drawing the picture')
    draw([slide for slide in slides if slide.expected], out / PICTURE)
    right = sum(slide.as_expected for slide in slides)
    section(f'Done: {right} of {len(slides)} results as expected. Look at {out / PICTURE}')
    line(f'training slides, models and the log of the nodes are in {out}/')
    line('by hand, in one terminal and, once it prints `the sensor delivers samples`, in another:')
    for command in by_hand(out, port):
        line(f'    {command}')
    if dashboard:
        line(f'the first of them serves the dashboard at {address} again')
    return all(slide.as_expected for slide in slides)


def _train(out: Path, recipe: str, seed: int) -> None:
    """Simulate a session of slides over each surface, and train both models on them."""
    section(f'Simulating {TRAINING_SLIDES} slides over each of {len(TRAINED)} surfaces')
    slides = SlidePlan(TRAINING_SLIDES, SPEED_M_S, FORCE_N, DISTANCE_M / SPEED_M_S)
    bags = write_simulated(out / TRAINING, slides, np.random.default_rng(seed), surfaces=tuple(TRAINED))
    section('Training a texture model and a roughness model (as `texture train` does)')
    with task('training the texture model'):
        model = train_from_bags(recipe, bags, out=out / MODEL)
    rows = [f'{surface},{grade}' for surface, grade in TRAINED.items()]
    (out / GRADES).write_text('\n'.join(['texture,grade', *rows, '']))
    with task('training the roughness model'):
        train_grades_from_bags('roughness', bags, out / GRADES, out=out / ROUGHNESS)
    line(f'trained on {len(TRAINED)} surfaces: {", ".join(TRAINED)}')
    for reason in filter(None, (model.acceptance.reason, model.acceptance.decided_reason)):
        line(reason)


def _explore(operator: Operator) -> list[Slide]:
    """Make all slides, and print what was answered to each."""
    slides: list[Slide] = []

    def slide(surface: str, title: str, expected: frozenset[Rejection], **changes: Any) -> None:
        usual = ExplorationRequest(
            'linear_slide',
            speed_m_s=SPEED_M_S,
            force_n=FORCE_N,
            distance_m=DISTANCE_M,
            surface=surface,
            early_stopping=True,
        )
        slides.append(slide_over(operator, replace(usual, **changes), title, expected))
        line(f'{"✓" if slides[-1].as_expected else "✗"} {title:<28}{slides[-1].outcome}')

    section('Trained surfaces: a slide ends as soon as the evidence is enough (roughness 1 is smooth)')
    for surface in RECOGNISED:
        slide(surface, surface, ACCEPTED)
    section('Surfaces that were never trained')
    for surface in UNTRAINED:
        slide(surface, surface, UNKNOWN)
    section('A speed that was not trained, and a slide over the edge of the sample')
    shown, speed_m_s = RECOGNISED[-1], UNTRAINED_SPEED_M_S
    as_long = DISTANCE_M * speed_m_s / SPEED_M_S  # in time
    slide(shown, f'{shown} at {speed_m_s:g} m/s', OUTSIDE, speed_m_s=speed_m_s, distance_m=as_long)
    slide(shown, 'over the edge', LOST, distance_m=1.5 * EDGE_M, early_stopping=False)
    return slides


def slide_over(operator: Operator, request: ExplorationRequest, title: str, expected: frozenset[Rejection]) -> Slide:
    """Put the surface of a request under the finger and slide.

    A slide that is aborted, lost all samples, or is rejected over a trained surface is made again, twice at most: by
    its calibration the model rejects one slide in 25.
    """
    operator.set_parameters('emulator', {'surface': request.surface})
    estimates: list[TextureEstimate] = []
    for left in reversed(range(ATTEMPTS)):
        estimates.clear()
        answer = operator.explore(request, lambda _state, texture: estimates.append(texture))
        made = Slide(request.surface, title, expected, answer, estimates)
        rejected = expected == ACCEPTED and answer.texture.rejection is not Rejection.NONE
        if not left or (made.ended and not rejected and (answer.texture.label or not expected)):
            break
        line(f'· {title:<28}{made.outcome}; this try does not count, trying again')
    return made


def by_hand(out: Path, dashboard_port: int) -> tuple[str, str]:
    """Return the commands with which a user explores with the model of the demonstration, beside other emulators."""
    program = Path(shutil.which('texture') or 'texture')
    texture = str(program.relative_to(Path.cwd()) if program.is_relative_to(Path.cwd()) else program)
    arguments = ['namespace:=demo', 'surface:=leather', f'model:={out / MODEL}.npz']
    if dashboard_port:
        arguments += ['dashboard:=true', f'dashboard_port:={dashboard_port}']
    motion = ['linear_slide', '--namespace', 'demo', '--speed', f'{SPEED_M_S:g}', '--distance', f'{DISTANCE_M:g}']
    return shlex.join([texture, 'launch', 'emulator', *arguments]), shlex.join([texture, 'explore', *motion])


def draw(slides: Sequence[Slide], path: Path) -> None:
    """Draw for each slide how the probabilities grew while the finger slid, and how it ended."""
    columns = 2
    rows = -(-len(slides) // columns)
    title = 'Probability of each surface while the finger slides (simulated)'
    with chart(path, (6.0, 1.9 * rows + 0.6), title) as figure:
        axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axis in axes.ravel()[len(slides) :]:
            axis.set_axis_off()
            axis.text(
                0.0,
                0.5,
                'green: accepted\norange: rejected\ngrey: other surfaces\ndotted: before the\nfirst estimate\n\n'
                'Probabilities are among\ntrained surfaces; novel:\nfar from all of them',
                transform=axis.transAxes,
                va='center',
            )
        for axis, slide in zip(axes.ravel(), slides, strict=False):
            _draw_slide(axis, slide)
        axes[0, 0].set_xlim(0.0, 1.05 * max(slide.answer.texture.evidence_s for slide in slides))
        for axis in axes[:, 0]:
            axis.set_ylabel('probability')
        for axis in axes.ravel():
            axis.tick_params(labelbottom=True)
        for axis in axes[-1]:
            axis.set_xlabel('sliding time (s)')


def _draw_slide(axis: Any, slide: Slide) -> None:
    estimates = [estimate for estimate in (*slide.estimates, slide.answer.texture) if estimate.probabilities]
    final = slide.answer.texture
    accepted = final.rejection is Rejection.NONE
    seconds = [estimate.evidence_s for estimate in estimates]
    best = int(np.argmax(final.probabilities)) if final.probabilities else -1
    for number in range(len(final.probabilities)):
        values = [estimate.probabilities[number] for estimate in estimates]
        colour = 'lightgrey' if number != best else COLOURS[2] if accepted else COLOURS[5]
        width, above = (2.0, 3) if number == best else (1.0, 2)
        axis.plot(seconds, values, color=colour, marker='.', linewidth=width, zorder=above)
        # No estimate before the first window: from as probable as any other.
        before_s, before = (0.0, *seconds[:1]), (1.0 / len(final.probabilities), *values[:1])
        axis.plot(before_s, before, color=colour, linestyle=':', linewidth=1.0, zorder=above)
    verdict = (
        f'accepted: {final.label}' if accepted else f'rejected: {in_words(final.rejection)}\nnearest: {final.label}'
    )
    if not final.label:
        verdict = 'no answer'
        axis.text(0.02, 0.5, final.message, transform=axis.transAxes, va='center', wrap=True)
    axis.set_title(f'{slide.title}\n{verdict}', color=COLOURS[2] if accepted else COLOURS[5])
    axis.set_ylim(0.0, 1.05)
