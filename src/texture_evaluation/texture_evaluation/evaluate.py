# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Evaluate a model on labelled bags, slide by slide, as in live operation."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.errors import ModelMismatch, counted
from texture_core.types import AnyArray, Array, FeatureVector, TextureEstimate
from texture_estimation.evidence import EvidenceAccumulator, single_decisions
from texture_estimation.model import TextureModel
from texture_evaluation import metrics
from texture_evaluation.cross_validation import (
    NO_PLACE,
    CrossValidation,
    PairedComparison,
    bags_compared,
    figures,
)
from texture_evaluation.metrics import SlideResult
from texture_evaluation.train import not_counted, slide_digests
from texture_features.feature_set import fingerprint_difference
from texture_features.windows import WindowEvent
from texture_recordings.dataset import SlideDataset, no_window
from texture_recordings.slides import LabelledSlide


@dataclass(frozen=True, eq=False)
class EvaluationReport:
    """How well a model recognises the surfaces in bags."""

    labels: tuple[str, ...]
    known: Sequence[SlideResult]
    unknown: Sequence[SlideResult]
    latency_us: Array
    unusable: tuple[str, ...] = ()
    tare_faults: tuple[str, ...] = ()
    shift: str = NO_PLACE
    slides_in_training: tuple[str, ...] = ()  # of the tested ones, by their samples
    clusters: Sequence[str] | None = None
    too_little_training: str = ''  # how many slides there are and how many are needed

    @property
    def confusion(self) -> AnyArray:
        """How many windows of each surface (row) got each label (column)."""
        return metrics.confusion(self.known, self.labels)

    @property
    def tested(self) -> list[str]:
        """Labels of the slides, with training or without."""
        return sorted({result.surface for result in (*self.known, *self.unknown)})

    def as_json(self) -> dict[str, Any]:
        """Return the figures; null where there is no slide, or none was decided."""
        median, p99 = np.percentile(self.latency_us, (50, 99))
        wrong, rejected = metrics.accepted_wrong(self.known), metrics.rejected(self.known)
        decided = metrics.ended_early(self.known)
        return {
            'shift': self.shift,
            'slides_in_training': list(self.slides_in_training),
            'too_little_training': self.too_little_training,
            **figures(self.known, self.clusters),
            'early': metrics.early_decision(self.known) if decided else None,
            'calibration_error': metrics.calibration_error(self.known),
            'n_unknown': len(self.unknown),
            'unknown_accepted': metrics.accepted_wrong(self.unknown)['final'],
            'unknown_ended_early': metrics.ended_early(self.unknown),
            'labels': list(self.labels),
            'tested': self.tested,
            'confusion': self.confusion.tolist(),
            'latency_us': {'median': float(median), 'p99': float(p99)},
            'once_decided': {'accepted_wrong': wrong['early'], 'rejected': rejected['early']} if decided else None,
            'rejected': rejected['final'],
            'rejections_of_untrained': metrics.rejections(self.unknown),
        }


def evaluate(
    model: TextureModel, bags: Iterable[str | Path], slides: str = '', namespace: str | None = None
) -> EvaluationReport:
    """Return how a model does on the labelled slides of bags.

    Parameters
    ----------
    model
        Whose feature set cuts and describes the windows.
    bags
        Bags, or folders of bags.
    slides
        Which slides of each surface, such as '31-40'; '' for all. Surfaces without training are unknown ones.
    namespace
        Namespace of the finger, if bags hold several.

    Returns
    -------
    EvaluationReport

    Raises
    ------
    ModelMismatch
        If inputs, rates or channels in the bags are not those that the model was trained on.
    InvalidData
        If a bag cannot be read or no slide is usable.
    """
    topics = model.recipe.feature_set.topics
    return evaluate_dataset(model, SlideDataset.from_bags(bags, slides, namespace, topics=topics))


