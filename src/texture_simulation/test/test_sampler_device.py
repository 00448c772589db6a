"""The drivers of DAQ and PVDF finger on emulated devices: what the contract of all sensors does not ask."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sensor_rig import CASES, Feed, Rig

from texture_core.types import lost_samples
from texture_simulation.devices.fingers import ByteFaults, EmulatedDaq, FrameFaults

pytestmark = pytest.mark.realtime

Make = Callable[..., Rig]


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Make]:
    with ExitStack() as rigs:

        def make(name: str = 'daq', *, start_us: int | None = None, **changes: Any) -> Rig:
            link = tmp_path / name
            device = None if start_us is None else EmulatedDaq(link, np.random.default_rng(0), start_us)
            rig = rigs.enter_context(Rig(name, link, case=replace(CASES[name], **changes), device=device))
            rig.sensor.open()
            return rig

        yield make


def test_the_channels_keep_their_order(make: Make) -> None:
    def feed(device: Any, first: int, ticks: int) -> None:
        device.sample(np.outer(np.arange(first, first + ticks) % 30_000, [1, 0, 0, 0, 0, 0, 0, -1]).astype(np.int16))

    last = make(feed=feed).signal_s(0.5)[-1]
    assert last.samples[0, 0] > 0
    np.testing.assert_array_equal(last.samples[:, 7], -last.samples[:, 0])


def test_sequence_and_clock_wrap_without_a_trace(make: Make) -> None:
    rig = make(start_us=2**32 - 1_000_000)
    rig.device._frames['daq'] = 65_536 - 200
    batches = rig.signal_s(1.5)
    assert len(set(rig.offsets(batches))) == 1
    assert rig.sensor.counts['lost'] == rig.sensor.counts['device restarts'] == 0


def test_frames_sent_twice_are_counted_and_no_others(make: Make) -> None:
    rig = make()
    rig.set(frame_faults=FrameFaults(skip=0.05, duplicate=0.05))
    rig.signal_s(1.0)
    assert rig.sensor.counts['repeated frames'] > 0
    assert rig.sensor.counts['bogus'] == rig.sensor.counts['left out by the device'] == 0


def test_a_brown_out_is_survived_and_the_gap_is_reported(make: Make) -> None:
    rig = make()
    batches = rig.signal_s(0.5)
    rig.run_locked(rig.device.reset)
    batches += rig.signal_s(0.5)
    assert rig.sensor.counts['device restarts'] == 1
    assert lost_samples(batches) == rig.sensor.counts['lost']
    first, last = batches[0], batches[-1]
    elapsed_s = (last.stamp_ns - first.stamp_ns) / 1e9
    assert (last.first_sample - first.first_sample) / 2500 == pytest.approx(elapsed_s, abs=0.05)


def test_a_silent_device_and_a_babbling_one_are_reported_apart(make: Make) -> None:
    rig = make()
    rig.set(silent=True)
    assert 'sends nothing' in rig.fault()
    rig.set(silent=False, faults=ByteFaults(flip=0.2))
    rig.sensor.open()
    assert 'no valid frame' in (babble := rig.fault())
    assert 'baud' in babble


def test_settings_that_name_other_channels_are_refused_in_one_sentence(make: Make) -> None:
    assert 'sends 8 channels, and 2 are named' in make(config='{channels: [{name: a}, {name: b}]}').fault()


def swing(device: Any, first: int, ticks: int) -> None:
    """Feed a film that swings at 50 Hz, and a force that rises."""
    numbers = np.arange(first, first + ticks)
    film = 1000 * np.sin(2 * np.pi * 50 / 4096 * numbers)
    device.sample(film.astype(np.int16), (numbers[numbers % 64 == 0] // 64 % 3000).astype(np.int16))


SWING: dict[str, Feed] = {'feed': swing}


def test_film_and_force_come_as_two_streams_in_their_units(make: Make) -> None:
    topics = make('pvdf', config='', **SWING).read_s(1.0)
    film, force = topics['signal'], topics['signal_static']
    assert lost_samples(film) == lost_samples(force) == 0
    assert (film[0].sensor, film[0].units, film[0].sampling_rate_hz) == ('pvdf/film', ('pC',), 4096.0)
    assert (force[0].sensor, force[0].units, force[0].sampling_rate_hz) == ('pvdf/force', ('N',), 64.0)
    charge = np.concatenate([batch.samples for batch in film])
    assert charge.max() == pytest.approx(2.0, rel=0.01)  # 1000 counts of 0.002 pC
    assert np.diff(np.concatenate([batch.samples for batch in force]), axis=0) == pytest.approx(0.005, abs=1e-6)


def test_the_force_on_the_film_is_restored_if_wanted(make: Make) -> None:
    batches = make('pvdf', config='{restore_from_hz: 0.5}', **SWING).signal_s(2.0)
    assert batches[-1].units == ('N',)
    late = np.concatenate([batch.samples for batch in batches])[4096:]
    assert np.ptp(late) / 2 == pytest.approx(2.0 / 21.0, rel=0.05)  # far above the corner nothing leaks
