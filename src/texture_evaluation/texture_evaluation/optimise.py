# SPDX-License-Identifier: Apache-2.0
"""Tune a recipe on labelled bags by a genetic search, and write what was found as recipe files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations, cycle
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from joblib import Parallel, delayed

from texture_core.config import writing
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import Array
from texture_estimation import search
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.roughness import RoughnessRecipe, load_roughness_recipe, read_grades
from texture_evaluation.charts import chart, line_styles
from texture_features.feature_set import AGAIN, FeatureSet
from texture_features.windows import CutWindow, WindowParams
from texture_recordings.dataset import SlideDataset

# --------------------
# A recipe for each pair of surfaces, found by a search of its own; the surface that wins most pairs is the answer.

Pair = tuple[str, str]
LEARNER = 'texture_papers.roberge:TunedPairs'
SHARED = ('windows', 'evidence', 'training')


@dataclass(frozen=True, eq=False)
class PairSearchResult:
    """The search of each pair; learning and test accuracy of the most pairs won, over all surfaces, on each half."""

    by_pair: Mapping[Pair, search.SearchResult]
    scores: tuple[search.HalfScore, ...]

    @property
    def fitness(self) -> float:
        """Mean of learning and test accuracy of all pairs together."""
        return search.fitness(self.scores)


def optimise_pairs(
    space: search.RecipeSpace,
    slides: search.SearchSlides,
    params: search.SearchParams,
    *,
    checkpoint: str | Path | None = None,
    resume: str | Path | None = None,
    tell: Callable[[Pair, search.Generation], None] = lambda *_: None,
) -> PairSearchResult:
    """Search for each pair of surfaces by itself, then evaluate all pairs together.

    Arguments are those of `optimise`; each pair has its own checkpoint, named after it.

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.C: the learning is adapted
    to each pair of textures.
    """
    task, found = search.ClassificationTask(), {}
    names = slides.split(space.base.training_windows)[0].names
    for pair in combinations(names, 2):
        reached = beside(resume, pair) if resume else None
        found[pair] = search.optimise(
            space,
            replace(slides, labels=pair, _known={}),
            params,
            task,
            checkpoint=beside(checkpoint, pair) if checkpoint else None,
            # the search that is gone on with may not have come to this pair
            resume=reached if reached and reached.is_file() else None,
            tell=lambda generation, pair=pair: tell(pair, generation),  # type: ignore[misc]
        )
    # each best recipe once more, on the slides of all surfaces
    best = {
        pair: search.trials_of(search.RecipeSpace(result.best.recipe, {}), slides, task, [()])[0]
        for pair, result in found.items()
    }
    together = Parallel()(delayed(search.scored_alone)(_MostPairsWon(best), number) for number in range(params.halves))
    return PairSearchResult(found, tuple(together))


def beside(path: str | Path, pair: Pair) -> Path:
    """Return the path with the pair's name in it: 'best.yaml' → 'best-cork-vs-measured.yaml'."""
    path = Path(path)
    return path.with_name(f'{path.stem}-{pair[0]}-vs-{pair[1]}{path.suffix}')


@dataclass(frozen=True, eq=False)
class _MostPairsWon:
    """The recipes of all pairs on the slides of all surfaces."""

    trials: Mapping[Pair, search.Trial]

    def __call__(self, number: int) -> search.HalfScore:
        """Return learning and test accuracy of the surface that wins most pairs."""
        wins: Array | None = None
        for pair, trial in self.trials.items():
            windows, halves = trial.recipe.training_windows, trial.halves[number]
            two = np.array([trial.names.index(name) for name in pair])
            training = halves & np.isin(trial.codes, two)
            of_pair = (trial.codes[training] == two[1]).astype(np.intp)
            learner = trial.recipe.learner
            fitted = learner.fit(trial.values[training], of_pair, trial.slides[training])
            scores = learner.predictor(fitted.parameters)(trial.values)
            hop_share = windows.hop_s / windows.length_s
            decided, first = search.decided_by_slide(scores, trial.slides, trial.recipe.evidence, hop_share)
            codes, known = trial.codes[first], halves[first]
            wins = np.zeros((len(codes), len(trial.names))) if wins is None else wins
            rows = np.flatnonzero(decided != search.UNDECIDED)
            wins[rows, two[decided[rows]]] += 1.0
        assert wins is not None
        return search.shares_right(search.decisions(wins), codes, known)


