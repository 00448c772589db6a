"""Recipes with windows of one length, tried on recorded slides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from texture_benchmarks.decision_times import decided_at
from texture_benchmarks.forked_map import map_forked
from texture_benchmarks.recipes.run import RATE_HZ
from texture_benchmarks.recipes.trial import comparable, every, figures_of, latencies_us
from texture_core.arrays import Array
from texture_estimation.channels import with_channels
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.search.parallel import single_blas_thread
from texture_evaluation import metrics
from texture_evaluation.cross_validation.cross_validate import cross_validate
from texture_evaluation.cross_validation.splits import Split
from texture_recordings.slide_dataset import SlideDataset

OVERLAPPING_S = 0.1  # windows of LENGTH_S begin so far apart on the robot
CONFIDENCES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.999)


class FrontierJob(NamedTuple):
    """A recipe with windows of a length, which begin so far apart as they are long or LENGTH_S, or overlap."""

    name: str
    length_s: float
    overlap: bool = False

    def recipe(self) -> Recipe:
        """Return the recipe of the job."""
        recipe = comparable(
            with_channels(load_recipe(self.name), 'fast'), RATE_HZ, of_motion=False, length_s=self.length_s
        )
        return every(OVERLAPPING_S, recipe) if self.overlap else recipe


class _Point(NamedTuple):
    """What came of a job."""

    model: TextureModel
    figures: dict[str, Any]
    curve: tuple[Array, Array]  # seconds of sliding, share of slides recognised
    early: tuple[Array, Array]  # mean seconds of sliding, share right, when slides end at CONFIDENCES
    rule: Mapping[str, float]  # the same at the fitted rule


Points = Mapping[str, Mapping[float, _Point]]  # by recipe and length (s) of its windows


def _try(dataset: SlideDataset, split: Split, job: FrontierJob) -> _Point:
    result = cross_validate(job.recipe(), dataset, split.splitter)
    results = result.pooled
    early = decided_at(results, CONFIDENCES)
    rule = metrics.early_decision(results)
    return _Point(result.folds[-1].model, figures_of(result), metrics.curve(results), early, rule)


def try_all(jobs: Sequence[FrontierJob], dataset: SlideDataset, split: Split) -> dict[FrontierJob, _Point]:
    """Return what comes of each job, one on each core; the computing time of windows is taken alone, at the end.

    Parameters
    ----------
    jobs
        What is tried.
    dataset
        The slides.
    split
        Which slides are trained on and tested.

    Returns
    -------
    dict
        What came of each job.
    """
    tried = dict(zip(jobs, map_forked(partial(_try, dataset, split), jobs), strict=True))
    with single_blas_thread():
        latencies = latencies_us({job: (job.recipe(), point.model, dataset) for job, point in tried.items()})
    for job, latency in latencies.items():
        tried[job].figures['latency_us'] = latency
    return tried
