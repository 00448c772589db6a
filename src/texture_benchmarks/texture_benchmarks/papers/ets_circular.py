"""Five ridges, grids and circles at four angles, along a line and in a circle (Roberge et al., second experiment)."""

from __future__ import annotations

import math
from dataclasses import replace

from texture_benchmarks.papers.claim_checks import higher_elsewhere, lower_in, most_errors
from texture_benchmarks.papers.ets_linear import PEAKS
from texture_benchmarks.papers.interval import apart
from texture_benchmarks.papers.protocol import (
    FEW,
    OURS,
    Anchor,
    Figures,
    Finding,
    Method,
    MethodResults,
    PaperProtocol,
    RecognitionTask,
    Visits,
    halves,
)
from texture_simulation.simulated_slide import SimulatedSlide

SPEED_M_S, FORCE_N, SLIDE_S, RADIUS_M = 0.10, 2.5, 0.5, 0.02
ANGLES_DEG = (0, 30, 45, 90)
CIRCLES, LINES = 'circles', 'lines'
# x is across the grooves; the paper counts angles from along them.
ACROSS_DEG = 90
ALONG = '0 degrees'
TABLE_2 = (
    (157, 30, 0, 0, 2, 11),
    (28, 162, 0, 1, 6, 0),
    (2, 0, 192, 1, 0, 5),
    (1, 0, 0, 190, 1, 8),
    (1, 0, 0, 1, 197, 1),
)


def findings(outcomes: MethodResults) -> list[Finding]:
    """Check what section IV.B.2 tells."""
    circle_ann, circle_svm = outcomes[CIRCLES, 'ets-circular-ann'], outcomes[CIRCLES, 'ets-circular-svm']
    line_ann, line_svm = outcomes[LINES, 'ets-linear-ann'], outcomes[LINES, 'ets-linear-svm']
    return [
        higher_elsewhere(
            'a circle beats a line when the orientation varies, SVM (86.7 to 76.4 %)', circle_svm, line_svm
        ),
        higher_elsewhere(
            'a circle beats a line when the orientation varies, ANN (81.1 to 71.5 %)', circle_ann, line_ann
        ),
        lower_in('a line along the grooves carries the least, SVM', line_svm, ALONG),
        lower_in('a line along the grooves carries the least, ANN', line_ann, ALONG),
        Finding(
            'fewer slides of a circle are unclassified, SVM (5.2 to 13.4 %)',
            f'{100 * circle_svm.unclassified:.1f} against {100 * line_svm.unclassified:.1f} %',
            (fewer := apart(line_svm.nothing(), circle_svm.nothing())),
            fewer.above(),
        ),
        most_errors('most errors of the circle are between the two ridges', circle_svm, [('ridge_1', 'ridge_2')]),
        most_errors(
            'most errors of the line are between the ridges, and between ridge 2 and the grid of its frequencies',
            line_svm,
            [('ridge_1', 'ridge_2'), ('ridge_2', 'grid_3')],
        ),
    ]


def _visits(radius_m: float) -> tuple[Visits, ...]:
    return tuple(
        Visits(
            f'{angle} degrees{" at the start" if radius_m else ""}',
            50,
            SimulatedSlide(SPEED_M_S, FORCE_N, SLIDE_S, math.radians(ACROSS_DEG - angle), radius_m),
        )
        for angle in ANGLES_DEG
    )


PROTOCOL = PaperProtocol(
    name='ets-circular',
    scene='ets_circular',
    paper='Roberge et al., "Textures recognition through tactile exploration", sections IV.A and IV.B.2',
    tasks=(
        RecognitionTask(
            CIRCLES,
            _visits(RADIUS_M),
            (
                Method('ets-circular-ann', Figures(0.846, 0.811, 0.028)),
                Method('ets-circular-svm', Figures(0.990, 0.867, 0.052), confusion=TABLE_2),
                replace(OURS, splits=FEW),
                Method('vibration-and-taxels', splits=FEW),
            ),
        ),
        RecognitionTask(
            LINES,
            _visits(0.0),
            (
                Method('ets-linear-ann', Figures(0.809, 0.715, 0.142), features=PEAKS),
                Method('ets-linear-svm', Figures(0.963, 0.764, 0.134), features=PEAKS, learner={'kernel_scale': 4.0}),
                replace(OURS, splits=FEW),
                Method('vibration-and-taxels', splits=FEW),
            ),
        ),
    ),
    divide=halves(20),
    split='20 random halves of each texture',
    anchor=Anchor(
        'linear slides', 'ets-linear-svm', 0.750, 'the same finger on the same robot', experiment='ets-linear'
    ),
    findings=findings,
    quick_count=16,
)
