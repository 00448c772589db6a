import numpy as np
import pytest

from texture_estimation.decisions import SlideCourse, StoppingRule, fit_open_set_rule, fit_stopping_rule

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


def test_at_the_start_of_a_slide_a_smaller_novelty_score_is_needed():
    rule = StoppingRule(confidence=0.9, novelty_score=40.0, early_novelty_score=0.5)
    assert rule.certain(0.95, 1.0, 0.49)
    assert not rule.certain(0.95, 1.0, 0.51)
    assert rule.certain(0.95, 2.0, 2.9)  # six times as much after each further window
    assert not rule.certain(0.95, 2.0, 3.1)
    assert rule.certain(0.95, 3.0, 17.0)
    assert not rule.certain(0.95, 3.0, 19.0)
    assert not rule.certain(0.95, 4.0, 41.0)
    assert not StoppingRule(novelty_score=0.5, early_novelty_score=1.0).certain(0.99, 1.0, 0.8)


def test_the_early_limit_of_a_slide_of_any_length_is_a_number():
    assert StoppingRule(confidence=0.9, early_novelty_score=0.05).certain(0.95, 5000.0, 3.0)
    assert not StoppingRule(confidence=0.9, early_novelty_score=0.0).certain(0.95, 5000.0, 3.0)


def course(right, novelty_score, disturbance=''):
    """Return a slide of which the same is said at all times, with full confidence."""
    count = len(EFFECTIVE_WINDOWS)
    return SlideCourse(
        confidences=np.full(count, 0.99),
        right=np.full(count, right),
        effective_windows=EFFECTIVE_WINDOWS,
        known=np.ones(count, bool),
        novelty_scores=np.full(count, novelty_score),
        disturbance=disturbance,
    )


def test_the_rule_stops_few_disturbed_slides_wrongly():
    undisturbed = [course(right=True, novelty_score=0.1)] * 50
    strange = [course(right=False, novelty_score=8.0, disturbance='gain')] * 5
    harmless = [course(right=True, novelty_score=0.1, disturbance='gain')] * 95
    strict, lax = (fit_open_set_rule([*undisturbed, *strange, *harmless], 0.02, wrong) for wrong in (0.02, 0.05))
    assert strict.certain(0.99, 1.0, 0.1)
    assert not strict.certain(0.99, 1.0, 8.0)
    assert lax.certain(0.99, 1.0, 8.0)


def test_an_early_limit_is_kept_while_the_rest_of_the_rule_is_fitted():
    slides = [course(right=True, novelty_score=0.7)] * 50
    free, limited = (fit_open_set_rule(slides, 0.02, 0.007, limit) for limit in (1e6, 0.4))
    assert free.certain(0.99, 1.0, 0.7)
    assert not limited.certain(0.99, 1.2, 0.7)
    assert limited.certain(0.99, 1.4, 0.7)  # 0.4 · 6^0.4 = 0.82
