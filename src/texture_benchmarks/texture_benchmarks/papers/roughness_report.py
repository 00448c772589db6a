"""The figures of the roughness experiment as tables for people, the paper's beside ours."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from texture_estimation.roughness.grades import TEST, Grades

PARTS = (('seen', 'training'), ('unseen', 'unseen'))


def lines(numbers: Mapping[str, Any], grades: Grades) -> Iterator[str]:
    """Yield the tables: errors, other conditions, textures one by one."""
    yield from _errors(numbers)
    others = numbers['other_conditions_unseen']
    for condition in others['ours']:
        row = [f'{name} {number(figures[condition]["error"])}' for name, figures in others.items()]
        yield f'  unseen textures at {condition}: {", ".join(row)}'
    splits = numbers['ours_other_splits']
    yield (
        f'  ours over {splits["splits"]} random choices of the training textures: error {splits["error"]:.2f}, '
        f'90 % intervals hold in {100 * splits["coverage_90"]:.0f} %'
    )
    skids = numbers['skids']
    yield (
        f'  with {skids["per_s"]:g} skids a second {100 * skids["with"]["refused"]:.0f} % of the windows are refused '
        f'(without, {100 * skids["without"]["refused"]:.1f} %): error of all {number(skids["with"]["error_of_all"])}, '
        f'of those graded {number(skids["with"]["error_of_the_others"])}'
    )
    for name, facts in numbers['tuning'].items():
        yield (
            f'  search for {name}: {facts["seconds"]:.0f} s, {facts["cpu_seconds"]:.0f} s of one core, for '
            f'{facts["generations"]} generations on {facts["scans"]} scans, {facts["individuals_tried"]} individuals'
        )
    latency = numbers['window_to_grade_us']
    yield f'  from window to grade: {latency["median"]:.0f} µs median, {latency["p99"]:.0f} µs 99th percentile'
    yield from _textures(numbers, grades)


def _errors(numbers: Mapping[str, Any]) -> Iterator[str]:
    yield 'mean absolute error (standard deviation within a texture), in grades:'
    yield (
        f'  {"":14}{"paper: training":>16}{"unseen":>14}'
        f'{"here: training":>18}{"unseen":>14}{"no grade":>10}{"left out":>10}'
        '   90 % intervals hold: unseen, left out'
    )
    for name, parts in numbers['regressors'].items():
        paper = numbers['paper'].get(name, {})
        unseen, left = parts['unseen'], parts['left_out']
        said = [pair(paper.get(part), paper.get(f'std_{part}')) for part, _ in PARTS]
        found = [pair(parts[part]['error'], parts[part]['std']) for part, _ in PARTS]
        yield (
            f'  {name:14}{said[0]:>16}{said[1]:>14}{found[0]:>18}{found[1]:>14}'
            f'{100 * unseen["without_grade"]:8.0f} %{number(left["error"]):>10}'
            f'   {number(unseen["coverage_90"])}, {number(left["coverage_90"])}'
        )
    middle = numbers['always_the_middle']
    yield f'  always 3{"":36}{middle["seen"]:11.2f}{middle["unseen"]:14.2f}{"":17}{middle["left_out"]:10.2f}'
    yield f'  one person against the others, in another study: {numbers["one_person"]}'
    errors = {name: parts['unseen']['error_of_the_mean'] for name, parts in numbers['regressors'].items()}
    reported = ', '.join(f'{name} {number(error)}' for name, error in errors.items())
    for finding in numbers['findings']:
        value, low, high = finding['interval']
        yield f'  {finding["verdict"]:14} {finding["claim"]}'
        yield f'  {"":14} here {finding["here"]}; decided by {value:+.2f} ({low:+.2f} to {high:+.2f})'
    yield f'  standard error of the unseen mean, ten textures being ten opinions: {reported}'


def _textures(numbers: Mapping[str, Any], grades: Grades) -> Iterator[str]:
    tables = {**numbers['by_texture'], 'left out': numbers['ours_left_out_by_texture']}
    width = max(map(len, grades.grades))
    yield f'  {"texture":{width}}{"people":>8}' + ''.join(f'{name:>13}' for name in tables)
    for texture, grade in grades.grades.items():
        unseen = grades.splits.get(texture) == TEST
        row = ''.join(f'{pair(table[texture]["mean"], table[texture]["std"]):>13}' for table in tables.values())
        yield f'  {texture:{width}}{grade:8g}{row}{"   unseen" if unseen else ""}'


def pair(mean: float | None, std: float | None) -> str:
    """Return 'mean (std)'."""
    return f'{number(mean)} ({number(std)})' if mean is not None else '–'


def number(value: float | None) -> str:
    """Return two digits after the point; a dash for what is not known."""
    return '–' if value is None or math.isnan(value) else f'{value:.2f}'
