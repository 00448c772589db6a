"""Record diagnostics, logs, samples and estimates of the running nodes."""

from __future__ import annotations

import re
import time
from collections import Counter, defaultdict

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from texture_msgs import msg

from texture_benchmarks.endurance.accounting import COUNTERS, AnswerAccount, SampleAccount, Totals
from texture_benchmarks.endurance.ros.listener import Listener
from texture_core.ros.qos import ESTIMATE_QOS, FEATURE_QOS
from texture_core.ros.time import to_ns

COUNTED = re.compile(r'\d+')
LEVELS = {Log.WARN: 'WARN', Log.ERROR: 'ERROR', Log.FATAL: 'FATAL'}
# Deep: what this listener loses must not look as if the driver had lost it.
SIGNAL_QOS = QoSProfile(depth=2000, reliability=ReliabilityPolicy.BEST_EFFORT)
LOG_QOS = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Watcher(Listener):
    """Keep books about the nodes of one domain, in a thread of its own; use it in a `with` block.

    Attributes
    ----------
    signal, answers
        Books about samples, and about feature vectors and estimates.
    totals
        Counters of /diagnostics, by node.
    said
        Warnings and errors of the nodes, with how often; numbers in them are left out.
    received_s
        When a node reported last on /diagnostics, and the stream 'signal' (monotonic clock).
    """

    def __init__(self, domain_id: int) -> None:
        self.signal, self.answers = SampleAccount(), AnswerAccount()
        self.totals: defaultdict[str, Totals] = defaultdict(Totals)
        self.said: Counter[tuple[str, str, str]] = Counter()
        self.received_s: dict[str, float] = {}
        super().__init__('watcher', domain_id)
        node = self.node
        node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)
        node.create_subscription(Log, '/rosout', self._on_log, LOG_QOS)
        node.create_subscription(msg.TactileSignal, 'signal', self._on_signal, SIGNAL_QOS)
        node.create_subscription(msg.FeatureVector, 'features', self._on_vector, FEATURE_QOS)
        node.create_subscription(msg.TextureEstimate, 'texture', self._on_estimate, ESTIMATE_QOS)

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        for status in array.status:
            node = status.name.rpartition('/')[2]
            counters = COUNTERS.get(node, ())
            self.totals[node].update({item.key: int(item.value) for item in status.values if item.key in counters})
            self.received_s[node] = time.monotonic()

    def _on_log(self, log: Log) -> None:
        if log.level in LEVELS:
            self.said[log.name, LEVELS[log.level], COUNTED.sub('…', log.msg)] += 1

    def _on_signal(self, batch: msg.TactileSignal) -> None:
        count = len(batch.samples) // max(1, len(batch.channels))
        self.signal.update(batch.first_sample, count, to_ns(batch.header.stamp), batch.sampling_rate_hz)
        self.received_s['signal'] = time.monotonic()

    def _on_vector(self, vector: msg.FeatureVector) -> None:
        self.answers.vectors[vector.exploration_id] += 1

    def _on_estimate(self, estimate: msg.TextureEstimate) -> None:
        self.answers.estimates[estimate.exploration_id] += 1
