"""The figures of all recipes as one table in Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Cells = Mapping[str, Any]  # figures of recipes by their name
VOTE_S = '5.0'


def recipe_table(settings: Mapping[str, Mapping[str, Cells]]) -> str:
    """Return one row for each recipe: what it recognises on each data set and split, then what it costs.

    Parameters
    ----------
    settings
        Data set → split → recipe → its figures. The costs are those of the first split that it was tried on.
    """
    columns = [(name, split, cells) for name, splits in settings.items() for split, cells in splits.items()]
    first = columns[0][2]
    names = list(dict.fromkeys(name for _, _, cells in columns for name in cells))
    names.sort(key=lambda name: -_window(first.get(name)))
    head = [
        'recipe',
        *(f'{name}, {split}: window; slide (%)' for name, split, _ in columns),
        'unclassified (%)',
        'training (s)',
        'latency (µs)',
    ]
    rows = [
        [
            name,
            *(_accuracy(cells.get(name)) for _, _, cells in columns),
            *_costs(next(cells[name] for _, _, cells in columns if name in cells)),
        ]
        for name in names
    ]
    return '\n'.join(map(_line, [head, ['---'] * len(head), *rows])) + '\n'


def slide_accuracy(cell: Mapping[str, Any]) -> float | None:
    """Return the share of slides recognised after 5 s, or from all of their windows if they are shorter."""
    after = cell['accuracy_at_s'][VOTE_S]
    found: float | None = cell.get('accuracy_at_end') if after is None else after
    return found


def _window(cell: Mapping[str, Any] | None) -> float:
    return float(cell['window_accuracy']) if cell else -1.0


def _accuracy(cell: Mapping[str, Any] | None) -> str:
    return f'{_percent(cell["window_accuracy"])}; {_percent(slide_accuracy(cell))}' if cell else ''


def _costs(cell: Mapping[str, Any]) -> list[str]:
    return [
        _percent(cell['unclassified_windows']),
        f'{cell["train_s"]:.1f}',
        f'{cell["latency_us"]["median"]:.0f}',
    ]


def _percent(share: float | None) -> str:
    return '' if share is None else f'{100 * share:.1f}'


def _line(cells: Sequence[str]) -> str:
    return f'| {" | ".join(cells)} |'
