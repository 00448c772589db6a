"""An executor for nodes some of whose callbacks wait long, as a service that answers only when the motion is over."""

from __future__ import annotations

import contextlib
import threading
import time
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import (
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
)

ANSWER_POLL_S = 0.02


class WaitingExecutor(SingleThreadedExecutor):
    """Run callbacks one after the other, but those of a ReentrantCallbackGroup each in a thread of its own.

    Goals of action servers run in threads of their own, too. rclpy's MultiThreadedExecutor would do, but in Jazzy it
    does not sleep while a callback waits for a thread (ros2/rclpy #1547): with 100 messages of a sensor a second it
    takes 80 % of a core and starves the other threads of the process, such as the one that moves the arm.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._aside: list[Any] = []  # tasks in threads of their own

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Send the answers of what has waited, for `timeout_sec` at most, and run no callback any more.

        The result of an action is sent by a callback that follows the one of the goal; rclpy's executor drops it.
        """
        deadline_s = time.monotonic() + (timeout_sec or 0.0)
        while self._unanswered() and time.monotonic() < deadline_s:
            self.spin_once(timeout_sec=ANSWER_POLL_S)
        return super().shutdown(timeout_sec)

    def _unanswered(self) -> bool:
        with self._tasks_lock:
            return self._context.ok() and any(not task.done() for task, _entity, _node in self._tasks)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Let one callback begin; raise what a callback has raised."""
        with contextlib.suppress(TimeoutException, ShutdownException, ExternalShutdownException):
            task, entity, _node = self.wait_for_ready_callbacks(timeout_sec)
            if entity is not None and not isinstance(entity.callback_group, ReentrantCallbackGroup):
                task()
                task.result()
            elif task not in self._aside:
                self._aside.append(task)
                threading.Thread(target=task, name='waiting callback').start()
        for task in [task for task in self._aside if task.done()]:
            self._aside.remove(task)
            task.result()
