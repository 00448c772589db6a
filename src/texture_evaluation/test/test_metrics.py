# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import dataclasses

import numpy as np
import pytest

from texture_core.types import Rejection, TextureEstimate
from texture_evaluation import metrics
from texture_evaluation.evaluate import EvaluationReport, summary
from texture_evaluation.metrics import SlideResult


def slide(
    surface: str, decisions: str, *, confidences: tuple[float, ...] = (), known: bool = True, decided_from: int = 99
) -> SlideResult:
    """Return a slide whose windows of 0.5 s every 0.1 s decide letter by letter, each alone as with the evidence."""
    confidences = confidences or (0.5,) * len(decisions)
    rejection = Rejection.NONE if known else Rejection.NOVEL
    estimates = [
        TextureEstimate(
            0, 'e', label, rejection, confidences[k], decided=k >= decided_from, windows=k + 1, evidence_s=0.5 + 0.1 * k
        )
        for k, label in enumerate(decisions)
    ]
    return SlideResult(surface, list(decisions), estimates)


RESULTS = [slide('a', 'abaaaa'), slide('b', 'aaabbb')]


@pytest.mark.parametrize(('seconds', 'accuracy'), [(0.5, 0.5), (0.6, 0.0), (0.64, 0.0), (0.7, 0.5), (1.0, 1.0)])
def test_accuracy_at_a_time_is_that_of_the_last_decision_by_then(seconds: float, accuracy: float) -> None:
    assert metrics.accuracy_at(RESULTS, seconds) == pytest.approx(accuracy)


@pytest.mark.parametrize(
    ('decided_from', 'line'),
    [(2, 'as soon as decided: accuracy 100.0 %, after 0.70 s on average'), (99, 'as soon as decided: never decided')],
)
def test_a_report_states_when_slides_were_decided_or_that_none_was(decided_from: int, line: str) -> None:
    report = EvaluationReport(('a', 'b'), [slide('a', 'bbaa', decided_from=decided_from)], [], np.ones(4))
    assert line in summary(report)
    assert any(', once decided: ' in one for one in summary(report)) == bool(report.as_json()['once_decided'])
    assert bool(report.as_json()['early']) == (decided_from == 2)


def test_a_decision_is_early_when_it_is_certain_of_a_known_surface() -> None:
    decided = slide('a', 'bbaa', decided_from=2)
    novel = slide('a', 'aab', decided_from=0, known=False)
    never_sure = slide('a', 'aaab')
    assert metrics.early_decision([novel]) == {'accuracy': 0.0, 'mean_s': pytest.approx(0.7)}
    assert metrics.early_decision([decided]) == {'accuracy': 1.0, 'mean_s': pytest.approx(0.7)}
    assert metrics.early_decision([never_sure]) == {'accuracy': 0.0, 'mean_s': pytest.approx(0.8)}


def test_slides_over_untrained_surfaces_that_end_early_and_accepted_are_counted() -> None:
    unknown = [
        slide('x', 'aaa', decided_from=1),  # ends early, accepted
        slide('x', 'aaa'),  # accepted at its end
        slide('y', 'aaa', decided_from=0, known=False),
        slide('y', 'aaa', known=False),
    ]
    report = EvaluationReport(('a', 'b'), [slide('a', 'aaa')], unknown, np.ones(4))
    figures, lines = report.as_json(), summary(report)
    assert (figures['n_unknown'], figures['unknown_ended_early'], figures['unknown_accepted']) == (4, 0.25, 0.5)
    ends = 'accepted at the end 50.0 %, with early stopping ended early and accepted 25.0 %'
    assert f'of the 4 slides over other surfaces: {ends}; slides rejected at the end: 2 novel' in lines
    assert 'as soon as decided: none over trained surfaces' in lines
    none = EvaluationReport(('a', 'b'), [slide('a', 'aaa')], [], np.ones(4))
    assert (none.as_json()['unknown_ended_early'], none.as_json()['unknown_accepted']) == (None, None)


def test_rows_of_the_confusion_table_are_the_true_surfaces() -> None:
    np.testing.assert_array_equal(metrics.confusion(RESULTS, ('a', 'b')), [[5, 1], [3, 3]])


def test_what_is_not_classified_counts_as_not_recognised_and_stands_in_no_column() -> None:
    silent = SlideResult('a', ['', 'a'], [TextureEstimate(0, 'e', windows=1, evidence_s=0.5)])
    assert metrics.unclassified_windows([silent, *RESULTS]) == pytest.approx(1 / 14)
    assert metrics.accuracy_at([silent], 0.5) == 0.0
    np.testing.assert_array_equal(metrics.confusion([silent], ('a', 'b')), [[1, 0], [0, 0]])


