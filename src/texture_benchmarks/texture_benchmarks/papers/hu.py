"""Five linens measured along x and along y (Hu et al. 2014)."""

from __future__ import annotations

import math
from dataclasses import replace

from texture_benchmarks.papers.claim_checks import better_on, higher
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
    View,
    Visits,
    drawn,
)
from texture_features.windowing.windows import WindowParams
from texture_simulation.simulated_slide import SimulatedSlide

TASK = 'five linens'
SLIDE_S = 3.0
WHOLE = WindowParams(length_s=SLIDE_S, hop_s=SLIDE_S)
BOTH, ONE = 'hu-pca-svm-xy', 'hu-pca-svm'
X_ONLY, Y_ONLY = f'{ONE}, x alone', f'{ONE}, y alone'
LOG, POWER, CENTRED = f'{BOTH}, logarithm', f'{BOTH}, power', f'{BOTH}, mean of the features subtracted'
ALONG_X_AND_Y = (View(), View(turned_rad=math.pi / 2))


def findings(outcomes: MethodResults) -> list[Finding]:
    """Check what section 5 tells."""
    both, x_only, y_only = (outcomes[TASK, name] for name in (BOTH, X_ONLY, Y_ONLY))
    log, power = (outcomes[TASK, name] for name in (LOG, POWER))
    return [
        better_on('linen 1, which differs between x and y, is distinguished best (100 %)', both, 'linen_1'),
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
                Method(BOTH, Figures(test=0.92), WHOLE),
                Method(ONE, windows=WHOLE, label=X_ONLY, views=(0,), splits=FEW),
                Method(ONE, windows=WHOLE, label=Y_ONLY, views=(1,), splits=FEW),
                Method(BOTH, windows=WHOLE, features={'spectrum': {'scale': 'power'}}, label=POWER, splits=FEW),
                Method(BOTH, windows=WHOLE, features={'spectrum': {'scale': 'log'}}, label=LOG, splits=FEW),
                Method(BOTH, windows=WHOLE, learner={'centre': 'features'}, label=CENTRED, splits=FEW),
                replace(OURS, splits=2),
            ),
        ),
    ),
    divide=drawn(2 / 3, 10),
    split='10 random draws of 200 of the 300 places for training',
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
