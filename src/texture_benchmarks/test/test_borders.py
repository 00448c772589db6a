# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import numpy as np

from texture_benchmarks import borders
from texture_benchmarks.borders import (
    PEERS,
    SAME,
    BorderTrial,
    SlideAnswer,
    across_places,
    control,
    figures,
    for_recipe,
    middles,
    recipe_of,
)
from texture_benchmarks.study import BenchmarkOptions
from texture_core.types import Rejection, TextureEstimate
from texture_evaluation.metrics import SlideResult
from texture_recordings.dataset import SlideDataset

RATE_HZ = 100.0


def slides(seconds: float = 4.0, topic: str = 'signal') -> SlideDataset:
    time_s = np.arange(round(seconds * RATE_HZ))[:, None] / RATE_HZ
    return SlideDataset.from_arrays({topic: [time_s] * 4}, ['cork', 'felt'] * 2, {topic: RATE_HZ})


def ended(surface: str, label: str, *, known: bool, cluster: str) -> SlideAnswer:
    rejection = Rejection.NONE if known else Rejection.NOVEL
    said = [TextureEstimate(0, 'e', label, rejection, 0.9, decided=known, evidence_s=s, windows=1) for s in (0.5, 1.0)]
    return SlideAnswer(cluster, SlideResult(surface, [label] * 2, said))


def test_other_places_are_parts_that_no_slide_trained() -> None:
    halves = slides().in_parts(2)
    trained = halves.select('1', where=lambda one: one.place == '1/2')
    tested = across_places(halves.select('2'), trained)
    assert {border: set(own.condition('place')) for border, own in tested.items()} == {
        SAME: {'1/2'},
        'other place': {'2/2'},
    }


def test_of_a_long_slide_the_middle_is_kept() -> None:
    [one, *_] = middles(slides(20.0)).samples('signal')
    assert (one.samples[0, 0], len(one.samples)) == (6.0, 800)
    [whole, *_] = middles(slides(4.0)).samples('signal')
    assert len(whole.samples) == 400


def test_slow_taxels_are_read_as_a_vibration_by_recipes_that_need_one() -> None:
    taxels = slides(topic='signal_static')
    assert set(for_recipe(taxels, recipe_of('fast'))[0].signals) == {'signal'}
    assert for_recipe(taxels, recipe_of('taxels')) is taxels


def test_slides_of_one_track_count_once_for_the_interval() -> None:
    tested = [ended('cork', 'cork', known=True, cluster='cork 1/2')] * 50
    tested += [ended('felt', 'cork', known=True, cluster='felt 1/2')] * 50
    found = figures(tested)
    assert (found['slides'], found['clusters'], found['right'], found['accepted_wrong']) == (100, 2, 0.5, 0.5)
    assert found['interval']['right'] == [0.0, 1.0]
    assert found['after_s']['1'] == {'slides': 100, 'right': 0.5, 'accepted_correct': 0.5, 'accepted_wrong': 0.5}
    assert found['after_s']['5'] is None
    assert found['decided_wrong'] == 0.5


def test_a_surface_that_was_recorded_more_often_counts_once_in_the_mean_of_clusters() -> None:
    tested = [ended('cork', 'cork', known=True, cluster='cork monday')] * 9
    found = figures([*tested, ended('felt', 'cork', known=True, cluster='felt monday')])
    assert (found['right'], found['mean_of_clusters']['right']) == (0.9, 0.5)
    assert found['slides_of_clusters'] == {'cork monday': 9, 'felt monday': 1}


def test_a_control_tells_surfaces_that_were_slid_over_in_different_directions() -> None:
    time_s = np.arange(400)[:, None] / RATE_HZ
    labels, directions = ['cork', 'felt'] * 4, [0.0, 1.5] * 4
    made = SlideDataset.from_arrays({'signal': [time_s] * 8}, labels, {'signal': RATE_HZ}, direction_rad=directions)
    found = control(BorderTrial('d', (), made, {SAME: made}), 'direction alone')[SAME]
    assert all(one.result.end.label == one.result.surface and not one.result.end.known for one in found)


def test_a_rejected_slide_is_neither_known_and_right_nor_known_and_wrong() -> None:
    found = figures([ended('cork', 'cork', known=False, cluster='a'), ended('felt', 'cork', known=False, cluster='b')])
    assert (found['right'], found['accepted_correct'], found['accepted_wrong']) == (0.5, 0.0, 0.0)


def test_a_quick_run_tests_every_recipe_on_both_sides_of_the_border(tmp_path: Path) -> None:
    result = borders.run(BenchmarkOptions(tmp_path, quick=True))
    for border in (SAME, 'other place'):
        assert set(result.numbers[border]['simulated halves']) == {'fast', *PEERS}
    assert (tmp_path / 'borders.png').exists()
    assert result.numbers[SAME]['simulated halves']['fast']['right'] > 0.8
