# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Textures by linear and circular motion (Roberge et al.): four, five and ten textures."""

from __future__ import annotations

import math

from texture_papers.protocol import (
    Anchor,
    Figures,
    Finding,
    Method,
    MethodResults,
    PaperProtocol,
    RecognitionTask,
    difference,
    halves,
    mean,
)
from texture_papers.report import at_least, built_in, higher, higher_elsewhere, lower_in, most_errors
from texture_papers.search import SearchParams
from texture_papers.slides import Visits
from texture_simulation.path import SimulatedSlide

# The paper's sizes; the search for parts continues from that for whole scans, and has half of the paper's halves.
FULL, OF_PARTS, OF_TEN = SearchParams(20, 30, 20), SearchParams(10, 10, 10), SearchParams(13, 10, 20)
# Smaller than the paper's: networks take ten times as long as machines, and those of parts hours.
OF_NETWORKS, OF_THEIR_PARTS = SearchParams(10, 5, 4), SearchParams(10, 1, 2)
LINEAR_S = 0.5
LINEAR_SLIDES = 'linear slides'
LINEAR_VISITS = tuple(
    Visits(f'{speed:.2f} m/s, {force:g} N', 50, SimulatedSlide(speed, force, LINEAR_S))
    for speed in (0.10, 0.15, 0.20)
    for force in (1.0, 2.5, 5.0)
)
ANN, SVM, ANN_VOTE, SVM_VOTE = 'ets-linear-ann', 'ets-linear-svm', 'ets-linear-ann-vote', 'ets-linear-svm-vote'
METHODS = (
    Method(ANN, Figures(0.851, 0.787, 0.088), search=OF_NETWORKS),
    Method(SVM, Figures(0.948, 0.750, 0.110), search=FULL),
    Method(ANN_VOTE, Figures(0.849, 0.840, 0.054), search=OF_THEIR_PARTS, of_whole=ANN),
    Method(SVM_VOTE, Figures(0.991, 0.973, 0.016), search=OF_PARTS, of_whole=SVM),
)


def linear_findings(outcomes: MethodResults) -> list[Finding]:
    """Check the claims of section IV.B.1."""
    ann, svm, ann_vote, svm_vote = (outcomes[LINEAR_SLIDES, name] for name in (ANN, SVM, ANN_VOTE, SVM_VOTE))
    lift_ann, lift_svm = ann_vote.right() - ann.right(), svm_vote.right() - svm.right()
    more = mean(lift_svm - lift_ann)
    return [
        at_least('with a vote over five parts the SVM recognises 97.3 %', svm_vote, 0.973),
        higher('the vote lifts the SVM (75.0 to 97.3 %)', svm_vote, svm),
        higher('the vote lifts the ANN (78.7 to 84.0 %)', ann_vote, ann),
        Finding(
            'the vote contributes more to the SVM than to the ANN (22.3 against 5.3 points)',
            f'{100 * lift_svm.mean():+.1f} against {100 * lift_ann.mean():+.1f} points',
            more,
        ),
        higher('without a vote the ANN is ahead of the SVM (78.7 against 75.0 %)', ann, svm),
        *built_in(
            'their depths differ by an eighth',
            most_errors(
                'most errors are between the ridges that differ in depth alone (19 of 32 with a vote)',
                svm_vote,
                [('ridge_2a', 'ridge_2b')],
            ),
        ),
    ]


LINEAR = PaperProtocol(
    name='ets-linear',
    scene='ets_linear',
    paper='Roberge et al., "Textures recognition through tactile exploration", sections IV.A and IV.B.1',
    tasks=(RecognitionTask(LINEAR_SLIDES, LINEAR_VISITS, METHODS),),
    divide=halves(1),
    split='1 random half of each texture',
    anchor=Anchor(
        LINEAR_SLIDES,
        SVM,
        0.750,
        'section IV.B.1: test, SVM without a vote, with variables for each pair',
        setting='uneven motion and frozen moments',
        experiment='ets-linear-tuned',
    ),
    findings=linear_findings,
    quick_count=18,
)


CIRCULAR_M_S, CIRCULAR_N, CIRCULAR_S, RADIUS_M = 0.10, 2.5, 0.5, 0.02
ANGLES_DEG = (0, 30, 45, 90)
CIRCLES, LINES = 'circles', 'lines'
# x is across the grooves; the paper counts angles from along them.
ACROSS_DEG = 90
ALONG = '0 degrees'


