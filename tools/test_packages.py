# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The packages of src/: what each imports is in its manifest, and dependencies run down the table of layers."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import pytest

from texture_core.errors import MissingLibrary

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = sorted(manifest.parent for manifest in ROOT.glob('src/*/package.xml'))
DEPLOYED = [p for p in PACKAGES if p.name not in {'texture_msgs', 'texture_papers', 'texture_benchmarks'}]

# Module → key of rosdep. What is imported under the name of its ROS package needs no line.
KEYS = {
    'aiohttp': 'python3-aiohttp',
    'argcomplete': 'python3-argcomplete',
    'h5py': 'python3-h5py',
    'hypothesis': 'python3-hypothesis',
    'joblib': 'python3-joblib',
    'matplotlib': 'python3-matplotlib',
    'numpy': 'python3-numpy',
    'pytest': 'python3-pytest',
    'rich': 'python3-rich',
    'scipy': 'python3-scipy',
    'serial': 'python3-serial',
    'sklearn': 'python3-sklearn',
    'yaml': 'python3-yaml',
}
# No distribution package has these, and rosdep no key: each is an extra of the package that uses it.
EXTRAS = {
    'distributed': 'distributed',
    'pyarrow': 'pyarrow',
    'pymoo': 'pymoo',
    'rosbags': 'rosbags',
    'apsw': 'rosbags',
    'backports': 'rosbags',
    'lz4': 'rosbags',
    'skops': 'skops',
    'miniaudio': 'miniaudio',
    'rtde_control': 'ur-rtde',
    'rtde_receive': 'ur-rtde',
    'dashboard_client': 'ur-rtde',
}
# What comes with Python or with scikit-learn, or lies in examples/.
OTHERS = {'compression', 'explore_client', 'threadpoolctl'}
# What refuses to be imported without rosbags, in these packages: all that reads or writes bags. The rest of what is
# deployed, above all what moves a robot and what recognises, needs no extra.
NEED_BAGS = {'texture_bringup', 'texture_evaluation', 'texture_recordings', 'texture_simulation'}
WITHOUT_EXTRAS = """
import importlib, sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in sys.argv[1].split():
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)

sys.meta_path.insert(0, Absent())
from texture_core.errors import MissingLibrary
for name in sys.argv[2:]:
    try:
        importlib.import_module(name)
    except MissingLibrary as error:
        print(error)
"""
# What some modules of a package use and its manifest leaves out, so that colcon builds the rest without it: to record
# and to read bags is possible with the messages, the core, the drivers and texture_recordings alone.
OPTIONAL = {
    'texture_recordings': {
        'python3-scipy': {'public_sets', 'readers'},
        'texture_features': {'commands.convert', 'dataset'},
    }
}
# What launch files need, which no module imports.
LAUNCHING = {'launch_ros', 'launch_xml', 'ros2launch'}


@dataclass(frozen=True)
class Layer:
    """What a package may import of the suite, what its tests may in addition, and which libraries it must not need."""

    may: frozenset[str]
    tests: frozenset[str] = frozenset()
    never: frozenset[str] = frozenset()
    # Modules that need a library of `never`, in a function and not when they are imported.
    late: Mapping[str, frozenset[str]] | None = None


def of(*short: str) -> frozenset[str]:
    return frozenset(f'texture_{name}' for name in short)


LEARNING = frozenset({'sklearn', 'skops', 'pymoo', 'joblib', 'distributed'})
DRAWING = frozenset({'matplotlib'})
SCIPY = frozenset({'scipy'})
# As in docs/architecture.md. A package comes after all that it may import, so there can be no cycle.
LAYERS: Mapping[str, Layer] = {
    'texture_msgs': Layer(of()),
    'texture_core': Layer(of('msgs'), never=LEARNING | DRAWING | SCIPY),
    'texture_drivers': Layer(of('msgs', 'core'), never=LEARNING | DRAWING | SCIPY),
    'texture_features': Layer(of('msgs', 'core'), never=LEARNING | DRAWING),
    'texture_estimation': Layer(of('msgs', 'core', 'features'), never=DRAWING | {'rosbags'}),
    'texture_recordings': Layer(
        of('msgs', 'core', 'features'),
        tests=of('drivers'),
        never=LEARNING | DRAWING | SCIPY,
        late={'texture_recordings.public_sets': SCIPY, 'texture_recordings.readers': SCIPY},
    ),
    'texture_simulation': Layer(of('msgs', 'core', 'drivers', 'recordings'), never=LEARNING | DRAWING),
    'texture_exploration': Layer(of('msgs', 'core'), tests=of('features', 'simulation'), never=LEARNING | DRAWING),
    'texture_evaluation': Layer(of('msgs', 'core', 'features', 'estimation', 'recordings'), tests=of('simulation')),
    'texture_bringup': Layer(
        of(
            'msgs', 'core', 'drivers', 'features', 'estimation', 'recordings', 'simulation', 'exploration',
            'evaluation',
        )
    ),
    'texture_papers': Layer(of('msgs', 'core', 'features', 'estimation', 'recordings', 'simulation', 'evaluation')),
    'texture_benchmarks': Layer(
        of(
            'msgs', 'core', 'drivers', 'features', 'estimation', 'recordings', 'simulation', 'exploration',
            'evaluation', 'bringup', 'papers',
        )
    ),
}  # fmt: skip


