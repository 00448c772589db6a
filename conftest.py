# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rules for every test of the repository, and examples on which tests of several packages train."""

from __future__ import annotations

import os
import re
import resource
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

# Files without such a test are not imported by `-m realtime` and `-m benchmark`: each worker saves seconds.
NAMED_MARKERS = ('realtime', 'benchmark')
SYSTEM = 'texture_bringup'  # the package whose realtime tests start all nodes
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'  # nodes of tests are found by this machine alone


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import only files with a selected test, and doctests only of modules that need no ROS."""
    if collection_path.suffix != '.py' or collection_path.name == 'conftest.py':
        return None
    text = _text(collection_path)
    if collection_path.name.startswith('test_'):
        return True if any(marker not in text for marker in selected_markers(config.getoption('markexpr'))) else None
    needs_ros = bool({'nodes', 'ros', 'ros.py', 'ros_testing.py', 'operator.py'} & set(collection_path.parts))
    return True if config.getoption('doctestmodules') and (needs_ros or '>>> ' not in text) else None


def selected_markers(expression: str) -> list[str]:
    """Return the markers that every test selected by an expression of `-m` must have."""
    terms = [] if re.search(r'\bor\b|[()]', expression) else expression.split(' and ')
    return [marker for marker in NAMED_MARKERS if marker in terms]


def pytest_collection_modifyitems(items: list[pytest.Item], config: pytest.Config) -> None:
    """Refuse a marked test whose file does not name the marker: `-m` would not find it. Spread tests of all nodes."""
    for item in items:
        for marker in NAMED_MARKERS:
            if item.get_closest_marker(marker) and marker not in _text(item.path):
                raise pytest.UsageError(f"{item.path} does not name the marker '{marker}' of its test {item.name}")
    if 'realtime' in selected_markers(config.getoption('markexpr')):
        order = {path: place for place, path in enumerate(spread(list(dict.fromkeys(item.path for item in items))))}
        items.sort(key=lambda item: order[item.path])


def spread(paths: Sequence[Path]) -> list[Path]:
    """Return the files with those that start the whole suite spread over the others.

    A few of them at once need the whole machine, and then samples are lost. The longest are last in the alphabet, so
    they come first.
    """
    system = [path for path in paths if SYSTEM in path.parts][::-1]
    others = [path for path in paths if SYSTEM not in path.parts]
    places = {path: place / len(group) for group in (system, others) for place, path in enumerate(group)}
    return sorted([*system, *others], key=places.__getitem__)


@cache
def _text(path: Path) -> str:
    return path.read_text(encoding='utf-8')


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Fail the run on the build server when a test was skipped: a skipped check counts as no check."""
    reporter = session.config.pluginmanager.get_plugin('terminalreporter')
    skipped = reporter.stats.get('skipped', []) if reporter else []
    if os.environ.get('CI') and skipped and exitstatus == pytest.ExitCode.OK:
        reporter.write_line(f'{len(skipped)} tests were skipped; on the build server every test must run', red=True)
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


FINGERPRINT = 'abcd1234 signal=1000Hz*1'
SIMULATED_SURFACES = ('glass', 'leather', 'ridge_2mm_deep')


def gaussian_examples(
    *,
    seed: int = 0,
    labels: Sequence[str] = ('cork', 'felt', 'wood', 'slate'),
    slides: int = 4,
    windows: int = 8,
    spread: float = 1.0,
    features: int = 6,
) -> Any:
    """Return windows around a centre for each label, with something in common within each slide."""
    from texture_features.feature_set import LabelledFeatures  # noqa: PLC0415  # tests of drivers and tools need none

    rng = np.random.default_rng(seed)
    centres = 2.0 * np.random.default_rng(99).normal(size=(len(labels), features))
    values, names, groups = [], [], []
    for centre, label in zip(centres, labels, strict=True):
        for slide in range(slides):
            common = centre + 0.3 * spread * rng.normal(size=features)
            values.append(common + spread * rng.normal(size=(windows, features)))
            names += [label] * windows
            groups += [f'{label}/{slide}'] * windows
    return LabelledFeatures(
        values=np.concatenate(values),
        labels=np.array(names),
        groups=np.array(groups),
        names=tuple(f'signal/f{number}' for number in range(features)),
        feature_set=FINGERPRINT,
        window_s=0.5,
        hop_s=0.25,
    )


@pytest.fixture(scope='session')
def make_examples() -> Any:
    """Return the function that makes labelled windows."""
    return gaussian_examples


@pytest.fixture(scope='session')
def examples() -> Any:
    """Return labelled windows of four surfaces, of as many slides as a label needs to be accepted."""
    return gaussian_examples(slides=12)


@pytest.fixture(scope='session')
def model(examples: Any) -> Any:
    """Return the default recipe, trained on `examples`."""
    from texture_estimation.recipe import load_recipe  # noqa: PLC0415
    from texture_estimation.training import train  # noqa: PLC0415

    return train(load_recipe('default'), examples)


@pytest.fixture(scope='session')
def graded_windows() -> Any:
    """Return a function that gives values, grades and textures: only the first feature depends on the grade."""

    def made(n_textures: int = 15, windows: int = 20, spread: float = 0.3, seed: int = 0) -> Any:
        rng = np.random.default_rng(seed)
        textures = np.repeat(np.arange(n_textures), windows)
        grades = (1.0 + np.arange(n_textures) % 5)[textures]
        values = np.stack([3.0 * grades, np.zeros(len(grades))], axis=1) + spread * rng.normal(size=(len(grades), 2))
        return values, grades, textures

    return made


@pytest.fixture(scope='session')
def data() -> Path:
    """Return the folder of the recorded data sets; skip a test where there is none."""
    folder = Path(os.environ.get('TEXTURE_DATA') or Path(__file__).resolve().parents[1] / 'shared' / 'data')
    if not folder.is_dir():
        pytest.skip(f'no recorded data in {folder}; set TEXTURE_DATA to its folder')
    return folder


@pytest.fixture
def fill_disk() -> Iterator[Callable[[], None]]:
    """Return what lets no file grow beyond 4 kB until the test ends, as if the disk were full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4000, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture(scope='session')
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of bags: six slides of 1.2 s over each of three simulated surfaces."""
    from texture_simulation.offline import SlidePlan, write_simulated  # noqa: PLC0415

    folder = tmp_path_factory.mktemp('simulated')
    plan = SlidePlan(slides=6, slide_s=1.2)
    write_simulated(folder, plan, np.random.default_rng(5), surfaces=SIMULATED_SURFACES)
    return folder
