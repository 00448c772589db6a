# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Each paper as a user repeats it on the emulator: its sensor, motion and recipes, from exploring to a live answer."""

import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

pytestmark = [pytest.mark.benchmark, pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

from ament_index_python import get_package_prefix
from rclpy.parameter import Parameter
from texture_msgs import msg

from texture_bringup.command import main
from texture_bringup.launcher import ChildLauncher
from texture_bringup.operator import Operator
from texture_core import config as resources
from texture_core.config import find_file
from texture_core.ros import (
    ESTIMATE_QOS,
    FEATURE_QOS,
    from_msg,
)
from texture_core.ros_testing import LocalGraph
from texture_core.types import ExplorationRequest
from texture_estimation.model import load_model
from texture_estimation.nodes.classifier import Classifier
from texture_estimation.nodes.roughness_estimator import RoughnessEstimator
from texture_estimation.recipe import load_recipe
from texture_estimation.roughness import (
    load_roughness_recipe,
    read_grades,
    train_grades,
)
from texture_estimation.training import train
from texture_exploration.presets import load_preset
from texture_features.feature_set import FeatureSet, LabelledFeatures
from texture_features.nodes.feature_extractor import FeatureExtractor

DOMAIN = 87
DEADLINE_S = 60.0
SPINNING_S = 150.0  # of one exploration and all estimates of it
TRIES = 3  # a sample that a busy machine loses costs the only window of a slide
SMOOTH, ROUGH = 'glass', 'ridge_2mm_deep'
# This machine may be busy.
PATIENT = {'estimate_timeout_s': 20.0, 'state_timeout_s': 1.5}
ARMS = {
    'ur': {'silence_s': 1.5, 'watchdog_hz': 1.0, 'connect_timeout_s': 30.0},
    # On a busy machine a late command is caught up with, which looks fast.
    'rails': {'peak_speed_fraction': 5.0},
    'hand': {'peak_speed_fraction': 5.0},
    'ros_controllers': {'deadman_s': 1.5, 'connect_timeout_s': 30.0},
}
# Either surface may be named: clusters of so few slides need not be the surfaces.
EITHER = ('kaboli-em', 'kaboli-em-two-fingers')
LEAST_N = {'ros_controllers': 3.0}  # its preset for a first contact refuses the 1 N of Kaboli et al.


@dataclass(frozen=True)
class Paper:
    """What a paper is repeated with; so many slides over each surface are for training.

    Most of the slides over the last surface that follow, so many, are named right live. `recipe` is computed and
    classifies in the launched nodes, those `beside` in nodes of this process.
    """

    sensor: str
    preset: str
    recipe: str
    beside: tuple[str, ...] = ()
    slides: int = 2
    live: int = 1
    robot: str = 'emulator'
    scene: str = 'twelve_textures'
    surfaces: tuple[str, str] = (SMOOTH, ROUGH)
    launch: Mapping[str, str] = field(default_factory=dict)  # further arguments


PAPERS = {
    'Roberge et al., linear': Paper(
        'tsf85_3x4',
        'ets-linear',
        'ets-linear-svm',
        (
            'ets-linear-ann',
            'ets-linear-svm-vote',
            'ets-linear-ann-vote',
        ),
        # A peak that one slide shows and another hides shifts the list of peaks: of machines of two slides over each
        # surface, 37 % of the windows of the last one are wrong, of eight 6 %.
        slides=8,
        live=5,
    ),
    'Roberge et al., variables for each pair': Paper(  # of the textures of their scene
        'tsf85_3x4',
        'ets-linear',
        'ets-linear-svm-pairs',
        ('ets-linear-svm-pairs-vote',),
        slides=8,
        live=3,
        scene='ets_linear',
        surfaces=('ridge_1', 'ridge_2a'),
    ),
    'Roberge et al., circles': Paper('tsf85_3x4', 'ets-circular', 'ets-circular-svm', ('ets-circular-ann',)),
    'Roberge et al., ten textures': Paper(
        'tsf85_3x4', 'ets-ten-textures', 'ets-fine-svm', ('ets-fine-ann',), slides=5, live=3
    ),
    'Jamali & Sammut 2010': Paper(
        'daq',
        'jamali',
        'jamali-naive-bayes-5',
        (
            'jamali-naive-bayes-3',
            'jamali-amplitude',
        ),
        slides=5,  # the variances of naive Bayes
        live=3,
    ),
    'Kaboli et al. 2015, two fingers': Paper(
        'biotac_hand', 'kaboli', 'kaboli-svm-two-fingers', ('kaboli-pa-two-fingers', 'kaboli-em-two-fingers')
    ),
    'Kaboli et al. 2015, one finger': Paper('biotac', 'kaboli', 'kaboli-svm', ('kaboli-pa', 'kaboli-em'), slides=5),
    'Kaboli et al. 2015, two fingers of the emulated hand': Paper(
        'biotac_hand', 'kaboli', 'kaboli-svm-two-fingers', robot='hand'
    ),
    'Hu et al. 2014, film on rails': Paper('pvdf', 'hu-cross', 'hu-pca-svm-xy', slides=1, robot='rails'),
    'Hu et al. 2014': Paper('pvdf', 'hu-cross', 'hu-pca-svm-xy', ('hu-pca-svm',), slides=1),
}
ROUGHNESS = Paper(
    'tsf85',
    'ets-roughness',
    'ets-roughness-ann1',
    ('ets-roughness-ann5', 'ets-roughness-svm5'),
    slides=6,
)


def recipe_file(name: str) -> Path:
    kind = 'roughness' if name.startswith('ets-roughness') else 'recipes'
    return find_file(name, 'texture_estimation', f'config/{kind}', 'recipe')


def described_alike(*recipes: str) -> bool:
    one, other = (FeatureSet.load(str(recipe_file(recipe))).as_mapping() for recipe in recipes)
    return one == other


@dataclass
class Beside:
    """A recipe whose features and estimates are computed in this process, on topics of its own."""

    recipe: str
    node: Any
    vectors: list[Any]
    estimates: list[Any]
    labels: dict[str, str] = field(default_factory=dict)  # of explorations

    @classmethod
    def joining(cls, graph: LocalGraph, recipe: str, main: str, kind: Callable[..., Any] = Classifier) -> 'Beside':
        """Start the nodes of a recipe; features that the main recipe has too are those of the launched node."""
        own = recipe.replace('-', '_')
        _, topic = kind.estimate
        features = 'features' if described_alike(recipe, main) else f'features_{own}'
        renaming = ['--ros-args', '-r', f'features:={features}', '-r', f'{topic}:={topic}_{own}', '-r']
        if features != 'features':
            extractor = partial(FeatureExtractor, cli_args=[*renaming, f'__node:=features_of_{own}'])
            graph.add(extractor, recipe=str(recipe_file(recipe)))
        node = graph.add(partial(kind, cli_args=[*renaming, f'__node:=estimator_of_{own}']))
        vectors = graph.listen(msg.FeatureVector, features, FEATURE_QOS)
        return cls(recipe, node, vectors, graph.listen(kind.estimate[0], f'{topic}_{own}', ESTIMATE_QOS))

    def has_described(self, exploration_id: str) -> bool:
        return any(vector.last and vector.exploration_id == exploration_id for vector in self.vectors)

    def has_window(self, exploration_id: str) -> bool:
        return any(not vector.last and vector.exploration_id == exploration_id for vector in self.vectors)

    def examples(self) -> LabelledFeatures:
        vectors = [from_msg(vector) for vector in self.vectors]
        return LabelledFeatures.from_vectors(vectors, self.labels)

    def use(self, model: Path) -> None:
        [result] = self.node.set_parameters([Parameter('model', value=str(model))])
        assert result.successful, result.reason

    def last_estimate(self, exploration_id: str) -> Any:
        own = [one for one in self.estimates if one.exploration_id == exploration_id and one.final]
        return from_msg(own[-1]) if own else None


class Rig:
    """The emulator, or an emulated robot, with the sensor of a paper, in a ROS domain of its own."""

    def __init__(self, paper: Paper, out: Path) -> None:
        self.paper = paper
        self._out = out
        self._environment = {**os.environ, 'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_LOG_DIR': str(out)}
        parameters = out / 'patient.yaml'
        patient = {**PATIENT, **ARMS.get(paper.robot, {})}
        parameters.write_text(yaml.safe_dump({'/**': {'ros__parameters': patient}}))
        given = {
            'sensor': paper.sensor,
            'devices': out,
            'recipe': recipe_file(paper.recipe),
            'scene': paper.scene,
            'surface': paper.surfaces[0],
            **paper.launch,
            'watch_signal': False,
            'explorer_params': parameters,
        }
        self.launcher = self.started(paper.robot, given)
        self.operator = Operator(domain_id=DOMAIN, guard=self.launcher.check)
        self.graph = LocalGraph(DOMAIN, deadline_s=SPINNING_S)
        self.beside: list[Beside] = []

    def started(self, name: str, given: dict[str, object]) -> ChildLauncher:
        """Return a launch file that is to be started with arguments."""
        return ChildLauncher(name, given, self._environment, self._out / f'{name}.log')

    def join(self, kind: Callable[..., Any] = Classifier) -> None:
        """Start the nodes of the recipes beside, and wait until they hear what moves and what it measures."""
        main = self.paper.recipe
        self.beside = [Beside.joining(self.graph, recipe, main, kind) for recipe in self.paper.beside]
        n_extractors = 1 + sum(not described_alike(recipe, main) for recipe in self.paper.beside)
        self.graph.until(lambda: self.graph.peer.count_subscribers('exploration') >= n_extractors)
        self._meanwhile(self.operator.wait_for_listeners, ('exploration',), n_extractors, self.launcher.check)

    @property
    def request(self) -> ExplorationRequest:
        """The first motion of the preset."""
        return load_preset(self.paper.preset).requests[0]

    def explore(self, surface: str = '') -> tuple[Any, list[Any]]:
        """Explore as the paper did; return the result and the features of the launched nodes."""
        forces = {'force_n': LEAST_N[self.paper.robot]} if self.paper.robot in LEAST_N else {}
        request = replace(self.request, surface=surface, **forces)
        for _ in range(TRIES):
            explored, own = self._meanwhile(self.operator.explore_with_features, request)
            assert explored.success, explored.message
            for one in self.beside:
                self.graph.until(partial(one.has_described, explored.exploration_id))
            lacking = [one.recipe for one in self.beside if not one.has_window(explored.exploration_id)]
            if own and not lacking:
                return explored, own
        raise AssertionError(f'{lacking or self.paper.recipe}: no window of {request}')

    def examples(self) -> LabelledFeatures:
        """Explore both surfaces, and return the features that the launched nodes made of it."""
        vectors, surfaces = [], {}
        for surface in self.paper.surfaces:
            self.operator.set_parameters('emulator', {'surface': surface})
            for _ in range(self.paper.slides):
                explored, own = self.explore(surface)
                vectors += own
                surfaces[explored.exploration_id] = surface
        for one in self.beside:
            one.labels = surfaces
        return LabelledFeatures.from_vectors(vectors, surfaces)

    def named(self, kind: str = 'texture') -> dict[str, Any]:
        """Explore, and return the final estimate of each recipe, texture or roughness."""
        explored, _ = self.explore()
        self.graph.until(lambda: all(one.last_estimate(explored.exploration_id) for one in self.beside))
        beside = {one.recipe: one.last_estimate(explored.exploration_id) for one in self.beside}
        return {self.paper.recipe: getattr(explored, kind), **beside}

    def _meanwhile(self, wait: Callable[..., Any], *given: Any) -> Any:
        """Wait for the launched nodes while those of this process go on."""
        with ThreadPoolExecutor(1) as pool:
            waiting = pool.submit(wait, *given)
            self.graph.until(waiting.done)
        return waiting.result()


@contextmanager
def running(paper: Paper, out: Path, kind: Callable[..., Any] = Classifier) -> Iterator[Rig]:
    rig = Rig(paper, out)
    with rig.launcher, rig.operator, rig.graph:
        rig.operator.wait_for_explorer(DEADLINE_S)
        rig.operator.wait_for_listeners(('features', 'exploration'), 1, rig.launcher.check)
        rig.join(kind)
        yield rig


@pytest.mark.parametrize('paper', PAPERS.values(), ids=PAPERS)
def test_recipes_of_a_paper_train_from_its_motion_and_name_the_surface_live(paper: Paper, tmp_path: Path) -> None:
    with running(paper, tmp_path) as rig:
        model = train(load_recipe(paper.recipe), rig.examples(), 'model').save(tmp_path / 'model')
        rig.operator.set_parameters('classifier', {'model': str(model)})
        for one in rig.beside:
            one.use(train(load_recipe(one.recipe), one.examples(), 'model').save(tmp_path / one.recipe))
        named = [rig.named() for _ in range(paper.live)]
    for recipe in (paper.recipe, *paper.beside):
        estimates = [one[recipe] for one in named]
        assert all(estimate.final for estimate in estimates), recipe
        right = paper.surfaces if recipe in EITHER else paper.surfaces[-1:]
        assert np.mean([estimate.label in right for estimate in estimates]) > 0.5, (recipe, estimates)
        assert estimates[0].evidence_s >= load_recipe(recipe).feature_set.windows.length_s


def test_a_model_of_two_fingers_of_the_emulated_hand_names_a_surface_by_two_others(tmp_path: Path) -> None:
    thumb, index, middle = 'finger0', 'finger1', 'finger2'  # places of the board
    learning = {'finger_set': 'kaboli-train', 'first_finger': index, 'second_finger': middle}
    testing = {'finger_set': 'kaboli-test', 'first_finger': thumb, 'second_finger': index}
    paper = replace(PAPERS['Kaboli et al. 2015, two fingers of the emulated hand'], slides=3)
    for folder in ('learning', 'testing'):
        (tmp_path / folder).mkdir()
    with running(replace(paper, launch=learning), tmp_path / 'learning') as rig:
        model = train(load_recipe(paper.recipe), rig.examples(), 'model').save(tmp_path / 'model')
    with running(replace(paper, launch=testing), tmp_path / 'testing') as rig:
        rig.operator.set_parameters('classifier', {'model': str(model)})
        for surface in paper.surfaces:
            rig.operator.set_parameters('emulator', {'surface': surface})
            assert [rig.named()[paper.recipe].label for _ in range(2)] == [surface] * 2


def test_recipes_of_rispal_et_al_train_from_their_motion_and_grade_the_surface_live(tmp_path: Path) -> None:
    table = tmp_path / 'grades.csv'
    table.write_text(f'texture,grade\n{SMOOTH},1\n{ROUGH},5\n', encoding='utf-8')
    grades = read_grades(table)
    with running(ROUGHNESS, tmp_path, RoughnessEstimator) as rig:
        recipe = load_roughness_recipe(ROUGHNESS.recipe)
        train_grades(recipe, rig.examples(), grades, 'grades').save(tmp_path / 'grades')
        for one in rig.beside:
            model = train_grades(load_roughness_recipe(one.recipe), one.examples(), grades, 'grades')
            one.use(model.save(tmp_path / one.recipe))
        with rig.started('roughness', {'roughness_model': tmp_path / 'grades.json'}) as grading:
            rig.operator.wait_for_listeners(('roughness_features', 'roughness'), 1, grading.check)
            graded = rig.named('roughness')
    for name, roughness in graded.items():
        assert (roughness.valid, roughness.final) == (True, True), (name, roughness)
        assert roughness.grade == pytest.approx(5.0, abs=1.0), name


@pytest.mark.parametrize('robot', [name for name in ARMS if name != 'hand'])  # which is one of the papers above
def test_the_motion_of_kaboli_et_al_gives_two_fingers_on_an_emulated_robot_a_window(robot: str, tmp_path: Path) -> None:
    with running(replace(PAPERS['Kaboli et al. 2015, two fingers'], robot=robot, beside=()), tmp_path) as rig:
        _, [window, *_] = rig.explore()
    assert len(window.values) == 16  # of two fingers, 8 each


def test_the_running_classifier_learns_a_new_object_online_slide_by_slide_as_kaboli_et_al_do(tmp_path: Path) -> None:
    paper = replace(
        PAPERS['Kaboli et al. 2015, one finger'],
        recipe='kaboli-pa',
        beside=(),
        slides=3,
        scene='kaboli',
        surfaces=('orange', 'toothbrush'),
    )
    with running(paper, tmp_path) as rig:
        model = train(load_recipe(paper.recipe), rig.examples(), 'model').save(tmp_path / 'model')
        rig.operator.set_parameters('classifier', {'model': str(model)})
        rig.operator.set_parameters('emulator', {'surface': 'pine_ball'})
        counts = []
        for _ in range(3):
            explored, _ = rig.explore()
            counts.append(rig.operator.add('pine_ball', explored.exploration_id)[0])
        assert 0 < counts[0] < counts[1] < counts[2]
        assert rig.named()[paper.recipe].label == 'pine_ball'


PAGE = Path(__file__).parents[3] / 'docs' / 'papers.md'
EXPLORATION = str(Path(get_package_prefix('texture_exploration')) / 'lib' / 'texture_exploration')
LIVE = re.findall(r'^ {4}texture launch \w+ sensor:=.*(?:\n {4}.*)+', PAGE.read_text(), re.MULTILINE)


@pytest.mark.parametrize('lines', LIVE, ids=[re.search(r'recipe:=(\S+)', lines)[1] for lines in LIVE])
def test_the_live_lines_of_the_page_record_two_surfaces_and_train_a_model_as_printed(
    lines: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('ROS_DOMAIN_ID', str(DOMAIN))
    (tmp_path / 'patient.yaml').write_text(yaml.safe_dump({'/**': {'ros__parameters': {**PATIENT, **ARMS['hand']}}}))
    [launch, *orders] = [shlex.split(line, comments=True) for line in lines.splitlines()]
    own = {'devices': tmp_path, 'explorer_params': tmp_path / 'patient.yaml'}
    given = {**own, **dict(word.split(':=') for word in launch[3:])}
    launcher = ChildLauncher(launch[2], given, dict(os.environ), tmp_path / 'nodes.log')
    with launcher, Operator(domain_id=DOMAIN, guard=launcher.check) as operator:
        operator.wait_for_explorer(DEADLINE_S)
        operator.wait_for_listeners(('features', 'exploration'), 1, launcher.check)
        for order in orders[:-1]:
            if order[1] == 'param':
                operator.set_parameters(order[3].removeprefix('/'), {order[4]: order[5]})
            else:
                presets = subprocess.run(
                    [shutil.which(order[3], path=EXPLORATION), *order[4:]],
                    capture_output=True,
                    text=True,
                    check=False,
                    timeout=300,
                )
                assert presets.returncode == 0, presets.stdout + presets.stderr
    assert main(orders[-1][1:]) == 0
    surfaces = {word.removeprefix('surface:=') for order in orders for word in order if word.startswith('surface:=')}
    assert load_model(tmp_path / orders[-1][-1]).labels == tuple(sorted(surfaces))


def test_every_recipe_of_a_paper_is_tried_above() -> None:
    tried = {recipe for paper in (*PAPERS.values(), ROUGHNESS) for recipe in (paper.recipe, *paper.beside)}
    shipped = {*resources.shipped('texture_estimation', 'config/recipes')}
    shipped |= {*resources.shipped('texture_estimation', 'config/roughness')}
    assert tried == {name for name in shipped if name.startswith(('ets-', 'jamali-', 'kaboli-', 'hu-'))}
