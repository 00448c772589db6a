# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a release is made of agrees with itself: versions, containers, workflows."""

import configparser
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from texture_bringup.launcher import STOP, find_launch_file

ROOT = Path(__file__).resolve().parents[3]
PACKAGES = sorted(manifest.parent for manifest in ROOT.glob('src/*/package.xml'))
VERSION = ElementTree.parse(PACKAGES[0] / 'package.xml').findtext('version')


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


def locked(path: str) -> dict[str, tuple[str, str]]:
    """Return version and marker of each package of a lock."""
    rows = re.findall(r'^([\w.-]+)==([\w.]+) ?(?:; ([^\\\n]*))?', (ROOT / path).read_text().lower(), re.M)
    return {name: (version, marker.strip()) for name, version, marker in rows}


def test_what_ubuntu_lacks_is_locked_with_the_versions_and_markers_that_are_tested() -> None:
    tested, extra = locked('tools/requirements.txt'), locked('docker/requirements.txt')
    for name in re.search(r'^names=\((.+)\)$', (ROOT / 'docker' / 'lock.sh').read_text(), re.M)[1].split():
        assert extra[name] == tested[name]
    assert 'python_full_version' in extra['ur-rtde'][1]  # no wheel from Python 3.13 on


def test_a_container_is_stopped_by_the_signal_on_which_launch_ends_its_nodes() -> None:
    dockerfile = (ROOT / 'docker' / 'Dockerfile').read_text()
    assert re.search(r'^CMD \["ros2", "launch"', dockerfile, re.M)
    assert re.findall(r'^STOPSIGNAL (\w+)$', dockerfile, re.M) == ['SIGINT']


def test_an_image_and_an_environment_of_conda_have_the_libraries_that_the_manifests_name() -> None:
    manifests = [ElementTree.parse(package / 'package.xml') for package in PACKAGES]
    keys = {depend.text for manifest in manifests for depend in manifest.iter('exec_depend')}
    libraries = {key for key in keys if key.startswith('python3-')}
    assert libraries <= set(re.findall(r'python3-\w+', (ROOT / 'docker' / 'Dockerfile').read_text()))
    conda = {'serial': 'pyserial', 'sklearn': 'scikit-learn', 'yaml': 'pyyaml', 'matplotlib': 'matplotlib-base'}
    named = {conda.get(name, name) for name in (key.removeprefix('python3-') for key in libraries)}
    assert named <= set(re.findall(r'^([\w-]+) = ', (ROOT / 'pixi.toml').read_text(), re.M))


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


def test_the_service_is_stopped_as_by_ctrl_c_and_never_started_again_by_itself() -> None:
    text = (ROOT / 'src/texture_bringup/config/systemd/tactile-texture.service').read_text()
    unit = configparser.ConfigParser(strict=False, interpolation=None)
    unit.optionxform = str
    unit.read_string(text)
    service = unit['Service']
    # The launcher passes the signal on and kills what is left after 8 s; systemd must wait longer.
    assert (service['KillSignal'], service['KillMode'], service['Restart']) == ('SIGINT', 'mixed', 'no')
    assert int(service['TimeoutStopSec']) > STOP[-1][0]
    assert find_launch_file(re.search(r'TEXTURE_LAUNCH=(\w+)', text)[1]).is_file()
