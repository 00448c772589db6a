# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Stream simulated slides to the running nodes, and time what they answer."""

from __future__ import annotations

import math
import tempfile
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.ros import from_msg, to_msg
from texture_core.ros_testing import LocalGraph, NodeProcess
from texture_core.types import NANOSECONDS, TactileSignal, TextureEstimate
from texture_estimation.model import load_model
from texture_features.windows import INDEX_TOLERANCE
from texture_recordings.bags import slide_batches
from texture_recordings.ros import TOPICS
from texture_simulation.offline import simulate_exploration
from texture_simulation.scene import load_scene

SETTLE_S = 3.0  # discovery of all subscriptions
READY_WITHIN_S = 60.0
DRIVER_S = 10.0
BATCH_S = 0.01  # as the sensor node delivers
SPEED_M_S, FORCE_N = 0.1, 2.0
DOMAIN = 83  # separate: other nodes on the machine must not subscribe


def measure(model_path: Path, scene: str, surface: str, slide_s: float, *, seed: int) -> dict[str, Any]:
    """Stream a simulated slide to feature extractor and classifier; return how late the estimates come.

    Time of each estimate since the batch with the last sample of its newest window was published, ms; computing time
    of the nodes, in percent of one core.
    """
    feature_set = load_model(model_path).recipe.feature_set
    length_s, hop_s = feature_set.windows.length_s, feature_set.windows.hop_s

    # What is streamed: a state at its stamp and a batch at its end.
    states, signals = simulate_exploration(
        load_scene(scene), surface, SPEED_M_S, FORCE_N, slide_s,
        start_ns=0, exploration_id='long', rng=np.random.default_rng(seed),
    )  # fmt: skip
    batches: dict[str, list[TactileSignal]] = {}
    for topic, [first, *others] in signals.items():  # one unbroken stream
        samples = np.concatenate([first.samples, *(signal.samples for signal in others)])
        batches[topic] = list(
            slide_batches(replace(first, samples=samples), np.arange(len(samples)), first.stamp_ns, batch_s=BATCH_S)
        )
    plan: list[tuple[int, str, Any]] = [(state.stamp_ns, 'exploration', state) for state in states]
    plan += [(batch.end_ns, topic, batch) for topic, of_topic in batches.items() for batch in of_topic]
    plan.sort(key=lambda timed: timed[0])
    messages = [(due_ns, topic, to_msg(value)) for due_ns, topic, value in plan]

    received: list[tuple[float, TextureEstimate]] = []
    sent_s: dict[str, list[float]] = {topic: [] for _, topic, _ in plan}
    with LocalGraph(DOMAIN, READY_WITHIN_S + slide_s) as graph, ExitStack() as stack:
        nodes = [
            stack.enter_context(NodeProcess(package, node, given))
            for package, node, given in (
                ('texture_features', 'feature_extractor', {'recipe': str(model_path.with_suffix('.json'))}),
                ('texture_estimation', 'classifier', {'model': str(model_path)}),
            )
        ]
        graph.peer.create_subscription(
            TOPICS['texture'].type,
            'texture',
            lambda message: received.append((time.perf_counter(), from_msg(message))),
            TOPICS['texture'].qos,
        )
        publishers = {
            topic: graph.peer.create_publisher(TOPICS[topic].type, topic, TOPICS[topic].qos) for topic in sent_s
        }

        # Wait until the extractor subscribes to the streams, and the classifier is discovered.
        needed = ('exploration', *feature_set.topics)
        graph.until(lambda: all(publishers[topic].get_subscription_count() for topic in needed))
        graph.until(lambda: graph.peer.count_publishers('texture'))
        settled_s = time.monotonic() + SETTLE_S
        graph.until(lambda: time.monotonic() > settled_s)

        # Stream from a separate thread until the final estimate.
        def publish() -> None:
            start_s = time.perf_counter()
            for due_ns, topic, message in messages:
                ahead_s = due_ns * 1e-9 - (time.perf_counter() - start_s)
                if ahead_s > 0:
                    time.sleep(ahead_s)
                sent_s[topic].append(time.perf_counter())
                publishers[topic].publish(message)

        before_s, began_s = [node.cpu_s() for node in nodes], time.monotonic()
        streamer = threading.Thread(target=publish, name='streamer')
        streamer.start()
        graph.until(lambda: received and received[-1][1].final)
        lasted_s = time.monotonic() - began_s
        streamer.join()
        cpu = {node.name: (node.cpu_s() - used_s) / lasted_s for node, used_s in zip(nodes, before_s, strict=True)}
    latency_ms = 1000 * np.array(
        [
            at_s - max(sent_s[topic][_last_batch(batches[topic], estimate, length_s)] for topic in feature_set.topics)
            for at_s, estimate in received
            if not estimate.final
        ]
    )
    median, p99 = np.percentile(latency_ms, (50, 99)).tolist()
    return {
        'estimates': len(latency_ms),
        'expected': math.floor((slide_s - length_s) / hop_s + 1e-6) + 1,
        'median_ms': median,
        'p99_ms': p99,
        'longest_ms': float(latency_ms.max()),
        'cpu_percent': {name: round(100 * load, 1) for name, load in [*cpu.items(), ('all', sum(cpu.values()))]},
    }


def driver_cpu() -> float:
    """Return the load of the sensor node, 1 for one core, reading an emulated TSF-85."""
    with tempfile.TemporaryDirectory() as folder:
        device = str(Path(folder) / 'tsf85')
        emulated = {'sensor_link': device, 'finger_pipe': str(Path(folder) / 'finger')}
        with (
            LocalGraph(DOMAIN, READY_WITHIN_S) as graph,
            NodeProcess('texture_simulation', 'emulator', emulated),
            NodeProcess('texture_drivers', 'sensor', {'device': device}) as sensor,
        ):
            received = graph.listen(TOPICS['signal'].type, 'signal', TOPICS['signal'].qos)
            graph.until(lambda: len(received) > 100)
            before_s, began_s = sensor.cpu_s(), time.monotonic()
            graph.until(lambda: time.monotonic() > began_s + DRIVER_S)
            return (sensor.cpu_s() - before_s) / (time.monotonic() - began_s)


def _last_batch(batches: Sequence[TactileSignal], estimate: TextureEstimate, length_s: float) -> int:
    """Return which batch holds the last sample of the newest window of an estimate; the stream begins at time 0."""
    rate_hz = batches[0].sampling_rate_hz
    start_s = estimate.stamp_ns / NANOSECONDS - length_s
    last = math.ceil(start_s * rate_hz - INDEX_TOLERANCE) + max(1, round(length_s * rate_hz)) - 1
    return next(number for number, batch in enumerate(batches) if batch.next_sample > last)
