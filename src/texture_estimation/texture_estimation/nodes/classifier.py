# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node that classifies the touched surface and adds new textures, and the base class of the roughness estimator."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, ClassVar

from rclpy.node import Node
from std_srvs.srv import Trigger
from texture_msgs import msg, srv

from texture_core.config import param
from texture_core.errors import InvalidParameter, ModelMismatch, TextureError, UnknownName, counted
from texture_core.ros import (
    ESTIMATE_QOS,
    FEATURE_QOS,
    STATE_QOS,
    DiagnosticReport,
    Diagnostics,
    declare,
    from_msg,
    on_change,
    quality_of_service,
    run,
    to_msg,
)
from texture_core.types import FeatureVector, ModelInfo, Rejection, TextureEstimate
from texture_estimation.evidence import NO_MODEL, EvidenceAccumulator
from texture_estimation.incremental import ChangeError, ChangeRefused, IncrementalClassifier
from texture_estimation.model import TextureModel, load_model

IN_PART = 'feature vectors were lost, and the estimate is of a part of the exploration; explore again'
NO_ESTIMATE_PERIOD_S = 10.0  # of the warning that a model does not fit, or that slides are too short


@dataclass(frozen=True)
class EstimatorParams:
    """Parameters of the classifier and of the roughness estimator."""

    model: str = param(
        '', "Path of a trained model of its kind (NAME.npz or NAME.json); '': no model. It can be changed at any time."
    )


