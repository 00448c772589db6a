# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every sensor that has a device must do, on that device emulated at protocol level."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from sensor_rig import CASES, Rig

from texture_core.errors import DeviceError
from texture_core.types import lost_samples
from texture_drivers.catalogue import SENSORS
from texture_simulation.devices.fingers import ByteFaults, FrameFaults

pytestmark = pytest.mark.realtime

# A card that miniaudio opens, whose rows of the contract are in test_sound_card.py.
WITHOUT_DEVICE = {'sound_card'}


LINES = {name: case.line for name, case in CASES.items() if case.line}
Make = Callable[..., Rig]


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Make]:
    rigs: list[Rig] = []

    def make(name: str, **options: float) -> Rig:
        rigs.append(Rig(name, tmp_path / name, **options))
        return rigs[-1]

    yield make
    for rig in rigs:
        rig.close()


@pytest.mark.parametrize('name', sorted({*SENSORS, *CASES, *WITHOUT_DEVICE}))
def test_a_sensor_is_tested_on_its_device(name: str) -> None:
    assert name in SENSORS, f"'{name}' is no sensor; list it in SENSORS of texture_drivers/catalogue.py"
    assert (name in CASES) != (name in WITHOUT_DEVICE), (
        f"list '{name}' once: in CASES of sensor_rig.py with its emulated device, or in WITHOUT_DEVICE of this file"
    )


@pytest.mark.parametrize('name', LINES)
def test_a_driver_reports_a_silent_device_and_other_firmware(name: str) -> None:
    assert LINES[name].silent, (
        f"give in the Line of '{name}' in sensor_rig.py what its driver reports of a silent device"
    )
    assert LINES[name].wrong, f"give in the Line of '{name}' in sensor_rig.py what its driver reports of other firmware"


@pytest.mark.parametrize('name', CASES)
def test_what_was_sampled_arrives_in_its_place_unit_and_time(make: Make, name: str) -> None:
    rig = make(name)
    rig.sensor.open()
    topics = rig.read_s(0.6)
    batches = topics[rig.case.topic]
    assert len(set(rig.offsets(batches))) == 1
    assert lost_samples(batches) == rig.sensor.counts['lost'] == rig.sensor.counts['bogus'] == 0
    assert rig.sensor.counts['samples'] >= sum(len(batch.samples) for batch in batches)
    for topic, units in rig.case.units.items():
        batch = topics[topic][-1]
        assert batch.units == (units if isinstance(units, tuple) else (units,) * len(batch.channels))
        assert topic == rig.case.resting or rig.in_order(batch), f'{topic}: a channel is not in its place, or no count'
    for topic, rate_hz in rig.sensor.expected_rates_hz.items():
        assert {batch.sampling_rate_hz for batch in topics[topic]} == {rate_hz}
        assert all(after.stamp_ns > before.stamp_ns for before, after in pairwise(topics[topic]))
    late_s = [rig.lateness_s(batch) for batch in batches]
    assert abs(np.median(late_s)) < 0.03


@pytest.mark.parametrize('name', LINES)
def test_it_may_be_opened_and_closed_any_number_of_times(make: Make, name: str) -> None:
    rig = make(name)
    batches = []
    for _ in range(3):
        rig.sensor.open()
        batches += rig.signal_s(0.1)
        rig.sensor.close()
        rig.sensor.close()
    assert rig.sensor.counts['reopened'] == 2
    assert all(after.first_sample >= before.next_sample for before, after in pairwise(batches))
    assert all(after.stamp_ns >= before.end_ns - 20e6 for before, after in pairwise(batches))


def give_away(name: Path) -> list[int]:
    """Return what holds the name of a terminal that has just become free."""
    ends: list[int] = []
    for _ in range(50):  # as many as may be free below it
        ends += os.openpty()
        if os.ttyname(ends[-1]) == str(name):
            break
    return ends


@pytest.mark.parametrize('name', LINES)
def test_replugged_under_another_name_it_goes_on_at_the_index_of_the_time(make: Make, name: str) -> None:
    rig = make(name)
    rig.sensor.open()
    last, first_name = rig.signal_s(0.2)[-1], rig.link.readlink()
    rig.run_locked(rig.device.unplug)
    assert rig.fault()
    with pytest.raises(DeviceError, match=str(rig.link)):
        rig.sensor.open()
    taken = give_away(first_name)
    rig.run_locked(rig.device.plug)
    assert rig.link.readlink() != first_name
    first = rig.signal_s(0.1)[0]
    for end in taken:
        os.close(end)
    gap_s = (first.stamp_ns - last.end_ns) / 1e9
    assert (first.first_sample - last.next_sample) / rig.case.rate_hz == pytest.approx(gap_s, abs=0.03)
    assert rig.sensor.counts['lost'] > 0
    assert rig.sensor.counts['reopened'] >= 1


@pytest.mark.parametrize('name', LINES)
def test_a_second_program_is_refused_and_the_first_is_not_disturbed(make: Make, name: str) -> None:
    rig = make(name)
    rig.sensor.open()
    batches = rig.signal_s(0.1)
    with pytest.raises(DeviceError, match='no other program has it open'):
        rig.another().open()
    batches += rig.signal_s(0.1)
    assert lost_samples(batches) == 0


