"""Check the words of the project: `python tools/check_terms.py [FOLDER]` ends with 1 and names what is to be changed.

Identifiers use the field's terms: a short list of words is banned as a part of any name in Python code. What users
read, the descriptions of parameters and launch arguments and the comments of messages, services and actions, are whole
sentences. The prose of the pages (README, CONTRIBUTING, docs/, README of each package) keeps to the same terms; code,
links and names of files in it are left out.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).parents[1]
# What is banned, and what to write instead.
BANNED = {
    'judge': 'predict, evaluate or classify',
    'judges': 'learners',
    'judged': 'predicted or evaluated',
    'pupil': 'incremental classifier',
    'pupils': 'incremental classifiers',
    'lesson': 'example',
    'lessons': 'examples',
    'taught': 'trained or incremental',
    'teach': 'train or add',
    'felt': 'measured or sensed',
    'feel': 'measure or sense',
    'feeling': 'measurement',
    'striker': 'fault injector',
    'struck': 'injected',
    'worth': 'effective window count',
    'voice': 'evidence',
    'wish': 'command',
    'trouble': 'fault',
    'pilot': 'controller',
    'stranger': 'unknown or novel',
    'strangers': 'unknown or novel',
    'familiarity': 'novelty score',
    'promise': 'guarantee or coverage',
    'promised': 'guaranteed',
    'anew': 'again',
}
# What is banned in the prose of the pages, besides: words that have another meaning in names.
BANNED_PROSE = {
    **dict.fromkeys(('teach', 'teaches', 'teaching', 'taught', 'learnt'), 'train, add or fit'),
    **dict.fromkeys(('told',), 'reported, given, sent or distinguished'),
    **dict.fromkeys(('judge', 'judges', 'judged', 'judging'), 'classify, evaluate or predict'),
    **dict.fromkeys(('lesson', 'lessons', 'pupil', 'pupils'), 'added slide or example'),
    **dict.fromkeys(('promise', 'promises', 'promised'), 'guarantee or coverage'),
    **dict.fromkeys(('stranger', 'strangers'), 'unknown, other or foreign'),
    'worth': 'contribution or gain',
    'trouble': 'fault',
    'striker': 'fault injector',
    'anew': 'again',
}
NOT_PROSE = re.compile(r'```.*?```|^    .*?$|`[^`\n]*`|\]\([^)]*\)|<[^>\n]*>', re.DOTALL | re.MULTILINE)
PAGES = ('*.md', 'docs/*.md', 'docs/robots/*.md', 'docs/sensors/*.md', 'src/*/README.md')
MIN_WORDS = 4
WORDS = re.compile(r'[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+')
# A simple test for a verb: the first word is in the third person ('Sets …'), or one of these stands anywhere.
VERBS = frozenset(
    {
        *('is', 'are', 'be', 'was', 'were', 'has', 'have', 'may', 'can', 'must', 'do', 'does', 'holds', 'contains'),
        *('lists', 'names', 'counts', 'says', 'gives', 'takes', 'ends', 'touches', 'moves'),
    }
)
THIRD_PERSON = re.compile(r'^[\'\"`]?[A-Z][a-z]+[a-z]s$')
NOUNS = frozenset(
    {
        'this',
        'its',
        'as',
        'less',
        'unless',
        'always',
        'bias',
        'radius',
        'samples',
        'slides',
        'windows',
        'places',
        'turns',
        'steps',
        'yarns',
    }
)
INTERFACE_FIELD = re.compile(r'^[\w/]+(\[\w*\])?\s+(\w+)(\s*=\s*\S+)?\s*(#\s*(.*))?$')


def names_of(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Yield each name that the code defines, with its line."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            yield node.name, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr, node.lineno


def banned_words(name: str) -> list[str]:
    """Return the banned words that a name is made of, such as 'felt' for `felt_n` and `FeltForce`."""
    return [word for word in map(str.lower, WORDS.findall(name)) if word in BANNED]


def sentence_fault(text: str) -> str:
    """Return what a description lacks to be a whole sentence, '' if nothing.

    A verb is known by a short list and by its ending alone, so that some texts without a verb pass. A sentence that is
    refused although it has one is written with 'is' or begins with 'Sets' or another verb in the third person.
    """
    words = re.findall(r"[\w'’-]+", text)
    if not text or not (text[0].isupper() or text[0] in '\'"`'):
        return 'it does not start with a capital'
    if not text.rstrip(')\'"').endswith('.'):
        return 'it does not end with a full stop'
    if len(words) < MIN_WORDS:
        return f'it has fewer than {MIN_WORDS} words'
    third_person = bool(THIRD_PERSON.match(words[0])) and words[0].lower() not in NOUNS
    if not third_person and not any(word.lower() in VERBS for word in words):
        return 'it has no verb'
    return ''


def parameter_descriptions(tree: ast.AST) -> Iterator[tuple[str, str, int]]:
    """Yield name, description and line of each field that is made by `param`."""
    for node in ast.walk(tree):
        call = node.value if isinstance(node, ast.AnnAssign) else None
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == 'param'):
            continue
        text = call.args[1] if len(call.args) > 1 else None
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and text is not None:
            yield node.target.id, _text(text), text.lineno


def _text(node: ast.expr) -> str:
    """Return a text, with a word in the place of each value that is filled in."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return ''.join(str(part.value) if isinstance(part, ast.Constant) else 'value' for part in node.values)
    return ''