class EstimatorNode(Node):
    """Turn feature vectors into estimates by the parameter `model`, which may change while it runs."""

    estimate: ClassVar[tuple[type, str]]  # message and topic
    no_model: ClassVar[str]
    activity: ClassVar[str]
    vectors_unused: ClassVar[str]  # status message when there are new faults
    in_part: ClassVar[Mapping[str, Any]]  # fields by which an estimate of a part of an exploration is not used

    def __init__(self, name: str, **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self._evidence = self._load(declare(self, EstimatorParams, changeable=True).model)
        on_change(self, EstimatorParams, self._change)
        self._estimates = 0
        self._invalid = 0
        self._lost = 0
        self._exploration_of_vectors: str | None = None  # None after the last one of an exploration
        self._next_number = 0
        self._in_part = False
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
        """Return the content of the report in addition to faults."""
        return {}

    def _faults(self) -> Mapping[str, int]:
        """Return how many vectors could not be used, by reason."""
        raise NotImplementedError

    def _on_features(self, message: msg.FeatureVector) -> None:
        began = time.perf_counter()
        # Vectors that did not come: each exploration numbers its own from 0, as does an extractor that starts again.
        begins = message.exploration_id != self._exploration_of_vectors
        number, expected = message.sequence, 0 if begins else self._next_number
        self._lost += number - (expected if number >= expected else 0)
        self._in_part = number != expected or (self._in_part and not begins)
        self._exploration_of_vectors = None if message.last else message.exploration_id
        self._next_number = number + 1
        try:
            vector = from_msg(message)
        except TextureError as error:
            self._invalid += 1
            self.get_logger().warning(str(error), throttle_duration_sec=1.0)
            return
        estimate = self._predict(vector)
        if estimate is None:
            return
        self._processing_s = time.perf_counter() - began
        if estimate.message and not estimate.windows and self._evidence.model:
            self.get_logger().warning(estimate.message, throttle_duration_sec=NO_ESTIMATE_PERIOD_S)
        if self._in_part:
            estimate = replace(estimate, message='; '.join(filter(None, (IN_PART, estimate.message))))
            estimate = replace(estimate, **self.in_part) if estimate.windows else estimate
        self._publisher.publish(to_msg(replace(estimate, processing_s=self._processing_s)))
        self._estimates += 1

    def _change(self, params: EstimatorParams) -> None:
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
        if (publishers := self.count_publishers(self.estimate[1])) > 1:
            topic = self.resolve_topic_name(self.estimate[1])
            return (
                'WARN',
                f"{publishers} nodes publish on '{topic}'; end all but one, or give each a namespace",
                numbers,
            )
        if model is None:
            return 'WARN', self.no_model, numbers
        count = sum(faults.values())
        new, self._reported = count != self._reported, count
        return ('WARN', self.vectors_unused, numbers) if new else ('OK', self.activity, numbers)


class Classifier(EstimatorNode):
    """Turn feature vectors into texture estimates, and add explorations to the model."""

    estimate = (msg.TextureEstimate, 'texture')
    no_model = NO_MODEL
    activity = 'classifying'
    vectors_unused = 'some feature vectors could not be used'
    in_part: ClassVar = {'rejection': Rejection.TOO_LITTLE_EVIDENCE, 'decided': False, 'prediction_set': ()}

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('classifier', **kwargs)
        self._revision = 0
        self._exploration_id = ''  # of the newest exploration, also of one that ends before it slides
        self._model_infos = self.create_publisher(msg.ModelInfo, 'model_info', quality_of_service('model_info'))
        self._publish_model()
        self.create_subscription(msg.ExplorationState, 'exploration', self._on_state, STATE_QOS)
        self.create_service(srv.AddTexture, '~/add_texture', self._on_add)
        self.create_service(Trigger, '~/remove_last_added', self._on_remove_last)
        self.create_service(srv.RemoveTexture, '~/remove_texture', self._on_remove)

    def _load(self, path: str) -> EvidenceAccumulator:
        model = load_model(path) if path else None
        self._incremental_classifier = IncrementalClassifier(model, path) if model and model.examples else None
        return EvidenceAccumulator(model)

    def _predict(self, vector: FeatureVector) -> TextureEstimate:
        if self._incremental_classifier is not None:
            self._incremental_classifier.observe(vector)
        return replace(super()._predict(vector), revision=self._revision)

    def _on_state(self, state: msg.ExplorationState) -> None:
        exploration_id, before, aborted = state.exploration_id, self._exploration_id, state.PHASE_ABORTED
        self._exploration_id = exploration_id or before
        if self._incremental_classifier is None:
            return
        if exploration_id not in ('', before):
            self._incremental_classifier.begin(exploration_id)
        if state.phase in (state.PHASE_IDLE, state.PHASE_DONE, aborted):
            self._incremental_classifier.end(exploration_id, aborted=state.phase == aborted)

    def _change(self, params: EstimatorParams) -> None:
        super()._change(params)
        self._publish_model()

    def _publish_model(self) -> None:
        """Publish the labels of the model, which estimates do not repeat."""
        self._revision += 1
        model, now_ns = self._evidence.model, self.get_clock().now().nanoseconds
        info = (
            ModelInfo(now_ns, model.name, labels=model.labels, feature_set=model.feature_set)
            if model
            else ModelInfo(now_ns)
        )
        self._model_infos.publish(to_msg(replace(info, revision=self._revision)))

    def _facts(self) -> dict[str, int]:
        return {'added_slides': len(self._evidence.model.added_slides) if self._evidence.model else 0}

    def _faults(self) -> dict[str, int]:
        return {'refused_vectors': self._evidence.refused, 'not_finite_vectors': self._evidence.not_finite}

    def _on_add(self, request: srv.AddTexture.Request, answer: srv.AddTexture.Response) -> Any:
        known = self._evidence.model.labels if self._evidence.model else ()
        try:
            answer.examples = self._require_incremental().add(request.label, request.exploration_id)
        except (TextureError, OSError) as error:
            return _refused(answer, error)
        model = self._use_updated_model()
        answer.error_code = srv.AddTexture.Response.ERROR_NONE
        added_slide = model.added_slides[-1]
        near = [] if added_slide.label in known else get_close_matches(added_slide.label, known, n=1)
        hint = f" (did you mean '{near[0]}'? `texture add --undo` takes it back)" if near else ''
        new = f', a new texture{hint},' * (added_slide.label not in known)
        answer.message = f"added '{added_slide.label}'{new} from '{added_slide.exploration_id}'; {_known(model)}"
        return answer

    def _on_remove_last(self, _: Trigger.Request, answer: Trigger.Response) -> Any:
        try:
            added_slide = self._require_incremental().remove_last()
        except (TextureError, OSError) as error:
            answer.message = str(error)
            return answer
        answer.success = True
        answer.message = f"removed '{added_slide.label}' from '{added_slide.exploration_id}'; " + _known(
            self._use_updated_model()
        )
        return answer

    def _on_remove(self, request: srv.RemoveTexture.Request, answer: srv.RemoveTexture.Response) -> Any:
        try:
            removed = self._require_incremental().remove(request.label)
        except (TextureError, OSError) as error:
            return _refused(answer, error)
        answer.error_code = srv.RemoveTexture.Response.ERROR_NONE
        answer.slides = len(removed)
        model = self._use_updated_model()
        stays = ' which stays as it was trained;' if removed[0].label in model.labels else ''
        answer.message = f"removed {counted(len(removed), 'slide')} of '{removed[0].label}';{stays} " + _known(model)
        return answer

    def _require_incremental(self) -> IncrementalClassifier:
        if self._incremental_classifier is None:
            raise ModelMismatch(
                f"model '{self._evidence.model.name}' holds no training examples, so none can be added; train it again"
                if self._evidence.model
                else NO_MODEL
            )
        return self._incremental_classifier

    def _use_updated_model(self) -> TextureModel:
        """Classify with the updated model."""
        model = self._require_incremental().model
        self._evidence = EvidenceAccumulator(model)
        self._publish_model()
        self.get_logger().info(_known(model))
        return model


def _refused(answer: Any, error: TextureError | OSError) -> Any:
    kinds = {ModelMismatch: ChangeError.NO_MODEL, UnknownName: ChangeError.NOT_ADDED, OSError: ChangeError.NOT_STORED}
    code = next((code for kind, code in kinds.items() if isinstance(error, kind)), ChangeError.INVALID_LABEL)
    answer.error_code = int(error.error if isinstance(error, ChangeRefused) else code)
    answer.message = str(error)
    return answer


def _known(model: TextureModel) -> str:
    return (
        f'{counted(len(model.labels), "texture")}, {counted(len(model.added_slides), "slide")} added since the training'
    )


def main() -> None:
    """Run the node."""
    run(Classifier)
