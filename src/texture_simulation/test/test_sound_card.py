# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sensor on a sound card that ALSA's file plugin emulates, through PortAudio as with a real one."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from texture_core.errors import DeviceError, InvalidParameter
from texture_core.types import TactileSignal, lost_samples
from texture_drivers.sensor import SensorParams
from texture_drivers.sound_card import AudioBlock, SoundCard

pytestmark = pytest.mark.realtime

# It lives in user space: ALSA's file plugin reads what is sampled from a pipe, and PortAudio lists it as a card. The
# environment variable ALSA_CONFIG_PATH names its configuration, in the process that opens it and before PortAudio is
# loaded there.
FRAMES_AT_ONCE = 960  # a write of this size is read at once, or not at all; PortAudio asks for two blocks of 480 frames
SYSTEM_CONFIG = '/usr/share/alsa/alsa.conf'
CONFIG = """pcm.emulated {{
  type file
  slave.pcm null
  file /dev/null
  infile "{pipe}"
  format raw
  hint {{ show on description "emulated sound card" }}
}}
"""
DEADLINE_S = 20.0
RATE_HZ = 48_000
TURN = 30_000


class PacedCard:
    """A card whose sample i holds i modulo 30 000."""

    def __init__(self, folder: Path) -> None:
        pipe, config = folder / 'pipe', folder / 'alsa.conf'
        os.mkfifo(pipe)
        config.write_text(CONFIG.format(pipe=pipe))
        self.environment = {'ALSA_CONFIG_PATH': f'{SYSTEM_CONFIG}:{config}'}
        # Both ends are open here: listing the cards opens and closes the pipe, too, and must not end it.
        self._pipe = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
        self.silent = False
        self.start_ns = time.time_ns()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        blocks = 0
        while not self._stop.wait(0.003):
            due = int((time.time_ns() - self.start_ns) / 1e9 * RATE_HZ / FRAMES_AT_ONCE)
            for number in range(blocks, due):
                samples = (np.arange(FRAMES_AT_ONCE) + number * FRAMES_AT_ONCE) % TURN
                if not self.silent:
                    with contextlib.suppress(BlockingIOError):  # nobody takes them
                        os.write(self._pipe, samples.astype('<i2').tobytes())
            blocks = due

    def drain(self) -> None:
        """Throw away what nobody has taken, as a card does that is not open."""
        with contextlib.suppress(BlockingIOError):
            while os.read(self._pipe, 65536):
                pass

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()


@pytest.fixture(scope='module')
def card(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PacedCard]:
    if not Path(SYSTEM_CONFIG).exists():
        pytest.skip('ALSA is not installed')
    made = PacedCard(tmp_path_factory.mktemp('alsa'))
    # Whoever lists the cards opens the pipe and waits for a writer: other tests of this process must not find it.
    with pytest.MonkeyPatch.context() as environment:
        for name, value in made.environment.items():
            environment.setenv(name, value)
        try:
            pytest.importorskip('sounddevice', exc_type=ImportError)
        except OSError:
            pytest.skip('PortAudio is not installed')
        yield made
        made.stop()


@pytest.fixture
def make(card: PacedCard) -> Iterator[Callable[..., SoundCard]]:
    made: list[SoundCard] = []

    def make(config: str = '{decimation: 1}', device: str = 'emulated') -> SoundCard:
        card.drain()
        made.append(SoundCard(SensorParams(device=device, config=config)))
        made[-1].open()
        return made[-1]

    yield make
    card.silent = False
    for sensor in made:
        sensor.close()


def read_s(sensor: SoundCard, seconds: float) -> list[TactileSignal]:
    batches: list[TactileSignal] = []
    deadline_s = time.monotonic() + DEADLINE_S
    while sum(len(batch.samples) for batch in batches) < seconds * sensor.expected_rates_hz['signal']:
        assert time.monotonic() < deadline_s
        batches += sensor.read().get('signal', [])
    return batches


def numbers(batches: list[TactileSignal]) -> np.ndarray:
    return np.concatenate([batch.samples[:, 0] for batch in batches]) * 32768


def test_each_sample_of_the_card_arrives_once_in_its_order(make: Callable[..., SoundCard]) -> None:
    sensor = make()
    batches = read_s(sensor, 1.0)
    assert set(np.diff(numbers(batches)) % TURN) == {1.0}
    assert lost_samples(batches) == sensor.counts['lost'] == sensor.counts['overflows'] == 0
    assert (batches[0].sampling_rate_hz, batches[0].units, batches[0].channels) == (48000.0, ('FS',), ('channel_1',))


def test_decimated_it_says_so_in_its_rate_and_keeps_the_band(make: Callable[..., SoundCard]) -> None:
    batches = read_s(make('{decimation: 12, unit: m/s², gain: 50.0}'), 1.0)
    assert (batches[0].sampling_rate_hz, batches[0].units) == (4000.0, ('m/s²',))
    steps = np.diff(np.concatenate([batch.samples[:, 0] for batch in batches])) * 32768 / 50.0
    assert np.median(steps) == pytest.approx(12.0, abs=0.05)  # a ramp passes the filter unchanged
    assert lost_samples(batches) == 0


