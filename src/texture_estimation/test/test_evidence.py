# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import dataclasses

import numpy as np
import pytest

from texture_estimation.acceptance import NEVER
from texture_estimation.domain import Domain
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.evidence_rules import (
    EVIDENCE_RULES,
    GroupedEvidence,
    MajorityVote,
    SoftVote,
    followed,
)
from texture_estimation.learners.learner import is_tied, log_softmax
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train
from texture_features.feature_set import fingerprint_difference


def vectors(examples, surface='felt', hop_s=0.1):
    """Return the windows of the first slide over a surface, `hop_s` apart, and the end of it."""
    return dataclasses.replace(examples, hop_s=hop_s).vectors(f'{surface}/0')


def with_acceptance(model, **changes):
    return dataclasses.replace(model, acceptance=dataclasses.replace(model.acceptance, **changes))


def unlimited(model):
    """Return the model as if its few held-out slides showed any confidence."""
    return with_acceptance(model, slides=100_000, decided_score=-NEVER)


def predict(model, stream):
    evidence = EvidenceAccumulator(model)
    return [evidence.update(vector) for vector in stream]


def test_evidence_grows_with_every_window_and_ends_with_a_final_estimate(model, examples):
    estimates = predict(model, vectors(examples))
    assert [estimate.windows for estimate in estimates] == [1, 2, 3, 4, 5, 6, 7, 8, 8]
    assert [estimate.final for estimate in estimates] == [False] * 8 + [True]
    assert estimates[-1].label == 'felt'
    assert estimates[-1].accepted
    assert estimates[-1].confidence == max(estimates[-1].probabilities)
    assert sum(estimates[-1].probabilities) == pytest.approx(1.0)
    assert len(estimates[-1].probabilities) == len(model.labels)


def test_the_final_estimate_states_how_many_windows_are_missing_from_it(make_examples):
    examples = make_examples(slides=12)
    model = unlimited(train(load_recipe('default'), examples))
    *windows, last = vectors(examples)
    final = predict(model, [*windows, dataclasses.replace(last, skipped=6)])[-1]
    assert final.message == '6 of 14 windows were left out, as samples were lost or not finite'
    assert predict(model, [*windows, last])[-1].message == ''


def test_overlapping_windows_count_the_sliding_time_once(model, examples):
    estimates = predict(model, vectors(examples, hop_s=0.1))
    assert [round(estimate.evidence_s, 3) for estimate in estimates[:4]] == [0.5, 0.6, 0.7, 0.8]
    assert estimates[0].stamp_ns == 500_000_000
    separate = predict(model, vectors(examples, hop_s=1.0))
    assert separate[2].evidence_s == pytest.approx(1.5)


def under(stream, **conditions):
    """Return vectors made under other conditions."""
    return [vector if vector.last else dataclasses.replace(vector, **conditions) for vector in stream]


def trained_at(model, speed_m_s):
    domain = Domain(motions=('linear_slide',), speed_m_s=(speed_m_s, speed_m_s))
    return with_acceptance(model, domain=domain)


def test_outside_the_training_nothing_is_accepted_or_decided_and_every_estimate_states_why(model, examples):
    slow = under(vectors(examples), speed_m_s=0.02, motion='linear_slide')
    sentence = 'outside the training: speed 0.02 m/s, trained 0.05 m/s'
    assert any(estimate.decided for estimate in predict(unlimited(model), slow))
    for estimate in predict(trained_at(unlimited(model), 0.05), slow):
        assert (estimate.accepted, estimate.decided, estimate.prediction_set) == (False, False, ())
        assert (estimate.label, estimate.message) == ('felt', sentence)


def test_a_label_of_slides_as_quiet_as_the_sensor_at_rest_is_rejected_and_others_accepted(model, examples):
    quiet = with_acceptance(unlimited(model), domain=Domain(quiet_labels=('felt',)))
    for estimate in predict(quiet, vectors(examples)):
        assert (estimate.accepted, estimate.decided, estimate.label) == (False, False, 'felt')
        assert estimate.message == (
            'outside the training: slides of felt are as quiet as the sensor at rest; slide faster, press harder, or '
            'use a finer sensor, and train so'
        )
    assert predict(quiet, vectors(examples, 'wood'))[-1].accepted


def test_the_mean_speed_of_the_exploration_counts_not_that_of_one_window(model, examples):
    first, *rest = under(vectors(examples), speed_m_s=0.05)
    estimates = predict(trained_at(model, 0.05), [dataclasses.replace(first, speed_m_s=0.035), *rest])
    assert [bool(estimate.message) for estimate in estimates[:3]] == [True, True, False]
    assert estimates[-1].accepted


def test_a_new_exploration_begins_again_even_without_an_end(model, examples):
    estimates = predict(model, vectors(examples)[:4] + vectors(examples, 'wood'))
    assert estimates[4].windows == 1
    assert estimates[-1].label == 'wood'


def test_a_window_that_is_not_finite_is_left_out_with_a_message(model, examples):
    stream = vectors(examples)
    values = stream[1].values.copy()
    values[2] = np.nan
    stream[1] = dataclasses.replace(stream[1], values=values)
    estimates = predict(model, stream)
    assert estimates[1].windows == 1
    assert "'signal/f2' is not finite" in estimates[1].message
    assert estimates[-1].windows == 7


