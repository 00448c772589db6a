# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Self-explanatory charts: what is shown is in the title, units on the axes, colours safe for colour blindness."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from texture_core.errors import InvalidParameter

# Okabe & Ito 2008: distinguished by all kinds of colour vision.
COLOURS = ('#0072B2', '#E69F00', '#009E73', '#CC79A7', '#56B4E9', '#D55E00', '#000000')
STYLE: Any = {
    'axes.titlelocation': 'left',
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.grid': True,
    'grid.alpha': 0.3,
    'legend.frameon': False,
}
DPI = 150
MARGIN_IN = 0.12  # around a figure
PHONE_PX, TEXT_PX = 380, 9.2  # the text of a chart that is as wide as the page on a phone
TITLE_CHARACTERS = 116  # bold ones of 1 point in 1 inch, on average
CHART_FORMATS = ('.png', '.svg', '.pdf')
REDUCED = 'REDUCED, not for publishing'
is_reduced = ContextVar('is_reduced', default=False)  # whether what runs has fewer slides than its published figures


@contextmanager
def reduced_run(*, quick: bool) -> Iterator[None]:
    """Mark each chart and JSON that is made within a `with` block, if `quick`."""
    before = is_reduced.set(quick)
    try:
        yield
    finally:
        is_reduced.reset(before)


def refuse_chart_format(path: str | Path) -> None:
    """Refuse a chart whose file has an ending other than those of `CHART_FORMATS`."""
    if Path(path).suffix.lower() not in CHART_FORMATS:
        raise InvalidParameter(f"the chart is '{path}'; a file that ends in .png, .svg or .pdf is needed")


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Return the points, by rising cost, of which no other has at most the cost and at least the accuracy."""
    front: list[int] = []
    for index in sorted(range(len(points)), key=lambda index: (points[index][0], -points[index][1])):
        if not front or points[index][1] > points[front[-1]][1]:
            front.append(index)
    return front


@contextmanager
def chart(path: str | Path, size: tuple[float, float], title: str = '') -> Iterator[Figure]:
    """Give an empty figure, with a title over all its panels if wanted, and save it at the end.

    The size, in inches, determines that of the text: it can be read on a phone, whatever the width of the figure.
    No display is needed and no global state is touched.
    """
    points = 72.0 * (size[0] + 2 * MARGIN_IN) * TEXT_PX / PHONE_PX
    # Not pyplot, which would keep every figure and need a display.
    with mpl.rc_context({**STYLE, **dict.fromkeys(('font.size', 'axes.titlesize', 'figure.titlesize'), points)}):
        figure = Figure(figsize=size, layout='constrained')
        FigureCanvasAgg(figure)
        if title:
            lines = fill(title, round(TITLE_CHARACTERS * size[0] / points))
            figure.suptitle(lines, x=0.02, ha='left', fontweight='bold')
        if is_reduced.get():
            figure.text(0.5, 0.5, REDUCED, color='red', fontsize=16, rotation=30, ha='center', va='center')
        yield figure
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=DPI, bbox_inches='tight', pad_inches=MARGIN_IN)


def line_styles() -> Iterator[dict[str, Any]]:
    """Yield styles of lines that are distinguished."""
    for dashes in ('-', '--', ':'):
        for colour in COLOURS:
            yield {'color': colour, 'linestyle': dashes}
