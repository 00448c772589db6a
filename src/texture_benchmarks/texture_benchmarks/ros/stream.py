"""Stream a tactile signal into the graph in real time, and note when each sample went out."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from typing import Any

from texture_benchmarks.ros.graph import Graph
from texture_core.ros.conversions import to_msg

Timed = tuple[int, str, Any]  # when it is due, ns since the start; topic; data class


class Streamer:
    """Publish from a thread of its own.

    Parameters
    ----------
    graph
        Where to publish.
    plan
        What is published when, in order of time.
    """

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
