# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A client that needs only the messages: it explores, and maps every result to a next step by its constants.

Next to `texture launch emulator`: .venv/bin/ros-run python examples/explore_client.py
"""

from enum import Enum

import rclpy
from rclpy.action import ActionClient
from rclpy.node import Node
from std_srvs.srv import Trigger
from texture_msgs.action import Explore
from texture_msgs.msg import ExplorationRequest, ExplorationResult, TextureEstimate

Next = Enum('Next', 'USE_LABEL FIX_REQUEST WAIT RETRY ASK_HELP TRAIN ELSEWHERE AS_TRAINED LONGER LOAD_MODEL TRAIN_MORE')
R, E = ExplorationResult, TextureEstimate
# Refused: the request must be corrected, or may be repeated later.
INVALID = {R.ERROR_UNKNOWN_MOTION, R.ERROR_INVALID_REQUEST, R.ERROR_UNUSED_FIELD, R.ERROR_OUTSIDE_WORKSPACE}
NOT_NOW = {R.ERROR_BUSY, R.ERROR_NOT_ACTIVE, R.ERROR_ARM_NOT_READY}
# Completed: the label may be used, or the same texture needs another slide or training.
COMPLETED = {
    E.REJECTION_NONE: Next.USE_LABEL,
    E.REJECTION_NOVEL: Next.TRAIN,
    E.REJECTION_AMBIGUOUS: Next.ELSEWHERE,
    E.REJECTION_OUTSIDE_TRAINING: Next.AS_TRAINED,
    E.REJECTION_TOO_LITTLE_EVIDENCE: Next.LONGER,
    E.REJECTION_NO_MODEL: Next.LOAD_MODEL,
    E.REJECTION_TOO_LITTLE_TRAINING: Next.TRAIN_MORE,
}


class TextureClient(Node):
    """Explore as Nav2's BasicNavigator drives: start, check for completion, cancel, read the result."""

    def __init__(self) -> None:
        super().__init__('texture_client')
        self._explore = ActionClient(self, Explore, 'explore')
        self._stop = self.create_client(Trigger, 'explorer/stop')

    def start(self, **request: object) -> None:
        """Request an exploration; omitted values take the default of the motion."""
        self._explore.wait_for_server()
        sent = self._explore.send_goal_async(Explore.Goal(request=ExplorationRequest(**request)))
        rclpy.spin_until_future_complete(self, sent)
        self._goal = sent.result()
        self._ending = self._goal.get_result_async()

    def is_complete(self) -> bool:
        """Let messages arrive, and return whether the result has."""
        rclpy.spin_once(self, timeout_sec=0.05)
        return self._ending.done()

    def cancel(self) -> None:
        """Abort this exploration; the finger is lifted."""
        self._goal.cancel_goal_async()

    def stop(self) -> rclpy.task.Future:
        """Abort any exploration and lift the finger; what is requested before the answer is cancelled, too."""
        self._stop.wait_for_service()
        return self._stop.call_async(Trigger.Request())

    def result(self) -> ExplorationResult:
        """Return the result of the exploration."""
        return self._ending.result().result.result


def probabilities(result: ExplorationResult) -> dict[str, float]:
    """Return the probability of each texture by its name; empty without a model or evidence."""
    return dict(zip(result.labels, result.texture.probabilities, strict=True))


def next_step(result: ExplorationResult) -> Next:
    """Return what to do after a result: the error code first, then the rejection of the label."""
    code = result.error_code
    if code == R.ERROR_NONE:
        return COMPLETED[result.texture.rejection]
    if code in INVALID:
        return Next.FIX_REQUEST
    if code in NOT_NOW:
        return Next.WAIT
    return Next.RETRY if result.lifted and code != R.ERROR_INTERNAL else Next.ASK_HELP


if __name__ == '__main__':
    rclpy.init()
    client = TextureClient()
    client.start(motion='linear_slide', early_stopping=True)
    while not client.is_complete():
        pass
    result = client.result()
    print(next_step(result).name, result.texture.label, probabilities(result))
