# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Record the topics of the suite into a bag."""

from __future__ import annotations

import queue
import threading
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from texture_core.config import param
from texture_core.errors import InvalidData, InvalidParameter, TextureError
from texture_core.ros import DiagnosticReport, Diagnostics, declare, run
from texture_core.types import ENDED, Quality, TactileSignal
from texture_recordings.bags import COMMON, MESSAGES, BagWriter, Continuity, RawMessage, decode, typestore
from texture_recordings.ros import TOPICS, message_class

QUEUE = 20_000  # a minute of one finger: a disk that stalls longer loses messages, and they are counted
POLL_S = 0.2
FLUSH_S = 1.0  # what a killed recorder, a failing supply or a full disk may take
DISCOVERY_S = 0.5  # period of the search for other topics
SILENT_S = 5.0  # without a sample, after which it is reported


@dataclass(frozen=True)
class RecordParams:
    """Parameters of the recorder."""

    out: str = param('', 'Folder of the new bag; nothing may exist there.')
    all: bool = param(
        False, 'Records every topic in the namespace and below it, not only those of the suite and a few of ROS.'
    )
    signal_topics: str = param(
        '',
        "Topics of the fingers, as the explorer's parameter of this name; of other namespaces below nothing is "
        "recorded, such as those of another explorer. '' records them all.",
    )


