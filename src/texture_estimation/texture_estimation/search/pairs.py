"""A recipe for each pair of surfaces, found by a search of its own; the surface that wins most pairs is the answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from texture_core.arrays import Array
from texture_estimation.classification.evidence_rules import EvidenceRule
from texture_estimation.learners.learner import Codes, Learner
from texture_estimation.recipe import Recipe
from texture_estimation.search.classification_task import ClassificationTask
from texture_estimation.search.feature_cache import FeatureCache
from texture_estimation.search.fitness import UNDECIDED, decided_by_slide, decisions, fitness, shares_right
from texture_estimation.search.generation import Generation, SearchParams
from texture_estimation.search.halves import Mask
from texture_estimation.search.optimise import SearchResult, optimise
from texture_estimation.search.parallel import ParallelMap, serial_map
from texture_estimation.search.racing import HalfScores
from texture_estimation.search.recipe_space import RecipeSpace
from texture_estimation.search.search_slides import SearchSlides

Pair = tuple[str, str]


@dataclass(frozen=True, eq=False)
class PairSearchResult:
    """What was found for each pair, and how all pairs do together.

    Parameters
    ----------
    by_pair
        The search of each pair.
    record
        Learning and test accuracy of the most pairs won, over all surfaces, on each half.

    Examples
    --------
    >>> from texture_estimation.search.racing import HalfScores
    >>> round(PairSearchResult({}, HalfScores.of([(1.0, 0.8), (1.0, 0.6)])).fitness, 3)
    0.85
    """

    by_pair: Mapping[Pair, SearchResult[Recipe]]
    record: HalfScores

    @property
    def fitness(self) -> float:
        """Mean of learning and test accuracy of all pairs together."""
        return fitness(self.record.learning, self.record.test)


def optimise_pairs(
    space: RecipeSpace[Recipe],
    search_slides: SearchSlides,
    params: SearchParams,
    *,
    parallel_map: ParallelMap = serial_map,
    checkpoint: str | Path | None = None,
    resume: str | Path | None = None,
    tell: Callable[[Pair, Generation], None] = lambda *_: None,
) -> PairSearchResult:
    """Search for each pair of surfaces by itself, then evaluate all pairs together.

    Arguments are those of `optimise`; each pair has its own checkpoint, named after it.

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.C: the learning is adapted
    to each pair of textures.

    Parameters
    ----------
    space
        The recipe, and what of it is varied.
    search_slides
        Slides and their halves.
    params
        Population, generations and so on.
    parallel_map
        Over cores or a cluster.
    checkpoint, resume
        Files that are written after each generation, and read first.
    tell
        Called after each generation of a pair.

    Returns
    -------
    PairSearchResult
        The recipe of each pair, and what all decide together.
    """
    features = FeatureCache(search_slides.cut)
    names = search_slides.examples(space.base.training_windows).names
    found = {
        pair: optimise(
            space,
            search_slides.only(pair),
            params,
            ClassificationTask(),
            features=features,
            parallel_map=parallel_map,
            checkpoint=checkpoint and beside(checkpoint, pair),
            resume=_reached(resume, pair),
            tell=lambda generation, pair=pair: tell(pair, generation),  # type: ignore[misc]
        )
        for pair in combinations(names, 2)
    }
    votes = [_votes_of(pair, result, search_slides, features) for pair, result in found.items()]
    scores = parallel_map(_evaluated_together, [(votes, number) for number in range(search_slides.n_halves)])
    return PairSearchResult(found, HalfScores.of(scores))


def beside(path: str | Path, pair: Pair) -> Path:
    """Return the path with the pair's name in it: 'best.yaml' → 'best-cork-vs-measured.yaml'."""
    path = Path(path)
    return path.with_name(f'{path.stem}-{pair[0]}-vs-{pair[1]}{path.suffix}')


def _reached(resume: str | Path | None, pair: Pair) -> Path | None:
    """Return the checkpoint of a pair; None if the search that is gone on with had not come to it."""
    path = resume and beside(resume, pair)
    return path if path and path.is_file() else None


@dataclass(frozen=True, eq=False)
class _PairVotes:
    """What the recipe of one pair says of the slides of all surfaces."""

    pair: tuple[int, int]
    learner: Learner
    rule: EvidenceRule
    values: Array
    codes: Codes
    slides: Codes
    halves: Mask
    hop_share: float

    def winners(self, number: int) -> tuple[Codes, Codes]:
        """Return the label that each slide is taken for, by number, or UNDECIDED, and the row of its first window."""
        training = self.halves[number] & np.isin(self.codes, self.pair)
        of_pair = (self.codes[training] == self.pair[1]).astype(np.intp)
        fitted = self.learner.fit(self.values[training], of_pair, self.slides[training])
        scores = self.learner.predictor(fitted.parameters)(self.values)
        decided, first = decided_by_slide(scores, self.slides, self.rule, self.hop_share)
        return np.where(decided == UNDECIDED, UNDECIDED, np.array(self.pair)[decided]), first


def _votes_of(
    pair: Pair, result: SearchResult[Recipe], search_slides: SearchSlides, features: FeatureCache
) -> _PairVotes:
    recipe = result.best.recipe
    windows = recipe.training_windows
    examples = search_slides.examples(windows)
    return _PairVotes(
        pair=(examples.names.index(pair[0]), examples.names.index(pair[1])),
        learner=recipe.learner,
        rule=recipe.evidence,
        values=features.values(ClassificationTask().feature_set_of(recipe)),
        codes=examples.codes,
        slides=examples.slides,
        halves=search_slides.halves(windows),
        hop_share=windows.hop_s / windows.length_s,
    )


def _evaluated_together(case: tuple[list[_PairVotes], int]) -> tuple[float, float]:
    votes, number = case
    wins: Array | None = None
    for of_pair in votes:
        winners, first = of_pair.winners(number)
        codes, training = of_pair.codes[first], of_pair.halves[number][first]
        wins = np.zeros((len(codes), int(codes.max()) + 1)) if wins is None else wins
        rows = np.flatnonzero(winners != UNDECIDED)
        wins[rows, winners[rows]] += 1.0
    assert wins is not None
    return shares_right(decisions(wins), codes, training)