def test_the_curve_of_windows_that_vote_has_a_point_for_each_complete_vote_alone() -> None:
    voted = [dataclasses.replace(result, voters=3) for result in RESULTS]
    seconds, accuracy = metrics.curve(voted)
    assert seconds.tolist() == pytest.approx([0.7, 1.0])  # after the third and the sixth window
    assert accuracy.tolist() == [0.5, 1.0]
    seconds, _ = metrics.curve([dataclasses.replace(result, voters=9) for result in RESULTS])
    assert seconds.tolist() == pytest.approx([1.0])  # no vote was complete: the slide's end decides


def test_confidence_that_equals_its_accuracy_has_no_calibration_error() -> None:
    honest = [slide('a', 'aaab', confidences=(0.75,) * 4)]
    assert metrics.calibration_error(honest) == pytest.approx(0.0)
    assert metrics.calibration_error([slide('a', 'bbbb', confidences=(0.9,) * 4)]) == pytest.approx(0.9)


def test_accepted_but_wrong_is_counted_once_decided_and_at_the_end() -> None:
    right = slide('a', 'aaaa', decided_from=1)
    soon_wrong = slide('a', 'bbaa', decided_from=1)  # decided for b, and right at its end
    late_wrong = slide('a', 'aaab', decided_from=0)  # decided for a, and wrong at its end
    never_decided = slide('a', 'aabb')  # known and wrong at its end, but never decided
    strange = slide('a', 'bbbb', decided_from=0, known=False)
    results = [right, soon_wrong, late_wrong, never_decided, strange]
    assert metrics.accepted_wrong(results) == {'early': pytest.approx(1 / 5), 'final': pytest.approx(2 / 5)}
    assert metrics.rejected(results) == {'early': pytest.approx(1 / 5), 'final': pytest.approx(1 / 5)}


def test_rejections_are_counted_by_their_reason_on_screen_and_in_the_figures() -> None:
    ends = [slide('a', 'a', known=False), slide('b', 'a', known=False), slide('b', 'b')]
    outside = TextureEstimate(0, 'e', 'a', Rejection.OUTSIDE_TRAINING, 0.5, windows=1, evidence_s=0.5)
    report = EvaluationReport(('a', 'b'), [*ends, SlideResult('a', ['a'], [outside])], [], np.ones(4))
    assert report.as_json()['rejections'] == {'novel': 2, 'outside_training': 1}
    assert 'slides rejected at the end: 2 novel, 1 outside training' in summary(report)


def test_each_line_names_the_slides_that_it_counts() -> None:
    known = [slide('a', 'a'), slide('a', 'b'), slide('a', 'a', known=False), slide('b', 'b', decided_from=0)]
    unknown = [slide('x', 'a', known=False)] * 4
    lines = summary(EvaluationReport(('a', 'b'), known, unknown, np.ones(4), unusable=('x/1',)))
    of = 'of the 4 slides over trained surfaces'
    ends = 'accuracy 75.0 %, accepted and correct 50.0 %, accepted but wrong 25.0 %, rejected 25.0 %'
    assert f'{of}, at the end: {ends}' in lines
    assert f'{of}, once decided: accepted but wrong 0.0 %, rejected 25.0 %' in lines
    early = 'with early stopping ended early and accepted 0.0 %'
    ends = f'accepted at the end 0.0 %, {early}; slides rejected at the end: 4 novel'
    assert f'of the 4 slides over other surfaces: {ends}' in lines
    assert lines[-1].startswith('1 slide not counted, as each window ')
    assert lines[-1].endswith(': x/1')


def test_both_lists_of_labels_are_named_where_no_tested_surface_was_trained() -> None:
    slides, few = (
        [slide('felt', 'a'), slide('cork', 'a', known=False)],
        'too little training: 12 slides could be held out',
    )
    report = EvaluationReport(('a', 'b'), [], slides, np.ones(2), too_little_training=few)
    lines = summary(report)
    assert 'no tested surface was trained, so there is no accuracy: trained are a, b; tested are cork, felt' in lines
    assert any(line.startswith('of the 2 slides over other surfaces: accepted at the end 50.0 %') for line in lines)
    assert lines[-1] == report.as_json()['too_little_training'] == few
    assert (report.as_json()['tested'], report.as_json()['rejections_of_untrained']) == (['cork', 'felt'], {'novel': 1})
