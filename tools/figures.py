# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write the tables of figures in the pages from the stored JSON: `python tools/figures.py`; `--check` only compares.

The check also fails where a stored experiment of a paper or definition of a recipe is not of the present code.

A page marks where a table goes, and its rows between the marks are replaced:

    <!-- table: NAME -->
    <!-- end -->

`docs/tables/NAME.md` is the table with a source in braces instead of each figure: `{trust/default/accuracy;.1%}` is a
file of `docs/charts` without its ending, the keys below `numbers` (`/` in a key is `~1`), and a format of Python,
optionally times a factor (`.0f*1e6`), `.1%` for percent without the sign. A stored null is printed as a dash.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PAGES = ('README.md', 'docs/*.md')
BLOCK = re.compile(r'(?P<begin><!-- table: (?P<name>\S+) -->\n)(?P<rows>.*?)(?P<end><!-- end -->)', re.DOTALL)
FIGURE = re.compile(r'\{(?P<source>[^;{}]+);(?P<form>[^{}]+)\}')


class BadFigure(ValueError):
    """A figure whose source is missing or does not fit its format."""


@lru_cache
def numbers(path: Path) -> Any:
    """Return the numbers of a stored chart."""
    if not path.exists():
        raise BadFigure(f'there is no file {path.name} in docs/charts')
    return json.loads(path.read_text(encoding='utf-8'))['numbers']


def entry(source: str, root: Path) -> Any:
    """Return what is stored at a source, such as 'trust/default/accuracy'."""
    name, *keys = (part.replace('~1', '/') for part in source.strip().split('/'))
    held = numbers(root / 'docs' / 'charts' / f'{name}.json')
    try:
        for key in keys:
            held = held[int(key)] if isinstance(held, list) else held[key]
    except (KeyError, IndexError, ValueError, TypeError):
        raise BadFigure(f"'{source}' ends at '{key}'") from None
    return held


def figure(source: str, form: str, root: Path) -> str:
    """Return a figure as it is to be printed."""
    held = entry(source, root)
    if held is None:
        return '–'
    form, _, factor = form.strip().partition('*')
    try:
        text = format(held * float(factor) if factor else held, form)
    except (TypeError, ValueError) as error:
        raise BadFigure(f"'{source}' is no number for '{form}': {error}") from None
    return text.replace('%', '').replace('-', '−')


def fill(page: str, root: Path) -> str:
    """Return a page with every table as it is stored now."""

    def block(found: re.Match[str]) -> str:
        path = root / 'docs' / 'tables' / f'{found["name"]}.md'
        if not path.exists():
            raise BadFigure(f"there is no table '{found['name']}' in docs/tables")
        rows = FIGURE.sub(lambda each: figure(each['source'], each['form'], root), path.read_text(encoding='utf-8'))
        return found['begin'] + rows + found['end']

    return BLOCK.sub(block, page)


def stale(root: Path, digests: Mapping[str, Callable[[], Mapping[str, str]]]) -> list[str]:
    """Return which stored experiments of papers are not of today's code, scenes, recipes, splits and libraries."""
    faults = []
    for name, now in digests.items():
        path = root / 'docs' / 'charts' / f'{name}.json'
        if not path.exists():
            continue
        print(f'checking {path.relative_to(root)}', flush=True)  # each takes seconds
        stored, today = numbers(path).get('digests', {}), now()
        changed = [row for row in {**stored, **today} if stored.get(row) != today.get(row)]
        command = f'texture experiment {name.removesuffix("-tuned")}{" --tune" if name.endswith("-tuned") else ""}'
        if changed:
            faults.append(f'{path.name}: changed since it was measured: {"; ".join(changed)}; run {command} --seeds 5')
    return faults


def definitions(held: Any, name: str = '') -> Iterator[tuple[str, str]]:
    """Yield each recipe by whose name figures are stored with the digest of its definition, and that digest."""
    if isinstance(held, dict):
        yield from [(name, held['definition'])] if 'definition' in held else []
        for key, value in held.items():
            yield from definitions(value, key)


def outdated(root: Path, digest_of: Callable[[str], str]) -> list[str]:
    """Return which benchmarks are stored with a definition of a recipe that is not today's, or of a reduced run."""
    faults = []
    for path in sorted((root / 'docs' / 'charts').glob('*.json')):
        if json.loads(path.read_text(encoding='utf-8')).get('reduced'):
            faults.append(f'{path.name}: it is of a reduced run; run texture benchmark {path.stem}')
        changed = sorted({name for name, digest in definitions(numbers(path)) if digest != digest_of(name)})
        if changed:
            faults.append(
                f'{path.name}: recipes changed since it was measured: {", ".join(changed)}; '
                f'run texture benchmark {path.stem}'
            )
    return faults


def main(root: Path = ROOT) -> int:
    """Fill the tables of the pages, or check them."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument('--check', action='store_true', help='compare only, and end with 1 if something disagrees')
    only_check = parser.parse_args().check
    faults, used = [], set()
    for path in sorted(found for pattern in PAGES for found in root.glob(pattern)):
        page = path.read_text(encoding='utf-8')
        used |= {found['name'] for found in BLOCK.finditer(page)}
        try:
            filled = fill(page, root)
        except BadFigure as error:
            faults.append(f'{path.relative_to(root)}: {error}')
            continue
        if filled != page and only_check:
            faults.append(f'{path.relative_to(root)}: a table is not as stored; run python tools/figures.py')
        elif filled != page:
            path.write_text(filled, encoding='utf-8')
    if only_check:
        # ruff: noqa: PLC0415  # these take seconds, and filling tables needs none
        from texture_papers.catalogue import DIGESTS
        from texture_papers.protocol import digest_of

        faults += [*stale(root, DIGESTS), *outdated(root, digest_of)]
    unused = {path.stem for path in (root / 'docs' / 'tables').glob('*.md')} - used
    faults += [f'docs/tables/{name}.md: no page shows this table' for name in sorted(unused)]
    print('\n'.join(faults), end='\n' if faults else '')
    return int(bool(faults))


if __name__ == '__main__':
    sys.exit(main())
