"""Every recipe on the same recorded slides: how often it is right, how long it learns, and how long it thinks."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from sklearn.model_selection import LeaveOneGroupOut

from texture_benchmarks.charts import evidence_chart, front_chart
from texture_benchmarks.forked_map import map_forked
from texture_benchmarks.imported_data import imported
from texture_benchmarks.papers.recipe_digest import digest_of
from texture_benchmarks.recipes import minirocket
from texture_benchmarks.recipes.own_method import (
    BESIDE,
    OWN_DATA,
    folds_of,
    own_recipe,
    shown_name,
    takes_windows,
    tells_motion,
)
from texture_benchmarks.recipes.raw_windows import try_estimator
from texture_benchmarks.recipes.table import recipe_table
from texture_benchmarks.recipes.trial import (
    LATENCY_ROUNDS,
    LENGTH_S,
    all_at_rate,
    comparable,
    figures_of,
    in_random_folds,
    latencies_us,
    trained_every,
)
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.resources import folder
from texture_estimation.channels import with_channels
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe, load_recipe
from texture_evaluation.cross_validation.chronological_split import ChronologicalSplit
from texture_evaluation.cross_validation.cross_validate import FoldFeatures, cross_validate
from texture_evaluation.cross_validation.slide_splits import split_slides
from texture_evaluation.cross_validation.splits import Split
from texture_features.augmentation.augmentation import Augmentation
from texture_features.feature_set import FeatureSet
from texture_recordings.slide_dataset import SlideDataset

VIBRATION, ALL_CHANNELS, ARRAY = 'biotac20, PAC at 1 kHz', 'biotac20, all channels', 'ntp21'
DATA = {
    'biotac20': 'BioTac, 20 materials × 40 slides of 6 s (github dexrob/BioTac_slide_20_50, Gao et al. 2020)',
    'ntp21': 'MEMS array of 9 taxels, 21 textures × 4 speeds × 4 forces, one slide each (github LIMB-UCF/NTP)',
    OWN_DATA: 'slides of the bags given',
}
RATE_HZ, FOLDS, LAST_TRAINED = 1000.0, 5, 30
QUICK_MATERIALS, QUICK_SLIDES, QUICK_FOLDS, QUICK_LAST_TRAINED = ('material01', 'material02', 'material03'), '1-6', 2, 4
FIRST, QUICK_FIRST = LAST_TRAINED / 40, QUICK_LAST_TRAINED / 6  # fraction of the slides of each material
QUICK_FASTER_M_S = 0.05
NEEDS_TANGENTIAL_FORCE = frozenset({'friction-svm'})
QUICK_RECIPES = ('default', 'ets-linear-svm-vote', 'kaboli-pa', 'jamali-naive-bayes-5, overlapping')
NEAREST = {'ties': 'nearest'}
OVERLAPPING_S = 0.25  # apart, by half
LATER = 'by time'
SPLITS: Mapping[str, str] = {
    'random': f'{FOLDS} folds by slide',
    LATER: f'trained on slides 1-{LAST_TRAINED} of each surface, tested on the later ones',
    'one force out': 'each in turn is tested and held out',
    'one speed out': 'each in turn is tested and held out',
}
SPLIT_TITLES: Mapping[str, str] = {LATER: 'later slides tested', 'one speed out': 'tested at a speed held out'}
MINIROCKET = 'MiniRocket'
SLOW = re.compile('-ann|MiniRocket')
# Published with the data, for all of its 50 slides a material: windows of 0.5 s of PAC at 1 kHz, five random folds by
# slide, one window one vote over 5 s. Window, vote, and computing time of a window (µs).
REFERENCES: Mapping[str, tuple[float, float | None, float | None]] = {
    '5 spectral peaks, naive Bayes': (0.280, 0.439, None),
    '8 spectral peaks, integral, length, RBF SVC': (0.506, 0.763, None),
    'log PSD, PCA to 99 %, RBF SVC': (0.510, 0.858, None),
    'Hjorth, SVC': (0.471, 0.684, None),
    'catch22+2, SVC': (0.480, 0.759, 1_200.0),
    'MiniRocket, ridge': (0.619, 0.883, 1_600.0),
    'MultiRocket, ridge': (0.630, 0.945, 17_000.0),
    'tsfresh efficient, SVC': (0.663, None, 97_000.0),
    '42 features, 64 log-Welch bands, RBF SVC': (0.710, 0.969, 150.0),
    'the same, calibrated, soft vote': (0.705, 0.983, 150.0),
}


@dataclass(frozen=True)
class Variant:
    """What a recipe tried beside has else than the one shipped.

    Parameters
    ----------
    learner
        Settings of its learner.
    apart_s
        How far apart the training windows begin; those tested stay as they are.
    """

    learner: Mapping[str, Any] = field(default_factory=dict)
    apart_s: float = LENGTH_S


SHIPPED = Variant()
# The papers leave ties unclassified, published machines of the same kind take the clearer label; Hu et al. keep 99 % of
# the variance; the figures published with the data do not say whether windows overlap in learning.
VARIANTS: Mapping[str, Variant] = {
    'ets-linear-svm, ties to the nearest': Variant(NEAREST),
    'ets-linear-svm, ties to the nearest, overlapping': Variant(NEAREST, OVERLAPPING_S),
    'ets-fine-svm, ties to the nearest': Variant(NEAREST),
    'hu-log-pca-svm, 99 % of the variance': Variant({'variance': 0.99, 'gamma': 1.0, 'c': 10.0}),
    'jamali-naive-bayes-5, overlapping': Variant(apart_s=OVERLAPPING_S),
}
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
# What is tried on one kind of data alone: windows overlap where the published figures are.
PLACES: Mapping[str, str] = {
    **dict.fromkeys(NEEDS_ARRAY, ARRAY),
    **{name: VIBRATION for name, variant in VARIANTS.items() if variant.apart_s == OVERLAPPING_S},
}


@dataclass(frozen=True, eq=False)
class Setting:
    """Slides of one data set as all recipes get them, and how they are split.

    Parameters
    ----------
    dataset
        All slides.
    splits
        Splitters of the slides.
    rate_hz
        Of the vibration.
    of_motion
        Whether recipes may use speed and force.
    """

    dataset: SlideDataset
    splits: Sequence[Split]
    rate_hz: float
    of_motion: bool

    def recipe(self, name: str) -> Recipe:
        """Return a recipe as it is tried here: with the vibration alone where other inputs are missing."""
        if name in VARIANTS:
            recipe = load_recipe(name.partition(', ')[0])
            learner: Any = recipe.learner
            recipe = replace(recipe, learner=replace(learner, **VARIANTS[name].learner))
        else:
            recipe = own_recipe(name)
        whole = set(recipe.feature_set.topics) <= set(self.dataset[0].signals)
        recipe = comparable(
            with_channels(recipe, 'all' if whole else 'fast'), self.rate_hz, of_motion=self.of_motion, augmented=True
        )
        return trained_every(VARIANTS.get(name, SHIPPED).apart_s, recipe)


class _RecipeJob(NamedTuple):
    setting: str
    recipes: tuple[str, ...]


class _RecipeFigures(NamedTuple):
    """The figures of one recipe by split, and the model of the last split; None for what is no recipe of ours."""

    figures: dict[str, dict[str, Any]]
    model: TextureModel | None


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Try all shipped recipes, and variants of some, on all recorded data sets that are there.

    With recipes, estimators or bags of the user's own, try these beside a few of the shipped recipes.
    """
    if options.own_methods or options.own_bags:
        return run_own(options)
    numbers = _numbers(_settings(options), (*_shipped(options), *(() if options.quick else VARIANTS)), options)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / 'recipes.md').write_text(recipe_table(numbers), encoding='utf-8')
    return result_of('recipes', numbers, options)


