"""`texture evaluate`: say how good a model is on labelled bags."""

from __future__ import annotations

import argparse

from texture_core.command_options import add_channels, add_seed, add_slides
from texture_core.errors import ModelMismatch
from texture_estimation.model import TextureModel, load_model
from texture_evaluation.evaluate import EvaluationReport, evaluate
from texture_evaluation.train import FAST_TOPIC


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('model', help='a trained model')
    parser.add_argument('bags', nargs='+', help='labelled bags, or folders of bags')
    parser.add_argument('--json', metavar='FILE', help='write the figures there, too')
    add_slides(parser)
    add_channels(parser)
    add_seed(parser)


def run(options: argparse.Namespace) -> int:
    """Evaluate, print the figures, and write them if asked to."""
    model = load_model(options.model)
    if options.channels == 'fast':
        refuse_slow_channels(model)
    report = evaluate(model, options.bags, options.slides)
    for line in summary(report):
        print(line)
    if options.json:
        report.write(options.json)
    return 0


def refuse_slow_channels(model: TextureModel) -> None:
    """Raise ModelMismatch if a model needs more than the vibration."""
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
    if figures['unknown_accepted'] is not None:
        lines.append(f'unknown surfaces taken for known ones: {percent(figures["unknown_accepted"])}')
    if report.unusable:
        lines.append(f'without a usable window, and not counted: {", ".join(report.unusable)}')
    return lines


def percent(share: float | None) -> str:
    """Return a share in per cent, or a dash if there is none."""
    return '–' if share is None else f'{100 * share:.1f} %'
