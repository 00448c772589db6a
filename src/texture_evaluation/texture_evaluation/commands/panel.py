# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""`texture panel`: evaluate the grades of a panel of people, and their agreement."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from texture_estimation.roughness import ROUGH, SMOOTH
from texture_evaluation.panel import read_ratings, report_of, write_panel

SHOWN_VIOLATIONS = 5
NAMED = {
    'krippendorff_alpha': "agreement, Krippendorff's alpha",
    'icc_single': 'ICC of one person',
    'icc_mean': 'ICC of the mean',
    'one_against_rest_error': 'one person against the mean of the others, grades',
    'one_against_rest_r': 'one person against the mean of the others, r',
}


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('ratings', type=Path, help='CSV file, one rating a line under rater,texture,grade')
    parser.add_argument('-o', '--out', type=Path, metavar='DIR', help='folder for figures, charts and grades.csv')
    parser.add_argument(
        '--scale',
        type=float,
        nargs=2,
        default=(SMOOTH, ROUGH),
        metavar=('LOW', 'HIGH'),
        help='smoothest and roughest rating of another scale, mapped linearly to 1 and 5',
    )


def run(options: argparse.Namespace) -> int:
    """Evaluate the panel, print the results, and write them with --out."""
    ratings = read_ratings(options.ratings, options.scale)
    print('\n'.join(summary(report_of(ratings))))
    for file in write_panel(ratings, options.out) if options.out else ():
        print(f'  {file}')
    return 0


def summary(report: Mapping[str, Any]) -> list[str]:
    """Return the figures in lines for people."""
    textures, violations = report['textures'], report['protocol_violations']
    lines = [f'{report["raters"]} people, {len(textures)} textures; {report["note"] or "grades as given"}']
    width = max(map(len, textures))
    lines += [
        f'  {name:<{width}}  {one["mean"]:.2f} ± {_number(one["std"])}   '
        f'votes {" ".join(f"{count:3d}" for count in one["votes"])}'
        for name, one in textures.items()
    ]
    lines += [f'{title}: {_number(report[name])}' for name, title in NAMED.items()]
    lines.append(f'protocol: {"kept" if not violations else f"not kept in {len(violations)} points"}')
    lines += [f'  {sentence}' for sentence in violations[:SHOWN_VIOLATIONS]]
    more = len(violations) - SHOWN_VIOLATIONS
    return lines + ([f'  and {more} more'] if more > 0 else [])


def _number(value: float | None) -> str:
    return '–' if value is None else f'{value:.2f}'
