"""What a release is made of agrees with itself: versions, dependencies, containers, workflows."""

import ast
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[3]
PACKAGES = sorted(manifest.parent for manifest in ROOT.glob('src/*/package.xml'))
VERSION = ElementTree.parse(PACKAGES[0] / 'package.xml').findtext('version')
# Module → key of rosdep. What is imported under the name of its ROS package needs no line.
KEYS = {
    'hypothesis': 'python3-hypothesis',
    'joblib': 'python3-joblib',
    'aiohttp': 'python3-aiohttp',
    'matplotlib': 'python3-matplotlib',
    'numpy': 'python3-numpy',
    'pytest': 'python3-pytest',
    'rosbags': 'python3-rosbags-pip',
    'scipy': 'python3-scipy',
    'serial': 'python3-serial',
    'sklearn': 'python3-sklearn',
    'yaml': 'python3-yaml',
    'apsw': 'python3-apsw',
    'lz4': 'python3-lz4',
}
# rosdep knows no key for these; docker/requirements.in and tools/requirements.in bring them.
KEYLESS = {'cobs', 'distributed', 'nltk', 'playwright', 'pymoo', 'pywt', 'skops', 'threadpoolctl'}
# What comes with Python or another package, and libraries that only tests of robots import.
OTHERS = {'backports', 'compression', 'dashboard_client', 'rtde_control', 'rtde_receive'}


def names(package: Path, *, tests: bool) -> set[str]:
    """Return the top-level modules that a package's code, or its tests, import from outside Python and itself."""
    found = set()
    for path in (package / ('test' if tests else package.name)).rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name.split('.')[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                found.add(node.module.split('.')[0])
    beside = {path.stem for path in (package / 'test').glob('*.py')} if tests else set()
    return found - set(sys.stdlib_module_names) - {package.name} - KEYLESS - OTHERS - beside


def depends(package: Path, *tags: str) -> set[str]:
    manifest = ElementTree.parse(package / 'package.xml').getroot()
    return {element.text for tag in tags for element in manifest.iter(tag)}


@pytest.mark.parametrize('package', PACKAGES, ids=lambda package: package.name)
def test_a_manifest_names_what_its_package_imports(package: Path) -> None:
    needed = {KEYS.get(name, name) for name in names(package, tests=False)}
    assert needed - depends(package, 'exec_depend', 'depend') == set()


@pytest.mark.parametrize('package', PACKAGES, ids=lambda package: package.name)
def test_a_manifest_names_what_its_tests_import(package: Path) -> None:
    needed = {KEYS.get(name, name) for name in names(package, tests=True)}
    assert needed - depends(package, 'exec_depend', 'depend', 'test_depend') == set()


@pytest.mark.parametrize('package', PACKAGES, ids=lambda package: package.name)
def test_versions_are_in_step(package: Path) -> None:
    assert ElementTree.parse(package / 'package.xml').findtext('version') == VERSION
    headings = re.findall(r'^(.+)\n-{5,}$', (package / 'CHANGELOG.rst').read_text(), re.MULTILINE)
    assert headings[0] == 'Forthcoming' or headings[0].startswith(f'{VERSION} (')


def test_citation_and_image_carry_the_same_version() -> None:
    assert yaml.safe_load((ROOT / 'CITATION.cff').read_text())['version'] == VERSION
    for compose in ('compose.yaml', 'compose.devices.yaml'):
        for service in yaml.safe_load((ROOT / 'docker' / compose).read_text())['services'].values():
            assert service['image'] == f'${{TACTILE_IMAGE:-tactile-texture:{VERSION}}}'


def test_what_ubuntu_lacks_is_locked_in_versions_that_are_tested() -> None:
    tested = set(re.findall(r'^([\w.-]+==[\w.]+)', (ROOT / 'tools' / 'requirements.txt').read_text().lower(), re.M))
    wanted = set(re.findall(r'^([\w.-]+==[\w.]+)', (ROOT / 'docker' / 'requirements.in').read_text().lower(), re.M))
    locked = set(re.findall(r'^([\w.-]+==[\w.]+)', (ROOT / 'docker' / 'requirements.txt').read_text(), re.M))
    assert wanted <= tested
    assert wanted <= locked


def test_an_image_holds_only_what_is_let_through() -> None:
    ignored = (ROOT / 'docker' / 'Dockerfile.dockerignore').read_text().split('\n')
    let_through = {line[1:] for line in ignored if line.startswith('!')}
    copied = re.findall(r'^COPY (?!--from)(?:--\S+ )*(.+) \S+$', (ROOT / 'docker' / 'Dockerfile').read_text(), re.M)
    sources = {name for line in copied for name in line.split()}
    assert '*' in ignored
    assert {Path(source).parts[0] for source in sources} == let_through
    assert all((ROOT / source).exists() for source in sources)


@pytest.mark.parametrize('workflow', sorted(ROOT.glob('.github/workflows/*.yaml')), ids=lambda path: path.name)
def test_a_workflow_ends_and_may_not_write_the_repository(workflow: Path) -> None:
    content = yaml.safe_load(workflow.read_text())
    assert content['permissions'] == {'contents': 'read'}
    for job in content['jobs'].values():
        assert job['timeout-minutes'] <= 60
        assert job.get('permissions', {}).get('contents', 'read') == 'read'


def test_there_are_workflows() -> None:
    assert {path.stem for path in ROOT.glob('.github/workflows/*.yaml')} == {'checks', 'colcon', 'image'}


def test_the_profile_for_loopback_knows_no_other_address() -> None:
    profile = ElementTree.parse(ROOT / 'src/texture_bringup/config/fastdds/loopback.xml')
    named = {element.tag.partition('}')[2]: element.text for element in profile.iter()}
    assert (named['address'], named['useBuiltinTransports']) == ('127.0.0.1', 'false')
    assert [element.text for element in profile.findall('.//{*}type')] == ['UDPv4', 'SHM']


def test_the_profile_for_restarts_shortens_no_lease_and_uses_no_shared_memory() -> None:
    profile = ElementTree.parse(ROOT / 'src/texture_bringup/config/fastdds/restart.xml')
    tags = [element.tag.partition('}')[2] for element in profile.iter()]
    assert 'leaseDuration' not in tags  # a short one loses nodes that live
    assert profile.findall('.//{*}locator/{*}udpv4') and not profile.findall('.//{*}locator/{*}shared_memory')
    announcement, heartbeat = (
        profile.findtext(f'.//{{*}}{name}/{{*}}nanosec') for name in ('leaseAnnouncement', 'heartbeatPeriod')
    )
    assert (announcement, heartbeat) == ('500000000', '200000000')
