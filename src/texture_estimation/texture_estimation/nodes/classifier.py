"""Node that says what surface is being felt, with the evidence so far, and learns new ones."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from typing import Any

from rclpy.node import Node
from std_srvs.srv import Trigger
from texture_msgs import msg, srv

from texture_core.errors import InvalidParameter, ModelMismatch, TextureError
from texture_core.parameters import param
from texture_core.ros.conversions import from_msg, to_msg
from texture_core.ros.diagnostics import Diagnostics, Report
from texture_core.ros.parameters import declare, on_change
from texture_core.ros.qos import ESTIMATE_QOS, FEATURE_QOS
from texture_core.ros.run import run
from texture_estimation.evidence import NO_MODEL, Evidence
from texture_estimation.model import Model, load_model
from texture_estimation.pupil import Pupil


@dataclass(frozen=True)
class ClassifierParams:
    """What the classifier judges by."""

    model: str = param(
        '', "Path of a trained model (NAME.skops or NAME.json); '' for none yet. May be changed at any time."
    )


class Classifier(Node):
    """Turn feature vectors into texture estimates, and explorations into knowledge."""

    def __init__(self) -> None:
        super().__init__('classifier')
        self._load(declare(self, ClassifierParams))
        on_change(self, ClassifierParams, self._change)
        self._estimates = 0
        self._broken = 0
        self._reported = 0
        self._processing_s = 0.0
        self._publisher = self.create_publisher(msg.TextureEstimate, 'texture', ESTIMATE_QOS)
        self.create_subscription(msg.FeatureVector, 'features', self._on_features, FEATURE_QOS)
        self.create_service(srv.LearnTexture, 'learn', self._on_learn)
        self.create_service(Trigger, 'undo_learning', self._on_undo)
        self._diagnostics = Diagnostics(self, self._report)

    def _on_features(self, message: msg.FeatureVector) -> None:
        began = time.perf_counter()
        try:
            vector = from_msg(message)
        except TextureError as error:
            self._broken += 1
            self.get_logger().warning(str(error), throttle_duration_sec=1.0)
            return
        if self._pupil is not None:
            self._pupil.remember(vector)
        estimate = self._evidence.update(vector)
        self._processing_s = time.perf_counter() - began
        self._publisher.publish(to_msg(dataclasses.replace(estimate, processing_s=self._processing_s)))
        self._estimates += 1

    def _on_learn(self, request: srv.LearnTexture.Request, answer: srv.LearnTexture.Response) -> Any:
        try:
            answer.examples = self._taught().learn(request.label, request.exploration_id)
        except (TextureError, OSError) as error:
            answer.message = str(error)
            return answer
        model = self._become_taught()
        answer.success = True
        answer.message = f"learnt '{request.label.strip()}' from '{model.lessons[-1].exploration_id}'; " + _known(model)
        return answer

    def _on_undo(self, _: Trigger.Request, answer: Trigger.Response) -> Any:
        try:
            lesson = self._taught().undo()
        except (TextureError, OSError) as error:
            answer.message = str(error)
            return answer
        answer.success = True
        answer.message = f"unlearnt '{lesson.label}' from '{lesson.exploration_id}'; " + _known(self._become_taught())
        return answer

    def _taught(self) -> Pupil:
        if self._pupil is None:
            raise ModelMismatch(
                f"model '{self._evidence.model.name}' holds no examples to learn beside; train it again"
                if self._evidence.model
                else NO_MODEL
            )
        return self._pupil

    def _become_taught(self) -> Model:
        """Judge by what the pupil knows now."""
        model = self._taught().model
        self._evidence = Evidence(model)
        self.get_logger().info(_known(model))
        return model

    def _change(self, params: ClassifierParams) -> None:
        try:
            self._load(params)
        except TextureError as error:
            raise InvalidParameter(str(error)) from error

    def _load(self, params: ClassifierParams) -> None:
        model = load_model(params.model) if params.model else None
        self._pupil = Pupil(model, params.model) if model and model.examples else None
        self._evidence = Evidence(model)

    def _report(self) -> Report:
        evidence = self._evidence
        numbers = {
            'model': evidence.model.name if evidence.model else '',
            'lessons': len(evidence.model.lessons) if evidence.model else 0,
            'estimates': self._estimates,
            'refused_vectors': evidence.refused,
            'not_finite_vectors': evidence.not_finite,
            'broken_messages': self._broken,
            'processing_s': self._processing_s,
        }
        if evidence.model is None:
            return 'WARN', NO_MODEL, numbers
        faults = evidence.refused + evidence.not_finite + self._broken
        new, self._reported = faults != self._reported, faults
        return ('WARN', 'some feature vectors could not be used', numbers) if new else ('OK', 'judging', numbers)


def _known(model: Model) -> str:
    taught = len(model.lessons)
    return f'{len(model.labels)} textures known, {taught} {"lesson" if taught == 1 else "lessons"} since the training'


def main() -> None:
    """Run the node."""
    run(Classifier)