def _refuse_unfit(names: Sequence[str], setting: Setting) -> None:
    for name in names:
        if not takes_windows(name) and not _fits(name, setting):
            needed = ', '.join(own_recipe(name).feature_set.topics)
            raise InvalidData(f"'{name}' needs {needed}; the slides have {', '.join(setting.dataset[0].signals)}")


def run_own(options: BenchmarkOptions) -> BenchmarkResult:
    """Try the user's own methods beside some shipped recipes, on the user's own slides if there are any.

    Raises
    ------
    InvalidData
        If the slides are too few to be split, or a recipe needs a signal that they lack.
    """
    settings = own_settings(options) if options.own_bags else _settings(options)
    first = next(iter(settings.values()))
    shipped = [name for name in (QUICK_RECIPES[:1] if options.quick else BESIDE) if _fits(name, first)]
    _refuse_unfit(options.own_methods, first)
    tried = _numbers(settings, (*shipped, *options.own_methods), options)
    numbers = {
        setting: {split: {shown_name(name): cell for name, cell in cells.items()} for split, cells in splits.items()}
        for setting, splits in tried.items()
    }
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / 'recipes_own.md').write_text(recipe_table(numbers), encoding='utf-8')
    return result_of('recipes_own', numbers, options)


def own_settings(options: BenchmarkOptions) -> dict[str, Setting]:
    """Return the user's own slides in five folds, or as many as there are slides of the rarest surface."""
    dataset = SlideDataset.from_bags(options.own_bags)
    rate_hz = next(iter(dataset[0].signals.values()))[0].sampling_rate_hz
    return {OWN_DATA: Setting(dataset, [folds_of(dataset, options.seed)], rate_hz, of_motion=tells_motion(dataset))}


