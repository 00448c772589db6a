# SPDX-License-Identifier: Apache-2.0
import os
import tty
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from texture_simulation.devices.fingers import EmulatedTsf85, FrameFaults

pytestmark = pytest.mark.realtime

TEN_MS = np.arange(10, dtype=np.int16)
NO_IMAGE = np.empty((0, 28), dtype=np.uint16)
START, STOP = bytes.fromhex('9A 00 58 01 01'), bytes.fromhex('9A 00 58 01 00')


@pytest.fixture
def device(tmp_path: Path) -> Iterator[EmulatedTsf85]:
    made = EmulatedTsf85(tmp_path / 'new' / 'tsf85', np.random.default_rng(0))
    made.plug()
    yield made
    made.unplug()


class Host:
    def __init__(self, link: Path) -> None:
        self.end = os.open(link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.end)

    def read(self) -> bytes:
        try:
            return os.read(self.end, 100_000)
        except BlockingIOError:
            return b''


@pytest.fixture
def host(tmp_path: Path, device: EmulatedTsf85) -> Iterator[Host]:
    made = Host(tmp_path / 'new' / 'tsf85')
    yield made
    os.close(made.end)


def test_it_streams_from_start_to_stop_only(device: EmulatedTsf85, host: Host) -> None:
    device.advance(TEN_MS, NO_IMAGE)
    assert host.read() == b''
    os.write(host.end, START)
    device.advance(TEN_MS, NO_IMAGE)
    assert host.read().count(b'\x9a\x00\x58') == 10
    os.write(host.end, STOP)
    device.advance(TEN_MS, NO_IMAGE)
    assert host.read() == b''


def test_a_command_is_understood_in_pieces_and_after_noise(device: EmulatedTsf85, host: Host) -> None:
    for piece in (b'\x00\xff', START[:2], START[2:]):
        os.write(host.end, piece)
        device.advance(TEN_MS[:1], NO_IMAGE)
    assert device.streaming


def test_it_never_waits_for_a_host_that_does_not_read(device: EmulatedTsf85, host: Host) -> None:
    os.write(host.end, START)
    for _ in range(200):
        device.advance(TEN_MS, NO_IMAGE)
    assert device.dropped_bytes > 50_000


def test_unplugging_breaks_the_port_and_removes_the_link(device: EmulatedTsf85, host: Host, tmp_path: Path) -> None:
    device.unplug()
    device.unplug()
    with pytest.raises(OSError, match='Input/output'):
        os.write(host.end, START)
    assert not os.path.lexists(tmp_path / 'new' / 'tsf85')
    device.advance(TEN_MS, NO_IMAGE)
    device.plug()
    assert (tmp_path / 'new' / 'tsf85').exists()
    assert not device.streaming


def test_after_an_unclean_end_it_takes_several_starts(device: EmulatedTsf85, host: Host) -> None:
    device.ignored_starts = 2
    came = []
    for _ in range(3):
        os.write(host.end, STOP + START)
        device.advance(TEN_MS, NO_IMAGE)
        came.append(bool(host.read()))
    assert came == [False, False, True]


def test_packets_are_left_out_sent_twice_and_held_back(device: EmulatedTsf85, host: Host) -> None:
    os.write(host.end, START)
    device.frame_faults = FrameFaults(skip=1.0)
    device.advance(TEN_MS, NO_IMAGE)
    assert host.read() == b''
    device.frame_faults = FrameFaults(duplicate=1.0)
    device.advance(TEN_MS, NO_IMAGE)
    assert host.read().count(b'\x9a\x00\x58') == 20
    device.frame_faults, device.stalled = FrameFaults(), True
    device.advance(TEN_MS, NO_IMAGE)
    assert host.read() == b''
    device.stalled = False
    device.advance(TEN_MS, NO_IMAGE)
    assert host.read().count(b'\x9a\x00\x58') == 20
