"""Read a sensor in a thread, reopen it when it is gone, and report its faults."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence

from texture_core.errors import DeviceError
from texture_core.protocols import Sensor
from texture_core.signal import TactileSignal

RETRY_S = 0.2
# So often a sensor that was never there is tried without a warning, for 5 s: its device may appear after the node.
QUIET_ATTEMPTS = 25
Deliver = Callable[[str, TactileSignal], None]
LogSentence = Callable[[str], None]
Action = Callable[[], None]


class SensorReader:
    """A thread that reads a sensor, hands each batch on, and opens the sensor again when it is gone.

    Parameters
    ----------
    sensor
        What is read; used by this thread alone.
    deliver
        Called with topic and batch, in the thread.
    warn, inform
        Called with one sentence when the sensor goes, not at each retry, and when it comes back. A sensor that was
        never there is warned of after `QUIET_ATTEMPTS`.
    """

    def __init__(
        self, sensor: Sensor, deliver: Deliver, warn: LogSentence = lambda _: None, inform: LogSentence = lambda _: None
    ) -> None:
        self.sensor = sensor
        self.fault = 'not opened yet'  # '' while all is well
        self.published: dict[str, int] = dict.fromkeys(sensor.expected_rates_hz, 0)
        self._quiet_attempts = QUIET_ATTEMPTS
        self._warned = ''  # of this fault
        self._deliver = deliver
        self._warn = warn
        self._inform = inform
        self._actions: deque[Action] = deque()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='sensor reader', daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def between_reads(self, action: Action) -> None:
        """Do something to the sensor in this thread, between two reads, once it is open; it may raise DeviceError."""
        self._actions.append(action)

    def stop(self) -> None:
        """End the thread and close the sensor; returns when both are done."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        while not self._stop.is_set():
            self._read_until_gone()
            self.sensor.close()
            self._stop.wait(RETRY_S)

    def _read_until_gone(self) -> None:
        try:
            self.sensor.open()
            self._quiet_attempts = 0
            while not self._stop.is_set():
                for topic, batches in self.sensor.read().items():
                    self._deliver_all(topic, batches)
                while self._actions:
                    self._actions.popleft()()
        except DeviceError as error:
            self.fault = str(error)
            self._warn_once(self.fault)

    def _warn_once(self, fault: str) -> None:
        """Warn of a fault that was not warned of yet, except in the first attempts."""
        if self._quiet_attempts:
            self._quiet_attempts -= 1
        elif self._warned != fault:
            self._warned = fault
            self._warn(f'{fault}. Trying again every {RETRY_S} s')

    def _deliver_all(self, topic: str, batches: Sequence[TactileSignal]) -> None:
        if batches and self.fault:  # before the first batch is out: who has it may ask for a tare at once
            self.fault = self._warned = ''
            self._inform('the sensor delivers samples')
        for batch in batches:
            self._deliver(topic, batch)
            self.published[topic] += len(batch.samples)
