"""What the sensor nodes cost, what they lose, how fast a device may be, and how replugging and a flood are borne."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from texture_benchmarks.charts import line_chart
from texture_benchmarks.load.interruptions import flood, replug
from texture_benchmarks.load.rig import Rig, fast_daq
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult

if TYPE_CHECKING:
    from texture_benchmarks.ros.sensor_load import SensorLoad

ALONE = ('tsf85', 'tsf85_pair', 'biotac', 'daq', 'pvdf', 'anyskin', 'papillarray')
TOGETHER = ('tsf85', 'biotac', 'daq', 'pvdf')
INTERRUPTED = ('tsf85', 'biotac', 'daq', 'pvdf', 'anyskin', 'papillarray')
QUICK_INTERRUPTED = ('anyskin',)
REPLUGS, QUICK_REPLUGS = 10, 1
FACTORS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)  # of the DAQ finger's 2.5 kHz
QUICK_FACTORS = (1.0,)
QUICK_S, ALONE_S, RATE_S, FLOOD_S = 2.0, 30.0, 10.0, 10.0
TARGETS = {'daq_lost': 0, 'daq_cpu_percent': 12.0, 'tsf85_cpu_percent': 12.0}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Run each sensor's node alone, four at once, one at ever higher rates; replug and flood each driver."""
    seconds = QUICK_S if options.quick else max(QUICK_S, options.duration_s)
    alone_s, rate_s = min(seconds, ALONE_S), min(seconds, RATE_S)
    alone = {name: _loads([name], alone_s)[name] for name in (('daq',) if options.quick else ALONE)}
    together = _loads(TOGETHER, seconds)
    interrupted = _interrupted(quick=options.quick)
    rates = [_fast(factor, rate_s) for factor in (QUICK_FACTORS if options.quick else FACTORS)]
    kilohertz = np.array([wanted_hz for wanted_hz, _ in rates]) / 1000
    chart = line_chart(
        {
            'computing time, % of one core': (kilohertz, np.array([100 * load.cpu for _, load in rates])),
            'samples lost, %': (kilohertz, np.array([100 * _lost_share(load) for _, load in rates])),
        },
        'Sensor node with 8 channels at ever higher rates (emulated DAQ finger)',
        ('samples of each channel a second (kHz)', '%'),
        options.out / 'sensors-load.png',
    )
    return BenchmarkResult(
        name='sensors-load',
        measured=(
            f'the node `sensor` as a process of its own: each alone for {alone_s:g} s, four together for {seconds:g} '
            f's, each other rate for {rate_s:g} s, with one subscriber. Samples and losses by its own counts, '
            'computing time in percent of one core. Replugged and ten times too fast: the driver without a node. '
            'unsent_bytes: what the emulated device could not send, for the machine was busy'
        ),
        data='emulated devices on pseudo-terminals, fed in real time on the same machine',
        split='none: nothing is trained',
        numbers={
            'targets': TARGETS,
            'alone': _numbers(alone),
            'together': {**_numbers(together), 'cpu_percent': sum(100 * load.cpu for load in together.values())},
            **interrupted,
            'daq_at_rates': {f'{wanted_hz:g} Hz': _row(load) for wanted_hz, load in rates},
            'highest_rate_without_loss_hz': max((w for w, load in rates if not load.lost), default=0.0),
        },
        charts=(chart,),
    )


def _interrupted(*, quick: bool) -> Mapping[str, Any]:
    """Return the figures of each driver whose device is unplugged again and again, and sends ten times too fast."""
    names, times = (QUICK_INTERRUPTED, QUICK_REPLUGS) if quick else (INTERRUPTED, REPLUGS)
    with tempfile.TemporaryDirectory() as folder:
        seconds = QUICK_S if quick else FLOOD_S
        return {
            'replugged': {name: asdict(replug(name, Path(folder), times)) for name in names},
            'ten_times_too_fast': {name: asdict(flood(name, Path(folder), seconds)) for name in names},
        }


def _loads(names: tuple[str, ...] | list[str], seconds: float) -> Mapping[str, SensorLoad]:
    from texture_benchmarks.ros.sensor_load import measure  # noqa: PLC0415  # ROS is needed for this alone

    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        rigs = {name: stack.enter_context(Rig(name, Path(folder) / name)) for name in names}
        loads: Mapping[str, SensorLoad] = measure(rigs, {name: name for name in names}, seconds)
        return loads


def _fast(factor: float, seconds: float) -> tuple[float, SensorLoad]:
    """Return the rate and the load of a DAQ finger of another rate."""
    from texture_benchmarks.ros.sensor_load import measure  # noqa: PLC0415

    with tempfile.TemporaryDirectory() as folder, fast_daq(Path(folder) / 'daq', factor) as rig:
        return rig.case.rate_hz, measure({'daq': rig}, {'daq': 'daq'}, seconds)['daq']


def _lost_share(load: SensorLoad) -> float:
    return float(load.lost / max(1.0, load.lost + load.rate_hz * load.seconds))


def _numbers(loads: Mapping[str, SensorLoad]) -> dict[str, Any]:
    return {name: _row(load) for name, load in loads.items()}


def _row(load: SensorLoad) -> Mapping[str, Any]:
    values = asdict(load)
    return {**values, 'cpu_percent': round(100 * values.pop('cpu'), 1)}
