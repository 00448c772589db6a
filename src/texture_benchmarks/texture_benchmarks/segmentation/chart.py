"""Charts of where sliding is found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.segmentation.trial import SegmentationTrial
from texture_core.arrays import Array
from texture_evaluation.charts import COLOURS, chart


@dataclass(frozen=True, eq=False)
class DetectedSlides:
    """A vibration as recorded, (n_samples,), and the stretches in which it was found to slide, s."""

    samples: Array
    rate_hz: float
    spans: Sequence[tuple[float, float]]


def error_strength_chart(trials: Mapping[str, Sequence[SegmentationTrial]], target_s: float, path: str | Path) -> Path:
    """Draw the errors of start and end against how much stronger the vibration is than the noise, a colour a scene.

    Parameters
    ----------
    trials
        Scene → slides.
    target_s
        Allowed error.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (9.0, 4.2), 'Start and end of sliding, found from the signal alone (simulated)') as figure:
        for axes, name in zip(figure.subplots(1, 2, sharex=True, sharey=True), ('start', 'end'), strict=True):
            for colour, (scene, listed) in zip(COLOURS, trials.items(), strict=False):
                errors = [1000 * abs(getattr(trial, f'{name}_error_s')) for trial in listed]
                strength = [trial.strength for trial in listed]
                axes.plot(strength, np.maximum(errors, 0.1), '.', color=colour, label=scene, alpha=0.6, markersize=5)
            axes.axhline(1000 * target_s, color='k', linewidth=1, linestyle='--')
            axes.set(xscale='log', yscale='log', title=name, xlabel='power of the slide, as a multiple of the noise')
        _left(figure.axes[0], 'error (ms)')
        figure.axes[1].legend(loc='upper right', fontsize=8, ncols=2, bbox_to_anchor=(1.0, 1.06))
    return Path(path)


def found_chart(recordings: Mapping[str, DetectedSlides], title: str, path: str | Path) -> Path:
    """Draw recordings below each other, with the stretches of sliding shaded.

    Parameters
    ----------
    recordings
        Name of the recording → its signal and the slides in it.
    title
        Above the chart.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (9.0, 0.6 + 1.1 * len(recordings)), title) as figure:
        rows = figure.subplots(len(recordings), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (name, found) in zip(rows, recordings.items(), strict=True):
            times = np.arange(len(found.samples)) / found.rate_hz
            axes.plot(times, found.samples, color=COLOURS[6], linewidth=0.3)
            for begin_s, end_s in found.spans:
                axes.axvspan(begin_s, end_s, color=COLOURS[1], alpha=0.35, linewidth=0)
            _left(axes, name)
            axes.grid(visible=False)
        rows[-1].set_xlabel('time (s)')
    return Path(path)


def _left(axes: Any, text: str) -> None:
    axes.set_ylabel(text, fontsize=8)
