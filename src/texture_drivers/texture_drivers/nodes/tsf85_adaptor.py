# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The node that turns the messages of the vendor's TSF-85 driver into the suite's signals."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rclpy.node import Node
from texture_msgs import msg

from texture_core.config import param
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.ros import SENSOR_QOS, DiagnosticReport, Diagnostics, declare, frame_name, run, to_msg
from texture_drivers.health import BEFORE_THE_START
from texture_drivers.tsf85 import Tsf85MessageConverter, Tsf85Settings

# --------------------
# Find other people's message types at run time: the suite does not depend on their packages.


def import_message(message_type: str, parameter: str) -> Any:
    """Return the class of 'package/msg/Type', as a parameter of that name asks for."""
    package, _, name = message_type.partition('/msg/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError) as error:
        raise InvalidParameter(
            f"parameter '{parameter}' asks for '{message_type}', which cannot be imported ({error}); build the package "
            'with these messages and source it, or name the type as package/msg/Type'
        ) from error


NEEDED = ('Dynamic', 'Timestamp', 'StaticData')
INERTIAL = ('Accelerometer', 'Gyroscope')


@dataclass(frozen=True)
class Tsf85AdaptorParams:
    """Parameters that select which TSF-85 messages are converted."""

    package: str = param('robotiq_tsf', "Package that defines the messages of the vendor's driver.")
    prefix: str = param('TactileSensor', 'First part of the names of the subscribed topics.')
    finger: int = param(0, 'Index of the finger that is converted; 0 is the first one.', low=0, high=1)
    imu: bool = param(
        False, 'Converts acceleration and angular rate too, which costs two more messages in each millisecond.'
    )
    static_rate_hz: float = param(
        60.0,
        'Rate at which taxel images are published; a higher rate repeats images more often.',
        unit='Hz',
        low=1.0,
        high=1000.0,
    )
    batch_s: float = param(
        0.01,
        'Duration of one published batch; a longer batch costs less computing time and adds latency.',
        unit='s',
        low=0.001,
        high=0.1,
    )
    frame_id: str = param(
        'fingertip',
        'Frame of the fingertip in the published messages; in a namespace NAMESPACE/ is put before it.',
    )


class Tsf85Adaptor(Node):
    """Publish one finger out of the messages of the vendor's driver."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('tsf85_adaptor', **kwargs)
        params = self._params = declare(self, Tsf85AdaptorParams)
        settings = Tsf85Settings(imu=params.imu)
        self._stream = Tsf85MessageConverter(
            params.finger, settings, params.static_rate_hz, frame_name(self.get_namespace(), params.frame_id)
        )
        self._refused = self._received = 0
        self._fault = ''
        self._counts = dict(self._stream.counts)
        self._signals = {
            topic: self.create_publisher(msg.TactileSignal, topic, SENSOR_QOS) for topic in self._stream.rates_hz
        }
        for name in NEEDED + INERTIAL if params.imu else NEEDED:
            message_class = import_message(f'{params.package}/msg/{name}', 'package')
            self.create_subscription(message_class, f'{params.prefix}/{name}', self._take(name), SENSOR_QOS)
        self.create_timer(params.batch_s, self._publish)
        self._diagnostics = Diagnostics(self, self._report)

    def _take(self, name: str) -> Callable[[Any, Mapping[str, int]], None]:
        """Return the callback of a topic."""

        def take(message: Any, info: Mapping[str, int]) -> None:
            self._received += 1
            try:
                self._stream.take(name, message, info['source_timestamp'])
            except InvalidData as error:
                self._refused += 1
                self._fault = str(error)

        return take

    def _publish(self) -> None:
        for topic, batches in self._stream.batches().items():
            for batch in batches:
                self._signals[topic].publish(to_msg(batch))

    def _report(self) -> DiagnosticReport:
        counts = dict(self._stream.counts)
        new = {name: total - self._counts[name] for name, total in counts.items()}
        received, fault = self._received, self._fault
        self._counts, self._received, self._fault = counts, 0, ''
        silent = f"no message on '{self._params.prefix}/…'; start the driver, or set the parameter prefix"
        unstamped = f"no '{self._params.prefix}/Timestamp': samples are numbered through, and losses are unknown"
        conditions = (
            (bool(fault), 'ERROR', fault),
            (received == 0, 'ERROR', silent),
            (new['lost'] > 0, 'WARN', f'{new["lost"]} samples lost since the last report'),
            (new['unstamped'] > new['samples'] / 2, 'WARN', unstamped),
        )
        level, sentence = next(((level, text) for holds, level, text in conditions if holds), ('OK', 'converting'))
        return level, sentence, {**counts, **BEFORE_THE_START, 'refused messages': self._refused}


def main() -> None:
    """Run the node."""
    run(Tsf85Adaptor)
