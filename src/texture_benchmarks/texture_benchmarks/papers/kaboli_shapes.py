"""Whether other fingers, shapes and movements cost anything (Kaboli et al. 2015), where they can cost something."""

from __future__ import annotations

from texture_benchmarks.papers.claim_checks import kept_in
from texture_benchmarks.papers.kaboli import ALL, EM, INDEX, MIDDLE, PA, PAPER_SVM, ROUNDS, SLIDE_S, SVM, THUMB, WHOLE
from texture_benchmarks.papers.protocol import (
    Anchor,
    Finding,
    Method,
    MethodResults,
    PaperProtocol,
    RecognitionTask,
    Visits,
    training_in,
)
from texture_simulation.simulated_slide import SimulatedSlide

SLIDING = SimulatedSlide(0.02, 1.0, SLIDE_S)  # as `in_hand_sliding` goes without a request: no paper tells it
TRAINING, TEST = 10, 5  # trials of each object, for training and under each condition of the test
OTHER_RADIUS_M = 0.015  # of all objects where their shape is another than in training
SPREAD = 0.4  # of speed and force, of random movements
TRAINED, SAME = 'training', 'as in training'
FINGERS, SHAPE, RANDOM, AT_ONCE = 'other finger', 'other shape', 'random movements', 'all three'
OF_TRAINING, OF_TEST = (INDEX, MIDDLE), (THUMB, INDEX)
VISITS = (
    Visits(TRAINED, TRAINING, SLIDING, OF_TRAINING),
    Visits(SAME, TEST, SLIDING, OF_TRAINING),
    Visits(FINGERS, TEST, SLIDING, OF_TEST),
    Visits(SHAPE, TEST, SLIDING, OF_TRAINING, radius_m=OTHER_RADIUS_M),
    Visits(RANDOM, TEST, SLIDING, OF_TRAINING, random=SPREAD),
    Visits(AT_ONCE, TEST, SLIDING, OF_TEST, radius_m=OTHER_RADIUS_M, random=SPREAD),
)
CLAIMS = {
    FINGERS: 'another finger than in training costs at most five points',
    SHAPE: 'another shape than in training costs at most five points',
    RANDOM: 'future work: random movements cost at most five points',
    AT_ONCE: 'all three at once cost at most five points',
}
SHORT = {SVM: 'SVM', PA: 'PA', EM: 'EM'}


def findings(outcomes: MethodResults) -> list[Finding]:
    """Check the claim of section VI, for each learner of the paper."""
    return [
        kept_in(f'{claim}, {short}', outcomes[ALL, method], condition, SAME)
        for condition, claim in CLAIMS.items()
        for method, short in SHORT.items()
    ]


PROTOCOL = PaperProtocol(
    name='kaboli-shapes',
    scene='kaboli_shapes',
    paper='Kaboli et al. 2015, "In-hand object recognition via texture properties", section VI',
    tasks=(
        RecognitionTask(
            ALL,
            VISITS,
            (
                Method(SVM, windows=WHOLE),
                Method(PA, windows=WHOLE, learner={'rounds': ROUNDS[-1]}),
                Method(EM, windows=WHOLE),
            ),
        ),
    ),
    divide=training_in(TRAINED),
    split='training: 10 slides with index and middle finger; test: 5 under each condition',
    anchor=Anchor(
        ALL,
        SVM,
        PAPER_SVM[-1],
        'section V.A',
        setting='noise of the fast channels, not set again',
        experiment='kaboli',
    ),
    findings=findings,
    quick_count=12,
    by_condition=True,
)
