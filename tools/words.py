# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Count pages and words written by hand: `python tools/words.py`; it ends with 1 above the limits.

Code blocks, comments and generated pages do not count. Code within a line counts as one word, and what has neither a
letter nor a digit, such as the rules of a table, as none.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGES = ('README.md', 'CONTRIBUTING.md', 'docs/*.md', 'docs/appendix/*.md', 'src/*/README.md')
MOST_PAGES, MOST_WORDS = 20, 16_000
GENERATED = '<!-- This page is generated'
LEFT_OUT = re.compile(r'<!--.*?-->|^ *```.*?^ *```|^    .*?$', re.DOTALL | re.MULTILINE)


def words(page: Path) -> int:
    """Return the number of words of a page."""
    text = re.sub(r'`[^`\n]+`', 'code', LEFT_OUT.sub('', page.read_text(encoding='utf-8')))
    return sum(bool(re.search(r'\w', word)) for word in text.split())


def written(pattern: str) -> list[Path]:
    """Return the pages of a pattern that no tool generates."""
    return [page for page in sorted(ROOT.glob(pattern)) if not page.read_text(encoding='utf-8').startswith(GENERATED)]


if __name__ == '__main__':
    counts = {page.relative_to(ROOT): words(page) for pattern in PAGES for page in written(pattern)}
    for path, count in sorted(counts.items(), key=lambda item: item[1]):
        print(f'{count:6d} {path}')
    total = sum(counts.values())
    print(f'{total:6d} words on {len(counts)} pages; at most {MOST_WORDS} on {MOST_PAGES}')
    if total > MOST_WORDS or len(counts) > MOST_PAGES:
        sys.exit(
            f'{max(0, total - MOST_WORDS)} words and {max(0, len(counts) - MOST_PAGES)} pages too many: cut what '
            'another page or docs/reference says too, and link it; code blocks and generated pages are free'
        )