def test_vectors_of_another_fingerprint_get_no_label_and_a_reason(model, examples):
    stream = [dataclasses.replace(v, feature_set='abcd1234 signal=2200Hz*1') for v in vectors(examples)[:-1]]
    for estimate in predict(model, [*stream, vectors(examples)[-1]]):
        assert (estimate.label, estimate.windows, estimate.probabilities) == ('', 0, ())
        assert "sampling rate of 'signal' is 2200 Hz, the model was trained at 1000 Hz" in estimate.message


def test_a_slide_without_windows_ends_with_a_reason(model, examples):
    [estimate] = predict(model, vectors(examples)[-1:])
    assert estimate.final
    assert estimate.label == ''
    assert estimate.message == (
        'no window could be used: the slide was shorter than the 0.5 s of a window, or its samples were lost; '
        'slide longer or more slowly'
    )


CHANNELS = "the number of channels of 'signal' is 2, that of the training 1; use a model of this sensor"


@pytest.mark.parametrize(
    ('came', 'trained', 'words'),
    [
        ('a signal=1000Hz*1', 'a signal=1000Hz*1', ''),
        ('a signal=1000Hz*1', 'a signal=2200Hz*1', 'sampling rate'),
        ('a signal=1000Hz*2', 'a signal=1000Hz*1', CHANNELS),
        ('a signal=1000Hz*1', 'a signal=1000Hz*1 signal_static=60Hz*12', 'signal, signal_static'),
        ('a signal=1000Hz*1', 'b signal=1000Hz*1', 'recipe'),
        ('', 'b signal=1000Hz*1', 'none'),
    ],
)
def test_the_part_that_differs_is_named(came, trained, words):
    assert words in fingerprint_difference(came, trained)
    assert bool(fingerprint_difference(came, trained)) == bool(words)


def voted(votes, group=5):
    """Return what is decided after each window, given for which of two labels it votes; None for undecided."""
    rule, decided = MajorityVote(windows=group), []
    evidence = GroupedEvidence(rule, 2)
    for number, vote in enumerate(votes, start=1):
        evidence.add(np.eye(2)[vote], float(number))
        posterior = rule.posterior(evidence.mean, evidence.windows, 1.0)
        decided.append(int(posterior.argmax()) if np.ptp(posterior) > 1e-9 else None)
    return decided


def test_five_windows_vote_together_and_then_the_next_five():
    # Roberge et al.: three equal answers of five decide, on 0.5 s; what came before does not count.
    assert voted([0, 0, 0, 0, 0, 1, 1, 1, 1, 1])[4:] == [0, 0, 0, 0, 0, 1]
    assert voted([0, 0, 0, 1, 1]) == [None, None, 0, 0, 0]
    assert voted([0, 0, 0, 0, 0, 1, 1, 1, 1, 1], group=0)[-1] is None  # five against five of all ten


@pytest.mark.parametrize(
    ('share', 'votes', 'answer'),
    [
        (0.6, [2, 2, 0, 2, 1], 2),
        (0.6, [2, 2, 0, 1, 1], None),
        (0.6, [2, 2, None, None, 1], None),
        (0.6, [2, None, 2, None, 2], 2),
        (0.6, [0, 0], None),
        (0.6, [0, 0, 0], 0),
        (0.6, [3] * 6 + [0] * 4, 3),
        (0.6, [3] * 5 + [0] * 5, None),
        (0.0, [0, 1, 2, 2], 2),
        (0.0, [0, 0, 2, 2], None),
        (0.0, [None, None], None),
    ],
)
def test_the_label_with_the_needed_share_of_five_votes_wins_and_a_tie_is_unclassified(share, votes, answer):
    rule, tie = MajorityVote(share=share), [1.0, 1.0, 0.0, 0.0]  # None: a window that speaks for two alike
    scores = np.array([tie if vote is None else np.eye(4)[vote] for vote in votes])
    posterior = rule.log_posterior(rule.window_evidence(log_softmax(scores)).mean(axis=0), float(len(votes)), 0.5)
    assert (None if is_tied(posterior) else int(posterior.argmax())) == answer


@pytest.mark.parametrize('name', EVIDENCE_RULES)
def test_many_slides_at_once_are_joined_as_one_by_one(name):
    rule = EVIDENCE_RULES[name]()
    log_p = log_softmax(np.random.default_rng(0).normal(size=(6, 5, 4)))
    means = rule.window_evidence(log_p).mean(axis=1)
    effective_windows = np.arange(1.0, 7.0)[:, None]
    together = rule.log_posterior(means, effective_windows, 0.7)
    assert np.isfinite(together).all()
    np.testing.assert_allclose(np.exp(together).sum(axis=1), 1.0)
    for mean, windows, expected in zip(means, effective_windows[:, 0], together, strict=True):
        alone = rule.log_posterior(mean, windows, 0.7)
        np.testing.assert_allclose(alone, expected, rtol=1e-12)  # sums may be ordered otherwise


def test_windows_late_in_a_slide_count_as_much_as_the_rule_defines():
    evidence = np.array([[0.0, -1.0]] * 5 + [[-1.0, 0.0]] * 8)
    equal, less = (followed(SoftVote(late_weight=weight), evidence, 1.0)[0] for weight in (1.0, 0.25))
    np.testing.assert_allclose(equal[:5], less[:5])
    np.testing.assert_allclose(equal[-1], [-8 / 13, -5 / 13])
    np.testing.assert_allclose(less[-1], [-2 / 7, -5 / 7])  # eight quarters are two windows
