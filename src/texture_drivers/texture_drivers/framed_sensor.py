"""A sensor that streams samples over a framed serial line."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

from texture_core.errors import DeviceError
from texture_core.signal import TactileSignal
from texture_drivers.params import SensorParams
from texture_drivers.serial_port import SerialPort
from texture_drivers.stream_decoder import FramedStream, StreamDecoder

PPM = 1e6
SILENCE_S = 1.0  # the device sends without being asked; opening the port again has woken many a one


class FramedSensor:
    """Read the streams of one device. See `texture_core.protocols.Sensor`.

    Parameters
    ----------
    params
        Device, frame and batch length.
    now_ns
        Clock of the stamps.
    streams
        What the device sends.
    baud
        Of a real UART; a USB device has none.
    """

    def __init__(
        self, params: SensorParams, now_ns: Callable[[], int], streams: Sequence[FramedStream], baud: int = 115200
    ) -> None:
        self._params = params
        self._now_ns = now_ns
        self._streams = streams
        self._baud = baud
        self._line = StreamDecoder(streams, params.frame_id)
        self._port: SerialPort | None = None
        self._opened = 0
        self._silent_s = 0.0

    def open(self) -> None:
        """Open the device; DeviceError if it cannot be reached."""
        self.close()
        self._port = SerialPort(self._params.device, self._baud)
        self._opened += 1
        self._silent_s = 0.0
        self._line.restart()

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Wait for the length of one batch and return what arrived.

        Raises
        ------
        DeviceError
            If the port is not open or is gone, or no valid frame has come for 1 s.
        """
        if self._port is None:
            raise DeviceError(f"device '{self._params.device}' is not open; open it before reading")
        time.sleep(self._params.batch_s)
        data = self._port.read()
        arrival_ns = self._now_ns()
        frames = self._line.deframer.frames
        batches = self._line.feed(data, arrival_ns)
        self._watch_silence(alive=self._line.deframer.frames > frames, any_bytes=bool(data))
        return batches

    def close(self) -> None:
        """Close the device."""
        if self._port is not None:
            self._port.close()
            self._port = None

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals: samples published and lost, frames refused or passed over, and new beginnings."""
        line, trackers = self._line, self._line.trackers.values()
        return {
            'samples': sum(tracker.samples for tracker in trackers),
            'lost': sum(tracker.lost for tracker in trackers),
            'left out by the device': sum(tracker.overrun for tracker in trackers),
            'bogus': line.deframer.bad_frames + line.malformed,
            'repeated frames': line.deframer.repeated,
            'other frames': line.other_frames,
            'device restarts': line.restarts,
            'reopened': max(0, self._opened - 1),
            'clock_steps': line.clock.steps,
        }

    @property
    def details(self) -> Mapping[str, float]:
        """How much the device's clock is slow."""
        return {'device clock slow by [ppm]': PPM * self._line.clock.drift}

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        return {stream.topic: stream.rate_hz for stream in self._streams}

    def _watch_silence(self, *, alive: bool, any_bytes: bool) -> None:
        self._silent_s = 0.0 if alive else self._silent_s + self._params.batch_s
        if self._silent_s < SILENCE_S:
            return
        what = 'bytes but no valid frame' if any_bytes else 'nothing'
        raise DeviceError(
            f"device '{self._params.device}' is open and sends {what}; check that it is the right device"
            + (f', and its baud rate ({self._baud} is set)' if any_bytes else ', and that its firmware runs')
        )
