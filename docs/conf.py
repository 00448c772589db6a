# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How the pages become a site: `python docs/build.py` runs Sphinx with this file on the root of the repository."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from sphinx.application import Sphinx

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent

project = 'Tactile Texture'
author = 'Tactile Texture maintainers'
copyright = author  # noqa: A001  the name that Sphinx wants
release = ElementTree.parse(ROOT / 'src' / 'texture_core' / 'package.xml').findtext('version')

extensions = ['myst_parser']
myst_heading_anchors = 4
root_doc = 'docs/index'
# The order of the pages in the site; a forge would show such a list in the first page as a block of code.
CONTENTS = """

```{toctree}
:hidden:

integrate
safety
robots
sensors
interfaces
deployment
motion
operate
recordings
recipes
generalisation
roughness
papers
simulation
benchmarks
extending
architecture
../CONTRIBUTING
../CHANGELOG
../QUALITY_DECLARATION
../SECURITY
reference/commands
reference/catalogues
reference/messages
reference/launch
reference/parameters
reference/recipes
reference/papers
../src/texture_msgs/README
../src/texture_core/README
../src/texture_drivers/README
../src/texture_exploration/README
../src/texture_features/README
../src/texture_estimation/README
../src/texture_recordings/README
../src/texture_evaluation/README
../src/texture_simulation/README
../src/texture_bringup/README
../src/texture_papers/README
../src/texture_benchmarks/README
```
"""
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


def setup(app: Sphinx) -> None:
    """Append the list of pages to the first one as Sphinx reads it."""
    app.connect('source-read', append_contents)


def append_contents(_app: Sphinx, page: str, source: list[str]) -> None:
    """Append the list of pages to the text of the first page."""
    if page == root_doc:
        source[0] += CONTENTS
