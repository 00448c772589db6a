"""A node's health on /diagnostics: one status, its level and its numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

LEVELS = {'OK': DiagnosticStatus.OK, 'WARN': DiagnosticStatus.WARN, 'ERROR': DiagnosticStatus.ERROR}
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
        level, message, numbers = self._report()
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


def _text(value: Any) -> str:
    return f'{value:.6g}' if isinstance(value, float) else str(value)
