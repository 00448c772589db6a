# SPDX-License-Identifier: Apache-2.0
"""`texture panel`: say what a panel of people grades as rough, and how far they agree."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from texture_estimation.roughness import ROUGH, SMOOTH
from texture_evaluation.panel import PanelReport, deviations_chart, examine, read_ratings, votes_chart

SHOWN_VIOLATIONS = 5


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
    """Examine the panel, print what it says, and write it if asked to."""
    low, high = options.scale
    report = examine(read_ratings(options.ratings, (low, high)))
    for line in summary(report):
        print(line)
    if options.out:
        ratings = report.ratings
        files = report.write(options.out)
        charts = votes_chart(ratings, options.out / 'votes.png'), deviations_chart(ratings, options.out / 'grades.png')
        for file in (*files, *charts):
            print(f'  {file}')
    return 0


def summary(report: PanelReport) -> list[str]:
    """Return the figures in lines for people."""
    ratings = report.ratings
    lines = [
        f'{len(ratings.raters)} people, {len(ratings.textures)} textures; {ratings.note or "grades as they stand"}'
    ]
    rows = zip(ratings.textures, ratings.means, ratings.deviations, ratings.votes, strict=True)
    width = max(map(len, ratings.textures))
    lines += [
        f'  {name:<{width}}  {mean:.2f} ± {_number(float(std))}   votes {" ".join(f"{count:3d}" for count in votes)}'
        for name, mean, std, votes in rows
    ]
    lines += [
        f"agreement: Krippendorff's alpha {_number(report.alpha)}, ICC of one person {_number(report.icc_single)}, "
        f'of the mean {_number(report.icc_mean)}',
        f'one person against the mean of the others: {_number(report.error)} grades apart, '
        f'r = {_number(report.correlation)}',
        f'protocol: {"kept" if not report.violations else f"not kept in {len(report.violations)} points"}',
    ]
    lines += [f'  {sentence}' for sentence in report.violations[:SHOWN_VIOLATIONS]]
    more = len(report.violations) - SHOWN_VIOLATIONS
    return lines + ([f'  and {more} more'] if more > 0 else [])


def _number(value: float) -> str:
    return '–' if math.isnan(value) else f'{value:.2f}'