def check_python(path: Path) -> Iterator[str]:
    """Yield one sentence for each banned name and each incomplete description of a Python file."""
    tree = ast.parse(path.read_text(encoding='utf-8'))
    for name, line in names_of(tree):
        for word in banned_words(name):
            yield f"{path}:{line}: the name '{name}' has the word '{word}'; write {BANNED[word]}"
    if 'test' in path.parts:
        return  # classes for tests are read by nobody else
    for name, text, line in parameter_descriptions(tree):
        if fault := sentence_fault(text):
            yield f"{path}:{line}: the description of '{name}' is no sentence, {fault}: {text}"


def check_interface(path: Path) -> Iterator[str]:
    """Yield one sentence for each field of a message, service or action without a whole sentence beside it."""
    for line, row in enumerate(path.read_text(encoding='utf-8').splitlines(), 1):
        field = INTERFACE_FIELD.match(row)
        if field and (fault := sentence_fault(field.group(5) or '')):
            yield f"{path}:{line}: the comment of '{field.group(2)}' is no sentence, {fault}"


def check_launch(path: Path) -> Iterator[str]:
    """Yield one sentence for each argument of a launch file without a whole sentence as its description."""
    for argument in ElementTree.parse(path).getroot().findall('arg'):
        text = argument.get('description', '')
        if fault := sentence_fault(text):
            yield f"{path}: the description of the argument '{argument.get('name')}' is no sentence, {fault}: {text}"


def check_page(path: Path) -> Iterator[str]:
    """Yield one sentence for each banned word in the prose of a Markdown page."""
    text = path.read_text(encoding='utf-8')
    prose = NOT_PROSE.sub(lambda found: re.sub(r'[^\n]', ' ', found.group()), text)
    for line, row in enumerate(prose.splitlines(), 1):
        for word in map(str.lower, re.findall(r'[A-Za-z]+', row)):
            if word in BANNED_PROSE:
                yield f"{path}:{line}: the page has the word '{word}'; write {BANNED_PROSE[word]}"


def check_pages(root: Path) -> list[str]:
    """Return one sentence for each banned word in the pages of the repository."""
    return [fault for pattern in PAGES for path in sorted(root.glob(pattern)) for fault in check_page(path)]


def check(folder: Path) -> list[str]:
    """Return one sentence for each fault in a source tree, in the order of the files."""
    found: list[str] = []
    for path in sorted(folder.rglob('*.py')):
        found += check_python(path)
    for path in sorted(path for kind in ('msg', 'srv', 'action') for path in folder.rglob(f'*.{kind}')):
        found += check_interface(path)
    for path in sorted(folder.rglob('*.launch.xml')):
        found += check_launch(path)
    return found


def main() -> int:
    """Check a folder and print what is to be changed."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument('folder', type=Path, nargs='?', default=ROOT / 'src', help='source tree to check')
    folder = parser.parse_args().folder
    found = check(folder) + (check_pages(ROOT) if folder == ROOT / 'src' else [])
    print('\n'.join(found) or 'all names and descriptions keep to the terms')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
