# SPDX-License-Identifier: Apache-2.0
"""Every recipe on the same recorded slides: how often it is right, how long it learns, and how long it thinks."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from itertools import product
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy.signal import resample_poly
from sklearn.model_selection import LeaveOneGroupOut, StratifiedKFold

from texture_benchmarks.study import (
    BenchmarkOptions,
    BenchmarkResult,
    evidence_chart,
    front_chart,
    imported,
    map_forked,
    markdown_table,
)
from texture_core.config import shipped
from texture_core.errors import InvalidParameter
from texture_core.types import TactileSignal
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe, load_recipe, with_channels
from texture_evaluation import metrics
from texture_evaluation.cross_validation import (
    ChronologicalSplit,
    CrossValidation,
    FoldFeatures,
    Split,
    cross_validate,
)
from texture_evaluation.evaluate import run_model
from texture_features.augmentation import Augmentation
from texture_features.feature import Feature
from texture_features.feature_set import InputFeatures
from texture_features.features.temporal import Force, Speed
from texture_features.windows import Stretched
from texture_papers.hu import Spectrum
from texture_papers.protocol import digest_of
from texture_recordings.dataset import LabelledSlide, SlideDataset, cut_slide

# Every recipe is given windows of this length, but for those whose paper votes over shorter parts, and is trained on
# windows this far apart.
LENGTH_S = 0.5
TIMED_SLIDES = 40
LATENCY_ROUNDS = 5  # the quickest counts, as other work on the machine only adds
ROUNDING = 1e-9  # of a quotient of two times
Key = TypeVar('Key', bound=Hashable)


def figures_of(result: CrossValidation) -> dict[str, Any]:
    """Return the figures of one cell of the table."""
    results = result.pooled
    seconds, shares = metrics.curve(results)
    return {
        'window_accuracy': metrics.window_accuracy(results),
        'accuracy_at_s': metrics.accuracy_at_times(results),
        'accuracy_at_end': metrics.accuracy_at_end(results),
        'decisions': {'s': seconds.round(3).tolist(), 'share': shares.round(4).tolist()},
        'unclassified_windows': metrics.unclassified_windows(results),
        'unclassified_at_s': metrics.unclassified_at_times(results),
        'train_s': round(float(np.mean([fold.train_s for fold in result.folds])), 2),
    }


def at_rate(slide: LabelledSlide, topic: str, rate_hz: float) -> LabelledSlide:
    """Return the slide with one topic alone, brought to another rate, stretch by stretch between losses."""
    return dataclasses.replace(slide, signals={topic: _at_rate(slide.signals[topic], rate_hz)})


def all_at_rate(dataset: SlideDataset, topic: str, rate_hz: float) -> SlideDataset:
    """Return the slides with one topic alone, brought to another rate."""
    return SlideDataset(tuple(at_rate(slide, topic, rate_hz) for slide in dataset))


def comparable(
    recipe: Recipe, rate_hz: float, *, of_motion: bool, length_s: float | None = None, augmented: bool = False
) -> Recipe:
    """Return a recipe with windows as all others have them, trained LENGTH_S apart."""
    windows = recipe.feature_set.windows
    if length_s is not None:
        windows = dataclasses.replace(windows, length_s=length_s, hop_s=min(length_s, LENGTH_S))
    elif windows.length_s >= LENGTH_S:
        windows = dataclasses.replace(windows, length_s=LENGTH_S, hop_s=LENGTH_S)
    inputs = (_adapted(item, round(windows.length_s * rate_hz), of_motion) for item in recipe.feature_set.inputs)
    inputs = (item for item in inputs if item.features)
    feature_set = dataclasses.replace(recipe.feature_set, windows=windows, inputs=tuple(inputs), _layouts={})
    augmentation = recipe.augmentation if augmented else Augmentation()
    comparable_recipe = dataclasses.replace(recipe, feature_set=feature_set, augmentation=augmentation)
    return trained_every(LENGTH_S, comparable_recipe)


def every(hop_s: float, recipe: Recipe) -> Recipe:
    """Return a recipe whose windows begin so far apart; those for training stay as they are."""
    windows = dataclasses.replace(recipe.feature_set.windows, hop_s=hop_s)
    feature_set = dataclasses.replace(recipe.feature_set, windows=windows, _layouts={})
    return dataclasses.replace(recipe, feature_set=feature_set)


def trained_every(apart_s: float, recipe: Recipe) -> Recipe:
    """Return a recipe whose training windows begin so far apart, or the next multiple of a shorter hop."""
    hop_s = recipe.feature_set.windows.hop_s
    multiple_s = hop_s * math.ceil(apart_s / hop_s - ROUNDING) if hop_s < apart_s else apart_s
    return dataclasses.replace(recipe, training=dataclasses.replace(recipe.training, hop_s=multiple_s))


def latency_us(recipe: Recipe, model: TextureModel, dataset: SlideDataset) -> dict[str, float]:
    """Return median and 99th percentile of the computing time of windows one by one; the first slide warms up.

    By the clock of the processor, which other work on the machine lengthens little.
    """
    timed = dataset.slides[:: max(1, len(dataset) // TIMED_SLIDES)]
    cut = [cut_slide(slide, recipe.feature_set) for slide in timed]
    taken = [run_model(model, events, time.process_time)[2][:-1] for events in (cut[0], *cut)][1:]
    median, p99 = np.percentile(np.concatenate(taken), (50, 99))
    return {'median': round(float(median), 1), 'p99': round(float(p99), 1)}


def latencies_us(timed: Mapping[Key, tuple[Recipe, TextureModel, SlideDataset]]) -> dict[Key, dict[str, float]]:
    """Return what `latency_us` does for each, of the round over all in which its median was lowest.

    Other work on the machine comes and goes within a minute, and only ever lengthens a round.
    """
    rounds = [{key: latency_us(*item) for key, item in timed.items()} for _ in range(LATENCY_ROUNDS)]
    return {key: min((taken[key] for taken in rounds), key=itemgetter('median')) for key in timed}


def _at_rate(batches: Sequence[TactileSignal], rate_hz: float) -> list[TactileSignal]:
    ratio = Fraction(rate_hz / batches[0].sampling_rate_hz).limit_denominator(1000)
    runs: list[list[TactileSignal]] = []
    for batch in batches:
        if runs and batch.first_sample == runs[-1][-1].next_sample:
            runs[-1].append(batch)
        else:
            runs.append([batch])
    return [_resampled(run, ratio, rate_hz) for run in runs]


def _resampled(run: Sequence[TactileSignal], ratio: Fraction, rate_hz: float) -> TactileSignal:
    samples = np.concatenate([batch.samples for batch in run]).astype(np.float64)
    whole = resample_poly(samples, ratio.numerator, ratio.denominator, axis=0)[: int(len(samples) * ratio)]
    return dataclasses.replace(
        run[0],
        sampling_rate_hz=rate_hz,
        first_sample=round(run[0].first_sample * ratio),
        samples=whole.astype(np.float32),
    )


def _adapted(item: InputFeatures, n_samples: int, of_motion: bool) -> InputFeatures:
    features = [(name, _adapted_feature(feature, n_samples, of_motion)) for name, feature in item.features]
    kept = tuple((name, feature) for name, feature in features if of_motion or not isinstance(feature, Speed | Force))
    return dataclasses.replace(item, features=kept)


def _adapted_feature(feature: Feature, n_samples: int, of_motion: bool) -> Feature:
    if isinstance(feature, Stretched):
        own = _adapted_feature(feature.feature, n_samples, of_motion)
        return dataclasses.replace(feature, feature=own) if of_motion else own
    if isinstance(feature, Spectrum):  # padding a window with zeros adds points, but nothing to them
        return dataclasses.replace(feature, points=min(feature.points, max(2, n_samples // 2)))
    return feature


def recipe_table(settings: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> str:
    """Return one row for each recipe: what it recognises on each data set and split, then what it costs.

    The costs are those of the first split that it was tried on; slides are counted after 5 s, or at their end.
    """
    columns = {f'{name}, {split}': cells for name, splits in settings.items() for split, cells in splits.items()}
    tried: dict[str, Mapping[str, Any]] = {}
    for cells in columns.values():
        tried = {**cells, **tried}
    first = next(iter(columns.values()))
    rows = [
        [
            name,
            *(_accuracy(cells[name]) if name in cells else '' for cells in columns.values()),
            f'{100 * cell["unclassified_windows"]:.1f}',
            f'{cell["train_s"]:.1f}',
            f'{cell["latency_us"]["median"]:.0f}',
        ]
        for name, cell in sorted(tried.items(), key=lambda item: -first.get(item[0], NOT_TRIED)['window_accuracy'])
    ]
    heads = (f'{column}: window; slide (%)' for column in columns)
    return markdown_table(['recipe', *heads, 'unclassified (%)', 'training (s)', 'latency (µs)'], rows)


NOT_TRIED = {'window_accuracy': -1.0}


def _accuracy(cell: Mapping[str, Any]) -> str:
    shares = (cell['window_accuracy'], cell['accuracy_at_s']['5.0'] or cell.get('accuracy_at_end'))
    return '; '.join('' if share is None else f'{100 * share:.1f}' for share in shares)


VIBRATION, ALL_CHANNELS, ARRAY = 'biotac20, PAC at 1 kHz', 'biotac20, all channels', 'ntp21'
DATA = {
    'biotac20': 'BioTac, 20 materials × 40 slides of 6 s (github dexrob/BioTac_slide_20_50, Gao et al. 2020)',
    'ntp21': 'MEMS array of 9 taxels, 21 textures × 4 speeds × 4 forces, one slide each (github LIMB-UCF/NTP)',
}
RATE_HZ, FOLDS, LAST_TRAINED = 1000.0, 5, 30
QUICK_MATERIALS, QUICK_SLIDES, QUICK_FOLDS, QUICK_LAST_TRAINED = ('material01', 'material02', 'material03'), '1-6', 2, 4
FIRST, QUICK_FIRST = LAST_TRAINED / 40, QUICK_LAST_TRAINED / 6  # fraction of the slides of each material
QUICK_FASTER_M_S = 0.05
NEEDS_TANGENTIAL_FORCE = frozenset({'friction-svm'})
QUICK_RECIPES = ('default', 'ets-linear-svm-vote', 'kaboli-pa', 'jamali-naive-bayes-5')
LATER = 'by time'
SPLITS: Mapping[str, str] = {
    'random': f'{FOLDS} folds by slide',
    LATER: f'trained on slides 1-{LAST_TRAINED} of each surface, tested on the later ones',
    'one force out': 'each in turn is tested and held out',
    'one speed out': 'each in turn is tested and held out',
}
SPLIT_TITLES: Mapping[str, str] = {LATER: 'later slides tested', 'one speed out': 'tested at a speed held out'}
SLOW = '-ann'  # networks for pairs: they are begun first, so that no core waits at the end


# Shown over the sliding time: each paper's way of deciding, and ours.
OVER_TIME = (
    'default',
    'ets-linear-svm',
    'ets-linear-svm-vote',
    'ets-linear-ann-vote',
    'ets-circular-svm',
    'kaboli-svm',
    'jamali-naive-bayes-5',
)
# They describe what only an array of taxels measures.
NEEDS_ARRAY = frozenset({'any-speed', 'taxels-signal'})


@dataclass(frozen=True, eq=False)
class Setting:
    """Slides of one data set as all recipes get them, and how they are split."""

    dataset: SlideDataset  # All slides
    splits: Sequence[Split]  # Splitters of the slides
    rate_hz: float  # Of the vibration
    of_motion: bool  # Whether recipes may use speed and force

    def recipe(self, name: str) -> Recipe:
        """Return a recipe as it is tried here: with the vibration alone where other inputs are missing."""
        recipe = load_recipe(name)
        whole = set(recipe.feature_set.topics) <= set(self.dataset[0].signals)
        recipe = with_channels(recipe, 'all' if whole else 'fast')
        return comparable(recipe, self.rate_hz, of_motion=self.of_motion, augmented=True)


class _RecipeJob(NamedTuple):
    setting: str
    recipes: tuple[str, ...]


class _RecipeFigures(NamedTuple):
    """The figures of one recipe by split, and the model of the last split."""

    figures: dict[str, dict[str, Any]]
    model: TextureModel


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Try all shipped recipes on all recorded data sets that are there."""
    settings: dict[str, Setting] = {}
    for name, build in (('biotac20', biotac20_settings), ('ntp21', _ntp21)):
        if options.data and (options.data / name).is_dir():
            settings |= build(options)
    if not settings:
        options.recordings('biotac20')  # says that it is missing
    numbers = _numbers(settings, _shipped(options), options)
    return _result('recipes', numbers, options, table=True)


