"""The emulator of the demonstration: its processes, and what the operator does with it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from texture_bringup.demo.isolation import isolate
from texture_bringup.ros.operator import ExplorationResult, Operator
from texture_core.errors import MotionAborted
from texture_core.exploration import ExplorationRequest
from texture_launch.child import ChildLauncher

RECORDED = ('signal', 'exploration')  # each is listened to by the feature extractor, too
START_DEADLINE_S = 60.0  # a slow machine that imports everything for the first time


class DemoRig:
    """Run the bench in a ROS domain of its own; use it in a `with` block.

    Parameters
    ----------
    folder
        For the device and the logs of ROS; it must outlive the block.
    log
        File for what the nodes say.
    recipe, seed
        Of the features, and of the bench's randomness.
    """

    def __init__(self, folder: Path, log: Path, recipe: str, seed: int) -> None:
        self._isolation = isolate(folder)
        self._environment = self._isolation.environment({**os.environ, 'ROS_LOG_DIR': str(folder / 'ros_log')})
        arguments = {
            'device': self._isolation.device,
            'finger_port': self._isolation.finger_port,
            'recipe': recipe,
            'seed': seed,
        }
        self._folder = folder
        self._launcher = ChildLauncher('emulator', arguments, self._environment, log)
        self._operator = Operator(domain_id=self._isolation.domain_id, guard=self._launcher.check)
        self._open = ExitStack()

    def __enter__(self) -> DemoRig:
        with ExitStack() as opening:
            opening.enter_context(self._launcher)
            opening.enter_context(self._operator)
            self._operator.wait_for_explorer(START_DEADLINE_S)
            self._operator.wait_for_signal(START_DEADLINE_S)
            self._open = opening.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    @contextmanager
    def recording(self, bag: Path) -> Iterator[None]:
        """Record the topics into a new bag for the length of a `with` block."""
        recorder = ChildLauncher('record', {'out': bag}, self._environment, self._folder / f'{bag.name}.log')
        # The explorer may listen to the signal, too: each topic has a number of its own.
        wanted = {topic: self._operator.listeners(topic) + 1 for topic in RECORDED}
        with recorder:
            for topic, number in wanted.items():
                self._operator.wait_for_listeners((topic,), number, recorder.check)
            yield
            recorder.check()

    def explore(self, surface: str, requests: Iterator[ExplorationRequest]) -> Iterator[ExplorationResult]:
        """Lay a surface under the finger and explore it.

        Raises
        ------
        MotionAborted
            If an exploration does not end as asked.
        """
        self._operator.set_parameters('emulator', {'surface': surface})
        for request in requests:
            explored = self._operator.explore(request)
            if not explored.success:
                raise MotionAborted(f'the exploration of {surface} failed: {explored.message}')
            yield explored

    def use_model(self, model: Path) -> None:
        """Let the running classifier load a model."""
        self._operator.set_parameters('classifier', {'model': str(model)})
