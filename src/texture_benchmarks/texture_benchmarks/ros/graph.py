# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Take part in a running ROS graph: stream simulated slides to the nodes, and time what they answer."""

from __future__ import annotations

import math
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from texture_core.errors import DeviceError
from texture_core.ros import from_msg, to_msg
from texture_core.ros_testing import NodeProcess
from texture_core.types import NANOSECONDS, Array, ExplorationState, TactileSignal, TextureEstimate
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


Timed = tuple[int, str, Any]  # when it is due, ns since the start; topic; data class


class Streamer:
    """Publish from a separate thread."""

    def __init__(self, graph: Graph, plan: Sequence[Timed]) -> None:
        publishers = {topic: graph.publisher(topic) for topic in {topic for _, topic, _ in plan}}
        self._plan = [(due_ns, publishers[topic], to_msg(value)) for due_ns, topic, value in plan]
        self.publishers = publishers
        self.topics = [topic for _, topic, _ in plan]
        self.sent_at_s: list[float] = []
        self._thread = threading.Thread(target=self._run, name='streamer')

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether there is more to come."""
        return self._thread.is_alive()

    def join(self) -> None:
        """Wait for the end."""
        self._thread.join()

    def _run(self) -> None:
        start = time.perf_counter()
        for due_ns, publisher, message in self._plan:
            ahead_s = due_ns * 1e-9 - (time.perf_counter() - start)
            if ahead_s > 0:
                time.sleep(ahead_s)
            self.sent_at_s.append(time.perf_counter())
            publisher.publish(message)


SETTLE_S = 3.0  # discovery of all subscriptions
READY_WITHIN_S = 60.0
DRIVER_S = 10.0
BATCH_S = 0.01  # as the sensor node delivers
SPEED_M_S, FORCE_N = 0.1, 2.0
DOMAIN = 83  # separate: other nodes on the machine must not subscribe


@dataclass(frozen=True, eq=False)
class LiveLatency:
    """What was measured over one long slide."""

    # (n_estimates,) From publishing the batch with the last sample of a window to receiving its estimate
    latency_s: Array
    expected: int  # Estimates that should have come
    cpu: Mapping[str, float]  # Fraction of one core that each node used, 0 to 1

    def numbers(self) -> dict[str, Any]:
        """Return the figures."""
        median, p99 = 1000 * np.percentile(self.latency_s, (50, 99))
        return {
            'estimates': len(self.latency_s),
            'expected': self.expected,
            'median_ms': float(median),
            'p99_ms': float(p99),
            'longest_ms': float(1000 * self.latency_s.max()),
            'cpu_percent': {name: round(100 * load, 1) for name, load in self.cpu.items()},
        }


@dataclass(frozen=True)
class LiveSlide:
    """What is streamed to each finger."""

    # scene, surface: which simulated surface is touched
    scene: str
    surface: str
    slide_s: float  # Length of the slide, s
    seed: int  # Seed of the slide of the first finger; each further one has the next


def measure(model_path: Path, slide: LiveSlide, namespaces: Sequence[str] = ('',)) -> Mapping[str, LiveLatency]:
    """Stream a simulated slide to each of several fingers at once, and time the estimates."""
    model = load_model(model_path)
    topics = model.recipe.feature_set.topics
    fingers = [_Finger.simulated(name, replace(slide, seed=slide.seed + i)) for i, name in enumerate(namespaces)]
    with Graph(DOMAIN) as graph, ExitStack() as stack:
        for finger in fingers:
            finger.start(graph, stack, model_path)
        streamer = Streamer(graph, sorted((timed for f in fingers for timed in f.plan()), key=lambda timed: timed[0]))
        _wait_for_nodes(graph, streamer, fingers, topics)
        loads = _stream(graph, streamer, fingers, slide.slide_s + READY_WITHIN_S)
    windows = model.recipe.feature_set.windows
    expected = math.floor((slide.slide_s - windows.length_s) / windows.hop_s + 1e-6) + 1
    return {
        finger.namespace: LiveLatency(np.array(finger.latency_s(streamer, topics, windows.length_s)), expected, load)
        for finger, load in zip(fingers, loads, strict=True)
    }


def _wait_for_nodes(graph: Graph, streamer: Streamer, fingers: Sequence[_Finger], topics: Sequence[str]) -> None:
    """Wait until each node subscribes to the streams, and each classifier is discovered."""
    needed = [finger.topic(topic) for finger in fingers for topic in ('exploration', *topics)]

    def ready() -> bool:
        heard = all(streamer.publishers[topic].get_subscription_count() for topic in needed)
        return heard and all(graph.node.count_publishers(finger.topic('texture')) for finger in fingers)

    graph.wait_until(ready, READY_WITHIN_S * len(fingers), 'the feature extractors and classifiers')
    graph.spin(SETTLE_S)


def _stream(
    graph: Graph, streamer: Streamer, fingers: Sequence[_Finger], deadline_s: float
) -> list[Mapping[str, float]]:
    """Stream until each finger has its final estimate; return the load of each of its nodes, 1 for one core."""
    before, began_s = [finger.cpu_s() for finger in fingers], time.monotonic()
    streamer.start()
    graph.wait_until(lambda: all(finger.ended for finger in fingers), deadline_s, 'the final estimates')
    lasted_s = time.monotonic() - began_s
    streamer.join()
    return [
        {name: (used_s - start[name]) / lasted_s for name, used_s in finger.cpu_s().items()}
        for finger, start in zip(fingers, before, strict=True)
    ]


@dataclass(eq=False)
class _Finger:
    """What is streamed to the nodes of one finger, and what comes from them."""

    namespace: str
    states: Sequence[ExplorationState]
    batches: Mapping[str, Sequence[TactileSignal]]
    nodes: list[NodeProcess] = field(default_factory=list)
    received: list[tuple[float, TextureEstimate]] = field(default_factory=list)

    @classmethod
    def simulated(cls, namespace: str, slide: LiveSlide) -> _Finger:
        """Return a finger that slides."""
        states, signals = simulate_exploration(
            load_scene(slide.scene), slide.surface, SPEED_M_S, FORCE_N, slide.slide_s,
            start_ns=0, exploration_id='long', rng=np.random.default_rng(slide.seed),
        )  # fmt: skip
        batches = {}
        for topic, [first, *others] in signals.items():  # one unbroken stream
            samples = np.concatenate([first.samples, *(signal.samples for signal in others)])
            places = np.arange(len(samples))
            batches[topic] = list(slide_batches(first, samples, places, first.stamp_ns, batch_s=BATCH_S))
        return cls(namespace, states, batches)

    def topic(self, short: str) -> str:
        """Return the name of a topic of this finger."""
        return f'{self.namespace}/{short}' if self.namespace else short

    def start(self, graph: Graph, stack: ExitStack, model_path: Path) -> None:
        """Start the two nodes, and note each estimate."""
        for package, node, given in (
            ('texture_features', 'feature_extractor', {'recipe': str(model_path.with_suffix('.json'))}),
            ('texture_estimation', 'classifier', {'model': str(model_path)}),
        ):
            process = NodeProcess(package, node, given, namespace=f'/{self.namespace}', domain_id=DOMAIN)
            self.nodes.append(stack.enter_context(process))
        graph.listen(self.topic('texture'), lambda estimate: self.received.append((time.perf_counter(), estimate)))

    @property
    def ended(self) -> bool:
        """Whether the final estimate has come."""
        return bool(self.received) and self.received[-1][1].final

    def cpu_s(self) -> Mapping[str, float]:
        """Return the computing time of each node so far."""
        return {node.name: node.cpu_s() for node in self.nodes}

    def plan(self) -> list[Timed]:
        """Return what is published when: a state at its stamp, a batch at its end."""
        plan: list[Timed] = [(state.stamp_ns, self.topic('exploration'), state) for state in self.states]
        for topic, signals in self.batches.items():
            plan += [(signal.end_ns, self.topic(topic), signal) for signal in signals]
        return sorted(plan, key=lambda timed: timed[0])

    def latency_s(self, streamer: Streamer, topics: Sequence[str], length_s: float) -> list[float]:
        """Return the time of each estimate since the last batch of its newest window was published."""
        sent = {topic: _sent_at(streamer, self.topic(topic)) for topic in topics}
        return [
            at_s - max(sent[topic][_last_batch(self.batches[topic], estimate, length_s)] for topic in sent)
            for at_s, estimate in self.received
            if not estimate.final
        ]


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


def _sent_at(streamer: Streamer, topic: str) -> list[float]:
    return [at_s for at_s, name in zip(streamer.sent_at_s, streamer.topics, strict=True) if name == topic]


def _last_batch(batches: Sequence[TactileSignal], estimate: TextureEstimate, length_s: float) -> int:
    """Return which batch holds the last sample of the newest window of an estimate; the stream begins at time 0."""
    rate_hz = batches[0].sampling_rate_hz
    start_s = estimate.stamp_ns / NANOSECONDS - length_s
    last = math.ceil(start_s * rate_hz - INDEX_TOLERANCE) + max(1, round(length_s * rate_hz)) - 1
    return next(number for number, batch in enumerate(batches) if batch.next_sample > last)
