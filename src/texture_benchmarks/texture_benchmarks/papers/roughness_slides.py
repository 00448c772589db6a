"""Scans of simulated textures with human grades, each simulated once, and what a model says of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from texture_benchmarks.papers.roughness_answers import Answers
from texture_core.arrays import Array
from texture_core.catalogue import find
from texture_core.window import Window
from texture_estimation.roughness.grades import Grades
from texture_estimation.roughness.model import RoughnessModel
from texture_estimation.roughness.roughness_recipe import RoughnessRecipe
from texture_estimation.search.slide_arrays import ArrayStream, SlideArrays
from texture_features.feature_set import FeatureSet
from texture_features.labelled_features import LabelledFeatures
from texture_features.windowing.windows import CutWindow
from texture_simulation.offline import simulate_slides
from texture_simulation.scene import Scene
from texture_simulation.sensors.catalogue import SENSORS
from texture_simulation.simulated_slide import SimulatedSlide

SPEED_M_S, FORCE_N, SCAN_S, USED_S = 0.15, 2.5, 0.7, 0.5


class SimulatedTextures:
    """Scans of textures, described: each texture, speed and force is simulated once.

    Parameters
    ----------
    scene
        What is touched.
    seed
        Of where, and of all effects.
    """

    def __init__(self, scene: Scene, seed: int) -> None:
        self._scene = scene
        self._seed = seed
        self._rate_hz = find(SENSORS, scene.sensor, 'sensor model').fast.rate_hz
        self._channels = find(SENSORS, scene.sensor, 'sensor model').fast.channels
        self._scans: dict[tuple[str, float, float, int], Array] = {}

    def extract(
        self, features: FeatureSet, textures: Sequence[str], count: int, speed_m_s: float, force_n: float
    ) -> LabelledFeatures:
        """Return one window of so many scans over each texture.

        Parameters
        ----------
        features
            What is computed of the windows.
        textures
            Labels.
        count
            Slides over each.
        speed_m_s
            Speed of the finger.
        force_n
            Normal force.

        Returns
        -------
        LabelledFeatures
            One window a slide.
        """
        events = [event for texture in textures for event in self.events(texture, count, speed_m_s, force_n)]
        vectors = features.extract_many(events)
        return LabelledFeatures.from_vectors(vectors, {event.exploration_id: event.surface for event in events})

    def events(self, texture: str, count: int, speed_m_s: float, force_n: float) -> Iterator[CutWindow]:
        """Yield the window of each scan, USED_S long.

        Parameters
        ----------
        texture
            Label.
        count
            Number of slides.
        speed_m_s
            Speed of the finger.
        force_n
            Normal force.

        Yields
        ------
        CutWindow
            One for each slide.
        """
        for number, samples in enumerate(self._measured(texture, count, speed_m_s, force_n)):
            window = Window(samples, self._rate_hz, self._channels, 0, speed_m_s, force_n)
            yield CutWindow(0, f'{texture}/{number}', USED_S, USED_S, {'signal': window}, speed_m_s, force_n, texture)

    def _measured(self, texture: str, count: int, speed_m_s: float, force_n: float) -> Array:
        key = texture, speed_m_s, force_n, count
        if key not in self._scans:
            place = list(self._scene.surfaces).index(texture)
            rng = np.random.default_rng([self._seed, place, round(1e4 * speed_m_s), round(1e3 * force_n), count])
            samples = simulate_slides(self._scene, texture, count, SimulatedSlide(speed_m_s, force_n, SCAN_S), rng)
            self._scans[key] = samples[:, : round(USED_S * self._rate_hz)].astype(np.float64)
        return self._scans[key]

    def scans(self, textures: Sequence[str], count: int, speed_m_s: float, force_n: float) -> SlideArrays:
        """Return the same scans as plain arrays, for a search.

        Parameters
        ----------
        textures
            Labels.
        count
            Slides over each.
        speed_m_s
            Speed of the finger.
        force_n
            Normal force.

        Returns
        -------
        SlideArrays
        """
        samples = np.concatenate([self._measured(texture, count, speed_m_s, force_n) for texture in textures])
        same = np.ones(len(samples))
        streams = {'signal': ArrayStream(samples, self._rate_hz)}
        return SlideArrays(streams, np.repeat(np.array(textures), count), speed_m_s * same, force_n * same)


@dataclass(frozen=True, eq=False)
class Setup:
    """What all parts of the experiment share."""

    simulated: SimulatedTextures
    grades: Grades
    scans: int
    other_scans: int
    splits: int
    seed: int
    quick: bool

    @property
    def textures(self) -> tuple[str, ...]:
        """All textures, in the order of the table."""
        return tuple(self.grades.grades)

    def examples(
        self, recipe: RoughnessRecipe, textures: Sequence[str], speed_m_s: float = SPEED_M_S, force_n: float = FORCE_N
    ) -> LabelledFeatures:
        """Return scans described for a recipe; fewer at other speeds and forces than the trained ones.

        Parameters
        ----------
        recipe
            Names the features.
        textures
            Labels.
        speed_m_s
            Speed of the finger.
        force_n
            Normal force.

        Returns
        -------
        LabelledFeatures
        """
        trained = (speed_m_s, force_n) == (SPEED_M_S, FORCE_N)
        count = self.scans if trained else self.other_scans
        return self.simulated.extract(recipe.feature_set, textures, count, speed_m_s, force_n)

    def ask(self, model: RoughnessModel, examples: LabelledFeatures) -> Answers:
        """Return what a model says of each window."""
        grades, stds = model.grade(examples.values)
        true = np.array([self.grades.of(label) for label in examples.labels])
        return Answers(grades, model.calibration.window_std(stds), true, examples.labels.tolist())