def circular_findings(outcomes: MethodResults) -> list[Finding]:
    """Check the claims of section IV.B.2."""
    circle_ann, circle_svm = outcomes[CIRCLES, 'ets-circular-ann'], outcomes[CIRCLES, 'ets-circular-svm']
    line_ann, line_svm = outcomes[LINES, 'ets-linear-ann'], outcomes[LINES, 'ets-linear-svm']
    return [
        higher_elsewhere(
            'a circle beats a line when the orientation varies, SVM (86.7 to 76.4 %)', circle_svm, line_svm
        ),
        higher_elsewhere(
            'a circle beats a line when the orientation varies, ANN (81.1 to 71.5 %)', circle_ann, line_ann
        ),
        *built_in(
            'grooves are straight',
            lower_in('a line along the grooves carries the least, SVM', line_svm, ALONG),
            lower_in('a line along the grooves carries the least, ANN', line_ann, ALONG),
        ),
        Finding(
            'fewer slides of a circle are unclassified, SVM (5.2 to 13.4 %)',
            f'{100 * circle_svm.unclassified:.1f} against {100 * line_svm.unclassified:.1f} %',
            difference(line_svm.nothing(), circle_svm.nothing()),
        ),
        *built_in(
            'which textures are alike was chosen',
            most_errors('most errors of the circle are between the two ridges', circle_svm, [('ridge_1', 'ridge_2')]),
            most_errors(
                'most errors of the line are between the ridges, and between ridge 2 and the grid of its frequencies',
                line_svm,
                [('ridge_1', 'ridge_2'), ('ridge_2', 'grid_3')],
            ),
        ),
    ]


def _circular_visits(radius_m: float) -> tuple[Visits, ...]:
    return tuple(
        Visits(
            f'{angle} degrees{" at the start" if radius_m else ""}',
            50,
            SimulatedSlide(CIRCULAR_M_S, CIRCULAR_N, CIRCULAR_S, math.radians(ACROSS_DEG - angle), radius_m),
        )
        for angle in ANGLES_DEG
    )


CIRCULAR = PaperProtocol(
    name='ets-circular',
    scene='ets_circular',
    paper='Roberge et al., "Textures recognition through tactile exploration", sections IV.A and IV.B.2',
    tasks=(
        RecognitionTask(
            CIRCLES,
            _circular_visits(RADIUS_M),
            (
                Method('ets-circular-ann', Figures(0.846, 0.811, 0.028), search=OF_NETWORKS),
                Method('ets-circular-svm', Figures(0.990, 0.867, 0.052), search=FULL),
            ),
        ),
        RecognitionTask(
            LINES,
            _circular_visits(0.0),
            (
                Method('ets-linear-ann', Figures(0.809, 0.715, 0.142), search=OF_NETWORKS),
                Method('ets-linear-svm', Figures(0.963, 0.764, 0.134), search=FULL),
            ),
        ),
    ),
    divide=halves(5),
    split='5 random halves of each texture',
    anchor=Anchor(
        CIRCLES, 'ets-circular-svm', 0.867, 'section IV.B.2: test, SVM', shortfall='set with one set of variables'
    ),
    findings=circular_findings,
    quick_count=16,
)


TEN_TEXTURES = 'ten textures'
FINE_ANN, FINE_SVM = 'ets-fine-ann', 'ets-fine-svm'


def fine_findings(outcomes: MethodResults) -> list[Finding]:
    """Check the claims of section V."""
    ann, svm = outcomes[TEN_TEXTURES, FINE_ANN], outcomes[TEN_TEXTURES, FINE_SVM]
    return [
        at_least('fine textures are recognised, ANN (94.9 %)', ann, 0.949),
        *built_in(
            'both have motifs of about the same size',
            most_errors('most errors: protruding with sunken motifs (22 of 84)', svm, [('pm_plastic', 'sm_plastic')]),
        ),
        most_errors('as many: smooth plastic with paper (30 of 84)', svm, [('smooth_plastic', 'sheet_of_paper')]),
    ]


FINE = PaperProtocol(
    name='ets-fine',
    scene='ets_fine',
    paper='Roberge et al., "Textures recognition through tactile exploration", section V',
    tasks=(
        RecognitionTask(
            TEN_TEXTURES,
            (Visits('0.125 m/s, 2 N', 200, SimulatedSlide(0.125, 2.0, 0.8)),),
            (
                Method(FINE_ANN, Figures(0.963, 0.949, 0.007), search=OF_NETWORKS),
                Method(FINE_SVM, Figures(0.960, 0.958, 0.014), search=OF_TEN),
            ),
        ),
    ),
    divide=halves(5),
    split='5 random halves of each texture',
    anchor=Anchor(TEN_TEXTURES, FINE_SVM, 0.958, 'table IV'),
    findings=fine_findings,
    quick_count=16,
)
