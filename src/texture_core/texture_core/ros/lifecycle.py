"""A lifecycle node that outlives a request which its state does not allow."""

from __future__ import annotations

from rclpy._rclpy_pybind11 import RCLError
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn


class PatientLifecycleNode(LifecycleNode):
    """Refuse an unknown or untimely transition; rclpy raises it as an error, which would end the process.

    rclpy offers no place to refuse it but its own private method: the service handler asks that one.
    """

    def _LifecycleNodeMixin__change_state(self, transition_id: int) -> TransitionCallbackReturn:  # noqa: N802
        try:
            return super()._LifecycleNodeMixin__change_state(transition_id)  # type: ignore[misc]
        except RCLError as error:
            self.get_logger().warning(f'the transition {transition_id} was refused: {error}')
            return TransitionCallbackReturn.FAILURE
