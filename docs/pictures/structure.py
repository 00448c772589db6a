# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Draw the modules of two source trees as areas: `python docs/pictures/structure.py BEFORE AFTER structure.png`."""

import ast
import sys
from pathlib import Path

import matplotlib.pyplot as plt

COLOURS = plt.get_cmap('tab20').colors


def modules(tree: Path) -> dict[str, list[int]]:
    """Return the lengths of the modules of each package, the longest first; tests and set-up are left out."""
    found: dict[str, list[int]] = {}
    for path in sorted((tree / 'src').glob('texture_*/texture_*/**/*.py')):
        if ast.parse(text := path.read_text()).body[1:]:
            found.setdefault(path.relative_to(tree / 'src').parts[0], []).append(len(text.splitlines()))
    return {package: sorted(lengths, reverse=True) for package, lengths in found.items()}


def rows(sizes: list[int], x: float, y: float, width: float, height: float) -> list[tuple[float, float, float, float]]:
    """Divide a rectangle among sizes by halving its longer side again and again."""
    if len(sizes) == 1:
        return [(x, y, width, height)]
    total, part, cut = sum(sizes), 0, 0
    while cut < len(sizes) - 1 and part + sizes[cut] / 2 < total / 2:
        part, cut = part + sizes[cut], cut + 1
    cut, part = max(cut, 1), sum(sizes[: max(cut, 1)])
    share = part / total
    if width > height:
        halves = (x, y, width * share, height), (x + width * share, y, width * (1 - share), height)
    else:
        halves = (x, y, width, height * share), (x, y + height * share, width, height * (1 - share))
    return [*rows(sizes[:cut], *halves[0]), *rows(sizes[cut:], *halves[1])]


def main(before: str, after: str, target: str) -> None:
    """Draw both trees beside each other on one scale."""
    trees = {name: modules(Path(tree)) for name, tree in (('before', before), ('after', after))}
    packages = sorted(set().union(*trees.values()))
    most = max(sum(map(sum, tree.values())) for tree in trees.values())
    figure, axes = plt.subplots(1, 2, figsize=(11, 5.6), constrained_layout=True)
    for axis, (name, tree) in zip(axes, trees.items(), strict=True):
        side = (sum(map(sum, tree.values())) / most) ** 0.5
        ordered = sorted(tree, key=lambda package: -sum(tree[package]))
        for package, area in zip(ordered, rows([sum(tree[p]) for p in ordered], 0, 0, side, side), strict=True):
            for x, y, width, height in rows(tree[package], *area):
                colour = COLOURS[packages.index(package) % len(COLOURS)]
                axis.add_patch(plt.Rectangle((x, y), width, height, facecolor=colour, edgecolor='white', linewidth=0.6))
            middle = area[0] + area[2] / 2, area[1] + area[3] / 2
            axis.text(*middle, package.removeprefix('texture_'), ha='center', va='center', fontsize=11)
        axis.set(xlim=(0, 1), ylim=(0, 1), aspect='equal', title=f'{name}: {sum(map(len, tree.values()))} modules')
        axis.axis('off')
    figure.savefig(target, dpi=110, bbox_inches='tight')


if __name__ == '__main__':
    main(*sys.argv[1:])
