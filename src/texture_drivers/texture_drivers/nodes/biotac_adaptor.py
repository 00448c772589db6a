# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The node that turns the messages of other BioTac drivers into the suite's signals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rclpy.node import Node
from texture_msgs import msg

from texture_core.config import find, param
from texture_core.errors import InvalidData
from texture_core.ros import SENSOR_QOS, DiagnosticReport, Diagnostics, declare, frame_name, run, to_msg
from texture_drivers.biotac import MESSAGES, BioTacMessageConverter
from texture_drivers.health import BEFORE_THE_START
from texture_drivers.nodes.tsf85_adaptor import import_message

TOPICS = ('signal', 'signal_static')


@dataclass(frozen=True)
class BiotacAdaptorParams:
    """Parameters that select which BioTac messages are converted."""

    message_type: str = param(
        'biotac_sensors/msg/BioTacHand', 'Type of the subscribed messages, written as package/msg/Type.'
    )
    topic: str = param('biotac_pub', 'Topic on which the other driver publishes.')
    finger: int = param(0, 'Index of the finger that is converted; 0 is the first one of the message.', low=0, high=4)
    frame_id: str = param(
        'fingertip',
        'Frame of the fingertip in the published messages; in a namespace NAMESPACE/ is put before it.',
    )


class BiotacAdaptor(Node):
    """Publish one finger out of the messages of another driver."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('biotac_adaptor', **kwargs)
        self._params = declare(self, BiotacAdaptorParams)
        layout = find(MESSAGES, self._params.message_type.rpartition('/')[2], 'layout of BioTac messages')
        self._stream = BioTacMessageConverter(
            layout, self._params.finger, frame_name(self.get_namespace(), self._params.frame_id)
        )
        self._messages = self._refused = self._lost = 0
        self._fault = ''
        self._signals = {topic: self.create_publisher(msg.TactileSignal, topic, SENSOR_QOS) for topic in TOPICS}
        message_class = import_message(self._params.message_type, 'message_type')
        self.create_subscription(message_class, self._params.topic, self._on_message, SENSOR_QOS)
        self._diagnostics = Diagnostics(self, self._report)

    def _on_message(self, message: Any) -> None:
        self._messages += 1
        try:
            batches = self._stream.update(message)
        except InvalidData as error:
            self._refused += 1
            self._fault = str(error)
            return
        self._fault = ''
        for topic, batch in batches.items():
            self._signals[topic].publish(to_msg(batch))

    def _report(self) -> DiagnosticReport:
        if self._stream.serial:
            self._diagnostics.hardware_id = self._stream.serial
        new, self._messages = self._messages, 0
        lost, self._lost = self._stream.lost - self._lost, self._stream.lost
        counts = {'samples': self._stream.samples, 'lost': self._stream.lost, 'refused messages': self._refused}
        conditions = (
            (bool(self._fault), 'ERROR', self._fault),
            (new == 0, 'ERROR', f"no message on '{self._params.topic}'; start the driver, or set the parameter topic"),
            (lost > 0, 'WARN', f'{lost} samples lost since the last report'),
        )
        level, sentence = next(((level, text) for holds, level, text in conditions if holds), ('OK', 'converting'))
        return level, sentence, {**counts, **BEFORE_THE_START}


def main() -> None:
    """Run the node."""
    run(BiotacAdaptor)
