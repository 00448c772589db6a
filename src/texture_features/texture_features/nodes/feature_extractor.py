# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node that cuts windows of sliding from the tactile streams and extracts their features."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.node import Node
from texture_msgs import msg

from texture_core.config import param
from texture_core.errors import TextureError
from texture_core.ros import (
    FEATURE_QOS,
    LISTENERS,
    SENSOR_QOS,
    STATE_QOS,
    DiagnosticReport,
    Diagnostics,
    declare,
    from_msg,
    run,
    to_msg,
)
from texture_core.types import RESTARTED
from texture_features.correction import CORRECTION, file_next_to
from texture_features.feature_set import FeatureSet
from texture_features.windows import WindowCutter, WindowEvent

TIMEOUT_PERIOD_S = 0.1


@dataclass(frozen=True)
class ExtractorParams:
    """Parameters of the feature extractor."""

    recipe: str = param(
        'default',
        "Recipe: the name of a shipped one, '' for 'default', or the path of a recipe (YAML) or of a model.",
    )


class FeatureExtractor(Node):
    """Publish the features of each window as soon as its last sample has arrived."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('feature_extractor', **kwargs)
        recipe = declare(self, ExtractorParams).recipe
        self._feature_set = FeatureSet.load(recipe)
        if self._feature_set.correction is not None:
            self.get_logger().info(f"the finger is corrected by '{file_next_to(recipe, CORRECTION)}'")
        self._cutter = WindowCutter(self._feature_set.windows, self._feature_set.window_names)
        self._invalid = 0
        # The exploration of the newest vector, and how many of it were sent.
        self._numbered: tuple[str | None, int] = (None, 0)
        self._reported: dict[str, int] = {}
        self._frame_id = ''  # of the fingertip, of several that of the first input
        self._tared: dict[str, bool] = {}  # by topic
        self._publisher = self.create_publisher(msg.FeatureVector, 'features', FEATURE_QOS)
        self.create_subscription(msg.ExplorationState, 'exploration', self._on_state, STATE_QOS)
        for topic in self._feature_set.topics:
            self.create_subscription(msg.TactileSignal, topic, partial(self._on_signal, topic), SENSOR_QOS)
        self.create_timer(TIMEOUT_PERIOD_S, lambda: self._publish(self._cutter.time_out(time.monotonic())))
        self._diagnostics = Diagnostics(self, self._report)

    def _on_signal(self, topic: str, message: msg.TactileSignal) -> None:
        if topic == self._feature_set.topics[0]:
            self._frame_id = message.header.frame_id
        self._tared[topic] = message.tared
        self._add(partial(self._cutter.add_signal, topic), message)

    def _on_state(self, message: msg.ExplorationState) -> None:
        self._add(self._cutter.add_state, message)

    def _add(self, add: Callable[[Any], None], message: Any) -> None:
        try:
            add(from_msg(message))
        except TextureError as error:
            self._count_invalid(error)
            return
        self._publish(self._cutter.take())

    def _count_invalid(self, error: TextureError) -> None:
        self._invalid += 1
        self.get_logger().warning(str(error), throttle_duration_sec=1.0)

    def _publish(self, events: list[WindowEvent]) -> None:
        for event in events:
            try:
                vector = to_msg(self._feature_set.extract(event))
            except TextureError as error:  # such as channels that the sensor does not have
                self._count_invalid(error)
                continue
            exploration_id, sent = self._numbered
            vector.sequence = sent if vector.exploration_id == exploration_id else 0
            self._numbered = (None if vector.last else vector.exploration_id, vector.sequence + 1)
            vector.header.frame_id = self._frame_id
            self._publisher.publish(vector)

    def _report(self) -> DiagnosticReport:
        level, message, numbers = self._health()
        found = self.get_subscriptions_info_by_topic(self._publisher.topic_name)
        return level, message, {**numbers, LISTENERS: ' '.join(sorted({one.node_name for one in found}))}

    def _health(self) -> tuple[str, str, dict[str, int]]:
        numbers = {**self._cutter.counts, 'invalid_messages': self._invalid}
        waiting = self._cutter.waiting_for
        if waiting:
            return 'WARN', f'no message yet on {", ".join(waiting)}', numbers
        dropped = self._cutter.dropped(time.monotonic())
        if dropped:
            return 'WARN', f'no more messages on {", ".join(dropped)}; no window can be cut without it', numbers
        tare_faults = self._feature_set.tare_faults(self._tared)
        if tare_faults:
            return 'WARN', '; '.join(tare_faults), numbers
        new, self._reported = {name: total - self._reported.get(name, 0) for name, total in numbers.items()}, numbers
        # After a restart, which numbers from 0, the number of lost samples is unknown.
        unknown = f'unknown losses in a restart of {RESTARTED}' if new['restarts'] else ''
        lost = f'{new["lost_samples"]} samples lost' if new['lost_samples'] else ''
        if sentence := ', and '.join(filter(None, (lost, unknown))):
            return 'WARN', sentence, numbers
        faults = sum(new.values()) - new['windows']
        return (
            ('WARN', 'windows were left out or messages refused', numbers) if faults else ('OK', 'extracting', numbers)
        )


def main() -> None:
    """Run the node."""
    run(FeatureExtractor)