def test_closed_and_opened_again_it_goes_on_at_the_index_of_the_time(
    make: Callable[..., SoundCard], card: PacedCard
) -> None:
    sensor = make()
    last = read_s(sensor, 0.5)[-1]
    sensor.close()
    card.drain()
    sensor.open()
    first = read_s(sensor, 0.5)[0]
    gap_s = (first.stamp_ns - last.end_ns) / 1e9
    assert (first.first_sample - last.next_sample) / RATE_HZ == pytest.approx(gap_s, abs=0.03)
    assert sensor.counts['reopened'] == 1


def test_a_silent_card_is_reported(make: Callable[..., SoundCard], card: PacedCard) -> None:
    sensor = make()
    read_s(sensor, 0.2)
    card.silent = True
    deadline_s = time.monotonic() + DEADLINE_S
    with pytest.raises(DeviceError, match="sound card 'emulated' is open and delivers nothing"):
        while time.monotonic() < deadline_s:
            sensor.read()
    card.silent = False  # a pipe that nobody writes to would hold up whoever closes the card


@pytest.mark.usefixtures('card')
def test_a_card_that_is_not_there_is_named() -> None:
    sensor = SoundCard(SensorParams(device='no such card'))
    with pytest.raises(DeviceError, match="sound card 'no such card' cannot be opened"):
        sensor.open()


def test_a_reader_that_is_too_busy_is_an_overflow_and_the_time_goes_on(
    make: Callable[..., SoundCard], card: PacedCard
) -> None:
    sensor = make()
    last = read_s(sensor, 0.3)[-1]
    deadline_s = time.monotonic() + DEADLINE_S
    while not sensor._capture._overflowed:  # type: ignore[union-attr]
        assert time.monotonic() < deadline_s
        time.sleep(0.01)
    card.drain()
    batches = read_s(sensor, 1.5)
    assert sensor.counts['overflows'] >= 1
    assert sensor.counts['lost'] > 0
    elapsed_s = (batches[-1].stamp_ns - last.stamp_ns) / 1e9
    assert (batches[-1].first_sample - last.first_sample) / RATE_HZ == pytest.approx(elapsed_s, abs=0.05)


class Blocks:
    """What stands for the capture: hands over blocks by hand."""

    def __init__(self) -> None:
        self.waiting: list[AudioBlock] = []

    def take(self) -> list[AudioBlock]:
        taken, self.waiting = self.waiting, []
        return taken

    def close(self) -> None: ...


def by_hand(
    late_s: Callable[[int], float], overflows: frozenset[int] = frozenset(), count: int = 200
) -> tuple[SoundCard, list[Any]]:
    """Return a sensor that has read blocks of 10 ms, and its batches.

    Parameters
    ----------
    late_s
        By how much the block of a number ends later than its samples at the nominal rate do.
    overflows
        Numbers of the blocks that report one.
    count
        Number of blocks.
    """
    sensor = SoundCard(SensorParams(config='{decimation: 1}', batch_s=0.001))
    blocks = Blocks()
    sensor._capture = blocks  # type: ignore[assignment]
    batches: list[Any] = []
    for number in range(count):
        end_ns = 10**18 + round(((number + 1) * 480 / RATE_HZ + late_s(number)) * 1e9)
        blocks.waiting.append(AudioBlock(np.zeros((480, 1), dtype=np.float32), end_ns, number in overflows))
        if number % 5 == 4:
            batches += sensor.read().get('signal', [])
    return sensor, batches


def test_an_overflow_is_counted_and_its_samples_are_left_out_of_the_index() -> None:
    sensor, batches = by_hand(lambda number: 0.05 * (number >= 50), frozenset({50}))
    assert sensor.counts['overflows'] == 1
    assert lost_samples(batches) == sensor.counts['lost'] == pytest.approx(2400, abs=5)


def test_a_gap_that_no_flag_reports_is_known_after_half_a_second() -> None:
    sensor, batches = by_hand(lambda number: 0.05 * (number >= 50))
    assert sensor.counts['overflows'] == 0
    assert lost_samples(batches) == sensor.counts['lost'] == pytest.approx(2400, abs=60)


def test_blocks_that_come_late_in_one_burst_lose_nothing() -> None:
    sensor, batches = by_hand(lambda number: max(0.0, 0.01 * (120 - number)) if 100 <= number < 120 else 0.0)
    assert lost_samples(batches) == sensor.counts['lost'] == 0
    assert sensor.counts['samples'] > 0.9 * 200 * 480


def test_a_decimation_that_does_not_divide_the_rate_is_refused() -> None:
    with pytest.raises(InvalidParameter, match='44100 Hz cannot be divided'):
        SoundCard(SensorParams(config='{rate_hz: 44100, decimation: 16}'))
