# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Train a model from labelled bags: one that recognises surfaces, or one that grades them as people did."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from texture_core.cli import task
from texture_core.config import writing
from texture_core.errors import InvalidData, counted
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.roughness import RoughnessModel, load_roughness_recipe, read_grades, train_grades
from texture_estimation.training import train
from texture_features.feature_set import LabelledFeatures
from texture_recordings.bags import find_bags
from texture_recordings.dataset import SlideDataset
from texture_recordings.slides import LabelledSlide


def train_from_bags(
    recipe: str,
    bags: Sequence[str | Path],
    slides: str = '',
    out: str | Path | None = None,
    *,
    namespace: str | None = None,
) -> TextureModel:
    """Return a model trained on the labelled slides of bags, and save it; a TextureError states what is wrong.

    Parameters
    ----------
    recipe
        Name of a shipped recipe, or path of any.
    bags
        Bags, or folders of bags.
    slides
        Which slides of each surface, such as '1-30'; '' for all.
    out
        Path of the model, with or without .npz; not saved if None.
    namespace
        Namespace of the finger, if bags hold several.

    Returns
    -------
    TextureModel
    """
    plan = load_recipe(recipe)
    dataset = SlideDataset.from_bags(bags, slides, namespace, topics=plan.feature_set.topics)
    digests = sorted(slide_digests(dataset))
    examples = training_examples(plan, dataset)
    with task(f"fitting '{plan.name}' to {len(examples.y)} windows"):
        model = train(plan, examples, _name(out, plan.name))
    faults = dataset.tare_faults(plan.feature_set)
    most = max(
        sum(len(batch.samples) for slide in dataset for batch in slide.signals[topic])
        for topic in plan.feature_set.topics
    )
    trained_on = {
        'sessions': sorted({slide.session for slide in dataset}),
        'slide_digests': digests,
        'samples': most,
        'unusable': not_counted(unusable(dataset, examples)),
    }
    model = replace(model, training={**model.training, **trained_on, **({'tare': faults} if faults else {})})
    if out is not None:
        _save(model, out, bags, slides)
    return model


def train_grades_from_bags(
    recipe: str,
    bags: Sequence[str | Path],
    grades: str | Path,
    slides: str = '',
    out: str | Path | None = None,
    *,
    namespace: str | None = None,
) -> RoughnessModel:
    """Return a roughness model trained on labelled slides, and save it; a TextureError states what is wrong."""
    plan, table = load_roughness_recipe(recipe), read_grades(grades)
    windows = replace(plan.feature_set, windows=plan.training_windows)
    dataset = SlideDataset.from_bags(bags, slides, namespace, topics=windows.topics)
    slide_digests(dataset)
    examples = dataset.features(windows)
    with task(f"fitting '{plan.name}' to {len(examples.y)} windows"):
        model = train_grades(plan, examples, table, _name(out, plan.name))
    model = replace(model, training={**model.training, 'unusable': not_counted(unusable(dataset, examples))})
    if out is not None:
        _save(model, out, bags, slides, grades=str(grades))
    return model


def training_examples(recipe: Recipe, dataset: SlideDataset) -> LabelledFeatures:
    """Return the windows of labelled slides as the training of a recipe needs them, with its augmentation."""
    windows = replace(recipe.feature_set, windows=recipe.training_windows)
    distances_m = recipe.training.distances_m(recipe.feature_set.windows.length_s)
    return dataset.features(windows, recipe.augmentation, distances_m)


def unusable(dataset: SlideDataset, features: LabelledFeatures) -> list[str]:
    """Return the names of the slides that have no window."""
    used = set(features.groups.tolist())
    return [name for name in dataset.names.tolist() if name not in used]


def not_counted(slides: Sequence[str]) -> list[str]:
    """Return a line on slides without a usable window, if there are any."""
    why = 'not counted, as each window lacks samples, has some that are NaN, or is longer than the slide'
    return [f'{counted(len(slides), "slide")} {why}: {", ".join(slides)}'] if slides else []


def slide_digest(slide: LabelledSlide) -> str:
    """Return a short digest of the samples of a slide, by which it is found again under any name and number."""
    digest = hashlib.sha256()
    for _, batches in sorted(slide.signals.items()):
        for batch in batches:
            digest.update(batch.samples.tobytes())
    return digest.hexdigest()[:12]


def slide_digests(dataset: SlideDataset) -> dict[str, LabelledSlide]:
    """Return slides by their digests; InvalidData if two have the same samples: one would test what another trains."""
    found: dict[str, LabelledSlide] = {}
    for slide in dataset:
        other = found.setdefault(slide_digest(slide), slide)
        if other is not slide and any(slide.signals.values()):
            where = f" (in '{other.bag}' and '{slide.bag}')" if slide.session else ''
            raise InvalidData(
                f"the slides '{other.name}' and '{slide.name}'{where} have the same samples; a copy is no further "
                'slide, so give each bag or array once'
            )
    return found


def _name(out: str | Path | None, recipe: str) -> str:
    """Return the name of a model: that of its file, or else of its recipe."""
    return Path(out).name.removesuffix('.npz') if out else recipe


def _save(
    model: TextureModel | RoughnessModel, out: str | Path, bags: Sequence[str | Path], slides: str, **more: str
) -> None:
    """Save a model with the names of the bags it was trained on, and further facts about the data."""
    data = {'bags': [path.name for path in find_bags(bags)], 'slides': slides or 'all', **more}
    with writing(out):
        model.save(out, {'data': data})
