# SPDX-License-Identifier: Apache-2.0
"""Twenty objects in a hand, trained with two fingers and recognised with two others (Kaboli et al. 2015)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from texture_papers.protocol import (
    OURS,
    Anchor,
    Figures,
    Finding,
    Method,
    MethodResults,
    PaperProtocol,
    RecognitionTask,
    Table,
    View,
    Visits,
    training_in,
)
from texture_papers.report import at_least, higher, kept_in, most_errors
from texture_simulation.path import SimulatedSlide

SLIDE_S = 2.0
SLIDING = SimulatedSlide(0.05, 1.0, SLIDE_S)
THUMB, INDEX, MIDDLE = View(finger=0), View(finger=1), View(finger=2)
TRAINED = 'index and middle finger'
VISITS = (Visits(TRAINED, 10, SLIDING, (INDEX, MIDDLE)), Visits('thumb and index finger', 20, SLIDING, (THUMB, INDEX)))
ROUND = (
    'red_ball', 'yellow_ball', 'rough_ball', 'orange', 'apple',
    'colorful_ball', 'sponge_ball', 'pine_ball', 'string_ball', 'mirror_ball',
)  # fmt: skip
VARIOUS = (
    'soft_sponge', 'memory_sponge', 'toothbrush', 'floor_brush', 'rough_star',
    'coffee_capsule', 'spray', 'paper_box', 'cream_tube', 'baby_feeder',
)  # fmt: skip
# Pairs that the paper names: smooth balls, rough ball and sponge ball, spray and capsule, star and toothbrush.
ALIKE = (
    ('red_ball', 'yellow_ball'),
    ('yellow_ball', 'colorful_ball'),
    ('rough_ball', 'sponge_ball'),
    ('coffee_capsule', 'spray'),
    ('rough_star', 'toothbrush'),
)
SAME, DIFFERENT, ALL = TASKS = ('same shape', 'various shapes', 'all 20 objects')
SURFACES = (ROUND, VARIOUS, ROUND + VARIOUS)
PAPER_SVM, PAPER_EM = (0.97, 0.975, 0.96), (0.8223, 0.835, 0.8058)
PAPER_PA = 0.87  # t = 10, on average
SVM, PA, OVR, EM = 'kaboli-svm', 'kaboli-pa', 'kaboli-pa-ovr', 'kaboli-em'
# Not of the paper, whose means are those of the electrodes: temperatures and pressure of the BioTac, too.
ALL_SLOW = {'texture_papers.kaboli:MeanHjorth': {'omit': ''}, 'texture_papers.kaboli:Correlation': {'omit': ''}}
ROUNDS = (1, 2, 5, 10)


def findings(outcomes: MethodResults) -> list[Finding]:
    """Check what section V tells."""
    svm = outcomes[ALL, SVM]
    em = {task: outcomes[task, EM] for task in TASKS}
    first, last = (outcomes[ALL, pa(t)] for t in (ROUNDS[0], ROUNDS[-1]))
    return [
        higher('online learning goes on: after ten slides of each object PA knows more than after one', last, first),
        at_least('PA recognises 87 % after ten slides of each object', last, 0.87),
        higher('the SVM is better than PA', svm, last),
        higher('not of the paper: planes that learn together know more than each by itself', last, outcomes[ALL, OVR]),
        *(at_least(f'clusters named by majority recognise {task}, EM ({100 * value:g} %)', em[task], value)
          for task, value in zip(TASKS, PAPER_EM, strict=True)),
        most_errors(
            'most errors of the SVM are between objects that the paper calls alike',
            svm,
            ALIKE,
        ),
    ]  # fmt: skip


def _table(surfaces: tuple[str, ...], errors: Mapping[tuple[str, str], int]) -> Table:
    """Return a table of 20 test slides an object, given how many of an object were taken for another."""
    counts = 20 * np.eye(len(surfaces))
    for (true, said), count in errors.items():
        row = surfaces.index(true)
        counts[row, row] -= count
        counts[row, surfaces.index(said)] += count
    return [tuple(row) for row in counts.tolist()]


FIGURE_4 = _table(
    ROUND,
    {
        ('yellow_ball', 'red_ball'): 1,
        ('yellow_ball', 'colorful_ball'): 1,
        ('rough_ball', 'sponge_ball'): 2,
        ('sponge_ball', 'rough_ball'): 1,
        ('mirror_ball', 'red_ball'): 1,
    },
)
FIGURE_5 = _table(
    VARIOUS,
    {
        ('toothbrush', 'rough_star'): 1,
        ('rough_star', 'toothbrush'): 1,
        ('coffee_capsule', 'spray'): 1,
        ('spray', 'coffee_capsule'): 1,
        ('baby_feeder', 'cream_tube'): 1,
    },
)
TABLES = (FIGURE_4, FIGURE_5, None)  # that of all 20 is a picture without numbers


def pa(rounds: int) -> str:
    """Return the name of online learning after so many slides of each object."""
    return f'{PA}, t = {rounds}'


def _methods(svm: float, em: float, table: Table | None) -> tuple[Method, ...]:
    online = [
        Method(PA, Figures(test=PAPER_PA if n == ROUNDS[-1] else None), learner={'rounds': n}, label=pa(n))
        for n in ROUNDS
    ]
    return (
        Method(SVM, Figures(test=svm), confusion=table),
        *online,
        Method(OVR),
        Method(EM, Figures(test=em)),
        Method(EM, features=ALL_SLOW, label=f'{EM}, all slow channels'),
        OURS,
        Method('vibration-and-taxels'),
    )


PROTOCOL = PaperProtocol(
    name='kaboli',
    scene='kaboli',
    paper='Kaboli et al. 2015, "In-hand object recognition via texture properties", section V',
    tasks=tuple(
        RecognitionTask(name, VISITS, _methods(svm, em, table), surfaces)
        for name, svm, em, table, surfaces in zip(TASKS, PAPER_SVM, PAPER_EM, TABLES, SURFACES, strict=True)
    ),
    divide=training_in(TRAINED),
    split='training: 10 slides with index and middle finger; test: 20 with thumb and index finger',
    anchor=Anchor(
        ALL,
        SVM,
        0.96,
        'section V.A',
        shortfall='reached within the interval: this is the noise of a resting BioTac, and less does not help',
        parts={SAME: PAPER_SVM[0], DIFFERENT: PAPER_SVM[1]},
    ),
    findings=findings,
    quick_count=4,
)


SHAPE_SLIDING = SimulatedSlide(0.02, 1.0, SLIDE_S)  # as `in_hand_sliding` goes without a request: no paper tells it
TRAINING, TEST = 10, 5  # trials of each object, for training and under each condition of the test
OTHER_RADIUS_M = 0.015  # of all objects where their shape is another than in training
SPREAD = 0.4  # of speed and force, of random movements
SHAPE_TRAINED, SAME_FINGERS = 'training', 'as in training'
FINGERS, SHAPE, RANDOM, AT_ONCE = 'other finger', 'other shape', 'random movements', 'all three'
OF_TRAINING, OF_TEST = (INDEX, MIDDLE), (THUMB, INDEX)
SHAPE_VISITS = (
    Visits(SHAPE_TRAINED, TRAINING, SHAPE_SLIDING, OF_TRAINING),
    Visits(SAME_FINGERS, TEST, SHAPE_SLIDING, OF_TRAINING),
    Visits(FINGERS, TEST, SHAPE_SLIDING, OF_TEST),
    Visits(SHAPE, TEST, SHAPE_SLIDING, OF_TRAINING, radius_m=OTHER_RADIUS_M),
    Visits(RANDOM, TEST, SHAPE_SLIDING, OF_TRAINING, random=SPREAD),
    Visits(AT_ONCE, TEST, SHAPE_SLIDING, OF_TEST, radius_m=OTHER_RADIUS_M, random=SPREAD),
)
CLAIMS = {
    FINGERS: 'another finger than in training costs at most five points',
    SHAPE: 'another shape than in training costs at most five points',
    RANDOM: 'future work: random movements cost at most five points',
    AT_ONCE: 'all three at once cost at most five points',
}
SHORT = {SVM: 'SVM', PA: 'PA', EM: 'EM'}


def shape_findings(outcomes: MethodResults) -> list[Finding]:
    """Check the claim of section VI, for each learner of the paper."""
    return [
        kept_in(f'{claim}, {short}', outcomes[ALL, method], condition, SAME_FINGERS)
        for condition, claim in CLAIMS.items()
        for method, short in SHORT.items()
    ]


SHAPES = PaperProtocol(
    name='kaboli-shapes',
    scene='kaboli_shapes',
    paper='Kaboli et al. 2015, "In-hand object recognition via texture properties", section VI',
    tasks=(
        RecognitionTask(
            ALL,
            SHAPE_VISITS,
            (
                Method(SVM),
                Method(PA),
                Method(EM),
            ),
        ),
    ),
    divide=training_in(SHAPE_TRAINED),
    split='training: 10 slides with index and middle finger; test: 5 under each condition',
    anchor=Anchor(
        ALL,
        SVM,
        PAPER_SVM[-1],
        'section V.A',
        setting='noise of the fast channels, not set again',
        experiment='kaboli',
    ),
    findings=shape_findings,
    quick_count=12,
    by_condition=True,
)
