# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drivers on their emulated devices: what the contract of all sensors does not cover."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sensor_rig import CASES, Feed, Rig, biotac, counting

from texture_core.types import lost_samples
from texture_drivers.biotac import BioTac
from texture_drivers.sensor import SensorParams
from texture_simulation.devices.fingers import ByteFaults, EmulatedBioTac, EmulatedDaq, EmulatedPvdf

pytestmark = pytest.mark.realtime

Make = Callable[..., Rig]


@pytest.fixture
def open_rig(tmp_path: Path) -> Iterator[Make]:
    with ExitStack() as rigs:

        def open_rig(name: str, sensor: Any = None, **changes: Any) -> Rig:
            """Return a rig with an opened sensor: another driver than of the catalogue, a changed case."""
            link = tmp_path / name
            rig = rigs.enter_context(Rig(name, link, case=replace(CASES[name], **changes)))
            rig.sensor = sensor(link) if sensor else rig.sensor
            rig.sensor.open()
            return rig

        yield open_rig


def board(
    open_rig: Make, serials: tuple[str, ...] = ('BT-0',), prefix: str = '', finger: int = 0, **options: Any
) -> Rig:
    """Return a rig with a board of BioTacs."""
    return open_rig(
        'biotac',
        lambda link: BioTac(SensorParams(device=str(link), finger=finger), **options),
        **vars(biotac(None, partial(EmulatedBioTac, serials=serials), prefix, fingers=len(serials))),
    )


def test_words_damaged_on_the_board_are_nan_and_no_neighbour_moves(open_rig: Make) -> None:
    rig = board(open_rig, serials=('BT-0', 'BT-1', ''), finger=1)
    rig.set(board_flip=0.01)
    batches = rig.signal_s(1.4)
    values = np.concatenate([batch.samples[:, 0] for batch in batches])
    assert 0.005 < np.isnan(values).mean() < 0.05  # two bytes a word
    assert len(set(rig.offsets(batches))) == 1
    assert lost_samples(batches) == 0
    assert rig.sensor.counts['damaged_words'] > 0


def test_the_serial_number_is_reported(open_rig: Make) -> None:
    rig = board(open_rig)
    rig.signal_s(1.5)
    assert rig.sensor.details['serial of finger 0'] == 'BT-0'


def test_all_fingers_of_a_board_have_separate_topics(open_rig: Make) -> None:
    rig = board(open_rig, serials=('BT-0', 'BT-1', ''), prefix='finger1/', fingers=(0, 1, 2))
    topics = rig.read_s(0.1)
    assert set(topics) == {f'finger{n}/{topic}' for n in range(2) for topic in ('signal', 'signal_static')}


def test_a_rate_that_nobody_set_is_measured_and_kept(open_rig: Make) -> None:
    rig = open_rig('anyskin', config='')
    first = rig.signal_s(0.2)[0]
    assert first.sampling_rate_hz == pytest.approx(250.0, abs=2.0)
    assert first.sampling_rate_hz == round(first.sampling_rate_hz)
    rig.sensor.close()
    rig.sensor.open()
    again = rig.signal_s(0.2)[0]
    assert again.sampling_rate_hz == first.sampling_rate_hz == rig.sensor.expected_rates_hz['signal']


# Another kind of frame, and the right ones of a PVDF finger taken for decimal numbers.
KIND_2 = {topic: stream._replace(kind=2) for topic, stream in EmulatedDaq.STREAMS.items()}
DECIMAL = {topic: stream._replace(kind=stream.kind - 6) for topic, stream in EmulatedPvdf.STREAMS.items()}


@pytest.mark.parametrize(
    ('name', 'silence', 'other', 'babble'),
    [
        ('daq', 'sends nothing', {'faults': ByteFaults(flip=0.2)}, 'no valid frame.*baud'),
        (
            'daq',
            'sends nothing',
            {'STREAMS': KIND_2},
            'sends frames of kind 0x02 instead of 0x01; check .*right device',
        ),
        ('pvdf', 'sends nothing', {'STREAMS': DECIMAL}, 'kind 0x0A, 0x0B instead of 0x10, 0x11'),
        ('tsf85', 'sends nothing, started', {'wrong_firmware': True}, 'no known packet'),
    ],
)
def test_a_silent_device_and_one_that_sends_other_bytes_have_different_reports(
    open_rig: Make, name: str, silence: str, other: dict[str, Any], babble: str
) -> None:
    rig = open_rig(name)
    rig.set(silent=True)
    assert silence in rig.fault()
    rig.set(silent=False, **other)
    rig.sensor.open()
    assert re.search(babble, rig.fault())


def test_a_device_never_waits_for_a_host_that_does_not_read(tmp_path: Path) -> None:
    device = EmulatedDaq(tmp_path / 'new' / 'daq', np.random.default_rng(0))
    device.plug()
    for first in range(0, 5000, 100):
        device.measure({'signal': counting(first, 100, 30_000, 8, 1)})
    assert device.dropped_bytes > 50_000
    device.unplug()


def swing(device: Any, first: int, ticks: int) -> None:
    """Feed a film that swings at 50 Hz, and a force that rises."""
    numbers = np.arange(first, first + ticks)[:, None, None]
    film = 1000 * np.sin(2 * np.pi * 50 / 4096 * numbers)
    device.measure({'signal': film, 'signal_static': numbers[numbers[:, 0, 0] % 64 == 0] // 64 % 3000})


SWING: dict[str, Feed] = {'feed': swing}


def test_film_and_force_come_as_two_streams_in_their_units(open_rig: Make) -> None:
    topics = open_rig('pvdf', config='', **SWING).read_s(1.0)
    film, force = topics['signal'], topics['signal_static']
    assert lost_samples(film) == lost_samples(force) == 0
    assert (film[0].sensor, film[0].units, film[0].sampling_rate_hz) == ('pvdf/film', ('pC',), 4096.0)
    assert (force[0].sensor, force[0].units, force[0].sampling_rate_hz) == ('pvdf/force', ('N',), 64.0)
    charge = np.concatenate([batch.samples for batch in film])
    assert charge.max() == pytest.approx(2.0, rel=0.01)  # 1000 counts of 0.002 pC
    assert np.diff(np.concatenate([batch.samples for batch in force]), axis=0) == pytest.approx(0.005, abs=1e-6)


def test_the_public_client_of_the_vendor_reads_each_packet_of_the_tsf85(tmp_path: Path) -> None:
    client_of = pytest.importorskip('pyrobotiqtactile').RobotiqTactileSensor
    link = tmp_path / 'tsf85'
    dynamic: list[int] = []
    with Rig('tsf85', link), client_of(port=str(link)) as client:
        client.configure(update_period_ms=1)
        while len(dynamic) < 1000:
            for packet in client.parser.feed(client.serial_port.read(200)):
                client.parser.parse_sensor_packet(packet)
                dynamic.append(client.parser.fingers[0].dynamic_tactile)
        pressure = client.read_frame().pressure
    # A packet of an image alone repeats the value; no other is skipped, repeated or misread.
    assert set(np.diff(dynamic) % 1000) == {0, 1}
    assert np.mean(np.diff(dynamic) == 0) < 0.5
    assert pressure.shape == (2, 7, 4)
    assert pressure[0].any()
