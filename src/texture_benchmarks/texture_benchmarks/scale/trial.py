"""One training of a size, and what its windows cost and recognise, in a process of its own."""

from __future__ import annotations

import multiprocessing
import resource
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from texture_benchmarks.scale.drawn_features import DrawnSize, FeatureSpread
from texture_core.arrays import Array
from texture_core.errors import DeviceError
from texture_estimation.classification.training import train
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe
from texture_features.labelled_features import LabelledFeatures

TESTED_SLIDES, MOST_TESTED, WARM_UP = 1, 200, 50
KIB_PER_MIB = 1024.0


def costs_of(recipe: Recipe, spread: FeatureSpread, size: DrawnSize, seed: int) -> dict[str, Any]:
    """Return what one training costs, and what its model recognises of other slides.

    Parameters
    ----------
    recipe
        Trained as it is, but for augmentation where the size asks for no copies.
    spread
        Of which examples are drawn.
    size
        Of the training.
    seed
        Seed of the examples.

    Returns
    -------
    dict
        Figures as plain values.
    """
    trained = recipe if size.copies else replace(recipe, augmentation=replace(recipe.augmentation, copies=0))
    return in_own_process(lambda: _measure(trained, spread, size, seed))


def in_own_process(measure: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Return what a function returns in a process of its own, whose memory nothing else has used.

    Parameters
    ----------
    measure
        What is called.

    Raises
    ------
    DeviceError
        If the process ended without an answer, as one without memory does.
    """
    context = multiprocessing.get_context('fork')
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_answer, args=(measure, there))
    process.start()
    there.close()
    try:
        found: dict[str, Any] = here.recv()
    except EOFError as error:
        raise DeviceError('a training ended without an answer; see above, or give it more memory') from error
    finally:
        process.join()
    return found


def _answer(measure: Callable[[], dict[str, Any]], answer: Connection) -> None:
    answer.send(measure())
    answer.close()


def _measure(recipe: Recipe, spread: FeatureSpread, size: DrawnSize, seed: int) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    textures = spread.textures(size.labels, rng)
    examples = spread.slides(textures, size, rng)
    before, start = _peak_mib(), time.process_time()
    model = train(recipe, examples)
    taken, after = time.process_time() - start, _peak_mib()
    tested = spread.slides(textures, replace(size, slides=TESTED_SLIDES, copies=0), rng, first=size.slides + 1)
    right, latency_us = _tested(model, tested)
    return {
        **asdict(size),
        'training_windows': len(examples.labels),
        'train_s': round(taken, 1),
        'examples_mib': round(_bytes(examples) / KIB_PER_MIB**2, 1),
        'memory_beyond_examples_mib': round(after - before, 1),
        'memory_of_the_process_mib': round(after, 1),
        'window_accuracy': right[0],
        'slide_accuracy': right[1],
        'features_to_estimate_us': {name: round(float(np.percentile(latency_us, q)), 1) for name, q in QUANTILES},
    }


QUANTILES = (('median', 50), ('p99', 99))


def _tested(model: TextureModel, examples: LabelledFeatures) -> tuple[tuple[float, float], Array]:
    """Return the shares of windows and of slides recognised, and the times from features to estimate."""
    slides = np.unique(examples.groups)
    chosen = slides[:: max(1, len(slides) // MOST_TESTED)]
    windows = examples.of_slides(chosen)
    alone = float(np.mean(np.array(model.decide(windows.values)) == windows.labels))
    evidence, right, taken = EvidenceAccumulator(model), [], []
    for slide in chosen.tolist():
        for vector in windows.vectors(slide):
            start = time.perf_counter()
            estimate = evidence.update(vector)
            taken.append(1e6 * (time.perf_counter() - start))
        right.append(estimate.label == slide.partition('/')[0])
    return (alone, float(np.mean(right))), np.array(taken[min(WARM_UP, len(taken) // 2) :])


def _bytes(examples: LabelledFeatures) -> int:
    copies = [examples.augmented.copies, examples.augmented.disturbed] if examples.augmented else []
    return examples.values.nbytes + sum(each.values.nbytes for each in copies)


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / KIB_PER_MIB
