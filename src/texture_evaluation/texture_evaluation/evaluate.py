"""Evaluate a model on labelled bags, slide by slide, as in live operation."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.errors import ModelMismatch
from texture_core.estimates import TextureEstimate
from texture_core.features import FeatureVector
from texture_estimation.evidence import EvidenceAccumulator, single_decisions
from texture_estimation.fingerprint import fingerprint_difference
from texture_estimation.model import TextureModel
from texture_evaluation import metrics
from texture_evaluation.metrics import SlideResult
from texture_features.windowing.windows import WindowEvent
from texture_recordings.labelled_slide import LabelledSlide
from texture_recordings.slide_dataset import SlideDataset, no_window


@dataclass(frozen=True, eq=False)
class EvaluationReport:
    """How well a model recognises the surfaces in bags.

    Parameters
    ----------
    labels
        Surfaces that the model knows.
    known, unknown
        Results of the slides over these surfaces, and over others.
    latency_us : (n_windows,)
        Computing time of each window, from samples to estimate.
    unusable
        Names of slides without a usable window, which count nowhere.
    """

    labels: tuple[str, ...]
    known: Sequence[SlideResult]
    unknown: Sequence[SlideResult]
    latency_us: Array
    unusable: tuple[str, ...] = ()

    @property
    def confusion(self) -> AnyArray:
        """How many windows of each surface (row) were taken for each label (column)."""
        return metrics.confusion(self.known, self.labels)

    def as_json(self) -> dict[str, Any]:
        """Return the figures; null where no slide tells."""
        nothing = {'accuracy': None, 'mean_s': None}
        median, p99 = np.percentile(self.latency_us, (50, 99))
        return {
            'window_accuracy': metrics.window_accuracy(self.known) if self.known else None,
            'accuracy_at_s': metrics.accuracy_at_times(self.known),
            'early': metrics.early_decision(self.known) if self.known else nothing,
            'calibration_error': metrics.calibration_error(self.known),
            'candidates': metrics.candidates(self.known),
            'falsely_rejected': metrics.falsely_rejected(self.known),
            'unknown_accepted': metrics.unknown_accepted(self.unknown),
            'labels': list(self.labels),
            'confusion': self.confusion.tolist(),
            'latency_us': {'median': float(median), 'p99': float(p99)},
            'unclassified': {
                'windows': metrics.unclassified_windows(self.known) if self.known else None,
                'at_s': metrics.unclassified_at_times(self.known),
            },
            'wrong_known': metrics.wrong_known([*self.known, *self.unknown]),
            'unknown': metrics.unknown([*self.known, *self.unknown]),
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
        Of the finger, if bags hold several.

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
    return evaluate_dataset(model, SlideDataset.from_bags(bags, slides, namespace, model.recipe.feature_set.topics))


def evaluate_dataset(model: TextureModel, dataset: SlideDataset) -> EvaluationReport:
    """Return how a model does on labelled slides.

    Parameters
    ----------
    model
        Whose feature set cuts and describes the windows.
    dataset
        The slides; surfaces that were not in the training set are unknown ones.

    Raises
    ------
    ModelMismatch
        If inputs, rates or channels are not those that the model was trained on.
    InvalidData
        If no slide is usable.
    """
    tested = {slide: _test(model, slide, events) for slide, events in dataset.windows(model.recipe.feature_set)}
    results = {slide: result for slide, (result, _) in tested.items() if result.estimates}
    if not results:
        raise no_window(dataset, model.recipe.feature_set)
    return EvaluationReport(
        labels=model.labels,
        known=[result for slide, result in results.items() if slide.surface in model.labels],
        unknown=[result for slide, result in results.items() if slide.surface not in model.labels],
        latency_us=np.concatenate([latency for _, latency in tested.values()]),
        unusable=tuple(slide.name for slide in tested if slide not in results),
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
    """Return what the model says of each usable window of a slide, and the computing times of all."""
    vectors, estimates, taken_us = run_model(model, events)
    used, received, before = [], [], 0
    for vector, estimate in zip(vectors, estimates, strict=True):
        _check_features(model, slide, vector)
        if estimate.windows > before and not vector.last:
            used.append(vector.values)
            received.append(estimate)
        before = estimate.windows
    alone = single_decisions(model, np.stack(used)) if used else []
    final = next((estimate for estimate in reversed(estimates) if estimate.final), None)
    return SlideResult(slide.surface, alone, received, final, model.recipe.evidence.group), taken_us


def _check_features(model: TextureModel, slide: LabelledSlide, vector: FeatureVector) -> None:
    """Raise ModelMismatch if the features of a window are not those of the model."""
    if not vector.last and vector.feature_set != model.feature_set:
        difference = fingerprint_difference(vector.feature_set, model.feature_set)
        raise ModelMismatch(f"model '{model.name}' does not fit slide '{slide.name}' in '{slide.bag}': {difference}")
