# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How the pages become a site: `python docs/build.py` runs Sphinx with this file on the root of the repository."""

from __future__ import annotations

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
# Templates of tables of figures are parts of pages.
exclude_patterns = ['.*', 'docs/tables', 'build', 'install', 'log', 'out', 'src/*/[!R]*', '**/__pycache__']

html_theme = 'furo'
html_title = f'Tactile Texture {release}'
html_copy_source = False
highlight_language = 'text'  # most blocks are commands and sentences
