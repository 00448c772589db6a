# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sub-commands of `texture` that measure: `evaluate` a model on labelled bags, `cross-validate` recipes."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import nullcontext
from importlib.metadata import version
from itertools import takewhile
from pathlib import Path

from texture_core.cli import Command, add_bag_namespace, add_dask, add_seed, add_slides, core_count
from texture_core.config import check_outputs, shipped, write_json
from texture_core.errors import InvalidParameter, counted
from texture_estimation.model import both_files, load_model
from texture_estimation.recipe import load_recipe
from texture_evaluation.charts import refuse_chart_format
from texture_evaluation.cross_validation import (
    compare,
    comparison_chart,
    cross_validate,
    dask_backend,
    parse_split,
)
from texture_evaluation.evaluate import evaluate, sentence, summary, table
from texture_recordings.dataset import SlideDataset, cut_slide


def _configure_evaluate(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('model', help='a trained model')
    parser.add_argument('bags', nargs='+', help='labelled bags, or folders of bags')
    parser.add_argument('--json', metavar='FILE', help='also write the figures there')
    add_slides(parser)
    add_bag_namespace(parser)


def _evaluate(options: argparse.Namespace) -> int:
    """Evaluate, print the figures, and write them with --json."""
    check_outputs([options.json], [*both_files(options.model), *options.bags])
    model = load_model(options.model)
    report = evaluate(model, options.bags, options.slides, options.namespace)
    print('\n'.join(summary(report)))
    if options.json:
        setting = {
            'model': options.model,
            'recipe': model.recipe.name,
            'feature_set': model.feature_set,
            'version': version('texture_evaluation'),
            'bags': options.bags,
            'slides': options.slides or 'all',
        }
        write_json({**setting, **report.as_json()}, options.json)
    return 0


def _configure_cross_validate(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        'split',
        help='how slides are split: stratified:5, leave-one-out:speed, leave-one-out:place:4 (quarters of the path), '
        'chronological:0.75 or random:20',
    )
    parser.add_argument('recipe', help='name of a shipped recipe, or path of a recipe; more may follow')
    parser.add_argument('bags', nargs='+', help='labelled bags, or folders of bags')
    parser.add_argument('--json', metavar='FILE', help='also write the figures there')
    parser.add_argument('--chart', metavar='FILE', help='draw the recipes there; .png, .svg or .pdf')
    parser.add_argument(
        '--jobs', type=core_count, default=1, metavar='N', help='folds computed at once; -1: one per core'
    )
    add_dask(parser)
    add_slides(parser)
    add_bag_namespace(parser)
    add_seed(parser)


def _cross_validate(options: argparse.Namespace) -> int:
    """Cross-validate one recipe or several, print tables and comparisons, and write and draw them on request."""
    split = parse_split(options.split, options.seed)
    names, bags = recipes_and_bags([options.recipe, *options.bags])
    # Files that cannot be written or would be lost are refused before hours of training, not after them.
    check_outputs([options.json, options.chart], [*names, *bags])
    if options.chart:
        refuse_chart_format(options.chart)
    recipes = [load_recipe(name) for name in names]
    topics = dict.fromkeys(topic for recipe in recipes for topic in recipe.feature_set.topics)
    dataset = split.cut(SlideDataset.from_bags(bags, options.slides, options.namespace, topics=tuple(topics)))
    for recipe in recipes:  # one that lacks a stream is refused before the others are computed
        cut_slide(dataset[0], recipe.feature_set)
    with dask_backend(options.dask) if options.dask else nullcontext():
        jobs = None if options.dask else options.jobs
        results = [cross_validate(recipe, dataset, split.splitter, jobs, groups=split.groups) for recipe in recipes]
    compared = [compare(results[0], other) for other in results[1:]]
    print('\n'.join([*(line for result in results for line in table(result, split.name)), *map(sentence, compared)]))
    if options.json:
        figures = [result.as_json() for result in results]
        setting = {'split': split.name, 'seed': options.seed, 'bags': bags, 'slides': options.slides or 'all'}
        write_json({**setting, 'recipes': figures, 'comparisons': [vars(one) for one in compared]}, options.json)
    if options.chart:
        of = ', '.join(Path(bag).name for bag in bags)
        surfaces = counted(len(results[0].labels), 'surface')
        title = f'{of}: {counted(len(dataset), "slide")} of {surfaces}, split {split.name}'
        print(comparison_chart(results, f'{title}; {results[0].shift}', options.chart))
    return 0


def recipes_and_bags(given: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the recipes and the bags: the first is a recipe, and so are shipped names and .yaml files behind it."""
    known = set(shipped('texture_estimation', 'config/recipes'))
    recipes = [given[0], *takewhile(lambda name: name in known or name.endswith('.yaml'), given[1:])]
    if len(recipes) == len(given):
        raise InvalidParameter(f'{", ".join(given)} are recipes; name the bags behind them')
    return recipes, list(given[len(recipes) :])


evaluate_ = Command('evaluate a model on labelled bags', _configure_evaluate, _evaluate)
cross_validate_ = Command(
    'train and test recipes on splits of labelled bags', _configure_cross_validate, _cross_validate
)
