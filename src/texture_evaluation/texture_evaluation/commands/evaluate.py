"""`texture evaluate`: say how good a model is on labelled bags, or cross-validate a recipe on them."""

from __future__ import annotations

import argparse
from contextlib import nullcontext

from texture_core.command_options import add_channels, add_seed, add_slides
from texture_core.errors import ModelMismatch
from texture_estimation.model import TextureModel, load_model
from texture_estimation.recipe import load_recipe
from texture_estimation.search.parallel import dask_backend
from texture_evaluation.cross_validation.cross_validate import CrossValidation, cross_validate
from texture_evaluation.cross_validation.splits import parse_split
from texture_evaluation.evaluate import EvaluationReport, evaluate
from texture_evaluation.train import FAST_TOPIC, with_channels
from texture_recordings.slide_dataset import SlideDataset


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('model', help='a trained model; with --cross-validate the name or path of a recipe')
    parser.add_argument('bags', nargs='+', help='labelled bags, or folders of bags')
    parser.add_argument('--json', metavar='FILE', help='write the figures there, too')
    parser.add_argument(
        '--cross-validate',
        metavar='SPLIT',
        help='train and test a recipe on splits of the slides: stratified:5, leave-one-out:speed, chronological:0.75 '
        'or random:20',
    )
    parser.add_argument('--jobs', type=int, default=1, metavar='N', help='folds computed at once; -1: one per core')
    parser.add_argument(
        '--dask', default='', metavar='ADDRESS', help='scheduler of a Dask cluster to use instead, or local:WORKERS'
    )
    add_slides(parser)
    add_channels(parser)
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Evaluate, print the figures, and write them if asked to."""
    if options.cross_validate:
        return run_cross_validation(options)
    model = load_model(options.model)
    if options.channels == 'fast':
        refuse_slow_channels(model)
    report = evaluate(model, options.bags, options.slides)
    for line in summary(report):
        print(line)
    if options.json:
        report.write(options.json)
    return 0


def run_cross_validation(options: argparse.Namespace) -> int:
    """Cross-validate, print a table, and write the figures if asked to."""
    split = parse_split(options.cross_validate, options.seed)
    recipe = with_channels(load_recipe(options.model), options.channels or 'all')
    dataset = SlideDataset.from_bags(options.bags, options.slides, topics=recipe.feature_set.topics)
    with dask_backend(options.dask) if options.dask else nullcontext():
        n_jobs = None if options.dask else options.jobs
        result = cross_validate(recipe, dataset, split.splitter, n_jobs, groups=split.groups)
    for line in table(result, split.name):
        print(line)
    if options.json:
        result.write(options.json)
    return 0


def table(result: CrossValidation, split: str) -> list[str]:
    """Return a row for each fold and one for all, in lines for people."""
    figures = result.as_json()
    rows = [(fold['name'], fold) for fold in figures['folds']] + [('all', figures)]
    width = max(len('fold'), *(len(name) for name, _ in rows))
    lines = [
        f"recipe '{result.recipe}', split {split}: {len(result.labels)} surfaces",
        f'{"fold":<{width}}  {"slides":>6}  {"windows right":>13}  {"slides right":>12}',
    ]
    lines += [
        f'{name:<{width}}  {row["n_slides"]:>6}  {percent(row["window_accuracy"]):>13}  '
        f'{percent(row["slide_accuracy"]):>12}'
        for name, row in rows
    ]
    windows, slides = (' to '.join(map(percent, figures[f'{name}_accuracy_interval'])) for name in ('window', 'slide'))
    lines.append(f'95 % intervals over all slides: windows {windows}; slides {slides}')
    if result.unusable:
        lines.append(f'without a usable window, and not counted: {", ".join(result.unusable)}')
    return lines


def refuse_slow_channels(model: TextureModel) -> None:
    """Raise ModelMismatch if a model needs more than the vibration.

    Raises
    ------
    ModelMismatch
        If it does.
    """
    slow = [topic for topic in model.recipe.feature_set.topics if topic != FAST_TOPIC]
    if slow:
        raise ModelMismatch(
            f"model '{model.name}' needs {', '.join(slow)}, which '--channels fast' leaves out; "
            "train one with '--channels fast', or evaluate it with all channels"
        )


def summary(report: EvaluationReport) -> list[str]:
    """Return the figures in lines for people."""
    figures = report.as_json()
    at = [
        f'{percent(share)} after {seconds} s'
        for seconds, share in figures['accuracy_at_s'].items()
        if share is not None
    ]
    early, latency = figures['early'], figures['latency_us']
    lines = [
        f'slides: {len(report.known)} over surfaces the model knows, {len(report.unknown)} over others',
        f'single windows right: {percent(figures["window_accuracy"])}',
        f'slides right: {", ".join(at) or "no slide is long enough to say"}',
        f'decided once certain: {percent(early["accuracy"])} right'
        + (f', after {early["mean_s"]:.2f} s on average' if early['mean_s'] is not None else ''),
        f'computing time of a window: {latency["median"]:.0f} µs median, {latency["p99"]:.0f} µs 99th percentile',
    ]
    wrong, unknown = figures['wrong_known'], figures['unknown']
    lines.append(
        f'wrong but taken for known: {percent(wrong["early"])} once decided, {percent(wrong["final"])} at the end; '
        f'taken for unknown: {percent(unknown["early"])}, {percent(unknown["final"])}'
    )
    if figures['unknown_accepted'] is not None:
        lines.append(f'unknown surfaces taken for known ones: {percent(figures["unknown_accepted"])}')
    if report.unusable:
        lines.append(f'without a usable window, and not counted: {", ".join(report.unusable)}')
    return lines


def percent(share: float | None) -> str:
    """Return a share in per cent, or a dash if there is none."""
    return '–' if share is None else f'{100 * share:.1f} %'
