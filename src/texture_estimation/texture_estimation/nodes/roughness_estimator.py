"""Node that says how rough the surface feels, with its uncertainty."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass

from rclpy.node import Node
from texture_msgs import msg

from texture_core.errors import InvalidParameter, TextureError
from texture_core.parameters import param
from texture_core.ros.conversions import from_msg, to_msg
from texture_core.ros.diagnostics import Diagnostics, Report
from texture_core.ros.parameters import declare, on_change
from texture_core.ros.qos import ESTIMATE_QOS, FEATURE_QOS
from texture_core.ros.run import run
from texture_estimation.roughness.evidence import NO_MODEL, RoughnessEvidence
from texture_estimation.roughness.model import load_roughness_model


@dataclass(frozen=True)
class RoughnessParams:
    """What the roughness estimator grades by."""

    model: str = param(
        '', "Path of a trained roughness model (NAME.skops or NAME.json); '' for none yet. May be changed at any time."
    )


class RoughnessEstimator(Node):
    """Turn feature vectors into roughness estimates."""

    def __init__(self) -> None:
        super().__init__('roughness_estimator')
        self._evidence = _evidence(declare(self, RoughnessParams))
        on_change(self, RoughnessParams, self._change)
        self._estimates = 0
        self._broken = 0
        self._reported = 0
        self._processing_s = 0.0
        self._publisher = self.create_publisher(msg.RoughnessEstimate, 'roughness', ESTIMATE_QOS)
        self.create_subscription(msg.FeatureVector, 'features', self._on_features, FEATURE_QOS)
        self._diagnostics = Diagnostics(self, self._report)

    def _on_features(self, message: msg.FeatureVector) -> None:
        began = time.perf_counter()
        try:
            vector = from_msg(message)
        except TextureError as error:
            self._broken += 1
            self.get_logger().warning(str(error), throttle_duration_sec=1.0)
            return
        estimate = self._evidence.update(vector)
        if estimate is None:
            return
        self._processing_s = time.perf_counter() - began
        self._publisher.publish(to_msg(dataclasses.replace(estimate, processing_s=self._processing_s)))
        self._estimates += 1

    def _change(self, params: RoughnessParams) -> None:
        try:
            self._evidence = _evidence(params)
        except TextureError as error:
            raise InvalidParameter(str(error)) from error

    def _report(self) -> Report:
        evidence = self._evidence
        numbers = {
            'model': evidence.model.name if evidence.model else '',
            'estimates': self._estimates,
            'refused_vectors': evidence.refused,
            'unusable_windows': evidence.unusable,
            'windows_without_grade': evidence.silent,
            'broken_messages': self._broken,
            'processing_s': self._processing_s,
        }
        if evidence.model is None:
            return 'WARN', NO_MODEL, numbers
        faults = evidence.refused + evidence.unusable + self._broken
        new, self._reported = faults != self._reported, faults
        return ('WARN', 'some feature vectors could not be graded', numbers) if new else ('OK', 'grading', numbers)


def _evidence(params: RoughnessParams) -> RoughnessEvidence:
    return RoughnessEvidence(load_roughness_model(params.model) if params.model else None)


def main() -> None:
    """Run the node."""
    run(RoughnessEstimator)
