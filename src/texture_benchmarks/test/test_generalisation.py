# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import json
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks import generalisation, peers
from texture_benchmarks.generalisation import (
    DECIDED,
    DISTANCE,
    END,
    HALVES,
    SPACING,
    Answer,
    Source,
    Trial,
    answers_of,
    figures,
    names_of,
)
from texture_benchmarks.peers import SVC, recipe_of
from texture_benchmarks.study import BenchmarkOptions
from texture_core.errors import InvalidData
from texture_recordings.dataset import SlideDataset

RATE_HZ = 100.0


def slides(seconds: float = 4.0, topic: str = 'signal', count: int = 4, **given: object) -> SlideDataset:
    time_s = np.arange(round(seconds * RATE_HZ))[:, None] / RATE_HZ
    labels = (['cork', 'felt'] * count)[:count]
    return SlideDataset.from_arrays({topic: [time_s] * count}, labels, {topic: RATE_HZ}, **given)  # type: ignore[arg-type]


def ended(surface: str, label: str, *, accepted: bool, cluster: str, decided: str = '') -> Answer:
    ends = {END: (label, accepted)} | ({DECIDED: (decided, True)} if decided else {})
    return Answer(cluster, surface, ends, '' if accepted else 'novel')


def test_of_a_long_slide_the_middle_is_kept() -> None:
    [one, *_] = generalisation._middles(slides(20.0)).samples('signal')
    assert (one.samples[0, 0], len(one.samples)) == (6.0, 800)
    [whole, *_] = generalisation._middles(slides(4.0)).samples('signal')
    assert len(whole.samples) == 400


def test_adjacent_parts_are_joined_to_one_stretch_of_the_slide() -> None:
    [stretch, *_] = generalisation._joined(slides(4.0).in_parts(10), (2, 5))
    [samples] = SlideDataset((stretch,)).samples('signal')
    np.testing.assert_allclose(samples.samples[[0, -1], 0], [0.8, 1.99], atol=1e-6)


def test_each_cell_is_trained_once_and_tested_at_every_distance() -> None:
    _, cells = generalisation._cells(slides(8.0, count=80, speed_m_s=0.02))
    alone = [one for one in cells if (DISTANCE, '0') in one.tested]
    assert len(alone) == 8 * len(generalisation.DRAWS)
    # From the end of the track there is one cell seven cells away; from inside there are two at most distances.
    counts = [sum(len(one.tested.get((DISTANCE, str(cells)), ())) for one in alone[:8]) for cells in range(8)]
    assert [count / counts[7] for count in counts] == [4, 7, 6, 5, 4, 3, 2, 1]
    assert not any(set(one.trained) & {name for names in one.tested.values() for name in names} for one in cells)
    assert {row for one in cells for table, row in one.tested if table == SPACING} >= {'2, 6: between'}


def test_slides_of_one_track_count_once_for_the_interval() -> None:
    tested = [ended('cork', 'cork', accepted=True, cluster='cork 1/2')] * 50
    tested += [ended('felt', 'cork', accepted=True, cluster='felt 1/2')] * 50
    found = figures(tested)
    assert (found['slides'], found['clusters'], found['accuracy'], found['accepted_wrong']) == (100, 2, 0.5, 0.5)
    assert found['interval']['accuracy'] == [0.0, 1.0]


def test_the_worst_time_counts_for_accepted_but_wrong() -> None:
    tested = [ended('cork', 'cork', accepted=True, cluster='a', decided='felt')]
    tested += [ended('felt', 'cork', accepted=False, cluster='b')] * 3
    found = figures(tested)
    assert (found['accepted_correct'], found['accepted_wrong'], found['most_accepted_wrong']) == (0.25, 0.0, 0.25)
    assert found['rejections'] == {'novel': 3}


def test_a_control_tells_surfaces_that_were_slid_over_in_different_directions() -> None:
    made = slides(count=8, direction_rad=[0.0, 1.5] * 4)
    names = made.names.tolist()
    trials = [Trial('', names, {('halves', 'same'): names})]
    [(cell, answers)] = answers_of('t', (made, trials), 0, recipe_of, 'direction alone')
    assert cell == ('halves', 'same', '')
    assert all(one.ends[END][0] == one.surface for one in answers)


