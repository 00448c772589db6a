import numpy as np
import pytest

from texture_estimation.open_set.stopping_rule import StoppingRule, fit_stopping_rule

EFFECTIVE_WINDOWS = 1.0 + 0.5 * np.arange(9)


def slides(rng, count=400):
    """Return a random walk to the right decision: Wald's test of two means, the confidence being the true one."""
    steps = rng.normal(0.5, 1.0, size=(count, len(EFFECTIVE_WINDOWS)))
    odds = 2.0 * 0.5 * np.cumsum(steps, axis=1)  # log-likelihood ratio of mean 0.5 against -0.5
    confidences = 1.0 / (1.0 + np.exp(-np.abs(odds)))
    return list(confidences), list(odds > 0), [EFFECTIVE_WINDOWS] * count


def outcome(rule, data):
    ends = [
        next((k for k in range(len(w)) if rule.certain(c[k], w[k])), len(w) - 1) for c, _, w in zip(*data, strict=True)
    ]
    wrong = np.mean([not right[k] for k, (_, right, _) in zip(ends, zip(*data, strict=True), strict=True)])
    return wrong, np.mean([EFFECTIVE_WINDOWS[k] for k in ends])


def test_the_rule_errs_as_rarely_on_new_slides_and_ends_sooner_if_more_errors_are_allowed():
    rng = np.random.default_rng(0)
    data, new = slides(rng, 2000), slides(rng, 2000)
    rules = {wrong: fit_stopping_rule(*data, wrong) for wrong in (0.05, 0.1, 0.2)}
    errors, times = zip(*(outcome(rule, new) for rule in rules.values()), strict=True)
    assert errors == pytest.approx(tuple(rules), abs=0.025)
    assert times[0] > times[1] > times[2]


def test_slides_that_are_right_at_once_end_at_once():
    assert fit_stopping_rule([np.full(9, 0.6)] * 5, [np.ones(9, bool)] * 5, [EFFECTIVE_WINDOWS] * 5, 0.02).certain(
        0.6, 1.0
    )


def test_where_no_rule_errs_rarely_enough_the_one_that_errs_least_is_taken():
    wrong_at_first = np.arange(9) >= 4
    rule = fit_stopping_rule(
        [np.full(9, 0.9)] * 5 + [np.full(9, 0.4)],
        [wrong_at_first] * 5 + [np.zeros(9, bool)],
        [EFFECTIVE_WINDOWS] * 6,
        0.0,
    )
    assert not rule.certain(0.9, 2.0)
    assert rule.certain(0.9, 3.0)


def test_without_anything_held_out_confidence_alone_decides():
    assert StoppingRule().certain(0.96, 1.0)
    assert not StoppingRule().certain(0.9, 100.0)
