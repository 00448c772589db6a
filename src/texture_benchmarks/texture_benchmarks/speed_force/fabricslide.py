"""Fabrics under slow taxels at forces, speeds and in directions that were not in the training set.

Each fabric was mounted once, and the shares of the load among the taxels know the mounting, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from texture_benchmarks.speed_force.conditions import extracted, slide_trial, speed_mm_s
from texture_benchmarks.speed_force.held_out import (
    EvaluateSplit,
    HeldOutResult,
    Mask,
    one_out,
    recognised,
    run,
    run_chosen,
)
from texture_benchmarks.speed_force.nuisance_projection import NuisanceProjection
from texture_core.arrays import AnyArray, Array
from texture_estimation.learners.learner import Learner
from texture_estimation.learners.svm_rbf import SvmRbf
from texture_features.feature import Feature, WindowBatch
from texture_features.features.centred_log_ratio import CentredLogRatio
from texture_features.features.mean_spatial_bands import MeanSpatialBands
from texture_recordings.slide_dataset import SlideDataset
from texture_recordings.slide_samples import SlideSamples

COMPLETE = ('BeigeCotton', 'BrownCotton', 'Canvas', 'Linen')  # of all forces, speeds and directions
START_ROWS = 3  # of the touch before the finger moves: 84 ms
ENERGIES = (0.0, 0.8, 0.9, 0.95, 0.98)  # how much of the turn is taken out; 0 for none of it
# Waves that 35.7 rows a second reach at 150 mm/s, and as long as a run shows some of.
BANDS = MeanSpatialBands(bands=16, longest_m=0.2, shortest_m=8.5e-3, floor=1e-4)


@dataclass(frozen=True, eq=False)
class Fabricslide:
    """The protocols on one set of slides.

    Parameters
    ----------
    dataset
        The slides, with their touch before they begin.
    learner
        What learns the loads; they are of one kind, and what a turn has left of a taxel is not to be blown up.
    energies
        How much of the turn is taken out, of which the training chooses.
    """

    dataset: SlideDataset
    learner: Learner = field(default_factory=lambda: SvmRbf(common_scale=True))
    energies: Sequence[float] = ENERGIES

    @cached_property
    def samples(self) -> list[SlideSamples]:
        """Samples of each slide."""
        return self.dataset.samples('signal_static')

    def splits(self) -> dict[str, dict[str, tuple[Mask, Mask]]]:
        """Return train and test slides by protocol and by what is left out.

        Returns
        -------
        dict
            Protocol → what is left out → train and test slides, (n_slides,) bool each.
        """
        return {
            'one force out': one_out(self.dataset.condition('force')),
            'one speed out': one_out(speed_mm_s(self.dataset)),
            'one direction out': one_out(np.copysign(1.0, np.sin(self.dataset.condition('direction')))),
        }

    def loads(self) -> dict[str, HeldOutResult]:
        """Return how slides are recognised from the shares of the load; no speed is needed.

        How much of what a turn changes is taken out is chosen within the training: for forces and speeds by leaving
        another one out; for directions by slides of another force whose finger has not moved yet, as there is no other
        direction for training.
        """
        starts, steady = self._shares()
        slides = {f'{energy:.0%}': self._load_trial(starts, steady, energy) for energy in self.energies}
        touches = {f'{energy:.0%}': self._load_trial(starts, steady, energy, starts) for energy in self.energies}
        force, speed = self.dataset.condition('force'), speed_mm_s(self.dataset)
        inner = {
            'one force out': (slides, [force]),
            'one speed out': (slides, [speed]),
            'one direction out': (touches, [force]),
        }
        return {
            name: run_chosen(slides, parts, inner[name][1], inner[name][0]) for name, parts in self.splits().items()
        }

    def loads_as_they_are(self) -> dict[str, HeldOutResult]:
        """Return the same with nothing taken out."""
        trial = self._load_trial(*self._shares(), energy=0.0)
        return {name: run(trial, parts) for name, parts in self.splits().items()}

    def bands(self) -> dict[str, HeldOutResult]:
        """Return how slides are recognised without the pattern: from mean bands of waves per metre."""
        windows = [slide.windows() for slide in self.samples]
        trial = slide_trial(self.dataset, SvmRbf(), extracted([BANDS], windows))
        return {name: run(trial, parts) for name, parts in self.splits().items()}

    def _shares(self) -> tuple[Array, Array]:
        """Return the load when each finger is about to slide and while it slides, (n, n_taxels)."""
        slides = self.samples
        share: Sequence[Feature] = [CentredLogRatio()]
        starts = extracted(share, [WindowBatch(slide.before[:START_ROWS], slide.rate_hz) for slide in slides])
        return starts, extracted(share, [slide.windows() for slide in slides])

    def _load_trial(self, starts: Array, steady: Array, energy: float, tested: Array | None = None) -> EvaluateSplit:
        surfaces, names = self.dataset.labels, self.dataset.names
        asked: AnyArray = steady if tested is None else tested

        def trial(train: Mask, test: Mask) -> Mask:
            free = NuisanceProjection.fit(starts[train], steady[train], energy)
            return recognised(
                self.learner, (free(steady[train]), surfaces[train], names[train]), (free(asked[test]), surfaces[test])
            )

        return trial