def joined_recipe(recipes: Mapping[Pair, Recipe], base: Recipe) -> Recipe:
    """Return the recipe of one model in which each pair of textures has the features and the learner of its own recipe.

    Each input of a pair's recipe becomes an input of the joined one, named 'signal#1' and so on; pairs with the same
    features share one.

    Parameters
    ----------
    recipes
        Recipe of each pair, by the two labels.
    base
        From which they were searched: gives windows, evidence rule and training, and decides pairs that are not listed.

    Raises
    ------
    InvalidParameter
        If the pairs differ in what all windows share: their length, the evidence rule or the training.
    """
    contents = {pair: recipe.as_mapping() for pair, recipe in recipes.items()}
    first_pair, first = next(iter(contents.items()))
    inputs: dict[str, Any] = {}
    pairs = []
    for pair, content in contents.items():
        for section in SHARED:
            if content[section] != first[section]:
                raise InvalidParameter(
                    f"the pairs {list(first_pair)} and {list(pair)} differ in '{section}', which a model has once; "
                    'search without varying it'
                )
        own = [_placed(inputs, topic, section) for topic, section in content['inputs'].items()]
        pairs.append({'pair': list(pair), 'inputs': own, 'learner': content['learner']})
    return Recipe.from_mapping(
        {
            'description': f'{base.description} Each pair with variables of its own.'.strip(),
            **{section: first[section] for section in SHARED},
            'inputs': inputs,
            'learner': {LEARNER: {'learner': base.as_mapping()['learner'], 'pairs': pairs}},
        },
        f'{base.name}-pairs',
    )


def _placed(inputs: dict[str, Any], topic: str, section: Any) -> str:
    """Return the name under which an input of a pair stands among the inputs; it is added if it is new."""
    plain = topic.partition(AGAIN)[0]
    for name, known in inputs.items():
        if name.partition(AGAIN)[0] == plain and known == section:
            return name
    name = f'{plain}{AGAIN}{1 + sum(known.partition(AGAIN)[0] == plain for known in inputs)}'
    inputs[name] = section
    return name


# --------------------
# Charts of genetic searches: how they converge.

NAMED = 10  # lines of more searches than this are not named


def convergence_chart(searches: Mapping[str, Sequence[search.Generation]], title: str, path: str | Path) -> Path:
    """Draw the fitness of the best individual over the generations, a line for each search.

    Parameters
    ----------
    searches
        Name of the search → its generations.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
    """
    with chart(path, (7.5, 4.2), title) as figure:
        axes = figure.subplots()
        for (name, history), style in zip(searches.items(), cycle(line_styles()), strict=False):
            best = [100 * one.fitness for one in history]
            label = name if len(searches) <= NAMED else None
            axes.step([one.number for one in history], best, where='mid', label=label, **style)
        axes.set(xlabel='generation', ylabel='fitness of the best individual (%)')
        if len(searches) <= NAMED:
            axes.legend(loc='lower right')
    return Path(path)


Tell = Callable[[str, search.Generation], None]


