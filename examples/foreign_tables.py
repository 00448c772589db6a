# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write recordings as other people keep them, to try an import on: simulated, shaped unlike those of the suite.

python foreign_tables.py FOLDER
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

RATE_HZ = 100.0
STROKES, STROKE_ROWS, IDLE_ROWS = 3, 250, 40
TONES_HZ = {'linen': 8.0, 'oak board': 17.0, 'cork_thick': 31.0}


@dataclass(frozen=True)
class Recording:
    """One file: rows of all channels, the name of the phase of each, and times in ms."""

    name: str
    material: str
    channels: np.ndarray  # (n, 4): three accelerations in mg, grip in gf
    phases: list[str]
    time_ms: np.ndarray

    def stroke(self, number: int) -> np.ndarray:
        """Return the rows of a stroke, (n, 4), from 1."""
        return self.channels[[phase == f'stroke {number}' for phase in self.phases]]


def recordings(
    files: int = 2, seed: int = 0, jitter_ms: float = 1.5, noise: float = 0.05, spread: float = 0.0
) -> list[Recording]:
    """Return files of each material: three strokes between which the finger rests.

    Parameters
    ----------
    files
        Number of files of each material.
    seed
        Seed of all that is random.
    jitter_ms
        Largest error of a time.
    noise
        Noise of the accelerations, as a multiple of the amplitude of the material's tone.
    spread
        Standard deviation of the material's frequency from stroke to stroke, as a fraction of it.
    """
    rng = np.random.default_rng(seed)
    return [
        _recording(rng, material, number, (jitter_ms, noise, spread))
        for material in TONES_HZ
        for number in range(1, files + 1)
    ]


def _recording(rng: np.random.Generator, material: str, number: int, errors: tuple[float, float, float]) -> Recording:
    jitter_ms, noise, spread = errors
    phases, tones_hz = ['rest'] * IDLE_ROWS, [0.0] * IDLE_ROWS
    for stroke in range(1, STROKES + 1):
        phases += [f'stroke {stroke}'] * STROKE_ROWS + ['rest'] * IDLE_ROWS
        tone_hz = TONES_HZ[material] * (1.0 + spread * rng.normal())
        tones_hz += [tone_hz] * STROKE_ROWS + [0.0] * IDLE_ROWS
    phase = 2 * np.pi * (np.cumsum(tones_hz) / RATE_HZ + rng.random())
    sliding = np.array(tones_hz) > 0
    tone = np.stack([np.sin(phase), 0.5 * np.cos(phase), 0.3 * np.sin(2 * phase)], axis=1)
    errors_mg = rng.normal(scale=noise, size=(len(phases), 3))
    grip = 120.0 + 30.0 * number + rng.normal(scale=0.5, size=len(phases))
    channels = np.column_stack([200.0 * (tone * sliding[:, None] + errors_mg), grip]).round(3)
    time_ms = 5e6 + 1000.0 * np.arange(len(phases)) / RATE_HZ + rng.uniform(-jitter_ms, jitter_ms, len(phases))
    return Recording(f'2031-05-0{number}, {material}, v20', material, channels, phases, time_ms.round(2))


MAPPING = """
# '2031-05-01, linen, v20.csv': day, material, speed in mm/s
files: '{day}, {material}, v{speed}.csv'
streams:
  signal:
    columns: ['acc_*']
    channels: [x, y, z]
    unit: g
    scale: 0.001
    time: {column: t, unit: ms}
label: {column: material}
slides: {by: column, column: phase, values: [stroke 1, stroke 2, stroke 3]}
conditions:
  speed: {column: speed, unit: mm/s}
  force: {column: grip, unit: gf}
session: day
sensor: accelerometer
"""


def write_csv(folder: Path, recorded: list[Recording], broken: dict[int, str] | None = None) -> Path:
    """Write semicolon-separated files with a note above and a comment; `broken` replaces rows by their index."""
    folder.mkdir(parents=True, exist_ok=True)
    for one in recorded:
        rows = [
            f'{t:.2f};{phase};{";".join(f"{value:.3f}" for value in values)}'
            for t, phase, values in zip(one.time_ms, one.phases, one.channels, strict=True)
        ]
        for index, text in (broken or {}).items():
            rows[index] = text
        head = '# made by a third-party logger\nt;phase;acc_x;acc_y;acc_z;grip\n'
        (folder / f'{one.name}.csv').write_text(head + '\n'.join(rows) + '\n')
    return folder


if __name__ == '__main__':
    # As they come from a logger: a bad cell, a line that is no row, and materials that are hard to distinguish.
    broken = {60: '5000600.00;stroke 1;oops;1.0;2.0;150.0', 400: 'logger restarted'}
    write_csv(Path(sys.argv[1]), recordings(files=8, noise=1.0, spread=0.25), broken)
