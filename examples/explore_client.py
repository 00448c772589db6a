# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A client that needs only the messages: it explores, and maps every result to a next step by its constants.

Next to `texture launch emulator`: .venv/bin/ros-run python examples/explore_client.py
"""

from enum import Enum
from typing import Any

import rclpy
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger
from texture_msgs.action import Explore
from texture_msgs.msg import ExplorationRequest
from texture_msgs.msg import ExplorationResult as Result
from texture_msgs.msg import TextureEstimate as Estimate

Next = Enum(
    'Next',
    'USE_LABEL CORRECT_REQUEST ASK_LATER EXPLORE_AGAIN CALL_A_PERSON '
    'TRAIN_IT SLIDE_ELSEWHERE SLIDE_AS_TRAINED SLIDE_LONGER LOAD_A_MODEL TRAIN_MORE',
)
REFUSED = {
    **dict.fromkeys((Result.ERROR_UNKNOWN_MOTION, Result.ERROR_INVALID_REQUEST), Next.CORRECT_REQUEST),
    **dict.fromkeys((Result.ERROR_UNUSED_FIELD, Result.ERROR_OUTSIDE_WORKSPACE), Next.CORRECT_REQUEST),
    **dict.fromkeys((Result.ERROR_BUSY, Result.ERROR_NOT_ACTIVE, Result.ERROR_ARM_NOT_READY), Next.ASK_LATER),
    Result.ERROR_INTERNAL: Next.CALL_A_PERSON,
}
REJECTED = {
    Estimate.REJECTION_NONE: Next.USE_LABEL,
    Estimate.REJECTION_NOVEL: Next.TRAIN_IT,
    Estimate.REJECTION_AMBIGUOUS: Next.SLIDE_ELSEWHERE,
    Estimate.REJECTION_OUTSIDE_TRAINING: Next.SLIDE_AS_TRAINED,
    Estimate.REJECTION_TOO_LITTLE_EVIDENCE: Next.SLIDE_LONGER,
    Estimate.REJECTION_NO_MODEL: Next.LOAD_A_MODEL,
    Estimate.REJECTION_TOO_LITTLE_TRAINING: Next.TRAIN_MORE,
}


class TextureClient(Node):
    """Explore as Nav2's BasicNavigator drives: start, check for completion, cancel, read the result."""

    def __init__(self) -> None:
        super().__init__('texture_client')
        self._spinner = SingleThreadedExecutor()
        self._spinner.add_node(self)
        self._explore = ActionClient(self, Explore, 'explore')
        self._stop = self.create_client(Trigger, 'explorer/stop')
        self.feedback: Any = None

    def _on_feedback(self, message: Any) -> None:
        self.feedback = message.feedback

    def start(self, **request: Any) -> None:
        """Request an exploration; omitted values take the default of the motion."""
        self.feedback = None
        self._explore.wait_for_server()
        goal = Explore.Goal(request=ExplorationRequest(**request))
        sent = self._explore.send_goal_async(goal, self._on_feedback)
        self._spinner.spin_until_future_complete(sent)
        self._goal = sent.result()
        self._ending = self._goal.get_result_async()

    def is_complete(self) -> bool:
        """Let messages arrive, and return whether the result has."""
        self._spinner.spin_once(timeout_sec=0.05)
        return self._ending.done()

    def cancel(self) -> None:
        """Abort this exploration; the finger is lifted."""
        self._goal.cancel_goal_async()

    def stop(self) -> None:
        """Abort any exploration, whoever requested it; the finger is lifted."""
        self._stop.wait_for_service()
        self._stop.call_async(Trigger.Request())

    def result(self) -> Result:
        """Return the result of the exploration."""
        return self._ending.result().result.result


def probabilities(result: Result) -> dict[str, float]:
    """Return the probability of each texture by its name; empty without a model or evidence."""
    return dict(zip(result.labels, result.texture.probabilities, strict=True))


def next_step(result: Result) -> Next:
    """Return what to do after a result: the error code first, then the rejection of the label."""
    if result.error_code in REFUSED:
        return REFUSED[result.error_code]
    if result.error_code != Result.ERROR_NONE:
        return Next.EXPLORE_AGAIN if result.lifted else Next.CALL_A_PERSON
    return REJECTED[result.texture.rejection]


def main() -> None:
    """Slide once, and print the next step and the probabilities."""
    rclpy.init()
    client = TextureClient()
    client.start(motion='linear_slide', early_stopping=True)
    while not client.is_complete():
        pass
    result = client.result()
    print(next_step(result).name, result.texture.label, probabilities(result))


if __name__ == '__main__':
    main()
