"""What a search is for: which recipes it varies, and how one of them is tried."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, TypeVar

from texture_core.arrays import Array
from texture_estimation.search.halves import Mask
from texture_estimation.search.labelled_windows import LabelledWindows
from texture_estimation.search.racing import FitnessFunction
from texture_features.feature_set import FeatureSet
from texture_features.windowing.windows import WindowParams


class Searchable(Protocol):
    """A recipe of any kind, as a file holds it."""

    @property
    def name(self) -> str:
        """Of the recipe."""

    @property
    def feature_set(self) -> FeatureSet:
        """Windows, inputs and features."""

    @property
    def training_windows(self) -> WindowParams:
        """How the windows are cut that are used for training."""

    def as_mapping(self) -> dict[str, Any]:
        """Return what a file holds."""

    @classmethod
    def from_mapping(cls, content: Mapping[str, Any], name: str) -> Any:
        """Build from what a file holds."""


R = TypeVar('R', bound=Searchable)
R_contra = TypeVar('R_contra', bound=Searchable, contravariant=True)


class SearchTask(Protocol[R_contra]):
    """Tries recipes of one kind; see `telling_apart` and `grading`."""

    def feature_set_of(self, recipe: R_contra) -> FeatureSet:
        """Return the features that are used for training, with the windows of the training."""

    def fitness_function(
        self, recipe: R_contra, values: Array, examples: LabelledWindows, halves: Mask, *, quick: bool
    ) -> FitnessFunction:
        """Return the trial of a recipe.

        Parameters
        ----------
        recipe
            What is tried.
        values : (n, n_features)
            Of the features of `extracted`.
        examples
            The windows, (n,) of them.
        halves : (n_halves, n)
            Which windows are used for training in each half.
        quick
            Whether a quick stand-in will do, or the learner itself is wanted.

        Returns
        -------
        FitnessFunction
            Gives the accuracies on each half.
        """

    def cost(self, recipe: R_contra, n_samples: int, n_values: int, examples: LabelledWindows) -> float:
        """Return about how many operations a window costs, of so many samples and values.

        Parameters
        ----------
        recipe
            What is tried.
        n_samples
            Samples of a window, all channels together.
        n_values
            Values of all features.
        examples
            The windows, which say how many labels and examples there are.

        Returns
        -------
        float
            Additions and multiplications.
        """
