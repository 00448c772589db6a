# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The node that turns the messages of any other driver into the suite's signals, by a mapping file."""

from __future__ import annotations

import importlib
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from texture_msgs import msg

from texture_core.config import param
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.ros import SENSOR_QOS, DiagnosticReport, Diagnostics, declare, frame_name, run, to_msg
from texture_drivers.adaptor import AdaptorMapping, SignalAdaptor, load_mapping
from texture_drivers.health import BEFORE_THE_START
from texture_drivers.nodes.sensor import shared_topic
from texture_drivers.sensor import BatchParams

MOST_MISSING = 0.05  # of the messages: of fewer the frequencies are off by less
# So many reports of an error in a row, one each second, log it: the driver may start after the node.
FIRST_REPORTS, LATER_REPORTS = 5, 2


def import_message(message_type: str) -> Any:
    """Return the class of 'package/msg/Type', found at run time: the suite does not depend on other drivers."""
    package, _, name = message_type.partition('/msg/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError) as error:
        raise InvalidParameter(
            f"the mapping needs '{message_type}', which cannot be imported ({error}); build the package with these "
            'messages and source it, or correct the type in the mapping'
        ) from error


def load_messages(mapping: str, finger: int) -> tuple[AdaptorMapping, dict[str, Any]]:
    """Return a mapping, and the classes of its messages by their types."""
    loaded = load_mapping(mapping, finger)
    kinds = [kind for one in loaded.signals.values() for kind in (one.type, one.number_type) if kind]
    return loaded, {kind: import_message(kind) for kind in kinds}


@dataclass(frozen=True)
class AdaptorParams(BatchParams):
    """Parameters that select which messages are converted."""

    mapping: str = param(
        'robotiq_tsf', 'Mapping of messages to signals: name of a shipped one, or path of a YAML file.'
    )


class Adaptor(Node):
    """Publish one finger out of the messages of another driver."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('adaptor', **kwargs)
        params = declare(self, AdaptorParams)
        frame_id = frame_name(self.get_namespace(), params.frame_id)
        mapping, self._messages = load_messages(params.mapping, params.finger)
        self._adaptors = {
            name: SignalAdaptor(f'{Path(params.mapping).stem}/{name}', signal, frame_id)
            for name, signal in mapping.signals.items()
        }
        self._publishers_of = {
            name: self.create_publisher(msg.TactileSignal, name, SENSOR_QOS) for name in self._adaptors
        }
        self._lost = 0
        self._received: Counter[tuple[str, str]] = Counter()  # messages by signal and topic
        self._reported = self._received.copy()  # those of them before the last report
        self._refusals: dict[str, str] = {}  # the newest since the last report, by signal
        self._delivering: set[str] = set()  # signals, until an error of theirs is logged
        self._patience = dict.fromkeys(self._adaptors, FIRST_REPORTS)  # reports until an error is logged
        self._rates_hz = {name: adaptor.rate_hz for name, adaptor in self._adaptors.items()}
        for name, adaptor in self._adaptors.items():
            wanted = adaptor.mapping
            self._listen(name, wanted.topic, wanted.type, adaptor.take)
            if wanted.number_topic:
                self._listen(name, wanted.number_topic, wanted.number_type, adaptor.take_number)
        self.create_timer(params.batch_s, self._publish)
        self._diagnostics = Diagnostics(self, self._report)

    def _listen(self, signal: str, topic: str, message_type: str, take: Callable[[Any, int], None]) -> None:
        """Subscribe; a message is passed on with the time at which it was sent."""

        def on_message(message: Any, info: Mapping[str, int]) -> None:
            if not self._received[stream]:
                self._patience[signal] = LATER_REPORTS
            self._received[stream] += 1
            try:
                take(message, info['source_timestamp'])
            except InvalidData as error:
                self._refusals[signal] = f"on '{stream[1]}' {error}"

        self.create_subscription(self._messages[message_type], topic, on_message, SENSOR_QOS)
        stream = signal, self.resolve_topic_name(topic)
        self._received[stream] = 0

    def _publish(self) -> None:
        for name, adaptor in self._adaptors.items():
            if adaptor.rate_hz != self._rates_hz[name]:
                self._rates_hz[name] = adaptor.rate_hz
                self.get_logger().info(
                    f"the rate of '{name}' was measured: {adaptor.rate_hz:g} Hz; set rate_hz in the mapping to keep it"
                )
            for batch in adaptor.batches():
                self._publishers_of[name].publish(to_msg(batch))
                if name not in self._delivering and self._patience[name] > 0:
                    self._delivering.add(name)
                    if len(self._delivering) == len(self._adaptors):
                        self.get_logger().info('the sensor delivers samples')

    def _errors(self) -> str:
        """Return what was wrong with the signals since the last report, and log it once if it lasts."""
        silent = [stream for stream, count in self._received.items() if count == self._reported[stream]]
        yet = '' if any(self._received[stream] for stream in silent) else ' yet'
        topics = ', '.join(sorted({f"'{topic}'" for _, topic in silent}))
        silence = f'no message on {topics}{yet}; start the driver, or correct topic and type in the mapping'
        found = {name: adaptor.fault for name, adaptor in self._adaptors.items()}
        found |= dict.fromkeys((name for name, _ in silent), silence) | self._refusals
        self._reported, self._refusals = self._received.copy(), {}
        for name, error in found.items():
            self._patience[name] = self._patience[name] - 1 if error else LATER_REPORTS
        sentence = '; '.join(dict.fromkeys(filter(None, found.values())))
        lasting = {name for name, reports in self._patience.items() if reports == 0}
        if lasting:
            self._delivering -= lasting
            self.get_logger().warning(sentence)
        return sentence

    def _report(self) -> DiagnosticReport:
        adaptors = list(self._adaptors.values())
        error = self._errors()
        exact = all(adaptor.mapping.number for adaptor in adaptors)
        missing = max(adaptor.missing for adaptor in adaptors)
        lost = sum(adaptor.lost for adaptor in adaptors)
        new, self._lost = lost - self._lost, lost
        shared = shared_topic(self, self._publishers_of.values())
        conditions = (
            (bool(error), 'ERROR', error),
            (bool(shared), 'WARN', shared),
            (new > 0, 'WARN', f'{new} samples lost since the last report'),
            (not all(one.measured for one in adaptors), 'WARN', 'measuring rates and times, in 2 s without a silence'),
            (
                missing > MOST_MISSING,
                'WARN',
                f'{missing:.0%} of the messages are missing, and short gaps are closed up: times and frequencies are '
                'wrong; mend the connection to the driver, or map its number',
            ),
        )
        level, sentence = next(((level, text) for holds, level, text in conditions if holds), ('OK', 'converting'))
        values = {
            'samples': sum(adaptor.samples for adaptor in adaptors),
            'lost': lost,
            'losses': 'by number' if exact else 'estimated by time; shorter ones unknown',
            **BEFORE_THE_START,
            'refused messages': sum(adaptor.refused for adaptor in adaptors),
            'values that are no number': sum(adaptor.invalid for adaptor in adaptors),
            'samples without number': sum(adaptor.unnumbered for adaptor in adaptors),
            'numbers without sample': sum(adaptor.unpaired for adaptor in adaptors),
            **{f'{name} rate [Hz]': adaptor.rate_hz for name, adaptor in self._adaptors.items()},
        }
        return level, sentence, values


def main() -> None:
    """Run the node."""
    run(Adaptor, make_executor=SingleThreadedExecutor)  # the EventsExecutor fails at callbacks with two arguments
