"""What is made from source: messages with their comments, all parameters, and the figures of the papers beside ours."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from texture_core.parameters import markdown_table

INTERFACES = 'src/texture_msgs'
CHARTS = 'docs/charts'
KINDS = {'msg': 'Messages', 'srv': 'Services', 'action': 'Actions'}


def messages(root: Path) -> str:
    """Return all interfaces as Markdown: what a file says before its first field, then the file as it is."""
    parts = []
    for kind, title in KINDS.items():
        parts.append(f'## {title}\n')
        for path in sorted((root / INTERFACES / kind).glob(f'*.{kind}')):
            about, definition = split(path.read_text(encoding='utf-8'))
            parts.append(f'### {path.stem}\n\n`texture_msgs/{kind}/{path.stem}`: {about}\n\n```\n{definition}\n```\n')
    return '\n'.join(parts)


def split(text: str) -> tuple[str, str]:
    """Return the comment at the top of an interface as one line, and the rest."""
    lines = text.strip().split('\n')
    head = next((number for number, line in enumerate(lines) if not line.startswith('#')), len(lines))
    return ' '.join(line.lstrip('# ') for line in lines[:head]), '\n'.join(lines[head:]).strip()


def parameters(root: Path) -> str:
    """Return all parameters as Markdown, by package and module."""
    parts, package = [], ''
    for cls in parameter_classes(root):
        owner = cls.__module__.split('.')[0]
        if owner != package:
            package = owner
            parts.append(f'## {package}\n')
        about = inspect.cleandoc(cls.__doc__ or '').split('\n', 1)[0]
        parts.append(f'### {cls.__module__.removeprefix(package + ".")}: {cls.__name__}\n\n{about}\n')
        parts.append(markdown_table(cls))
    return '\n'.join(parts)


def parameter_classes(root: Path) -> Iterator[type]:
    """Yield every dataclass with a field made by `param`: by packages, in each the nodes first."""
    paths = [path.relative_to(root / 'src') for path in root.glob('src/*/texture_*/**/*.py')]
    for path in sorted(paths, key=lambda path: (path.parts[0], path.parent.name != 'nodes', path)):
        if 'param(' not in (root / 'src' / path).read_text(encoding='utf-8'):
            continue
        module = importlib.import_module('.'.join(path.with_suffix('').parts[1:]))
        for cls in vars(module).values():
            if inspect.isclass(cls) and cls.__module__ == module.__name__ and _has_parameters(cls):
                yield cls


def _has_parameters(cls: type) -> bool:
    return dataclasses.is_dataclass(cls) and any('description' in item.metadata for item in dataclasses.fields(cls))


def papers(root: Path) -> str:
    """Return a table of each experiment whose figures are there: slides recognised in the paper, and here."""
    contents = [json.loads(path.read_text(encoding='utf-8')) for path in sorted((root / CHARTS).glob('*.json'))]
    return '\n'.join(_experiment(content) for content in contents if 'tasks' in content.get('numbers', {}))


def _experiment(content: dict[str, Any]) -> str:
    rows = ['| task | recipe | paper | here, with 95 % interval |', '|---|---|---|---|']
    for task, recipes in content['numbers']['tasks'].items():
        for recipe, figures in recipes.items():
            paper = figures.get('paper', {}).get('test')
            rows.append(f'| {task} | {recipe} | {percent(paper)} | {percent(figures["test"])} |')
    head = f'### {content["name"]}\n\nData: {content["data"]}. Split: {content["split"]}.\n'
    return head + difficulty(content['numbers'].get('difficulty') or {}) + '\n' + '\n'.join(rows) + '\n'


def difficulty(chosen: dict[str, Any]) -> str:
    """Return which figure the scene was made for: it is no result."""
    return f'The difficulty of the scene ({chosen["setting"]}) was set by {chosen["set_by"]}.\n' if chosen else ''


def grades(root: Path) -> str:
    """Return the mean error of roughness grades, paper and ours, on trained and unseen textures."""
    content = json.loads((root / CHARTS / 'roughness.json').read_text(encoding='utf-8'))
    numbers = content['numbers']
    rows = ['| regressor | paper: trained | paper: unseen | here: trained | here: unseen |', '|---|---|---|---|---|']
    for regressor, figures in numbers['regressors'].items():
        published = numbers['paper'].get(regressor, {})
        paper = [f'{published[kind]:.2f}' if published else '–' for kind in ('seen', 'unseen')]
        here = [f'{figures[kind]["error"]:.2f}' for kind in ('seen', 'unseen')]
        rows.append(f'| {" | ".join([regressor, *paper, *here])} |')
    about = f'Mean absolute error in grades from 1 to 5. Data: {content["data"]}. Split: {content["split"]}.'
    person = f'One person differs from the mean of the others by {numbers["one_person"]:.2f} (another study).'
    return f'{about} {person}\n\n' + '\n'.join(rows) + '\n'


def percent(share: float | list[float] | None) -> str:
    """Return a share in percent, with its interval if it has one."""
    if share is None:
        return '–'
    if isinstance(share, list):
        middle, low, high = (100 * value for value in share)
        return f'{middle:.1f} % ({low:.1f} to {high:.1f})'
    return f'{100 * share:.1f} %'
