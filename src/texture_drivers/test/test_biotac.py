# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest

from texture_core.errors import DeviceError
from texture_core.framing import Frame, FrameDecoder, pack
from texture_core.types import TactileSignal
from texture_drivers.biotac import (
    ERROR_WORDS,
    LAYOUTS,
    QUEUED_FRAMES,
    REPLY,
    SERIALS,
    BioTac,
    BioTacLayout,
    Cheetah,
    decode,
    sampling_command,
)
from texture_drivers.sensor import SensorParams

BIOTAC, BIOTAC_SP = LAYOUTS['biotac'], LAYOUTS['biotac_sp']
# Words worked out by hand: seven bits and odd parity, five bits, 00 and odd parity.
WORDS = {
    0: bytes([0b0000000_1, 0b00000_00_1]),
    4095: bytes([0b1111111_0, 0b11111_00_0]),
    2021: bytes([0b0111111_1, 0b00101_00_1]),  # 63 * 32 + 5
    1739: bytes([0b0110110_1, 0b01011_00_0]),  # 54 * 32 + 11
}


def slot(command: int, *values: int) -> bytes:
    return bytes([command, 0]) + b''.join(WORDS[value] for value in values)


def test_sampling_commands_are_those_of_the_header_file() -> None:
    known = {
        'pac': 0x80, 'pdc': 0x83, 'tac': 0x85, 'tdc': 0x86, 'electrode1': 0xA2, 'electrode2': 0xA4,
        'electrode3': 0xA7, 'electrode19': 0xC7, 'electrode20': 0xC8, 'electrode24': 0xD0,
    }  # fmt: skip
    assert {channel: sampling_command(channel) for channel in known} == known


def test_a_frame_samples_pac_in_every_second_slot() -> None:
    assert len(BIOTAC.slots) == 44
    assert BIOTAC.slots[:4] == ('electrode1', 'pac', 'electrode2', 'pac')
    assert BIOTAC.slots[36:] == ('electrode19', 'pac', 'pdc', 'pac', 'tac', 'pac', 'tdc', 'pac')
    assert (BIOTAC.frame_rate_hz, BIOTAC.pac_rate_hz, BIOTAC.pac_per_frame) == (100.0, 2200.0, 22)
    assert (len(BIOTAC_SP.slots), BIOTAC_SP.pac_per_frame, BIOTAC_SP.pac_rate_hz) == (54, 27, 2200.0)
    assert BIOTAC_SP.frame_rate_hz == pytest.approx(81.48, abs=0.01)


@pytest.mark.parametrize('value', WORDS)
def test_words_written_by_hand_give_their_values(value: int) -> None:
    replies = decode(slot(0x80, value) * 44, BIOTAC, fingers=1)
    assert replies.pac.shape == (22, 1)
    assert (replies.pac == value).all()
    assert not replies.damaged.any()


def test_each_channel_and_finger_gets_a_separate_word() -> None:
    frame = [slot(0xA2, 0, 0, 0), slot(0x80, 1739, 1739, 1739)] * 22
    frame[0] = slot(0xA2, 1739, 2021, 4095)  # electrode 1
    frame[38] = slot(0x83, 4095, 0, 0)  # PDC
    frame[42] = slot(0x86, 0, 0, 2021)  # TDC
    replies = decode(b''.join(frame), BIOTAC, fingers=3)
    assert replies.slow.shape == (1, 22, 3)
    slow = dict(zip(BIOTAC.slow_channels, replies.slow[0].tolist(), strict=True))
    assert slow['electrode1'] == [1739, 2021, 4095]
    assert slow['pdc'] == [4095, 0, 0]
    assert slow['tdc'] == [0, 0, 2021]
    assert slow['tac'] == slow['electrode19'] == [0, 0, 0]
    assert (replies.pac == 1739).all()


def test_a_place_without_a_biotac_gives_no_numbers() -> None:
    for line in (b'\x00', b'\xff'):
        replies = decode((b'\x80\x00' + WORDS[2021] + line * 2) * 44, BIOTAC, fingers=2)
        assert replies.damaged.tolist() == [0, 44]
        assert np.isnan(replies.pac[:, 1]).all()


@pytest.mark.parametrize('word', ERROR_WORDS)
def test_error_words_are_no_values(word: int) -> None:
    replies = decode((b'\x80\x00' + word.to_bytes(2, 'big')) * 44, BIOTAC, fingers=1)
    assert replies.refused.tolist() == replies.damaged.tolist() == [44]
    assert np.isnan(replies.slow).all()