def evaluate_dataset(model: TextureModel, dataset: SlideDataset) -> EvaluationReport:
    """Return how a model does on labelled slides."""
    by_digest = slide_digests(dataset)
    tested = {slide: _test(model, slide, events) for slide, events in dataset.windows(model.recipe.feature_set)}
    results = {slide: result for slide, (result, _) in tested.items() if result.estimates}
    if not results:
        raise no_window(dataset, model.recipe.feature_set)
    sessions, digests = (model.training.get(name, ()) for name in ('sessions', 'slide_digests'))
    known = [slide for slide in results if slide.surface in model.labels]
    return EvaluationReport(
        labels=model.labels,
        known=[results[slide] for slide in known],
        unknown=[result for slide, result in results.items() if slide.surface not in model.labels],
        latency_us=np.concatenate([latency for _, latency in tested.values()]),
        unusable=tuple(slide.name for slide in tested if slide not in results),
        tare_faults=tuple(dataset.tare_faults(model.recipe.feature_set)),
        shift=f'{bags_compared([(sessions, [slide.session for slide in results])])}; {NO_PLACE}',
        slides_in_training=tuple(slide.name for one, slide in by_digest.items() if one in digests and slide in results),
        too_little_training=model.acceptance.reason,
        clusters=[one.name if one.session in sessions else f'{one.surface} {one.session}' for one in known],
    )


def run_model(
    model: TextureModel, events: Iterable[WindowEvent], clock: Callable[[], float] = time.perf_counter
) -> tuple[list[FeatureVector], list[TextureEstimate], Array]:
    """Return vector, estimate and time (µs, by the clock) of each window and of the end of one slide, one by one.

    Parameters
    ----------
    model
        Trained model.
    events
        Windows of one slide and its end, in order.
    clock
        Gives the time in s.

    Returns
    -------
    list of FeatureVector
        One for each event.
    list of TextureEstimate
        One for each event.
    (n_events,)
        From window to estimate, µs.
    """
    evidence = EvidenceAccumulator(model)
    vectors, estimates, taken_us = [], [], []
    for event in events:
        start = clock()
        vector = model.recipe.feature_set.extract(event)
        estimate = evidence.update(vector)
        taken_us.append(1e6 * (clock() - start))
        vectors.append(vector)
        estimates.append(estimate)
    return vectors, estimates, np.array(taken_us)


def _test(model: TextureModel, slide: LabelledSlide, events: Sequence[WindowEvent]) -> tuple[SlideResult, Array]:
    """Return the estimate for each usable window of a slide, and the computing times of all."""
    # By the processor's clock: the machine may be busy.
    vectors, estimates, taken_us = run_model(model, events, time.process_time)
    used, received, before = [], [], 0
    for vector, estimate in zip(vectors, estimates, strict=True):
        if not vector.last and vector.feature_set != model.feature_set:
            difference = fingerprint_difference(vector.feature_set, model.feature_set)
            raise ModelMismatch(
                f"model '{model.name}' does not fit slide '{slide.name}' in '{slide.bag}': {difference}"
            )
        # A window without a usable value adds no evidence, and counts nowhere.
        if estimate.windows > before and not vector.last:
            used.append(vector.values)
            received.append(estimate)
        before = estimate.windows
    alone = single_decisions(model, np.stack(used)) if used else []
    final = next((estimate for estimate in reversed(estimates) if estimate.final), None)
    return SlideResult(slide.surface, alone, received, final, model.recipe.evidence.group), taken_us


# --------------------
# The figures of an evaluation as text.


LEVEL = 0.05  # of significance


def sentence(one: PairedComparison) -> str:
    """Return a comparison in words: intervals by bootstrap are too narrow for few clusters, so the test decides."""
    slides, windows = (
        f'{100 * value:+.1f} points ({100 * low:+.1f} to {100 * high:+.1f})'
        for value, (low, high) in (
            (one.slide_difference, one.slide_interval),
            (one.window_difference, one.window_interval),
        )
    )
    test = 'exact McNemar test'
    if one.n_clusters != one.n_slides:
        test = f'exact sign test over {one.n_clusters} clusters'
    return (
        f"'{one.second}' against '{one.first}' on {one.n_slides} slides: slides {slides}, windows {windows}; "
        f'{one.only_second} slides are correct by it only, {one.only_first} by the other only: '
        f'p = {one.p_value:.2g} ({test}, which decides: {"a" if one.p_value < LEVEL else "no"} difference is shown)'
    )


COLUMNS = {
    'window accuracy': 'window_accuracy',
    'slide accuracy': 'slide_accuracy',
    'accepted and correct': 'accepted_correct',
    'accepted but wrong': 'accepted_wrong',
}


