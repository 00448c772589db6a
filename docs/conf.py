"""How the pages become a site: `python docs/build.py` runs Sphinx with this file on the root of the repository."""

from __future__ import annotations

import re
import sys
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path.insert(0, str(DOCS))  # Sphinx does not put the folder of its configuration there

import reference  # noqa: E402  found by the line above

project = 'Tactile Texture'
author = 'Tactile Texture maintainers'
copyright = author  # noqa: A001  the name that Sphinx wants
release = ElementTree.parse(ROOT / 'src' / 'texture_core' / 'package.xml').findtext('version')

extensions = ['myst_parser']
myst_heading_anchors = 4
root_doc = 'docs/index'
# The pages lie where they are read on a forge as well; links between them, to files and to packages work in both.
include_patterns = ['docs/**', 'src/*/README.md']
exclude_patterns = ['.*', 'build', 'install', 'log', 'out', 'src/*/[!R]*', '**/__pycache__']

html_theme = 'furo'
html_title = f'Tactile Texture {release}'
html_copy_source = False
highlight_language = 'text'  # most blocks are commands and sentences

# What stands in a page in place of what is made from source when the site is built.
MADE = {
    '<!-- messages -->': reference.messages,
    '<!-- parameters -->': reference.parameters,
    '<!-- papers -->': reference.papers,
    '<!-- grades -->': reference.grades,
    '<!-- recipes later -->': reference.later,
    **{f'<!-- experiment {name} -->': partial(reference.experiment, name) for name in reference.EXPERIMENTS},
}
MORE_PAGES = '<!-- more pages -->'
# Tables that a benchmark wrote, linked from its page: without a title, so in no list of pages.
TABLES = 'docs/charts/'


def fill(app: object, docname: str, source: list[str]) -> None:
    """Put what is made from source into the page that asks for it, before Sphinx reads the page."""
    if docname.startswith(TABLES):
        source[0] = f'---\norphan: true\n---\n{source[0]}'
    for place, make in MADE.items():
        if place in source[0]:
            source[0] = source[0].replace(place, make(ROOT))
    if MORE_PAGES in source[0]:
        source[0] = source[0].replace(MORE_PAGES, more_pages(source[0]))


def more_pages(index: str) -> str:
    """Return the pages of this folder that the index does not name, so that none is lost."""
    named = set(re.findall(r'^([\w-]+)$', index, re.MULTILINE)) | {'index'}
    return '\n'.join(sorted({page.stem for page in DOCS.glob('*.md')} - named))


def setup(app: object) -> None:
    """Tell Sphinx of `fill`."""
    app.connect('source-read', fill)  # type: ignore[attr-defined]