@dataclass(frozen=True)
class Wanted:
    """What is tuned, and on which slides.

    Parameters
    ----------
    recipe
        Name of a shipped recipe, or path of any; of a roughness recipe if there are `grades`.
    bags
        Bags, or folders of bags.
    search
        Name or path of the search space; '' for that of the recipe or its learner.
    slides
        Which slides of each surface, such as '1-30'; '' for all.
    grades
        CSV file with the grade of every surface, or the name of a shipped table; '' to distinguish surfaces.
    per_pair
        Tune the variables of each pair of surfaces by themselves; one recipe joins them.
    """

    recipe: str
    bags: tuple[str, ...]
    search: str = ''
    slides: str = ''
    grades: str = ''
    per_pair: bool = False

    def __post_init__(self) -> None:
        if self.grades and self.per_pair:
            raise InvalidParameter('grades are not decided pair by pair; leave --per-pair or --grades out')


def _named_windows(dataset: SlideDataset, plan: FeatureSet) -> Iterator[CutWindow]:
    """Yield the windows by names of slides: unlike ids of explorations, these are unique over all bags."""
    for slide, events in dataset.windows(plan):
        yield from (replace(event, exploration_id=slide.name) for event in events if isinstance(event, CutWindow))


def cut_of(dataset: SlideDataset, feature_set: FeatureSet) -> search.Cut:
    """Return what gives the windows of all slides, by window parameters; each length is cut once."""

    @cache
    def cut(windows: WindowParams) -> search.LabelledWindows:
        plan = replace(feature_set, windows=windows, _layouts={})
        return search.LabelledWindows.from_events(_named_windows(dataset, plan), feature_set.window_names)

    return cut


