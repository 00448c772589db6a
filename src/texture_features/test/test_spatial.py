import numpy as np
import pytest

from texture_core.errors import InvalidData, InvalidParameter
from texture_features.feature import ArraySpeedEstimator, WindowBatch
from texture_features.feature_set import FEATURES, FeatureSet

RATE_HZ = 400.0
PITCH_M = 4e-3
SPEEDS_M_S = (0.02, 0.05, 0.1)
PLACES_M = np.array([0.0, 1e-3, 5e-3, 9e-3])


def slide(speed_m_s, distance_m=0.05, places_m=PLACES_M, surface=None):
    """Slide an array of taxels over a surface: each measures the height at its own place."""
    along = np.arange(round(distance_m / speed_m_s * RATE_HZ)) / RATE_HZ * speed_m_s
    surface = surface or (lambda x: np.sin(2 * np.pi * x / PITCH_M))
    return surface(along[:, None] + places_m)


def measured(speed_m_s, **options):
    return WindowBatch(slide(speed_m_s, **options), RATE_HZ, np.array(speed_m_s))


def rough(seed=0, waves=60):
    """Return a surface of many waves, 2 to 20 mm long."""
    rng = np.random.default_rng(seed)
    per_m, phase = rng.uniform(50.0, 500.0, waves), rng.uniform(0.0, 2 * np.pi, waves)
    return lambda x: np.sin(2 * np.pi * x[..., None] * per_m + phase).sum(axis=-1)


@pytest.mark.parametrize('speed', SPEEDS_M_S)
@pytest.mark.parametrize('name', ['spatial_bands', 'mean_spatial_bands'])
def test_the_line_of_a_grating_stands_at_one_over_its_pitch_at_every_speed(name, speed):
    feature = FEATURES[name](bands=24, longest_m=32e-3, shortest_m=1e-3)
    highest = feature(measured(speed)).argmax(axis=-1)
    low, high = feature.edges_per_m[highest], feature.edges_per_m[highest + 1]
    assert ((low <= 1 / PITCH_M) & (high >= 1 / PITCH_M)).all()


def test_spatial_bands_are_those_of_the_surface_not_of_the_speed():
    feature = FEATURES['mean_spatial_bands'](bands=8, longest_m=20e-3, shortest_m=2e-3, normalised=False)
    slow, fast = (feature(measured(speed, distance_m=0.5, surface=rough())) for speed in (0.05, 0.1))
    np.testing.assert_allclose(slow, fast, atol=0.02)


def test_the_power_in_all_bands_adds_up_to_the_variance():
    feature = FEATURES['spatial_bands'](bands=64, longest_m=0.1, shortest_m=1e-3, normalised=False)
    density = np.exp(feature(measured(0.05, distance_m=0.5)))[0]
    assert (density * np.diff(feature.edges_per_m)).sum() == pytest.approx(0.5, rel=0.02)


def test_the_mean_over_the_taxels_does_not_know_which_measured_it():
    samples = slide(0.05) * np.array([1.0, 2.0, 3.0, 4.0])
    for name in ('mean_spatial_bands', 'mean_statistics'):
        feature = FEATURES[name]()
        there, swapped = (feature(WindowBatch(x, RATE_HZ, np.array(0.05))) for x in (samples, samples[:, ::-1]))
        np.testing.assert_allclose(there, swapped, rtol=1e-9)


@pytest.mark.parametrize('name', ['spatial_bands', 'mean_spatial_bands'])
def test_a_harder_touch_leaves_the_normalised_bands_and_no_offset_counts(name):
    feature = FEATURES[name](floor=1e-30)
    soft = feature(measured(0.05, surface=rough()))
    hard = feature(WindowBatch(5.0 + 3.0 * slide(0.05, surface=rough()), RATE_HZ, np.array(0.05)))
    np.testing.assert_allclose(soft, hard, atol=1e-4)


@pytest.mark.parametrize('speed', [np.nan, 0.0, -0.1])
@pytest.mark.parametrize('name', ['spatial_bands', 'mean_spatial_bands'])
def test_without_movement_there_are_no_waves(name, speed):
    assert np.isnan(FEATURES[name]()(WindowBatch(slide(0.05), RATE_HZ, np.array(speed)))).all()


