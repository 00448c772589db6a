# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The site builds without a warning, holds what is made from source, and its examples run."""

from __future__ import annotations

import argparse
import ast
import importlib
import json
import re
import shlex
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
import reference

from texture_bringup.command import installed
from texture_core.config import parameters_of
from texture_core.errors import ExplorationError, MotionRefused
from texture_core.types import ExplorationRequest
from texture_drivers.catalogue import SENSORS
from texture_drivers.sensor import SensorParams
from texture_estimation.model import load_model
from texture_evaluation.evaluate import evaluate
from texture_evaluation.train import train_from_bags
from texture_exploration.arms.simulated import SimulatedArm, SimulatedArmParams
from texture_exploration.exploration import Exploration
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams
from texture_features.windows import WindowBatch
from texture_simulation.offline import SlidePlan, write_simulated

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / 'docs'
EXAMPLE = re.compile(r'```\w+\n# my_textures/(\S+)\n(.*?)```', re.DOTALL)
PARAM_FIELD = re.compile(r'^    (\w+): .+ = param\(', re.MULTILINE)


@pytest.fixture(scope='module')
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp('site')
    built = subprocess.run([sys.executable, DOCS / 'build.py', out], capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    assert not built.stderr
    return out


@pytest.mark.ros
def test_every_page_is_in_the_site_and_reached_from_the_first(site: Path) -> None:
    first = (site / 'docs' / 'index.html').read_text()
    folders = ('.', 'reference', 'appendix')
    for page in [path for folder in folders for path in DOCS.glob(f'{folder}/*.md')]:
        name = page.relative_to(DOCS).with_suffix('.html')
        assert (site / 'docs' / name).exists()
        assert page.stem == 'index' or f'href="{name}"' in first


@pytest.mark.ros  # the parameters of nodes are read from the nodes
def test_the_reference_in_the_repository_is_what_the_source_makes() -> None:
    assert reference.stale() == []


@pytest.mark.ros
def test_the_site_loads_nothing_from_elsewhere(site: Path) -> None:
    for page in site.rglob('*.html'):
        assert not re.findall(r'<(?:script|img|iframe)[^>]+src="(?:https?:)?//[^"]*"', page.read_text()), page
        assert not re.findall(r'<link[^>]+rel="stylesheet"[^>]+href="(?:https?:)?//[^"]*"', page.read_text()), page


@pytest.mark.ros
def test_the_page_of_messages_has_every_field(site: Path) -> None:
    page = (site / 'docs' / 'reference' / 'messages.html').read_text()
    for path in [path for kind in ('msg', 'srv', 'action') for path in (ROOT / 'src/texture_msgs' / kind).iterdir()]:
        assert f'id="{path.stem.lower()}' in page
        for field in re.findall(r'^[\w/\[\]]+ (\w+)', path.read_text(), re.MULTILINE):
            assert field in page


@pytest.mark.ros
def test_the_page_of_parameters_has_every_one_that_the_code_makes(site: Path) -> None:
    page = (site / 'docs' / 'reference' / 'parameters.html').read_text()
    missing = [
        f'{path.name}: {name}'
        for path in sorted(ROOT.glob('src/*/texture_*/**/*.py'))
        for name in PARAM_FIELD.findall(path.read_text())
        if f'<span class="pre">{name}</span>' not in page
    ]
    assert missing == []


@pytest.mark.ros
def test_figures_of_the_papers_are_those_of_the_charts(site: Path) -> None:
    page = (site / 'docs' / 'reference' / 'papers.html').read_text()
    shown = (('ets-linear', 'linear slides', 'ets-linear-svm'), ('hu', 'five linens', 'hu-pca-svm-xy'))
    for name, task, recipe in shown:
        figures = json.loads((DOCS / 'charts' / f'{name}.json').read_text())['numbers']['tasks'][task][recipe]
        assert f'{100 * figures["paper"]["test"]:.1f} %' in page
        assert f'{100 * figures["test"][0]:.1f} %' in page
    regressors = json.loads((DOCS / 'charts' / 'roughness.json').read_text())['numbers']['regressors']
    assert all(f'{regressor["unseen"]["error"]:.2f}' in page for regressor in regressors.values())


def free_port() -> int:
    """Return a UDP port on which nothing listens."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def examples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Write the examples of the page on extending into a package."""
    folder = tmp_path / 'my_textures'
    folder.mkdir()
    for name, text in EXAMPLE.findall((DOCS / 'extending.md').read_text()):
        (folder / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    yield folder
    for name in [name for name in sys.modules if name.split('.')[0] == 'my_textures']:
        del sys.modules[name]


def test_the_sensor_of_the_page_delivers_and_counts_what_is_lost(examples: Path) -> None:
    finger_class = importlib.import_module('my_textures.udp_finger').UdpFinger
    port = free_port()
    finger = finger_class(SensorParams(device=str(port)), time.time_ns)
    finger.open()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for first in (0, 20, 60):
            samples = np.arange(first, first + 20, dtype='<f4')
            sender.sendto(first.to_bytes(8, 'little') + samples.tobytes(), ('127.0.0.1', port))
    batches = [batch for _ in range(3) for batch in finger.read()['signal']]
    finger.close()
    assert [batch.first_sample for batch in batches] == [0, 20, 60]
    assert all(batch.samples[0, 0] == batch.first_sample for batch in batches)
    assert finger.counts == {'samples': 60, 'lost': 20, 'reopened': 0}
    assert set(SENSORS['daq'](SensorParams(), time.time_ns).counts) >= set(finger.counts)


def test_the_files_that_the_page_on_extending_names_exist() -> None:
    named = re.findall(r'(?:src/)?(texture_\w+/[\w/]+\.py)', (DOCS / 'extending.md').read_text())
    assert len(named) > 10
    paths = {name: [ROOT / 'src' / name, ROOT / 'src' / name.split('/')[0] / name] for name in named}
    assert [name for name, found in paths.items() if not any(path.exists() for path in found)] == []


def test_the_emulated_sensor_of_the_page_passes_its_test(examples: Path) -> None:
    path = examples / 'test_udp_finger.py'
    text = path.read_text()
    assert text.count('port = 5006 ') == 1
    path.write_text(text.replace('port = 5006 ', f'port = {free_port()} '))
    module = importlib.import_module('my_textures.test_udp_finger')
    module.test_a_slide_arrives_as_it_was_sent_and_a_lost_datagram_is_counted()


def test_the_motion_of_the_page_slides_along_its_bows(examples: Path) -> None:
    snake = importlib.import_module('my_textures.snake').snake
    now_ns, states, places = 1_000_000_000, [], []
    arm = SimulatedArm(SimulatedArmParams(), clock=lambda: now_ns, own_thread=False)
    arm.connect()

    def pace() -> None:
        nonlocal now_ns
        for _ in range(2):
            now_ns += 5_000_000
            arm.step(0.005)

    def note(state: object) -> None:
        states.append(state)
        places.append(arm.state().position)

    request, limits = ExplorationRequest('snake'), SafetyLimits()
    motion = snake(request, arm.state().position, TouchParams(), limits)
    exploration = Exploration(
        'one', request, arm=arm, motion=motion, limits=limits, clock=lambda: now_ns, on_state=note
    )
    exploration.run(pace)
    assert exploration.outcome.success
    slid = [place for state, place in zip(states, places, strict=True) if state.phase.value == 'slide']
    assert max(y for _, y, _ in slid) == pytest.approx(0.02, abs=0.001)
    assert min(y for _, y, _ in slid) == pytest.approx(-0.02, abs=0.001)


@pytest.mark.parametrize(
    ('numbers', 'field', 'allowed'),
    [
        ({'speed_m_s': 0.25, 'radius_m': 0.01}, 'speed_m_s', '0.224'),  # the root of 5 m/s² times the radius
        ({'radius_m': 0.06}, 'radius_m', '0.050'),
        # Three half circles of 0.04 m in 0.15 m; the ramps of 0.1 s and the steady 0.05 s take 0.008 m.
        ({'distance_m': 0.2}, 'distance_m', '0.181'),
    ],
)
def test_the_motion_of_the_page_refuses_with_the_field_and_what_is_allowed(
    examples: Path, numbers: Mapping[str, float], field: str, allowed: str
) -> None:
    snake, limits = importlib.import_module('my_textures.snake').snake, SafetyLimits(x_high_m=0.15, y_low_m=-0.05)
    with pytest.raises(MotionRefused, match=rf'allowed is at most {allowed} m') as refused:
        snake(ExplorationRequest('snake', **numbers), (0.0, 0.0, 0.01), TouchParams(), limits)
    assert refused.value.field == field
    outside = field != 'speed_m_s'
    assert refused.value.error == (ExplorationError.OUTSIDE_WORKSPACE if outside else ExplorationError.INVALID_REQUEST)


def test_the_feature_of_the_page_counts_the_crossings_of_a_tone(examples: Path) -> None:
    crossings = importlib.import_module('my_textures.crossings').Crossings()
    tone = np.sin(2 * np.pi * 50 * np.arange(1000) / 1000 + 0.1)[:, None]
    assert crossings(WindowBatch(tone, 1000.0)).shape == (1, 1)
    assert crossings(WindowBatch(tone, 1000.0)).item() == pytest.approx(100, abs=1)
    assert [parameter.name for parameter in parameters_of(type(crossings))] == ['level']


def test_the_recipe_of_the_page_learns_and_recognises(examples: Path, tmp_path: Path) -> None:
    plan = SlidePlan(slides=4, slide_s=1.0)
    bags = write_simulated(tmp_path, plan, np.random.default_rng(0), surfaces=('leather', 'ridge_2mm_deep'))
    train_from_bags(str(examples / 'my-recipe.yaml'), bags, '1-3', tmp_path / 'model')
    report = evaluate(load_model(str(tmp_path / 'model')), bags, slides='4')
    assert report.as_json()['window_accuracy'] == 1.0


def test_the_learner_of_the_page_learns_and_recognises(examples: Path, tmp_path: Path) -> None:
    text = (examples / 'my-recipe.yaml').read_text()
    (entry,) = re.findall(r'^    learner: (.*nearest_mean.*)$', (DOCS / 'extending.md').read_text(), re.MULTILINE)
    recipe = tmp_path / 'own.yaml'
    recipe.write_text(re.sub(r'^learner: .*$', f'learner: {entry}', text, flags=re.MULTILINE))
    plan = SlidePlan(slides=4, slide_s=1.0)
    bags = write_simulated(tmp_path, plan, np.random.default_rng(0), surfaces=('leather', 'ridge_2mm_deep'))
    train_from_bags(str(recipe), bags, '1-3', tmp_path / 'model')
    model = load_model(str(tmp_path / 'model'))
    assert model.parameters['sharpness'] == 2.0
    assert model.training['held_out_window_accuracy'] == 1.0
    assert evaluate(model, bags, slides='4').as_json()['window_accuracy'] == 1.0


def test_the_learner_of_the_page_holds_nothing_out_where_a_label_has_a_single_window(examples: Path) -> None:
    learner = importlib.import_module('my_textures.nearest_mean').NearestMean()
    values, codes = np.array([[0.0], [0.1], [1.0]]), np.array([0, 0, 1])
    fitted = learner.fit(values, codes, np.array([0, 1, 2]))
    assert fitted.held_out is None
    predicted = learner.predictor(fitted.parameters)(values)
    assert predicted.argmax(axis=1).tolist() == codes.tolist()
    np.testing.assert_allclose(np.exp(predicted).sum(axis=1), 1.0)


def texts(path: Path) -> Iterator[str]:
    """Yield every text of a file, with … where something is filled in."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.JoinedStr):
            yield ''.join(str(part.value) if isinstance(part, ast.Constant) else '…' for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value.replace('%s', '…')


def test_the_sentences_in_troubleshooting_are_those_of_the_programs() -> None:
    spoken = '\n'.join(text for path in ROOT.glob('src/texture_*/texture_*/**/*.py') for text in texts(path))
    tables = (('operate', '## Troubleshooting'), ('integrate', '## The first ten faults'))
    rows = '\n'.join((DOCS / f'{page}.md').read_text().partition(heading)[2] for page, heading in tables)
    quoted = re.findall(r'^\| `([^`]+)`', rows, re.MULTILINE)
    assert len(quoted) > 30
    assert [sentence for sentence in quoted if sentence not in spoken] == []


def commands(start: str) -> list[tuple[str, str]]:
    """Return the lines of the pages that begin with `start`, without comments, each with its page."""
    pages = [ROOT / 'README.md', *DOCS.glob('**/*.md'), *ROOT.glob('src/*/README.md')]
    line = re.compile(rf'^ *(?:\.venv/bin/)?({start} [^\n`|]*)$', re.MULTILINE)
    found = [(page, match) for page in pages for match in line.findall(page.read_text())]
    return sorted({(str(page.relative_to(ROOT)), re.sub(r'\s+#.*', '', match)) for page, match in found})


@pytest.mark.parametrize(('page', 'line'), commands('texture'))
def test_a_command_of_the_pages_has_the_arguments_that_it_takes(page: str, line: str) -> None:
    _, name, *rest = shlex.split(line)
    parser = argparse.ArgumentParser(exit_on_error=False)
    module = installed()[name].load()
    module.configure(parser)
    options = parser.parse_args(rest)
    if name == 'launch':
        given = [text for text in options.arguments if ':=' in text]
        assert {text.split(':=')[0] for text in given} <= launch_arguments(options.file)


def options_of(parser: argparse.ArgumentParser) -> set[str]:
    """Return all options of a parser and of its sub-commands."""
    below = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    names = {option for action in parser._actions for option in action.option_strings}
    return names.union(*(options_of(found) for action in below for found in action.choices.values()))


def test_every_option_that_a_page_names_is_one_of_a_command() -> None:
    known = {'--version', '--check'}  # of `texture` itself and of the tools
    for entry in installed().values():
        parser = argparse.ArgumentParser()
        entry.load().configure(parser)
        known |= options_of(parser)
    pages = [ROOT / 'README.md', *DOCS.glob('*.md')]
    named = {(page.name, option) for page in pages for option in re.findall(r'`(--[a-z][\w-]*)', page.read_text())}
    assert sorted(found for found in named if found[1] not in known | OF_OTHERS) == []


OF_OTHERS = {'--build-arg'}  # docker


def launch_arguments(name: str) -> set[str]:
    """Return the arguments that a launch file of the suite declares, with those of the files it includes."""
    text = (ROOT / 'src/texture_bringup/launch' / f'{name}.launch.xml').read_text()
    names = set(re.findall(r'<arg name="(\w+)" (?:default|description)=', text))
    included = re.findall(r'<include file="\S+ texture_bringup\)/launch/(\w+)\.launch', text)
    return names.union(*(launch_arguments(name) for name in included))


@pytest.mark.parametrize(('page', 'line'), commands('ros2 run'))
def test_a_node_of_the_pages_exists(page: str, line: str) -> None:
    package, executable = line.split()[2:4]
    assert (ROOT / 'src' / package / package / 'nodes' / f'{executable}.py').exists()


def test_no_page_names_a_place_of_its_authors() -> None:
    pages = [ROOT / 'README.md', *DOCS.glob('**/*.md'), *ROOT.glob('src/*/README.md')]
    assert [page for page in pages if re.search(r'/work/|/root/', page.read_text())] == []
