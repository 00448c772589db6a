# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Take part in a running ROS graph: stream simulated slides to the nodes, and time what they answer."""

from __future__ import annotations

import math
import tempfile
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from texture_core.errors import DeviceError
from texture_core.ros import from_msg, to_msg
from texture_core.ros_testing import NodeProcess
from texture_core.types import NANOSECONDS, TactileSignal, TextureEstimate
from texture_estimation.model import load_model
from texture_features.windows import INDEX_TOLERANCE
from texture_recordings.bags import slide_batches
from texture_recordings.ros import TOPICS, Topic
from texture_simulation.offline import simulate_exploration
from texture_simulation.scene import load_scene

POLL_S = 0.05
GraphT = TypeVar('GraphT', bound='Graph')


class Graph:
    """Take part in a ROS graph until the end of a `with` block."""

    def __init__(self, domain_id: int | None = None, name: str = 'probe') -> None:
        self._context = Context()
        self._context.init(domain_id=domain_id)
        self.node = Node(name, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)

    def __enter__(self: GraphT) -> GraphT:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def publisher(self, topic: str) -> Any:
        """Return a publisher on a topic of the suite: 'signal', or 'finger1/signal' in a separate namespace."""
        kind, qos, name = _in_namespace(topic)
        return self.node.create_publisher(kind, name, qos)

    def listen(self, topic: str, received: Callable[[Any], None]) -> None:
        """Call `received` with the data class of each message of a topic, or the message itself of /diagnostics."""
        kind, qos, name = _in_namespace(topic)
        convert = from_msg if kind.__module__.startswith('texture_msgs') else (lambda message: message)
        self.node.create_subscription(kind, name, lambda message: received(convert(message)), qos)

    def wait_until(self, condition: Callable[[], bool], deadline_s: float, what: str) -> None:
        """Take messages until the condition holds."""
        deadline = time.monotonic() + deadline_s
        while not condition():
            if time.monotonic() > deadline:
                raise DeviceError(f'{what}: nothing of it within {deadline_s:g} s; see the logs of the nodes')
            self._executor.spin_once(timeout_sec=POLL_S)

    def spin(self, seconds: float) -> None:
        """Take messages for so long."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)


def _in_namespace(topic: str) -> Topic:
    namespace, _, short = topic.rpartition('/')
    found = TOPICS[short]
    return found._replace(name=f'{namespace}/{found.name}') if namespace else found


SETTLE_S = 3.0  # discovery of all subscriptions
READY_WITHIN_S = 60.0
DRIVER_S = 10.0
BATCH_S = 0.01  # as the sensor node delivers
SPEED_M_S, FORCE_N = 0.1, 2.0
DOMAIN = 83  # separate: other nodes on the machine must not subscribe


def measure(
    model_path: Path, scene: str, surface: str, slide_s: float, *, seed: int, fingers: Sequence[str] = ('',)
) -> dict[str, Any]:
    """Stream a simulated slide to each finger, named by its namespace; return how late its estimates come.

    Time of each estimate since the batch with the last sample of its newest window was published, ms; computing time
    of the nodes, in percent of one core. The slide of each finger has the next seed.
    """
    feature_set = load_model(model_path).recipe.feature_set
    length_s, hop_s = feature_set.windows.length_s, feature_set.windows.hop_s
    batches = {finger: dict[str, list[TactileSignal]]() for finger in fingers}
    received = {finger: list[tuple[float, TextureEstimate]]() for finger in fingers}
    sent_s: defaultdict[str, list[float]] = defaultdict(list)  # by topic
    plan: list[tuple[int, str, Any]] = []  # when it is due, ns since the start; topic; data class
    nodes: list[NodeProcess] = []
    with Graph(DOMAIN) as graph, ExitStack() as stack:
        # What is streamed to each finger, a state at its stamp and a batch at its end, and its two nodes.
        for number, finger in enumerate(fingers):
            states, signals = simulate_exploration(
                load_scene(scene), surface, SPEED_M_S, FORCE_N, slide_s,
                start_ns=0, exploration_id='long', rng=np.random.default_rng(seed + number),
            )  # fmt: skip
            plan += [(state.stamp_ns, _topic(finger, 'exploration'), state) for state in states]
            for topic, [first, *others] in signals.items():  # one unbroken stream
                samples = np.concatenate([first.samples, *(signal.samples for signal in others)])
                places = np.arange(len(samples))
                batches[finger][topic] = list(slide_batches(first, samples, places, first.stamp_ns, batch_s=BATCH_S))
                plan += [(batch.end_ns, _topic(finger, topic), batch) for batch in batches[finger][topic]]
            for package, node, given in (
                ('texture_features', 'feature_extractor', {'recipe': str(model_path.with_suffix('.json'))}),
                ('texture_estimation', 'classifier', {'model': str(model_path)}),
            ):
                process = NodeProcess(package, node, given, namespace=f'/{finger}', domain_id=DOMAIN)
                nodes.append(stack.enter_context(process))
            graph.listen(
                _topic(finger, 'texture'),
                lambda estimate, found=received[finger]: found.append((time.perf_counter(), estimate)),
            )
        plan.sort(key=lambda timed: timed[0])
        publishers = {topic: graph.publisher(topic) for _, topic, _ in plan}
        messages = [(due_ns, topic, to_msg(value)) for due_ns, topic, value in plan]

        # Wait until each node subscribes to the streams, and each classifier is discovered.
        needed = [_topic(finger, topic) for finger in fingers for topic in ('exploration', *feature_set.topics)]

        def ready() -> bool:
            heard = all(publishers[topic].get_subscription_count() for topic in needed)
            return heard and all(graph.node.count_publishers(_topic(finger, 'texture')) for finger in fingers)

        graph.wait_until(ready, READY_WITHIN_S * len(fingers), 'the feature extractors and classifiers')
        graph.spin(SETTLE_S)

        # Stream from a separate thread until each finger has its final estimate.
        def publish() -> None:
            start_s = time.perf_counter()
            for due_ns, topic, message in messages:
                ahead_s = due_ns * 1e-9 - (time.perf_counter() - start_s)
                if ahead_s > 0:
                    time.sleep(ahead_s)
                sent_s[topic].append(time.perf_counter())
                publishers[topic].publish(message)

        def ended() -> bool:
            return all(found and found[-1][1].final for found in received.values())

        before_s, began_s = [node.cpu_s() for node in nodes], time.monotonic()
        streamer = threading.Thread(target=publish, name='streamer')
        streamer.start()
        graph.wait_until(ended, slide_s + READY_WITHIN_S, 'the final estimates')
        lasted_s = time.monotonic() - began_s
        streamer.join()
        cpu: Counter[str] = Counter()
        for node, used_s in zip(nodes, before_s, strict=True):
            cpu[node.name] += (node.cpu_s() - used_s) / lasted_s
    latency_ms = 1000 * np.array(
        [
            at_s
            - max(
                sent_s[_topic(finger, topic)][_last_batch(batches[finger][topic], estimate, length_s)]
                for topic in feature_set.topics
            )
            for finger in fingers
            for at_s, estimate in received[finger]
            if not estimate.final
        ]
    )
    median, p99 = np.percentile(latency_ms, (50, 99)).tolist()
    return {
        'estimates': len(latency_ms),
        'expected': len(fingers) * (math.floor((slide_s - length_s) / hop_s + 1e-6) + 1),
        'median_ms': median,
        'p99_ms': p99,
        'longest_ms': float(latency_ms.max()),
        'cpu_percent': {name: round(100 * load, 1) for name, load in [*cpu.items(), ('all', cpu.total())]},
    }


def _topic(finger: str, name: str) -> str:
    return f'{finger}/{name}' if finger else name


def driver_cpu() -> float:
    """Return the load of the sensor node, 1 for one core, reading an emulated TSF-85."""
    with tempfile.TemporaryDirectory() as folder:
        device = str(Path(folder) / 'tsf85')
        emulated = {'sensor_link': device, 'finger_pipe': str(Path(folder) / 'finger')}
        received: list[TactileSignal] = []
        with (
            Graph(DOMAIN) as graph,
            NodeProcess('texture_simulation', 'emulator', emulated, domain_id=DOMAIN),
            NodeProcess('texture_drivers', 'sensor', {'device': device}, domain_id=DOMAIN) as sensor,
        ):
            graph.listen('signal', received.append)
            graph.wait_until(lambda: len(received) > 100, READY_WITHIN_S, 'the signal of the sensor node')
            before, began = sensor.cpu_s(), time.monotonic()
            graph.spin(DRIVER_S)
            return (sensor.cpu_s() - before) / (time.monotonic() - began)


def _last_batch(batches: Sequence[TactileSignal], estimate: TextureEstimate, length_s: float) -> int:
    """Return which batch holds the last sample of the newest window of an estimate; the stream begins at time 0."""
    rate_hz = batches[0].sampling_rate_hz
    start_s = estimate.stamp_ns / NANOSECONDS - length_s
    last = math.ceil(start_s * rate_hz - INDEX_TOLERANCE) + max(1, round(length_s * rate_hz)) - 1
    return next(number for number, batch in enumerate(batches) if batch.next_sample > last)
