# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Ask the explorer for every motion of a preset, one after the other."""

from __future__ import annotations

import signal
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from rclpy.node import Node
from texture_msgs import srv

from texture_core.config import param
from texture_core.ros import declare, run, to_msg
from texture_exploration.presets import load_preset

SAMPLE_PERIOD_S = 0.1


@dataclass(frozen=True)
class ExplorePresetParams:
    """Which motions are made on what."""

    preset: str = param('ets-linear', 'Preset that is explored: the name of a shipped one or the path of a file.')
    surface: str = param('', 'True label of the surface if it is known; it labels the recording.')
    repeats: int = param(
        0, 'Number of rounds through all combinations; 0 takes the number of the preset.', low=0, high=10000
    )


class ExplorePreset(Node):
    """A client of the service `explore`; calls `on_end` when all is done."""

    def __init__(self, on_end: Callable[[], None] = lambda: None, **kwargs: Any) -> None:
        super().__init__('explore_preset', **kwargs)
        params = declare(self, ExplorePresetParams)
        preset = load_preset(params.preset)
        requests = preset.all(params.repeats)
        self.counts: Counter[str] = Counter(done=0, aborted=0, refused=0)
        self._remaining = [replace(request, surface=params.surface) for request in requests]
        self._total = len(self._remaining)
        self._busy = False
        self._on_end = on_end
        self._client = self.create_client(srv.Explore, 'explore')
        self._timer = self.create_timer(SAMPLE_PERIOD_S, self._request_next)
        self.get_logger().info(f"preset '{preset.name}': {self._total} explorations; {preset.paper}")

    def _request_next(self) -> None:
        """Ask for the next one; until the explorer is there, look again later."""
        if self._busy or not self._client.service_is_ready():
            return
        if not self._remaining:
            self.get_logger().info(f'ended: {dict(self.counts)}')
            self._timer.cancel()
            self._on_end()
            return
        self._busy = True
        request = srv.Explore.Request(request=to_msg(self._remaining.pop(0)))
        self._client.call_async(request).add_done_callback(self._on_answer)

    def _on_answer(self, future: Any) -> None:
        answer = future.result().result
        kind = 'done' if answer.error_code == answer.ERROR_NONE else 'aborted' if answer.exploration_id else 'refused'
        self.counts[kind] += 1
        number = self._total - len(self._remaining)
        self.get_logger().info(f'{number} of {self._total}, {kind}: {answer.exploration_id} {answer.message}')
        self._busy = False

    @property
    def all_succeeded(self) -> bool:
        """Whether every exploration was made to its end."""
        return self.counts['done'] == self._total


def main() -> None:
    """Run the node until all is done; end with 1 if something went wrong."""
    nodes: list[ExplorePreset] = []

    def make() -> ExplorePreset:
        nodes.append(ExplorePreset(lambda: signal.raise_signal(signal.SIGTERM)))
        return nodes[0]

    run(make)
    sys.exit(0 if nodes[0].all_succeeded else 1)
