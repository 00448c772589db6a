# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""`texture train`: learn a model from labelled bags."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING

from texture_core.cli import add_bag_namespace, add_slides, task
from texture_core.config import shipped
from texture_core.errors import InvalidParameter
from texture_features.feature_set import read_recipe

if TYPE_CHECKING:
    from texture_estimation.model import TextureModel
    from texture_estimation.roughness import RoughnessModel

# What trains is imported when the names are known to be right.
# ruff: noqa: PLC0415


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument(
        'recipe', help='name of a shipped recipe, such as default, or roughness with --grades, or path of a recipe'
    )
    parser.add_argument('bags', nargs='+', help='labelled bags, or folders of bags')
    parser.add_argument(
        '--grades', metavar='FILE', help='CSV file texture,grade: learn to grade roughness, by a roughness recipe'
    )
    parser.add_argument('-o', '--out', required=True, metavar='MODEL', help='makes MODEL.npz and MODEL.json')
    parser.add_argument('--force', action='store_true', help='replace a model that is there already')
    add_slides(parser)
    add_bag_namespace(parser)


def run(options: argparse.Namespace) -> int:
    """Train, save, and report what was trained."""
    _check_place(Path(options.out), replace=options.force)
    if not options.grades and options.recipe in shipped('texture_estimation', 'config/roughness'):
        raise InvalidParameter(f"recipe '{options.recipe}' learns grades of roughness; give them with --grades FILE")
    kind = ('config/roughness', 'roughness recipe') if options.grades else ('config/recipes', 'recipe')
    read_recipe(options.recipe, *kind)
    with task('loading the libraries of train'):
        from texture_evaluation.train import train_from_bags, train_grades_from_bags
    if options.grades:
        graded = train_grades_from_bags(
            options.recipe, options.bags, options.grades, options.slides, options.out, namespace=options.namespace
        )
        print('\n'.join(graded_summary(graded, Path(options.out))))
        return 0
    model = train_from_bags(options.recipe, options.bags, options.slides, options.out, namespace=options.namespace)
    print('\n'.join(summary(model, Path(options.out))))
    return 0


def _check_place(out: Path, *, replace: bool) -> None:
    """Refuse, before anything is computed, a place where a model is already, or a folder that does not exist."""
    from texture_estimation.model import both_files

    file, _ = both_files(out)
    if file.exists() and not replace:
        raise InvalidParameter(f"'{file}' exists; give another name, or --force to replace it")
    added = file.with_suffix('.added')
    if any(added.glob('*')):  # they would belong to the new model at once
        raise InvalidParameter(
            f"slides were added to an earlier model, in '{added}'; move them away, or give another name"
        )
    if not file.parent.is_dir():
        raise InvalidParameter(f"there is no folder '{file.parent}' for the model; make it, or name another")
    try:
        TemporaryFile(dir=file.parent).close()
    except OSError as error:
        raise InvalidParameter(f"'{file}' cannot be written: {error.strerror}; name another folder") from error


def summary(model: TextureModel, out: Path) -> list[str]:
    """Return the labels of a model and its held-out accuracy, in lines."""
    from texture_estimation.acceptance import LEAST_SLIDES_A_LABEL

    training = model.training
    accuracy, slides = training['held_out_window_accuracy'], model.acceptance.domain.slides
    held_out, fewest = 'nothing was held out', min(slides.values(), default=0)
    few = fewest < LEAST_SLIDES_A_LABEL
    if accuracy is not None and few:
        needed = f'{fewest} of the {LEAST_SLIDES_A_LABEL} slides that each needs'
        held_out = f'no accuracy can be measured, as a surface has {needed}; record more'
    elif accuracy is not None:
        held_out = f'{100 * accuracy:.1f} % accuracy of held-out windows'
    kinds = len(model.next_touch_model.motions) if model.next_touch_model else 0
    return [
        f"recipe '{model.recipe.name}' trained on {len(model.labels)} surfaces: {', '.join(model.labels)}",
        f'from {training["slides"]} slides, {training["windows"]} windows of {training["window_s"]:g} s; {held_out}',
        *_unfit(model, None if few else accuracy),
        *_uneven(slides),
        *training.get('unusable', []),
        *training.get('tare', []),
        *filter(
            None, [model.acceptance.reason or model.acceptance.decided_reason, model.acceptance.domain.reach_reason]
        ),
        *training.get('quiet', []),
        *([f'{kinds} kinds of slides over each, from which `texture identify` can choose'] if kinds else []),
        _saved_as(out),
    ]


def _unfit(model: TextureModel, accuracy: float | None) -> list[str]:
    """Return warnings that the recipe does not fit the data: no better than chance, or more windows than samples."""
    training, labels = model.training, len(model.labels)
    warnings = []
    chance = 1.0 / max(labels, 1)
    margin = 1.64 * (chance * (1.0 - chance) / max(training['slides'], 1)) ** 0.5
    if accuracy is not None and labels > 1 and accuracy <= chance + margin:
        warnings.append(
            f'warning: {100 * accuracy:.1f} % accuracy of held-out windows is not above chance, {100 * chance:.1f} % '
            f'of {labels} surfaces; use a recipe for this sensor and rate, or check the labels'
        )
    if training['windows'] > training.get('samples', training['windows']):
        warnings.append(
            f'warning: {training["windows"]} windows overlap more than the {training["samples"]} samples that exist; '
            'use a recipe with longer hops, or check the rate of the recording'
        )
    return warnings


def _uneven(slides: Mapping[str, int]) -> list[str]:
    """Return a line on the labels with the fewest slides, where others have twice as many."""
    fewest, most = min(slides.values(), default=0), max(slides.values(), default=0)
    if 2 * fewest > most or not most:
        return []
    few = ', '.join(label for label, count in slides.items() if count == fewest)
    return [f'few slides of {few}: {fewest}, of others up to {most}; record equally many of each']


def graded_summary(model: RoughnessModel, out: Path) -> list[str]:
    """Return the training set and the held-out errors of a roughness model, in lines."""
    training = model.training
    error = training.get('held_out_error')
    held_out = 'nothing was held out' if error is None else f'{error:.2f} grades mean error on held-out textures'
    return [
        f"recipe '{model.recipe.name}' trained on the grades of {training['textures']} textures",
        f'from {training["slides"]} slides, {training["windows"]} windows of {training["window_s"]:g} s; {held_out}',
        *training.get('unusable', []),
        _saved_as(out),
    ]


def _saved_as(out: Path) -> str:
    from texture_estimation.model import both_files

    return f'saved as {both_files(out)[0]}, with its model card next to it'
