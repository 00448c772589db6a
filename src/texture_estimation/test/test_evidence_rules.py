import numpy as np
import pytest

from texture_estimation.evidence_rules import EVIDENCE_RULES, GroupedEvidence, MajorityVote, SoftVote, running_means
from texture_estimation.numerics import is_tied, log_softmax


def joined(rule, votes, n_labels=4):
    """Return the log-posterior of windows that each speak for one label, or for two alike (None)."""
    scores = np.array(
        [np.eye(n_labels)[vote] if vote is not None else [1.0, 1.0, *[0.0] * (n_labels - 2)] for vote in votes]
    )
    return rule.log_posterior(rule.window_evidence(log_softmax(scores)).mean(axis=0), float(len(votes)), 0.5)


def winner(rule, votes):
    posterior = joined(rule, votes)
    return None if is_tied(posterior) else int(posterior.argmax())


@pytest.mark.parametrize(
    ('votes', 'answer'),
    [
        ([2, 2, 0, 2, 1], 2),
        ([2, 2, 0, 1, 1], None),
        ([2, 2, None, None, 1], None),
        ([2, None, 2, None, 2], 2),
        ([0, 0], None),
        ([0, 0, 0], 0),
        ([3] * 6 + [0] * 4, 3),
        ([3] * 5 + [0] * 5, None),
    ],
)
def test_of_five_parts_three_must_agree(votes, answer):
    assert winner(MajorityVote(), votes) == answer


def test_without_a_needed_share_the_most_votes_decide_and_a_tie_is_unclassified():
    assert winner(MajorityVote(share=0.0), [0, 1, 2, 2]) == 2
    assert winner(MajorityVote(share=0.0), [0, 0, 2, 2]) is None
    assert winner(MajorityVote(share=0.0), [None, None]) is None


def test_the_probability_of_the_majority_is_its_share_of_the_votes():
    np.testing.assert_allclose(np.exp(joined(MajorityVote(), [1, 1, 1, 0, 0])), [0.4, 0.6, 0.0, 0.0], atol=1e-5)


def test_windows_that_speak_for_two_labels_alike_are_unclassified_by_the_soft_vote_too():
    assert winner(SoftVote(), [None, None]) is None
    assert winner(SoftVote(), [None, 1]) == 1


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


def test_windows_late_in_a_slide_count_as_much_as_the_rule_says():
    evidence = np.array([[0.0, -1.0]] * 5 + [[-1.0, 0.0]] * 8)
    counts = np.arange(1.0, 14.0)
    equal, less = (running_means(SoftVote(late_weight=weight), evidence, counts) for weight in (1.0, 0.25))
    np.testing.assert_allclose(equal[:5], less[:5])
    np.testing.assert_allclose(equal[-1], [-8 / 13, -5 / 13])
    np.testing.assert_allclose(less[-1], [-2 / 7, -5 / 7])  # eight quarters are two windows


def test_a_vote_of_groups_counts_every_window_alike():
    np.testing.assert_array_equal(MajorityVote().window_weights(np.array([1.0, 5.0, 50.0])), 1.0)


@pytest.mark.parametrize('rule', [SoftVote(late_weight=0.25), MajorityVote()])
def test_one_window_weighs_what_it_weighs_among_many(rule):
    counts = np.array([1.0, 4.8, 5.0, 5.0 + 1e-12, 5.2, 9.0])
    assert [rule.window_weight(count) for count in counts.tolist()] == rule.window_weights(counts).tolist()


def test_evidence_gathered_window_by_window_has_the_same_mean_as_all_at_once():
    rule, grouped = SoftVote(late_weight=0.25), GroupedEvidence(n_labels=3)
    evidence, counts = np.random.default_rng(0).normal(size=(9, 3)), np.linspace(1.0, 9.0, 9)
    for row, count, mean in zip(evidence, counts, running_means(rule, evidence, counts), strict=True):
        grouped.add(row, new_s=0.5, weight=rule.window_weight(float(count)))
        np.testing.assert_allclose(grouped.mean, mean)
