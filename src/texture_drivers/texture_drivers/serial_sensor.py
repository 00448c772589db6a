"""A sensor that streams samples over a serial port, whatever its protocol: a decoder turns the bytes into batches."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from texture_core.errors import DeviceError
from texture_core.signal import TactileSignal
from texture_drivers.channel_watch import Limits
from texture_drivers.params import SensorParams
from texture_drivers.serial_port import SerialPort

SILENCE_S = 1.0  # the device sends without being asked; opening the port again has woken many a one


class Decoder(Protocol):
    """Turns the bytes of one protocol into batches; knows no port and no clock of its own."""

    @property
    def valid_frames(self) -> int:
        """How many valid frames have come in all."""
        ...

    @property
    def counts(self) -> Mapping[str, int]:
        """Running totals, 'samples', 'lost' and 'bogus' among them."""
        ...

    @property
    def details(self) -> Mapping[str, float]:
        """What the device's stream shows beside the samples, by name."""
        ...

    @property
    def rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        ...

    @property
    def limits(self) -> Limits:
        """Lowest and highest sample by topic, where they are known."""
        ...

    def restart(self) -> None:
        """Go on after an interruption."""

    def feed(self, data: bytes, arrival_ns: int) -> Mapping[str, Sequence[TactileSignal]]:
        """Return the batches, by topic, in `data`, which has just arrived."""
        ...


class SerialSensor:
    """Read the streams of one device. See `texture_core.protocols.Sensor`.

    Parameters
    ----------
    params
        Device, frame and batch length.
    now_ns
        Clock of the stamps.
    decoder
        What understands the device's bytes.
    baud
        Of a real UART; a USB device has none.
    start_command, stop_command
        What is sent when the port has been opened, and before it is closed; b'' sends nothing.
    """

    def __init__(
        self,
        params: SensorParams,
        now_ns: Callable[[], int],
        decoder: Decoder,
        *,
        baud: int = 115200,
        start_command: bytes = b'',
        stop_command: bytes = b'',
    ) -> None:
        self._params = params
        self._now_ns = now_ns
        self._decoder = decoder
        self._baud = baud
        self._start_command = start_command
        self._stop_command = stop_command
        self._port: SerialPort | None = None
        self._opened = 0
        self._silent_s = 0.0

    def open(self) -> None:
        """Open the device and start its stream; DeviceError if it cannot be reached."""
        self.close()
        self._port = SerialPort(self._params.device, self._baud)
        self.send(self._start_command)
        self._opened += 1
        self._silent_s = 0.0
        self._decoder.restart()

    def send(self, command: bytes) -> None:
        """Send a command; b'' sends nothing.

        Raises
        ------
        DeviceError
            If the port is not open or is gone.
        """
        port = self._opened_port()
        if command:
            port.write(command)

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Wait for the length of one batch and return what arrived.

        Raises
        ------
        DeviceError
            If the port is not open or is gone, or no valid frame has come for 1 s.
        """
        port = self._opened_port()
        time.sleep(self._params.batch_s)
        data = port.read()
        arrival_ns = self._now_ns()
        frames = self._decoder.valid_frames
        batches = self._decoder.feed(data, arrival_ns)
        self._watch_silence(alive=self._decoder.valid_frames > frames, any_bytes=bool(data))
        return batches

    def close(self) -> None:
        """Stop the stream and close the device."""
        if self._port is None:
            return
        with contextlib.suppress(DeviceError):  # if it is gone there is nothing to stop
            self.send(self._stop_command)
        self._port.close()
        self._port = None

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals of the decoder, and how often the device was opened again."""
        return {**self._decoder.counts, 'reopened': max(0, self._opened - 1)}

    @property
    def details(self) -> Mapping[str, float]:
        """What the decoder knows beside the samples, such as how much the device's clock is slow."""
        return self._decoder.details

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        return self._decoder.rates_hz

    @property
    def limits(self) -> Limits:
        """Lowest and highest sample by topic, where they are known."""
        return self._decoder.limits

    def _opened_port(self) -> SerialPort:
        if self._port is None:
            raise DeviceError(f"device '{self._params.device}' is not open; open it before reading")
        return self._port

    def _watch_silence(self, *, alive: bool, any_bytes: bool) -> None:
        self._silent_s = 0.0 if alive else self._silent_s + self._params.batch_s
        if self._silent_s < SILENCE_S:
            return
        what = 'bytes but no valid frame' if any_bytes else 'nothing'
        raise DeviceError(
            f"device '{self._params.device}' is open and sends {what}; check that it is the right device"
            + (f', and its baud rate ({self._baud} is set)' if any_bytes else ', and that its firmware runs')
        )
