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
EXPERIMENTS = (
    'ets-linear',
    'ets-circular',
    'ets-fine',
    'friction',
    'jamali',
    'kaboli',
    'kaboli-shapes',
    'hu',
    'roughness',
)
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
    seeds = len(content['numbers'].get('seeds', [0]))
    rows = [
        f'| task | recipe | paper | here, with 95 % interval over slides | mean of {seeds} seeds, with 95 % interval |',
        '|---|---|---|---|---|',
    ]
    for task, recipes in content['numbers']['tasks'].items():
        for recipe, figures in recipes.items():
            paper = percent(figures.get('paper', {}).get('test'))
            here, over_seeds = percent(figures['test']), percent(figures.get('over_seeds'))
            rows.append(f'| {task} | {recipe} | {paper} | {here} | {over_seeds} |')
    head = f'### {content["name"]}\n\nData: {content["data"]}. Split: {content["split"]}.\n'
    return head + difficulty(content['numbers'].get('difficulty') or {}) + '\n' + '\n'.join(rows) + '\n'


def experiment(name: str, root: Path) -> str:
    """Return the tables of one experiment: methods, anchor and findings, over the seeds that it was run with."""
    content = json.loads((root / CHARTS / f'{name}.json').read_text(encoding='utf-8'))
    numbers = content['numbers']
    seeds = numbers.get('seeds', [numbers.get('seed', 0)])
    rows = [
        f'| task | method | paper: test | simulated, seed {seeds[0]}: training | test (95 % over slides) '
        f'| unclassified | over {len(seeds)} seeds: test (95 %) |',
        '|---|---|---|---|---|---|---|',
    ]
    for task, methods in numbers.get('tasks', {}).items():
        for method, figures in methods.items():
            cells = [
                percent(figures.get('paper', {}).get('test')),
                percent(figures.get('learning')),
                percent(figures['test']),
                percent(figures['unclassified']),
                percent(figures.get('over_seeds')),
            ]
            rows.append(f'| {task} | {method} | {" | ".join(cells)} |')
            for condition, part in figures.get('conditions', {}).items():
                shares = f'{percent(part["test"])} | – | {percent(part.get("over_seeds"))}'
                rows.append(f'| {task} | {method}: {condition} | – | – | {shares} |')
    table = '\n'.join(rows) if numbers.get('tasks') else ''
    anchor = difficulty(numbers.get('difficulty') or {})
    unit = 100.0 if numbers.get('tasks') else 1.0  # points of a share, or grades
    return f'{table}\n\n{anchor}\n{_findings(numbers["findings"], len(seeds), unit)}\n'


def _findings(found: list[dict[str, Any]], seeds: int, unit: float) -> str:
    rows = [f'| finding | seed 0 | decided by the mean over {seeds} seeds (95 %) | verdict |', '|---|---|---|---|']
    for finding in found:
        decides = signed(finding.get('over_seeds', finding['interval']), unit)
        claim = finding['claim'].replace('|', '\\|')  # of |s|
        rows.append(f'| {claim} | {finding["here"]} | {decides} | **{finding["verdict"]}** |')
    return '\n'.join(rows)


def signed(interval: list[float], unit: float) -> str:
    """Return a difference with its interval, times a unit."""
    digits = 1 if unit > 1.0 else 2
    middle, low, high = (unit * value for value in interval)
    return f'{middle:+.{digits}f} ({low:+.{digits}f} to {high:+.{digits}f})'


def difficulty(chosen: dict[str, Any]) -> str:
    """Return which figure the scene was made for: it is no result."""
    if not chosen:
        return ''
    shortfall = f'; {chosen["shortfall"]}' if chosen.get('shortfall') else ''
    return f'Anchor, no finding: {chosen["setting"]} was set by {chosen["set_by"]}{shortfall}.\n'


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


def later(root: Path) -> str:
    """Return a table of the recipes on later slides, each with the definition that was measured, best first."""
    numbers = json.loads((root / CHARTS / 'recipes_later.json').read_text(encoding='utf-8'))['numbers']
    [cells] = next(
        setting for setting in numbers.values() if isinstance(setting, dict) and 'by time' in setting
    ).values()
    rows = [
        '| recipe | single windows or votes | slides after 5 s | windows or votes unclassified | definition |',
        '|---|---|---|---|---|',
    ]
    for name, cell in sorted(cells.items(), key=lambda item: -item[1]['window_accuracy']):
        after = cell['accuracy_at_s']['5.0']
        shares = (cell['window_accuracy'], after, cell['unclassified_windows'])
        rows.append(f'| {name} | {" | ".join(map(percent, shares))} | {cell.get("definition", "an earlier one")} |')
    return '\n'.join(rows) + '\n'


def percent(share: float | list[float] | None) -> str:
    """Return a share in percent, with its interval if it has one."""
    if share is None:
        return '–'
    if isinstance(share, list):
        middle, low, high = (100 * value for value in share)
        return f'{middle:.1f} % ({low:.1f} to {high:.1f})'
    return f'{100 * share:.1f} %'