def _fits(name: str, setting: Setting) -> bool:
    """Return whether a recipe can be tried: its signals and, where it needs it, the speed are there."""
    try:
        topics = setting.recipe(name).feature_set.topics
    except InvalidParameter:  # of a recipe without vibration on slides that have nothing else
        return False
    return set(topics) <= set(setting.dataset[0].signals) and (name not in NEEDS_ARRAY or setting.of_motion)


def run_later(options: BenchmarkOptions) -> BenchmarkResult:
    """Try the shipped ones on the vibration of later slides alone, in a sixth of the time."""
    setting = biotac20_settings(options)[VIBRATION]
    later = replace(setting, splits=[split for split in setting.splits if split.name == LATER])
    numbers = _numbers({VIBRATION: later}, _shipped(options), options)
    for recipe, figures in numbers[VIBRATION][LATER].items():
        if recipe not in (MINIROCKET, *VARIANTS):
            figures['definition'] = digest_of(recipe)  # of what was measured
    return later_result(numbers, options)


def later_result(numbers: Mapping[str, Any], options: BenchmarkOptions) -> BenchmarkResult:
    """Return the figures of later slides as a result, with the chart of decisions over the sliding time.

    Parameters
    ----------
    numbers
        Figures as plain values.
    options
        Where files are written.

    Returns
    -------
    BenchmarkResult
    """
    result = result_of('recipes_later', numbers, options)
    cells = numbers[VIBRATION][LATER]
    lines = {name: cells[name]['decisions'] for name in OVER_TIME if 'decisions' in cells.get(name, {})}
    path = options.out / 'recipes_later_sliding.png'
    title = 'Recorded slides: decisions of recipes that vote, and of others, when they are made'
    series = {name: (np.array(line['s']), np.array(line['share'])) for name, line in lines.items()}
    return replace(result, charts=(*result.charts, evidence_chart(series, title, path)))


def _shipped(options: BenchmarkOptions) -> Sequence[str]:
    if options.quick:
        return QUICK_RECIPES
    return of_one_finger(path.stem for path in folder('texture_estimation', 'config/recipes').glob('*.yaml'))


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
    jobs = _jobs(settings, names, options)
    timed = {}
    for job, tried in zip(jobs, map_forked(partial(_try, settings, options.seed), jobs), strict=True):
        setting = settings[job.setting]
        for name, (of_splits, model) in tried.items():
            for split, figures in of_splits.items():
                numbers[job.setting][split][name] = figures
            if model:
                timed[job.setting, name] = setting.recipe(name), model, setting.dataset
    for (place, name), latency in latencies_us(timed).items():
        for own in settings[place].splits:
            numbers[place][own.name][name]['latency_us'] = latency
    return numbers


def result_of(name: str, numbers: Mapping[str, Any], options: BenchmarkOptions) -> BenchmarkResult:
    """Draw the chart of the figures by setting, split and recipe, and return all as a result.

    Parameters
    ----------
    name
        Name of the chart and of the figures.
    numbers
        Figures as plain values.
    options
        Where files are written.

    Returns
    -------
    BenchmarkResult
    """
    sets = {setting.partition(',')[0] for setting in numbers}
    splits = {split for of_setting in numbers.values() for split in of_setting}
    return BenchmarkResult(
        name=name,
        measured=(
            'share of single windows recognised; share of slides after so much sliding; share unclassified; mean '
            'computing time of a training (s); time from window to estimate (µs), the quickest of '
            f'{LATENCY_ROUNDS} rounds. Windows of {LENGTH_S} s that do not overlap, trained on as tested; recipes that '
            f'vote over shorter parts keep those, and train on parts {LENGTH_S} s apart; recipes named "overlapping" '
            f'train on windows {OVERLAPPING_S} s apart. Recipes as released, but on biotac20 without speed, force '
            'and stretching: there they belong to the session and not to the surface'
        ),
        data='; '.join(text for name, text in DATA.items() if name in sets),
        split='; '.join(f'{split}: {SPLITS[split]}' if split in SPLITS else split for split in sorted(splits)),
        numbers={'references': REFERENCES, 'MiniRocket': _note(options), **numbers},
        charts=(_chart(numbers, options.out / f'{name}.png', [shown_name(own) for own in options.own_methods]),),
    )