def test_every_single_flipped_bit_is_noticed() -> None:
    for bit in range(16):
        word = (int.from_bytes(WORDS[2021], 'big') ^ 1 << bit).to_bytes(2, 'big')
        assert decode((b'\x80\x00' + word) * 44, BIOTAC, fingers=1).damaged.tolist() == [44]


FRAME_NS = 10_000_000
START_NS = 1_700_000_000_000_000_000
ABSENT = None


def odd(byte: int) -> int:
    return byte | (byte.bit_count() + 1) % 2


def word(value: int | None) -> bytes:
    return bytes(2) if value is ABSENT else bytes([odd(value >> 5 << 1), odd((value & 31) << 3)])


def reply(layout: BioTacLayout = BIOTAC, *, fingers: Sequence[int | None] = (0,), step: int = 0) -> bytes:
    """Each slot holds its number times `step`, plus a number of the finger."""
    values = [
        [ABSENT if base is ABSENT else base + step * slot for base in fingers] for slot in range(len(layout.slots))
    ]
    return b''.join(b'\x80\x00' + b''.join(map(word, row)) for row in values)


class FakeBridge:
    """Frames that come one a read, 10 ms apart; None is a frame that never comes."""

    def __init__(self, frames: Sequence[Frame | None]) -> None:
        self.coming = deque(frames)
        self.now_ns = START_NS

    def read(self, wait_s: float) -> bytes:
        frame = self.coming.popleft() if self.coming else None
        self.now_ns += FRAME_NS
        return b'' if frame is None else pack(frame)

    def write(self, data: bytes) -> None: ...

    def close(self) -> None: ...


def numbered(numbers: range, content: bytes, *, slots: int = 44, fingers: int = 1) -> list[Frame]:
    return [Frame(REPLY, 1, number, 10_000 * number, slots, fingers, content) for number in numbers]


def opened(bridge: FakeBridge, *, finger: int = 0, **options: object) -> BioTac:
    sensor = BioTac(SensorParams(finger=finger, frame_id='tip'), lambda: bridge.now_ns, **options)
    sensor._open_port = lambda: bridge
    sensor.open()
    return sensor


def run(sensor: BioTac, reads: int) -> dict[str, list[TactileSignal]]:
    topics: dict[str, list[TactileSignal]] = {}
    for _ in range(reads):
        for topic, batches in sensor.read().items():
            topics.setdefault(topic, []).extend(batches)
    return topics


def test_each_sample_has_the_time_of_its_slot() -> None:
    bridge = FakeBridge(numbered(range(50), reply(step=1)))
    start_ns = bridge.now_ns  # of the first frame: it comes when it is complete, at the first reading
    topics = run(opened(bridge), 50)
    signal, static = topics['signal'][-1], topics['signal_static'][-1]
    assert abs(static.stamp_ns - (start_ns + 49 * FRAME_NS)) < 1000
    assert signal.stamp_ns - static.stamp_ns == 227_273
    # Slot numbers are the values: PAC comes from slots 1, 3 … 43, so sample k was taken at (2k + 1) slots.
    assert signal.samples[:, 0].tolist() == list(range(1, 44, 2))
    times_s = 227.273e-6 + np.arange(22) / signal.sampling_rate_hz
    assert times_s == pytest.approx(signal.samples[:, 0] / 4400, abs=1e-6)
    assert static.samples[0].tolist() == [42, 40, 38, *range(0, 38, 2)]  # TDC, TAC, PDC, electrodes
    assert static.channels == ('tdc', 'tac', 'pdc', *(f'electrode{number}' for number in range(1, 20)))
    assert (signal.sensor, signal.channels, signal.frame_id) == ('biotac/pac', ('pac',), 'tip')
    assert signal.units == ('count',)
    assert (signal.sampling_rate_hz, static.sampling_rate_hz) == (2200.0, 100.0)
    assert signal.first_sample == 22 * static.first_sample


def test_a_place_without_a_biotac_is_reported_and_sends_nothing() -> None:
    frames = [Frame(SERIALS, 1, 0, 0, 1, 2, b'BT-1,'), *numbered(range(200), reply(fingers=(7, ABSENT)), fingers=2)]
    sensor = opened(FakeBridge(frames), finger=1)
    with pytest.raises(DeviceError, match='no BioTac answers as finger 1'):
        assert not run(sensor, 200)
    assert sensor.details['serial of finger 0'] == 'BT-1'
    assert 'serial of finger 1' not in sensor.details