def _fits(name: str, setting: Setting) -> bool:
    """Return whether a recipe can be tried: its signals and, where it needs it, the speed are there."""
    try:
        topics = setting.recipe(name).feature_set.topics
    except InvalidParameter:  # of a recipe without vibration on slides that have nothing else
        return False
    return set(topics) <= set(setting.dataset[0].signals)


def run_later(options: BenchmarkOptions) -> BenchmarkResult:
    """Try the shipped ones on the vibration of later slides alone, in a sixth of the time."""
    setting = biotac20_settings(options)[VIBRATION]
    later = replace(setting, splits=[split for split in setting.splits if split.name == LATER])
    numbers = _numbers({VIBRATION: later}, _shipped(options), options)
    cells = numbers[VIBRATION][LATER]
    for recipe, figures in cells.items():
        figures['definition'] = digest_of(recipe)  # of what was measured
    result = _result('recipes_later', numbers, options)
    lines = {name: cells[name]['decisions'] for name in OVER_TIME if name in cells}
    series = {name: (np.array(line['s']), np.array(line['share'])) for name, line in lines.items()}
    path = options.out / 'recipes_later_sliding.png'
    title = 'Recorded slides: decisions of recipes that vote, and of others, when they are made'
    return replace(result, charts=(*result.charts, evidence_chart(series, title, path)))


