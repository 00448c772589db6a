"""The TSF-85 fingertip as a sensor of the suite."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence

from texture_core.errors import DeviceError, InvalidParameter
from texture_core.signal import TactileSignal
from texture_drivers import usb_ports
from texture_drivers.channel_watch import Limits
from texture_drivers.params import SensorParams
from texture_drivers.serial_port import SerialPort
from texture_drivers.settings import load_settings
from texture_drivers.tsf85 import tables
from texture_drivers.tsf85.finger_stream import FingerStream
from texture_drivers.tsf85.protocol import Packet, Tsf85Parser, start_command, stop_command
from texture_drivers.tsf85.sample_frames import SampleFrameSplitter
from texture_drivers.tsf85.settings import Tsf85Settings

SILENCE_S = 0.5  # an open port may stay silent after an unclean end; stop and start wake the device
REVIVALS = 3  # so many times, as the vendor does, before the port is given up
REVIVAL_PAUSE_S = 0.05  # between stop and start
PPM = 1e6


class Tsf85:
    """Read a TSF-85: 'signal' at 1 kHz, 'signal_static' (7 rows of 4 taxels) at a constant rate, 'imu' at 1 kHz.

    The device's own stamps number the samples, so losses are known exactly; over an interruption the host's clock
    does. Taxel images come irregularly (or, from old firmware, repeated each millisecond): the newest one is published
    at each tick of the static rate. See `texture_core.protocols.Sensor`.

    Parameters
    ----------
    params
        `device` is a path or 'auto', `finger` 0 or 1, `config` means `Tsf85Settings`.
    now_ns
        The host's clock.
    layout
        Kind of fingertip.
    fingers
        Several fingers instead of `params.finger`; topics are then 'finger0/signal' and so on.

    Raises
    ------
    InvalidParameter
        If there is no such finger, or the settings are wrong.
    """

    def __init__(
        self,
        params: SensorParams,
        now_ns: Callable[[], int] = time.time_ns,
        *,
        layout: tables.Tsf85Layout = tables.TSF85,
        fingers: Sequence[int] = (),
    ) -> None:
        if not fingers and params.finger >= tables.FINGERS:
            raise InvalidParameter(f"parameter 'finger' is {params.finger}; a TSF-85 has the fingers 0 and 1")
        self._params = params
        self._now_ns = now_ns
        settings = load_settings(Tsf85Settings, params.config)
        self._port: SerialPort | None = None
        self._parser = Tsf85Parser(layout)
        self._prefixes = {finger: f'finger{finger}/' for finger in fingers} or {params.finger: ''}
        self._splitters = {finger: SampleFrameSplitter(finger, settings.kinds) for finger in self._prefixes}
        self._fingers = {
            finger: FingerStream(layout, settings, params.static_rate_hz, params.frame_id) for finger in self._prefixes
        }
        self._serial = ''
        self._last_packet: Packet | None = None
        self._repeated = 0
        self._silent_reads = self._silent_bytes = 0
        self._opened = self._revived = self._revivals = 0

    def open(self) -> None:
        """Open the device and start its stream; DeviceError if it cannot be reached."""
        self.close()
        device = usb_ports.resolve(self._params.device, tables.USB_IDS, 'TSF-85')
        port = SerialPort(device)
        port.write(start_command())
        self._port = port
        self._serial = usb_ports.serial_number(device)
        self._opened += 1
        self._silent_reads = self._silent_bytes = self._revivals = 0
        self._interrupt()

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Wait for the length of one batch and return what arrived.

        Raises
        ------
        DeviceError
            If the port is not open or is gone, or the device stays silent after three restarts.
        """
        if self._port is None:
            raise DeviceError(f"device '{self._params.device}' is not open; open it before reading")
        time.sleep(self._params.batch_s)
        data = self._port.read()
        arrival_ns = self._now_ns()
        packets = self._without_duplicates(self._parser.feed(data))
        topics, alive = self._place(packets, arrival_ns)
        self._watch_silence(self._port, alive, len(data))
        return topics

    def _place(self, packets: Sequence[Packet], arrival_ns: int) -> tuple[dict[str, Sequence[TactileSignal]], bool]:
        """Return the batches of each topic, and whether any finger sent a frame."""
        topics: dict[str, Sequence[TactileSignal]] = {}
        alive = False
        for number, finger in self._fingers.items():
            frames = self._splitters[number].frames(packets)
            alive = alive or bool(frames)
            for topic, batches in finger.place(frames, arrival_ns).items():
                topics[f'{self._prefixes[number]}{topic}'] = batches
        return topics, alive

    def close(self) -> None:
        """Stop the stream and close the device."""
        if self._port is None:
            return
        with contextlib.suppress(DeviceError):  # if it is gone there is nothing to stop
            self._port.write(stop_command())
        self._port.close()
        self._port = None

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals: samples published, samples lost, bogus candidates and bytes refused, and what was done about it."""
        cutters = [finger.cutter for finger in self._fingers.values()]
        return {
            'samples': sum(cutter.samples for cutter in cutters),
            'lost': sum(cutter.lost for cutter in cutters),
            'bogus': self._parser.refused,
            'refused_bytes': self._parser.refused_bytes,
            'repeated': self._repeated,
            'damaged_stamps': sum(finger.counter.damaged_stamps for finger in self._fingers.values()),
            'images': sum(cutter.images for cutter in cutters),
            'repeated_images': sum(cutter.repeated_images for cutter in cutters),
            'reopened': max(0, self._opened - 1),
            'revived': self._revived,
            'clock_steps': sum(finger.clock.steps for finger in self._fingers.values()),
        }

    @property
    def details(self) -> Mapping[str, str | float]:
        """Serial number of the USB device if it tells one, and how much its clock is slow."""
        drift = next(iter(self._fingers.values())).clock.drift
        serial = {'serial number': self._serial} if self._serial else {}
        return {**serial, 'device clock slow by [ppm]': PPM * drift}

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        return {
            f'{prefix}{topic}': rate
            for number, prefix in self._prefixes.items()
            for topic, rate in self._fingers[number].rates_hz.items()
        }

    @property
    def limits(self) -> Limits:
        """Ends of the int16 and of the uint16 by topic."""
        return {f'{prefix}{topic}': ends for prefix in self._prefixes.values() for topic, ends in tables.LIMITS.items()}

    def _without_duplicates(self, packets: Sequence[Packet]) -> list[Packet]:
        """Leave out what came twice: the same to the last bit, stamp and all."""
        unique = []
        for packet in packets:
            if packet == self._last_packet and any(item.kind == tables.TIMESTAMP for item in packet.items):
                self._repeated += 1
            else:
                unique.append(packet)
            self._last_packet = packet
        return unique

    def _watch_silence(self, port: SerialPort, alive: bool, n_bytes: int) -> None:
        """Wake a device that is open but silent; DeviceError when that does not help."""
        if alive:
            self._silent_reads = self._silent_bytes = self._revivals = 0
            return
        self._silent_reads += 1
        self._silent_bytes += n_bytes
        if self._silent_reads * self._params.batch_s < SILENCE_S:
            return
        if self._revivals == REVIVALS:
            raise DeviceError(self._silence_sentence())
        self._silent_reads = 0
        self._revivals += 1
        self._revived += 1
        port.write(stop_command())
        time.sleep(REVIVAL_PAUSE_S)
        port.write(start_command())
        self._interrupt()

    def _silence_sentence(self) -> str:
        fingers = ' or '.join(str(finger) for finger in self._prefixes)
        if self._silent_bytes:
            return (
                f"device '{self._params.device}' sends bytes, and nothing of finger {fingers} in them that this driver "
                'knows; check the finger, that it is a TSF-85, and its firmware (1.0.6 to 1.1.8 are known)'
            )
        return f"device '{self._params.device}' is open and sends nothing, started {1 + REVIVALS} times; replug it"

    def _interrupt(self) -> None:
        for finger in self._fingers.values():
            finger.interrupt()
