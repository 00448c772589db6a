# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What must come out whatever the sensor: lines of ridges, exponents, power, and no harm from odd movements."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from texture_core.errors import InvalidParameter
from texture_simulation.contact import SkinContact
from texture_simulation.offline import simulate_slides
from texture_simulation.path import SimulatedSlide, Trajectory
from texture_simulation.scene import Scene, load_scene, scene_from
from texture_simulation.sensor_models import SENSORS
from texture_simulation.surfaces import MIN_BLUR_M, SIDE, Grating, PlaceVariation, Sandpaper, SelfAffine, Surface

PITCH_M = 1.5e-3
SPEEDS_M_S = (0.02, 0.05, 0.1, 0.2, 0.4)
ANGLES_RAD = (0.0, 0.4, 0.8, 1.2, -2.5)
ROUGH = {'kind': 'self_affine', 'rms_m': 1e-5, 'seed': 5}
FRICTIONS = ([], [{'kind': 'sliding_friction'}], [{'kind': 'stick_slip'}])
ALL_EFFECTS = ('uneven_motion', 'patch_growth', 'force_gain', 'unevenness', 'noise', 'dropouts')


def ridges(pitch_m: float = PITCH_M, **more: object) -> Scene:
    grating = {'kind': 'grating', 'pitch_m': pitch_m, 'depth_m': 4e-5}
    return scene_from('ridges', {'surfaces': {'ridges': [grating]}, **more})


@pytest.mark.parametrize('sensor', SENSORS)
def test_ridges_give_their_line_at_speed_over_pitch_at_all_speeds_and_angles(sensor: str) -> None:
    speed_m_s, angle_rad = np.array(list(itertools.product(SPEEDS_M_S, ANGLES_RAD))).T
    sliding = SimulatedSlide(speed_m_s, 2.0, 1.0, angle_rad)
    scene = ridges(sensor=sensor, effects={'patch_growth': {}, 'force_gain': {}})
    measured = simulate_slides(scene, 'ridges', len(speed_m_s), sliding, np.random.default_rng(0))[..., 0]
    measured = (measured - measured.mean(axis=1, keepdims=True)) * np.hanning(measured.shape[1])
    found_hz = np.abs(np.fft.rfft(measured, axis=1)).argmax(axis=1) * 1.0  # 1 s: bins of 1 Hz
    line_hz = speed_m_s * np.abs(np.cos(angle_rad)) / PITCH_M
    # Below, a slide of 1 s has hardly a period; above, a slow sensor filters the line out.
    clear = (line_hz > 3.0) & (line_hz < 0.3 * SENSORS[sensor].fast.rate_hz)
    assert clear.sum() >= (20 if 0.3 * SENSORS[sensor].fast.rate_hz > line_hz.max() else 5)
    assert np.abs(found_hz - line_hz)[clear].max() <= 1.0


@pytest.mark.parametrize('hurst', [0.2, 0.5, 0.9])
def test_random_roughness_falls_with_the_requested_exponent(hurst: float) -> None:
    roughs = [SelfAffine(hurst=hurst, longest_m=6e-3, shortest_m=2e-4, seed=seed) for seed in range(16)]
    heights = np.concatenate([rough.sharp() for rough in roughs])
    power = (np.abs(np.fft.rfft(heights, axis=1)) ** 2).mean(axis=0)  # along lines
    wave_1_m = np.fft.rfftfreq(SIDE, roughs[0].spacing_m)
    # Off the upper limit: a line there misses what slants across it.
    band = (wave_1_m > 1.2 / 6e-3) & (wave_1_m < 0.25 / 2e-4)
    slope = np.polyfit(np.log(wave_1_m[band]), np.log(power[band]), 1)[0]
    assert slope == pytest.approx(-(1 + 2 * hurst), abs=0.15)


def test_the_power_of_a_relief_is_the_same_in_place_and_in_frequency() -> None:
    for random in (SelfAffine(rms_m=2e-5), Sandpaper()):
        height = random.sharp()
        coefficients = np.fft.fft2(height) / SIDE**2
        assert (np.abs(coefficients) ** 2).sum() == pytest.approx(np.mean(height**2), rel=1e-9)
    assert SelfAffine(rms_m=2e-5).sharp().std() == pytest.approx(2e-5)


def test_half_of_the_sampling_rate_is_measured_little_and_what_would_be_folded_to_low_frequencies_not_at_all() -> None:
    rate_hz, pitch_m = 2000.0, 2e-3

    def measured(frequency_hz: float) -> float:
        touch = SkinContact(ridges(pitch_m), ridges(pitch_m).surface('ridges'), np.random.default_rng(0), rate_hz,
                      finger=0, batch_shape=())  # fmt: skip
        x_m = np.arange(4000) * frequency_hz * pitch_m / rate_hz
        path = Trajectory(x_m, np.zeros_like(x_m), np.ones_like(x_m))
        return float(touch.variation_n(touch.placed(path)).std())

    assert measured(1000.0) < 0.25 * measured(100.0)
    assert measured(1990.0) < 2e-3 * measured(100.0)