def optimise_from_bags(
    wanted: Wanted,
    params: search.SearchParams,
    out: str | Path,
    *,
    resume: bool = False,
    tell: Tell = lambda *_: None,
) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Tune a recipe and write it as `out`, with checkpoint and chart beside it; within `workers`, on several cores.

    Parameters
    ----------
    wanted
        Recipe and slides.
    params
        Population, generations and so on.
    out
        Path of the recipe that is written, such as 'best.yaml'.
    resume
        Go on from the checkpoint beside `out`.
    tell
        Called after each generation with the pair of surfaces ('' for all) and what it brought.

    Returns
    -------
    tuple of Path
        The files.
    tuple of str
        What was found, in lines for people.

    Raises
    ------
    TextureError
        With one sentence, if recipe, bags, search space or checkpoint are wrong.
    InvalidParameter
        If the folder of `out` does not exist.
    InvalidData
        If there is no checkpoint to go on from.
    """
    target = Path(out).expanduser()
    if not target.parent.is_dir():
        raise InvalidParameter(f"there is no folder '{target.parent}' for '{target.name}'; name another place")
    space = _space(wanted)
    feature_set = space.base.feature_set
    dataset = SlideDataset.from_bags(wanted.bags, wanted.slides, topics=feature_set.topics)
    search_slides = search.SearchSlides(cut_of(dataset, feature_set), params.halves, params.seed)
    checkpoint = checkpoint_of(target)
    if resume and not written_checkpoints(target):
        raise InvalidData(f"there is no checkpoint '{checkpoint}' to go on from; leave '--resume' out to start again")
    options: dict[str, Any] = {'checkpoint': checkpoint, 'resume': checkpoint if resume else None}
    found: search.SearchResult | PairSearchResult
    if wanted.per_pair:
        found = optimise_pairs(
            space, search_slides, params, tell=lambda pair, said: tell(' – '.join(pair), said), **options
        )
    else:
        task = search.RoughnessTask(read_grades(wanted.grades)) if wanted.grades else search.ClassificationTask()
        found = search.optimise(space, search_slides, params, task, tell=lambda said: tell('', said), **options)
    files, lines = write_recipes(found, space.base, wanted.recipe, params, target)
    return (*files, _draw(found, wanted.recipe, target.with_suffix('.png'))), lines


def _draw(found: search.SearchResult | PairSearchResult, recipe: str, chart: Path) -> Path:
    if isinstance(found, PairSearchResult):
        histories = {' – '.join(pair): one.history for pair, one in found.by_pair.items()}
        return convergence_chart(histories, f'{recipe}: a search for each pair', chart)
    return convergence_chart({recipe: found.history}, f'{recipe}: the search', chart)


def _space(wanted: Wanted) -> search.RecipeSpace:
    recipe: Recipe | RoughnessRecipe
    if wanted.grades:
        recipe = load_roughness_recipe(wanted.recipe)
        learner = recipe.regressor_name
    else:
        recipe = load_recipe(wanted.recipe)
        learner = recipe.learner_name
    of_pairs = search.space_for('pairs_of', recipe.name) if wanted.per_pair else None
    name = (
        wanted.search or of_pairs or search.space_for('recipes', recipe.name) or search.space_for('learners', learner)
    )
    if not name:
        raise InvalidParameter(
            f"recipe '{recipe.name}' has no search space of its own, nor has '{learner}'; "
            'say with --search FILE what is to be varied'
        )
    return search.RecipeSpace.load(name, recipe)


# --------------------
# Recipes that a search has found, written as files that `texture train` reads.


def checkpoint_of(out: str | Path) -> Path:
    """Return where the scores of a search are kept: 'best.yaml' → 'best.search.json'."""
    path = Path(out)
    return path.with_name(f'{path.stem}.search.json')


def written_checkpoints(out: str | Path) -> list[Path]:
    """Return the checkpoint of a search that is there, or those of its pairs."""
    path = checkpoint_of(out)
    return [path] if path.is_file() else sorted(path.parent.glob(f'{path.stem}-*-vs-*{path.suffix}'))


def write_recipes(
    found: search.SearchResult | PairSearchResult, base: Any, tuned: str, params: search.SearchParams, target: Path
) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Write the best recipe; of pairs, theirs and the one that joins them.

    Where a recipe comes from and its scores stand at the top of its file.

    Parameters
    ----------
    found
        What was found.
    base
        Recipe from which the search began.
    tuned
        How it was named.
    params
        Parameters of the search.
    target
        Path of the recipe.

    Returns
    -------
    tuple of Path
        The files, with the checkpoint of a search that has one.
    tuple of str
        What was found, in lines for people.

    Raises
    ------
    InvalidParameter
        If a file cannot be written.
    """
    origin = (
        f'Found by `texture optimise {tuned}`: {params.population} individuals, {params.generations} '
        f'generations, {params.halves} halves, seed {params.seed}.'
    )
    files = (
        {beside(target, pair): one.best for pair, one in found.by_pair.items()}
        if isinstance(found, PairSearchResult)
        else {target: found.best}
    )
    for path, finalist in files.items():
        _write(finalist.recipe, path, origin, _scores(finalist))
    lines = tuple(f'{path}: {_scores(finalist)}' for path, finalist in files.items())
    if not isinstance(found, PairSearchResult):
        return (*files, checkpoint_of(target)), lines
    together = f'all pairs together, most pairs won: {_shares(found.scores)}'
    try:
        joined = joined_recipe({pair: one.best.recipe for pair, one in found.by_pair.items()}, base)
    except InvalidParameter as error:
        return tuple(files), (*lines, together, f'no recipe of all pairs was written: {error}')
    _write(joined, target, origin, together)
    return (target, *files), (*lines, f'{target}: {together}')


def _write(recipe: Any, path: Path, origin: str, scores: str) -> None:
    content = yaml.safe_dump(recipe.as_mapping(), sort_keys=False, allow_unicode=True, width=120)
    with writing(path):
        path.write_text(f'# {origin}\n# {scores}.\n{content}', encoding='utf-8')


def _scores(finalist: search.Finalist) -> str:
    return f'fitness {100 * finalist.fitness:.1f} %: {_shares(finalist.scores)} over {len(finalist.scores)} halves'


def _shares(scores: Sequence[search.HalfScore]) -> str:
    learning, test = 100.0 * np.mean(scores, axis=0)
    return f'training {learning:.1f} %, tested {test:.1f} %'
