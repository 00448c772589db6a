"""Fitness of a classification recipe on half splits of extracted windows."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.arrays import Array
from texture_estimation.classification.evidence_rules import EvidenceRule, MajorityVote
from texture_estimation.learners.learner import Codes, Learner
from texture_estimation.search.fitness import decided_by_slide, decisions, shares_right
from texture_estimation.search.halves import Mask
from texture_estimation.search.racing import HalfScorer
from texture_estimation.search.surrogates.surrogate import ScoresOfHalf, Surrogate


@dataclass(frozen=True, eq=False)
class ClassificationFitness:
    """Evaluation of one recipe; see `texture_estimation.search.racing.FitnessFunction`.

    What is counted is right windows; with a majority vote, whose windows are parts of a slide, right slides.

    Parameters
    ----------
    surrogate
        The learner, or what stands for it.
    learner, rule
        As the recipe has them.
    values : (n, n_features)
    codes, slides : (n,)
    halves : (n_halves, n)
    hop_share
        Distance of the windows over their length.

    Examples
    --------
    >>> import numpy as np
    >>> from texture_estimation.classification.evidence_rules import SoftVote
    >>> from texture_estimation.learners.svm_rbf import SvmRbf
    >>> from texture_estimation.search.surrogates.exact import exact
    >>> codes, slides = np.repeat([0, 1], 4), np.arange(8)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((8, 1))
    >>> halves = (slides % 2 == 0)[None]
    >>> fitness = ClassificationFitness(exact, SvmRbf(), SoftVote(), values, codes, slides, halves)
    >>> fitness.start()(0)  # accuracy on the slides that were trained on, and on the others
    (1.0, 1.0)
    """

    surrogate: Surrogate
    learner: Learner
    rule: EvidenceRule
    values: Array
    codes: Codes
    slides: Codes
    halves: Mask
    hop_share: float = 1.0

    def start(self) -> HalfScorer:
        """Return what gives learning and test accuracy on a half."""
        scores_of = self.surrogate(self.learner, self.values, self.codes, self.slides)

        def half(number: int) -> tuple[float, float]:
            decided, first = self.decided(scores_of, number)
            return shares_right(decided, self.codes[first], self.halves[number][first])

        return half

    def decided(self, scores_of: ScoresOfHalf, number: int) -> tuple[Codes, Codes | slice]:
        """Return the decisions on a half, and the rows of the windows, or of the slides' first ones."""
        scores = scores_of(self.halves[number])
        if isinstance(self.rule, MajorityVote):
            return decided_by_slide(scores, self.slides, self.rule, self.hop_share)
        return decisions(scores), slice(None)
