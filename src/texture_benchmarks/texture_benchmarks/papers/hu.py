"""Five linens measured along x and along y (Hu et al. 2014)."""

from __future__ import annotations

import math
from dataclasses import replace

from texture_benchmarks.papers.claim_checks import better_on, higher, most_errors
from texture_benchmarks.papers.protocol import (
    FEW,
    OURS,
    Anchor,
    Figures,
    Finding,
    Method,
    MethodResults,
    Protocol,
    RecognitionTask,
    View,
    Visits,
    drawn,
)
from texture_features.windowing.windows import WindowParams
from texture_simulation.simulated_slide import SimulatedSlide

TASK = 'five linens'
SLIDE_S = 3.0
WHOLE = WindowParams(length_s=SLIDE_S, hop_s=SLIDE_S)
# Far above most of the density (pC²/Hz): the logarithm becomes the power itself, which is what the paper takes.
POWER = {'log_spectrum': {'floor': 1e-2}}
# All of the paper's own, and the usual width and penalty.
PLAIN = {'variance': 0.99, 'gamma': 1.0, 'c': 10.0}
BOTH, X_ONLY, Y_ONLY = 'hu-pca-svm', 'hu-pca-svm, x alone', 'hu-pca-svm, y alone'
ALONG_X_AND_Y = (View(), View(turned_rad=math.pi / 2))


def findings(outcomes: MethodResults) -> list[Finding]:
    """Check what section 5 tells."""
    both, x_only, y_only = (outcomes[TASK, name] for name in (BOTH, X_ONLY, Y_ONLY))
    return [
        better_on('linen 1, which differs between x and y, is told best (100 %)', both, 'linen_1'),
        most_errors('most errors are between linen 3 and 4', both, [('linen_3', 'linen_4')]),
        higher('x and y joined are better than x alone', both, x_only),
        higher('x and y joined are better than y alone', both, y_only),
    ]


PROTOCOL = Protocol(
    name='hu',
    scene='hu',
    paper='Hu et al. 2014, "A finger-shaped tactile sensor for fabric surfaces evaluation", section 5',
    tasks=(
        RecognitionTask(
            TASK,
            (Visits('25.5 mm/s, 1.5 N', 60, SimulatedSlide(0.0255, 1.5, SLIDE_S), ALONG_X_AND_Y),),
            (
                Method('hu-pca-svm', Figures(test=0.92), WHOLE, {**PLAIN, 'blocks': 2}, POWER),
                Method('hu-pca-svm', windows=WHOLE, learner=PLAIN, features=POWER, label=X_ONLY, views=(0,)),
                Method('hu-pca-svm', windows=WHOLE, learner=PLAIN, features=POWER, label=Y_ONLY, views=(1,)),
                replace(OURS, splits=FEW),
            ),
        ),
    ),
    divide=drawn(2 / 3, 20),
    split='20 random draws of 200 of the 300 places for training',
    anchor=Anchor(TASK, BOTH, 0.92, 'table 1', setting='how near linen 4 is to linen 3'),
    findings=findings,
    quick_count=10,
)
