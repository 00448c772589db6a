# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Publish a bag into the graph, at any rate, and exit when it is through."""

from __future__ import annotations

import itertools
import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rosgraph_msgs.msg import Clock as ClockTime

from texture_core.config import param
from texture_core.errors import DeviceError, InvalidData, InvalidParameter, TextureError
from texture_core.ros import LISTENERS, declare, run, to_stamp
from texture_core.types import NANOSECONDS
from texture_recordings.bags import RawMessage, bags_in, read_named, short_name, topics_in
from texture_recordings.ros import TOPICS
from texture_recordings.slides import find_slides

# --------------------
# When each message of a recording is due in a replay.


LONGEST_PAUSE_NS = NANOSECONDS  # longer ones are shortened to it


class Schedule:
    """Turn log times, given in their order, into seconds since the replay began."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._last_ns: int | None = None
        self._played_ns = 0

    def due_s(self, log_ns: int) -> float:
        """Return when the message logged at `log_ns` is due."""
        if self._last_ns is not None:
            self._played_ns += min(max(log_ns - self._last_ns, 0), LONGEST_PAUSE_NS)
        self._last_ns = log_ns
        return self._played_ns / self._rate / NANOSECONDS

    @property
    def played_s(self) -> float:
        """Seconds of the recording up to the last requested message, with shortened pauses."""
        return self._played_ns / NANOSECONDS


# What is derived from these is left out: the live graph derives it again.
INPUTS = ('signal', 'signal_static', 'exploration')
EARLY_S = 0.0005  # what is due so soon is published now: waking up again would cost more than it gains
POLL_S = 0.05
ACKNOWLEDGED_WITHIN = Duration(seconds=5)


@dataclass(frozen=True)
class ReplayParams:
    """What is published, how fast, and to which nodes."""

    bag: str = param('', 'Bag, or the folder of bags, that is published.')
    rate: float = param(1.0, 'Playback rate relative to the recording; 2 is twice as fast.', low=0.01, high=1000.0)
    slides: str = param('', "Which slides of each surface are published, such as '1-30'; '' takes the whole recording.")
    from_namespace: str = param('', "Namespace in the bag to publish; '' if it has but one.")
    listeners: str = param(
        'classifier',
        'Names of the nodes that must get the samples, or features of them, before the start, separated by spaces.',
    )
    deadline_s: float = param(60.0, 'Time to wait for these nodes.', unit='s', low=0.0)
    end_delay_s: float = param(
        0.0,
        'Time to wait after the last message, in which the last estimates come, before the node ends.',
        unit='s',
        low=0.0,
    )
    start_delay_s: float = param(1.0, 'Time between finding these nodes and the start.', unit='s', low=0.0)
    clock: bool = param(
        False, "Publishes the time of the recording on '/clock', for nodes whose parameter 'use_sim_time' is true."
    )


class ReplayNode(Node):
    """Publish the signals and states of a bag as they were: order, stamps and bytes."""

    def __init__(self) -> None:
        super().__init__('replay')
        self._params = declare(self, ReplayParams)
        if not self._params.bag:
            raise InvalidParameter("parameter 'bag' is ''; give the bag to replay")
        self._messages, names = self._chosen()
        topics = {name: TOPICS[short_name(name)] for name in names}
        self._outputs = {name: self.create_publisher(t.type, name, t.qos) for name, t in topics.items()}
        self._clock_time = self.create_publisher(ClockTime, '/clock', 10) if self._params.clock else None
        self._counts: Counter[str] = Counter()
        self._listeners: dict[str, list[str]] = {}  # of a feature extractor, as it reports
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)
        self._stop = threading.Event()
        self.error: TextureError | None = None  # which ended the player
        self._player = threading.Thread(target=self._play, name='player')
        self._player.start()
        # With use_sim_time the node's time would end with the recording.
        self.create_timer(POLL_S, self._check, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def shutdown(self) -> None:
        """Stop publishing."""
        self._stop.set()
        self._player.join()

    def _chosen(self) -> tuple[Iterator[tuple[str, RawMessage]], set[str]]:
        """Return the messages to publish, each with its topic, and all topics.

        A bag that cannot be read is refused here, before any thread runs.
        """
        namespace = self._params.from_namespace or None
        bags = bags_in(self._params.bag)
        inside = {name for bag in bags for name in topics_in(bag, namespace) if short_name(name) in INPUTS}
        # With several fingers there is no topic of a single one.
        names = {'exploration', *inside} if any('/' in name for name in inside) else set(INPUTS)
        if not self._params.slides:
            return (message for bag in bags for message in read_named(bag, namespace)), names
        chosen = find_slides(bags, self._params.slides, namespace)
        return (message for s in chosen for message in read_named(s.bag, namespace, s.start_ns, s.stop_ns)), names

    def _check(self) -> None:
        """End the node when the player is through."""
        if not self._player.is_alive():
            rclpy.try_shutdown()

    def _play(self) -> None:
        try:
            self._wait_for_listeners()
            self._refuse_others()
            self._begin_clock()
            self._wait_alone()
            self._publish_all()
        except TextureError as error:
            self.error = error

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            names = {value.key: value.value for value in status.values}.get(LISTENERS, '')
            self._listeners[status.name] = names.split()

    def _reached(self) -> set[str]:
        """Return the names of the nodes that get the samples, and of those that get the features of these."""
        found = {name: self._subscribed(name) for name in self._outputs}
        # Of several fingers the live graph may use one.
        samples = set().union(*(nodes for name, nodes in found.items() if short_name(name) != 'exploration'))
        direct = samples & found['exploration']
        names = {node.rpartition('/')[2] for node in direct}
        return names.union(*(self._listeners.get(node, ()) for node in direct))

    def _subscribed(self, name: str) -> set[str]:
        """Return the full names of the nodes that subscribe to an output."""
        found = self.get_subscriptions_info_by_topic(self._outputs[name].topic_name)
        return {f'{one.node_namespace.rstrip("/")}/{one.node_name}' for one in found}

    def _wait_for_listeners(self) -> None:
        """Wait for the nodes by their names: a recorder that listens as well is none of them."""
        deadline = time.monotonic() + self._params.deadline_s
        wanted = self._params.listeners.split()
        while not self._stop.wait(POLL_S):
            reached = self._reached()
            if not (missing := [name for name in wanted if name not in reached]):
                break
            if time.monotonic() > deadline:
                raise DeviceError(
                    f"nothing is played, as no node '{missing[0]}' gets the samples or their features (waited "
                    f'{self._params.deadline_s:g} s; found: {", ".join(sorted(reached)) or "none"}); '
                    f'`texture launch replay bag:={self._params.bag}` also starts these nodes, --namespace names '
                    'nodes that run elsewhere, and --listeners other nodes'
                )

    def _wait_alone(self) -> None:
        """Wait for the start delay, in which other publishers are still being discovered."""
        deadline = time.monotonic() + self._params.start_delay_s
        while time.monotonic() < deadline and not self._stop.wait(POLL_S):
            self._refuse_others()

    def _refuse_others(self) -> None:
        """Refuse topics that another node publishes: two streams on one would be mixed in every window."""
        taken = [one.topic_name for one in self._outputs.values() if self.count_publishers(one.topic_name) > 1]
        if taken:
            bag = self._params.bag
            raise InvalidData(
                f"another node publishes '{taken[0]}', and the samples of both would be mixed; stop it and start "
                f'`texture launch replay bag:={bag}`, or play the bag next to it with `texture launch replay '
                f'bag:={bag} namespace:=replay`'
            )

    def _begin_clock(self) -> None:
        """Publish the time of the first message, so that no node is at time 0 when it comes."""
        for name, message in itertools.islice(self._messages, 1):
            self._publish_time(message.log_ns)
            self._messages = itertools.chain([(name, message)], self._messages)

    def _publish_time(self, time_ns: int) -> None:
        if self._clock_time is not None:
            self._clock_time.publish(ClockTime(clock=to_stamp(time_ns)))

    def _publish_all(self) -> None:
        schedule = Schedule(self._params.rate)
        start, latest_s = time.monotonic(), 0.0
        for name, message in self._messages:
            if name not in self._outputs:
                continue
            ahead_s = schedule.due_s(message.log_ns) - (time.monotonic() - start)
            if ahead_s > EARLY_S:
                self._stop.wait(ahead_s)
            if self._stop.is_set():
                break
            latest_s = max(latest_s, -ahead_s)
            self._publish_time(message.log_ns)
            self._outputs[name].publish(message.data)
            self._counts[name] += 1
        for publisher in self._outputs.values():
            if publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE:
                publisher.wait_for_all_acked(ACKNOWLEDGED_WITHIN)
        counts = ', '.join(f'{count} {name}' for name, count in self._counts.items()) or 'nothing'
        self.get_logger().info(
            f'published {counts}: {schedule.played_s:.1f} s in {time.monotonic() - start:.1f} s, '
            f'at most {1000 * latest_s:.0f} ms late'
        )
        self._stop.wait(self._params.end_delay_s)


def main() -> None:
    """Run the node."""
    run(ReplayNode)
