from __future__ import annotations

import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_core.types import TactileSignal, lost_samples


def batch(first: int, count: int, **changes: object) -> TactileSignal:
    values = {
        'stamp_ns': 0,
        'sensor': 'tsf85/dynamic',
        'channels': ('dynamic',),
        'units': ('count',),
        'sampling_rate_hz': 1000.0,
        'first_sample': first,
        'samples': np.zeros((count, 1), dtype=np.float32),
        **changes,
    }
    return TactileSignal(**values)  # type: ignore[arg-type]


def test_ten_samples_at_one_kilohertz_last_ten_milliseconds() -> None:
    assert batch(0, 10).end_ns == 10_000_000


def test_a_jump_of_the_index_is_a_loss() -> None:
    assert lost_samples([batch(0, 10), batch(10, 10), batch(25, 10)]) == 5


@pytest.mark.parametrize(
    'changes',
    [
        {'samples': np.zeros(10, dtype=np.float32)},
        {'samples': np.zeros((10, 2), dtype=np.float32)},
        {'sampling_rate_hz': 0.0},
        {'sampling_rate_hz': float('nan')},
        {'sampling_rate_hz': 1e12},
        {'first_sample': -1},
        {'units': ('count', 'count')},
    ],
)
def test_a_signal_that_contradicts_itself_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(InvalidData, match='tsf85/dynamic'):
        batch(0, 10, **changes)


@pytest.mark.parametrize(
    ('units', 'common'), [(('Pa', 'Pa'), 'Pa'), (('Pa', 'N'), ''), ((), '')], ids=['equal', 'different', 'unknown']
)
def test_the_common_unit_is_that_of_all_channels(units: tuple[str, ...], common: str) -> None:
    signal = batch(0, 10, channels=('a', 'b'), units=units, samples=np.zeros((10, 2), dtype=np.float32))
    assert signal.common_unit == common
