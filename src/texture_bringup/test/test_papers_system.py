"""Each paper as a user repeats it on the emulator: its sensor, motion and recipe, from exploring to a live answer."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

pytestmark = [pytest.mark.benchmark, pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

from texture_bringup.demo.isolation import free_port  # noqa: E402
from texture_bringup.ros.operator import Operator  # noqa: E402
from texture_core.exploration import ExplorationRequest  # noqa: E402
from texture_core.resources import folder  # noqa: E402
from texture_estimation.classification.training import train  # noqa: E402
from texture_estimation.recipe import load_recipe  # noqa: E402
from texture_estimation.roughness.grades import read_grades  # noqa: E402
from texture_estimation.roughness.roughness_recipe import load_roughness_recipe  # noqa: E402
from texture_estimation.roughness.training import train_grades  # noqa: E402
from texture_exploration.presets import load_preset  # noqa: E402
from texture_features.labelled_features import LabelledFeatures  # noqa: E402
from texture_launch.child import ChildLauncher  # noqa: E402

DOMAIN = 87
DEADLINE_S = 60.0
SMOOTH, ROUGH = 'glass', 'ridge_2mm_deep'


@dataclass(frozen=True)
class Paper:
    """What a paper is repeated with; so many slides over each surface are for training."""

    sensor: str
    preset: str
    recipe: str
    slides: int = 2


PAPERS = {
    'Roberge et al., textures': Paper('tsf85_3x4', 'ets-linear', 'ets-linear-svm'),
    'Jamali & Sammut 2010': Paper('daq', 'jamali', 'jamali-naive-bayes-5', slides=1),
    'Kaboli et al. 2015': Paper('biotac_hand', 'kaboli', 'kaboli-svm-two-fingers'),
    'Hu et al. 2014': Paper('pvdf', 'hu-cross', 'hu-pca-svm-xy', slides=1),
}
ROUGHNESS = Paper('tsf85', 'ets-roughness', 'ets-roughness-ann1')


class Rig:
    """The emulator with the sensor of a paper, in a ROS domain of its own."""

    def __init__(self, paper: Paper, recipe: str, out: Path) -> None:
        self.paper = paper
        self._out = out
        self._environment = {**os.environ, 'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_LOG_DIR': str(out)}
        given = {'sensor': paper.sensor, 'device': out / 'sensor', 'finger_port': free_port(), 'recipe': recipe}
        self.launcher = self.started('emulator', {**given, 'surface': SMOOTH, 'watch_signal': False})
        self.operator = Operator(domain_id=DOMAIN, guard=self.launcher.check)

    def started(self, name: str, given: dict[str, object]) -> ChildLauncher:
        """Return a launch file that is to be started with arguments."""
        return ChildLauncher(name, given, self._environment, self._out / f'{name}.log')

    @property
    def request(self) -> ExplorationRequest:
        """The first motion of the preset."""
        return load_preset(self.paper.preset).requests[0]

    def examples(self) -> LabelledFeatures:
        """Explore both surfaces as the paper did, and return the features that the running nodes made of it."""
        vectors, surfaces = [], {}
        for surface in (SMOOTH, ROUGH):
            self.operator.set_parameters('emulator', {'surface': surface})
            for _ in range(self.paper.slides):
                explored, own = self.operator.explore_with_features(replace(self.request, surface=surface))
                assert explored.success, explored.message
                assert own, f'{self.paper.recipe} has no window of {self.request}'
                vectors += own
                surfaces[explored.exploration_id] = surface
        return LabelledFeatures.from_vectors(vectors, surfaces)


@contextmanager
def running(paper: Paper, recipe: str, out: Path) -> Iterator[Rig]:
    rig = Rig(paper, recipe, out)
    with rig.launcher, rig.operator:
        rig.operator.wait_for_explorer(DEADLINE_S)
        rig.operator.wait_for_listeners(('features', 'exploration'), 1, rig.launcher.check)
        patient = {'estimate_timeout_s': 20.0, 'state_timeout_s': 1.5}  # this machine may be busy
        rig.operator.set_parameters('explorer', patient)
        yield rig


@pytest.mark.parametrize('paper', PAPERS.values(), ids=PAPERS)
def test_the_recipe_of_a_paper_trains_from_its_motion_and_names_the_surface_live(paper: Paper, tmp_path: Path) -> None:
    with running(paper, paper.recipe, tmp_path) as rig:
        model = train(load_recipe(paper.recipe), rig.examples(), 'model').save(tmp_path / 'model')
        rig.operator.set_parameters('classifier', {'model': str(model)})
        explored = rig.operator.explore(rig.request)
    assert explored.success, explored.message
    assert (explored.texture.label, explored.texture.final) == (ROUGH, True), explored.texture.message
    assert explored.texture.evidence_s >= load_recipe(paper.recipe).feature_set.windows.length_s


def test_the_recipe_of_rispal_et_al_trains_from_their_motion_and_grades_the_surface_live(tmp_path: Path) -> None:
    grades = tmp_path / 'grades.csv'
    grades.write_text(f'texture,grade\n{SMOOTH},1\n{ROUGH},5\n', encoding='utf-8')
    recipe = load_roughness_recipe(ROUGHNESS.recipe)
    windows = folder('texture_estimation', 'config/roughness') / f'{ROUGHNESS.recipe}.yaml'
    with running(ROUGHNESS, str(windows), tmp_path) as rig:
        train_grades(recipe, rig.examples(), read_grades(grades), 'grades').save(tmp_path / 'grades')
        with rig.started('roughness', {'roughness_model': tmp_path / 'grades.json'}) as grading:
            rig.operator.wait_for_listeners(('roughness_features', 'roughness'), 1, grading.check)
            roughness = rig.operator.explore(rig.request).roughness
    assert (roughness.valid, roughness.final) == (True, True), roughness
    assert roughness.grade == pytest.approx(5.0, abs=1.0)
