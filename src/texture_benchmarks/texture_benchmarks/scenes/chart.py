"""Charts of what simulated scenes cost, and of what their terms contribute."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.scenes.costs import MANY, DeviceLoad, ScanCost
from texture_benchmarks.scenes.trial import Ablation, TermEffect
from texture_evaluation.charts import COLOURS, chart

COLUMNS = 2


def ablation_chart(ablations: Sequence[Ablation], path: str | Path) -> Path:
    """Draw for each scene how the accuracy changes when a term is left out; one panel for each scene."""
    rows = -(-len(ablations) // COLUMNS)
    most = max(len(ablation.term_effects) for ablation in ablations)
    with chart(
        path, (9.0, 0.9 + rows * (0.8 + 0.27 * most)), 'Change of accuracy when a term of a simulated scene is left out'
    ) as figure:
        panels = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
        for axes, ablation in zip(panels, ablations, strict=False):
            _ablation(axes, ablation)
        for axes in panels[len(ablations) :]:
            axes.axis('off')
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc='outside lower left', title='the term is left out of')
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
        together, alone = ([getattr(cost, which) for cost in costs.values()] for which in ('together_ms', 'alone_ms'))
        scans.barh(places - 0.2, together, 0.38, color=COLOURS[0], label=f'each of {MANY} slides at once')
        scans.barh(places + 0.2, alone, 0.38, color=COLOURS[4], label='one slide alone')
        targets = [target_ms[sticks] for _, sticks in costs]
        scans.vlines(targets, places - 0.45, places + 0.45, color=COLOURS[5], linewidth=2, label='target')
        scans.set_yticks(places, [f'{name}\nstick-slip' if sticks else name for name, sticks in costs])
        scans.set(xscale='log', xlabel='computing time of a slide of 0.5 s (ms)', title='1. Slides computed offline')
        scans.invert_yaxis()
        scans.legend(loc='upper center', bbox_to_anchor=(0.5, -0.13), ncols=3)
        places = np.arange(len(loads))
        live.barh(places, [100 * load.cpu for load in loads.values()], 0.6, color=COLOURS[0])
        live.axvline(100 * target_cpu, color=COLOURS[5], linewidth=2, label='target')
        names = [f'{name}\n{load.rate_hz / 1000:g} kHz × {load.channels}' for name, load in loads.items()]
        live.set_yticks(places, names)
        live.set(xlabel='computing time (% of one core)', title='2. Emulated devices in real time')
        live.invert_yaxis()
        live.legend(loc='upper center', bbox_to_anchor=(0.5, -0.13))
    return Path(path)


def _ablation(axes: Any, ablation: Ablation) -> None:
    places = np.arange(len(ablation.term_effects))
    series = (
        ('training and test slides', [effect.easier for effect in ablation.term_effects], COLOURS[0], -0.2),
        ('training slides only', [effect.unprepared for effect in ablation.term_effects], COLOURS[1], 0.2),
        ("both, with the paper's method", [effect.paper for effect in ablation.term_effects], COLOURS[2], 0.0),
    )
    for label, differences, colour, shift in series:
        known = [(place + shift, item) for place, item in zip(places, differences, strict=True) if item]
        axes.errorbar(
            [100 * item.mean for _, item in known],
            [place for place, _ in known],
            xerr=[100 * item.half if np.isfinite(item.half) else 0.0 for _, item in known],
            fmt='o',
            color=colour,
            markersize=4,
            capsize=2,
            label=label,
        )
    axes.axvline(0.0, color='black', linewidth=0.8)
    axes.set_yticks(places, [_named(term_effect) for term_effect in ablation.term_effects])
    axes.set_ylim(len(places) - 0.5, -0.5)
    axes.set(xlabel='change of accuracy (percentage points)')
    axes.set_title(
        f'{ablation.scene}: {100 * ablation.accuracy:.0f} % right, {ablation.slide_us:.0f} µs a slide', fontsize=9
    )


def _named(term_effect: TermEffect) -> str:
    """Return the term, its verdict if it does not decide, and what it adds to the computing time of a slide."""
    mark = '' if term_effect.verdict == 'decides' else f'{term_effect.verdict}, '
    return f'{term_effect.term.replace("_", " ")} ({mark}{term_effect.cost_us:+.0f} µs)'
