# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tune a recipe on labelled bags by a genetic search, and write what was found as recipe files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
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


# The search of each pair, by its two surfaces; of all surfaces at once, by none.
Found = Mapping[tuple[str, ...], search.SearchResult]


def optimise_pairs(
    space: search.RecipeSpace,
    slides: search.SearchSlides,
    params: search.SearchParams,
    *,
    checkpoint: str | Path | None = None,
    resume: str | Path | None = None,
    tell: Callable[[Pair, search.Generation], None] = lambda *_: None,
) -> tuple[Found, tuple[search.HalfScore, ...]]:
    """Search for each pair of surfaces by itself, then evaluate all pairs together.

    Arguments are those of `optimise`; each pair has its own checkpoint, named after it.

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.C: the learning is adapted
    to each pair of textures.
    """
    task = search.ClassificationTask()
    found: dict[tuple[str, ...], search.SearchResult] = {}
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
    most_pairs_won = partial(_most_pairs_won, best)
    together = Parallel()(delayed(search.scored_alone)(most_pairs_won, number) for number in range(params.halves))
    return found, tuple(together)


def beside(path: str | Path, pair: Sequence[str]) -> Path:
    """Return the path with the pair's name in it: 'best.yaml' → 'best-cork-vs-measured.yaml'."""
    path = Path(path)
    return path.with_name(f'{path.stem}-{pair[0]}-vs-{pair[1]}{path.suffix}')


def _most_pairs_won(trials: Mapping[tuple[str, ...], search.Trial], number: int) -> search.HalfScore:
    """Return learning and test accuracy of the surface that wins most pairs, on a half of the slides of all."""
    wins: Array | None = None
    for pair, trial in trials.items():
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


def joined_recipe(recipes: Mapping[tuple[str, ...], Recipe], base: Recipe) -> Recipe:
    """Return the recipe of one model in which each pair of textures has the features and the learner of its own recipe.

    Each input of a pair's recipe becomes an input of the joined one, named 'signal#1' and so on; pairs with the same
    features share one.
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
    """Draw the fitness of the best individual over the generations, a line for each search."""
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
    recipe: str,
    bags: Sequence[str | Path],
    params: search.SearchParams,
    out: str | Path,
    *,
    search_space: str = '',
    slides: str = '',
    grades: str = '',
    per_pair: bool = False,
    resume: bool = False,
    tell: Tell = lambda *_: None,
) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Tune a recipe and write it as `out`, with checkpoint and chart beside it; within `workers`, on several cores."""
    target = Path(out).expanduser()
    if not target.parent.is_dir():
        raise InvalidParameter(f"there is no folder '{target.parent}' for '{target.name}'; name another place")
    if grades and per_pair:
        raise InvalidParameter('grades are not decided pair by pair; leave --per-pair or --grades out')
    base = load_roughness_recipe(recipe) if grades else load_recipe(recipe)
    feature_set = base.feature_set
    space = search.RecipeSpace.load(search_space or _space_of(base, per_pair=per_pair), base)
    dataset = SlideDataset.from_bags(bags, slides, topics=feature_set.topics)
    search_slides = search.SearchSlides(cut_of(dataset, feature_set), params.halves, params.seed)
    checkpoint = checkpoint_of(target)
    if resume and not written_checkpoints(target):
        raise InvalidData(f"there is no checkpoint '{checkpoint}' to go on from; leave '--resume' out to start again")
    options: dict[str, Any] = {'checkpoint': checkpoint, 'resume': checkpoint if resume else None}
    found: Found
    if per_pair:
        found, together = optimise_pairs(
            space, search_slides, params, tell=lambda pair, said: tell(' – '.join(pair), said), **options
        )
    else:
        task = search.RoughnessTask(read_grades(grades)) if grades else search.ClassificationTask()
        found = {(): search.optimise(space, search_slides, params, task, tell=lambda said: tell('', said), **options)}
        together = ()
    files, lines = write_recipes(found, together, base, params, target)
    histories = {' – '.join(pair) or recipe: one.history for pair, one in found.items()}
    title = f'{recipe}: a search for each pair' if per_pair else f'{recipe}: the search'
    return (*files, convergence_chart(histories, title, target.with_suffix('.png'))), lines


def _space_of(recipe: Recipe | RoughnessRecipe, *, per_pair: bool) -> str:
    learner = recipe.learner_name if isinstance(recipe, Recipe) else recipe.regressor_name
    of_pairs = search.space_for('pairs_of', recipe.name) if per_pair else None
    name = of_pairs or search.space_for('recipes', recipe.name) or search.space_for('learners', learner)
    if not name:
        raise InvalidParameter(
            f"recipe '{recipe.name}' has no search space of its own, nor has '{learner}'; "
            'say with --search FILE what is to be varied'
        )
    return name


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
    found: Found, together: Sequence[search.HalfScore], base: Any, params: search.SearchParams, target: Path
) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Write the best recipe; of pairs, theirs and the one that joins them.

    Where a recipe comes from and its scores stand at the top of its file.
    """
    origin = (
        f'Found by `texture optimise {base.name}`: {params.population} individuals, {params.generations} '
        f'generations, {params.halves} halves, seed {params.seed}.'
    )
    files = {beside(target, pair) if pair else target: one.best for pair, one in found.items()}
    for path, finalist in files.items():
        _write(finalist.recipe, path, origin, _scores(finalist))
    lines = tuple(f'{path}: {_scores(finalist)}' for path, finalist in files.items())
    if not together:
        return (*files, checkpoint_of(target)), lines
    shares = f'all pairs together, most pairs won: {_shares(together)}'
    try:
        joined = joined_recipe({pair: one.best.recipe for pair, one in found.items()}, base)
    except InvalidParameter as error:
        return tuple(files), (*lines, shares, f'no recipe of all pairs was written: {error}')
    _write(joined, target, origin, shares)
    return (target, *files), (*lines, f'{target}: {shares}')


def _write(recipe: Any, path: Path, origin: str, scores: str) -> None:
    content = yaml.safe_dump(recipe.as_mapping(), sort_keys=False, allow_unicode=True, width=120)
    with writing(path):
        path.write_text(f'# {origin}\n# {scores}.\n{content}', encoding='utf-8')


def _scores(finalist: search.Finalist) -> str:
    return f'fitness {100 * finalist.fitness:.1f} %: {_shares(finalist.scores)} over {len(finalist.scores)} halves'


def _shares(scores: Sequence[search.HalfScore]) -> str:
    learning, test = 100.0 * np.mean(scores, axis=0)
    return f'training {learning:.1f} %, tested {test:.1f} %'
