"""Train a roughness model from labelled bags and the grades that people gave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from texture_estimation.roughness.grades import read_grades
from texture_estimation.roughness.model import RoughnessModel
from texture_estimation.roughness.recipe import load_roughness_recipe
from texture_estimation.roughness.training import train_grades
from texture_evaluation.train import save_model
from texture_recordings.slide_dataset import SlideDataset


def train_grades_from_bags(
    recipe: str,
    bags: Sequence[str | Path],
    grades: str | Path,
    slides: str = '',
    out: str | Path | None = None,
    *,
    name: str = '',
    namespace: str | None = None,
) -> RoughnessModel:
    """Return a roughness model trained on the labelled slides of bags, and save it.

    Parameters
    ----------
    recipe
        Name of a shipped roughness recipe, or path of any.
    bags
        Bags, or folders of bags.
    grades
        CSV file with the grade of every surface in the bags, or the name of a shipped table.
    slides
        Which slides of each surface, such as '1-30'; '' for all.
    out
        Path of the model, with or without .skops; not saved if None.
    name
        Of the model; that of the file, or else of the recipe, if ''.
    namespace
        Of the finger, if bags hold several.

    Returns
    -------
    RoughnessModel

    Raises
    ------
    TextureError
        With one sentence, if recipe, bags, grades, slides or place are wrong.
    InvalidParameter
        If the model cannot be saved.
    """
    plan, table = load_roughness_recipe(recipe), read_grades(grades)
    windows = replace(plan.feature_set, windows=plan.training_windows)
    examples = SlideDataset.from_bags(bags, slides, namespace, windows.topics).features(windows)
    model = train_grades(plan, examples, table, name or (Path(out).name.removesuffix('.skops') if out else plan.name))
    if out is not None:
        save_model(model, out, bags, slides, grades=str(grades))
    return model
