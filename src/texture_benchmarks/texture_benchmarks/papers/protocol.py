"""What a paper's experiment was: how each surface was touched, what evaluated it, how it was tested, what came out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.model_selection import (
    BaseCrossValidator,
    RepeatedStratifiedKFold,
    ShuffleSplit,
    StratifiedShuffleSplit,
)

from texture_benchmarks.papers.interval import Interval
from texture_benchmarks.papers.method_result import MethodResult
from texture_estimation.learners.learner import Codes
from texture_features.windowing.windows import WindowParams
from texture_simulation.simulated_slide import SimulatedSlide

Mask = NDArray[np.bool_]
# (surface and condition of each slide, randomness, whether to hurry) -> which slides are used for training, by split
Splitter = Callable[[Codes, NDArray[np.str_], np.random.Generator, bool], Mask]
Table = Sequence[Sequence[float]]


@dataclass(frozen=True)
class View:
    """One of the ways in which a trial measures a surface; the features of all views of a trial are joined."""

    finger: int = 0
    turned_rad: float = 0.0


@dataclass(frozen=True)
class Visits:
    """Trials that are alike, over each surface.

    Parameters
    ----------
    condition
        What they have in common, in words.
    count
        How many over each surface.
    sliding
        How the finger goes.
    views
        What a trial consists of.
    radius_m
        Radius of curvature of all objects, instead of their own; 0 for their own.
    random
        Relative spread of speed and force from trial to trial; above 0, the direction is a random one, too.
    """

    condition: str
    count: int
    sliding: SimulatedSlide
    views: tuple[View, ...] = (View(),)
    radius_m: float = 0.0
    random: float = 0.0


@dataclass(frozen=True)
class Figures:
    """What a paper tells of a method, as shares; None if it does not."""

    learning: float | None = None
    test: float | None = None
    unclassified: float | None = None  # of the test slides


@dataclass(frozen=True)
class Method:
    """A recipe on trial.

    Parameters
    ----------
    recipe
        Its name.
    paper
        What the paper got with it.
    windows
        How slides are cut, trained on and evaluated; None: as the recipe says.
    learner
        Parameters of the learner that this experiment changes.
    features
        Parameters of features, by the feature's name, that it changes.
    stretch_to_m_s, also
        Speed to which the vibration is stretched, and features of it beside those of the recipe.
    label
        Name in the table; '' for that of the recipe.
    views
        Which views of a slide it is given; () for all.
    singly
        Whether the windows are assigned for training one by one, half of them, instead of slide by slide: all slides
        are then tested though parts of each are in the training set: data leakage on purpose, to measure its effect.
    splits
        It is tried on so many of the splits; 0 for all.
    confusion : (n_surfaces, n_surfaces) or (n_surfaces, n_surfaces + 1)
        The paper's table; the last column, if there is one more, counts what is unclassified.
    """

    recipe: str
    paper: Figures = Figures()
    windows: WindowParams | None = None
    learner: Mapping[str, Any] = field(default_factory=dict)
    features: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    stretch_to_m_s: float = 0.0
    also: tuple[str, ...] = ()
    label: str = ''
    views: tuple[int, ...] = ()
    singly: bool = False
    splits: int = 0
    confusion: Table | None = None

    @property
    def name(self) -> str:
        """Name in the table."""
        return self.label or self.recipe


# Decisions do not depend on the calibration, which takes most of the time: two parts will do.
OURS = Method('default', learner={'folds': 2})
FEW = 5  # splits: enough for a method that stands beside the paper's, where it takes long


@dataclass(frozen=True)
class RecognitionTask:
    """Surfaces to tell apart, how they are touched, and what tries to.

    Parameters
    ----------
    name
        In a few words.
    visits
        How each surface is touched.
    methods
        What tries to distinguish them.
    surfaces
        Names; () for all of the scene.
    """

    name: str
    visits: tuple[Visits, ...]
    methods: tuple[Method, ...]
    surfaces: tuple[str, ...] = ()


@dataclass(frozen=True)
class Finding:
    """Something a paper found, and whether it is found here.

    Parameters
    ----------
    claim
        In the paper's sense.
    here
        What was measured here, in words and numbers.
    interval
        What decides, with 95 %.
    holds
        None if the interval does not decide.
    reaches
        Whether the claim is that a figure is reached: it holds where the interval does not lie below 0 as a whole.
    """

    claim: str
    here: str
    interval: Interval
    holds: bool | None
    reaches: bool = False


MethodResults = Mapping[tuple[str, str], MethodResult]  # (task, method) -> what came out


@dataclass(frozen=True)
class Anchor:
    """The one stated figure by which the difficulty of a scene is set: so many test slides are right by this method.

    Parameters
    ----------
    setting
        What of the scene was set by it.
    experiment
        Whose figure it is, if not of the same experiment.
    shortfall
        Why the figure could not be met; '' if it was.
    parts
        The paper's figures of the same method on parts of the same slides, by task: set along with it, no findings.
    """

    task: str
    method: str
    test: float
    source: str
    setting: str = 'noise of the fast channels'
    experiment: str = ''
    shortfall: str = ''
    parts: Mapping[str, float] = field(default_factory=dict)

    @property
    def figures(self) -> Mapping[str, float]:
        """All figures that are set, by task."""
        return {self.task: self.test, **self.parts}


@dataclass(frozen=True)
class PaperProtocol:
    """A paper's experiment.

    Parameters
    ----------
    name, scene
        Of the experiment and of what is touched.
    paper
        Who did it.
    tasks
        What was to be distinguished, by what.
    divide, split
        Which slides are used for training, and that in words.
    anchor
        What the scene's noise was set by.
    findings
        Checks what the paper found.
    by_condition
        Whether the share recognised is also reported for each condition of the test.
    quick_count
        Trials over each surface, instead of those of each of the visits, for tests.
    """

    name: str
    scene: str
    paper: str
    tasks: tuple[RecognitionTask, ...]
    divide: Splitter
    split: str
    anchor: Anchor
    findings: Callable[[MethodResults], Sequence[Finding]]
    quick_count: int = 8
    by_condition: bool = False


def halves(count: int) -> Splitter:
    """Return what draws random halves, each surface halved."""
    return _of(lambda quick, seed: StratifiedShuffleSplit(2 if quick else count, train_size=0.5, random_state=seed))


def _of(make: Callable[[bool, int], BaseCrossValidator]) -> Splitter:
    """Return the splits of one of scikit-learn's splitters, as which slides each trains on."""

    def divide(codes: Codes, conditions: NDArray[np.str_], rng: np.random.Generator, quick: bool) -> Mask:
        parts = list(make(quick, int(rng.integers(2**31))).split(codes, codes))
        trained_on = np.zeros((len(parts), len(codes)), dtype=bool)
        for row, (training, _) in zip(trained_on, parts, strict=True):
            row[training] = True
        return trained_on

    return divide


def folds(count: int, repeats: int) -> Splitter:
    """Return what holds out each part of the slides in turn, each surface assigned at random, several times."""

    def splitter(quick: bool, seed: int) -> BaseCrossValidator:
        of_all: BaseCrossValidator = RepeatedStratifiedKFold(
            n_splits=2 if quick else count, n_repeats=1 if quick else repeats, random_state=seed
        )
        return of_all

    return _of(splitter)


def drawn(share: float, count: int) -> Splitter:
    """Return what draws so large a share of all slides for training, whatever their surface."""
    return _of(lambda quick, seed: ShuffleSplit(2 if quick else count, train_size=share, random_state=seed))


def training_in(condition: str) -> Splitter:
    """Return what is trained on the slides of one condition and tests on all others."""

    def divide(codes: Codes, conditions: NDArray[np.str_], rng: np.random.Generator, quick: bool) -> Mask:
        trained_on: Mask = (conditions == condition)[None, :]
        return trained_on

    return divide
