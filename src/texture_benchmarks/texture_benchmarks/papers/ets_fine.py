"""Ten textures of everyday life, four of them very fine (Roberge et al., third experiment)."""

from __future__ import annotations

from dataclasses import replace

from texture_benchmarks.papers.claim_checks import at_least, most_errors
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

TASK = 'ten textures'
ANN, SVM = 'ets-fine-ann', 'ets-fine-svm'
TABLE_3 = (
    (200, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
    (0, 183, 10, 0, 3, 0, 0, 0, 0, 0, 4),
    (0, 20, 171, 3, 0, 0, 0, 1, 0, 0, 5),
    (0, 0, 4, 190, 0, 0, 0, 2, 0, 0, 4),
    (0, 0, 0, 0, 195, 0, 0, 0, 3, 0, 2),
    (0, 2, 0, 0, 0, 180, 15, 0, 0, 0, 3),
    (0, 2, 0, 0, 0, 7, 191, 0, 0, 0, 2),
    (0, 0, 0, 2, 0, 0, 0, 193, 0, 0, 5),
    (0, 0, 0, 0, 4, 0, 0, 1, 193, 0, 2),
    (0, 0, 0, 0, 0, 0, 0, 0, 0, 200, 0),
)


def findings(outcomes: MethodResults) -> list[Finding]:
    """Check what section V tells."""
    ann, svm = outcomes[TASK, ANN], outcomes[TASK, SVM]
    return [
        at_least('fine textures are recognised, ANN (94.9 %)', ann, 0.949),
        most_errors('most errors: protruding with sunken motifs (22 of 84)', svm, [('pm_plastic', 'sm_plastic')]),
        most_errors('as many: smooth plastic with paper (30 of 84)', svm, [('smooth_plastic', 'sheet_of_paper')]),
    ]


PROTOCOL = PaperProtocol(
    name='ets-fine',
    scene='ets_fine',
    paper='Roberge et al., "Textures recognition through tactile exploration", section V',
    tasks=(
        RecognitionTask(
            TASK,
            (Visits('0.125 m/s, 2 N', 200, SimulatedSlide(0.125, 2.0, 0.8)),),
            (
                Method(ANN, Figures(0.963, 0.949, 0.007)),
                Method(SVM, Figures(0.960, 0.958, 0.014), confusion=TABLE_3),
                replace(OURS, splits=FEW),
                Method('vibration-and-taxels', splits=FEW),
            ),
        ),
    ),
    divide=halves(20),
    split='20 random halves of each texture',
    anchor=Anchor(TASK, SVM, 0.958, 'table IV'),
    findings=findings,
    quick_count=16,
)
