# SPDX-License-Identifier: Apache-2.0
"""Record the topics of the suite into a bag."""

from __future__ import annotations

import queue
import threading
import time
from collections import Counter
from dataclasses import dataclass
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile

from texture_core.config import param
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.ros import DiagnosticReport, Diagnostics, declare, run
from texture_recordings.bags import BagWriter, Continuity, RawMessage, SignalDecoder, short_name
from texture_recordings.ros import TOPICS, Topic

QUEUE = 20_000  # a minute of one finger: a disk that stalls longer loses messages, and they are counted
POLL_S = 0.2
FLUSH_S = 1.0  # what a killed recorder, a failing supply or a full disk may take
NOTHING = RawMessage('', '', 0, b'')
DISCOVERY_S = 0.5  # how often it is asked what else is published


@dataclass(frozen=True)
class RecordParams:
    """Parameters of the recorder."""

    out: str = param('', 'Folder of the new bag; nothing may exist there.')


class RecordNode(Node):
    """Write every message of the suite's topics, in its namespace and below it, to a bag, with its time of arrival."""

    def __init__(self) -> None:
        super().__init__('record')
        params = declare(self, RecordParams)
        if not params.out:
            raise InvalidParameter("parameter 'out' is ''; give the folder of the new bag")
        self._path = params.out
        self._bag = BagWriter(params.out)
        self._counts: Counter[str] = Counter()
        self._continuity = Continuity()
        self._decoders: dict[str, SignalDecoder] = {}
        self._queue: queue.Queue[RawMessage | None] = queue.Queue(QUEUE)
        self._error: OSError | None = None
        self._writer = threading.Thread(target=self._write, name='writer')
        self._writer.start()
        self._namespace = self.get_namespace().rstrip('/')
        self._subscribed: set[str] = set()
        for topic in TOPICS.values():
            self._subscribe(topic, self.resolve_topic_name(topic.name))
        self._diagnostics = Diagnostics(self, self._report)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # with use_sim_time the node's own may stand still
        self.create_timer(POLL_S, self._check, clock=steady)
        self.create_timer(DISCOVERY_S, self._find_more, clock=steady)
        self.get_logger().info(f"recording {', '.join(TOPICS)} to '{self._path}'")

    def shutdown(self) -> None:
        """Write what is waiting and complete the bag."""
        self._queue.put(None)
        self._writer.join()
        try:
            self._bag.close()
        except OSError as error:
            self.get_logger().error(f"'{self._path}' cannot be completed: {error}; free some space and record again")
        else:
            self.get_logger().info(f"'{self._path}' is complete: {self._report()[1]}")
            self._diagnostics.end()

    def _find_more(self) -> None:
        """Subscribe to what has appeared below the namespace: further fingers, and the nodes of further namespaces."""
        for name, types in self.get_topic_names_and_types():
            topic = TOPICS.get(short_name(name))
            ours = topic is not None and name.startswith(f'{self._namespace}/')
            if topic is not None and ours and name not in self._subscribed and topic.msgtype in types:
                self._subscribe(topic, name)
                self.get_logger().info(f"recording '{name}', too")

    def _subscribe(self, topic: Topic, name: str) -> None:
        self._subscribed.add(name)
        # Deep queues: a burst must not be lost while the executor is busy. Volatile: of an exploration that was over
        # before the recording began, the states alone would come, without the signal.
        qos = QoSProfile(depth=1000, reliability=topic.qos.reliability)
        self.create_subscription(topic.type, name, lambda raw: self._on_message(name, topic, raw), qos, raw=True)

    def _on_message(self, name: str, topic: Topic, raw: bytes) -> None:
        message = RawMessage(name, topic.msgtype, self.get_clock().now().nanoseconds, raw)
        try:
            self._queue.put_nowait(message)
        except queue.Full:
            self._counts['dropped'] += 1

    def _write(self) -> None:
        """Take messages from the queue to the disk until told to stop."""
        flushed_s = time.monotonic()
        while (message := self._next()) is not None:
            try:
                if message is not NOTHING:
                    self._bag.write_raw(message)
                if time.monotonic() - flushed_s >= FLUSH_S:
                    flushed_s = time.monotonic()
                    self._bag.flush()
            except OSError as error:
                self._error = self._error or error
                continue
            if message is not NOTHING:
                self._counts['messages'] += 1
                self._count_losses(message)

    def _next(self) -> RawMessage | None:
        try:
            return self._queue.get(timeout=FLUSH_S)
        except queue.Empty:
            return NOTHING

    def _count_losses(self, message: RawMessage) -> None:
        if not message.msgtype.endswith('/TactileSignal'):
            return
        try:
            signal = self._decoders.setdefault(message.topic, SignalDecoder()).decode(message.data)
        except InvalidData:
            self._counts['bad'] += 1
            return
        self._continuity.update(message.topic, signal)

    def _check(self) -> None:
        if self._error is not None:
            raise InvalidData(f"'{self._path}' cannot be written: {self._error}; free some space and record again")

    def _report(self) -> DiagnosticReport:
        lost = sum(self._continuity.lost.values())
        dropped, bad = self._counts['dropped'], self._counts['bad']
        faults = {'lost_samples': lost, 'dropped_messages': dropped, 'bad_messages': bad}
        numbers: dict[str, Any] = {
            'messages': self._counts['messages'],
            **faults,
            'restarts': sum(self._continuity.restarts.values()),
            **{f'samples {topic}': count for topic, count in self._continuity.samples.items()},
        }
        others = [f'{count} {name.replace("_", " ")}' for name, count in faults.items() if count]
        said = ', '.join(filter(None, (self._continuity.losses, *others[bool(lost) :])))
        sentence = f'{self._counts["messages"]} messages recorded, {said or "nothing lost"}'
        return 'WARN' if said else 'OK', sentence, numbers


def main() -> None:
    """Run the node."""
    run(RecordNode)
