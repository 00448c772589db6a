import numpy as np
import pytest

from texture_estimation.gaussians import LENGTHS, SlideGaussians, SlideMoments

WINDOWS, SLIDES = 12, 8


def slide(centre, seed, spread=1.0):
    rng = np.random.default_rng(seed)
    return np.asarray(centre) + 0.3 * rng.normal(size=3) + spread * rng.normal(size=(WINDOWS, 3))


def trained(centres=((0.0, 0.0, 0.0), (6.0, 0.0, 0.0)), spread=1.0):
    values = np.concatenate(
        [slide(centre, 100 * code + number, spread) for code, centre in enumerate(centres) for number in range(SLIDES)]
    )
    slides = np.repeat(np.arange(SLIDES * len(centres)), WINDOWS)
    return SlideGaussians.fit(values, slides // SLIDES, slides, overlap=1.0)


def best(gaussians, values, effective_windows=float(WINDOWS)):
    shares = gaussians.shares(values.mean(axis=0), values.var(axis=0), effective_windows)
    return int(gaussians.combined(np.full(gaussians.n_trained, 1.0 / gaussians.n_trained), shares).argmax())


@pytest.mark.parametrize('length', LENGTHS)
def test_a_texture_of_one_slide_is_recognised_at_every_length_and_the_trained_ones_stay(length):
    gaussians = trained().with_added([slide([0.0, 8.0, 0.0], 1)], np.array([2]))
    part = slice(0, round(length))
    assert best(gaussians, slide([0.0, 8.0, 0.0], 2)[part], length) == 2
    assert best(gaussians, slide([0.0, 0.0, 0.0], 3)[part], length) != 2
    assert best(gaussians, slide([6.0, 0.0, 0.0], 4)[part], length) != 2


def test_textures_that_differ_in_their_variation_alone_are_told_apart_in_a_long_slide():
    gaussians = trained(spread=0.5).with_added([slide([0.0, 0.0, 0.0], 1, spread=3.0)], np.array([2]))
    still, varied = slide([0.0, 0.0, 0.0], 2, spread=0.5), slide([0.0, 0.0, 0.0], 3, spread=3.0)
    assert best(gaussians, varied) == 2
    assert best(gaussians, still) != 2


def test_trained_textures_share_what_they_have_together_as_they_were():
    gaussians = trained().with_added([slide([0.0, 8.0, 0.0], 1)], np.array([2]))
    values = slide([0.0, 3.0, 0.0], 2)
    shares = gaussians.shares(values.mean(axis=0), values.var(axis=0), float(WINDOWS))
    probabilities = gaussians.combined(np.array([0.9, 0.1]), shares)
    assert probabilities.sum() == pytest.approx(1.0)
    assert probabilities[0] / probabilities[1] == pytest.approx(9.0)


def test_a_trained_texture_under_other_conditions_is_recognised_under_both():
    gaussians = trained().with_added([slide([0.0, 0.0, 9.0], 1)], np.array([1]))
    assert best(gaussians, slide([0.0, 0.0, 9.0], 2)) == 1
    values = slide([6.0, 0.0, 0.0], 3)
    shares = gaussians.shares(values.mean(axis=0), values.var(axis=0), float(WINDOWS))
    assert int(gaussians.combined(np.array([0.1, 0.9]), shares).argmax()) == 1


def test_two_equal_slides_are_surer_than_one_of_them():
    added, asked = slide([0.0, 8.0, 0.0], 1), slide([0.0, 7.0, 0.0], 2)
    once, twice = (trained().with_added([added] * count, np.full(count, 2)) for count in (1, 2))
    first, second = (one.shares(asked.mean(axis=0), asked.var(axis=0), float(WINDOWS)) for one in (once, twice))
    assert np.isfinite(first).all() and np.isfinite(second).all()
    assert best(once, added) == best(twice, added) == 2


def test_a_slide_of_a_single_window_is_an_example():
    gaussians = trained().with_added([np.array([[0.0, 8.0, 0.0]])], np.array([2]))
    assert best(gaussians, np.array([[0.0, 7.5, 0.0]]), 1.0) == 2
    assert int(gaussians.window_shares(np.array([0.0, 8.0, 0.0])).argmax()) == 2


def test_added_slides_take_the_place_of_those_added_before_and_none_is_left_of_them():
    first, second = slide([0.0, 8.0, 0.0], 1), slide([0.0, 0.0, 8.0], 2)
    again = trained().with_added([first], np.array([2])).with_added([second], np.array([2]))
    direct = trained().with_added([second], np.array([2]))
    asked = slide([1.0, 2.0, 3.0], 3)
    np.testing.assert_array_equal(*(one.shares(asked.mean(axis=0), asked.var(axis=0), 3.0) for one in (again, direct)))


def test_training_slides_of_one_window_have_gaussians_of_one_length():
    values, codes = np.array([[0.0], [0.2], [5.0], [5.2]]), np.array([0, 0, 1, 1])
    gaussians = SlideGaussians.fit(values, codes, np.arange(4), overlap=0.2)
    assert gaussians.lengths == (1.0,)
    moments = SlideMoments(n_features=1)
    moments.add(np.array([5.1]))
    assert gaussians.shares(moments.mean, moments.variance, 20.0).argmax() == 1


def test_the_order_of_added_slides_does_not_matter():
    slides, asked = [slide([0.0, 8.0, 0.0], seed) for seed in (1, 2, 3)], slide([0.0, 7.0, 0.0], 4)
    there, back = (trained().with_added(order, np.array([2, 2, 2])) for order in (slides, slides[::-1]))
    np.testing.assert_allclose(there.window_shares(asked), back.window_shares(asked), atol=1e-9)


@pytest.mark.parametrize('count', [1, 2])
def test_very_few_examples_suffice_for_training(count):
    values = np.repeat([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]], count, axis=0)
    codes = np.repeat([0, 1], count)
    gaussians = SlideGaussians.fit(values, codes, codes, overlap=1.0).with_added([values[:1] + 4.0], np.array([2]))
    assert np.isfinite(gaussians.window_shares(values)).all()
    assert (gaussians.window_shares(values).argmax(axis=1) == codes).all()


def test_constant_and_doubled_features_do_no_harm():
    values = np.concatenate([slide([0.0, 0.0, 0.0], 1), slide([8.0, 0.0, 0.0], 2)])
    values[:, 1], values[:, 2] = 7.0, values[:, 0]
    codes = np.repeat([0, 1], WINDOWS)
    gaussians = SlideGaussians.fit(values, codes, np.arange(2 * WINDOWS) // 3, overlap=1.0)
    assert (gaussians.window_shares(values).argmax(axis=1) == codes).all()


def test_probabilities_are_neither_sure_of_everything_nor_of_nothing():
    gaussians = trained().with_added([slide([0.0, 8.0, 0.0], 1)], np.array([2]))
    between = np.exp(gaussians.window_shares(slide([3.0, 0.0, 0.0], 2)))
    assert 0.5 < between.max(axis=1).mean() < 0.99
