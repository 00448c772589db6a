"""Run sensor nodes on emulated devices for a while, and see what they cost and lose."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from texture_msgs import msg

from texture_benchmarks.load.rig import Rig
from texture_benchmarks.ros.graph import Graph
from texture_core.node_process import NodeProcess
from texture_core.ros.qos import SENSOR_QOS

SETTLE_S = 3.0
REPORT_S = 1.5  # until the next report on /diagnostics has come for sure
READY_WITHIN_S = 60.0
DOMAIN = 82  # of its own: what else runs on the machine must not listen


@dataclass(frozen=True)
class SensorLoad:
    """What one sensor node did over a while.

    Parameters
    ----------
    seconds
        How long.
    rate_hz
        Samples that it published a second by its own counts, all fingers and streams together.
    lost
        Samples that the driver missed.
    unsent_bytes
        What the emulated device could not get rid of, for the line was full: then the machine was too slow.
    messages
        Of the fast topic, as a subscriber received them.
    cpu
        Share of one core that the node used, 0 to 1.
    """

    seconds: float
    rate_hz: float
    lost: int
    unsent_bytes: int
    messages: int
    cpu: float


def measure(rigs: Mapping[str, Rig], sensors: Mapping[str, str], seconds: float) -> Mapping[str, SensorLoad]:
    """Return the load of one node on each rig, all at the same time.

    Parameters
    ----------
    rigs
        By a name that becomes the node's namespace.
    sensors
        Which sensor each of them is.
    seconds
        How long to measure.

    Returns
    -------
    mapping
        Load of each node, by its namespace.
    """
    received = {name: _SensorReports() for name in rigs}
    with Graph(DOMAIN) as graph, ExitStack() as stack:
        graph.listen('diagnostics', lambda array: [received[s.name.split('/')[1]].note(s.values) for s in array.status])
        nodes = {}
        for name, rig in rigs.items():
            topic = f'/{name}/{rig.case.topic}'
            graph.node.create_subscription(msg.TactileSignal, topic, received[name].count, SENSOR_QOS, raw=True)
            given = {'sensor': sensors[name], 'device': str(rig.link), 'config': rig.case.config}
            node = NodeProcess('texture_drivers', 'sensor', given, namespace=f'/{name}', domain_id=DOMAIN)
            nodes[name] = stack.enter_context(node)
        graph.wait_until(lambda: all(item.streams for item in received.values()), READY_WITHIN_S, 'the sensors')
        graph.spin(SETTLE_S)
        for item in received.values():
            item.restart()
        cpu_s, unsent = _used(nodes), {name: rig.device.dropped_bytes for name, rig in rigs.items()}
        began_s = time.monotonic()
        graph.spin(seconds + REPORT_S)
        lasted_s = time.monotonic() - began_s
        used_s = _used(nodes)
        return {
            name: received[name].load((used_s[name] - cpu_s[name]) / lasted_s, rig.device.dropped_bytes - unsent[name])
            for name, rig in rigs.items()
        }


def _used(nodes: Mapping[str, NodeProcess]) -> dict[str, float]:
    return {name: node.cpu_s() for name, node in nodes.items()}


class _SensorReports:
    """What has come from one sensor node."""

    def __init__(self) -> None:
        self.streams = False
        self.restart()

    def restart(self) -> None:
        self._messages = 0
        self._reports: list[tuple[float, Mapping[str, str]]] = []

    def note(self, values: Sequence[Any]) -> None:
        """Take a report on /diagnostics."""
        report = {value.key: value.value for value in values}
        self.streams = self.streams or int(report.get('samples', 0)) > 0
        self._reports.append((time.monotonic(), report))

    def count(self, _message: bytes) -> None:
        self._messages += 1

    def load(self, cpu: float, unsent_bytes: int) -> SensorLoad:
        """Return what happened from the first report to the last."""
        (first_s, first), (last_s, last) = self._reports[0], self._reports[-1]
        new = {name: int(last[name]) - int(first[name]) for name in ('samples', 'lost')}
        seconds = last_s - first_s
        return SensorLoad(seconds, new['samples'] / seconds, new['lost'], unsent_bytes, self._messages, cpu)
