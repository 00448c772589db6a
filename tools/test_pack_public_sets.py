# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The example that packs public recordings: files in their published form become what the importers read."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from texture_bringup.command import main
from texture_recordings.dataset import SlideDataset

EXAMPLE = Path(__file__).resolve().parent.parent / 'examples' / 'pack_public_sets.py'


def table(path: Path, header: str, rows: np.ndarray, end: str = '') -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [','.join(f'{value:.9f}'.rstrip('0').rstrip('.') for value in row) + end for row in rows.tolist()]
    path.write_text('\n'.join([*filter(None, [header]), *lines, '']))


def biotac20(clone: Path) -> None:
    time_s = 1581073084.5 + 0.01 * np.arange(400)[:, None]
    counts = 100 + np.arange(400 * 44).reshape(400, 44) % 50
    for slide in (1, 2):
        place = clone / 'raw_data/mat7' / f'mat7_{slide}'
        table(place.with_name(f'{place.name}_bio.csv'), 'timestamp,tdc', np.hstack([time_s, counts]), ',')
        velocity = np.tile([-0.02, 0.0, 0.0, 0.0, 0.0, 0.0], (400, 1))
        table(place.with_name(f'{place.name}_cv.csv'), 'timestamp,x', np.hstack([time_s + 0.25, velocity]))
        wrench = np.tile([0.0, 0.0, 8.0, 0.0, 0.0, 0.0], (400, 1))
        table(place.with_name(f'{place.name}_cw.csv'), 'timestamp,x', np.hstack([time_s + 0.25, wrench]))


def ntp21(clone: Path) -> None:
    rows = np.hstack([np.arange(8000).reshape(800, 10) % 7, 5.0 + np.arange(800)[:, None] / 320])
    for number in (3, 4):
        name = f'Data[Texture({number:03d})][Speed(1200)][Force(0.5)][Trial(1)].csv'
        table(clone / f'data/processed/Texture{number:03d}' / name, '', rows)


def fabricslide(clone: Path) -> None:
    rows = np.hstack([28 * np.arange(300)[:, None], 50 + np.arange(300 * 18).reshape(300, 18) % 40])
    for name in ('fabric/Linen_F120_V-10mmps_0', 'fabric/Canvas_F120_V-10mmps_0', 'board/Board2mm_F120_V-10mmps_0'):
        table(clone / f'data/{name}.csv', 'timestamp, proximity1', rows)


SETS: dict[str, tuple[Callable[[Path], None], set[str]]] = {
    'biotac20': (biotac20, {'material07'}),
    'ntp21': (ntp21, {'texture03', 'texture04'}),
    'fabricslide': (fabricslide, {'Linen', 'Canvas', 'Board2mm'}),
}


@pytest.mark.parametrize('name', SETS)
def test_what_is_packed_is_imported(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    publish, surfaces = SETS[name]
    publish(tmp_path / 'clone')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, 'argv', ['pack_public_sets.py', name, 'clone', 'data'])
    runpy.run_path(str(EXAMPLE), run_name='__main__')
    assert main(['import', name, f'data/{name}', 'bags']) == 0
    assert set(SlideDataset.from_bags(['bags']).labels.tolist()) == surfaces


def test_times_count_from_the_first_sample(tmp_path: Path) -> None:
    packers = runpy.run_path(str(EXAMPLE))
    biotac20(tmp_path)
    packed = packers['biotac20'](tmp_path)['material07']
    assert packed['slide01/epoch'] == 1581073084.5
    assert packed['slide02/frames'].shape == (400, 44)
    np.testing.assert_allclose(packed['slide01/velocity'][0], [0.25, -0.02, 0.0, 0.0], atol=1e-6)
    ntp21(tmp_path)
    assert packers['ntp21'](tmp_path)['slides']['texture03/speed020/force0.5'][[0, 320], -1].tolist() == [0.0, 1.0]
