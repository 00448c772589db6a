"""A microcontroller that samples a BioTac board over SPI and streams the replies over a serial line.

Our own design, for whoever has no Cheetah adapter: see docs/sensors/biotac.md. It sends without being asked, framed as
in `texture_core.framing`: the reply to one frame of sampling commands in each, and now and then the serial numbers.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

from texture_core.errors import DeviceError
from texture_core.framing import SEQUENCE_BITS, TIME_BITS, CounterUnwrapper, Frame, FrameDecoder
from texture_drivers.biotac.link import SpiFrame
from texture_drivers.biotac.tables import ECHO_BYTES, WORD_BYTES, BioTacLayout
from texture_drivers.serial_port import SerialPort

VERSION = 1
REPLY, SERIALS = 0x42, 0x53  # kinds of frames: 'B' and 'S'
POLLS = 5  # looks at the port per waiting time: a frame's arrival tells the time
LATE_FRAMES = 0.5  # a frame further than this from where its number puts it: the bridge stopped or restarted
RATE_CHECK_S = 1.0
RATE_TOLERANCE = 0.02  # far more than clocks differ, far less than slots made of delays instead of by a timer


class SerialBridge:
    """The replies that a bridge sends, in order and each once. See `SpiLink`.

    Parameters
    ----------
    device
        Path of the serial device.
    layout
        What the bridge must be sampling.
    wait_s
        How long to wait for bytes.
    """

    max_drift = 5e-3  # the internal oscillator of a microcontroller on USB is right to 0.25 %

    def __init__(self, device: str, layout: BioTacLayout, wait_s: float = 0.01) -> None:
        self.serials: tuple[str, ...] = ()
        self._device = device
        self._layout = layout
        self._wait_s = wait_s
        self._port: SerialPort | None = None
        self._deframer = FrameDecoder()
        self._tracker = FrameTracker(layout)
        self._unknown_frames = 0

    def open(self) -> None:
        """Open the port; DeviceError if it is not there."""
        self.close()
        self._port = SerialPort(self._device)
        self._deframer.restart()
        self._tracker.restart()

    def read(self) -> Sequence[SpiFrame]:
        """Wait for bytes and return the replies they complete.

        Raises
        ------
        DeviceError
            If the port is not open or is gone, or the bridge samples another kind of BioTac.
        """
        if self._port is None:
            raise DeviceError(f"device '{self._device}' is not open; open it before reading")
        data = b''
        for _ in range(POLLS):
            time.sleep(self._wait_s / POLLS)
            data += self._port.read()
            if data:
                break
        return [reply for frame in self._deframer.feed(data) if (reply := self._decode(frame)) is not None]

    def close(self) -> None:
        """Close the port."""
        if self._port is not None:
            self._port.close()
            self._port = None

    @property
    def counts(self) -> Mapping[str, int]:
        """Damaged or unknown frames, frames that came twice, and stops or resets of the device."""
        return {
            'bogus': self._deframer.bad_frames + self._unknown_frames,
            'repeated': self._deframer.repeated,
            'restarts': self._tracker.restarts,
        }

    def _decode(self, frame: Frame) -> SpiFrame | None:
        """Return the reply in a frame, if it is one."""
        if frame.version == VERSION and frame.kind == SERIALS:
            self.serials = tuple(frame.body.decode('ascii', 'replace').split(','))
            return None
        fits = frame.columns > 0 and len(frame.body) == frame.rows * (ECHO_BYTES + WORD_BYTES * frame.columns)
        if frame.version != VERSION or frame.kind != REPLY or not fits:
            self._unknown_frames += 1
            return None
        if frame.rows != len(self._layout.slots):
            raise DeviceError(
                f"the bridge on '{self._device}' samples frames of {frame.rows} slots, and this kind of BioTac has "
                f'{len(self._layout.slots)}; choose the sensor with the right one, or change the bridge'
            )
        return self._tracker.place(frame)


class FrameTracker:
    """Unwrap the numbers and the clock of a device, and detect when they restart.

    Parameters
    ----------
    layout
        What is sampled; it determines the duration of a frame.
    """

    def __init__(self, layout: BioTacLayout) -> None:
        self.restarts = 0
        self._epoch = 0
        self._frame_us = layout.frame_s * 1e6
        self.restart()

    def restart(self) -> None:
        """Begin a new epoch: another stream."""
        self._epoch += 1
        self._number = CounterUnwrapper(SEQUENCE_BITS)
        self._time_us = CounterUnwrapper(TIME_BITS)
        self._checked: SpiFrame | None = None

    def place(self, frame: Frame) -> SpiFrame:
        """Return the frame with its number and time.

        Raises
        ------
        DeviceError
            If the device samples at another pace than a BioTac is to be sampled.
        """
        steps, elapsed_us = self._number.step(frame.sequence), self._time_us.step(frame.time_us)
        late_us = abs(elapsed_us - steps * self._frame_us)
        steady = steps > 0 and late_us <= (LATE_FRAMES + RATE_TOLERANCE * steps) * self._frame_us
        if self._number.value is not None and not steady:
            self.restarts += 1
            self.restart()
        number, time_us = self._number.advance(frame.sequence), self._time_us.advance(frame.time_us)
        unwrapped = SpiFrame(self._epoch, number, time_us, frame.columns, frame.body)
        self._check_rate(unwrapped)
        return unwrapped

    def _check_rate(self, frame: SpiFrame) -> None:
        before = self._checked or frame
        elapsed_us = frame.time_us - before.time_us
        if elapsed_us < RATE_CHECK_S * 1e6:
            self._checked = before
            return
        self._checked = frame
        frame_us = elapsed_us / (frame.number - before.number)
        if abs(frame_us / self._frame_us - 1) > RATE_TOLERANCE:
            raise DeviceError(
                f'the bridge takes {frame_us / 1000:.2f} ms for a frame, and {self._frame_us / 1000:.2f} ms are needed'
                '; let a timer of the bridge start a slot every 227.27 µs'
            )