def table(result: CrossValidation, split: str) -> list[str]:
    """Return a row for each fold and one for all, in lines for people."""
    figures = result.as_json()
    rows = [(fold['name'], fold) for fold in figures['folds']] + [('all', figures)]
    width = max(len('fold'), *(len(name) for name, _ in rows))
    lines = [
        f"recipe '{result.recipe}', split {split}: {counted(len(result.labels), 'surface')}; {result.shift}",
        f'{"fold":<{width}}  {"slides":>6}' + ''.join(f'  {title:>20}' for title in COLUMNS),
    ]
    lines += [
        f'{name:<{width}}  {row["n_slides"]:>6}' + ''.join(f'  {percent(row[key]):>20}' for key in COLUMNS.values())
        for name, row in rows
    ]
    intervals = (
        f'{title} {" to ".join(map(percent, figures[f"{key}_interval"]))}'
        for title, key in COLUMNS.items()
        if figures[key] is not None
    )
    lines.append(f'95 % intervals over {figures["n_clusters"]} {result.intervals_over}: {"; ".join(intervals)}')
    lines.append(by_reason(figures['rejections']))
    if result.untested:
        names = ', '.join(f"'{surface}' ({count} slides)" for surface, count in result.untested.items())
        lines.append(f'trained but not tested, as no other slide would train them: {names}')
    return [*lines, *not_counted(result.unusable), *filter(None, [result.too_little_training])]


def by_reason(rejections: Mapping[str, int]) -> str:
    """Return how many slides were rejected for each reason, in words."""
    counts = ', '.join(f'{count} {reason.replace("_", " ")}' for reason, count in rejections.items())
    return f'slides rejected at the end: {counts or "none"}'


ENDS = {
    'accuracy': 'slide_accuracy',
    'accepted and correct': 'accepted_correct',
    'accepted but wrong': 'accepted_wrong',
    'rejected': 'rejected',
}


def summary(report: EvaluationReport) -> list[str]:
    """Return the figures in lines for people."""
    figures = report.as_json()
    at = [
        f'{percent(fraction)} after {seconds} s ({figures["n_slides_at_s"][seconds]} slides)'
        for seconds, fraction in figures['accuracy_at_s'].items()
        if fraction is not None
    ]
    early, latency = figures['early'], figures['latency_us']
    undecided = 'none over trained surfaces' if figures['unknown_ended_early'] else 'never decided'
    lines = [
        f'slides: {len(report.known)} over trained surfaces, {len(report.unknown)} over others',
        f'training and test, by the names of the bags: {report.shift}',
        *(
            [
                f'accuracy of single windows: {percent(figures["window_accuracy"])}',
                f'accuracy of slides: {", ".join(at) or "no slide is long enough"}',
            ]
            if report.known
            else [
                'no tested surface was trained, so there is no accuracy: trained are '
                f'{", ".join(report.labels)}; tested are {", ".join(report.tested)}'
            ]
        ),
        f'as soon as decided: accuracy {percent(early["accuracy"])}, after {early["mean_s"]:.2f} s on average'
        if figures['once_decided']
        else f'as soon as decided: {undecided}',
        f'processor time of a window: {latency["median"]:.0f} µs median, {latency["p99"]:.0f} µs 99th percentile',
    ]
    if report.known:
        of = f'of the {len(report.known)} slides over trained surfaces'
        for when, ends in (('at the end', figures), ('once decided', figures['once_decided'] or {})):
            shown = [f'{name} {percent(ends[key])}' for name, key in ENDS.items() if key in ends]
            lines += [f'{of}, {when}: {", ".join(shown)}'] if shown else []
        lines.append(by_reason(figures['rejections']))
    if report.unknown:
        accepted, ended = percent(figures['unknown_accepted']), percent(figures['unknown_ended_early'])
        lines.append(
            f'of the {len(report.unknown)} slides over other surfaces: accepted at the end {accepted}, with early '
            f'stopping ended early and accepted {ended}; {by_reason(figures["rejections_of_untrained"])}'
        )
    if report.slides_in_training:
        lines.append(
            f'{len(report.slides_in_training)} of {len(report.known)} slides were in the training, so these figures '
            'are optimistic; leave them out with --slides'
        )
    return [*lines, *not_counted(report.unusable), *report.tare_faults, *filter(None, [report.too_little_training])]


def percent(fraction: float | None) -> str:
    """Return a fraction in per cent, or a dash if there is none."""
    return '–' if fraction is None else f'{100 * fraction:.1f} %'
