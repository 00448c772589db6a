import numpy as np

from texture_estimation.gaussians import SlideMoments


def test_running_moments_equal_those_of_all_windows_also_far_from_zero():
    windows = 1e6 + np.random.default_rng(0).normal(size=(500, 3))
    moments = SlideMoments(n_features=3)
    for count, window in enumerate(windows, start=1):
        moments.add(window)
        np.testing.assert_allclose(moments.mean, windows[:count].mean(axis=0), rtol=1e-12)
        np.testing.assert_allclose(moments.variance, windows[:count].var(axis=0), atol=1e-6)


def test_one_window_has_no_variance():
    moments = SlideMoments(n_features=2)
    moments.add(np.array([3.0, -1.0]))
    assert moments.mean.tolist() == [3.0, -1.0]
    assert moments.variance.tolist() == [0.0, 0.0]
