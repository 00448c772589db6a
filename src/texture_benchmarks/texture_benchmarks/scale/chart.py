"""Chart of what more textures and more windows cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from texture_evaluation.charts import COLOURS, chart

Rows = Sequence[Mapping[str, Any]]
HEADROOM = 0.05  # above the highest point


def scale_chart(textures: Rows, windows: Rows, path: str | Path) -> Path:
    """Draw accuracy, training time, memory and window time by textures, and time and memory by windows.

    Parameters
    ----------
    textures, windows
        Figures by size, as `costs_of` returns them.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    labels = [row['labels'] for row in textures]
    counts = [row['training_windows'] for row in windows]
    title = 'More textures (default) and more windows (vibration-and-taxels): drawn features, simulated'
    with chart(path, (11.0, 5.6), title) as figure:
        grid = figure.subplots(2, 3)
        _line(grid[0, 0], labels, [100 * row['window_accuracy'] for row in textures], 'single windows', COLOURS[0])
        _line(grid[0, 0], labels, [100 * row['slide_accuracy'] for row in textures], 'slides of 1.5 s', COLOURS[2])
        grid[0, 0].set(ylabel='recognised (%)', ylim=(0, 101))
        grid[0, 0].legend()
        _line(grid[0, 1], labels, [row['features_to_estimate_us']['median'] for row in textures])
        grid[0, 1].set(ylabel='features to estimate, median (µs)')
        _costs(grid[0, 2], grid[1, 0], labels, textures)
        _costs(grid[1, 1], grid[1, 2], counts, windows)
        for axes in (*grid[0], grid[1, 0]):
            axes.set(xlabel='textures', xscale='log')
        for axes in grid[1, 1:]:
            axes.set(xlabel='training windows, 8 copies each', xscale='log')
    return Path(path)


def _costs(seconds: Any, memory: Any, sizes: Sequence[int], rows: Rows) -> None:
    _line(seconds, sizes, [row['train_s'] for row in rows])
    seconds.set(ylabel='training (s)')
    _line(memory, sizes, [row['memory_beyond_examples_mib'] for row in rows], 'beyond the examples')
    _line(memory, sizes, [row['memory_of_the_process_mib'] for row in rows], 'whole process', COLOURS[5])
    memory.set(ylabel='memory (MiB)')
    memory.legend()


def _line(axes: Any, x: Sequence[float], y: Sequence[float], label: str = '', colour: str = COLOURS[0]) -> None:
    below = axes.get_ylim()[1] if axes.lines else 0.0
    axes.plot(x, y, marker='.', color=colour, label=label)
    axes.set_ylim(0, max(below, (1 + HEADROOM) * max(y)))
