# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pack public recordings from clones of their repositories, as `texture import` reads them.

python pack_public_sets.py biotac20|ntp21|fabricslide CLONE $TEXTURE_DATA
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np

Arrays = dict[str, np.ndarray]


def biotac20(clone: Path) -> dict[str, Arrays]:
    """Return a file for each material of dexrob/BioTac_slide_20_50."""
    files: dict[str, Arrays] = {}
    for path in sorted(clone.glob('raw_data/mat*/mat*_bio.csv')):
        material, slide, _ = path.stem.split('_')
        frames = np.genfromtxt(path, delimiter=',', skip_header=1, usecols=range(45))
        epoch, name = frames[0, 0], f'slide{int(slide):02d}'
        arrays = files.setdefault(f'material{int(material[3:]):02d}', {})
        arrays[f'{name}/epoch'] = np.float64(epoch)
        arrays[f'{name}/frame_time'] = (frames[:, 0] - epoch).astype(np.float32)
        arrays[f'{name}/frames'] = frames[:, 1:].astype(np.int16)
        for field, ending, columns in (('velocity', 'cv', 4), ('wrench', 'cw', 7)):
            other = path.with_name(f'{material}_{slide}_{ending}.csv')
            rows = np.genfromtxt(other, delimiter=',', skip_header=1, usecols=range(columns))
            rows[:, 0] -= epoch
            arrays[f'{name}/{field}'] = rows.astype(np.float32)
    return files


def ntp21(clone: Path) -> dict[str, Arrays]:
    """Return the one file of LIMB-UCF/NTP; speeds are published in mm/min."""
    arrays = {}
    for path in sorted(clone.glob('data/processed/Texture*/*.csv')):
        texture, speed, force = re.findall(r'\(([\d.]+)\)', path.name)[:3]
        rows = np.loadtxt(path, delimiter=',')
        rows[:, -1] -= rows[0, -1]
        arrays[f'texture{int(texture):02d}/speed{int(speed) // 60:03d}/force{force}'] = rows.astype(np.float32)
    return {'slides': arrays}


def fabricslide(clone: Path) -> dict[str, Arrays]:
    """Return the one file of wngfra/FabricSlide."""
    arrays = {}
    for path in sorted(clone.glob('data/*/*.csv')):
        key = (
            path.stem.replace('mmps', '').replace('_', '/') if path.parent.name == 'fabric' else f'grating/{path.stem}'
        )
        arrays[key] = np.loadtxt(path, delimiter=',', skiprows=1, dtype=np.int32)
    return {'runs': arrays}


if __name__ == '__main__':
    name, clone, out = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]) / sys.argv[1]
    out.mkdir(parents=True, exist_ok=True)
    for file, arrays in {'biotac20': biotac20, 'ntp21': ntp21, 'fabricslide': fabricslide}[name](clone).items():
        np.savez_compressed(out / f'{file}.npz', **arrays)
        print(out / f'{file}.npz', len(arrays), 'arrays')
