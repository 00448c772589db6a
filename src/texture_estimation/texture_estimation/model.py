# SPDX-License-Identifier: Apache-2.0
"""A trained model and its files: NAME.npz, the card NAME.json, and the slides added since in the folder NAME.added.

Adding slides does not change the two files.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.errors import ModelMismatch
from texture_core.types import Array
from texture_estimation import model_files
from texture_estimation.decisions import Decisions, ErrorBound, SlideNovelty, space_means
from texture_estimation.gaussians import SlideGaussians, TrainingExamples
from texture_estimation.learners.learner import Predictor, hidden_layer
from texture_estimation.learners.mlp import MlpPredictor
from texture_estimation.model_files import AddedSlide, StoredModel, part_of, read_added_slides, tree_of
from texture_estimation.next_motion import NextTouchModel
from texture_estimation.numerics import is_tied, log_softmax
from texture_estimation.recipe import Recipe
from texture_features.correction import CORRECTED, read_correction
from texture_features.features import temporal as slide_onset

LEAST_PROBABILITY = 1e-300  # so that its logarithm is finite


@dataclass(frozen=True, eq=False, kw_only=True)
class TextureModel(StoredModel):
    """Fitted parameters, and what is needed to classify a feature vector and to refuse an incompatible one.

    Parameters
    ----------
    labels
        Textures in the training set, in the order of the probabilities; added ones last.
    tempering_exponent
        Exponent of the effective window count in the evidence, 0 to 1.
    decisions
        When a slide may end, and when its surface is known.
    next_touch_model
        Class-conditional Gaussians of each motion, to choose the next touch; None if all slides were alike.
    examples
        Training windows that are kept for incremental training; None if it holds none.
    added_slides
        Slides added after the training.
    slide_gaussians
        Gaussians of whole slides that tell added textures; None until a slide is added.

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

    labels: tuple[str, ...]
    recipe: Recipe
    tempering_exponent: float
    decisions: Decisions
    next_touch_model: NextTouchModel | None = None
    examples: TrainingExamples | None = None
    added_slides: tuple[AddedSlide, ...] = ()
    slide_gaussians: SlideGaussians | None = None

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
    def active_decisions(self) -> Decisions:
        """Decisions that include the added slides."""
        added = self.added_slides
        if not added:
            return self.decisions
        means = [space_means(slide.values, self.activations(slide.values), self._overlap) for slide in added]
        codes = np.array([self.labels.index(slide.label) for slide in added])
        return self.decisions.with_slides(
            means, codes, [slide.conditions for slide in added], [slide.label for slide in added]
        )

    @property
    def _overlap(self) -> float:
        """Distance of two windows of a slide over their length."""
        windows = self.recipe.feature_set.windows
        return min(windows.hop_s / windows.length_s, 1.0)

    @cached_property
    def _hidden_layer(self) -> Callable[[Array], Array] | None:
        return hidden_layer(self.recipe.learner.predictor(self.parameters))

    def activations(self, X: Array) -> Array | None:
        """Return the outputs of the trained hidden layer, (..., n_hidden); None if the classifier has none."""
        return self._hidden_layer(X) if self._hidden_layer is not None else None

    def error_bound_of(self, number: int) -> ErrorBound:
        """Return what can be shown for the label of this number: few slides of an added texture show little."""
        if number < self.n_trained:
            return self.decisions.error_bound
        slides = sum(added.label == self.labels[number] for added in self.added_slides)
        return replace(self.decisions.error_bound, slides=slides)

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
        return np.log(np.maximum(combined, LEAST_PROBABILITY))

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

    def n_examples(self, label: str) -> int:
        """Return how many windows of a label there are from training and added slides."""
        trained = self.examples is not None and label in self.labels
        known = int((self.examples.codes == self.labels.index(label)).sum()) if self.examples and trained else 0
        return known + sum(len(slide.values) for slide in self.added_slides if slide.label == label)

    def _fit_slide_gaussians(self) -> SlideGaussians:
        """Return the Gaussians of the trained textures, from the windows of the training that are kept."""
        if self.examples is None:
            raise ModelMismatch(f"model '{self.name}' holds no training examples, so none can be added; train it again")
        known, windows = self.examples, self.recipe.training_windows
        kept = len(known.codes) / max(int(self.training.get('windows', 0)), len(known.codes))
        hop_share = min(windows.hop_s / windows.length_s / kept, 1.0)
        compared = np.array(
            [name.rsplit('/', 1)[-1] != slide_onset.SLIDE_ONSET for name in self.names], dtype=np.float64
        )
        return SlideGaussians.fit(known.values.astype(np.float64), known.codes, known.slides, hop_share, compared)

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
        decisions, detector = self.decisions, self.decisions.novelty_detector
        decisions.prediction_sets.members(np.exp(answer), 1.0)
        decisions.stopping_rule.decided(0.5, 1.0)
        decisions.confidence_floor.reached(0.5, 1.0)
        if detector is not None:
            novelty = SlideNovelty(detector.distances, len(self.labels))
            novelty.add(nothing, self.activations(nothing), 0, 1.0)
            detector.novelty_score(novelty.scores(0, 0.0), 1.0)
        if self.slide_gaussians is not None:
            self.slide_gaussians.check(nothing)
        if self.next_touch_model is not None:
            self.next_touch_model.check(nothing)
        if self.examples is not None:
            self.examples.check(len(self.names), len(self.labels))
        if not 0.0 <= self.tempering_exponent <= 1.0:
            raise ModelMismatch(f'the exponent of its evidence is {self.tempering_exponent}; allowed is 0 to 1')

    @property
    def tree(self) -> dict[str, Any]:
        """What the two files hold: plain values, and arrays as leaves."""
        return {
            **super().tree,
            'labels': list(self.trained_labels),
            'tempering_exponent': self.tempering_exponent,
            'decisions': tree_of(self.decisions),
            'next_touch_model': tree_of(self.next_touch_model),
            'examples': tree_of(self.examples),
        }


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
    tree = model_files.read(path, of='learner')
    with model_files.usable(target):
        recipe = Recipe.from_mapping(tree['recipe'], str(tree['recipe_name']))
        common = model_files.common_parts(tree)
        correction = read_correction(target)
        if correction is not None:
            recipe = replace(recipe, feature_set=replace(recipe.feature_set, correction=correction, _layouts={}))
            common['feature_set'] += f'{CORRECTED}{correction.fingerprint}'
        model = TextureModel(
            **common,
            recipe=recipe,
            labels=part_of(tuple[str, ...], tree.get('labels'), 'labels'),
            tempering_exponent=part_of(float, tree.get('tempering_exponent'), 'tempering_exponent'),
            decisions=part_of(Decisions, tree.get('decisions'), 'decisions'),
            next_touch_model=part_of(NextTouchModel | None, tree.get('next_touch_model'), 'next_touch_model'),
            examples=part_of(TrainingExamples | None, tree.get('examples'), 'examples'),
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
