"""Charts of what is recognised at speeds, forces and in directions that were not in the training set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.speed_force.held_out import HeldOutResult
from texture_evaluation.charts import COLOURS, chart
from texture_features.features.mean_spatial_bands import MeanSpatialBands
from texture_recordings.slide_samples import SlideSamples

BEHIND = {'facecolor': 'white', 'edgecolor': 'none', 'pad': 0.5}
MARKERS = 'osD^v'
FINE = MeanSpatialBands(bands=64, floor=1e-9)

Methods = Mapping[str, Mapping[str, HeldOutResult]]


def held_out_chart(panels: Mapping[str, tuple[Methods, Mapping[str, float]]], path: str | Path) -> Path:
    """Draw the share recognised by what was left out, a marker for each method, and the goals.

    Parameters
    ----------
    panels
        Title → method → what was left out → outcome; and the goal by what was left out.
    """
    with chart(
        path, (10.0, 2.2 * len(panels) + 0.8), 'Slides recognised under conditions that were not in the training set'
    ) as figure:
        for axes, (title, (methods, goals)) in zip(figure.subplots(len(panels), 1), panels.items(), strict=True):
            _methods(axes, methods, goals)
            axes.set_title(title)
        figure.axes[-1].set_xlabel('slides recognised (%)')
    return Path(path)


WINDOW_TITLE = 'Single windows of 0.6 s at a speed that was not in the training set (ntp21)\nTrained on windows of …'


def window_chart(outcomes: Mapping[str, HeldOutResult], goal: float, path: str | Path) -> Path:
    """Draw the share of single windows recognised by the speed left out, a line for each way of adding examples.

    Parameters
    ----------
    outcomes
        Way of adding examples → shares by speed.
    goal
        Share that is drawn as a line, 0 to 1.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (7.0, 4.2)) as figure:
        axes = figure.subplots()
        for (trained, outcome), colour, marker in zip(outcomes.items(), COLOURS, MARKERS, strict=False):
            speeds = [float(name) for name in outcome.right]
            share = [100 * part.mean() for part in outcome.right.values()]
            label = f'{trained}: {100 * outcome.accuracy:.1f} % on average'
            axes.plot(speeds, share, marker=marker, color=colour, label=label)
        axes.axhline(100 * goal, color='k', linestyle='--', linewidth=1, label=f'goal for the average, {goal:.0%}')
        axes.set(xlabel='speed that was not in the training set (mm/s)', ylabel='windows recognised (%)', ylim=(0, 103))
        axes.set_title(WINDOW_TITLE)
        axes.legend(loc='lower right')
    return Path(path)


def spectra_chart(slides: Sequence[SlideSamples], path: str | Path) -> Path:
    """Draw the mean spectrum of one surface at each speed: over frequency, and over waves per metre."""
    with chart(path, (10.0, 4.0), f'One texture at several speeds ({slides[0].surface})') as figure:
        over_time, over_way = figure.subplots(1, 2, sharey=True)
        edges = FINE.edges_per_m
        waves = np.sqrt(edges[1:] * edges[:-1])
        for speed, colour in zip(sorted({slide.speed_m_s for slide in slides}), COLOURS, strict=False):
            own = [FINE(slide.windows()).ravel() for slide in slides if slide.speed_m_s == speed]
            level = 10 / np.log(10) * np.mean(own, axis=0)
            over_time.plot(waves * speed, level, color=colour, linewidth=1)
            over_way.plot(waves, level, color=colour, linewidth=1, label=f'{1000 * speed:g} mm/s')
        over_time.set(xscale='log', xlabel='frequency (Hz)', ylabel='power, less its mean (dB)', title='over time')
        over_way.set(xscale='log', xlabel='waves per metre of the surface', title='over the way')
        over_way.legend(loc='best')
    return Path(path)


def _methods(axes: Any, methods: Methods, goals: Mapping[str, float]) -> None:
    for row, goal in enumerate(goals.values()):
        line = axes.plot([100 * goal] * 2, [row - 0.38, row + 0.38], color='k', linewidth=2, label='goal')
        line[0].set_label('goal' if row == 0 else '')
    for number, (method, outcomes) in enumerate(methods.items()):
        offset = 0.25 * (2 * number / max(len(methods) - 1, 1) - 1)
        shares = [100 * outcomes[name].accuracy for name in goals]
        rows = np.arange(len(goals)) + offset
        axes.plot(shares, rows, MARKERS[number], color=COLOURS[number], label=method, markersize=6)
        for share, row in zip(shares, rows, strict=True):
            text = f'{share:.1f}'
            axes.annotate(
                text, (share, row), xytext=(6, 0), textcoords='offset points', fontsize=7, va='center', bbox=BEHIND
            )
    axes.set_yticks(range(len(goals)), list(goals))
    axes.set(xlim=(0, 106))
    axes.invert_yaxis()
    axes.legend(loc='center left', bbox_to_anchor=(1.0, 0.5))
