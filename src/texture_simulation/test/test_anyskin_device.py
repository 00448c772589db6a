"""The driver of the AnySkin on its emulated board: what the contract of all sensors does not ask."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sensor_rig import CASES, Rig

from texture_core.types import lost_samples
from texture_simulation.devices.fingers import ByteFaults, FrameFaults

pytestmark = pytest.mark.realtime
OPENINGS = 3  # beside other tests the emulated board may get no processor time for a second

Make = Callable[..., Rig]


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Make]:
    with ExitStack() as rigs:

        def make(**changes: Any) -> Rig:
            rig = rigs.enter_context(Rig('anyskin', tmp_path / 'anyskin', case=replace(CASES['anyskin'], **changes)))
            rig.sensor.open()
            return rig

        yield make


def test_a_rate_that_nobody_set_is_measured_and_kept(make: Make) -> None:
    rig = make(config='')
    first = rig.signal_s(0.2)[0]
    assert first.sampling_rate_hz == pytest.approx(250.0, abs=2.0)
    assert first.sampling_rate_hz == round(first.sampling_rate_hz)
    rig.sensor.close()
    rig.sensor.open()
    again = rig.signal_s(0.2)[0]
    assert again.sampling_rate_hz == first.sampling_rate_hz == rig.sensor.expected_rates_hz['signal']


def test_the_axes_keep_their_order_and_names(make: Make) -> None:
    def feed(device: Any, first: int, ticks: int) -> None:
        device.sample(np.tile(np.arange(15.0), (ticks, 1)))

    batch = make(feed=feed).signal_s(0.2)[-1]
    assert batch.channels[:4] == ('m0_x', 'm0_y', 'm0_z', 'm1_x')
    np.testing.assert_array_equal(batch.samples[0], np.arange(15.0))


def test_the_temperature_is_published_if_wanted(make: Make) -> None:
    assert 'temperature' not in make(config='{rate_hz: 250.0}').read_s(0.2)
    temperature = make().read_s(0.2)['temperature'][-1]
    assert temperature.channels == ('m0', 'm1', 'm2', 'm3', 'm4')
    assert temperature.samples == pytest.approx(31.25)


def test_frames_left_out_in_a_row_are_known_soon_after(make: Make) -> None:
    rig = make()
    batches = rig.signal_s(1.5)
    rig.set(frame_faults=FrameFaults(skip=1.0))
    for _ in range(20):
        batches += rig.sensor.read().get('signal', [])
    rig.set(frame_faults=FrameFaults())
    batches += rig.signal_s(2.0)
    assert lost_samples(batches) == rig.sensor.counts['lost'] > 0
    assert abs(rig.lateness_s(batches[-1])) < 0.03


def test_another_board_is_reported(make: Make) -> None:
    rig = make(config='{magnetometers: 4, rate_hz: 250.0}')
    assert 'no valid frame' in rig.fault()


def test_bytes_of_noise_alone_are_reported_and_none_is_published(make: Make) -> None:
    rig = make()
    rig.set(faults=ByteFaults(flip=0.3))
    sentences = [rig.fault()]
    while 'sends nothing' in sentences[-1] and len(sentences) < OPENINGS:
        rig.sensor.close()
        rig.sensor.open()
        sentences.append(rig.fault())
    assert 'bytes but no valid frame' in sentences[-1]
    assert rig.sensor.counts['samples'] == 0


def test_a_brown_out_of_the_board_is_survived_and_nothing_moves(make: Make) -> None:
    rig = make()
    batches = rig.signal_s(0.5)
    rig.run_locked(rig.device.reset)
    batches += rig.signal_s(0.5)
    assert len(set(rig.offsets(batches))) == 1
    assert rig.sensor.counts['bogus'] == 0
