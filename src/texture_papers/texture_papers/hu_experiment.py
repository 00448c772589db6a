# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Five linens measured along x and along y (Hu et al. 2014)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

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
from texture_papers.slides import View, Visits, gather
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import load_scene

TASK = 'five linens'
PAPER = 39  # components of one linen in one direction
SLIDE_S = 3.0
BOTH, ONE = 'hu-pca-svm-xy', 'hu-pca-svm'
X_ONLY, Y_ONLY = f'{ONE}, x alone', f'{ONE}, y alone'
OF_PAPER = f'{BOTH}, 39 + 39 components'
ALONG_X_AND_Y = (View(), View(turned_rad=math.pi / 2))


def findings(outcomes: MethodResults) -> list[Finding]:
    """Check the claims of section 5."""
    both, x_only, y_only = (outcomes[TASK, name] for name in (BOTH, X_ONLY, Y_ONLY))
    return [
        *built_in(
            'linen 1 alone differs between x and y',
            better_on('linen 1, which differs between x and y, is distinguished best (100 %)', both, 'linen_1'),
        ),
        higher('x and y joined are better than x alone', both, x_only),
        higher('x and y joined are better than y alone', both, y_only),
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


QUICK = ('linen_2', 'linen_3')  # fewer slides could not have 39 components


def run_components(experiment: Experiment) -> ExperimentResult:
    """Count the components that explain 99 % of the variance of the slides over each linen in each direction."""
    [task] = PROTOCOL.tasks
    task = replace(task, surfaces=QUICK) if experiment.quick else task
    slides = gather(load_scene(PROTOCOL.scene), task.surfaces, task.visits, experiment.seed, slow=False)
    recipe = recipe_of(task.methods[0])
    values, owner = slides.extract(recipe.feature_set)
    counts: dict[str, dict[str, int]] = {}
    for direction, part in zip(('x', 'y'), np.split(values, 2, axis=1), strict=True):
        centred = part - part.mean(axis=1, keepdims=True)  # the mean of each example, eq. 7
        counts[direction] = {
            linen: principal_components(centred[slides.codes[owner] == code], recipe.learner.variance).shape[1]  # type: ignore[attr-defined]  # of SvmMaxWins
            for code, linen in enumerate(slides.surfaces)
        }
    found = np.array([count for of_linen in counts.values() for count in of_linen.values()])
    here = f'{found.mean():.1f} components, {found.min()} to {found.max()}'
    return ExperimentResult(
        name='hu-components',
        measured='principal components that hold 99 % of the variance of the slides over one linen in one direction',
        data=f"simulated: scene '{PROTOCOL.scene}', {task.visits[0].count} slides of each linen along x and along y",
        split='none: components are sought on all slides over one linen',
        numbers={
            'seed': experiment.seed,
            'digests': digests(PROTOCOL),
            'paper': PAPER,
            'components': counts,
            'findings': [
                finding_as_json(Finding(f'one linen takes {PAPER} components or more', here, mean(found - PAPER)))
            ],
        },
    )
