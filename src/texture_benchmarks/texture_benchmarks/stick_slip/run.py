"""What it costs to simulate stick-slip, with which error, and how long a step may be."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_benchmarks.stick_slip.chart import Borders, Costs, border_chart, cost_chart, vibration_chart
from texture_benchmarks.stick_slip.dragged_tip import FORCE_N, FRICTION, SPEED_M_S
from texture_benchmarks.stick_slip.integrators import INTEGRATORS
from texture_benchmarks.stick_slip.simulated_limit import ContactRegime, simulated_max_stable_step_s
from texture_benchmarks.stick_slip.vibration import drag_vibration
from texture_core.arrays import Array
from texture_simulation.stick_slip.integrator import Integrator
from texture_simulation.stick_slip.reference import SOLVERS, solve
from texture_simulation.stick_slip.semi_implicit import SEMI_IMPLICIT
from texture_simulation.stick_slip.simulate import drag_unchecked, pull_n
from texture_simulation.stick_slip.stability_limit import MARGIN, max_stable_step_s
from texture_simulation.stick_slip.tip_drag import TipDrag
from texture_simulation.trajectory import Trajectory

SLIDE_M_S = 0.4  # speed at which the border of sliding is sought
SCAN_S, COMPARED_S, QUICK_COMPARED_S = 0.5, 0.2, 0.04
MS = 1e-3
REFERENCE = 1e-9
SHARES = (0.9, 0.45, 0.22, 0.11, 0.05)  # of the border, for the methods with one that matters
STEPS_S = (5e-4, 2.5e-4, 1.25e-4, 6e-5, 3e-5, 1.5e-5)  # of the default
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
STIFFNESSES_1_M = (1e4, 3e4, 1e5, 3e5, 1e6, 3e6)
SPEED_SHARES = (0.1, 0.2, 0.4, 0.6, 0.8, 0.95, 1.05, 1.3, 1.6, 2.0, 2.2, 2.4, 2.6, 3.0)  # of the critical speed
RATES_HZ = {'TSF-85': 2000.0, 'DAQ finger': 5000.0, 'PVDF finger': 8192.0, 'BioTac': 8800.0}
MANY = 100
REPEATS, LONG_S = 5, 0.2  # what takes longer is measured once
TARGET_MS = 10.0


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Compare the integrators, find their borders, and time the default."""
    compared_s = QUICK_COMPARED_S if options.quick else COMPARED_S
    costs = _costs(compared_s, thin=2 if options.quick else 1)
    borders = _borders(STIFFNESSES_1_M[:: 3 if options.quick else 1])
    vibration = drag_vibration(SPEED_SHARES[:: 4 if options.quick else 1])
    charts = (
        cost_chart(costs, options.out / 'stick_slip_cost.png'),
        border_chart(borders, options.out / 'stick_slip_border.png'),
        vibration_chart(vibration, options.out / 'stick_slip_vibration.png'),
    )
    return BenchmarkResult(
        name='stick_slip',
        measured=f'ms of one core for a slide of {SCAN_S} s; error: rms of the force on the skin over {compared_s} s '
        'against Radau, as share of the rms of its vibration; border: longest stable step, predicted and found',
        data=f'simulated drag at {SPEED_M_S} m/s and {FORCE_N} N; border of sliding at {SLIDE_M_S} m/s and {FORCE_N} N',
        split='none: nothing is trained',
        numbers={
            'target_ms': TARGET_MS,
            'default': {'method': SEMI_IMPLICIT.name, 'step_us': 1e6 * FRICTION.step_s, **_margins()},
            'scan_ms': _scan_ms(3 if options.quick else 31),
            'integrators': {name: [dict(row) for row in rows] for name, rows in costs.rows.items()},
            'border_us': _border_numbers(borders),
            'vibration': {
                'critical_m_s': vibration.critical_m_s,
                'speed_m_s': vibration.speed_m_s.tolist(),
                'period_ms': (1000 * vibration.period_s).tolist(),
                'formula_ms': (1000 * vibration.formula_s).tolist(),
                'swing_from_rest_n': vibration.from_rest_n.tolist(),
                'swing_from_sliding_n': vibration.from_sliding_n.tolist(),
            },
        },
        charts=charts,
    )


def _margins() -> dict[str, float]:
    return {
        'border_us': 1e6 * max_stable_step_s(SEMI_IMPLICIT, FRICTION, SPEED_M_S, FORCE_N),
        'allowed_us': 1e6 * MARGIN * max_stable_step_s(SEMI_IMPLICIT, FRICTION, SPEED_M_S, FORCE_N),
        'provably_passive_up_to_us': 1e6 * FRICTION.passive_step_s,
    }


