"""Train a model from labelled bags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from texture_core.errors import InvalidParameter
from texture_core.files import writing
from texture_estimation.classification.training import train
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.roughness.model import RoughnessModel
from texture_features.labelled_features import LabelledFeatures
from texture_recordings.bags import find_bags
from texture_recordings.slide_dataset import SlideDataset

FAST_TOPIC = 'signal'
CHANNELS = ('fast', 'all')
HOPS = 4  # windows of the least distance overlap so often


def train_from_bags(
    recipe: str,
    bags: Sequence[str | Path],
    slides: str = '',
    out: str | Path | None = None,
    *,
    channels: str = 'all',
    name: str = '',
    namespace: str | None = None,
) -> TextureModel:
    """Return a model trained on the labelled slides of bags, and save it.

    Parameters
    ----------
    recipe
        Name of a shipped recipe, or path of any.
    bags
        Bags, or folders of bags.
    slides
        Which slides of each surface, such as '1-30'; '' for all.
    out
        Path of the model, with or without .skops; not saved if None.
    channels
        'fast' leaves all inputs of the recipe but `signal` out.
    name
        Of the model; that of the file, or else of the recipe, if ''.
    namespace
        Of the finger, if bags hold several.

    Returns
    -------
    TextureModel

    Raises
    ------
    TextureError
        With one sentence, if recipe, bags, slides or place are wrong.
    """
    plan = with_channels(load_recipe(recipe), channels)
    dataset = SlideDataset.from_bags(bags, slides, namespace, plan.feature_set.topics)
    examples = training_examples(plan, dataset)
    default = Path(out).name.removesuffix('.skops') if out else plan.name
    model = train(plan, examples, name or default)
    if out is not None:
        save_model(model, out, bags, slides)
    return model


def training_examples(recipe: Recipe, dataset: SlideDataset) -> LabelledFeatures:
    """Return the windows of labelled slides as the training of a recipe needs them, with its augmentation."""
    windows = replace(recipe.feature_set, windows=recipe.training_windows, _layouts={})
    examples = dataset.features(windows, recipe.augmentation, recipe.training.touch_s)
    distances_m = recipe.training.distances_m(recipe.feature_set.windows.length_s)
    if not distances_m:
        return examples
    return replace(examples, resized=dataset.features_over_distances(windows, distances_m, distances_m[0] / HOPS))


def with_channels(recipe: Recipe, channels: str) -> Recipe:
    """Return the recipe as it is for 'all' channels, with the input `signal` alone for 'fast'.

    Raises
    ------
    InvalidParameter
        If `channels` is neither, or the recipe has no vibration.
    """
    if channels not in CHANNELS:
        raise InvalidParameter(f"channels are '{channels}'; 'fast' or 'all' is needed")
    if channels == 'all':
        return recipe
    inputs = tuple(item for item in recipe.feature_set.inputs if item.topics == (FAST_TOPIC,))
    if not inputs:
        raise InvalidParameter(f"recipe '{recipe.name}' has no input '{FAST_TOPIC}'; use it with all channels")
    feature_set = replace(recipe.feature_set, inputs=inputs, _layouts={})
    return replace(recipe, feature_set=feature_set)


def save_model(
    model: TextureModel | RoughnessModel, out: str | Path, bags: Sequence[str | Path], slides: str, **more: str
) -> None:
    """Save a model with the names of the bags it was trained on.

    Parameters
    ----------
    model
        What was trained.
    out
        Path of the model, with or without .skops.
    bags
        Bags, or folders of bags.
    slides
        Which slides of each surface; '' for all.
    **more
        Further facts about the data.

    Raises
    ------
    InvalidParameter
        If the file cannot be written.
    """
    data = {'bags': [path.name for path in find_bags(bags)], 'slides': slides or 'all', **more}
    with writing(out):
        model.save(out, {'data': data})
