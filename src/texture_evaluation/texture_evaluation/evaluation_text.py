"""The figures of an evaluation as text."""

from __future__ import annotations

from texture_evaluation.cross_validation.comparison import PairedComparison
from texture_evaluation.cross_validation.cross_validation import CrossValidation
from texture_evaluation.evaluate import EvaluationReport


def sentence(one: PairedComparison) -> str:
    """Return a comparison in words."""
    slides, windows = (
        f'{100 * value:+.1f} points ({100 * low:+.1f} to {100 * high:+.1f})'
        for value, (low, high) in (
            (one.slide_difference, one.slide_interval),
            (one.window_difference, one.window_interval),
        )
    )
    return (
        f"'{one.second}' against '{one.first}' on {one.n_slides} slides: slides {slides}, windows {windows}; "
        f'{one.only_second} slides are right by it alone, {one.only_first} by the other alone: '
        f'p = {one.p_value_adjusted:.2g} (exact McNemar test)'
    )


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


def summary(report: EvaluationReport) -> list[str]:
    """Return the figures in lines for people."""
    figures = report.as_json()
    shares = figures['accuracy_at_s'].items()
    at = [f'{percent(share)} after {seconds} s' for seconds, share in shares if share is not None]
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