@cache
def imported(path: Path) -> tuple[frozenset[str], frozenset[str]]:
    """Return the names of all modules that a file imports: when it is imported itself, and only in its functions."""
    tree = ast.parse(path.read_text())
    inner = {
        node
        for function in ast.walk(tree)
        if isinstance(function, (ast.FunctionDef, ast.AsyncFunctionDef))
        for node in ast.walk(function)
    }
    return frozenset(named(set(ast.walk(tree)) - inner)), frozenset(named(inner))


def named(nodes: Iterable[ast.AST]) -> set[str]:
    found = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
    return found


def top(modules: Iterable[str]) -> set[str]:
    return {module.partition('.')[0] for module in modules} - set(sys.stdlib_module_names)


def imports(package: Path, folder: str) -> set[str]:
    """Return what the modules in a folder of a package import from outside Python and the package."""
    files = list((package / folder).rglob('*.py'))
    importable = {path.stem for path in (*files, *ROOT.glob('examples/*.py'))} if folder == 'test' else set()
    return set().union(*(top(at_once | late) for at_once, late in map(imported, files))) - {package.name} - importable


def depends(package: Path, *tags: str) -> set[str]:
    manifest = ElementTree.parse(package / 'package.xml').getroot()
    return {element.text or '' for tag in tags for element in manifest.iter(tag)}


def keys(modules: set[str]) -> set[str]:
    return {KEYS.get(name, name) for name in modules - set(EXTRAS) - OTHERS}


def outside(package: str, modules: set[str], allowed: frozenset[str]) -> set[str]:
    """Return the packages of the suite among the modules that a package may not import."""
    return {name for name in modules if name.startswith('texture_')} - allowed - {package}


each = pytest.mark.parametrize('package', PACKAGES, ids=lambda package: package.name)


@each
def test_a_manifest_names_what_its_package_imports(package: Path) -> None:
    optional = set(OPTIONAL.get(package.name, {}))
    assert keys(imports(package, package.name)) - depends(package, 'exec_depend', 'depend') == optional


@pytest.mark.parametrize('name', OPTIONAL)
def test_what_a_manifest_leaves_out_is_used_in_few_modules(name: str) -> None:
    package = ROOT / 'src' / name
    users: dict[str, set[str]] = {key: set() for key in OPTIONAL[name]}
    for path in (package / name).rglob('*.py'):
        for key in keys(top(frozenset().union(*imported(path)))) & set(users):
            users[key].add('.'.join(path.relative_to(package / name).with_suffix('').parts))
    assert users == OPTIONAL[name]


@each
def test_a_manifest_names_the_extras_that_its_package_imports(package: Path) -> None:
    extras = ElementTree.parse(package / 'package.xml').iter('extra')
    named = {word for extra in extras for word in (extra.text or '').split()}
    text = '\n'.join(path.read_text() for path in (package / package.name).rglob('*.py'))
    used = imports(package, package.name) | set(re.findall(r"(?:library|import_module)\('(\w+)", text))
    assert {EXTRAS[name] for name in used & set(EXTRAS)} - named == set()


@pytest.mark.parametrize('package', DEPLOYED, ids=lambda package: package.name)
def test_what_is_deployed_runs_without_extras_or_states_in_one_sentence_which_it_needs(package: Path) -> None:
    files = sorted((package / package.name).rglob('*.py'))
    modules = ['.'.join(path.relative_to(package).with_suffix('').parts).removesuffix('.__init__') for path in files]
    command = [sys.executable, '-c', WITHOUT_EXTRAS, ' '.join([*EXTRAS, 'h5py']), *modules]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    printed = set(done.stdout.splitlines())
    assert printed == ({str(MissingLibrary('rosbags', 'bags', 'bags'))} if package.name in NEED_BAGS else set())


@each
def test_a_manifest_names_what_its_tests_import(package: Path) -> None:
    assert keys(imports(package, 'test')) - depends(package, 'exec_depend', 'depend', 'test_depend') == set()