def test_windows_of_different_speeds_are_described_together_as_each_alone():
    samples = np.stack([slide(0.05, distance_m=0.02, surface=rough(seed)) for seed in range(3)])
    speed = np.array([0.02, np.nan, 0.1])
    for name in ('spatial_bands', 'mean_spatial_bands'):
        feature = FEATURES[name]()
        together = feature(WindowBatch(samples, RATE_HZ, speed))
        for window, at, values in zip(samples, speed, together, strict=True):
            np.testing.assert_array_equal(feature(WindowBatch(window, RATE_HZ, np.array(at))), values)


def test_a_band_beyond_half_the_sampling_rate_holds_the_density_there():
    feature = FEATURES['spatial_bands'](bands=4, longest_m=2e-4, shortest_m=1e-4, normalised=False)
    values = feature(measured(0.1))
    np.testing.assert_array_equal(values, np.repeat(values[..., :1], 4, axis=-1))


def test_shape_has_its_closed_forms():
    ramp = np.arange(8.0)[:, None]
    level, log_variance, rise, absolute, above, skewness = FEATURES['mean_statistics'](floor=1e-12)(
        WindowBatch(-ramp, RATE_HZ)
    )[0]
    assert (level, log_variance) == (pytest.approx(-3.5), pytest.approx(np.log(5.25)))
    assert (rise, absolute, above) == (pytest.approx(-6.0), pytest.approx(6.0), pytest.approx(0.5))
    assert skewness == pytest.approx(0.0, abs=1e-9)


def test_shares_of_the_load_are_the_same_however_hard_it_is_pressed():
    samples = np.random.default_rng(0).uniform(10.0, 20.0, (50, 3))
    soft, hard = (FEATURES['centred_log_ratio']()(WindowBatch(x, RATE_HZ)) for x in (samples, 3.0 * samples))
    np.testing.assert_allclose(soft, hard)
    assert soft.sum() == pytest.approx(0.0, abs=1e-12)


def test_bands_that_end_before_they_begin_are_refused():
    with pytest.raises(InvalidParameter, match='must be longer'):
        FEATURES['spatial_bands'](longest_m=1e-3, shortest_m=2e-3)


@pytest.mark.parametrize('speed', SPEEDS_M_S)
def test_the_array_reports_its_own_speed_on_a_surface_it_never_met(speed):
    trained = [(slide(0.04, surface=rough(seed)), RATE_HZ, 0.04) for seed in range(4)]
    tried = np.geomspace(0.01, 0.2, 200)
    for estimator in (ArraySpeedEstimator.fit(trained), ArraySpeedEstimator.from_positions(PLACES_M)):
        found = estimator(slide(speed, surface=rough(9)), RATE_HZ, tried)
        assert found == pytest.approx(speed, rel=0.05)


def test_positions_of_taxels_are_estimated_to_a_tenth_of_a_millimetre():
    training = ArraySpeedEstimator.fit([(slide(0.04, surface=rough(seed)), RATE_HZ, 0.04) for seed in range(4)])
    np.testing.assert_allclose(training.offsets_m, ArraySpeedEstimator.from_positions(PLACES_M).offsets_m, atol=2e-4)
    with pytest.raises(InvalidData, match='no slides'):
        ArraySpeedEstimator.fit([])


def test_the_any_speed_recipe_describes_a_window_live():
    features = FeatureSet.load('any-speed')
    assert features.topics == ('signal',)


def test_shares_keep_the_sign_and_leave_the_noise_of_free_taxels_out():
    shares = FEATURES['log_shares'](floor=0.01)
    calm, noisy = (shares(WindowBatch(np.tile([60.0, -40.0, free], (20, 1)), RATE_HZ))[:, 0] for free in (0.1, -0.1))
    np.testing.assert_allclose(calm - calm[2], [np.log(60 / 1.001), -np.log(40 / 1.001), 0.0], rtol=0.01)
    np.testing.assert_allclose(calm, noisy, atol=0.01)


@pytest.mark.parametrize('name', ['log_shares', 'relative_changes'])
def test_features_of_shares_are_the_same_however_hard_it_is_pressed(name):
    samples = np.random.default_rng(0).uniform(-10.0, 20.0, (50, 3))
    soft, hard = (FEATURES[name]()(WindowBatch(x, RATE_HZ)) for x in (samples, 3.0 * samples))
    np.testing.assert_allclose(soft, hard)


def test_relative_changes_do_not_know_which_level_a_taxel_has():
    samples = np.random.default_rng(0).normal(size=(50, 2))
    one, other = (FEATURES['relative_changes']()(WindowBatch(samples + x, RATE_HZ)) for x in ([90, 10], [10, 90]))
    np.testing.assert_allclose(one, other, rtol=1e-2)  # the same load in all
