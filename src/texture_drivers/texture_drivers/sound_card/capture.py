"""Blocks of samples from a sound card, through PortAudio: captured in its thread, handed over in order."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import DeviceError
from texture_core.signal import NANOSECONDS
from texture_drivers.sound_card import tables

FULL_SCALE = 2.0**15
LONGEST_LATENCY_S = 1.0  # a time of conversion that lies further off is none: some drivers tell 0


class AudioBlock(NamedTuple):
    """What PortAudio delivered at once.

    Parameters
    ----------
    samples : (n_samples, n_channels) float32
        1 is full scale.
    end_ns
        When the last sample was converted, by the host's clock.
    overflowed
        Whether samples before this block were lost.
    """

    samples: NDArray[np.float32]
    end_ns: int
    overflowed: bool


class Capture:
    """An opened input of a sound card.

    Parameters
    ----------
    device
        Its name or a part of it, or its number; '' is the default input.
    rate_hz, channels
        What is asked of it.
    now_ns
        The host's clock.

    Raises
    ------
    DeviceError
        If it cannot be opened.
    """

    def __init__(self, device: str, rate_hz: int, channels: int, now_ns: Callable[[], int]) -> None:
        self._rate_hz = rate_hz
        self._now_ns = now_ns
        self._overflowed = False
        self._blocks: deque[AudioBlock] = deque()
        self._most_blocks = round(tables.QUEUED_S * rate_hz / tables.BLOCK_FRAMES)
        with open_errors(device) as sounddevice:
            self._stream = sounddevice.InputStream(
                device=int(device) if device.isdecimal() else device or None,
                samplerate=rate_hz,
                channels=channels,
                dtype='int16',  # what every card has; PortAudio rounds what a card of 24 bits delivers
                blocksize=tables.BLOCK_FRAMES,
                callback=self._on_block,
            )
            self._stream.start()

    def take(self) -> Sequence[AudioBlock]:
        """Return the blocks that have come since the last call."""
        return [self._blocks.popleft() for _ in range(len(self._blocks))]

    def close(self) -> None:
        """Stop and close; never raises."""
        with contextlib.suppress(Exception):  # PortAudio raises an error of its own for each way a device can be gone
            self._stream.abort()
        with contextlib.suppress(Exception):
            self._stream.close()

    def _on_block(self, samples: NDArray[np.int16], frames: int, times: Any, status: Any) -> None:
        """Keep a block; called in PortAudio's thread."""
        self._overflowed = self._overflowed or bool(status.input_overflow)
        if len(self._blocks) >= self._most_blocks:
            self._overflowed = True  # the reader is too busy: this block is lost
            return
        latency_s = times.currentTime - times.inputBufferAdcTime - frames / self._rate_hz
        believed_s = latency_s if 0 <= latency_s < LONGEST_LATENCY_S else 0.0
        end_ns = self._now_ns() - round(believed_s * NANOSECONDS)
        self._blocks.append(AudioBlock((samples / FULL_SCALE).astype(np.float32), end_ns, self._overflowed))
        self._overflowed = False


@contextlib.contextmanager
def open_errors(device: str) -> Iterator[Any]:
    """Yield the module sounddevice with a fresh list of devices.

    Raises
    ------
    DeviceError
        If the module or PortAudio is missing, or for whatever goes wrong with the device meanwhile.
    """
    try:
        import sounddevice  # noqa: PLC0415  # optional, and it fails without PortAudio
    except (ImportError, OSError) as error:
        raise DeviceError(
            f"sound card '{device}' cannot be opened: {error}; install PortAudio (Debian: libportaudio2) and the "
            'Python package sounddevice'
        ) from error
    try:
        # PortAudio lists the devices once; a card that was plugged in later is found only after a new start.
        sounddevice._terminate()
        sounddevice._initialize()
        yield sounddevice
    except (sounddevice.PortAudioError, ValueError) as error:
        raise DeviceError(
            f"sound card '{device}' cannot be opened: {error}; check its plug, its rate and number of channels, and "
            'that no other program has it open (`python -m sounddevice` lists the cards)'
        ) from error
