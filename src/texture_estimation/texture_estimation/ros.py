# SPDX-License-Identifier: Apache-2.0
"""What nodes that answer feature vectors with estimates share: messages, the model, the report."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from typing import Any, ClassVar

from rclpy.node import Node
from texture_msgs import msg

from texture_core.errors import InvalidParameter, TextureError
from texture_core.ros import (
    ESTIMATE_QOS,
    FEATURE_QOS,
    DiagnosticReport,
    Diagnostics,
    declare,
    from_msg,
    on_change,
    to_msg,
)
from texture_core.types import FeatureVector


class EstimatorNode(Node):
    """Turn feature vectors into estimates by the parameter `model`, which may change while it runs."""

    params: ClassVar[type]  # has the field `model`, a path or ''
    estimate: ClassVar[tuple[type, str]]  # message and topic
    no_model: ClassVar[str]
    activity: ClassVar[str]
    vectors_unused: ClassVar[str]  # what is said when there are new faults

    def __init__(self, name: str, **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self._evidence = self._load(declare(self, self.params, changeable=True).model)
        on_change(self, self.params, self._change)
        self._estimates = 0
        self._invalid = 0
        self._lost = 0
        self._next_number: int | None = None
        self._reported = 0
        self._processing_s = 0.0
        self._publisher = self.create_publisher(*self.estimate, ESTIMATE_QOS)
        self.create_subscription(msg.FeatureVector, 'features', self._on_features, FEATURE_QOS)
        self._diagnostics = Diagnostics(self, self._report)

    def _load(self, path: str) -> Any:
        """Return the evidence that begins with the model of this path, without one for ''."""
        raise NotImplementedError

    def _predict(self, vector: FeatureVector) -> Any:
        """Return the estimate after one more vector, None if there is none."""
        return self._evidence.update(vector)

    def _facts(self) -> Mapping[str, Any]:
        """Return what the report says besides faults."""
        return {}

    def _faults(self) -> Mapping[str, int]:
        """Return how many vectors could not be used, by reason."""
        raise NotImplementedError

    def _vector_of(self, message: msg.FeatureVector) -> FeatureVector | None:
        try:
            return from_msg(message)
        except TextureError as error:
            self._invalid += 1
            self.get_logger().warning(str(error), throttle_duration_sec=1.0)
            return None

    def _on_features(self, message: msg.FeatureVector) -> None:
        began = time.perf_counter()
        self._count_lost(message.sequence)
        vector = self._vector_of(message)
        estimate = self._predict(vector) if vector is not None else None
        if estimate is None:
            return
        self._processing_s = time.perf_counter() - began
        self._publisher.publish(to_msg(dataclasses.replace(estimate, processing_s=self._processing_s)))
        self._estimates += 1

    def _count_lost(self, number: int) -> None:
        """Count the vectors that did not come: their numbers run on, and start again with another extractor."""
        if self._next_number is not None:
            self._lost += number - (self._next_number if number >= self._next_number else 0)
        self._next_number = number + 1

    def _change(self, params: Any) -> None:
        try:
            self._evidence = self._load(params.model)
        except TextureError as error:
            raise InvalidParameter(str(error)) from error

    def _report(self) -> DiagnosticReport:
        model = self._evidence.model
        faults = {**self._faults(), 'invalid_messages': self._invalid, 'lost_vectors': self._lost}
        numbers = {
            'model': model.name if model else '',
            'estimates': self._estimates,
            **self._facts(),
            **faults,
            'processing_s': self._processing_s,
        }
        if model is None:
            return 'WARN', self.no_model, numbers
        count = sum(faults.values())
        new, self._reported = count != self._reported, count
        return ('WARN', self.vectors_unused, numbers) if new else ('OK', self.activity, numbers)
