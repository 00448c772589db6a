# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Build this package. The same text in every Python package of the suite: all facts come from package.xml."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from setuptools import find_packages, setup
from setuptools.command.develop import develop
from setuptools.command.install_scripts import install_scripts

HERE = Path(__file__).parent
PACKAGE = ElementTree.parse(HERE / 'package.xml').getroot()
NAME = PACKAGE.findtext('name')
MAINTAINER = PACKAGE.find('maintainer')


def shared(folder: str) -> list[tuple[str, list[str]]]:
    """Return the files of a folder that are installed to share/, folder by folder."""
    files = [path for path in (HERE / folder).rglob('*') if path.is_file()]
    parents = sorted({path.parent for path in files})
    return [
        (f'share/{NAME}/{parent.relative_to(HERE)}', [str(p.relative_to(HERE)) for p in files if p.parent == parent])
        for parent in parents
    ]


def modules(folder: str) -> list[str]:
    """Return the names of the modules in a folder of the package."""
    return sorted(path.stem for path in (HERE / NAME / folder).glob('[a-z]*.py'))


def executables() -> list[str]:
    """Return one executable for each module of nodes/, named as the module, and the one of command.py."""
    command = [f'texture = {NAME}.command:program'] if (HERE / NAME / 'command.py').exists() else []
    return [f'{module} = texture_core.start:node' for module in modules('nodes')] + command


def holding(command: type) -> type:
    """Return a command of setuptools that writes executables whose stop signals wait until Python can handle them."""

    class _Holding(command):
        def write_script(self, name: str, contents: str, *more: Any) -> None:
            super().write_script(name, contents.replace('#!', '#!/usr/bin/env -S --block-signal=INT,TERM ', 1), *more)

    return _Holding


def commands() -> list[str]:
    """Return the sub-commands of `texture`: one for each module of commands/, named as it (import_ as 'import').

    A module for which package.xml has <export><commands module="services">stop tare</commands></export> holds an
    object for each of these instead.
    """
    several = {item.get('module'): item.text.split() for item in PACKAGE.iter('commands')}
    listed = [f'{name} = {NAME}.commands.{module}:{name}' for module, names in several.items() for name in names]
    alone = [module for module in modules('commands') if module not in several]
    return listed + [f'{module.rstrip("_")} = {NAME}.commands.{module}' for module in alone]


def extras() -> dict[str, list[str]]:
    """Return the libraries of each extra: <export><extra name="hdf5">h5py</extra></export> in package.xml."""
    return {'test': ['pytest'], **{item.get('name'): item.text.split() for item in PACKAGE.iter('extra')}}


def on_path() -> list[str]:
    """Return the files of bin/, which are installed to where the shell finds them."""
    return sorted(str(path.relative_to(HERE)) for path in HERE.glob('bin/*'))


setup(
    name=NAME,
    version='0.1.0',
    description=PACKAGE.findtext('description'),
    license=PACKAGE.findtext('license'),
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get('email'),
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={'': ['py.typed', '*.yaml', '*.csv']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml', 'LICENSE']),
        *shared('launch'),
        *shared('config'),
        ('bin', on_path()),
    ],
    install_requires=['setuptools'],
    extras_require=extras(),
    zip_safe=False,
    entry_points={'console_scripts': executables(), 'texture.commands': commands()},
    cmdclass={'develop': holding(develop), 'install_scripts': holding(install_scripts)},
    options={'develop': {'script_dir': f'$base/lib/{NAME}'}, 'install': {'install_scripts': f'$base/lib/{NAME}'}},
)
