"""Node that says what surface is being felt, with the evidence so far, and learns new ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from std_srvs.srv import Trigger
from texture_msgs import msg, srv

from texture_core.errors import ModelMismatch, TextureError
from texture_core.estimates import TextureEstimate
from texture_core.features import FeatureVector
from texture_core.parameters import param
from texture_core.ros.run import run
from texture_estimation.evidence import NO_MODEL, Evidence
from texture_estimation.incremental.incremental_classifier import Pupil
from texture_estimation.model import Model, load_model
from texture_estimation.ros.estimator_node import EstimatorNode


@dataclass(frozen=True)
class ClassifierParams:
    """What the classifier judges by."""

    model: str = param(
        '', "Path of a trained model (NAME.skops or NAME.json); '' for none yet. May be changed at any time."
    )


class Classifier(EstimatorNode):
    """Turn feature vectors into texture estimates, and explorations into knowledge."""

    params = ClassifierParams
    estimate = (msg.TextureEstimate, 'texture')
    no_model = NO_MODEL
    doing = 'judging'
    unused = 'some feature vectors could not be used'

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('classifier', **kwargs)
        self.create_service(srv.AddTexture, 'add_texture', self._on_learn)
        self.create_service(Trigger, 'undo_learning', self._on_undo)

    def _load(self, path: str) -> Evidence:
        model = load_model(path) if path else None
        self._pupil = Pupil(model, path) if model and model.examples else None
        return Evidence(model)

    def _judge(self, vector: FeatureVector) -> TextureEstimate:
        if self._pupil is not None:
            self._pupil.remember(vector)
        return super()._judge(vector)

    def _facts(self) -> dict[str, int]:
        return {'lessons': len(self._evidence.model.lessons) if self._evidence.model else 0}

    def _faults(self) -> dict[str, int]:
        return {'refused_vectors': self._evidence.refused, 'not_finite_vectors': self._evidence.not_finite}

    def _on_learn(self, request: srv.AddTexture.Request, answer: srv.AddTexture.Response) -> Any:
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


def _known(model: Model) -> str:
    taught = len(model.lessons)
    return f'{len(model.labels)} textures known, {taught} {"lesson" if taught == 1 else "lessons"} since the training'


def main() -> None:
    """Run the node."""
    run(Classifier)
