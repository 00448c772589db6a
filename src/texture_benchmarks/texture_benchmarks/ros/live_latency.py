"""Measure the running feature extractor and classifier: latency through DDS, and computing time."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.ros.graph import Graph
from texture_benchmarks.ros.stream import Streamer, Timed
from texture_core.arrays import Array
from texture_core.estimates import TextureEstimate
from texture_core.exploration import ExplorationState
from texture_core.node_process import NodeProcess
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_estimation.model import load_model
from texture_features.windowing.sample_buffer import INDEX_TOLERANCE
from texture_simulation.offline import simulate_exploration
from texture_simulation.scene import load_scene

SETTLE_S = 3.0  # discovery of all subscriptions
READY_WITHIN_S = 60.0
DRIVER_S = 10.0
BATCH_S = 0.01  # as the sensor node delivers
SPEED_M_S, FORCE_N = 0.1, 2.0
SURFACE = 'leather'
DOMAIN = 83  # of its own: what else runs on the machine must not listen


@dataclass(frozen=True, eq=False)
class LiveLatency:
    """What was measured over one long slide.

    Parameters
    ----------
    latency_s : (n_estimates,)
        From publishing the batch with the last sample of a window to receiving its estimate.
    expected
        Estimates that should have come.
    cpu
        Share of one core that each node used, 0 to 1.
    """

    latency_s: Array
    expected: int
    cpu: Mapping[str, float]

    def numbers(self) -> dict[str, Any]:
        """Return the figures."""
        median, p99 = 1000 * np.percentile(self.latency_s, (50, 99))
        return {
            'estimates': len(self.latency_s),
            'expected': self.expected,
            'median_ms': float(median),
            'p99_ms': float(p99),
            'longest_ms': float(1000 * self.latency_s.max()),
            'cpu_percent': {name: round(100 * share, 1) for name, share in self.cpu.items()},
        }


def measure(model_path: Path, seed: int, slide_s: float) -> LiveLatency:
    """Stream one long simulated slide through feature extractor and classifier, and time the estimates.

    Parameters
    ----------
    model_path
        Path of the model.
    seed
        Seed of the simulated slide.
    slide_s
        Length of the slide.

    Returns
    -------
    LiveLatency
        Times from the last sample of a window to its estimate.
    """
    model = load_model(model_path)
    states, signals = simulate_exploration(
        load_scene('twelve_textures'), SURFACE, SPEED_M_S, FORCE_N, slide_s,
        start_ns=0, exploration_id='long', rng=np.random.default_rng(seed),
    )  # fmt: skip
    batches = {topic: rebatch(signals[topic]) for topic in signals}
    received: list[tuple[float, TextureEstimate]] = []
    nodes = (
        NodeProcess(
            'texture_features', 'feature_extractor', {'recipe': str(model_path.with_suffix('.json'))}, domain_id=DOMAIN
        ),
        NodeProcess('texture_estimation', 'classifier', {'model': str(model_path)}, domain_id=DOMAIN),
    )
    with Graph(DOMAIN) as graph, nodes[0], nodes[1]:
        graph.listen('texture', lambda estimate: received.append((time.perf_counter(), estimate)))
        streamer = Streamer(graph, _plan(states, batches))
        topics = ('exploration', *model.recipe.feature_set.topics)
        graph.wait_until(
            lambda: (
                all(streamer.publishers[topic].get_subscription_count() for topic in topics)
                and graph.node.count_publishers('texture') > 0
            ),
            READY_WITHIN_S,
            'the two nodes',
        )
        graph.spin(SETTLE_S)
        before, began = [node.cpu_s() for node in nodes], time.monotonic()
        streamer.start()
        graph.wait_until(
            lambda: bool(received) and received[-1][1].final, slide_s + READY_WITHIN_S, 'the final estimate'
        )
        lasted_s = time.monotonic() - began
        cpu = {n.name: (n.cpu_s() - used) / lasted_s for n, used in zip(nodes, before, strict=True)}
        streamer.join()
    windows = model.recipe.feature_set.windows
    expected = math.floor((slide_s - windows.length_s) / windows.hop_s + 1e-6) + 1
    sent = {topic: _sent_at(streamer, topic) for topic in model.recipe.feature_set.topics}
    found = [
        at_s - max(sent[topic][_last_batch(batches[topic], estimate, windows.length_s)] for topic in sent)
        for at_s, estimate in received
        if not estimate.final
    ]
    return LiveLatency(np.array(found), expected, cpu)


def driver_cpu() -> float:
    """Return the share of one core that the sensor node uses, reading an emulated TSF-85."""
    with tempfile.TemporaryDirectory() as folder:
        device = str(Path(folder) / 'tsf85')
        received: list[TactileSignal] = []
        with (
            Graph(DOMAIN) as graph,
            NodeProcess('texture_simulation', 'emulator', {'sensor_link': device, 'finger_port': 0}, domain_id=DOMAIN),
            NodeProcess('texture_drivers', 'sensor', {'device': device}, domain_id=DOMAIN) as sensor,
        ):
            graph.listen('signal', received.append)
            graph.wait_until(lambda: len(received) > 100, READY_WITHIN_S, 'the signal of the sensor node')
            before, began = sensor.cpu_s(), time.monotonic()
            graph.spin(DRIVER_S)
            return (sensor.cpu_s() - before) / (time.monotonic() - began)


def rebatch(signals: Sequence[TactileSignal]) -> list[TactileSignal]:
    """Cut one unbroken stream into batches of BATCH_S, or of one sample if that is longer."""
    samples = np.concatenate([signal.samples for signal in signals])
    first = signals[0]
    rate_hz = first.sampling_rate_hz
    size = max(1, round(BATCH_S * rate_hz))
    return [
        replace(
            first,
            stamp_ns=first.stamp_ns + round(start / rate_hz * NANOSECONDS),
            first_sample=first.first_sample + start,
            samples=samples[start : start + size],
        )
        for start in range(0, len(samples), size)
    ]


def _plan(states: Sequence[ExplorationState], batches: Mapping[str, Sequence[TactileSignal]]) -> list[Timed]:
    """Return what is published when: a state at its stamp, a batch at its end."""
    plan: list[Timed] = [(state.stamp_ns, 'exploration', state) for state in states]
    for topic, signals in batches.items():
        plan += [(signal.end_ns, topic, signal) for signal in signals]
    return sorted(plan, key=lambda timed: timed[0])


def _sent_at(streamer: Streamer, topic: str) -> list[float]:
    return [at_s for at_s, name in zip(streamer.sent_at_s, streamer.topics, strict=True) if name == topic]


def _last_batch(batches: Sequence[TactileSignal], estimate: TextureEstimate, length_s: float) -> int:
    """Return which batch holds the last sample of the newest window of an estimate; the stream begins at time 0."""
    rate_hz = batches[0].sampling_rate_hz
    start_s = estimate.stamp_ns / NANOSECONDS - length_s
    last = math.ceil(start_s * rate_hz - INDEX_TOLERANCE) + max(1, round(length_s * rate_hz)) - 1
    return next(number for number, batch in enumerate(batches) if batch.next_sample > last)
