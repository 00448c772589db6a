# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys
from collections import deque
from types import SimpleNamespace

import pytest

from texture_core.errors import DeviceError
from texture_drivers.biotac import LAYOUTS, QUEUED_FRAMES, Cheetah, decode

BIOTAC = LAYOUTS['biotac']
SERIAL = b'BT2P0220B11E0004'


def odd(byte: int) -> int:
    return byte | (byte.bit_count() + 1) % 2


class StandIn:
    """A Cheetah with one BioTac at the first place, at the level of the calls of the vendor's module."""

    CH_PORT_NOT_FREE, CH_SPI_BITORDER_MSB, CH_TARGET_POWER_ON = 0x8000, 0, 1

    def __init__(self) -> None:
        self.ports = [0x8000, 1]
        self.queue: list[tuple[str, int]] = []
        self.slept_ns = 0
        self.pending: deque[bytes] = deque()
        self.opened = self.closed = 0
        self.status = 0

    def ch_find_devices_ext(self, ports: int, ids: int) -> tuple[int, list[int], list[int]]:
        return len(self.ports), self.ports, [0] * len(self.ports)

    def ch_open(self, port: int) -> int:
        self.opened = port
        return 5

    def ch_close(self, handle: int) -> int:
        self.closed += 1
        return 0

    def ch_spi_configure(self, handle: int, polarity: int, phase: int, order: int, selects: int) -> int:
        assert (polarity, phase, order, selects) == (0, 0, 0, 0)
        return 0

    def ch_spi_bitrate(self, handle: int, khz: int) -> int:
        assert khz == 4400
        return khz

    def ch_target_power(self, handle: int, on: int) -> int:
        return on

    def ch_sleep_ms(self, ms: int) -> int:
        return ms

    def ch_spi_queue_clear(self, handle: int) -> int:
        self.queue, self.slept_ns = [], 0
        return 0

    def ch_spi_queue_oe(self, handle: int, on: int) -> int:
        return 0

    def ch_spi_queue_ss(self, handle: int, select: int) -> int:
        self.queue.append(('select', select))
        return 0

    def ch_spi_queue_byte(self, handle: int, count: int, byte: int) -> int:
        self.queue += [('byte', byte)] * count
        return 0

    def ch_spi_queue_delay_ns(self, handle: int, ns: int) -> int:
        self.slept_ns += ns
        return ns

    def ch_spi_batch_shift(self, handle: int, size: int) -> tuple[int, bytes]:
        data = self.shift()
        return len(data), data

    def ch_spi_async_submit(self, handle: int) -> int:
        self.pending.append(self.shift())
        return self.status

    def ch_spi_async_collect(self, handle: int, size: int) -> tuple[int, bytes]:
        data = self.pending.popleft()
        return len(data), data

    def ch_status_string(self, status: int) -> str:
        return 'communication error'

    def shift(self) -> bytes:
        """What comes back: the BioTac at select 1 answers with its serial number, or with the command it was given."""
        answer, heard, select, out = deque[int](), [], 0, []
        for kind, value in self.queue:
            if kind == 'select':
                if value == 0 and heard[:2] == [0x61, 0x15]:
                    answer, heard = deque(SERIAL), []
                elif value == 0 and heard and heard[0] & 0x80:
                    answer, heard = deque([odd(heard[0] & 0x7E), odd(0)]), []
                select = value
            elif select == 1 and answer:
                out.append(answer.popleft())
            else:
                heard += [value] if select in (1, 7) else []
                out.append(0xFF)
        return bytes(out)


@pytest.fixture
def api(monkeypatch: pytest.MonkeyPatch) -> StandIn:
    stand_in = StandIn()
    monkeypatch.setitem(sys.modules, 'cheetah_py', stand_in)
    return stand_in


def test_frames_hold_what_the_biotac_answered_to_each_command(api: StandIn) -> None:
    link = Cheetah(BIOTAC)
    link.open()
    frames = [frame for _ in range(3) for frame in link.read()]
    assert [(frame.number, frame.time_us, frame.fingers) for frame in frames] == [
        (0, 0, 3),
        (1, 10_000, 3),
        (2, 20_000, 3),
    ]
    replies = decode(frames[0].reply, BIOTAC, 3)
    assert replies.damaged.tolist() == [0, 44, 44]
    # The stand-in answers with bits 6..1 of the command: twice the index, in the upper seven bits of the word.
    slow = dict(zip(BIOTAC.slow_channels, replies.slow[0, :, 0].tolist(), strict=True))
    assert (slow['tdc'], slow['pdc'], slow['electrode1']) == (3 * 32, 1 * 32, 17 * 32)
    assert (replies.pac[:, 0] == 0).all()
    assert link.serials == (SERIAL.decode(), '', '')
    assert (api.opened, len(api.pending)) == (1, QUEUED_FRAMES)
    link.close()
    link.close()
    assert api.closed == 1


def test_after_a_pause_of_the_host_a_new_epoch_begins_behind_the_queue(api: StandIn) -> None:
    clock = SimpleNamespace(now=0.0)
    link = Cheetah(BIOTAC, lambda: clock.now)
    link.open()
    before = link.read()[0].epoch
    clock.now += 1.0
    epochs = [link.read()[0].epoch for _ in range(QUEUED_FRAMES + 2)]
    assert epochs == [before] * QUEUED_FRAMES + [before + 1] * 2
    assert link.counts == {'pauses': 1}


def test_without_the_vendors_module_the_sentence_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'cheetah_py', None)
    with pytest.raises(DeviceError, match=r"Total Phase's Python module 'cheetah_py'.*serial bridge"):
        Cheetah(BIOTAC).open()


def test_an_adapter_in_use_or_failing_is_reported(api: StandIn) -> None:
    link = Cheetah(BIOTAC)
    link.open()
    api.status = -8
    with pytest.raises(DeviceError, match=r'submitting commands failed.*communication error'):
        link.read()
    api.ports = [0x8000]
    with pytest.raises(DeviceError, match='no free Cheetah adapter'):
        Cheetah(BIOTAC).open()
