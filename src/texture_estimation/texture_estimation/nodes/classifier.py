# SPDX-License-Identifier: Apache-2.0
"""Node that classifies the touched surface from the evidence so far, and adds new textures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from std_srvs.srv import Trigger
from texture_msgs import msg, srv

from texture_core.config import param
from texture_core.errors import ModelMismatch, TextureError, UnknownName
from texture_core.ros import quality_of_service, run, to_msg
from texture_core.types import FeatureVector, ModelInfo, TextureEstimate
from texture_estimation.evidence import NO_MODEL, EvidenceAccumulator
from texture_estimation.incremental import ChangeError, ChangeRefused, IncrementalClassifier
from texture_estimation.model import TextureModel, load_model
from texture_estimation.ros import EstimatorNode


@dataclass(frozen=True)
class ClassifierParams:
    """Parameters of the classifier."""

    model: str = param(
        '', "Path of a trained model (NAME.npz or NAME.json); '': no model. It can be changed at any time."
    )


class Classifier(EstimatorNode):
    """Turn feature vectors into texture estimates, and add explorations to the model."""

    params = ClassifierParams
    estimate = (msg.TextureEstimate, 'texture')
    no_model = NO_MODEL
    activity = 'classifying'
    vectors_unused = 'some feature vectors could not be used'

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('classifier', **kwargs)
        self._revision = 0
        self._model_infos = self.create_publisher(msg.ModelInfo, 'model_info', quality_of_service('model_info'))
        self._tell_model()
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

    def _change(self, params: Any) -> None:
        super()._change(params)
        self._tell_model()

    def _tell_model(self) -> None:
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
        try:
            answer.examples = self._require_incremental().add(request.label, request.exploration_id)
        except (TextureError, OSError) as error:
            return _refused(answer, error)
        model = self._use_updated_model()
        answer.error_code = srv.AddTexture.Response.ERROR_NONE
        answer.message = f"added '{request.label.strip()}' from '{model.added_slides[-1].exploration_id}'; " + _known(
            model
        )
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
        answer.message = f"removed {_slides(len(removed))} of '{removed[0].label}';{stays} " + _known(model)
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
        self._tell_model()
        self.get_logger().info(_known(model))
        return model


def _refused(answer: Any, error: TextureError | OSError) -> Any:
    kinds = {ModelMismatch: ChangeError.NO_MODEL, UnknownName: ChangeError.NOT_ADDED, OSError: ChangeError.NOT_STORED}
    code = next((code for kind, code in kinds.items() if isinstance(error, kind)), ChangeError.INVALID_LABEL)
    answer.error_code = int(error.error if isinstance(error, ChangeRefused) else code)
    answer.message = str(error)
    return answer


def _known(model: TextureModel) -> str:
    return f'{len(model.labels)} textures, {_slides(len(model.added_slides))} added since the training'


def _slides(number: int) -> str:
    return f'{number} {"slide" if number == 1 else "slides"}'


def main() -> None:
    """Run the node."""
    run(Classifier)
