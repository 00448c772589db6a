# SPDX-License-Identifier: Apache-2.0
"""Fill the measured numbers of the pages from the stored JSON: `python tools/figures.py`, or `--check` to compare only.

A number in a page is followed by a comment that names its source, so that a forge shows the number alone:

    81.1<!--=trust/default/window_accuracy;.1%--> %

The source is a file of `docs/charts` without its ending, then the keys below `numbers` (a `/` in a key is written
`~1`), then the format after a semicolon. A format is a Python format, optionally with a factor (`.0f*1e6`); `.1%` gives
percent without the sign. `*` in place of a key takes every entry, and `min`, `max`, `mean`, `sum` or `len` before the
format reduces them. `A minus B` takes a difference, and a stored null is printed as a dash. A new number is written as
`?` and filled by the tool.

Every other number with a unit needs a marker that says where it comes from: `<!-- constants -->` for settings, physics
and figures of others, `<!-- measured once -->` for a measurement without a stored file. A marker holds for its
paragraph, list or table; as `<!-- constants: section -->` up to the next heading of its level or a higher one; as
`<!-- constants: page -->` for the page.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from statistics import fmean
from typing import Any

ROOT = Path(__file__).parents[1]
CHARTS = ROOT / 'docs' / 'charts'
PAGES = ('README.md', 'CONTRIBUTING.md', 'docs/*.md', 'docs/*/*.md', 'src/*/README.md')
GENERATED = ('docs/charts/', 'docs/reference/')  # their tests compare them with the data
FIGURE = re.compile(r'(?P<value>[+−-]?\d[\d.,]*|\?|–)<!--=\s*(?P<source>[^;>]+?)\s*;\s*(?P<form>[^;>]+?)\s*-->')
COMMENT = re.compile(r'<!--=.*?-->')
FORM = re.compile(r'^(?:(?P<reduce>min|max|mean|sum|len) )?(?P<format>[^*\s]*)(?:\*(?P<factor>[\d.e-]+))?$')
REDUCTIONS: dict[str, Callable[[Any], float]] = {'min': min, 'max': max, 'mean': fmean, 'sum': sum, 'len': len}
UNIT = re.compile(
    r'(?<![\w.~])\d[\d.,]*\s?(?:%|µs\b|°|(?:percent|points?|ms|us|s|min|h|N|N/s|mN|Hz|kHz|mm|µm|cm|m|m/s|mm/s|dB|kB|MB|GB)(?![\w/]))'
)
MARKER = re.compile(r'<!-- (?:constants|measured once)(?P<extent>: section|: page)? -->')
CODE = re.compile(r'```.*?```|^(?: {4}|\t)(?![ -]*[-*|\d]).*?$|`[^`\n]*`|\]\([^)]*\)', re.DOTALL | re.MULTILINE)
COMMENT_OR_CODE = re.compile(f'({COMMENT.pattern})|(?:{CODE.pattern})', CODE.flags)
# Pages whose numbers are not asked for a source; none is.
UNCONVERTED: frozenset[str] = frozenset()


class BadFigure(ValueError):
    """A number whose source is missing or does not fit its format."""


@lru_cache
def numbers(name: str) -> Any:
    """Return the numbers of a stored chart."""
    path = CHARTS / f'{name}.json'
    if not path.exists():
        raise BadFigure(f'there is no file {path.name} in docs/charts')
    return json.loads(path.read_text(encoding='utf-8'))['numbers']


def entry(source: str) -> Any:
    """Return what stands at a source, such as 'trust/default/window_accuracy'; a list if it holds `*`."""
    name, *keys = (part.replace('~1', '/') for part in source.split('/'))
    found = [numbers(name)]
    for key in keys:
        found = [value for held in found for value in _under(held, key, source)]
    return found if '*' in keys else found[0]


def _under(held: Any, key: str, source: str) -> list[Any]:
    if key == '*':
        return _values(held)
    try:
        return [held[int(key)] if isinstance(held, list) else held[key]]
    except (KeyError, IndexError, ValueError, TypeError):
        raise BadFigure(f"'{source}' ends at '{key}'") from None


def _values(held: Any) -> list[Any]:
    return list(held.values()) if isinstance(held, dict) else list(held)


def figure(source: str, form: str) -> str:
    """Return a number as it is to be printed."""
    parsed = FORM.match(form)
    if parsed is None:
        raise BadFigure(f"'{form}' is no format; write one such as .1f, .1%, .0f*1e6 or 'max .1%'")
    left, *right = (entry(part.strip()) for part in source.split(' minus '))
    if left is None:
        return '–'
    if right:
        left -= right[0]
    if parsed['reduce']:
        left = REDUCTIONS[parsed['reduce']](left)
    try:
        text = format(left * float(parsed['factor']) if parsed['factor'] else left, parsed['format'])
    except (TypeError, ValueError) as error:
        raise BadFigure(f"'{source}' is no number for '{form}': {error}") from None
    return text.replace('%', '').replace('-', '−')


def fill(text: str) -> str:
    """Return a page with every included number as it is stored now; code is left as it is."""
    filled, end = [], 0
    for found in FIGURE.finditer(without_code(text)):
        filled += [text[end : found.start()], figure(found['source'], found['form'])]
        end = found.end('value')
    return ''.join([*filled, text[end:]])


def without_code(text: str) -> str:
    """Return a page with blanks in place of its code, and its comments as they are."""
    return COMMENT_OR_CODE.sub(lambda found: found[1] or re.sub(r'[^\n]', ' ', found.group()), text)


def check_figures(text: str) -> Iterator[str]:
    """Yield one sentence for each included number that is not the stored one."""
    for line, row in enumerate(without_code(text).splitlines(), 1):
        found = list(FIGURE.finditer(row))
        if len(found) != len(COMMENT.findall(row)):
            yield f'{line}: a comment <!--=…--> does not follow a number, or has no format'
        for one in found:
            try:
                stored = figure(one['source'], one['form'])
            except BadFigure as error:
                yield f'{line}: {error}'
                continue
            if stored != one['value'].replace('-', '−'):
                yield f'{line}: {one["value"]} stands for {one["source"]}, which is {stored}'


def check_units(text: str) -> Iterator[str]:
    """Yield one sentence for each number with a unit that is neither included nor marked."""
    if '<!-- constants: page -->' in text or '<!-- measured once: page -->' in text:
        return
    prose = without_code(COMMENT.sub('<!---->', text))
    marked_below = 0  # level of the heading whose section is marked
    level, line = 1, 1
    for block in re.split(r'(\n\s*\n)', prose):
        heading = re.match(r'\n*(#+) ', block)
        if heading:
            level = len(heading[1])
            marked_below = 0 if level <= marked_below else marked_below
        marker = MARKER.search(block)
        if marker and marker['extent'] == ': section':
            marked_below = level
        elif not marker and not marked_below:
            yield from _unmarked(block, line)
        line += block.count('\n')


def _unmarked(block: str, line: int) -> Iterator[str]:
    rows = block.split('\n')
    for number, (row, below) in enumerate(zip(rows, [*rows[1:], ''], strict=True), line):
        if re.match(r'\|[ :|-]+$', below.strip()):
            continue  # the head of a table names conditions, as the first cell of its rows does
        for found in UNIT.findall(re.sub(r'^\|[^|]*', '', row)):
            yield f"{number}: '{found}' has no source; include it from docs/charts or mark its paragraph"


def pages(root: Path) -> list[Path]:
    """Return the pages that are written by hand."""
    found = [path for pattern in PAGES for path in sorted(root.glob(pattern))]
    return [path for path in found if not str(path.relative_to(root)).startswith(GENERATED)]


def faults(page: Path, check: Callable[[str], Iterator[str]], root: Path = ROOT) -> list[str]:
    """Return the faults of one page, each with its page and line."""
    return [f'{page.relative_to(root)}:{fault}' for fault in check(page.read_text(encoding='utf-8'))]


def check(root: Path = ROOT) -> list[str]:
    """Return one sentence for each fault of the pages."""
    found: list[str] = []
    for page in pages(root):
        found += faults(page, check_figures, root)
        if asked_for_sources(page, root):
            found += faults(page, check_units, root)
    return found


def asked_for_sources(page: Path, root: Path) -> bool:
    """Return whether every number with a unit needs a source: not in the settings that READMEs of packages list."""
    name = str(page.relative_to(root))
    return name not in UNCONVERTED and not name.startswith('src/')


def write(root: Path = ROOT) -> list[str]:
    """Fill every page; return the names of those that changed."""
    changed = []
    for page in pages(root):
        text = page.read_text(encoding='utf-8')
        if (filled := fill(text)) != text:
            page.write_text(filled, encoding='utf-8')
            changed.append(str(page.relative_to(root)))
    return changed


def main() -> int:
    """Fill the pages, or check them."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument('--check', action='store_true', help='compare only, and end with 1 if something disagrees')
    only_check = parser.parse_args().check
    found = check() if only_check else write()
    print('\n'.join(found))
    return int(only_check and bool(found))


if __name__ == '__main__':
    sys.exit(main())