class RecordNode(Node):
    """Write the topics of the suite's messages, in its namespace and below it, to a bag, with their times of arrival.

    Also `/diagnostics`, `/rosout`, `/tf_static` and `/parameter_events`.
    """

    def __init__(self) -> None:
        super().__init__('record')
        params = declare(self, RecordParams)
        if not params.out:
            raise InvalidParameter("parameter 'out' is ''; give the folder of the new bag")
        self._path, self._all = params.out, params.all
        self._bag = BagWriter(params.out)
        self._counts: Counter[str] = Counter()
        self._continuity = Continuity()
        self._exploring: dict[str, str] = {}  # id of the exploration that is recorded, '' if none, by topic
        self._queue: queue.Queue[RawMessage | None] = queue.Queue(QUEUE)
        self.error: TextureError | None = None  # which ended the recording, or says that it has no sample
        self._silent_from_s = time.monotonic() + SILENT_S
        self._writer = threading.Thread(target=self._write, name='writer')
        self._writer.start()
        self._namespace = self.get_namespace().rstrip('/')
        self._fingers = {self.resolve_topic_name(topic).rpartition('/')[0] for topic in params.signal_topics.split()}
        self._seen: set[str] = set()  # topics that are recorded, or whose omission was logged
        for topic in TOPICS.values():
            self._subscribe(self.resolve_topic_name(topic.name), topic.msgtype, topic.qos)
        self._diagnostics = Diagnostics(self, self._report)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # with use_sim_time the node's clock may stop
        self.create_timer(POLL_S, self._check, clock=steady)
        self.create_timer(DISCOVERY_S, self._find_more, clock=steady)
        self.get_logger().info(f"recording {', '.join(TOPICS)} to '{self._path}'")

    def shutdown(self) -> None:
        """Write what is waiting and complete the bag."""
        self._queue.put(None)
        self._writer.join()
        try:
            self._bag.close()
        except TextureError as error:
            self.error = error
        if self.error is not None:
            self.get_logger().error(f'the bag is not complete: {self.error}')
        else:
            self._silent_from_s = 0.0
            self.get_logger().info(f"'{self._path}' is complete: {self._report()[1]}")
            self._diagnostics.end()
            if silence := self._silence():
                self.error = InvalidData(f"'{self._path}': {silence}")

    def _find_more(self) -> None:
        """Subscribe to what has appeared."""
        for name, types in self.get_topic_names_and_types():
            ours = name.startswith(f'{self._namespace}/') and (self._all or types[0] in MESSAGES)
            ours &= not self._fingers or name.rpartition('/')[0] in (self._namespace, *self._fingers)
            if name not in self._seen and (ours or name in COMMON):
                if types[0] not in typestore().types:
                    self._seen.add(name)
                    self.get_logger().warning(f"'{name}' is not recorded: bags cannot hold {types[0]}")
                elif publishers := self.get_publishers_info_by_topic(name):
                    # Not before: who only listens does not tell what is offered, and a wrong wish gets nothing.
                    self._subscribe(name, types[0], publishers[0].qos_profile)

    def _subscribe(self, name: str, msgtype: str, offered: QoSProfile) -> None:
        self._seen.add(name)
        reliable, latched = ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL
        depth = max(1, offered.depth)  # unknown of a publisher in another process: 0
        quality = Quality(depth, offered.reliability == reliable, offered.durability == latched)
        self._bag.qualities[name] = quality
        # Deep queues: a burst must not be lost while the executor is busy. Volatile, but for what is published once:
        # of an exploration that was over before the recording began, the states alone would come.
        once = name in COMMON or name.endswith(('_baseline', '/model_info'))
        durability = offered.durability if once else DurabilityPolicy.VOLATILE
        qos = QoSProfile(depth=1000, reliability=offered.reliability, durability=durability)
        kind = message_class(msgtype)
        self.create_subscription(kind, name, lambda raw: self._on_message(name, msgtype, raw), qos, raw=True)
        if name not in TOPICS:
            self.get_logger().info(f"recording '{name}'")

    def _on_message(self, name: str, msgtype: str, raw: bytes) -> None:
        message = RawMessage(name, msgtype, self.get_clock().now().nanoseconds, raw)
        try:
            self._queue.put_nowait(message)
        except queue.Full:
            self._counts['dropped'] += 1

    def _write(self) -> None:
        """Write messages from the queue to the disk until stopped."""
        flushed_s = time.monotonic()
        while True:
            try:
                with suppress(queue.Empty):
                    if (message := self._queue.get(timeout=FLUSH_S)) is None:
                        return
                    self._bag.write_raw(message)
                    self._counts['messages'] += 1
                    self._counts['wanted'] += self._all and message.topic not in COMMON
                    self._note(message)
                if time.monotonic() - flushed_s >= FLUSH_S:
                    flushed_s = time.monotonic()
                    self._bag.flush()
            except TextureError as error:  # noqa: PERF203 - what comes later may fit
                self.error = self.error or error

    def _note(self, message: RawMessage) -> None:
        """Count lost samples, and bring an exploration that is over to the disk."""
        if not message.msgtype.endswith(('/TactileSignal', '/ExplorationState')):
            return
        try:
            value = decode(message.data, message.msgtype)
        except InvalidData:
            self._counts['bad'] += 1
            return
        if isinstance(value, TactileSignal):
            self._continuity.update(message.topic, value)
            self._counts['wanted'] += 1
            return
        before = self._exploring.get(message.topic, '')
        self._exploring[message.topic] = '' if value.phase in ENDED else value.exploration_id
        if before and before != self._exploring[message.topic]:
            self._bag.flush()
            self.get_logger().info(f"exploration '{before}' is on the disk: {self._report()[1]}")

    def _check(self) -> None:
        """End the node when the bag cannot be written."""
        if self.error is not None:
            rclpy.try_shutdown()

    def _silence(self) -> str:
        """Return that no sample came, and where sensors publish; '' at first."""
        if self._counts['wanted'] or time.monotonic() < self._silent_from_s:
            return ''
        found = [name for name, types in self.get_topic_names_and_types() if 'texture_msgs/msg/TactileSignal' in types]
        sensors = ', '.join(name for name in found if self.count_publishers(name))
        return (
            f"no sample came in the namespace '{self._namespace or '/'}', and sensors publish {sensors or 'nowhere'}; "
            'start the sensor, or give its namespace (--namespace)'
        )

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
        if silence := self._silence():
            self.get_logger().warning(silence, once=True)
        said = ', '.join(filter(None, (self._continuity.losses, *others[bool(lost) :], silence)))
        sentence = f'{self._counts["messages"]} messages recorded, {said or "nothing lost"}'
        return 'WARN' if said else 'OK', sentence, numbers


def main() -> None:
    """Run the node."""
    run(RecordNode)
