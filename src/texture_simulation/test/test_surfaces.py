# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from texture_core.errors import InvalidParameter
from texture_simulation.offline import simulate_slides
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import load_scene
from texture_simulation.surfaces import MIN_BLUR_M, Grating, PlaceVariation, SelfAffine, Surface

SHARP = MIN_BLUR_M
PLACES = np.linspace(0.0, 0.2, 20_000)


def height(term, blur_m=SHARP, x_m=PLACES, y_m=0.0):
    return Surface('one', (term,)).height_m(x_m, np.full_like(x_m, y_m), np.full_like(x_m, blur_m))


def test_a_sine_is_blurred_by_the_gaussian_s_transfer_function() -> None:
    pitch_m, depth_m, blur_m = 2e-3, 1e-4, 4e-4
    measured = height(Grating(pitch_m, depth_m), blur_m)
    expected = depth_m / 2 * np.exp(-0.5 * (2 * np.pi * blur_m / pitch_m) ** 2)
    assert np.ptp(measured) / 2 == pytest.approx(expected, rel=1e-3)


def test_a_square_ridge_measured_sharply_is_as_high_and_as_wide_as_asked() -> None:
    measured = height(Grating(5e-3, 1e-4, shape='square', duty=0.3))
    assert np.median(measured[measured > 0]) - np.median(measured[measured < 0]) == pytest.approx(1e-4, rel=0.02)
    assert (measured > measured.mean()).mean() == pytest.approx(0.3, abs=0.02)


def test_sliding_along_the_ridges_meets_none() -> None:
    assert np.ptp(height(Grating(2e-3, 1e-4, angle_rad=np.pi / 2))) < 1e-12


def test_random_roughness_has_its_rms_and_its_waves() -> None:
    rough = SelfAffine(rms_m=1e-5, longest_m=4e-3, shortest_m=5e-4)
    x_m, y_m = (np.random.default_rng(0).uniform(0, 1, 50_000) for _ in range(2))
    measured = height(rough, x_m=x_m, y_m=y_m)
    assert measured.std() == pytest.approx(1e-5, rel=0.15)  # the least blur takes some of it
    line = height(rough)
    power = np.abs(np.fft.rfft(line * np.hanning(len(line)))) ** 2
    wave = np.fft.rfftfreq(len(line), PLACES[1] - PLACES[0])
    assert power[wave > 1.3 / rough.shortest_m].sum() < 0.01 * power.sum()


def test_waves_that_do_not_fit_a_tile_are_refused() -> None:
    with pytest.raises(InvalidParameter, match='at most 32 times'):
        SelfAffine(longest_m=0.05, shortest_m=1e-4)


def test_a_varying_sample_is_itself_at_the_same_place_and_another_elsewhere():
    scene = load_scene('varying').without('noise')

    def slide(x_m):
        sliding = SimulatedSlide(0.05, 2.0, 1.0, start_x_m=x_m)
        return simulate_slides(scene, 'suede', 1, sliding, np.random.default_rng())[0, :, 0]

    first, again, other = slide(0.0), slide(0.0), slide(0.08)
    assert np.abs(first - again).max() <= 1.0  # counts: the sample lies still, whatever the random numbers
    assert np.abs(first - other).max() > 100.0


def test_the_level_of_a_sample_varies_slowly_by_the_strength_of_its_variation():
    x_m, blur_m = np.linspace(0.0, 1.0, 20_000), np.full(1, 1e-4)
    terms = (Grating(pitch_m=1e-3, depth_m=1e-4),)
    height = {
        strength: Surface('s', terms, variation=PlaceVariation(strength=strength)).height_m(x_m, 0.0 * x_m, blur_m)
        for strength in (0.0, 1.0)
    }
    assert height[0.0] == pytest.approx(Surface('s', terms).height_m(x_m, 0.0 * x_m, blur_m), abs=1e-12)
    levels = np.log(height[1.0].reshape(200, 100).std(axis=1))  # of 5 mm each
    assert 0.15 < levels.std() < 0.6
    assert np.corrcoef(levels[1:], levels[:-1])[0, 1] > 0.5  # from one to the next it hardly changes