def test_what_a_contact_averages_weakens_ridges_as_the_gaussian_s_transfer_function() -> None:
    def measured(force_n: float) -> float:
        scene = ridges(sensor='pvdf', effects={'patch_growth': {}})
        return float(
            simulate_slides(scene, 'ridges', 1, SimulatedSlide(0.1, force_n, 2.0), np.random.default_rng(0)).std()
        )

    blur_m = 1.2e-4 * np.cbrt([1.0, 8.0])
    expected = np.exp(-0.5 * (2 * np.pi * blur_m / PITCH_M) ** 2)
    assert measured(8.0) / measured(1.0) == pytest.approx(expected[1] / expected[0], rel=0.01)


def odd_way(rate_hz: float, step_points: int) -> Trajectory:
    """Return a path that rests, moves, turns round, lifts off, jumps, touches again, and is pressed with nothing."""
    speed = [0.0, 0.1, -0.1, 0.1, 0.0, 0.3, 0.1, 0.0]
    force = [2.0, 2.0, 2.0, 0.0, 0.0, 5.0, 1e-9, 0.0]
    count = step_points * round(0.1 * rate_hz / step_points)
    x_m = np.cumsum(np.repeat(speed, count)) / rate_hz
    x_m[4 * count :] += 0.05  # put elsewhere in the air
    force_n = np.repeat(force, count)
    return Trajectory(x_m, np.zeros_like(x_m), force_n)


@pytest.mark.parametrize('friction', FRICTIONS)
@pytest.mark.parametrize('sensor', SENSORS)
def test_rest_reversal_lift_off_and_a_new_touch_do_no_harm(sensor: str, friction: list) -> None:
    effects = {name: {} for name in ALL_EFFECTS}
    content = {'sensor': sensor, 'surfaces': {'rough': [ROUGH, *friction]}, 'effects': effects}
    scene = scene_from('odd', content)
    kind = SENSORS[sensor]
    model = kind.make(scene, scene.surface('rough'), np.random.default_rng(0))
    path = odd_way(kind.path_rate_hz, kind.step_points)
    for samples in model.streams(path).values():
        assert np.isfinite(samples).all()


@pytest.mark.parametrize('friction', FRICTIONS)
@pytest.mark.parametrize('sensor', SENSORS)
def test_a_finger_in_the_air_or_at_rest_senses_nothing_however_long(sensor: str, friction: list) -> None:
    scene = scene_from('still', {'sensor': sensor, 'surfaces': {'rough': [ROUGH, *friction]}})
    kind = SENSORS[sensor]
    count = kind.step_points * round(0.5 * kind.path_rate_hz / kind.step_points)
    travelled_m, rest_m = 0.1 * np.arange(count) / kind.path_rate_hz, np.zeros(count)

    def largest_change(x_m: np.ndarray, force_n: float) -> float:
        model = kind.make(scene, scene.surface('rough'), np.random.default_rng(0), settled=True)
        measured = model.streams(Trajectory(x_m, rest_m, np.full(count, force_n)), slow=False)[kind.fast.topic]
        return float(np.ptp(measured[len(measured) // 2 :], axis=0).max())

    sliding = largest_change(travelled_m, 2.0)
    assert sliding > 0.0
    assert largest_change(travelled_m, 0.0) <= 1e-3 * sliding  # in the air
    assert largest_change(rest_m, 2.0) <= 1e-3 * sliding


SHARP = MIN_BLUR_M
PLACES = np.linspace(0.0, 0.2, 20_000)


def height(term, blur_m=SHARP, x_m=PLACES, y_m=0.0):
    return Surface('one', (term,)).height_m(x_m, np.full_like(x_m, y_m), np.full_like(x_m, blur_m))


def test_a_square_ridge_measured_sharply_is_as_high_and_as_wide_as_requested() -> None:
    measured = height(Grating(pitch_m=5e-3, depth_m=1e-4, shape='square', duty=0.3))
    assert np.median(measured[measured > 0]) - np.median(measured[measured < 0]) == pytest.approx(1e-4, rel=0.02)
    assert (measured > measured.mean()).mean() == pytest.approx(0.3, abs=0.02)


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


@pytest.mark.parametrize('sensor', SENSORS)
def test_a_path_in_blocks_is_measured_like_the_whole(sensor: str) -> None:
    scene = scene_from('blocks', {'sensor': sensor, 'surfaces': {'rough': [ROUGH]}})
    kind = SENSORS[sensor]
    steps = round(0.5 * kind.path_rate_hz / kind.step_points)
    x_m = 0.05 / kind.path_rate_hz * np.arange(steps * kind.step_points)
    path = Trajectory(x_m, np.zeros_like(x_m), np.full_like(x_m, 2.0))
    whole, pieces = (kind.make(scene, scene.surface('rough'), np.random.default_rng(3)) for _ in range(2))
    ends = kind.step_points * np.array([0, 1, steps // 7, steps // 2, steps])
    parts = [pieces.streams(path.at(slice(a, b))) for a, b in itertools.pairwise(ends.tolist())]
    for topic, samples in whole.streams(path).items():
        joined = np.concatenate([part[topic] for part in parts])
        # The blur sums as many harmonics as a block needs: not to the last bit the same.
        np.testing.assert_allclose(joined, samples, atol=0.05 * samples.std())
