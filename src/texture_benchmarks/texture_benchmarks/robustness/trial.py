"""Recipes that trained on the same clean slides, and how many windows of other slides they recognise."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import eq
from typing import NamedTuple

import numpy as np

from texture_benchmarks.recipes.trial import at_rate
from texture_benchmarks.robustness.degradations import Degradation
from texture_core.arrays import Array
from texture_core.signal import TactileSignal
from texture_estimation.classification.training import train
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe
from texture_evaluation.train import training_examples
from texture_features.augmentation.augmentation import Augmentation
from texture_features.feature_set import FeatureSet
from texture_recordings.labelled_slide import LabelledSlide
from texture_recordings.slide_dataset import SlideDataset

TOPIC = 'signal'
AT_ONCE = 512  # windows evaluated together: many for speed, few enough for the memory


class Count(NamedTuple):
    """Windows recognised, each by itself, of those that were cut."""

    right: int
    cut: int


@dataclass(frozen=True, eq=False)
class TrainedModels:
    """Models of several recipes that trained on the same slides; recipes of the same features describe them once."""

    models: Sequence[TextureModel]

    @classmethod
    def trained(cls, recipes: Iterable[Recipe], slides: Sequence[LabelledSlide]) -> TrainedModels:
        """Train each recipe on all slides."""
        models = []
        for group in _sharing({recipe.name: recipe for recipe in recipes}):
            examples = training_examples(group[0], SlideDataset(tuple(slides)))
            models += [train(recipe, examples) for recipe in group]
        return cls(models)

    def counts(self, slides: Sequence[LabelledSlide], length: float = 1.0) -> dict[str, Count]:
        """Return what each recipe recognises, by its name, in windows `length` times as long as those trained."""
        models = {model.recipe.name: model for model in self.models}
        found: dict[str, Count] = {}
        for group in _sharing({name: with_windows(model.recipe, length) for name, model in models.items()}):
            vectors = SlideDataset(tuple(slides)).vectors(group[0].feature_set)
            extracted = [(slide.surface, vector.values) for slide, own in vectors for vector in own]
            found |= {recipe.name: _count(models[recipe.name], extracted) for recipe in group}
        return found


def with_windows(recipe: Recipe, length: float) -> Recipe:
    """Return a recipe that describes longer or shorter windows in the same terms, one each as often as before."""
    own = recipe.feature_set.windows
    windows = dataclasses.replace(own, length_s=length * own.length_s)
    features = dataclasses.replace(recipe.feature_set, windows=windows, _layouts={})
    return dataclasses.replace(recipe, feature_set=features)


def degraded(
    item: LabelledSlide, degradation: Degradation, strength: float, rate_hz: float, rng: np.random.Generator
) -> LabelledSlide:
    """Return the vibration of a slide at a rate, as bad as the strength says.

    Parameters
    ----------
    item
        Slide with its vibration.
    degradation
        What becomes worse.
    strength
        In the unit of the degradation.
    rate_hz
        Sampling rate of the result.
    rng
        Random numbers of the degradation.

    Returns
    -------
    LabelledSlide
    """
    whole = at_rate(item, TOPIC, _native_hz(item) if degradation.of_the_world else rate_hz)
    signals = [_changed(run, degradation, strength, rng) for run in whole.signals[TOPIC]]
    return at_rate(dataclasses.replace(item, signals={TOPIC: signals}), TOPIC, rate_hz)


def _native_hz(item: LabelledSlide) -> float:
    return item.signals[TOPIC][0].sampling_rate_hz


def _changed(run: TactileSignal, degradation: Degradation, strength: float, rng: np.random.Generator) -> TactileSignal:
    samples = degradation.change(run.samples.astype(np.float64), run.sampling_rate_hz, strength, rng)
    return dataclasses.replace(run, samples=samples.astype(np.float32))


def _sharing(recipes: Mapping[str, Recipe]) -> list[list[Recipe]]:
    """Return the recipes that have the same windows, features and augmentation together."""
    groups: dict[tuple[FeatureSet, Augmentation], list[Recipe]] = {}
    for recipe in recipes.values():
        groups.setdefault((recipe.feature_set, recipe.augmentation), []).append(recipe)
    return list(groups.values())


def _count(model: TextureModel, extracted: Sequence[tuple[str, Array]]) -> Count:
    right = 0
    for first in range(0, len(extracted), AT_ONCE):
        surfaces, values = zip(*extracted[first : first + AT_ONCE], strict=True)
        right += sum(map(eq, model.decide(np.stack(values)), surfaces))
    return Count(right, len(extracted))
