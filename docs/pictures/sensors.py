# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Draw docs/pictures/sensor_*.png, simulated slides: `.venv/bin/ros-run python docs/pictures/sensors.py`.

Each has channels that feel vibration, channels that feel pressure, and the spectrum of the first while sliding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import signal

from texture_core.types import Array
from texture_evaluation.charts import COLOURS, chart
from texture_simulation.offline import APPROACH_S, LIFT_S, SLIDE_FROM_S, simulate_exploration
from texture_simulation.scene import load_scene

SCENE, SLIDE_S = 'twelve_textures', 1.5
Touch = tuple[str, str, float, float, float]  # surface, its name in the title, its pitch (m), speed (m/s), force (N)
RIDGES: Touch = ('ridge_2mm_deep', '2 mm ridges', 2e-3, 0.1, 2.0)
PICTURES: dict[str, tuple[str, Touch, Sequence[str], Sequence[str]]] = {
    'tsf85': ('TSF-85', RIDGES, ['dynamic'], ['taxel_3_1', 'taxel_2_1', 'taxel_3_0', 'taxel_1_1']),
    'biotac': ('BioTac', RIDGES, ['pac'], ['pdc', 'electrode1', 'electrode10', 'tdc']),
    'daq': (
        'DAQ finger',
        ('ridge_1mm', '1 mm ridges', 1e-3, 0.05, 1.0),
        ['pvdf_outer_1', 'pvdf_inner_1'],
        ['strain_outer_1', 'strain_inner_1'],
    ),
    'pvdf': ('PVDF finger', ('woven_cloth', 'woven cloth', 8e-4, 0.0255, 1.5), ['film'], ['force']),
}


def channels(sensor: str, touch: Touch) -> dict[str, tuple[Array, float, str]]:
    """Return by channel its changes since the finger was free, (n_samples,), their rate in Hz, and their unit."""
    surface, _, _, speed_m_s, force_n = touch
    scene, rng = replace(load_scene(SCENE), sensor=sensor), np.random.default_rng(0)
    _, recording = simulate_exploration(
        scene, surface, speed_m_s, force_n, SLIDE_S, start_ns=0, exploration_id='one', rng=rng
    )
    found = {}
    for first, *others in recording.values():
        samples = np.concatenate([first.samples, *(batch.samples for batch in others)]).astype(float)
        samples -= samples[: int(APPROACH_S * first.sampling_rate_hz)].mean(axis=0)
        for channel, unit, column in zip(first.channels, first.units, samples.T, strict=True):
            found[channel] = column, first.sampling_rate_hz, unit
    return found


def draw(sensor: str) -> None:
    """Draw the picture of one sensor."""
    name, touch, fast, slow = PICTURES[sensor]
    _, surface, pitch_m, speed_m_s, force_n = touch
    found = channels(sensor, touch)
    title = f'Simulated {name} over {surface}, {1e3 * speed_m_s:g} mm/s, {force_n:g} N'
    path = Path(__file__).with_name(f'sensor_{sensor}.png')
    with chart(path, (5.8, 6.4), title) as figure:
        vibration, pressure, spectrum = figure.subplots(3, 1)
        colours = iter(COLOURS)
        for axes, names in ((vibration, fast), (pressure, slow)):
            for channel, colour in zip(names, colours, strict=False):
                values, rate_hz, unit = found[channel]
                axes.plot(np.arange(len(values)) / rate_hz, values, linewidth=0.9, color=colour, label=channel)
            axes.axvspan(SLIDE_FROM_S, SLIDE_FROM_S + SLIDE_S, color='grey', alpha=0.15, linewidth=0)
            axes.set(xlim=(0, SLIDE_FROM_S + SLIDE_S + LIFT_S), ylabel=f'change ({unit})')
        pressure.set_xlabel('time (s); grey: slide')
        for channel, colour in zip(fast, COLOURS, strict=False):
            values, rate_hz, unit = found[channel]
            sliding = values[int(SLIDE_FROM_S * rate_hz) : int((SLIDE_FROM_S + SLIDE_S) * rate_hz)]
            hz, power = signal.periodogram(sliding, rate_hz, 'hann')
            spectrum.semilogx(hz[3:], 10 * np.log10(power[3:]), linewidth=0.9, color=colour, label=channel)
        spectrum.xaxis.set_major_formatter('{x:g}')
        passes_hz = speed_m_s / pitch_m
        spectrum.axvline(
            passes_hz, color='black', linestyle='--', linewidth=1, zorder=0, label=f'{passes_hz:.0f} Hz: speed / pitch'
        )
        spectrum.set(xlabel='frequency (Hz)', ylabel=f'power (dB of {unit}²/Hz)', xlim=(5, hz[-1]))
        for axes in (vibration, pressure, spectrum):
            axes.legend(loc='lower right', bbox_to_anchor=(1.02, 0.98), ncols=4, columnspacing=1.0, handlelength=1.2)


if __name__ == '__main__':
    for one in PICTURES:
        draw(one)
