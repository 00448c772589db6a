"""The driver of the PapillArray on its emulated hub: what the contract of all sensors does not ask."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sensor_rig import CASES, Rig, feed_papillarray

from texture_core.errors import InvalidParameter
from texture_core.types import lost_samples
from texture_drivers.papillarray import PapillArray
from texture_drivers.sensor import SensorParams
from texture_simulation.devices.fingers import EmulatedPapillArray

pytestmark = pytest.mark.realtime

Make = Callable[..., Rig]


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Make]:
    with ExitStack() as rigs:

        def make(name: str = 'papillarray', *, arrays: int = 1, **changes: Any) -> Rig:
            link = tmp_path / name
            device = EmulatedPapillArray(link, np.random.default_rng(0), arrays)
            rig = rigs.enter_context(Rig(name, link, case=replace(CASES[name], **changes), device=device))
            rig.sensor.open()
            return rig

        yield make


@pytest.mark.parametrize('rate_hz', [100, 500])
def test_the_hub_is_asked_for_the_rate_and_sends_it(make: Make, rate_hz: int) -> None:
    def feed(device: Any, first: int, ticks: int) -> None:
        numbers = np.arange(4 * first, 4 * (first + ticks))  # milliseconds
        device.sample(np.broadcast_to(numbers[:, None, None, None], (4 * ticks, 1, 9, 6)).astype(np.float64))

    rig = make(config=f'{{rate_hz: {rate_hz}}}', feed=feed)
    batches = rig.signal_s(0.2)
    assert rig.device.rate_hz == rate_hz
    assert batches[-1].sampling_rate_hz == rate_hz
    values = np.concatenate([batch.samples[:, 0] for batch in batches])
    assert set(np.diff(values)) == {1000 / rate_hz}


def test_a_rate_that_the_hub_cannot_do_is_refused() -> None:
    with pytest.raises(InvalidParameter, match='100, 250, 500, 1000'):
        PapillArray(SensorParams(device='/dev/null', config='{rate_hz: 300}'))


def test_the_force_on_the_array_is_the_sum_over_its_pillars(make: Make) -> None:
    topics = make().read_s(0.2)
    pillars, whole = topics['signal'][-1].samples, topics['wrench'][-1].samples
    np.testing.assert_allclose(whole[:, 0], pillars[:, ::6].sum(axis=1))


def test_an_array_that_the_hub_does_not_carry_is_reported(make: Make) -> None:
    assert 'array 1 is asked for, and the hub' in make('papillarray_pair', arrays=1, feed=feed_papillarray(1)).fault()


def test_the_bias_command_takes_the_present_values_for_none(make: Make) -> None:
    def feed(device: Any, first: int, ticks: int) -> None:
        device.sample(np.full((4 * ticks, 1, 9, 6), 0.25))

    rig = make(feed=feed)
    assert rig.signal_s(0.2)[-1].samples.max() == 0.25
    rig.sensor.send(b'z\n')
    assert np.abs(rig.signal_s(0.3)[-1].samples).max() == 0.0


def test_a_brown_out_of_the_hub_is_survived_and_the_gap_is_reported(make: Make) -> None:
    rig = make()
    batches = rig.signal_s(0.5)
    rig.run_locked(rig.device.reset)  # the hub is back at its usual rate, too: the driver asks for its own again
    deadline_s = time.monotonic() + 30.0
    while rig.device.rate_hz != 250:
        assert time.monotonic() < deadline_s
        batches += rig.sensor.read().get('signal', [])
    batches += rig.signal_s(0.5)
    assert rig.sensor.counts['device restarts'] >= 1
    assert lost_samples(batches) == rig.sensor.counts['lost']
    first, last = batches[0], batches[-1]
    elapsed_s = (last.stamp_ns - first.stamp_ns) / 1e9
    assert (last.first_sample - first.first_sample) / 250 == pytest.approx(elapsed_s, abs=0.05)
