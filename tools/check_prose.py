"""Check the style of the pages: `python tools/check_prose.py [PAGE ...]` ends with 1 and names what is to be changed.

A sentence has at most 30 words, and a verb if it ends with a full stop. Words of `check_terms.py` and a few phrases
that readers from the field stumbled over are banned. Code, links, comments and headings are left out; a cell of a table
and an item of a list are read by themselves, and what is shorter than four words is no sentence.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import check_terms
import figures

ROOT = Path(__file__).parents[1]
MAX_WORDS = 30
MIN_WORDS = 4
PHRASES = {
    'what to see': 'a sentence that says what the picture shows',
    'taken for': 'classified as, or reported as',
    'what ships': 'the released recipe',
    'as shipped': 'as released',
    'at hand': 'available',
    'haste': 'early stopping',
    'strange surfaces': 'unknown surfaces',
    'one look': 'one evaluation',
    'first look': 'first evaluation',
    'looked at': 'evaluated or examined',
    'asked for': 'requested or the target',
    'honest': 'calibrated',
    'of course': 'nothing',
    'simply': 'nothing',
    'obviously': 'nothing',
}
# A simple test for a verb: one of these words, or an ending that verbs have.
VERBS = check_terms.VERBS | frozenset(
    {
        *(
            'cannot',
            'does',
            'did',
            'had',
            'will',
            'would',
            'should',
            'could',
            'might',
            'need',
            'see',
            'read',
            'use',
            'run',
        ),
        *('set', 'make', 'take', 'give', 'keep', 'hold', 'get', 'go', 'say', 'show', 'start', 'stop', 'write', 'wrote'),
        *('rose', 'fell', 'came', 'kept', 'lost', 'won', 'cost', 'took', 'gave', 'made', 'let', 'lie', 'lay', 'stand'),
        *('differ', 'agree', 'train', 'test', 'measure', 'compare', 'choose', 'open', 'press', 'call', 'add', 'build'),
        *('install', 'check', 'mount', 'connect', 'send', 'wait', 'know', 'mean', 'depend', 'follow', 'become', 'move'),
        *('report', 'help', 'want', 'work', 'apply', 'count', 'carry', 'begin', 'end', 'put', 'pass', 'leave', 'fit'),
        *(
            'form',
            'share',
            'reach',
            'contain',
            'list',
            'name',
            'replace',
            'stay',
            'remain',
            'describe',
            'explain',
            "don't",
        ),
        *(
            'draw',
            'decide',
            'copy',
            'sample',
            'learn',
            'tune',
            'notice',
            'lift',
            'has',
            'want',
            'exist',
            'print',
            'stamp',
        ),
    }
)
VERB_ENDING = re.compile(r'^[a-z-]{2,}(?:[^s]s|ed|ify|ise)$')
SENTENCE_END = re.compile(
    r'(?<=[.!?])(?<!e\.g\.)(?<!i\.e\.)(?<!et al\.)(?<!vs\.)(?<!approx\.)(?<!eq\.)[)*_"]*\s+(?=[*_("\[]*[A-Z0-9])'
)
HIDDEN = re.compile(r'<!--.*?-->|\A---\n.*?\n---\n|```\{.*?```|~~~.*?~~~', re.DOTALL)
CODE_BLOCK = re.compile(r'```.*?```|^(?: {4}|\t)(?! *(?:[-*|]|\d+\.) ).*?$', re.DOTALL | re.MULTILINE)
INLINE_CODE = re.compile(r'`[^`\n]*`')
LINK = re.compile(r'!?\[([^]]*)\]\([^)]*\)')
ITEM = re.compile(r'^ *(?:[-*+]|\d+\.) ')
# Pages that are left out; none is.
UNCONVERTED: frozenset[str] = frozenset()


def blank(found: re.Match[str]) -> str:
    """Return the line ends of a match, so that the numbers of lines stay."""
    return '\n' * found.group().count('\n')


def units(text: str) -> Iterator[tuple[int, str]]:
    """Yield each paragraph, item and cell of a page without code and links, with its line."""
    text = CODE_BLOCK.sub(blank, HIDDEN.sub(blank, text))
    text = LINK.sub(lambda found: found[1] or 'link', INLINE_CODE.sub('Code', text))
    held: list[str] = []
    start = 0
    for line, row in enumerate([*text.split('\n'), ''], 1):
        alone = not row.strip() or row.lstrip().startswith(('#', '|', ':::', '<')) or ITEM.match(row)
        if alone and held:
            yield start, ' '.join(held)
            held = []
        if row.lstrip().startswith('|'):
            yield from ((line, cell.strip()) for cell in row.strip().strip('|').split('|'))
        elif ITEM.match(row) or (row.strip() and not alone):
            start = start if held else line
            held.append(ITEM.sub('', row).strip())


def sentence_faults(sentence: str) -> Iterator[str]:
    """Yield what is wrong with one sentence."""
    words = re.findall(r"[A-Za-zÀ-ž'’][\w'’-]*|\d[\d.,]*", sentence)
    if len(words) > MAX_WORDS:
        yield f'a sentence of {len(words)} words; write at most {MAX_WORDS}: {sentence[:70]}…'
    lower = [word.lower() for word in words]
    ends = sentence.rstrip(')*_"').endswith('.')
    if ends and len(words) >= MIN_WORDS and not any(word in VERBS or VERB_ENDING.match(word) for word in lower):
        yield f'a sentence without a verb: {sentence[:90]}'
    whole = ' '.join(lower)
    for phrase, better in PHRASES.items():
        if re.search(rf'\b{phrase}\b', whole):
            yield f"the phrase '{phrase}'; write {better}"


def check_page(path: Path) -> Iterator[str]:
    """Yield one sentence for each fault of style in a page."""
    for line, unit in units(path.read_text(encoding='utf-8')):
        for sentence in SENTENCE_END.split(unit):
            for fault in sentence_faults(sentence):
                yield f'{path.relative_to(ROOT) if path.is_relative_to(ROOT) else path}:{line}: {fault}'
    yield from (fault.replace(f'{ROOT}/', '') for fault in check_terms.check_page(path))


def pages() -> list[Path]:
    """Return the pages whose style is checked."""
    return [path for path in figures.pages(ROOT) if str(path.relative_to(ROOT)) not in UNCONVERTED]


def main() -> int:
    """Check pages and print what is to be changed."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument('pages', type=Path, nargs='*', help='pages to check; all converted ones without')
    found = [fault for page in parser.parse_args().pages or pages() for fault in check_page(page.resolve())]
    print('\n'.join(found) or 'all pages keep to the style')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
