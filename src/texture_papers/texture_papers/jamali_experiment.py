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
    Visits,
    folds,
)
from texture_papers.report import built_in, higher, more_spread, most_errors, seldom
from texture_simulation.path import SimulatedSlide

TASK = 'eight surfaces'
SLIDE_S = 2.0
THREE, FIVE, AMPLITUDE = 'jamali-naive-bayes-3', 'jamali-naive-bayes-5', 'jamali-amplitude'
SIGNAL = f'{AMPLITUDE}, mean of s'  # no recipe: the mean of a vibration tells next to nothing
# The paper's words can be read three ways; the first is nearest to them and to its figure.
READINGS = {
    AMPLITUDE: 'mean of |s|',
    SIGNAL: 'mean of s',
    'jamali-amplitude-deviation': 'mean of |s - mean(s)|',
}
FUTURE = ('jamali-stft', 'jamali-wavelets', 'jamali-symbols')  # section VII, without figures
VINYLS = ('vinyl_1', 'vinyl_2')
ALIKE = (('carpet_1', 'carpet_2'), ('tile_1', 'tile_2'), VINYLS)
TABLE_1 = (
    (38, 7, 4, 0, 0, 0, 1, 0),
    (3, 46, 1, 0, 0, 0, 0, 0),
    (7, 9, 33, 0, 0, 0, 0, 1),
    (0, 0, 0, 42, 7, 0, 1, 0),
    (0, 0, 0, 11, 37, 0, 2, 0),
    (0, 0, 1, 0, 0, 40, 1, 8),
    (0, 0, 1, 0, 1, 1, 39, 8),
    (0, 0, 4, 0, 0, 7, 2, 37),
)
TABLE_2 = (
    (41, 4, 2, 0, 0, 0, 0, 3),
    (6, 42, 1, 0, 0, 0, 0, 1),
    (2, 0, 39, 0, 0, 4, 0, 5),
    (0, 0, 0, 42, 6, 0, 2, 0),
    (1, 0, 0, 4, 44, 0, 0, 1),
    (0, 1, 1, 0, 0, 47, 1, 0),
    (2, 0, 0, 0, 0, 1, 40, 7),
    (1, 0, 1, 0, 0, 9, 0, 39),
)
TABLE_3 = (
    (34, 14, 0, 0, 2, 0, 0, 0),
    (4, 42, 0, 0, 0, 4, 0, 0),
    (0, 0, 41, 0, 0, 1, 1, 7),
    (1, 0, 2, 32, 8, 4, 1, 2),
    (2, 2, 4, 15, 17, 5, 0, 5),
    (0, 1, 1, 2, 2, 35, 6, 3),
    (0, 0, 3, 0, 0, 7, 33, 7),
    (0, 1, 8, 0, 2, 6, 4, 29),
)


def findings(outcomes: MethodResults) -> list[Finding]:
    """Check what section VI tells."""
    three, five = (outcomes[TASK, name] for name in (THREE, FIVE))
    amplitudes = {reading: outcomes[TASK, name] for name, reading in READINGS.items()}
    return [
        higher('five peaks are better than three (83.5 against 78 %)', five, three),
        *built_in('the press varies from run to run so much that it is so', *(
            higher(f'{count} peaks are better than the mean amplitude ({paper:g} against 65.75 %): {reading}', one, of)
            for count, paper, one in (('five', 83.5, five), ('three', 78, three))
            for reading, of in amplitudes.items())),
        *built_in('which surfaces are alike was chosen', most_errors(
            'with three peaks most errors are within a material: carpet 1 and 2, tile 1 and 2',
            three,
            [('carpet_1', 'carpet_2'), ('tile_1', 'tile_2')],
        ), seldom('vinyl 1 and 2 are hardly taken for each other (2 of 100 with three peaks)', three, VINYLS, 0.05)),
        *(more_spread(f'by amplitude, errors go to unlike materials more often: {reading}', amplitude, three, ALIKE)
          for reading, amplitude in amplitudes.items()),
    ]  # fmt: skip


PROTOCOL = PaperProtocol(
    name='jamali',
    scene='jamali',
    paper='Jamali & Sammut 2010, "Material classification by tactile sensing using surface textures", section VI',
    tasks=(
        RecognitionTask(
            TASK,
            (Visits('1 N', 50, SimulatedSlide(0.05, 1.0, SLIDE_S)),),
            (
                Method(THREE, Figures(test=0.78), confusion=TABLE_1),
                Method(FIVE, Figures(test=0.835), confusion=TABLE_2),
                Method(AMPLITUDE, Figures(test=0.6575), confusion=TABLE_3),
                Method(AMPLITUDE, features={'texture_papers.jamali:MeanAmplitude': {'of': 'signal'}}, label=SIGNAL),
                Method('jamali-amplitude-deviation'),
                *(Method(name) for name in FUTURE),
            ),
        ),
    ),
    divide=folds(10, 1),
    split='10-fold cross-validation',
    anchor=Anchor(TASK, FIVE, 0.835, 'table II'),
    findings=findings,
    quick_count=6,
)
