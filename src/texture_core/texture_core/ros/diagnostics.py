"""A node's health on /diagnostics: one status, its level and its numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.duration import Duration

LEVELS = {'OK': DiagnosticStatus.OK, 'WARN': DiagnosticStatus.WARN, 'ERROR': DiagnosticStatus.ERROR}
ENDED = 'ended'  # the value that the last report of a node carries
ACKNOWLEDGED_S = 1.0  # the longest that a node waits at its end for the readers of that report
DiagnosticReport = tuple[str, str, Mapping[str, Any]]


class Diagnostics:
    """Publish a status once a second, and whenever asked.

    Parameters
    ----------
    node
        The node that reports.
    report
        Returns (level, message, numbers): 'OK', 'WARN' or 'ERROR', one sentence, and what to show beside it.
    hardware_id
        Serial number or device path; '' for a node that owns no device.
    """

    def __init__(
        self, node: Any, report: Callable[[], DiagnosticReport], hardware_id: str = '', period_s: float = 1.0
    ) -> None:
        self._node = node
        self._report = report
        self.hardware_id = hardware_id
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._timer = node.create_timer(period_s, self.publish)

    def publish(self) -> None:
        """Publish the status now."""
        self._publish(*self._report())

    def end(self) -> None:
        """Publish the status for the last time, and say so: a node that ends as asked is not one that fell silent."""
        level, message, numbers = self._report()
        self._publish(level, message, {**numbers, ENDED: True})
        self._publisher.wait_for_all_acked(Duration(seconds=ACKNOWLEDGED_S))

    def _publish(self, level: str, message: str, numbers: Mapping[str, Any]) -> None:
        status = DiagnosticStatus(
            level=LEVELS[level],
            name=self._node.get_fully_qualified_name(),
            message=message,
            hardware_id=self.hardware_id,
            values=[KeyValue(key=str(key), value=_text(value)) for key, value in numbers.items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)


def has_ended(status: DiagnosticStatus) -> bool:
    """Return whether a status is the last one of a node that ended as asked."""
    return any(value.key == ENDED for value in status.values)


def _text(value: Any) -> str:
    return f'{value:.6g}' if isinstance(value, float) else str(value)
