# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The set-up of the workspace, as far as it decides something."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import workspace


@pytest.mark.parametrize('sourced', ['', 'jazzy', 'lyrical'])
def test_no_ros_jazzy_and_lyrical_are_taken(sourced: str) -> None:
    assert workspace.checked_distribution(sourced) == sourced


def test_another_distribution_is_refused_with_what_to_do(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    monkeypatch.setenv('ROS_DISTRO', 'humble')
    assert workspace.main() == 2
    output = capsys.readouterr().err
    assert "ROS 2 'humble' is sourced in this shell" in output
    assert 'source /opt/ros/jazzy/setup.bash' in output


def test_the_python_of_an_environment_is_kept_whatever_runs_the_set_up(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    home = tmp_path / 'home'
    home.mkdir()
    other = home / 'python3.12'
    other.write_text('#!/bin/sh\necho 3 12\n')
    other.chmod(0o755)
    monkeypatch.setattr(workspace, 'VENV', tmp_path)
    assert workspace.own_interpreter() == []
    (tmp_path / 'pyvenv.cfg').write_text(f'home = {home}\nversion = 3.12.1\n')
    assert workspace.choose_interpreter(workspace.own_interpreter()) == (str(other), (3, 12))
    other.unlink()
    assert workspace.choose_interpreter(workspace.own_interpreter()) == (sys.executable, sys.version_info[:2])


@pytest.mark.parametrize(
    ('arguments', 'called'),
    [
        (['setup', 'PYTHON=python3.12'], 'python3.12 --python'),
        (['setup', 'PYTHON=shim'], 'python3 --python'),
        (['setup'], 'python3'),
        (['demo'], 'python3'),
        (['test-pure'], 'python3'),
    ],
)
def test_only_a_make_that_is_given_a_python_asks_for_another_environment(
    tmp_path: Path, arguments: list[str], called: str
) -> None:
    """Whatever python3 is, the environment of before has the last word; a shim that does not run is passed over."""
    answers = {'python3': 0, 'python3.12': 0, 'shim': 127}
    for name, code in answers.items():
        script = tmp_path / name
        script.write_text(f'#!/bin/sh\n[ {code} = 0 ] || exit {code}\n[ "$1" = -c ] || echo called: {name} $2\n')
        script.chmod(0o755)
    environment = {name: value for name, value in os.environ.items() if name not in ('PYTHON', 'MAKEFLAGS')}
    environment['PATH'] = f'{tmp_path}:{environment["PATH"]}'
    command = ['make', '--no-print-directory', '-f', workspace.ROOT / 'Makefile', '-k', *arguments]
    made = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert f'called: {called}' in made.stdout.splitlines()


def test_no_python_that_runs_ends_the_set_up_with_one_sentence(tmp_path: Path) -> None:
    environment = {'PATH': str(tmp_path)}
    for tool in ('sh', 'make'):
        (tmp_path / tool).symlink_to(shutil.which(tool))
    made = subprocess.run(
        [tmp_path / 'make', '-f', workspace.ROOT / 'Makefile', 'setup'],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert made.returncode == 2
    assert made.stderr.startswith('set-up: no Python runs here; install one from 3.10 to 3.13')


def test_a_second_set_up_does_nothing_and_another_python_makes_the_environment_anew(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(workspace, 'VENV', tmp_path)
    made = []
    for version in ((3, 12), (3, 12), (3, 13)):
        workspace.once('venv', version, [], lambda version=version: made.append(version))
    assert made == [(3, 12), (3, 13)]


def test_a_long_step_says_which_it_is_and_how_long_it_has_lasted(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(workspace, 'SIGN_S', 0.1)
    step = workspace.Step(3)
    step.run(sys.executable, '-c', 'import time; time.sleep(0.5)')
    named = 'set-up: [3 of 4] building texture_msgs, the longest step'
    said = capfd.readouterr().out.splitlines()
    assert said[0] == named
    assert said[1:]
    assert set(said[1:]) == {f'{named}, 0 min so far'}
    with pytest.raises(workspace.SetupError, match='this command failed'):
        step.run(sys.executable, '-c', 'raise SystemExit(3)')


def test_each_file_of_the_lock_has_its_hash() -> None:
    text = workspace.LOCK.read_text()
    names = re.findall(r'^\w[^ \n]*==.*$', text, re.MULTILINE)
    assert names
    assert all(line.endswith('\\') for line in names)
    assert text.count('--hash=sha256:') >= len(names)


def test_an_interface_is_built_only_where_no_prefix_has_it(tmp_path: Path) -> None:
    assert [path.name for path in workspace.missing_interfaces([str(tmp_path)])] == ['tf2_msgs']
    share = tmp_path / 'share' / 'tf2_msgs'
    share.mkdir(parents=True)
    (share / 'package.xml').touch()
    assert workspace.missing_interfaces(['/nowhere', str(tmp_path)]) == []


def test_the_interfaces_of_the_set_up_are_hidden_from_a_workspace_that_holds_the_repository() -> None:
    assert (workspace.INTERFACES.parent / 'COLCON_IGNORE').is_file()


@pytest.mark.parametrize(
    'file', sorted([*workspace.ROOT.glob('src/*/CMakeLists.txt'), *workspace.INTERFACES.rglob('CMakeLists.txt')])
)
def test_no_package_asks_for_a_version_that_cmake_deprecates_with_a_warning(file: Path) -> None:
    found = re.search(r'cmake_minimum_required\(VERSION (\d+)\.(\d+)\)', file.read_text())
    assert found is not None
    assert (int(found[1]), int(found[2])) >= (3, 10)
