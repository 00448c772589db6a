"""The Total Phase Cheetah SPI adapter, through the vendor's own Python module `cheetah_py`.

That module and its library are not free and not part of this project; who owns the adapter has them from the vendor.
The calls and their values are those of kth-ros-pkg/biotac_driver @6fb8e33 `biotac_sensors/src/biotac.c`. This file has
never met the hardware; its tests run against a stand-in.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from texture_core.errors import DeviceError
from texture_drivers.biotac.link import SpiFrame
from texture_drivers.biotac.tables import ECHO_BYTES, SLOT_RATE_HZ, WORD_BYTES, BioTacLayout, sampling_command

MODULE = 'cheetah_py'
BITRATE_KHZ = 4400
POWER_SETTLE_MS = 100
AFTER_SAMPLE_NS, BETWEEN_WORDS_NS = 50_000, 10_000
OVERHEAD_NS = 3_000  # of a slot, as the vendor's library reckons
SELECT_ALL, SELECT_NONE = 0x07, 0x00
SELECT = (0x01, 0x02, 0x04)  # the places of a board for three BioTacs
READ_PROPERTY, SERIAL_NUMBER = 0x61, 0x15
SERIAL_BYTES, SERIAL_START = 16, 'BT'
MODE_0 = (0, 0)  # clock idles low, sampled at the first edge
QUEUED_FRAMES = 16  # submitted ahead: the adapter samples on while the host is busy
ADAPTERS = 16


class Cheetah:
    """Frames sampled back to back by a Cheetah adapter. See `SpiLink`.

    Parameters
    ----------
    layout
        Kind of BioTac.
    now_s
        A monotonic clock: when the host was away for longer than the queue lasts, sampling has paused.
    """

    max_drift = 2e-2  # the slots are made of delays, whose sum is nominal

    def __init__(self, layout: BioTacLayout, now_s: Callable[[], float] = time.monotonic) -> None:
        self.serials: tuple[str, ...] = ()
        self._layout = layout
        self._now_s = now_s
        self._api: Any = None
        self._handle = 0
        self._epoch = self._number = self._pauses = 0
        self._last_s = 0.0
        self._pause_at: int | None = None

    def open(self) -> None:
        """Open the first free adapter and start sampling; DeviceError if there is none.

        Raises
        ------
        DeviceError
            If there is no free adapter, or its library is missing.
        """
        self.close()
        try:
            self._api = importlib.import_module(MODULE)
        except ImportError as error:
            raise DeviceError(
                f"the Cheetah adapter needs Total Phase's Python module '{MODULE}' and its library, which cannot be "
                f'imported ({error}); put them on PYTHONPATH, or use a serial bridge as the device'
            ) from error
        self._handle = self._open_first()
        self._configure()
        self.serials = tuple(self._serial(select) for select in SELECT)
        self._queue_frame()
        for _ in range(QUEUED_FRAMES):
            self._checked(self._api.ch_spi_async_submit(self._handle), 'submitting commands')
        self._epoch += 1
        self._number = 0
        self._last_s = self._now_s()
        self._pause_at = None

    def read(self) -> Sequence[SpiFrame]:
        """Wait for one frame and return it.

        Raises
        ------
        DeviceError
            If the adapter is not open, or an exchange with it fails.
        """
        if not self._handle:
            raise DeviceError('the Cheetah adapter is not open; open it before reading')
        size = self._layout.frame_bytes(len(SELECT))
        received, data = self._api.ch_spi_async_collect(self._handle, size)
        self._checked(received, 'collecting replies')
        self._checked(self._api.ch_spi_async_submit(self._handle), 'submitting commands')
        if received != size:
            raise DeviceError(f'the Cheetah adapter returned {received} bytes of {size}; replug it')
        self._note_pauses()
        time_us = round(self._number * self._layout.frame_s * 1e6)
        frame = SpiFrame(self._epoch, self._number, time_us, len(SELECT), bytes(data))
        self._number += 1
        return [frame]

    def close(self) -> None:
        """Let the adapter go."""
        if self._handle:
            self._api.ch_close(self._handle)
            self._handle = 0

    @property
    def counts(self) -> Mapping[str, int]:
        """How often sampling paused because the host was away."""
        return {'pauses': self._pauses}

    def _note_pauses(self) -> None:
        """Begin a new epoch after the frames still queued, when the host was away for longer than they lasted."""
        now_s = self._now_s()
        if now_s - self._last_s > QUEUED_FRAMES * self._layout.frame_s:
            self._pauses += 1
            self._pause_at = self._number + QUEUED_FRAMES
        self._last_s = now_s
        if self._number == self._pause_at:
            self._epoch += 1
            self._pause_at = None

    def _open_first(self) -> int:
        found, ports, _ = self._api.ch_find_devices_ext(ADAPTERS, ADAPTERS)
        free = [port for port in list(ports)[: max(0, found)] if not port & self._api.CH_PORT_NOT_FREE]
        if not free:
            raise DeviceError(
                f'no free Cheetah adapter is there ({max(0, found)} found); plug it in, or close the program using it'
            )
        return int(self._checked(self._api.ch_open(free[0]), 'opening'))

    def _configure(self) -> None:
        api, handle = self._api, self._handle
        self._checked(api.ch_spi_configure(handle, *MODE_0, api.CH_SPI_BITORDER_MSB, 0), 'configuring')
        self._checked(api.ch_target_power(handle, api.CH_TARGET_POWER_ON), 'powering the board')
        api.ch_sleep_ms(POWER_SETTLE_MS)
        self._checked(api.ch_spi_bitrate(handle, BITRATE_KHZ), 'setting the bit rate')
        api.ch_spi_queue_clear(handle)
        api.ch_spi_queue_oe(handle, 1)

    def _serial(self, select: int) -> str:
        """Return the serial number of the BioTac at a place, '' if there is none."""
        api, handle = self._api, self._handle
        api.ch_spi_queue_clear(handle)
        api.ch_spi_queue_ss(handle, select)
        api.ch_spi_queue_byte(handle, 1, READ_PROPERTY)
        api.ch_spi_queue_byte(handle, 1, SERIAL_NUMBER)
        api.ch_spi_queue_ss(handle, SELECT_NONE)
        api.ch_spi_queue_delay_ns(handle, AFTER_SAMPLE_NS)
        api.ch_spi_queue_ss(handle, select)
        api.ch_spi_queue_byte(handle, SERIAL_BYTES, 0)
        api.ch_spi_queue_ss(handle, SELECT_NONE)
        received, data = api.ch_spi_batch_shift(handle, 2 + SERIAL_BYTES)
        self._checked(received, 'reading serial numbers')
        text = bytes(data)[2:].decode('ascii', 'replace')
        return text if text.startswith(SERIAL_START) else ''

    def _queue_frame(self) -> None:
        """Queue the commands of one frame: each is given to all BioTacs at once, then one after the other is read."""
        api, handle = self._api, self._handle
        words, selections = 1 + len(SELECT), 3 + len(SELECT)
        shifting_ns = (16 * words + 8 * selections) / BITRATE_KHZ * 1e6
        rest_ns = round(1e9 / SLOT_RATE_HZ - shifting_ns - AFTER_SAMPLE_NS - BETWEEN_WORDS_NS - OVERHEAD_NS)
        api.ch_spi_queue_clear(handle)
        for channel in self._layout.slots:
            api.ch_spi_queue_ss(handle, SELECT_ALL)
            api.ch_spi_queue_byte(handle, 1, sampling_command(channel))
            api.ch_spi_queue_byte(handle, ECHO_BYTES - 1, 0)
            api.ch_spi_queue_ss(handle, SELECT_NONE)
            api.ch_spi_queue_delay_ns(handle, AFTER_SAMPLE_NS)
            for select in SELECT:
                api.ch_spi_queue_ss(handle, select)
                api.ch_spi_queue_byte(handle, WORD_BYTES, 0)
            api.ch_spi_queue_ss(handle, SELECT_NONE)
            api.ch_spi_queue_delay_ns(handle, BETWEEN_WORDS_NS + rest_ns)

    def _checked(self, status: int, doing: str) -> int:
        """Return a status, or raise DeviceError if it is one of an error."""
        if status < 0:
            text = self._api.ch_status_string(status)
            raise DeviceError(f'{doing} failed on the Cheetah adapter ({text}, status {status}); replug it')
        return status
