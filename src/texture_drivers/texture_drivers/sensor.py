# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Common parts of all sensors: parameters, and the thread that reads."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from texture_core.config import PARSE_ERRORS, find_file, from_mapping, load_yaml, param, parse_yaml, safe_repr
from texture_core.errors import DeviceError, InvalidParameter
from texture_core.types import Sensor, TactileSignal

# --------------------
# Parameters of every sensor.


@dataclass(frozen=True)
class BatchParams:
    """How the samples of a finger are delivered."""

    frame_id: str = param(
        'fingertip', 'Frame of the fingertip in the published messages; in a namespace NAMESPACE/ is put before it.'
    )
    batch_s: float = param(
        0.01,
        'Duration of one published batch; a longer batch costs less computing time and adds latency.',
        unit='s',
        low=0.001,
        high=0.1,
    )
    finger: int = param(0, 'Index of the finger that is read; 0 is the first one.', low=0, high=15)


@dataclass(frozen=True)
class SensorParams(BatchParams):
    """Where the sensor is and how its samples are delivered."""

    finger: int = param(0, 'Index of the finger that is read; 0 is the first one of the device.', low=0, high=4)
    device: str = param(
        '/dev/rq_tsf85_0',
        "Path of the device; a symbolic link is followed at each opening. 'auto' finds the only TSF-85 on USB.",
    )
    config: str = param(
        '', "Settings of the sensor: path of a YAML file or name of one in config/sensors; '' takes the defaults."
    )


# --------------------
# Read a sensor in a thread, reopen it when it is gone, and report its faults.

RETRY_S = 0.2
# So often a sensor that was never there is tried without a warning, for 10 s: its device may appear after the node.
QUIET_ATTEMPTS = 50
NOT_OPENED = 'not opened yet'
Deliver = Callable[[str, TactileSignal], None]
LogSentence = Callable[[str], None]
T = TypeVar('T')


class SensorReader:
    """A thread that reads a sensor, hands each batch on, and opens the sensor again when it is gone."""

    def __init__(
        self, sensor: Sensor, deliver: Deliver, warn: LogSentence = lambda _: None, inform: LogSentence = lambda _: None
    ) -> None:
        self.sensor = sensor
        self.fault = NOT_OPENED  # '' while all is well
        self.published: dict[str, int] = dict.fromkeys(sensor.expected_rates_hz, 0)
        self._quiet_attempts = QUIET_ATTEMPTS
        self._warned = ''  # of this fault
        self._deliver = deliver
        self._warn = warn
        self._inform = inform
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='sensor reader', daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

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
            self._of_sensor(self.sensor.open)
            self._quiet_attempts = 0
            if self.fault == NOT_OPENED:
                self.fault = 'no sample has come since it was opened; check the sensor'
            while not self._stop.is_set():
                for topic, batches in self._of_sensor(self.sensor.read).items():
                    self._deliver_all(topic, batches)
        except DeviceError as error:
            self.fault = str(error)
            self._warn_once(self.fault)

    def _of_sensor(self, call: Callable[[], T]) -> T:
        """Return what a call of the sensor does; DeviceError, with type, text and line, whatever else it raises."""
        try:
            return call()
        except DeviceError:
            raise
        except Exception as error:  # a sensor may be a user's, and raise anything: this thread must outlive it
            place = traceback.extract_tb(error.__traceback__)[-1]
            where = f'{Path(place.filename).name}, line {place.lineno}'
            raise DeviceError(f'the sensor raised {type(error).__name__} in {where}: {error}') from error

    def _warn_once(self, fault: str) -> None:
        """Warn of a fault that was not warned of yet, except in the first attempts."""
        if self._quiet_attempts:
            self._quiet_attempts -= 1
        elif self._warned != fault:
            self._warned = fault
            stop = '' if fault.endswith(('.', '?', '!')) else '.'
            self._warn(f'{fault}{stop} Trying again every {RETRY_S} s')

    def _deliver_all(self, topic: str, batches: Sequence[TactileSignal]) -> None:
        if batches and self.fault:  # before the first batch is out: its receiver may request a tare at once
            self.fault = self._warned = ''
            self._inform('the sensor delivers samples')
        for batch in batches:
            self._deliver(topic, batch)
            self.published[topic] += len(batch.samples)


# --------------------
# Settings of one kind of sensor, in addition to those of every sensor: from a YAML file, or written in place.


def load_settings(cls: type[T], config: str) -> T:
    """Return the settings that `config` means; what they do not name keeps its default."""
    return from_mapping(cls, read_settings(config), f'settings {config}')


def read_settings(config: str) -> dict[str, Any]:
    """Return the mapping that `config` means; see `load_settings`."""
    if not config:
        return {}
    if config.lstrip().startswith('{'):
        try:
            content = parse_yaml(config)
        except PARSE_ERRORS as error:
            raise InvalidParameter(f'settings {config} are not YAML: {error}') from error
    else:
        content = load_yaml(find_file(config, 'texture_drivers', 'config/sensors', 'settings'), 'settings')
    if not isinstance(content, dict):
        raise InvalidParameter(f'settings {config} hold {safe_repr(content)}; a mapping of names to values is needed')
    return content