def _shipped(options: BenchmarkOptions) -> Sequence[str]:
    if options.quick:
        return QUICK_RECIPES
    return of_one_finger(path.stem for path in shipped('texture_estimation', 'config/recipes').values())


def of_one_finger(recipes: Iterable[str]) -> list[str]:
    """Return the recipes by name, without those of several fingers or of friction: no recorded data has these."""
    return sorted(
        name
        for name in recipes
        if name not in NEEDS_TANGENTIAL_FORCE
        and not {'/', '@'} & set(''.join(load_recipe(name).feature_set.window_names))
    )


def _numbers(settings: Mapping[str, Setting], names: Sequence[str], options: BenchmarkOptions) -> dict[str, Any]:
    numbers: dict[str, Any] = {name: {split.name: {} for split in setting.splits} for name, setting in settings.items()}
    jobs = _jobs(settings, names)
    timed = {}
    for job, tried in zip(jobs, map_forked(partial(_try, settings), jobs), strict=True):
        setting = settings[job.setting]
        for name, (of_splits, model) in tried.items():
            for split, figures in of_splits.items():
                numbers[job.setting][split][name] = figures
            timed[job.setting, name] = setting.recipe(name), model, setting.dataset
    for (place, name), latency in latencies_us(timed).items():
        for own in settings[place].splits:
            numbers[place][own.name][name]['latency_us'] = latency
    return numbers


