# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tables with random rates, jitter, drops, repeats, swaps, resets, rollovers and bursts: true samples, or a refusal."""

import os
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_recordings.dataset import SlideDataset
from texture_recordings.mapping import mapping_from
from texture_recordings.tables import import_tables

FAULTS = ['drops', 'heavy drops', 'repeats', 'heavy repeats', 'swaps', 'resets', 'rollover', 'bursts', 'uneven bursts']
FAULTS += ['spikes', 'twice']
# Next to these a row with a wrong time contradicts nothing.
UNSURE = {'drops', 'heavy drops', 'swaps', 'repeats', 'heavy repeats', 'twice'}
VALUES = np.random.default_rng(0).permutation(4000)  # of samples by their number, which alone would be a counter
NUMBERS = np.append(np.argsort(VALUES), 0).astype(float)
TRIES = int(os.environ.get('IMPORT_TRIES', '150'))


def run_of(rng: np.random.Generator, rate_hz: float, first: int) -> np.ndarray:
    """Return one run, (n, 2): times in s, and the number of each sample, by which it is known again."""
    numbers = first + np.arange(int(rng.integers(150, 500)))
    jitter = rng.choice([0.0, 0.05, 0.2]) * rng.uniform(-1, 1, len(numbers))
    return np.column_stack([(np.arange(len(numbers)) + jitter) / rate_hz, numbers])


def stamped(rng: np.random.Generator, times: np.ndarray, rate_hz: float, faults: list[str]) -> np.ndarray:
    """Return times as a buffer stamps them, of one size or read at any time, also as a coarse clock does."""
    if 'bursts' in faults:
        size = int(rng.integers(2, 12))
        rows = np.arange(len(times))
        return times[(rows // size) * size] + rng.choice([0.0, 0.01]) * (rows % size) / rate_hz
    if 'uneven bursts' in faults:
        even = rng.choice([[1.0, 1.0], [0.5, 1.5]])
        reads_s = np.cumsum(rng.uniform(*even, len(times))) * rng.uniform(2, 9) / rate_hz
        return reads_s[np.searchsorted(reads_s, times)]
    return times


def damaged(rng: np.random.Generator, rate_hz: float, faults: list[str]) -> tuple[np.ndarray, str]:
    """Return rows with faults, and the unit of their times."""
    runs = [run_of(rng, rate_hz, 1000 * number) for number in range(3 if 'resets' in faults else 1)]
    for run in runs:
        run[:, 0] = stamped(rng, run[:, 0], rate_hz, faults)
    start_s = 0.0 if 'resets' in faults or rng.random() < 0.5 else float(rng.choice([1.7e9, 5.0, 12345.678]))
    rows = np.concatenate(runs) + np.array([start_s, 0.0])
    for fault, fraction in (('drops', 0.05), ('heavy drops', 0.6)):
        if fault in faults:
            rows = rows[rng.random(len(rows)) > fraction * rng.random()]
    for fault, fraction in (('repeats', 0.05), ('heavy repeats', 0.5)):
        if fault in faults:
            rows = np.repeat(rows, 1 + (rng.random(len(rows)) < fraction * rng.random()), axis=0)
    if 'twice' in faults:
        rows = np.repeat(rows, 2, axis=0)
    if 'swaps' in faults:
        for row in rng.integers(0, len(rows) - 4, max(1, int(0.05 * rng.random() * len(rows)))).tolist():
            if rows[row, 0] != rows[row + 3, 0]:  # rows of one stamp count in the order of the file
                rows[[row, row + 3]] = rows[[row + 3, row]]
    if 'spikes' in faults and not UNSURE & {*faults}:
        far_s = rng.choice([-1, 1]) * rng.choice([0.01, 0.1, 10.0, 1e5])
        rows[rng.integers(0, len(rows), int(rng.integers(1, 4))), 0] += far_s
    if 'rollover' in faults and 'resets' not in faults:  # a run may begin where the counter would go on
        rows[:, 0] = np.round(1e6 * rows[:, 0]) % 2**16 if rng.random() < 0.5 else np.round(1e3 * rows[:, 0]) % 1024
        return rows, 'us' if rows[:, 0].max() > 1100 else 'ms'
    return rows, 's'


def placed_as_recorded(dataset: SlideDataset) -> bool:
    """Return whether each sample is as far from the first of its slide as it was recorded."""
    for slide in dataset:
        batches = slide.signals['signal']
        index = np.concatenate([batch.first_sample + np.arange(len(batch.samples)) for batch in batches])
        values = np.concatenate([batch.samples[:, 0] for batch in batches])
        known = np.isfinite(values)
        numbers = NUMBERS[np.where(known, values, -1).astype(int)]
        if not np.array_equal(np.diff(index[known]), np.diff(numbers[known])):
            return False
    return True


def test_the_importer_gives_the_true_samples_or_refuses(tmp_path: Path) -> None:
    rng = np.random.default_rng(int(os.environ.get('IMPORT_SEED', '0')))
    outcomes: Counter[str] = Counter()
    for number in range(TRIES):
        rate_hz = float(rng.choice([25.0, 100.0, 400.0, 1000.0, 2200.0]) * rng.uniform(0.9, 1.1))
        faults = rng.choice(FAULTS, int(rng.integers(0, 4)), replace=False).tolist()
        rows, unit = damaged(rng, rate_hz, faults)
        folder = tmp_path / str(number)
        folder.mkdir()
        np.savetxt(
            folder / 'cork_1.csv',
            np.c_[rows[:, 0], VALUES[rows[:, 1].astype(int)]],
            '%.9f',
            ',',
            header='t,x',
            comments='',
        )
        mapping = mapping_from({
            'files': '{material}_{run}.csv',
            'streams': {'signal': {'columns': ['x'], 'time': {'column': 't', 'unit': unit}}},
            'label': {'column': 'material'}, 'slides': {'by': str(rng.choice(['file', 'pause'])), 'min_s': 0.05},
        })  # fmt: skip
        try:
            report = import_tables(mapping, folder, folder / 'bags')
        except InvalidData as error:
            assert "'cork_1.csv'" in str(error) or 'no slide of' in str(error)
            outcomes['refused'] += 1
            assert faults, f'try {number} has no fault, and is refused: {error}'
            continue
        outcomes['imported'] += 1
        if not placed_as_recorded(SlideDataset.from_bags(report.bags)):
            pytest.fail(
                f'try {number} at {rate_hz:g} Hz with {faults} gives other samples: ' + '\n'.join(report.lines())
            )
    assert min(outcomes['refused'], outcomes['imported']) > 0.1 * TRIES, outcomes
