# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Five linens measured along x and along y (Hu et al. 2014)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from texture_core.types import Array
from texture_papers.hu import principal_components
from texture_papers.protocol import (
    Anchor,
    Experiment,
    ExperimentResult,
    Figures,
    Finding,
    Method,
    MethodResults,
    PaperProtocol,
    RecognitionTask,
    drawn,
    mean,
    recipe_of,
)
from texture_papers.report import better_on, built_in, digests, finding_as_json, higher
from texture_papers.slides import Slides, View, Visits, gather
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import load_scene

TASK = 'five linens'
PAPER = 39  # components of one linen in one direction
SLIDE_S = 3.0
BOTH, ONE = 'hu-pca-svm-xy', 'hu-pca-svm'
X_ONLY, Y_ONLY = f'{ONE}, x alone', f'{ONE}, y alone'
LOG, POWER, OF_PAPER = f'{BOTH}, logarithm', f'{BOTH}, power', f'{BOTH}, 39 + 39 components'
ALONG_X_AND_Y = (View(), View(turned_rad=math.pi / 2))


def findings(outcomes: MethodResults) -> list[Finding]:
    """Check the claims of section 5."""
    both, x_only, y_only = (outcomes[TASK, name] for name in (BOTH, X_ONLY, Y_ONLY))
    log, power = (outcomes[TASK, name] for name in (LOG, POWER))
    return [
        *built_in(
            'linen 1 alone differs between x and y',
            better_on('linen 1, which differs between x and y, is distinguished best (100 %)', both, 'linen_1'),
        ),
        higher('x and y joined are better than x alone', both, x_only),
        higher('x and y joined are better than y alone', both, y_only),
        higher('not of the paper: magnitudes distinguish better than powers', both, power),
        higher('not of the paper: magnitudes distinguish better than their logarithm', both, log),
    ]


PROTOCOL = PaperProtocol(
    name='hu',
    scene='hu',
    paper='Hu et al. 2014, "A finger-shaped tactile sensor for fabric surfaces evaluation", section 5',
    tasks=(
        RecognitionTask(
            TASK,
            (Visits('25.5 mm/s, 1.5 N', 60, SimulatedSlide(0.0255, 1.5, SLIDE_S), ALONG_X_AND_Y),),
            (
                Method(BOTH, Figures(test=0.92)),
                Method(ONE, label=X_ONLY, views=(0,)),
                Method(ONE, label=Y_ONLY, views=(1,)),
                Method(BOTH, features={'texture_papers.hu:Spectrum': {'scale': 'power'}}, label=POWER),
                Method(BOTH, features={'texture_papers.hu:Spectrum': {'scale': 'log'}}, label=LOG),
                Method(BOTH, learner={'components': PAPER}, label=OF_PAPER),
            ),
        ),
    ),
    divide=drawn(2 / 3, 1),
    split='1 random draw of 200 of the 300 places for training',
    anchor=Anchor(
        TASK,
        BOTH,
        0.92,
        'table 1',
        setting='how near linen 4 is to linen 3, so that these are confused is built in',
    ),
    findings=findings,
    quick_count=10,
)


NAME = 'hu-components'
COMPONENT_METHODS = {'magnitude': BOTH, 'power': POWER, 'logarithm': LOG}
DIRECTIONS = ('x', 'y')
QUICK = ('linen_2', 'linen_3')  # fewer slides could not have 39 components
Counts = Mapping[str, Mapping[str, Mapping[str, int]]]  # by scale, direction and linen


def run_components(experiment: Experiment) -> ExperimentResult:
    """Count the components of each linen in each direction, of magnitudes, powers and their logarithms."""
    [task] = PROTOCOL.tasks
    task = replace(task, surfaces=QUICK) if experiment.quick else task
    slides = gather(load_scene(PROTOCOL.scene), task.surfaces, task.visits, experiment.seed, slow=False)
    counts = {scale: components(slides, method) for scale, method in COMPONENT_METHODS.items()}
    return ExperimentResult(
        name=NAME,
        measured='principal components that hold 99 % of the variance of the slides over one linen in one direction',
        data=f"simulated: scene '{PROTOCOL.scene}', {task.visits[0].count} slides of each linen along x and along y",
        split='none: components are sought on all slides over one linen',
        numbers={
            'seed': experiment.seed,
            'digests': component_digests(),
            'paper': PAPER,
            'components': counts,
            'findings': [finding_as_json(finding) for finding in component_findings(counts)],
        },
    )


def components(slides: Slides, method: str) -> Mapping[str, Mapping[str, int]]:
    """Return by direction and linen how many components the recipe of a method of the experiment keeps of one linen."""
    recipe = recipe_of(next(one for one in PROTOCOL.tasks[0].methods if one.name == method))
    values, owner = slides.extract(recipe.feature_set)
    ratio = recipe.learner.variance  # type: ignore[attr-defined]  # of SvmMaxWins
    return {
        direction: {linen: kept(part[slides.codes[owner] == code], ratio) for code, linen in enumerate(slides.surfaces)}
        for direction, part in zip(DIRECTIONS, np.split(values, len(DIRECTIONS), axis=1), strict=True)
    }


def kept(values: Array, ratio: float) -> int:
    """Return how many components explain a fraction of the variance, the mean of each example subtracted (eq. 7)."""
    return principal_components(values - values.mean(axis=1, keepdims=True), ratio).shape[1]


def component_digests() -> dict[str, str]:
    """Return the digests of the experiment as they are now."""
    return digests(PROTOCOL)


def component_findings(counts: Counts) -> list[Finding]:
    """Check the 39 components of the paper with each reading of its spectrum, over linens and directions."""
    found = {scale: np.array([[*of.values()] for of in parts.values()]).ravel() for scale, parts in counts.items()}
    distances = {scale: np.abs(values - PAPER) for scale, values in found.items()}
    return [
        *(_component_finding(f'one linen takes {PAPER} components or more: {scale}', values - PAPER, values)
          for scale, values in found.items()),
        *(_component_finding(f'not of the paper: magnitudes are nearer to its {PAPER} components than the {other}',
                             distances[other] - distances['magnitude'], found[other])
          for other in ('power', 'logarithm')),
    ]  # fmt: skip


def _component_finding(claim: str, difference: Array, values: Array) -> Finding:
    return Finding(claim, f'{values.mean():.1f} components, {values.min()} to {values.max()}', mean(difference))
