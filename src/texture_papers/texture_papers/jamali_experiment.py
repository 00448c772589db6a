# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Eight surfaces of a floor and a kitchen (Jamali & Sammut 2010)."""

from __future__ import annotations

from texture_papers.protocol import (
    Anchor,
    Figures,
    Finding,
    Method,
    MethodResults,
    PaperProtocol,
    RecognitionTask,
    folds,
)
from texture_papers.report import built_in, higher, more_spread, most_errors, seldom
from texture_papers.slides import EntireContacts, Visits
from texture_simulation.path import SimulatedSlide

TASK, ENTIRE = 'eight surfaces', 'the entire contact'
SLIDING = SimulatedSlide(0.05, 1.0, 2.0)
THREE, FIVE, AMPLITUDE = 'jamali-naive-bayes-3', 'jamali-naive-bayes-5', 'jamali-amplitude'
VINYLS = ('vinyl_1', 'vinyl_2')
ALIKE = (('carpet_1', 'carpet_2'), ('tile_1', 'tile_2'), VINYLS)


def findings(outcomes: MethodResults) -> list[Finding]:
    """Check the claims of section VI."""
    three, five = (outcomes[TASK, name] for name in (THREE, FIVE))
    amplitude = outcomes[TASK, AMPLITUDE]
    return [
        higher('five peaks are better than three (83.5 against 78 %)', five, three),
        *built_in(
            'the press varies from run to run so much that it is so',
            higher('five peaks are better than the mean amplitude (83.5 against 65.75 %)', five, amplitude),
            higher('three peaks are better than the mean amplitude (78 against 65.75 %)', three, amplitude),
        ),
        *built_in('which surfaces are alike was chosen', most_errors(
            'with three peaks most errors are within a material: carpet 1 and 2, tile 1 and 2',
            three,
            [('carpet_1', 'carpet_2'), ('tile_1', 'tile_2')],
        ), seldom('vinyl 1 and 2 are rarely confused (2 of 100 with three peaks)', three, VINYLS, 0.05)),
        more_spread('by amplitude, errors go to unlike materials more often', amplitude, three, ALIKE),
    ]  # fmt: skip


PROTOCOL = PaperProtocol(
    name='jamali',
    scene='jamali',
    paper='Jamali & Sammut 2010, "Material classification by tactile sensing using surface textures", section VI',
    tasks=(
        RecognitionTask(
            TASK,
            (Visits('1 N', 50, SLIDING),),
            (
                Method(THREE, Figures(test=0.78)),
                Method(FIVE, Figures(test=0.835)),
                Method(AMPLITUDE, Figures(test=0.6575)),
            ),
        ),
        RecognitionTask(ENTIRE, (EntireContacts('1 N', 50, SLIDING),), (Method(FIVE),)),
    ),
    divide=folds(10, 1),
    split='10-fold cross-validation',
    anchor=Anchor(TASK, FIVE, 0.835, 'table II'),
    findings=findings,
    quick_count=10,
)