@pytest.mark.parametrize(
    ('frame', 'sentence'),
    [
        (Frame(REPLY, 1, 0, 0, 54, 1, bytes(54 * 4)), 'samples frames of 54 slots, .* has 44'),
        (Frame(REPLY, 1, 0, 0, 44, 1, bytes(44 * 4)), 'finger 1 is requested, .* places 0 to 0'),
    ],
)
def test_another_board_than_the_requested_one_is_reported(frame: Frame, sentence: str) -> None:
    with pytest.raises(DeviceError, match=sentence):
        opened(FakeBridge([frame]), finger=1).read()


def test_frames_of_another_length_or_number_of_places_are_counted_and_passed_over() -> None:
    sensor = opened(FakeBridge([*numbered(range(3), reply()), *numbered(range(3, 6), reply(fingers=(1, 2)), fingers=2),
                                *numbered(range(6, 9), b'short')]))  # fmt: skip
    run(sensor, 9)
    assert sensor.counts['bogus'] == 6


SERIAL = b'BT2P0220B11E0004'


class StandIn:
    """A Cheetah with one BioTac at the first place, emulated at the level of the vendor's module."""

    CH_PORT_NOT_FREE, CH_SPI_BITORDER_MSB, CH_TARGET_POWER_ON = 0x8000, 0, 1

    def __init__(self) -> None:
        self.ports = [0x8000, 1]
        self.queue: list[tuple[str, int]] = []
        self.slept_ns = 0
        self.pending: deque[bytes] = deque()
        self.opened = self.closed = 0
        self.status = 0

    ch_target_power = ch_sleep_ms = ch_spi_queue_oe = lambda *_: 0

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

    def ch_spi_queue_clear(self, handle: int) -> int:
        self.queue, self.slept_ns = [], 0
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


def came(link: Cheetah, reads: int) -> list[Frame]:
    return FrameDecoder().feed(b''.join(link.read(0.0) for _ in range(reads)))


def test_frames_hold_what_the_biotac_answered_to_each_command(api: StandIn) -> None:
    link = Cheetah(BIOTAC)
    serials, *frames = came(link, 3)
    assert (serials.kind, serials.body) == (SERIALS, SERIAL + b',,')
    assert [(frame.kind, frame.sequence, frame.time_us, frame.rows, frame.columns) for frame in frames] == [
        (REPLY, number, 10_000 * number, 44, 3) for number in range(3)
    ]
    replies = decode(frames[0].body, BIOTAC, 3)
    assert replies.damaged.tolist() == [0, 44, 44]
    # The mock answers with bits 6..1 of the command: twice the index, in the upper seven bits of the word.
    slow = dict(zip(BIOTAC.slow_channels, replies.slow[0, :, 0].tolist(), strict=True))
    assert (slow['tdc'], slow['pdc'], slow['electrode1']) == (3 * 32, 1 * 32, 17 * 32)
    assert (replies.pac[:, 0] == 0).all()
    assert (api.opened, len(api.pending)) == (1, QUEUED_FRAMES)
    link.close()
    link.close()
    assert api.closed == 1


def test_after_a_pause_of_the_host_the_time_begins_again_behind_the_queue(api: StandIn) -> None:
    clock = SimpleNamespace(now=0.0)
    link = Cheetah(BIOTAC, lambda: clock.now)
    came(link, 1)
    clock.now += 1.0
    frames = came(link, QUEUED_FRAMES + 2)
    assert [frame.time_us // 10_000 for frame in frames] == [*range(1, QUEUED_FRAMES + 1), 0, 1]


def test_without_the_vendors_module_the_message_states_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'cheetah_py', None)
    with pytest.raises(DeviceError, match=r"Total Phase's Python module 'cheetah_py'.*serial bridge"):
        Cheetah(BIOTAC)


def test_an_adapter_in_use_or_failing_is_reported(api: StandIn) -> None:
    link = Cheetah(BIOTAC)
    api.status = -8
    for fails in (lambda: link.read(0.0), lambda: Cheetah(BIOTAC)):
        with pytest.raises(DeviceError, match=r'submitting commands failed.*communication error'):
            fails()
    assert api.closed == 1  # the one that could not be opened
    api.ports = [0x8000]
    with pytest.raises(DeviceError, match='no free Cheetah adapter'):
        Cheetah(BIOTAC)
