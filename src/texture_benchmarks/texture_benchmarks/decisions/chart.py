"""Charts of early decisions, calibration and unknown surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from texture_benchmarks.charts import line_chart
from texture_benchmarks.decision_times import decided_at
from texture_benchmarks.decisions.trial import (
    TESTED,
    TRAINED,
    UNKNOWN,
    Trial,
)
from texture_core.arrays import Array
from texture_evaluation.metrics import SlideResult

CONFIDENCES = (0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97, 0.98, 0.99, 0.995, 0.999)


def charts(trials: dict[str, Trial], out: Path) -> tuple[Path, ...]:
    """Draw early decisions, the calibration, and unknown slides accepted against known ones rejected."""
    draws = len(next(iter(trials.values())).draws)
    where = f'BioTac, 20 materials, trained on slides {TRAINED}, tested on {TESTED}'
    early = {f'{name}: ends at a confidence': _by_confidence(trial.results) for name, trial in trials.items()}
    early |= {f'{name}: fitted stopping rule': _point(trial.figures['early']) for name, trial in trials.items()}
    return (
        line_chart(
            early,
            f'Early stopping\n{where}',
            ('mean sliding time (s)', 'slides right (%)'),
            out / 'decisions_early.png',
        ),
        line_chart(
            {
                **{name: _reliability(trial.results) for name, trial in trials.items()},
                'perfect calibration': (np.array([30.0, 100.0]), np.array([30.0, 100.0])),
            },
            f'Calibration of the confidence\n{where}',
            ('mean confidence (%)', 'estimates that are right (%)'),
            out / 'decisions_calibration.png',
        ),
        line_chart(
            {name: tuple(100.0 * trial.draws[:, :-1].mean(axis=0).T) for name, trial in trials.items()},
            f'{UNKNOWN} materials unknown, after 2.5 s of sliding; mean of {draws} draws\n{where}',
            ('slides of known materials rejected (%)', 'slides of unknown materials accepted (%)'),
            out / 'decisions_unknown.png',
        ),
    )


def _by_confidence(results: Sequence[SlideResult]) -> tuple[Array, Array]:
    """Return mean time (s) and accuracy (%) of slides that end at a confidence, (n,) each."""
    times, shares = decided_at(results, CONFIDENCES)
    return times, 100.0 * shares


def _point(early: dict[str, float]) -> tuple[Array, Array]:
    return np.array([early['mean_s']]), np.array([100.0 * early['accuracy']])


def _reliability(results: Sequence[SlideResult]) -> tuple[Array, Array]:
    """Return mean confidence and accuracy (%) in tenths of the confidence that hold 20 estimates or more."""
    reported = np.array([(e.confidence, e.label == r.surface) for r in results for e in r.estimates], dtype=np.float64)
    bins = np.minimum((10.0 * reported[:, 0]).astype(int), 9)
    used = [reported[bins == number] for number in range(10) if np.count_nonzero(bins == number) >= 20]
    confidence, right = 100.0 * np.array([part.mean(axis=0) for part in used]).reshape(-1, 2).T
    return confidence, right