@pytest.mark.parametrize('name', LINES)
def test_a_device_that_opens_and_stays_silent_is_reported_by_its_path(make: Make, name: str) -> None:
    rig = make(name)
    rig.set(silent=True)
    rig.sensor.open()
    began_s = time.monotonic()
    fault = rig.fault()
    assert str(rig.link) in fault
    assert LINES[name].silent in fault
    assert time.monotonic() - began_s < 10.0
    rig.set(silent=False)
    assert rig.signal_s(0.1)


@pytest.mark.parametrize('name', LINES)
def test_wrong_firmware_is_an_error_and_none_of_it_is_published(make: Make, name: str) -> None:
    rig = make(name)
    rig.set(wrong_firmware=True)
    rig.sensor.open()
    assert LINES[name].wrong in rig.fault()
    assert rig.sensor.counts['samples'] == 0


@pytest.mark.parametrize('name', LINES)
def test_bytes_lost_added_or_changed_are_counted_and_no_sample_moves(make: Make, name: str) -> None:
    rig = make(name)
    rig.sensor.open()
    batches = rig.signal_s(0.1)
    rig.set(faults=ByteFaults(**dict.fromkeys(('drop', 'insert', 'flip'), LINES[name].fault_rate)))
    batches += rig.signal_s(1.0)
    offsets = rig.offsets(batches)
    right = int(np.bincount(offsets.astype(int)).max())
    assert rig.sensor.counts['bogus'] > 0
    assert lost_samples(batches) > 0
    # Without a checksum a flipped bit of a value cannot be seen, nor a byte lost and one added within one frame; it
    # spoils that frame alone.
    needed = len(offsets) if LINES[name].checked else 0.98 * len(offsets)
    assert right >= needed, f'{right} of {len(offsets)} samples are in their place, {needed:.0f} must be'


@pytest.mark.parametrize('name', [name for name in LINES if LINES[name].numbered])
def test_frames_left_out_are_lost_and_those_sent_twice_come_once(make: Make, name: str) -> None:
    rig = make(name)
    rig.sensor.open()
    batches = rig.signal_s(0.1)
    rig.set(frame_faults=FrameFaults(duplicate=0.1))
    batches += rig.signal_s(0.5)
    rig.set(frame_faults=FrameFaults())
    batches += rig.signal_s(0.1)
    assert lost_samples(batches) == 0
    assert len(set(rig.offsets(batches))) == 1
    rig.set(frame_faults=FrameFaults(skip=0.3))
    more = rig.signal_s(0.5)
    assert 0.1 < lost_samples(more) / (more[-1].next_sample - more[0].first_sample) < 0.6
    assert len(set(rig.offsets(more))) == 1


@pytest.mark.parametrize('name', LINES)
def test_a_stall_of_the_line_delays_and_loses_nothing(make: Make, name: str) -> None:
    rig = make(name)
    rig.sensor.open()
    batches = rig.signal_s(0.4)
    rig.set(stalled=True)
    for _ in range(5):
        batches += rig.sensor.read().get(rig.case.topic, [])
    rig.set(stalled=False)
    batches += rig.signal_s(0.4)
    # Also on a machine that stalls, what was kept back may be more than the line takes at once.
    assert lost_samples(batches) == 0 or rig.device.dropped_bytes
    assert len(set(rig.offsets(batches))) == 1
    assert max(abs(rig.lateness_s(batch)) for batch in batches[len(batches) // 2 :]) < 0.04


@pytest.mark.parametrize('name', [name for name in LINES if LINES[name].restarts])
def test_after_a_brown_out_of_the_device_the_index_goes_on_with_the_time(make: Make, name: str) -> None:
    rig = make(name)
    rig.sensor.open()
    before = rig.read_s(0.3)
    rig.run_locked(rig.device.reset)
    topics = {topic: [*before.get(topic, []), *after] for topic, after in rig.read_s(0.5).items()}
    lost = {topic: lost_samples(batches) for topic, batches in topics.items()}
    assert rig.sensor.counts['lost'] in (
        lost[rig.case.topic],
        sum(lost.values()),
    )  # of a BioTac the PAC alone is counted
    first, last = topics[rig.case.topic][0], topics[rig.case.topic][-1]
    elapsed_s = (last.stamp_ns - first.stamp_ns) / 1e9
    assert (last.first_sample - first.first_sample) / rig.case.rate_hz == pytest.approx(elapsed_s, abs=0.05)


@pytest.mark.parametrize('name', LINES)
def test_a_clock_that_drifts_is_followed_and_reported(make: Make, name: str) -> None:
    rig = make(name, pace=1.004)
    rig.sensor.open()
    batches = rig.signal_s(3.0)
    assert lost_samples(batches) == 0
    assert len(set(rig.offsets(batches))) == 1
    assert rig.sensor.details['device clock slow by [ppm]'] == pytest.approx(-4000, abs=1500)