def _result(
    name: str, numbers: Mapping[str, Any], options: BenchmarkOptions, *, table: bool = False
) -> BenchmarkResult:
    """Return the figures of recipes and a chart of them.

    Share of single windows recognised; share of slides after so much sliding; share unclassified; mean computing time
    of a training (s); time from window to estimate (µs), the quickest of 5 rounds. Windows of 0.5 s that do not
    overlap, trained on as tested; recipes that vote over shorter parts keep those, and train on parts 0.5 s apart.
    Recipes as released, but on biotac20 without speed, force and stretching: there they belong to the session and not
    to the surface.
    """
    sets = {setting.partition(',')[0] for setting in numbers}
    splits = {split for of_setting in numbers.values() for split in of_setting}
    options.out.mkdir(parents=True, exist_ok=True)
    if table:
        (options.out / f'{name}.md').write_text(recipe_table(numbers), encoding='utf-8')
    return BenchmarkResult(
        name=name,
        measured=_result.__doc__,
        data='; '.join(text for name, text in DATA.items() if name in sets),
        split='; '.join(f'{split}: {SPLITS[split]}' if split in SPLITS else split for split in sorted(splits)),
        numbers=numbers,
        charts=(_chart(numbers, options.out / f'{name}.png'),),
    )


def biotac20_settings(options: BenchmarkOptions) -> dict[str, Setting]:
    """Return the vibration alone and all channels of the BioTac's slides."""
    some = (QUICK_SLIDES, QUICK_MATERIALS) if options.quick else ()
    with imported(options, 'biotac20', *some) as bags:
        dataset = SlideDataset.from_bags(bags)
    by_time = Split(LATER, ChronologicalSplit(QUICK_FIRST if options.quick else FIRST))
    at_random = Split(
        'random', StratifiedKFold(QUICK_FOLDS if options.quick else FOLDS, shuffle=True, random_state=options.seed)
    )
    vibration = all_at_rate(dataset, 'signal', RATE_HZ)
    return {
        VIBRATION: Setting(vibration, [at_random, by_time], RATE_HZ, of_motion=False),
        ALL_CHANNELS: Setting(dataset, [by_time], 2200.0, of_motion=False),
    }


