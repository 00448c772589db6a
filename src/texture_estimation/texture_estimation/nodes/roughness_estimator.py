# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node that estimates how rough the surface is, with its uncertainty."""

from __future__ import annotations

from typing import Any, ClassVar

from texture_msgs import msg

from texture_core.ros import run
from texture_estimation.nodes.classifier import EstimatorNode, EstimatorParams  # noqa: F401  # its parameters
from texture_estimation.roughness import NO_MODEL, RoughnessAccumulator, load_roughness_model


class RoughnessEstimator(EstimatorNode):
    """Turn feature vectors into roughness estimates."""

    estimate = (msg.RoughnessEstimate, 'roughness')
    no_model = NO_MODEL
    activity = 'grading'
    vectors_unused = 'some feature vectors could not be graded'
    in_part: ClassVar = {'valid': False}

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('roughness_estimator', **kwargs)

    def _load(self, path: str) -> RoughnessAccumulator:
        return RoughnessAccumulator(load_roughness_model(path) if path else None)

    def _facts(self) -> dict[str, int]:
        return {'windows_without_grade': self._evidence.silent}

    def _faults(self) -> dict[str, int]:
        return {'refused_vectors': self._evidence.refused, 'unusable_windows': self._evidence.unusable}


def main() -> None:
    """Run the node."""
    run(RoughnessEstimator)
