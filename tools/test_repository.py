# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Checks of the repository as a whole: links, the shared setup.py, versions, names."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = sorted(path.parent for path in ROOT.glob('src/*/package.xml'))
PYTHON_PACKAGES = [package for package in PACKAGES if package.name != 'texture_msgs']
# What is in docs/tables goes into other pages, from which its links lead.
PAGES = sorted(
    [*ROOT.glob('*.md'), *ROOT.glob('docs/*.md'), *ROOT.glob('docs/reference/*.md'), *ROOT.glob('src/*/*.md')]
)
LINK = re.compile(r'\]\(([^)\s]+)\)')
REPOSITORY = re.search(r'^repository: (.+)$', (ROOT / 'CONTRIBUTING.md').read_text(), re.MULTILINE)[1]
HEADING = re.compile(r'^#+ (.+)$', re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """Return the anchors that a Markdown page offers, as the common renderers name them."""
    text = re.sub(r'```.*?```', '', page.read_text(), flags=re.DOTALL)
    return {re.sub(r'[^\w\- ]', '', heading.lower()).strip().replace(' ', '-') for heading in HEADING.findall(text)}


@pytest.mark.parametrize('page', PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_relative_link_leads_somewhere(page: Path) -> None:
    text = re.sub(r'```.*?```', '', page.read_text(), flags=re.DOTALL)
    for link in LINK.findall(text):
        if '://' in link or link.startswith('mailto:') or link == '../../issues':  # of the site that shows the page
            continue
        path, _, anchor = link.partition('#')
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f'{link} leads nowhere'
        if anchor:
            assert anchor in anchors(target), f'{link}: no such heading'


@pytest.mark.parametrize('package', PYTHON_PACKAGES, ids=lambda package: package.name)
def test_setup_py_is_the_same_text_everywhere(package: Path) -> None:
    assert (package / 'setup.py').read_text() == (PYTHON_PACKAGES[0] / 'setup.py').read_text()


@pytest.mark.parametrize('package', PACKAGES, ids=lambda package: package.name)
def test_a_package_has_its_papers(package: Path) -> None:
    facts = ElementTree.parse(package / 'package.xml').getroot()
    if (package / 'setup.py').exists():  # a literal, because the release tools of ROS look for one
        assert f"version='{facts.findtext('version')}'," in (package / 'setup.py').read_text()
    assert facts.findtext('license') == 'Apache-2.0'
    assert (package / 'LICENSE').read_bytes() == (ROOT / 'LICENSE').read_bytes()
    assert [url.get('type') for url in facts.iter('url')] == ['website', 'repository', 'bugtracker']
    assert all((url.text or '').startswith(REPOSITORY) for url in facts.iter('url'))
    assert '](' not in (package / 'README.md').read_text()  # a link into docs/ is dead on the pages of ROS
    assert (package / 'CHANGELOG.rst').exists()


DOMAIN = re.compile(r"(?:LocalGraph\(|DOMAIN = |'ROS_DOMAIN_ID'[:,] ')(\d+)")
ADDRESS = re.compile(r'127\.0\.0\.(\d+)')
SHARED_ADDRESSES = {'1', '2'}  # loopback itself, and the default of the emulated robot, which no test binds


@pytest.mark.parametrize('pattern', [DOMAIN, ADDRESS], ids=['ROS domain', 'loopback address'])
def test_no_two_files_of_tests_meet_on_one(pattern: re.Pattern[str]) -> None:
    """Files of tests run side by side; what one emulates, another must not find."""
    files: dict[str, set[str]] = {}
    for path in [*ROOT.glob('src/*/test/*.py'), *ROOT.glob('src/texture_benchmarks/texture_benchmarks/**/*.py')]:
        for number in pattern.findall(path.read_text()):
            files.setdefault(number, set()).add(path.name)
    shared = {number: names for number, names in files.items() if len(names) > 1 and number not in SHARED_ADDRESSES}
    assert not shared, f'give each of these files a number that no other file has: {shared}'


def test_the_domains_of_tests_are_those_that_no_demonstration_takes() -> None:
    numbers = {int(n) for path in ROOT.glob('src/*/test/*.py') for n in DOMAIN.findall(path.read_text())} - {0}
    assert numbers
    assert all(61 <= number <= 100 for number in numbers), numbers


def public_classes(text: str) -> set[str]:
    """Return the names of the classes that a module defines and that do not begin with an underscore."""
    found = (node.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ClassDef))
    return {name for name in found if not name.startswith('_')}


def test_no_two_public_classes_of_the_suite_have_the_same_name() -> None:
    """The name of a class is unambiguous without looking at its import."""
    modules = [path for root in ('src', 'tools') for path in (ROOT / root).rglob('*.py')]
    files: dict[str, list[str]] = {}
    for path in modules:
        if 'test' not in path.parts and not path.name.startswith('test_'):
            for name in public_classes(path.read_text(encoding='utf-8')):
                files.setdefault(name, []).append(str(path.relative_to(ROOT)))
    assert 'WindowParams' in files
    shared = [f'{name} in {" and ".join(paths)}' for name, paths in files.items() if len(paths) > 1]
    assert not shared, f'rename all but one class of each name: {"; ".join(shared)}'