@each
def test_a_manifest_names_no_package_of_the_suite_that_nothing_imports(package: Path) -> None:
    text = '\n'.join(path.read_text() for path in package.glob('launch/*.xml'))
    used = imports(package, package.name) | set(re.findall(r'texture_\w+', text))
    named = {name for name in depends(package, 'exec_depend', 'depend') if name.startswith('texture_')}
    assert named - used == set()
    # Tests also start the nodes of others by name.
    text = '\n'.join(path.read_text() for path in package.glob('test/*.py'))
    tested = {name for name in depends(package, 'test_depend') if name.startswith('texture_')}
    assert tested - set(re.findall(r'texture_[a-z]+', text)) == set()


def test_what_runs_launch_files_is_named_where_they_are() -> None:
    for package in PACKAGES:
        if list(package.glob('launch/*.launch.xml')):
            assert depends(package, 'exec_depend') >= LAUNCHING, package.name


def test_the_table_of_layers_has_every_package_once_and_below_what_it_imports() -> None:
    assert set(LAYERS) == {package.name for package in PACKAGES}
    above: set[str] = set()
    for name, layer in LAYERS.items():
        assert layer.may <= above, f'{name} may import what comes after it'
        above.add(name)


@each
def test_a_package_imports_only_what_stands_above_it(package: Path) -> None:
    layer = LAYERS[package.name]
    assert outside(package.name, imports(package, package.name), layer.may) == set()
    assert outside(package.name, imports(package, 'test'), layer.may | layer.tests) == set()
    declared = depends(package, 'exec_depend', 'depend')
    assert outside(package.name, declared, layer.may) == set()


def test_nothing_that_is_deployed_imports_the_benchmarks_or_needs_the_papers() -> None:
    for package in PACKAGES:
        needed = imports(package, package.name) | depends(package, 'exec_depend', 'depend')
        tested = imports(package, 'test') | depends(package, 'test_depend')
        if package.name != 'texture_benchmarks':
            assert 'texture_benchmarks' not in needed | tested
            assert package.name == 'texture_papers' or 'texture_papers' not in needed


@pytest.mark.parametrize('paper', ['roberge', 'rispal', 'jamali', 'kaboli', 'hu'])
def test_a_learner_of_a_paper_is_imported_without_simulation_evaluation_and_drawing(paper: str) -> None:
    code = f'import sys, texture_papers.{paper}; print(*sys.modules)'
    loaded = set(
        subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True).stdout.split()
    )
    assert not loaded & {'texture_simulation', 'texture_evaluation', 'matplotlib', 'sklearn'}


@each
def test_a_package_does_without_the_libraries_that_it_must_not_need(package: Path) -> None:
    layer = LAYERS[package.name]
    for path in (package / package.name).rglob('*.py'):
        at_once, late = imported(path)
        module = '.'.join(path.relative_to(package).with_suffix('').parts)
        allowed = (layer.late or {}).get(module, frozenset())
        assert top(at_once) & layer.never == set(), f'{module} imports it at once'
        assert top(late) & layer.never <= allowed, f'{module} imports it in a function'


def test_the_checks_see_an_import_that_is_not_allowed(tmp_path: Path) -> None:
    code = tmp_path / 'texture_core' / 'texture_core'
    code.mkdir(parents=True)
    (code / 'wrong.py').write_text(
        'import os\nimport scipy.signal\n\ndef late():\n    from texture_features import a\n'
    )
    found = imports(tmp_path / 'texture_core', 'texture_core')
    assert found == {'scipy', 'texture_features'}
    assert outside('texture_core', found, LAYERS['texture_core'].may) == {'texture_features'}
    assert top(imported(code / 'wrong.py')[0]) & LAYERS['texture_core'].never == {'scipy'}
    assert keys(found) == {'python3-scipy', 'texture_features'}


@each
def test_modules_import_each_other_in_no_circle(package: Path) -> None:
    files = {
        '.'.join(path.relative_to(package).with_suffix('').parts).removesuffix('.__init__'): path
        for path in (package / package.name).rglob('*.py')
    }
    graph = {name: within(path, files) - {name} for name, path in files.items()}
    while leaves := {name for name, needed in graph.items() if not needed}:
        graph = {name: needed - leaves for name, needed in graph.items() if name not in leaves}
    assert set(graph) == set()


def within(path: Path, files: Mapping[str, Path]) -> set[str]:
    """Return the modules among `files` that a file imports when it is imported."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module in files:
            parts = {f'{node.module}.{alias.name}' for alias in node.names} & set(files)
            found |= parts or {node.module}
    return found
