# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How the pages become a site: `python docs/build.py` runs Sphinx with this file on the root of the repository."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent

project = 'Tactile Texture'
author = 'Tactile Texture maintainers'
copyright = author  # noqa: A001  the name that Sphinx wants
release = ElementTree.parse(ROOT / 'src' / 'texture_core' / 'package.xml').findtext('version')

extensions = ['myst_parser']
myst_heading_anchors = 4
root_doc = 'docs/index'
# The pages lie where they are read on a forge as well; links between them, to files and to packages work in both.
include_patterns = [
    'docs/**',
    'src/*/README.md',
    'CONTRIBUTING.md',
    'CHANGELOG.md',
    'QUALITY_DECLARATION.md',
    'SECURITY.md',
]
exclude_patterns = ['.*', 'build', 'install', 'log', 'out', 'src/*/[!R]*', '**/__pycache__']

html_theme = 'furo'
html_title = f'Tactile Texture {release}'
html_copy_source = False
highlight_language = 'text'  # most blocks are commands and sentences

# Sources of included numbers, which tools/figures.py reads: a forge hides them, and the site leaves them out.
SOURCES = re.compile(r'<!--=.*?-->|<!-- (?:constants|measured once)(?:: \w+)? -->')
# Tables that a benchmark wrote, linked from its page: without a title, so in no list of pages.
TABLES = 'docs/charts/'


def fill(app: object, docname: str, source: list[str]) -> None:
    """Take the sources of numbers out of a page before Sphinx reads it."""
    if docname.startswith(TABLES):
        source[0] = f'---\norphan: true\n---\n{source[0]}'
    source[0] = SOURCES.sub('', source[0])


def setup(app: object) -> None:
    """Tell Sphinx of `fill`."""
    app.connect('source-read', fill)  # type: ignore[attr-defined]
