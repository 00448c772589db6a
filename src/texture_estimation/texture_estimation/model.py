# SPDX-License-Identifier: Apache-2.0
"""A trained model and its files: NAME.skops, the card NAME.json, and the slides added since in the folder NAME.added.

Adding slides does not change the two files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.errors import ModelMismatch
from texture_core.types import Array
from texture_estimation import model_files
from texture_estimation.decisions import (
    ConfidenceFloor,
    Domain,
    ErrorBound,
    NoveltyDetector,
    PredictionSets,
    SlideNovelty,
    StoppingRule,
    space_means,
)
from texture_estimation.gaussians import SlideGaussians, TrainingExamples
from texture_estimation.learners.learner import Predictor, hidden_layer
from texture_estimation.learners.mlp import MlpPredictor
from texture_estimation.model_files import AddedSlide, read_added_slides
from texture_estimation.next_motion import NextTouchModel
from texture_estimation.numerics import is_tied, log_softmax
from texture_estimation.recipe import Recipe
from texture_features.correction import CORRECTED, read_correction
from texture_features.features import temporal as slide_onset

# Names of their parts in the file.
EXAMPLES, NOVELTY_DETECTOR, NEXT_TOUCH_MODEL = 'examples', 'novelty_detector', 'next_touch_model'
LEAST_PROBABILITY = 1e-300  # so that its logarithm is finite
# What a model file may hold beyond plain values and arrays; anything else is refused before it is built.
TRUSTED = (
    'sklearn.naive_bayes.GaussianNB',
    'sklearn.preprocessing._data.StandardScaler',
    'sklearn.svm._classes.SVC',
)


@dataclass(frozen=True, eq=False)
class TextureModel:
    """Fitted parameters, and what is needed to classify a feature vector and to refuse an incompatible one.

    Parameters
    ----------
    name
        Of the model.
    labels
        Textures in the training set, in the order of the probabilities; added ones last.
    names, feature_set
        Features it expects, and their fingerprint.
    recipe
        By which it was made.
    parameters
        Fitted parameters of the learner, as the file stores them.
    tempering_exponent
        Exponent of the effective window count in the evidence, 0 to 1.
    error_bound
        What the held-out slides can show; it limits the confidence, and early stopping.
    training
        Facts about the training, for the card.
    stopping_rule
        Early stopping rule.
    prediction_sets
        Conformal prediction sets.
    novelty_detector
        Rejects unknown surfaces; with None no surface is rejected.
    confidence_floor
        Smallest confidence of known surfaces.
    next_touch_model
        Class-conditional Gaussians of each motion, to choose the next touch; None if all slides were alike.
    examples
        Training windows that are kept for incremental training; None if it holds none.
    added_slides
        Slides added after the training.
    slide_gaussians
        Gaussians of whole slides that tell added textures; None until a slide is added.
    domain
        Conditions under which the model was trained; outside them it decides nothing.

    Examples
    --------
    >>> import numpy as np
    >>> from texture_estimation.training import train
    >>> from texture_estimation.recipe import Recipe
    >>> from texture_features.examples import LabelledFeatures
    >>> learner = {'sklearn': {'estimator': 'sklearn.naive_bayes:GaussianNB'}}
    >>> recipe = Recipe.from_mapping({'inputs': {'signal': {'features': ['mean']}}, 'learner': learner}, 'tiny')
    >>> labels = np.repeat(['cork', 'felt'], 20)
    >>> slides = np.char.add(labels, np.tile(np.repeat(['/1', '/2', '/3', '/4'], 5), 2))
    >>> values = (labels == 'felt')[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 1))
    >>> model = train(recipe, LabelledFeatures(values, labels, slides, ('mean',), 'a1', 0.5, 0.1))
    >>> model.labels, model.decide(np.array([[0.05], [0.02]]))
    (('cork', 'felt'), ['cork', 'cork'])
    """

    name: str
    labels: tuple[str, ...]
    names: tuple[str, ...]
    feature_set: str
    recipe: Recipe
    parameters: Mapping[str, Any]
    tempering_exponent: float
    error_bound: ErrorBound
    training: Mapping[str, Any] = field(default_factory=dict)
    stopping_rule: StoppingRule = field(default_factory=StoppingRule)
    prediction_sets: PredictionSets = field(default_factory=PredictionSets)
    novelty_detector: NoveltyDetector | None = None
    confidence_floor: ConfidenceFloor = field(default_factory=ConfidenceFloor)
    next_touch_model: NextTouchModel | None = None
    examples: TrainingExamples | None = None
    added_slides: tuple[AddedSlide, ...] = ()
    slide_gaussians: SlideGaussians | None = None
    domain: Domain = field(default_factory=Domain)

    @cached_property
    def predictor(self) -> Predictor:
        """Predictor of the trained textures; of all textures, with what was added, if the learner learns online."""
        learner, parameters = self.recipe.learner, self.parameters
        if self.learns_online:
            for added in self.added_slides:
                code = self.labels.index(added.label)
                parameters = learner.partial_fit(parameters, added.values, code)  # type: ignore[attr-defined]
        return learner.predictor(parameters)

    @property
    def learns_online(self) -> bool:
        """Whether added slides update the learner itself; otherwise Gaussians of whole slides tell them."""
        return hasattr(self.recipe.learner, 'partial_fit')

    @property
    def n_predicted(self) -> int:
        """Number of textures that the predictor tells."""
        return len(self.labels) if self.learns_online else self.n_trained

    @cached_property
    def active_novelty_detector(self) -> NoveltyDetector | None:
        """Novelty detector that includes the added slides."""
        if self.novelty_detector is None or not self.added_slides:
            return self.novelty_detector
        means = [
            space_means(added.values, self.activations(added.values), self._overlap) for added in self.added_slides
        ]
        numbers = np.array([self.labels.index(added.label) for added in self.added_slides])
        return self.novelty_detector.with_slides(means, numbers)

    @cached_property
    def active_confidence_floor(self) -> ConfidenceFloor:
        """Smallest confidence of known surfaces; none with added slides, whose labels make all others less probable."""
        return ConfidenceFloor() if self.added_slides else self.confidence_floor

    @cached_property
    def active_domain(self) -> Domain:
        """Domain that includes the added slides."""
        if not self.added_slides:
            return self.domain
        return self.domain.widened(
            [added.conditions for added in self.added_slides], [added.label for added in self.added_slides]
        )

    @property
    def _overlap(self) -> float:
        """Distance of two windows of a slide over their length."""
        windows = self.recipe.feature_set.windows
        return min(windows.hop_s / windows.length_s, 1.0)

    def decided(self, confidence: float, effective_windows: float, novelty_score: float) -> bool:
        """Return whether a slide may end: by the stopping rule, if enough slides were held out to show its error rate.

        Parameters
        ----------
        confidence
            Probability of the best label, 0 to 1, as the evidence gives it.
        effective_windows
            Effective window count so far.
        novelty_score
            Novelty score so far.

        Returns
        -------
        bool
        """
        return self.error_bound.shown and self.stopping_rule.decided(confidence, effective_windows, novelty_score)

    @cached_property
    def _hidden_layer(self) -> Callable[[Array], Array] | None:
        return hidden_layer(self.recipe.learner.predictor(self.parameters))

    def activations(self, X: Array) -> Array | None:
        """Return the outputs of the trained hidden layer, (..., n_hidden); None if the classifier has none."""
        return self._hidden_layer(X) if self._hidden_layer is not None else None

    def error_bound_of(self, number: int) -> ErrorBound:
        """Return what can be shown for the label of this number: few slides of an added texture show little."""
        if number < self.n_trained:
            return self.error_bound
        slides = sum(added.label == self.labels[number] for added in self.added_slides)
        return replace(self.error_bound, slides=slides)

    def predict_with_activations(self, X: Array) -> tuple[Array, Array | None]:
        """Return what `predictor` and `activations` give, with the hidden layer computed once where both have it.

        Parameters
        ----------
        X : (..., n_features)

        Returns
        -------
        (..., n_trained)
            Log-probabilities of the trained textures up to a constant of the window.
        (..., n_hidden) or None
            Outputs of the trained hidden layer; None if the classifier has none.
        """
        # A predictor derived from it may add to what the hidden layer gives, as that of `onset_mlp` does.
        if type(self.predictor) is MlpPredictor:
            activations = self.predictor.activations(X)
            return self.predictor.scores(activations), activations
        return self.predictor(X), self.activations(X)

    @cached_property
    def trust(self) -> Callable[[Array], float]:
        """How much a window of these features, (n_features,), counts in its slide."""
        of: Callable[[Array], float] | None = getattr(self.predictor, 'trust', None)
        return of or (lambda _: 1.0)

    def predict_log_proba(self, X: Array) -> Array:
        """Return the log-probability of each label, (..., n_labels) of (..., n_features).

        Parameters
        ----------
        X : (..., n_features)

        Returns
        -------
        (..., n_labels)
            Natural logarithms.
        """
        trained = log_softmax(self.predictor(X))
        if self.slide_gaussians is None or not self.added_slides:
            return trained
        combined = self.slide_gaussians.combined(np.exp(trained), self.slide_gaussians.window_shares(X))
        log_probabilities: Array = np.log(np.maximum(combined, LEAST_PROBABILITY))
        return log_probabilities

    def decide(self, X: Array) -> list[str]:
        """Return the label of each window alone, (n,) of (n, n_features); '' where several labels are equally good.

        Parameters
        ----------
        X : (n_features,), or (n, n_features)
            Of the windows of one slide.
        """
        log_probabilities = self.predict_log_proba(X)
        best = log_probabilities.argmax(axis=-1).tolist()
        none = is_tied(log_probabilities).tolist()
        return ['' if tied else self.labels[index] for index, tied in zip(best, none, strict=True)]

    def with_added_slides(self, added_slides: tuple[AddedSlide, ...]) -> TextureModel:
        """Return the model with these added slides in place of those it has.

        Raises
        ------
        ModelMismatch
            If the model holds no training examples.
        """
        trained = self.trained_labels
        labels = (*trained, *dict.fromkeys(slide.label for slide in added_slides if slide.label not in trained))
        if self.learns_online and self.examples is not None:
            return replace(self, labels=labels, added_slides=added_slides)
        gaussians = self.slide_gaussians or self._fit_slide_gaussians()
        if added_slides:
            codes = np.array([labels.index(slide.label) for slide in added_slides])
            gaussians = gaussians.with_added([slide.values for slide in added_slides], codes, self._overlap)
        return replace(self, labels=labels, added_slides=added_slides, slide_gaussians=gaussians)

    @property
    def trained_labels(self) -> tuple[str, ...]:
        """Textures known from the training."""
        return self.labels[: self.n_trained]

    @cached_property
    def n_trained(self) -> int:
        """Number of textures known from the training."""
        return int(self.examples.codes.max()) + 1 if self.examples else len(self.labels)

    def examples_of(self, label: str) -> Array:
        """Return the examples of a label from training and added slides, (n, n_features).

        Returns
        -------
        (n, n_features)
            Those of the training and those added.
        """
        known = self.examples.of_label(self.labels.index(label)) if self.examples and label in self.labels else None
        own = [added_slide.values for added_slide in self.added_slides if added_slide.label == label]
        return np.concatenate([np.empty((0, len(self.names))) if known is None else known, *own])

    def _fit_slide_gaussians(self) -> SlideGaussians:
        """Return the Gaussians of the trained textures, from the windows of the training that are kept."""
        if self.examples is None:
            raise ModelMismatch(f"model '{self.name}' holds no training examples, so none can be added; train it again")
        known, windows = self.examples, self.recipe.training_windows
        kept = len(known.codes) / max(int(self.training.get('windows', 0)), len(known.codes))
        overlap = min(windows.hop_s / windows.length_s / kept, 1.0)
        compared = np.array(
            [name.rsplit('/', 1)[-1] != slide_onset.SLIDE_ONSET for name in self.names], dtype=np.float64
        )
        return SlideGaussians.fit(known.values.astype(np.float64), known.codes, known.slides, overlap, compared)

    def validate(self) -> None:
        """Use every part once on a window of zeros: what does not fit the others, or is no number, raises now.

        Raises
        ------
        ModelMismatch
            If parts contradict each other, or a number is not finite or out of its range.
        """
        nothing = np.zeros(len(self.names))
        answer = self.predict_log_proba(nothing)
        if answer.shape != (len(self.labels),) or np.isnan(answer).any():
            raise ModelMismatch(f'it answers {answer.shape} numbers, its card names {len(self.labels)} labels')
        self.prediction_sets.members(np.exp(answer), 1.0)
        self.stopping_rule.decided(0.5, 1.0)
        self.confidence_floor.reached(0.5, 1.0)
        if self.novelty_detector is not None:
            novelty = SlideNovelty(self.novelty_detector.distances, len(self.labels))
            novelty.add(nothing, self.activations(nothing), 0, 1.0)
            self.novelty_detector.novelty_score(novelty.scores(0, 0.0), 1.0)
        if self.slide_gaussians is not None:
            self.slide_gaussians.check(nothing)
        if self.next_touch_model is not None:
            self.next_touch_model.check(nothing)
        if self.examples is not None:
            self.examples.check(len(self.names), len(self.labels))
        if not 0.0 <= self.tempering_exponent <= 1.0:
            raise ModelMismatch(f'the exponent of its evidence is {self.tempering_exponent}; allowed is 0 to 1')

    @property
    def card(self) -> dict[str, Any]:
        """What the card says, in the form of JSON."""
        return {
            'format': model_files.FORMAT,
            'name': self.name,
            'labels': list(self.trained_labels),
            'feature_set': self.feature_set.partition(CORRECTED)[0],
            'features': list(self.names),
            'tempering_exponent': self.tempering_exponent,
            'stopping_rule': asdict(self.stopping_rule),
            'error_bound': asdict(self.error_bound),
            'prediction_sets': asdict(self.prediction_sets),
            'confidence_floor': asdict(self.confidence_floor),
            'domain': self.domain.as_card(),
            'motions': [asdict(motion) for motion in self.next_touch_model.gaussians] if self.next_touch_model else [],
            'training': dict(self.training),
            'recipe': self.recipe.as_mapping(),
            'recipe_name': self.recipe.name,
        }

    def save(self, path: str | Path, facts: Mapping[str, Any] | None = None) -> Path:
        """Write NAME.skops and NAME.json; `facts`, such as accuracies, are added to the card. Return NAME.skops.

        Added slides are not written: they lie beside the model to which they were added.
        """
        more = {
            EXAMPLES: self.examples,
            NOVELTY_DETECTOR: self.novelty_detector,
            NEXT_TOUCH_MODEL: self.next_touch_model,
        }
        kept = {name: part.as_arrays() for name, part in more.items() if part}
        return model_files.write(path, {**self.parameters, **kept}, {**self.card, **(facts or {})})


def load_model(path: str | Path) -> TextureModel:
    """Read a model with its added slides. No code in the files is run.

    Parameters
    ----------
    path
        Of either file, or of both without the ending.

    Raises
    ------
    ModelMismatch
        With one sentence, if a file is missing, damaged, foreign or does not belong to the other.
    """
    target = model_files.model_stem(path)
    card, content = model_files.read(path)
    if 'regressor' in card.get('recipe', {}):
        raise ModelMismatch(f"model '{target}' estimates roughness; load it in the roughness_estimator")
    with model_files.usable(target):
        recipe = Recipe.from_mapping(card['recipe'], str(card['recipe_name']))
        correction = read_correction(target)
        feature_set = str(card['feature_set'])
        if correction is not None:
            recipe = replace(recipe, feature_set=replace(recipe.feature_set, correction=correction, _layouts={}))
            feature_set += f'{CORRECTED}{correction.fingerprint}'
        parameters = model_files.load_parameters(content, TRUSTED, estimators=recipe.learner_name == 'sklearn')
        examples, novelty_detector, gaussians = (
            parameters.pop(name, None) for name in (EXAMPLES, NOVELTY_DETECTOR, NEXT_TOUCH_MODEL)
        )
        model = TextureModel(
            name=str(card['name']),
            labels=tuple(map(str, card['labels'])),
            names=tuple(map(str, card['features'])),
            feature_set=feature_set,
            recipe=recipe,
            parameters=parameters,
            tempering_exponent=float(card['tempering_exponent']),
            error_bound=ErrorBound.from_card(card),
            training=dict(card['training']),
            stopping_rule=StoppingRule(**card['stopping_rule']),
            prediction_sets=PredictionSets(**{name: _tuples(value) for name, value in card['prediction_sets'].items()}),
            novelty_detector=NoveltyDetector.from_arrays(novelty_detector) if novelty_detector else None,
            confidence_floor=ConfidenceFloor.from_card(card),
            next_touch_model=NextTouchModel.from_arrays(gaussians) if gaussians else None,
            examples=TrainingExamples.from_arrays(examples) if examples else None,
            domain=Domain.from_card(card.get('domain')),
        )
        model.validate()
    added_slides = read_added_slides(target, model.feature_set, model.names)
    if not added_slides:
        return model
    try:
        with_added = model.with_added_slides(added_slides)
        with_added.validate()
        return with_added
    except model_files.BROKEN as error:
        raise ModelMismatch(f"the added slides of model '{target}' cannot be used: {error}; move them away") from error


def _tuples(value: Any) -> Any:
    return tuple(map(float, value)) if isinstance(value, list) else float(value)
