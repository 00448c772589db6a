"""Charts of what simulated scenes cost, and of what their terms contribute."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.scenes.costs import MANY, DeviceLoad, ScanCost
from texture_benchmarks.scenes.trial import Ablation, TermEffect
from texture_evaluation.charts import COLOURS, chart

COLUMNS = 3


def ablation_chart(ablations: Sequence[Ablation], path: str | Path) -> Path:
    """Draw for each scene what happens when a term is removed; a panel a scene."""
    rows = -(-len(ablations) // COLUMNS)
    most = max(len(ablation.term_effects) for ablation in ablations)
    with chart(
        path, (13.0, 1.0 + rows * (0.9 + 0.42 * most)), 'What changes when a term of a simulated scene is removed'
    ) as figure:
        panels = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
        for axes, ablation in zip(panels, ablations, strict=False):
            _ablation(axes, ablation)
        for axes in panels[len(ablations) :]:
            axes.axis('off')
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc='outside lower center', ncols=3, fontsize=9)
    return Path(path)


def cost_chart(
    costs: Mapping[tuple[str, bool], ScanCost],
    target_ms: Mapping[bool, float],
    loads: Mapping[str, DeviceLoad],
    target_cpu: float,
    path: str | Path,
) -> Path:
    """Draw the time of a slide by scene, with what is allowed, and the load of emulated devices.

    Parameters
    ----------
    costs
        Scene and whether many slides are made at once → time of a slide.
    target_ms
        Allowed time of a single slide, and of one of many.
    loads
        Scene → load of its emulated device.
    target_cpu
        Allowed share of a core.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    with chart(path, (11.0, 4.6)) as figure:
        scans, live = figure.subplots(1, 2, width_ratios=[1.5, 1.0])
        places = np.arange(len(costs))
        scans.barh(places - 0.2, [cost.together_ms for cost in costs.values()], 0.38, color=COLOURS[0])
        scans.barh(places + 0.2, [cost.alone_ms for cost in costs.values()], 0.38, color=COLOURS[4])
        for place, (_, sticks) in zip(places, costs, strict=True):
            scans.plot([target_ms[sticks]] * 2, [place - 0.45, place + 0.45], color=COLOURS[5], linewidth=2)
        scans.set_yticks(places, [f'{name}\nstick-slip' if sticks else name for name, sticks in costs])
        scans.set(xscale='log', xlabel='computing time of a slide of 0.5 s (ms)')
        scans.set_title(f'1. Offline: dark each of {MANY} at once, light alone; red: allowed')
        scans.invert_yaxis()
        places = np.arange(len(loads))
        live.barh(places, [100 * load.cpu for load in loads.values()], 0.6, color=COLOURS[0])
        live.axvline(100 * target_cpu, color=COLOURS[5], linewidth=2)
        names = [f'{name}\n{load.rate_hz / 1000:g} kHz × {load.channels}' for name, load in loads.items()]
        live.set_yticks(places, names)
        live.set(xlabel='computing time (% of one core); red: allowed')
        live.set_title('2. Emulated devices in real time')
        live.invert_yaxis()
    return Path(path)


def _ablation(axes: Any, ablation: Ablation) -> None:
    places = np.arange(len(ablation.term_effects))
    series = (
        (
            'if the world had no such term',
            [term_effect.easier for term_effect in ablation.term_effects],
            COLOURS[0],
            -0.16,
        ),
        (
            'if only what is used for training had none',
            [term_effect.unprepared for term_effect in ablation.term_effects],
            COLOURS[1],
            0.16,
        ),
        (
            "by the paper's method, if the world had none",
            [term_effect.paper for term_effect in ablation.term_effects],
            COLOURS[2],
            0.0,
        ),
    )
    for label, differences, colour, shift in series:
        known = [(place + shift, item) for place, item in zip(places, differences, strict=True) if item]
        axes.errorbar(
            [100 * item.mean for _, item in known],
            [place for place, _ in known],
            xerr=[100 * item.half if np.isfinite(item.half) else 0.0 for _, item in known],
            fmt='o',
            color=colour,
            markersize=5,
            capsize=2,
            label=label,
        )
    axes.axvline(0.0, color='black', linewidth=0.8)
    axes.set_yticks(places, [_named(term_effect) for term_effect in ablation.term_effects])
    axes.set_ylim(len(places) - 0.5, -0.5)
    axes.set(xlabel='change of accuracy (percentage points)')
    axes.set_title(f'{ablation.scene}: {100 * ablation.accuracy:.0f} % right, {ablation.slide_us:.0f} µs a slide')


def _named(term_effect: TermEffect) -> str:
    """Return the term, marked unless it decides, with what it adds to the time of a slide."""
    mark = '' if term_effect.verdict == 'decides' else f' ({term_effect.verdict})'
    return f'{term_effect.term.replace("_", " ")}{mark}\ncosts {term_effect.cost_us:.0f} µs'