def _settings(options: BenchmarkOptions) -> dict[str, Setting]:
    builders: Mapping[str, Callable[[BenchmarkOptions], dict[str, Setting]]] = {
        'biotac20': biotac20_settings,
        'ntp21': _ntp21,
    }
    present = [name for name in builders if options.data and (options.data / name).is_dir()]
    if not present:
        raise InvalidData(
            f"no recorded data in '{options.data or 'no folder'}'; give the folder of biotac20/ with --data"
        )
    settings: dict[str, Setting] = {}
    for name in present:
        settings |= builders[name](options)
    return settings


def biotac20_settings(options: BenchmarkOptions) -> dict[str, Setting]:
    """Return the vibration alone and all channels of the BioTac's slides."""
    some = (QUICK_SLIDES, QUICK_MATERIALS) if options.quick else ()
    with imported(options, 'biotac20', *some) as bags:
        dataset = SlideDataset.from_bags(bags)
    by_time = Split(LATER, ChronologicalSplit(QUICK_FIRST if options.quick else FIRST))
    at_random = in_random_folds('random', dataset, QUICK_FOLDS if options.quick else FOLDS, options.seed)
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


def _jobs(settings: Mapping[str, Setting], names: Sequence[str], options: BenchmarkOptions) -> list[_RecipeJob]:
    """Return what is tried; recipes with the same windows and features together: they are described once."""
    groups: dict[tuple[str, FeatureSet | str, float, Augmentation], list[str]] = {}
    for setting, name in product(settings, names):
        if takes_windows(name):
            groups.setdefault((setting, name, 0.0, Augmentation()), []).append(name)
        elif setting in (PLACES.get(name, setting), OWN_DATA) and _fits(name, settings[setting]):
            recipe = settings[setting].recipe(name)
            key = (setting, recipe.feature_set, recipe.training.hop_s, recipe.augmentation)
            groups.setdefault(key, []).append(name)
    jobs = [_RecipeJob(setting, tuple(group)) for (setting, *_), group in groups.items()]
    if not options.quick and minirocket.installed() and VIBRATION in settings:
        jobs.append(_RecipeJob(VIBRATION, (MINIROCKET,)))
    return _slowest_first(jobs, settings)


def _slowest_first(jobs: Sequence[_RecipeJob], settings: Mapping[str, Setting]) -> list[_RecipeJob]:
    """Return the jobs in an order in which no core waits at the end."""
    trainings = {name: sum(_count(setting, split) for split in setting.splits) for name, setting in settings.items()}
    return sorted(jobs, key=lambda job: (not any(map(SLOW.search, job.recipes)), -trainings[job.setting]))


def _count(setting: Setting, split: Split) -> int:
    return len(split_slides(setting.dataset, split.splitter, split.groups))


def _try(settings: Mapping[str, Setting], seed: int, job: _RecipeJob) -> dict[str, _RecipeFigures]:
    setting = settings[job.setting]
    if takes_windows(job.recipes[0]):
        [name] = job.recipes
        found = {split.name: try_estimator(setting.dataset, split, name, seed) for split in setting.splits}
        return {name: _RecipeFigures(found, None)}
    if job.recipes == (MINIROCKET,):
        figures = {split.name: minirocket.try_minirocket(setting.dataset, split, seed) for split in setting.splits}
        return {MINIROCKET: _RecipeFigures(figures, None)}
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


def _note(options: BenchmarkOptions) -> str:
    if options.quick:
        return 'not measured in a quick run'
    return 'measured' if minirocket.installed() else minirocket.ABSENT


def _chart(numbers: Mapping[str, Any], path: Path, always: Sequence[str]) -> Path:
    panels = {
        f'{name}, {SPLIT_TITLES.get(split, split)}': {
            recipe: (cell['latency_us']['median'], cell['window_accuracy']) for recipe, cell in of_split.items()
        }
        for name, of_setting in numbers.items()
        for split, of_split in list(of_setting.items())[-1:]
    }
    title = 'Accuracy of all recipes over computing time; orange: most accurate for the time'
    axis_labels = ('computing time of a window (µs)', 'single windows recognised (%)')
    return front_chart(panels, title, axis_labels, path, always=always)
