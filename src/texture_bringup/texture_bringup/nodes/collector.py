# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Collect labelled slides of a surface at many places of the taught patch into a bag, as a service or as an action."""

from __future__ import annotations

import logging
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from texture_msgs import action, msg, srv

from texture_bringup.operator import Operator
from texture_core.errors import (
    CollectionError,
    ExplorationError,
    InvalidData,
    LaunchFailed,
    MotionAborted,
    MotionRefused,
    TextureError,
)
from texture_core.ros import WaitingExecutor, run
from texture_core.types import ExplorationRequest
from texture_evaluation.collection import (
    CollectionEnd,
    CollectionParams,
    Patch,
    PlaceAccuracy,
    PlacePlan,
    collect,
    evaluate_places,
    next_bag,
)
from texture_features.feature_set import FeatureSet
from texture_recordings.dataset import SlideDataset

RECIPE = 'default'  # whose features distinguish the places
RECORDER_S = 30.0  # to start, and to complete the bag
FLUSHED_S = 20.0  # within which what was recorded can be read: a recorder may be behind
RECORDED = ('signal', 'exploration')
PATCH = ('patch_x_low_m', 'patch_x_high_m', 'patch_y_low_m', 'patch_y_high_m')
LEAST_SPEED_M_S = 0.002  # of every explorer
LIMITS = ('min_force_n', 'max_force_n', 'max_speed_m_s')
Tell = Callable[[str, int], None]
BAGS_LOG = logging.getLogger('texture_recordings.bags')


def collect_surface(
    operator: Operator, surface: str, folder: Path, params: CollectionParams, tell: Tell, *, namespace: str = ''
) -> tuple[CollectionEnd, Path | None]:
    """Collect a surface; return how it ended, and the bag, which is complete however that was, Ctrl-C included.

    A bag without any slide is removed; then None is returned instead.
    """
    low_x, high_x, low_y, high_y, low_n, high_n, high_m_s = operator.parameters('explorer', (*PATCH, *LIMITS))
    if not (low_x < high_x and low_y < high_y):
        raise InvalidData(
            'no surface patch is taught: touch the corners of the surface with `texture touch-surface`, or give the '
            f'explorer {", ".join(PATCH)}'
        )
    patch = Patch(low_x, high_x, low_y, high_y)
    plan = PlacePlan(surface, params, patch, (low_n, high_n), (LEAST_SPEED_M_S, high_m_s))
    folder.mkdir(parents=True, exist_ok=True)
    bag = folder / next_bag([one.name for one in folder.iterdir()], surface)
    with recorder(operator, bag, namespace) as check:

        def explore(request: ExplorationRequest) -> tuple[ExplorationError, str]:
            check()
            try:
                explored = operator.explore(request)
            except (MotionRefused, MotionAborted) as error:
                return error.error, str(error)
            return explored.error, explored.message

        end = collect(plan, params, explore, partial(_evaluate_bag, bag, surface), tell)
    # Where the recorder has ended, the bag there may be another one.
    if end.slides or end.error is CollectionError.NOT_RECORDED:
        return end, bag
    shutil.rmtree(bag, ignore_errors=True)
    with suppress(OSError):  # other surfaces are in it
        folder.rmdir()
    return replace(end, message=f'{end.message}; no slide was made, so no bag is kept'), None


def _evaluate_bag(bag: Path, surface: str, slides: int) -> PlaceAccuracy:
    """Evaluate all bags of the folder, once the newest one has `slides` slides on the disk."""
    feature_set = FeatureSet.load(RECIPE)
    deadline_s = time.monotonic() + FLUSHED_S
    while True:
        time.sleep(1.0)
        BAGS_LOG.disabled = True  # the bag that is still recorded has no end yet
        try:
            dataset = SlideDataset.from_bags([bag.parent], topics=feature_set.topics)
        finally:
            BAGS_LOG.disabled = False
        written = sum(one.bag == bag for one in dataset)
        if written >= slides or time.monotonic() > deadline_s:
            return evaluate_places(dataset.features(feature_set), surface)