def _scan_ms(repeats: int) -> dict[str, float]:
    """Return what one scan costs at the path rates of the sensors, and one of many at once: medians."""

    def path(rate_hz: float, scans: tuple[int, ...] = ()) -> Trajectory:
        x_m = np.arange(round(SCAN_S * rate_hz)) * SPEED_M_S / rate_hz * np.ones((*scans, 1))
        return Trajectory(x_m, np.zeros_like(x_m), np.full_like(x_m, FORCE_N))

    def measured_n(rate_hz: float, scans: tuple[int, ...] = ()) -> Callable[[], Array]:
        way = path(rate_hz, scans)
        return lambda: TipDrag(FRICTION, rate_hz).advance(way)

    alone = {
        f'{sensor}, {rate_hz:g} points/s': 1000 * _median_s(measured_n(rate_hz), repeats)
        for sensor, rate_hz in RATES_HZ.items()
    }
    rate_hz = RATES_HZ['TSF-85']
    together_s = _median_s(measured_n(rate_hz, (MANY,)), max(1, repeats // 6))
    return {**alone, f'each of {MANY} at once, {rate_hz:g} points/s': 1000 * together_s / MANY}


def _median_s(work: Callable[[], Array], repeats: int) -> float:
    """Return the median time of the processor, which counts no waiting for others; once for what takes long."""
    times: list[float] = []
    while len(times) < repeats and not (times and times[0] > LONG_S):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return float(np.median(times))


def _costs(compared_s: float, thin: int) -> Costs:
    """Return cost and error of every method over its steps or tolerances."""
    measure = _Measure(compared_s, 1 if thin > 1 else REPEATS)
    rows = {}
    for name, integrator in INTEGRATORS.items():
        border = max_stable_step_s(integrator, FRICTION, SPEED_M_S, FORCE_N)
        steps_s = STEPS_S if integrator is SEMI_IMPLICIT else [share * border for share in SHARES]
        rows[name] = [measure.fixed_step(integrator, step_s) for step_s in steps_s[::thin]]
    for method in SOLVERS:
        rows[method] = [measure.own_step(method, tolerance) for tolerance in TOLERANCES[::thin]]
    return Costs(rows, TARGET_MS, 1e6 * FRICTION.step_s)


class _Measure:
    """Cost and error of a drag from rest, looked at each ms."""

    def __init__(self, compared_s: float, repeats: int) -> None:
        self._repeats = repeats
        self._times_s: Array = np.arange(1.0, round(compared_s / MS) + 1, dtype=np.float64) * MS
        self._to_scan_ms = 1000 * SCAN_S / compared_s
        self._exact_n = self._solved_n('radau', REFERENCE)
        self._spread_n = float(self._exact_n.std())

    def fixed_step(self, integrator: Integrator, longest_s: float) -> dict[str, float]:
        """Return the row of an integrator, with the longest step up to one that divides a ms."""
        per_ms = max(1, math.ceil(MS / longest_s - 1e-9))
        speed = np.full(per_ms * len(self._times_s), SPEED_M_S)
        force = np.full_like(speed, FORCE_N)

        def pulled_n() -> Array:
            tip = drag_unchecked(FRICTION, speed, force, MS / per_ms, integrator=integrator, force_before_n=FORCE_N)
            return pull_n(FRICTION, tip, speed)[per_ms - 1 :: per_ms]

        return {'step_us': 1e6 * MS / per_ms, **self._row(pulled_n)}

    def own_step(self, method: str, tolerance: float) -> dict[str, float]:
        """Return the row of a solver of scipy."""
        return {'tolerance': tolerance, **self._row(lambda: self._solved_n(method, tolerance))}

    def _solved_n(self, method: str, tolerance: float) -> Array:
        tip = solve(FRICTION, SPEED_M_S, FORCE_N, self._times_s, method=method, tolerance=tolerance).tip
        return pull_n(FRICTION, tip, np.full_like(self._times_s, SPEED_M_S))

    def _row(self, work: Callable[[], Array]) -> dict[str, float]:
        pulled_n = work()
        error = float(np.sqrt(np.mean((pulled_n - self._exact_n) ** 2))) / self._spread_n
        return {'ms': self._to_scan_ms * _median_s(work, self._repeats), 'error': error}


def _borders(stiffnesses_1_m: tuple[float, ...]) -> Borders:
    """Return the borders of all methods over the stiffness of the bristles."""
    predicted, found = {}, {}
    for phase in ContactRegime:
        slip_m_s = 0.0 if phase is ContactRegime.STICK else SLIDE_M_S
        for method, integrator in INTEGRATORS.items():
            pairs = []
            for stiffness in stiffnesses_1_m:
                friction = replace(FRICTION, bristle_1_m=stiffness)
                expected_s = integrator.limit_s(friction, slip_m_s, FORCE_N)
                between_s = (expected_s / 3, expected_s * 3) if math.isfinite(expected_s) else (1e-5, 0.1)
                pairs.append(
                    (
                        expected_s,
                        simulated_max_stable_step_s(
                            integrator, friction, phase, FORCE_N, slip_m_s=SLIDE_M_S, between_s=between_s
                        ),
                    )
                )
            predicted[phase.value, method], found[phase.value, method] = np.array(pairs).T
    return Borders(np.array(stiffnesses_1_m), predicted, found, FRICTION.step_s)


def _border_numbers(borders: Borders) -> dict[str, Any]:
    """Return the borders in µs; None where there is none."""

    def microseconds(values_s: Array) -> list[float | None]:
        return [1e6 * value if math.isfinite(value) else None for value in values_s.tolist()]

    finite = [
        np.abs(borders.found_s[key] / predicted - 1).max()
        for key, predicted in borders.predicted_s.items()
        if np.isfinite(predicted).all()
    ]
    numbers: dict[str, Any] = {'bristle_1_m': borders.stiffness_1_m.tolist(), 'largest_difference': float(max(finite))}
    for (phase, method), predicted in borders.predicted_s.items():
        numbers[f'{phase}, {method}'] = {
            'predicted': microseconds(predicted),
            'found': microseconds(borders.found_s[phase, method]),
        }
    return numbers
