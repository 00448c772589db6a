"""One slide in one picture: signal, spectrum, evidence, and how often such decisions are right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import welch

from texture_core.arrays import AnyArray, Array, Samples
from texture_evaluation.charts import COLOURS, chart, draw_confusion, line_styles

SHOWN_LABELS = 3
SHOWN_S = 0.5
MARGIN = 0.05


@dataclass(frozen=True, eq=False)
class GrowingEvidence:
    """How the evidence for one label grows while the finger slides.

    Parameters
    ----------
    label
        The label at the end.
    seconds : (n_windows,)
        Sliding time used at the end of each window, s.
    labels
        All labels of the model.
    log_odds : (n_windows, n_labels)
        Natural logarithm of how much more probable `label` is than each label; 0 for itself.
    confidence
        Of the label at the end, as it was reported.
    """

    label: str
    seconds: Array
    labels: Sequence[str]
    log_odds: Array
    confidence: float


@dataclass(frozen=True, eq=False)
class SlideOverview:
    """One slide from the first sample to the decision, and how often such decisions are right.

    Parameters
    ----------
    source
        Where the signal comes from, in words, such as 'simulated TSF-85'.
    surface
        What the finger slid over.
    samples : (n_samples,)
        One channel of the slide.
    rate_hz, unit
        Of the samples.
    evidence
        After each window.
    labels, table
        Confusion of test windows, as `metrics.confusion` counts it.
    others
        Slides over other surfaces, (n_samples,) each, whose spectra are drawn beside for comparison.
    note
        Lines below the panels; '' for none.
    """

    source: str
    surface: str
    samples: Array
    rate_hz: float
    unit: str
    evidence: GrowingEvidence
    labels: Sequence[str]
    table: AnyArray
    others: Mapping[str, Array] = field(default_factory=dict)
    note: str = ''


def picture(overview: SlideOverview, path: str | Path) -> Path:
    """Draw one slide in four panels: signal, spectrum, evidence and confusion."""
    with chart(path, (11.0, 8.0), f'How a slide over {overview.surface} is recognised ({overview.source})') as figure:
        (signal, spectrum), (evidence, table) = figure.subplots(2, 2)
        _signal(signal, overview)
        _spectrum(spectrum, overview)
        _evidence(evidence, overview)
        draw_confusion(table, overview.labels, overview.table)
        table.set_title('4. Single windows of all test slides')
        if overview.note:
            figure.supxlabel(overview.note, fontsize='medium')
    return Path(path)


def _signal(axes: Any, overview: SlideOverview) -> None:
    shown = overview.samples[: round(SHOWN_S * overview.rate_hz)]
    axes.plot(np.arange(len(shown)) / overview.rate_hz, shown, color=COLOURS[0], linewidth=0.8)
    axes.set(xlabel='time since the slide began (s)', ylabel=f'signal ({overview.unit or "no unit"})')
    axes.set_title(f'1. The fingertip vibrates while it slides: the first {SHOWN_S} s')


def _spectrum(axes: Any, overview: SlideOverview) -> None:
    slides = {overview.surface: overview.samples, **overview.others}
    for (name, slide), colour in zip(slides.items(), COLOURS, strict=False):
        samples: Samples = np.asarray(slide, dtype=float)
        n_segment = min(len(samples), round(overview.rate_hz / 2))
        hertz, power = welch(samples, fs=overview.rate_hz, nperseg=n_segment)
        own = name == overview.surface
        axes.semilogy(hertz[1:], power[1:], color=colour, linewidth=1.4 if own else 0.7, label=name, zorder=2 + own)
    unit = f'{overview.unit}²/Hz' if overview.unit else '1/Hz'
    axes.set(xlabel='frequency (Hz)', ylabel=f'power density ({unit})')
    axes.set_title('2. Its spectrum is the mark of the surface')
    if overview.others:
        axes.legend(loc='upper right')


def _evidence(axes: Any, overview: SlideOverview) -> None:
    evidence = overview.evidence
    others = [column for column in np.argsort(evidence.log_odds[-1]) if evidence.labels[column] != evidence.label]
    for column, style in zip(others[:SHOWN_LABELS], line_styles(), strict=False):
        axes.plot(evidence.seconds, evidence.log_odds[:, column], marker='.', label=evidence.labels[column], **style)
    axes.axhline(0, color='grey', linewidth=0.8)
    axes.set(xlabel='sliding time used (s)', ylabel=f'log odds of {evidence.label}', ylim=_with_zero(evidence.log_odds))
    axes.set_xlim(left=0)
    axes.set_title(f'3. Each window adds evidence; reported confidence {evidence.confidence:.2f}')
    axes.legend(loc='lower right', title='compared with')


def _with_zero(values: Array) -> tuple[float, float]:
    """Return limits that hold all values and 0, with a margin."""
    low, high = min(0.0, float(values.min())), max(1.0, float(values.max()))
    margin = MARGIN * (high - low)
    return low - margin, high + margin