@contextmanager
def recorder(
    operator: Operator, bag: Path, namespace: str, environment: Mapping[str, str] | None = None
) -> Iterator[Callable[[], None]]:
    """Record a bag in a separate process; the function raises InvalidData, with its last message, if that ended."""
    operator.wait_for_listeners(RECORDED, 1, lambda: None)  # the feature extractor; by then all others are found
    wanted = {topic: operator.listeners(topic) + 1 for topic in RECORDED}
    command = [sys.executable, '-m', 'texture_bringup.command', 'record', str(bag), '--namespace', namespace]
    with tempfile.TemporaryFile('w+') as output:
        process = subprocess.Popen(command, stdout=output, stderr=output, start_new_session=True, env=environment)

        def last_message() -> str:
            output.seek(0)
            return output.read().strip().rpartition('\n')[2]

        def check() -> None:
            if process.poll() is not None:
                raise InvalidData(f'the recorder ended: {last_message()}')

        try:
            for topic, number in wanted.items():
                operator.wait_for_listeners((topic,), number, check)
            yield check
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            try:
                process.wait(RECORDER_S)
            except subprocess.TimeoutExpired:
                process.kill()


class Collector(Node):
    """Offer `collect` as a service and as an action; one collection at a time."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('collector', **kwargs)
        self._busy = threading.Lock()
        self._closing = False
        group = ReentrantCallbackGroup()
        self.create_service(srv.Collect, 'collect', self._on_service, callback_group=group)
        ActionServer(
            self,
            action.Collect,
            'collect',
            self._on_goal,
            callback_group=group,
            cancel_callback=lambda _goal: CancelResponse.ACCEPT,
        )

    def shutdown(self) -> None:
        """End the collection that runs; its finger is lifted and its bag completed."""
        self._closing = True
        with self._busy:
            pass

    def _on_service(self, request: srv.Collect.Request, response: srv.Collect.Response) -> srv.Collect.Response:
        response.result = self._collect(request.request, lambda _sentence, _slides: None, lambda: False)
        return response

    def _on_goal(self, goal: Any) -> action.Collect.Result:
        def tell(sentence: str, slides: int) -> None:
            goal.publish_feedback(action.Collect.Feedback(message=sentence, slides=slides))

        result = self._collect(goal.request.request, tell, lambda: bool(goal.is_cancel_requested))
        if goal.is_cancel_requested:
            goal.canceled()
        elif result.error_code == CollectionError.NONE:
            goal.succeed()
        else:
            goal.abort()
        return action.Collect.Result(result=result)

    def _collect(self, request: msg.CollectionRequest, tell: Tell, cancelled: Callable[[], bool]) -> Any:
        if not self._busy.acquire(blocking=False):
            busy = 'another collection is running; wait for its end, or cancel it'
            return msg.CollectionResult(error_code=CollectionError.BUSY, message=busy)

        def guard() -> None:
            if cancelled() or self._closing:
                raise KeyboardInterrupt('cancelled')

        result = msg.CollectionResult()
        namespace = self.get_namespace().strip('/')
        try:
            with Operator(namespace, guard=guard) as operator:
                operator.wait_for_explorer(10.0)
                params = params_from(request)
                end, bag = collect_surface(
                    operator, request.surface, Path(request.folder), params, tell, namespace=namespace
                )
        except LaunchFailed as error:
            result.error_code, result.message = CollectionError.NOT_ACTIVE, str(error)
        except (TextureError, OSError) as error:
            result.error_code, result.message = CollectionError.INVALID_REQUEST, str(error)
        except KeyboardInterrupt as error:
            result.error_code, result.message = CollectionError.CANCELLED, str(error)
        else:
            result.error_code, result.message, result.bag = end.error, end.message, str(bag or '')
            result.slides, result.places, result.right = end.slides, end.accuracy.places, end.accuracy.correct
        finally:
            self._busy.release()
        self.get_logger().info(f'collect: {result.message}')
        return result


def params_from(request: Any) -> CollectionParams:
    """Return the parameters of a request; 0 takes the default of a number."""
    given = {one.name: getattr(request, one.name) for one in fields(CollectionParams) if hasattr(request, one.name)}
    return CollectionParams(**{name: value for name, value in given.items() if value})


def main() -> None:
    """Run the node."""
    run(Collector, make_executor=WaitingExecutor)
