"""Charts of simulated stick-slip: cost and error, borders of stability, and how it vibrates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texture_core.arrays import Array
from texture_evaluation.charts import COLOURS, chart

MARKERS = 'o^vsDP'
SHOWN_S = 0.12
PERIODS_MS = (5, 10, 20, 50)


@dataclass(frozen=True, eq=False)
class Costs:
    """Cost `ms` and `error` of each method over its settings, the cost allowed, and the default's step."""

    rows: Mapping[str, list[dict[str, float]]]
    target_ms: float
    default_step_us: float


@dataclass(frozen=True, eq=False)
class Borders:
    """Longest stable steps by (phase, method) over the bristles' stiffness, (n,) each; inf where there is none."""

    stiffness_1_m: Array
    predicted_s: Mapping[tuple[str, str], Array]
    found_s: Mapping[tuple[str, str], Array]
    default_step_s: float


@dataclass(frozen=True, eq=False)
class Vibration:
    """How a dragged tip vibrates over the speed, (n,) each; NaN is no period; and what is measured at some speeds."""

    speed_m_s: Array
    critical_m_s: float
    period_s: Array
    formula_s: Array
    from_rest_n: Array
    from_sliding_n: Array
    step_s: float
    shown: Mapping[float, Array]


def cost_chart(costs: Costs, path: str | Path) -> Path:
    """Draw the error over the cost, one line a method; what lies low and left is good."""
    with chart(path, (7.6, 4.8)) as figure:
        axes = figure.subplots()
        for (name, rows), colour, marker in zip(costs.rows.items(), COLOURS, MARKERS, strict=False):
            ms, errors = ([row[key] for row in rows] for key in ('ms', 'error'))
            label = (
                f'{name}, steps {rows[0]["step_us"]:.3g} to {rows[-1]["step_us"]:.2g} µs'
                if 'step_us' in rows[0]
                else name
            )
            axes.loglog(ms, 100 * np.array(errors), color=colour, marker=marker, markersize=4, label=label)
            for row in rows:
                if row.get('step_us') == costs.default_step_us:
                    axes.plot(row['ms'], 100 * row['error'], 'o', markersize=11, fillstyle='none', color='black')
                    axes.annotate('default', (row['ms'], 100 * row['error']), (7, 7), textcoords='offset points')
        axes.axvline(costs.target_ms, color='black', linestyle='--', linewidth=1)
        axes.set(
            xlabel='computing time of a slide of 0.5 s (ms); dashed: target',
            ylabel='error of the force (% of its vibration)',
        )
        axes.set_title('Stick-slip at 0.05 m/s and 1.5 N: error and computing time of the integrators')
        axes.legend(loc='upper center', bbox_to_anchor=(0.5, -0.16), ncols=2, fontsize=8)
    return Path(path)


def border_chart(borders: Borders, path: str | Path) -> Path:
    """Draw the longest stable step over the stiffness: lines predicted, markers found; a panel for each phase."""
    with chart(path, (9.0, 4.6), 'Longest stable step: predicted (lines) and simulated (markers)') as figure:
        panels = dict(zip(('stick', 'slide'), figure.subplots(1, 2, sharey=True), strict=True))
        methods = list(dict.fromkeys(method for _, method in borders.predicted_s))
        for (phase, method), predicted in borders.predicted_s.items():
            axes, i = panels[phase], methods.index(method)
            if not np.isfinite(predicted).any():
                axes.plot([], [], color=COLOURS[i], marker=MARKERS[i], label=f'{method}: none')
                continue
            axes.loglog(borders.stiffness_1_m, 1e6 * predicted, color=COLOURS[i], label=method)
            found = 1e6 * borders.found_s[phase, method]
            axes.loglog(borders.stiffness_1_m, found, MARKERS[i], color=COLOURS[i], markersize=5)
        for phase, axes in panels.items():
            axes.axhline(1e6 * borders.default_step_s, color='black', linestyle='--', linewidth=1)
            axes.set(title=f'while the tip {phase}s', xlabel='stiffness of the bristles (1/m)')
            axes.legend(loc='lower left', fontsize=8)
        panels['stick'].set_ylabel('step (µs); dashed: default')
    return Path(path)


def vibration_chart(vibration: Vibration, path: str | Path) -> Path:
    """Draw the force over time at some speeds, the period and the swing over the speed."""
    with chart(path, (11.0, 4.2)) as figure:
        over_time, period, swing = figure.subplots(1, 3)
        for (speed, pull), colour in zip(vibration.shown.items(), COLOURS, strict=False):
            n = round(SHOWN_S / vibration.step_s)
            over_time.plot(
                vibration.step_s * np.arange(n), pull[:n], color=colour, label=f'{speed:.3f} m/s', linewidth=1
            )
        over_time.set(xlabel='time (s)', ylabel='force on the skin (N)', title='1. From rest, 1.5 N')
        over_time.legend(loc='upper center', bbox_to_anchor=(0.5, -0.16), ncols=3, fontsize=8)
        period.loglog(vibration.speed_m_s, 1000 * vibration.formula_s, color='black', label='formula for slow drags')
        period.loglog(vibration.speed_m_s, 1000 * vibration.period_s, 'o', color=COLOURS[0], label='simulated')
        period.set(xlabel='speed (m/s)', ylabel='period (ms)', title='2. Faster drag, shorter period')
        period.set_yticks(PERIODS_MS, [str(period_ms) for period_ms in PERIODS_MS])
        period.minorticks_off()
        period.legend(loc='upper right', fontsize=8)
        swing.plot(vibration.speed_m_s, vibration.from_rest_n, 'o-', color=COLOURS[0], label='from rest')
        swing.plot(vibration.speed_m_s, vibration.from_sliding_n, '^--', color=COLOURS[1], label='from sliding')
        swing.axvline(vibration.critical_m_s, color='black', linestyle='--', linewidth=1)
        swing.set(xlabel='speed (m/s); dashed: critical, predicted', ylabel='swing of the force (N)')
        swing.set_title('3. Fast drag is quiet')
        swing.legend(loc='upper center', bbox_to_anchor=(0.5, -0.16), ncols=2, fontsize=8)
    return Path(path)