def _ntp21(options: BenchmarkOptions) -> dict[str, Setting]:
    with imported(options, 'ntp21') as bags:
        dataset = SlideDataset.from_bags(bags[:3] if options.quick else bags)
    if options.quick:  # fast slides are the short ones
        dataset = dataset.select(where=lambda slide: slide.speed_m_s > QUICK_FASTER_M_S)
    splits = [Split(f'one {condition} out', LeaveOneGroupOut(), condition) for condition in ('force', 'speed')]
    rate_hz = dataset[0].signals['signal'][0].sampling_rate_hz
    return {ARRAY: Setting(dataset, splits, rate_hz, of_motion=True)}


def _jobs(settings: Mapping[str, Setting], names: Sequence[str]) -> list[_RecipeJob]:
    """Return what is tried; recipes with the same windows and features together: they are described once."""
    groups: dict[tuple[Any, ...], list[str]] = {}
    for setting, name in product(settings, names):
        if (name not in NEEDS_ARRAY or setting == ARRAY) and _fits(name, settings[setting]):
            recipe = settings[setting].recipe(name)
            key = (setting, recipe.feature_set, recipe.training.hop_s, recipe.augmentation)
            groups.setdefault(key, []).append(name)
    jobs = [_RecipeJob(setting, tuple(group)) for (setting, *_), group in groups.items()]
    return sorted(jobs, key=lambda job: not any(SLOW in name for name in job.recipes))


def _try(settings: Mapping[str, Setting], job: _RecipeJob) -> dict[str, _RecipeFigures]:
    setting = settings[job.setting]
    recipes = {name: setting.recipe(name) for name in job.recipes}
    features = FoldFeatures.of(recipes[job.recipes[0]], setting.dataset)
    tried = {}
    for name, recipe in recipes.items():
        results = {
            split.name: cross_validate(recipe, setting.dataset, split.splitter, groups=split.groups, features=features)
            for split in setting.splits
        }
        *_, last = results.values()
        figures = {split: figures_of(result) for split, result in results.items()}
        tried[name] = _RecipeFigures(figures, last.folds[-1].model)
    return tried


def _chart(numbers: Mapping[str, Any], path: Path) -> Path:
    panels = {
        f'{name}, {SPLIT_TITLES.get(split, split)}': {
            recipe: (cell['latency_us']['median'], cell['window_accuracy']) for recipe, cell in of_split.items()
        }
        for name, of_setting in numbers.items()
        for split, of_split in list(of_setting.items())[-1:]
    }
    title = 'Accuracy of all recipes over computing time; orange: most accurate for the time'
    axis_labels = ('computing time of a window (µs)', 'single windows recognised (%)')
    return front_chart(panels, title, axis_labels, path)