def test_a_peer_answers_for_slides_that_have_a_window(monkeypatch) -> None:
    monkeypatch.setitem(peers.CLASSIFIERS, 'a peer', 'sklearn.dummy:DummyClassifier')  # the most frequent label
    signals = [np.zeros((round(seconds * RATE_HZ), 1)) for seconds in (2.0, 1.0, 0.3)]
    made = SlideDataset.from_arrays({'signal': signals}, ['cork', 'felt', 'felt'], {'signal': RATE_HZ})
    names = made.names.tolist()
    [(_, answers)] = answers_of('t', (made, [Trial('', names, {(HALVES, 'a row'): names})]), 0, recipe_of, 'a peer')
    assert [(one.surface, *one.ends[END]) for one in answers] == [('cork', 'cork', True), ('felt', 'cork', True)]


def test_what_is_trained_from_either_end_lies_in_no_test_of_another_stretch() -> None:
    trained, rows = generalisation.GAPS[1]
    _, [first, turned, *_] = generalisation._stretches(rows, trained, slides(8.0, count=80))
    [places] = [{name.rpartition(' part ')[2] for name in one} for one in first.tested.values()]
    assert {name.rpartition(' part ')[2] for name in first.trained} == {'0-4/10'}
    assert places == {'6-10/10'} == {name.rpartition(' part ')[2] for name in turned.trained}


def test_what_is_finished_is_not_computed_again_and_what_fails_is_named(tmp_path: Path, monkeypatch) -> None:
    def fails(*_: object) -> None:
        raise InvalidData('too few slides')

    monkeypatch.setattr(generalisation, '_run_part', fails)
    options = BenchmarkOptions(tmp_path, quick=True)
    row, cell = 'simulated, no gap', figures([ended('cork', 'cork', accepted=True, cluster='a')])
    line = {'part': f'simulated track, {SVC}', 'found': [[HALVES, row, SVC, cell]]}
    (tmp_path / generalisation.FINISHED).write_text(json.dumps(line) + '\n')
    numbers = generalisation.run(options).numbers
    assert numbers['missing'] == ['simulated track, default']
    assert numbers[HALVES] == {row: {SVC: json.loads(json.dumps(cell))}}


def test_without_some_sets_the_others_are_measured_and_these_are_named(tmp_path: Path, monkeypatch, capsys) -> None:
    (tmp_path / 'here').mkdir()
    made = slides(count=8, direction_rad=[0.0, 1.5] * 4)
    trial = Trial('', made.names.tolist(), {(HALVES, 'a row'): made.names.tolist()})
    source = Source(lambda _options: made, {'a part': (('direction alone',), lambda whole: (whole, [trial]))})
    monkeypatch.setattr(generalisation, 'SETS', {'here': source, 'gone': source})
    options = BenchmarkOptions(tmp_path / 'out', tmp_path)
    numbers = generalisation.run(options).numbers
    assert numbers['missing'] == ['a part (no recordings)']
    assert numbers[HALVES]['a row']['direction alone']['accuracy'] == 1.0
    assert f"'{tmp_path}' has no gone, left out" in capsys.readouterr().out
    (tmp_path / 'here').rmdir()
    with pytest.raises(InvalidData, match='give the folder that holds here/ with --data'):
        generalisation.run(options)


def test_names_are_of_the_requested_places() -> None:
    assert names_of(slides().in_parts(2), '2', '2/2') == ['cork/2 part 2/2', 'felt/2 part 2/2']


@pytest.mark.benchmark
def test_a_reduced_run_tests_recipe_and_peer_near_and_far(tmp_path: Path) -> None:
    numbers = generalisation.run(BenchmarkOptions(tmp_path, quick=True)).numbers
    assert not (tmp_path / generalisation.FINISHED).exists()  # all is in the JSON
    near, far = (numbers[HALVES][row] for row in ('simulated, same half', 'simulated, gap of 2.2 cm'))
    assert set(near) == set(far) == {'default', SVC}
    assert near['default']['accuracy'] > far['default']['accuracy']
    parts = near['default']['accepted_correct'], near['default']['accepted_wrong'], near['default']['rejections']
    assert parts[0] + parts[1] + sum(parts[2].values()) / near['default']['slides'] == pytest.approx(1.0)
